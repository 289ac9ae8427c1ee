"""A campaign of a hundred thousand runs: how much of it is arithmetic, what Basilisk takes for such runs, and its memory.

Each run flies the scenario three-laws under the law lyapunov for 600 s, 6000 control periods, from an attitude and a rate of
its own. Three things take turns on all threads: the kernel alone, from states in memory to states in memory; the campaign,
from the scenario to files on disk, with all that it finds out; and Basilisk's Monte Carlo controller, which flies as many
runs as fit into some seconds. Basilisk's law is the nearest that it has, and cheaper, see basilisk_campaign.py; that
starhold reaches the same states under that law is checked first. Basilisk's own way of keeping data sleeps for a second a
run: it stands in the table, for it is what a user meets, but the ratios are to the way without.

A micro-satellite on four wheels with a gyro and a star tracker then flies for five minutes ten thousand times: with the rate
at the start drawn alone, and with inertia, the gyro's scale, the axes of the wheels and their friction. What the second
takes more is what numbers cost that differ from run to run, their preparation included.

The fastest round counts, by the clock on the wall. Then ten times as many runs fly once, alone in a process, for the memory.

Run: python benchmarks/campaign.py    (Basilisk is left out where `bsk` is not installed)
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import common
from common import DURATION, FAST, SLOW, header, interleaved, show
from starhold.algebra.structure import flatten
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.effectors.layouts import pyramid
from starhold.simulation.lanes import simulate_many

RUNS, MANY, CRAFTS = 100_000, 1_000_000, 10_000
STEPS = round(DURATION / common.PERIOD)
ROUNDS = 3
BUDGET, RETAINED, CHECKED = 20.0, 8, 4
"""Seconds of a round of Basilisk's, runs that it keeps by its own policies, runs whose ends are compared."""
KERNEL, CAMPAIGN = "starhold, kernel alone", "starhold, campaign"
BASILISK, RETAINING = "Basilisk, Monte Carlo controller", "Basilisk, keeping by its own policies"
START = {"initial.rate": {"distribution": "shell", "high": "0.5 deg/s"}}
SHARE = {"distribution": "normal", "sigma": "3 %", "relative": True}
HARDWARE = {
    "spacecraft.inertia": SHARE,
    "part.gyro.scale_error": {"distribution": "normal", "sigma": "0.1 %"},
    "wheels.viscous": SHARE,
    "wheels.coulomb": SHARE,
    **{f"wheel[{k}].axis": {"distribution": "normal", "sigma": 0.005} for k in (1, 2, 3, 4)},
}
"""What is drawn of a craft for the last comparison."""
APART = 1e-9
"""By how much the ends may differ: rad, rad/s, relative. Measured: 1e-14."""


def loop() -> ClosedLoop:
    """The published experiment under the law lyapunov."""
    law = catalogue()["lyapunov"]
    return common.problem(law, law.examples()[0], common.PUBLISHED, torque_limit=0.01, limit="axis")


def starts(lanes: int) -> NDArray[np.float64]:
    """States (numbers, lanes): attitudes uniform over all rotations, rates of any direction with magnitudes in a range."""
    random = np.random.default_rng(1)
    states = np.repeat(np.array(flatten(common.PUBLISHED))[:, None], lanes, axis=1)
    for rows, length in ((slice(0, 4), 1.0), (slice(4, 7), random.uniform(SLOW, FAST, lanes))):
        ways = random.normal(size=(rows.stop - rows.start, lanes))
        states[rows] = ways / np.linalg.norm(ways, axis=0) * length
    return states


def starhold_campaign(runs: int) -> float:
    """Seconds of a campaign, from the scenario's name to files on disk."""
    import starhold as sh

    with TemporaryDirectory() as folder:
        began = time.perf_counter()
        scenario = sh.load("three-laws").with_({"simulation.duration": f"{DURATION} s"})
        over = {
            "initial.attitude": {"distribution": "rotations"},
            "initial.rate": {"distribution": "shell", "low": f"{SLOW} rad/s", "high": f"{FAST} rad/s"},
        }
        sh.campaign(scenario, runs=runs, over=over, law="lyapunov", folder=Path(folder, "campaign"))
        return time.perf_counter() - began


def craft_campaign(runs: int, over: dict[str, Any]) -> None:
    """A campaign of a craft on wheels in which this is drawn."""
    import starhold as sh

    changes = {
        "simulation.duration": "5 min",
        "wheels.layout": None,
        "wheels.viscous": 1e-6,
        "wheels.coulomb": 1e-5,
        "wheel": [{"axis": axis} for axis in pyramid()],
        "part": [{"type": "gyro", "noise": 1e-6}, {"type": "star-tracker", "cross": "5 arcsec", "roll": "30 arcsec"}],
    }
    with TemporaryDirectory() as folder:
        scenario = sh.load("wheels-orbital").with_(changes)
        sh.campaign(scenario, runs=runs, over=over, law="wheel", folder=Path(folder, "campaign"), search=False)


def measure_dispersions(runs: int) -> None:
    """Let campaigns of rates and of hardware take turns and print their ratio."""
    tasks = {"rates": lambda: craft_campaign(runs, START), "hardware": lambda: craft_campaign(runs, HARDWARE)}
    wall = {name: spent.wall for name, spent in interleaved(tasks, ROUNDS).items()}
    rows = [[name, str(runs), f"{seconds:.2f}", f"{seconds / runs * 1e6:.1f}"] for name, seconds in wall.items()]
    show(["drawn", "runs", "s", "us a run"], rows)
    print(f"Hardware drawn / rates alone: {wall['hardware'] / wall['rates']:.2f}")


def peak_of(runs: int) -> tuple[float, float]:
    """Seconds of a campaign, and the peak memory (GB) of the process that does nothing else."""
    command = [sys.executable, __file__, "--alone", str(runs)]
    said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    seconds, memory = map(float, said.split())
    return seconds, memory


def memory() -> float:
    """The peak memory of this process so far, in GB."""
    status = Path("/proc/self/status")
    if status.exists():
        # A child inherits ru_maxrss of the process that started it; VmHWM is its own.
        found = next(line for line in status.read_text(encoding="ascii").splitlines() if line.startswith("VmHWM"))
        return float(found.split()[1]) * 1024 / 1e9
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9


def gap_to_basilisk(basilisk: Any, threads: int) -> float:
    """The largest difference between the ends of Basilisk's runs and ours from the same starts under the same law."""
    flights = basilisk.ends(CHECKED, threads)
    same = common.problem(common.CANCELLING, basilisk.GAINS, sign_policy="shortest")
    ours = simulate_many(same, [start for start, _ in flights], STEPS, threads=threads)
    return max(max(common.gap(ours.state(run), end)) for run, (_, end) in enumerate(flights))


def measure(runs: int, threads: int, budget: float) -> None:
    """Let the three take turns and print their table; budget: seconds of a round of Basilisk's."""
    flown, states = loop(), starts(runs)
    tasks: dict[str, Callable[[], Any]] = {
        KERNEL: lambda: simulate_many(flown, states, STEPS, threads=threads),
        CAMPAIGN: lambda: starhold_campaign(runs),
    }
    counts = {KERNEL: runs, CAMPAIGN: runs}
    others: dict[str, tuple[int, float]] = {}
    if importlib.util.find_spec("Basilisk") is not None:
        import basilisk_campaign as basilisk

        apart = gap_to_basilisk(basilisk, threads)
        verdict = "one problem" if apart < APART else "DIFFERENT"
        print(f"Ends of {CHECKED} runs under Basilisk's law, here and there: {apart:.0e} apart, {verdict}\n")
        others[RETAINING] = RETAINED, basilisk.fly(RETAINED, threads, retain=True)
        counts[BASILISK], _ = basilisk.measure(budget, threads)
        tasks[BASILISK] = lambda: basilisk.fly(counts[BASILISK], threads)
    times = interleaved(tasks, ROUNDS)
    seconds = {name: (counts[name], spent.wall) for name, spent in times.items()} | others
    each = {name: wall / count for name, (count, wall) in seconds.items()}
    rows = [
        [name, str(count), f"{wall:.2f}", f"{each[name] * 1e6:.1f}", f"{each[name] / each[CAMPAIGN]:.3g}"]
        for name, (count, wall) in seconds.items()
    ]
    show([f"{threads} threads", "runs", "s", "us a run", "of the campaign's"], rows)
    print(f"Campaign / kernel alone: {each[CAMPAIGN] / each[KERNEL]:.2f}")
    if BASILISK in each:
        whole, alone = (each[BASILISK] / each[name] for name in (CAMPAIGN, KERNEL))
        print(f"Basilisk / starhold: campaign {whole:.0f}, kernel alone {alone:.0f}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a hundredth of the runs, to see that it works")
    parser.add_argument("--alone", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.alone:
        print(starhold_campaign(given.alone), memory())
        return
    share = 100 if given.quick else 1
    print(header("bsk"))
    measure(RUNS // share, os.cpu_count() or 1, BUDGET / (10 if given.quick else 1))
    measure_dispersions(CRAFTS // share)
    seconds, peak = peak_of(MANY // share)
    print(f"{MANY // share} runs, campaign: {seconds:.1f} s, {peak:.2f} GB at the peak")


if __name__ == "__main__":
    main()
