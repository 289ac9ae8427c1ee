"""Where a run starts, and what it is to reach."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.algebra.cosines import from_angles
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise, relative, stretch, to_body
from starhold.algebra.scalar import side
from starhold.algebra.vector import ZERO, add, subtract
from starhold.errors import InputError
from starhold.laws.interface import Start
from starhold.parts.bodies.rigid_body import State
from starhold.parts.effectors.wheeled_body import WheeledState
from starhold.parts.effectors.wheels import capacity, wheel_momentum
from starhold.parts.targets.target import Knots, Target, inertial, knots_of, orbital, tabulate
from starhold.scenario.history import read_history
from starhold.scenario.rotors import start_momenta
from starhold.scenario.schema import Pointing

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario


def _attitude(pointing: Pointing) -> Quaternion:
    if pointing.angles is not None:
        return from_angles(*pointing.angles)
    if pointing.attitude is None:
        return NO_TURN
    # Scaled first, so that the squares of odd numbers neither vanish nor overflow.
    return normalise(stretch(1.0 / max(map(abs, pointing.attitude)), pointing.attitude))


def target_of(scenario: Scenario) -> Any:
    """The target as a `ClosedLoop` takes it."""
    table = scenario.table.target
    if table.mode == "orbital":
        return "orbital"
    return _attitude(table) if table.mode == "inertial" else _table(scenario)


def knots_for(scenario: Scenario) -> Knots | None:
    """The knots of the spline that a target with a history follows; None for other targets."""
    simulation = scenario.table.simulation
    last = simulation.steps * simulation.control_period
    return (
        _history(scenario, lambda times, rows: knots_of(times, rows, last))
        if scenario.table.target.mode == "history"
        else None
    )


def _table(scenario: Scenario) -> Any:
    simulation = scenario.table.simulation
    samples = np.arange(simulation.steps + 1) * simulation.control_period
    return _history(scenario, lambda times, rows: tabulate(times, rows, samples))


def _history(scenario: Scenario, use: Callable[..., Any]) -> Any:
    """What is made of the times and attitudes in the file of a history."""
    path = scenario.folder / str(scenario.table.target.file)
    allowed = "a CSV file of columns time,q0,q1,q2,q3 (in another order if named), unit quaternions, times that increase"
    try:
        return use(*read_history(path))
    except OSError as error:
        raise InputError(scenario.where, "target.file", f"{path}: {error.strerror}", allowed) from None
    except ValueError as error:
        raise InputError(scenario.where, "target.file", f"{path}: {error}", allowed) from None


def start_of(scenario: Scenario, goal: Any) -> State | WheeledState:
    """The first state of a run with this target."""
    table = scenario.table
    orbit = table.orbit
    position, velocity = (ZERO, ZERO) if orbit is None else orbit.start
    attitude, rate = _attitude(table.initial), table.initial.rate
    if table.initial.relative_to == "target":
        held = _target_at_start(goal, position, velocity)
        rate = add(rate, to_body(attitude, held.rate))
        attitude = multiply(held.attitude, attitude)
    wheels = scenario.wheels
    if wheels is None:
        return State(attitude, rate, position, velocity, ZERO)
    momentum = start_momenta(table.wheels, table.wheel, len(wheels.axes))
    return WheeledState(attitude, rate, position, velocity, ZERO, momentum)


def _target_at_start(goal: Any, position: Any, velocity: Any) -> Target:
    if isinstance(goal, str):
        return orbital(None, position, velocity, 0, NO_TURN)
    if isinstance(goal, np.ndarray):
        row = goal[0].tolist()
        return Target(tuple(row[:4]), tuple(row[4:7]), tuple(row[7:]))
    return inertial(goal, position, velocity, 0, None)


def told_to_design(scenario: Scenario, cover: str) -> Start:
    """What the design of a law of a scenario may reckon with; `cover`: which of q and -q is fed back."""
    table, goal = scenario.table, target_of(scenario)
    begun = start_of(scenario, goal)
    held = _target_at_start(goal, begun.position, begun.velocity)
    error = relative(held.attitude, begun.attitude)
    error = error if cover == "as_published" else stretch(side(error[0]), error)
    rate = subtract(begun.rate, to_body(error, held.rate))
    momentum, held_by_wheels = math.inf, None
    free = table.spacecraft.limit == "none" and scenario.wheels is None
    torque = math.inf if free else scenario.torque_limit(scenario.wheels)
    if scenario.wheels is not None and isinstance(begun, WheeledState):
        held_by_wheels, momentum = wheel_momentum(begun.momentum, scenario.wheels), capacity(scenario.wheels, begun.momentum)
    tolerances = table.settling
    return Start(error, rate, held_by_wheels, torque, momentum, tolerances.attitude_tolerance, tolerances.rate_tolerance)
