"""Closed loops in few words, for tests."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import find, fit
from starhold.parts.craft import EARTH, make_craft
from starhold.parts.effectors.wheels import ALLOCATIONS
from starhold.parts.effectors.wheels import State as Rotors
from starhold.parts.part import Fitted
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lane import Recording, fly, label

ORBIT = (fit("environment", "two-body"), fit("environment", "gravity-gradient"))
ORBITAL = fit("target", "orbital")
HUB = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]])
"""An inertia (kg m2) with products."""


def hub(
    *parts: Any, rate: Any = (0.02, -0.03, 0.05), attitude: Any = (0.6, 0.0, 0.8, 0.0), period: float = 0.1,
    substeps: int = 4, gains: Any = (0.9, 0.09), **options: Any,
) -> ClosedLoop:  # fmt: skip
    """A body of the inertia HUB in free space, with these parts, under PD feedback; none acts with `command_limit=0.0`."""
    law, start = catalogue()["pd"], State(attitude, rate, ZERO, ZERO, ZERO)
    return ClosedLoop(make_craft(HUB.tolist()), law, law.gains(*gains), start, period, substeps, parts=parts, **options)


def spun(torque: Any, times: Any, attitude: Any, rate: Any, inertia: Any = HUB) -> Any:
    """Attitudes (n, 4) and rates (n, 3) at these times (s) by SciPy, under torque(t, attitude) (N m, body axes)."""

    def slope(t: float, y: Any) -> Any:
        q, w = y[:4], y[4:]
        spin = np.linalg.solve(inertia, torque(t, q) - np.cross(w, inertia @ w))
        return [-0.5 * q[1:] @ w, *(0.5 * (q[0] * w + np.cross(q[1:], w))), *spin]

    found = solve_ivp(slope, (times[0], times[-1]), [*attitude, *rate], "DOP853", times, rtol=1e-12, atol=1e-15).y
    return found[:4].T, found[4:].T


def orbited(position: Any, velocity: Any, times: Any, push: Any = None) -> Any:
    """Positions and velocities (n, 6) in two-body motion about the Earth at times (s) from 0 on by SciPy, with another
    acceleration push(t, position, velocity) (m/s2) beside the attraction."""

    def slope(t: float, y: Any) -> Any:
        return [*y[3:], *(-EARTH * y[:3] / np.linalg.norm(y[:3]) ** 3 + (push(t, y[:3], y[3:]) if push else 0.0))]

    begun = [*position, *velocity]
    return solve_ivp(slope, (0.0, times[-1]), begun, "DOP853", times, rtol=1e-13, atol=1e-8).y.T


def aimed(target: Any, knots: Any = ()) -> Fitted:
    """A quaternion, or a table of `tabulate` with the knots of its spline, as a target."""
    return fit("target", "history", target, knots) if isinstance(target, np.ndarray) else fit("target", "inertial", target)


def noise(torque: float = 0.0, attitude: float = 0.0, rate: float = 0.0) -> tuple[Fitted, Fitted]:
    """A random torque (N m) and noisy sensors (rad, rad/s)."""
    return fit("environment", "random-torque", torque), fit("sensor", "gaussian", attitude, rate)


def rotors(wheels: Any, momenta: Any = None, allocation: str | None = None) -> Fitted:
    """Wheels with these momenta at the start, at rest if not given."""
    started = Rotors(tuple(momenta or (0.0,) * len(wheels.axes)))
    if allocation is not None:
        wheels = wheels._replace(allocation=ALLOCATIONS.index(allocation))
    return Fitted(find("effector", "wheels"), wheels, start=started)


def on_wheels(loop: ClosedLoop, **changes: Any) -> ClosedLoop:
    """The loop with other numbers of its wheels."""
    found = loop.find("wheels")
    assert found is not None
    return loop.with_parts(replace(found, params=found.params._replace(**changes)))


def point_loop(
    plant: Any, law: Any, gains: Any, start: Any, period: float, model: str = "linear", limit: float = math.inf,
    kind: Any = "norm", lag: float = 0.0,
) -> ClosedLoop:  # fmt: skip
    """A law near a libration point."""
    field = fit("environment", "linear-gravity" if model == "linear" else "three-body-gravity")
    surfaces = (fit("actuator", "lag", lag),) if lag else ()
    return ClosedLoop(
        plant, law, gains, start, period, parts=(field, *surfaces), limit=kind, command_limit=limit, seed=0
    )  # fmt: skip


def built(scenario: Any, law: str | None = None) -> ClosedLoop:
    """The loop of a scenario, or of the one of this name or in this file, with this law, or with its first."""
    scenario = load(scenario) if isinstance(scenario, str | Path) else scenario
    return build(scenario, scenario.pick(law))


def flown(loop: ClosedLoop, steps: int = 600, run: int = 0) -> Recording:
    """The recording of a flight."""
    return label(loop, *fly(loop, steps, run=run), 1)


def wheels_after(event: Any) -> Any:
    """The wheels from an event on."""
    return next(fitted.params for fitted in event.parts if fitted.part.name == "wheels")
