"""The cost of a law's calls along a flight, in processor time and operations."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.cost import CALLS, Replay, recorded_states
from starhold.loop.kernels import Numbers, make_step
from starhold.loop.programs import replay
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.verdicts import Finding
from starhold.trace.bounds import work

PASSES = 3
WINDOW = 2000
"""The number of calls, from the start on, for the mean: those of 200 s, in which predictive control reaches the target."""
SHOWN = (0.8, 700.0)
"""The range of horizons in a figure."""


class Timed(NamedTuple):
    """A law whose calls are timed: its scenario file and name, the number of calls timed at once, and that of all calls."""

    file: str
    law: str
    chunk: int
    calls: int


TIMED = {
    "lyapunov": Timed("three-laws", "lyapunov", 100, 6000),
    "sliding": Timed("three-laws", "sliding", 100, 6000),
    "N = 10": Timed("three-laws", "mpc", 20, 6000),
    "N = 150": Timed("printed-functional", "N 150", 10, WINDOW),
    "N = 300": Timed("printed-functional", "N 300", 10, WINDOW),
    "N = 500": Timed("printed-functional", "N 500", 10, WINDOW),
}


def call_times(desk: Desk) -> dict[str, NDArray[np.float64]]:
    """Return the processor time (s) per call in each chunk of the first calls of a flight, (chunks,) by the names of TIMED:
    the minimum over several passes, in which the laws alternate."""

    def make() -> dict[str, NDArray[np.float64]]:
        times: dict[str, NDArray[np.float64]] = {}
        kernels: dict[str, Replay] = {}
        for name, (file, law, chunk, calls) in TIMED.items():
            loop = desk.loop(file, law)
            kernels[name] = Replay(loop, recorded_states(loop, desk.recording(file, law)))
            times[name] = np.full(calls // chunk, np.inf)
        empty = dict.fromkeys(TIMED, np.inf)
        for _ in range(PASSES):
            for name, kernel in kernels.items():
                chunk = TIMED[name].chunk
                empty[name] = min([empty[name], *(kernel.timed(0, 0) for _ in range(20))])
                for number in range(len(times[name])):
                    times[name][number] = min(times[name][number], kernel.timed(number * chunk, (number + 1) * chunk))
        # Both are least before one is taken from the other: an empty call in a slow moment would make a call too short.
        return {name: np.maximum(spent - empty[name], 1e-9) / TIMED[name].chunk for name, spent in times.items()}

    return desk.once(("call times",), make)


def mean_time(desk: Desk, name: str) -> float:
    """The mean time of a call (s) over the window."""
    return float(call_times(desk)[name][: WINDOW // TIMED[name].chunk].mean())


def ratio(desk: Desk, name: str) -> float:
    """The mean duration of a call divided by that of the Lyapunov law."""
    return mean_time(desk, name) / mean_time(desk, "lyapunov")


def total_time(desk: Desk, name: str) -> Finding:
    """The time of 50 000 calls (s)."""
    return Finding(CALLS * mean_time(desk, name))


def time_ratio(desk: Desk, name: str) -> Finding:
    """Return the time of a law's call divided by that of a Lyapunov call."""
    return Finding(ratio(desk, name))


def time_cases(desk: Desk, names: Sequence[str], least: float, most: float = float("inf")) -> Finding:
    """Return for each law whether a call takes between `least` and `most` times as long as one of the Lyapunov law."""
    ratios = {name: ratio(desk, name) for name in names}
    note = ", ".join(f"{name} {value:.2g} times" for name, value in ratios.items())
    return Finding({name: least < value < most for name, value in ratios.items()}, note)


def operations(desk: Desk, law: str, gravity: bool) -> int:
    """Return the number of additions, multiplications, divisions and roots in one call, from the measured state to the
    limited torque; gravity: whether there is a gravity torque, which a law may have to compute."""
    loop = desk.loop("three-laws", law, None if gravity else {"environment.gravity_gradient": False})
    program = replay(make_step(loop.composition()), loop.carry(), Numbers.of(loop.phases(1)[0]))
    return work(program, {"first": 0, "count": 1}).work.arithmetic


def operations_ratio(desk: Desk) -> Finding:
    """Return the number of operations in a sliding call as a share of those in a Lyapunov call."""
    sliding, lyapunov = operations(desk, "sliding", True), operations(desk, "lyapunov", True)
    return Finding(sliding / lyapunov, f"{sliding} operations by {lyapunov}")


def fewer_operations(desk: Desk, law: str, than: str, factor: float = 1.0) -> Finding:
    """Return whether a call of a law does fewer operations than `factor` times another's: with and without the gravity
    model, which some laws have to compute."""
    cases = {"gravity model counted": True, "gravity model not counted": False}
    counted = {name: (operations(desk, law, gravity), operations(desk, than, gravity)) for name, gravity in cases.items()}
    note = "; ".join(f"{name}: {mine} and {other} operations" for name, (mine, other) in counted.items())
    return Finding({name: mine < factor * other for name, (mine, other) in counted.items()}, note)


def call_figure(desk: Desk, names: Mapping[str, str], unit: str = "ns", scale: float = 1e9) -> Figure:
    """Return a figure of the time per call over the time of the flight; names: labels by the names of TIMED."""
    times = call_times(desk)
    alone, curves = len(names) == 1, list[Curve]()
    for name, label in names.items():
        middle = 0.1 * TIMED[name].chunk * (np.arange(len(times[name])) + 0.5)
        curves.append(Curve(middle, scale * times[name], label, "line" if alone else "steps"))
    # Other work on the machine causes spikes.
    span = (0.0, 1.5 * float(np.quantile(curves[0].y, 0.95))) if alone else None
    return Figure([Panel("time, s", f"time of a call, {unit}", curves, y_span=span, log_y=not alone)])


def horizon_figure(desk: Desk, weighted: Mapping[str, Any], printed: Mapping[str, Any], published: float) -> Figure:
    """Return a figure, over the horizon, of the steps to stay within 10^-3 and of the time per call relative to a Lyapunov
    call: with a terminal weight and with the functional as printed. Both arguments map horizons to [file, law]."""
    groups = {"with terminal weight": weighted, "as printed": printed}
    steps: list[Curve] = []
    times: list[Curve] = []
    for hue, (name, flights) in enumerate(groups.items()):
        horizons = np.array([float(n) for n in flights])
        reached = [desk.flight(*flight).metrics["iterations_1e-3"] for flight in flights.values()]
        steps.append(Curve(horizons, [np.nan if n is None else n for n in reached], name, "points", hue))
        known = [n for n in flights if f"N = {n}" in TIMED]
        times.append(Curve([float(n) for n in known], [ratio(desk, f"N = {n}") for n in known], name, "points", hue))
    lyapunov = float(desk.flight("three-laws", "lyapunov").metrics["iterations_1e-3"])
    return Figure(
        [
            Panel("horizon N", "steps to stay within 10^-3", steps, x_span=SHOWN, log_x=True, levels=[lyapunov],
                  notes=[(8.0, 0.95 * lyapunov, "Lyapunov law")]),
            Panel("horizon N", "time of a call / Lyapunov law's", times, x_span=SHOWN, log_x=True, log_y=True,
                  levels=[published], notes=[(30.0, 0.75 * published, "published totals")]),
        ],
        columns=2,
    )  # fmt: skip
