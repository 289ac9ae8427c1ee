"""What the benchmarks share: the machine in words, fair timing, tables, and one problem stated for several engines.

The problem is the published spacecraft (J = 2, 3, 4 kg m2, low orbit, gravity gradient, torque held for 0.1 s,
classical Runge-Kutta) under Basilisk's feedback on modified Rodrigues parameters: that law is the one both programs can
fly with compiled code alone. `tests/oracles/test_basilisk.py` holds that they agree.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.vector import ZERO, Vector, add, gyroscopic_torque
from starhold.laws import mrp
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.interface import Card, Measurement, NoMemory
from starhold.laws.mrp import Gains
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import fit
from starhold.parts.craft import EARTH, Craft, make_craft
from starhold.trace.machine import is_wide

PERIOD = 0.1
ORBIT = (fit("environment", "two-body"), fit("environment", "gravity-gradient"))
NOISE = (fit("environment", "random-torque", 1e-3), fit("sensor", "gaussian", 1e-3, 1e-3))
INERTIA = (2.0, 3.0, 4.0)
PUBLISHED = State((0.0, *(3.0**-0.5,) * 3), (0.04, 0.03, 0.02), (7e6, 0.0, 0.0), (0.0, 7550.0, 0.0), ZERO)
"""The published start. It is half a turn from the target, where the two sets of Rodrigues parameters meet."""
START = PUBLISHED._replace(attitude=(0.01, 0.4, 0.7, 0.3499**0.5))
"""A start just short of half a turn, which the rate carries past it."""

DURATION, SLOW, FAST = 600.0, 0.02, 0.07
"""A campaign's runs: their length (s), and the least and largest magnitude of the rate at the start (rad/s)."""


def header(*packages: str) -> str:
    """The machine and the versions, for the top of a report."""
    names = ("starhold", "llvmlite", "numpy", *packages)
    versions = ", ".join(f"{name} {_version(name)}" for name in names)
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return f"{_processor()}, {os.cpu_count()} threads, {system}\n{versions}\n"


def _processor() -> str:
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text(encoding="utf-8").splitlines() if facts.exists() else []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or "unknown processor")


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        import starhold

        return starhold.__version__ if name == "starhold" else "not installed"


def verdict(met: bool, goal: float, wide: bool = False) -> str:
    """What to say of a goal. One that was set with registers of 512 bits (`wide`) is not missed without them."""
    if met:
        return f"meets {goal:g}"
    return f"MISSES {goal:g}" if is_wide() or not wide else f"not {goal:g}, set with AVX-512"


class Spent(NamedTuple):
    """Least seconds of a task: by the clock on the wall, and by the processor's work for this process."""

    wall: float
    work: float


def interleaved(tasks: Mapping[str, Callable[[], Any]], repeats: int = 7) -> dict[str, Spent]:
    """The least time of each task in `repeats` rounds, after one untimed call of each.

    The tasks take turns, so what the machine does meanwhile falls on all alike: compare figures of one call of this
    function, never of two. Of a task on one thread take `work`, which leaves out the time it waits for a processor.
    """
    times: dict[str, list[Spent]] = {name: [] for name in tasks}
    for task in tasks.values():
        task()
    for _ in range(repeats):
        for name, task in tasks.items():
            wall, work = time.perf_counter(), time.process_time()
            task()
            times[name].append(Spent(time.perf_counter() - wall, time.process_time() - work))
    return {name: Spent(min(t.wall for t in spent), min(t.work for t in spent)) for name, spent in times.items()}


def show(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table: the first column to the left, the others to the right."""
    widths = [max(len(line[i]) for line in (heads, *rows)) for i in range(len(heads))]
    for line in (heads, ["-" * width for width in widths], *rows):
        cells = [cell.rjust(width) for cell, width in zip(line, widths, strict=True)]
        print("  ".join([line[0].ljust(widths[0]), *cells[1:]]))
    print()


def cancelling(seen: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """The feedback, and w x Jw cancelled."""
    torque, memory = mrp.torque(seen, gains, craft, memory)
    return add(torque, gyroscopic_torque(craft.inertia, seen.body_rate)), memory


def steady(seen: Measurement, gains: Vector, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """A constant torque, no control at all."""
    return gains, memory


def as_law(name: str, torque: Callable[..., Any]) -> Law:
    """A law of a function alone, of which nothing is claimed."""
    card = Card(title=name, summary="", sources=(), assumptions=(), claims="none")
    module = ModuleType(name)
    vars(module).update(CARD=card, torque=torque)
    return Law(name, module)


FEEDBACK = catalogue()["mrp"]
FEEDBACK_GAINS = Gains(k_rate=0.09, k_attitude=0.036)
CANCELLING = as_law("cancelling", cancelling)
STEADY = as_law("steady", steady)
STEADY_TORQUE: Vector = (1e-4, -2e-4, 1.5e-4)


def problem(law: Law, gains: Any, start: State = START, **options: Any) -> ClosedLoop:
    """The closed loop of a law on the problem; without further options the torque is not limited."""
    craft = make_craft(INERTIA, options.pop("torque_limit", np.inf))
    around = {"parts": ORBIT, "limit": "none"}
    return ClosedLoop(craft, law, gains, start, PERIOD, **(around | options))


FEEDBACK_LOOP = problem(FEEDBACK, FEEDBACK_GAINS, sign_policy="shortest")
STEADY_LOOP = problem(STEADY, STEADY_TORQUE)


def gap(a: State, b: State) -> tuple[float, float, float]:
    """How far two states are apart: attitude (rad), rate (rad/s), position relative to the distance."""
    one, other = np.array(a.attitude), np.array(b.attitude)
    # The chord between the unit quaternions; the arc cosine of their product would lose half the digits.
    chord = np.linalg.norm(one - other if one @ other >= 0.0 else one + other)
    angle = 4.0 * np.arcsin(0.5 * chord)
    rate = float(np.abs(np.array(a.rate) - b.rate).max())
    away = float(np.linalg.norm(np.array(a.position) - b.position) / np.linalg.norm(a.position))
    return float(angle), rate, away


def in_basilisk(control: str, start: State = START) -> Callable[[int], State]:
    """The problem in Basilisk; the result flies it for a number of steps from where it was and gives the state.

    control: "feedback" (Basilisk's own flight-software modules), or "steady" (a constant torque, no flight software). The
    models run in such an order that the torque of a state is held from that instant on.
    """
    simulation, body, actuator, kept = body_in_basilisk(start)
    tick = round(PERIOD * 1e9)
    if control == "feedback":
        kept += flight_software(simulation, body, actuator, FEEDBACK_GAINS)
    else:
        actuator.extTorquePntB_B = [[x] for x in STEADY_TORQUE]
    simulation.AddModelToTask("task", actuator)
    simulation.InitializeSimulation()
    done = 0

    def fly(steps: int) -> State:
        nonlocal done
        done += steps
        simulation.ConfigureStopTime(done * tick)
        simulation.ExecuteSimulation()
        return state_in_basilisk(body)

    return fly


def state_in_basilisk(body: Any) -> State:
    """Where a body of Basilisk's is now."""
    now = body.scStateOutMsg.read()
    rate, position, velocity = (tuple(x) for x in (now.omega_BN_B, now.r_CN_N, now.v_CN_N))
    return State(as_quaternion(now.sigma_BN), rate, position, velocity, ZERO)


def body_in_basilisk(start: State) -> tuple[Any, Any, Any, list[Any]]:
    """The body on its orbit under the gravity gradient: simulation, body, its actuator, which is in no task yet, and what
    has to be kept as long as they fly, for Basilisk's models hold each other by bare pointers."""
    from Basilisk.simulation import GravityGradientEffector, extForceTorque, spacecraft
    from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody

    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(PERIOD)))

    body = spacecraft.Spacecraft()
    body.ModelTag = "body"
    body.hub.mHub = 100.0
    body.hub.IHubPntBc_B = np.diag(INERTIA).tolist()
    body.hub.r_CN_NInit, body.hub.v_CN_NInit = list(start.position), list(start.velocity)
    body.hub.sigma_BNInit = [[x / (1.0 + start.attitude[0])] for x in start.attitude[1:]]
    body.hub.omega_BN_BInit = [[x] for x in start.rate]
    simulation.AddModelToTask("task", body)

    factory = simIncludeGravBody.gravBodyFactory()
    earth = factory.createEarth()
    earth.mu, earth.isCentralBody = EARTH, True
    factory.addBodiesTo(body)
    gradient = GravityGradientEffector.GravityGradientEffector()
    gradient.ModelTag = "gradient"
    gradient.addPlanetName(earth.planetName)
    body.addDynamicEffector(gradient)
    simulation.AddModelToTask("task", gradient)
    actuator = extForceTorque.ExtForceTorque()
    body.addDynamicEffector(actuator)

    return simulation, body, actuator, [body, factory, earth, gradient, actuator]


def as_quaternion(sigma: Sequence[float]) -> Quaternion:
    """The quaternion of modified Rodrigues parameters."""
    s = np.array(sigma)
    square = float(s @ s)
    v = (2.0 * s / (1.0 + square)).tolist()
    return ((1.0 - square) / (1.0 + square), v[0], v[1], v[2])


def flight_software(simulation: Any, body: Any, actuator: Any, gains: Gains, gyroscopic: bool = False) -> list[Any]:
    """Basilisk's own modules of the feedback on modified Rodrigues parameters; gyroscopic: w x Jw is cancelled too."""
    from Basilisk.architecture import messaging
    from Basilisk.fswAlgorithms import attTrackingError, inertial3D, mrpFeedback
    from Basilisk.simulation import simpleNav

    sensor = simpleNav.SimpleNav()
    sensor.scStateInMsg.subscribeTo(body.scStateOutMsg)
    goal = inertial3D.inertial3D()
    goal.sigma_R0N = [0.0, 0.0, 0.0]
    error = attTrackingError.attTrackingError()
    error.attNavInMsg.subscribeTo(sensor.attOutMsg)
    error.attRefInMsg.subscribeTo(goal.attRefOutMsg)
    law = mrpFeedback.mrpFeedback()
    law.guidInMsg.subscribeTo(error.attGuidOutMsg)
    law.K, law.P, law.Ki = gains.k_attitude, gains.k_rate, -1.0
    law.controlLawType = int(gyroscopic)
    known = messaging.VehicleConfigMsgPayload()
    known.ISCPntB_B = np.diag(INERTIA).ravel().tolist()
    told = messaging.VehicleConfigMsg().write(known)
    law.vehConfigInMsg.subscribeTo(told)
    actuator.cmdTorqueInMsg.subscribeTo(law.cmdTorqueOutMsg)
    for model in (sensor, goal, error, law):
        simulation.AddModelToTask("task", model)
    return [sensor, goal, error, law, told]
