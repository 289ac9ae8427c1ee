"""A campaign as Basilisk flies it: its own Monte Carlo controller, its own pool of processes, its own compiled modules.

The problem is that of the scenario three-laws under the law lyapunov, for 600 s, from random attitudes and rates. Basilisk
has no compiled module of that law. The nearest is `mrpFeedback`, w x Jw cancelled and with the same stiffness near the
target; it knows neither a torque limit nor the gravity gradient, so that Basilisk is asked for a little less than starhold.

The controller's retention policies sleep for a whole second after each run, whatever they keep. So none is set: the
function that executes a run, which is the user's, writes the state in which it ends. `retain` sets one all the same.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import Any

import numpy as np
from Basilisk.utilities.MonteCarlo.Controller import Controller
from Basilisk.utilities.MonteCarlo.Dispersions import VectorVariableDispersion
from Basilisk.utilities.MonteCarlo.RetentionPolicy import RetentionPolicy

from common import DURATION, FAST, PUBLISHED, SLOW, as_quaternion, body_in_basilisk, flight_software, state_in_basilisk
from starhold.algebra.structure import flatten, unflatten
from starhold.laws.pd import Gains
from starhold.parts.bodies.rigid_body import State

GAINS = Gains(k_rate=0.09, k_attitude=0.018)
"""Those of the law lyapunov, for the Rodrigues parameters are half of the quaternion's vector part near the target."""
CALIBRATION = 8


Spread: Any = VectorVariableDispersion
"""Its `generate` returns a vector, but is declared to return nothing."""


class Rotations(Spread):
    """Attitudes, uniform over all rotations."""

    def generate(self, sim: Any = None) -> list[float]:
        """Return Rodrigues parameters of length 1 at most."""
        q = np.random.normal(size=4)  # noqa: NPY002 the controller seeds this generator, run by run
        q /= np.copysign(np.linalg.norm(q), q[0])
        return (q[1:] / (1.0 + q[0])).tolist()


class Shell(Spread):
    """Vectors of any direction, with a magnitude uniform between the bounds."""

    def generate(self, sim: Any = None) -> list[float]:
        """Return a vector."""
        way = np.random.normal(size=3)  # noqa: NPY002
        return (way / np.linalg.norm(way) * np.random.uniform(*self.bounds)).tolist()  # noqa: NPY002


def create() -> Any:
    """Set up the simulation of one run, which the controller then disperses."""
    simulation, body, actuator, kept = body_in_basilisk(PUBLISHED)
    kept += flight_software(simulation, body, actuator, GAINS, gyroscopic=True)
    simulation.AddModelToTask("task", actuator)
    simulation.body, simulation.kept = body, kept
    return simulation


def execute(simulation: Any) -> None:
    """Fly one run."""
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(round(DURATION * 1e9))
    simulation.ExecuteSimulation()


def execute_and_write(simulation: Any, name: str) -> None:
    """Fly one run and write where it ended; the controller gives a name to a function that asks for one."""
    execute(simulation)
    Path(f"{name}.end").write_bytes(np.array(flatten(state_in_basilisk(simulation.body))).tobytes())


def end_of(simulation: Any) -> dict[str, Any]:
    """What a retention policy keeps of a run: time and state at its end."""
    return {"end": np.array([[DURATION, *flatten(state_in_basilisk(simulation.body))]])}


def fly(runs: int, threads: int = 2, retain: bool = False) -> float:
    """Seconds of a campaign. retain: by a retention policy of Basilisk's, see above."""
    with TemporaryDirectory() as folder:
        return _fly(runs, threads, retain, Path(folder, "archive"))[1]


def measure(budget: float, threads: int = 2) -> tuple[int, float]:
    """As many runs as fit into so many seconds, and the seconds that they took."""
    few = CALIBRATION * threads
    runs = max(few, int(budget / fly(few, threads) * few))
    return runs, fly(runs, threads)


def ends(runs: int, threads: int = 2) -> list[tuple[State, State]]:
    """Where each run of a campaign begins and ends."""
    with TemporaryDirectory() as folder:
        archive = Path(folder, "archive")
        controller, _ = _fly(runs, threads, False, archive)
        return [(_start(controller.getParameters(run)), _end(archive / f"run{run}.end")) for run in range(runs)]


def _start(parameters: dict[str, str]) -> State:
    sigma, rate = (json.loads(parameters[f"body.hub.{name}"]) for name in INITIAL)
    return PUBLISHED._replace(attitude=as_quaternion(sigma), rate=tuple(rate))


def _end(file: Path) -> State:
    return unflatten(np.frombuffer(file.read_bytes()).tolist(), PUBLISHED)


INITIAL = ("sigma_BNInit", "omega_BN_BInit")


def _fly(runs: int, threads: int, retain: bool, archive: Path) -> tuple[Controller, float]:
    attitude, rate = (f"body.hub.{name}" for name in INITIAL)
    controller = Controller()
    controller.setSimulationFunction(create)
    controller.setExecutionFunction(execute if retain else execute_and_write)
    controller.addDispersion(Rotations(attitude, None))
    controller.addDispersion(Shell(rate, (SLOW, FAST)))
    controller.setExecutionCount(runs)
    controller.setThreadCount(threads)
    controller.setShowProgressBar(False)
    controller.setArchiveDir(str(archive))
    if retain:
        policy = RetentionPolicy()
        policy.addRetentionFunction(end_of)
        controller.addRetentionPolicy(policy)
    with quiet() as said:
        # Imports Basilisk's modules once, here. Else each process would, and the controller starts new ones all along.
        create()
        began = time.perf_counter()
        failed = controller.executeSimulations()
        seconds = time.perf_counter() - began
        found = len(list(archive.glob("run*.data" if retain else "run*.end")))
    if failed or found != runs:
        raise RuntimeError(f"of {runs} runs Basilisk failed in {failed} and kept {found}:\n{''.join(said)}")
    return controller, seconds


@contextmanager
def quiet() -> Iterator[list[str]]:
    """Take what this process and its children print, compiled code included; the list holds it afterwards."""
    said: list[str] = []
    sys.stdout.flush()
    sys.stderr.flush()
    out, err = os.dup(1), os.dup(2)
    with TemporaryFile("w+", encoding="utf-8", errors="replace") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
        try:
            yield said
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os.dup2(out, 1)
            os.dup2(err, 2)
            os.close(out)
            os.close(err)
            file.seek(0)
            said.append(file.read())
