"""The initial state of a run and its target."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.cosines import from_angles
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise, relative, stretch, to_body
from starhold.algebra.scalar import side
from starhold.algebra.vector import ZERO, add, most, subtract
from starhold.errors import InputError, input_at
from starhold.export.aem import OFF_UNIT, from_date, parse_aem
from starhold.laws.interface import Start
from starhold.loop.step import total
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import fit
from starhold.parts.epoch import EPOCH, OF_J2000, Date
from starhold.parts.orbit import body_of
from starhold.parts.part import Fitted
from starhold.parts.roles import Goal
from starhold.parts.targets import history
from starhold.scenario.bodies.rigid_body.craft import effectors_of, sure_torque, torque_limit
from starhold.scenario.bodies.rigid_body.tables import Pointing, TargetTable
from starhold.scenario.checking import show, validate
from starhold.scenario.csv_files import csv_lines, number_in
from starhold.scenario.parts import read_part

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario


def stated(pointing: Pointing) -> Quaternion:
    """Return the unit quaternion that a table gives as an attitude or as angles."""
    if pointing.angles is not None:
        return from_angles(*pointing.angles)
    return NO_TURN if pointing.attitude is None else unit_of(pointing.attitude)


def unit_of(given: Quaternion) -> Quaternion:
    """Return the unit quaternion in the direction of four numbers; an equation."""
    # Scaled first so that squares neither underflow nor overflow.
    return normalise(stretch(1.0 / most(given), given))


def target_of(scenario: Scenario) -> Fitted:
    """Return the target of the scenario: its [[part]] with this role, or that of [target]."""
    table = scenario.table.target
    given_part = next((fitted for fitted in scenario.parts if fitted.part.role == "target"), None)
    if given_part is not None:
        if "target" in scenario.table.model_fields_set:
            raise InputError(scenario.where, f"part {given_part.called}", "a second target, beside [target]", "one target")
        return _tried(scenario, given_part, f"part {given_part.called}")
    return _from_table(scenario, table, "target")


def _tried(scenario: Scenario, target: Fitted, key: str) -> Fitted:
    """Return the target itself. InputError for parameters that it refuses: they are checked here because the initial state
    may be relative to the target, before all parts are checked together."""
    with input_at(scenario.where, key):
        target.prepared(scenario.table.simulation.control_period)
    return target


def mode_target(scenario: Scenario, given: Any, units: Any, key: str) -> Fitted:
    """Return the target that a mode's raw table defines, in the form of [target] or of a [[part]] with the role target; the
    scenario's target for None."""
    if given is None:
        return target_of(scenario)
    if not isinstance(given, dict):
        raise InputError(scenario.where, key, show(given), 'a table, such as { mode = "orbital" } or { type = "a target" }')
    if "type" in given or ("file" in given and "mode" not in given):
        table, shared = cast("dict[str, Any]", given), scenario.table.shared
        target = read_part(table, "rigid-body", scenario.folder, scenario.where, key, shared, units)
        if target.part.role != "target":
            raise InputError(scenario.where, key, f"{target.part.name}, of the role {target.part.role}", "a target")
        return _tried(scenario, target, key)
    table = validate(TargetTable, given, scenario.where, key)
    if table.mode == "orbital" and scenario.table.orbit is None:
        raise InputError(scenario.where, f"{key}.mode", show("orbital"), "another mode without an [orbit] table")
    return _from_table(scenario, table, key)


def _from_table(scenario: Scenario, table: TargetTable, key: str) -> Fitted:
    """Return the target that a [target] table defines."""
    simulation = scenario.table.simulation
    if table.mode == "orbital":
        return fit("target", "orbital")
    if table.mode == "inertial":
        return fit("target", "inertial", stated(table))
    samples = np.arange(simulation.steps + 1) * simulation.control_period
    last = simulation.steps * simulation.control_period
    rows = _history(scenario, table, key, lambda times, rows: history.tabulate(times, rows, samples))
    return fit(
        "target", "history", rows, _history(scenario, table, key, lambda times, rows: history.knots_of(times, rows, last))
    )


def date_of_axes(scenario: Scenario) -> Date | None:
    """Return the date whose mean equator and equinox define the inertial axes: the epoch of an orbit about the Earth, if the
    scenario states it or has a part that uses the Sun or the Earth's rotation. None where the axes are arbitrary."""
    orbit = scenario.table.orbit
    if orbit is None or body_of(orbit.gravitational_parameter) != "Earth":
        return None
    knows = any(item.gain.shared == EPOCH.shared for fitted in scenario.parts for item in fitted.part.fields())
    return scenario.table.shared[EPOCH.shared] if knows or orbit.epoch is not None else None


def _history(scenario: Scenario, table: TargetTable, key: str, use: Callable[..., Any]) -> Any:
    """Return the result of `use` for the times and attitudes of a history file. InputError where the file cannot be used."""
    path = scenario.folder / str(table.file)
    allowed = "a CSV file of columns time,q0,q1,q2,q3 (in another order if named), unit quaternions, times that increase"
    if path.suffix.lower() == ".aem":
        allowed = "a CCSDS attitude ephemeris message of one segment, unit quaternions, epochs that increase"
    try:
        times, attitudes, frame = read_history(path)
        of_date = date_of_axes(scenario)
        if frame == OF_J2000 and of_date is not None:
            attitudes = from_date(attitudes, of_date, back=True)
        return use(times, attitudes)
    except OSError as error:
        raise InputError(scenario.where, f"{key}.file", f"{path}: {error.strerror}", allowed) from None
    except ValueError as error:
        raise InputError(scenario.where, f"{key}.file", f"{path}: {error}", allowed) from None


def start_of(scenario: Scenario, goal: Fitted, attitude: Any = None, rate: Any = None, placed: Any = None) -> State:
    """Return the initial state of a run with this target. A unit quaternion and a rate, if given, replace those of
    [initial], and `placed`, a position and a velocity, those of [orbit]; with them this is an equation."""
    table = scenario.table
    begun = (ZERO, ZERO) if table.orbit is None else table.orbit.start
    position, velocity = begun if placed is None else placed
    turned = stated(table.initial) if attitude is None else attitude
    begun = State(turned, table.initial.rate if rate is None else rate, position, velocity, ZERO)
    if table.initial.relative_to == "target":
        aim = goal_at_start(goal, begun)
        rate = add(begun.rate, to_body(begun.attitude, aim.rate))
        return begun._replace(attitude=multiply(aim.attitude, begun.attitude), rate=rate)
    return begun


def goal_at_start(goal: Fitted, begun: State) -> Goal:
    return goal.part.module.goal(goal.prepared(1.0), begun, 0, NO_TURN)


def told_to_design(scenario: Scenario, sign: str) -> Start:
    """Return the initial error that a design form may use; `sign`: the law's quaternion sign policy."""
    table, goal, effectors = scenario.table, target_of(scenario), effectors_of(scenario)
    begun = start_of(scenario, goal)
    aim = goal_at_start(goal, begun)
    error = relative(aim.attitude, begun.attitude)
    error = error if sign == "as_published" else stretch(side(error[0]), error)
    rate = subtract(begun.rate, to_body(error, aim.rate))
    torque = (sure_torque if table.spacecraft.limit == "none" else torque_limit)(table, effectors)
    stored = total(f.part.module.momentum(f.start, f.params) for f in effectors)
    room = min((f.part.module.capacity(f.start, f.params) for f in effectors), default=math.inf)
    tolerances = table.settling
    return Start(error, rate, stored, torque, room, tolerances.attitude_tolerance, tolerances.rate_tolerance)


COLUMNS = ("time", "q0", "q1", "q2", "q3")


def read_history(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """Return times (n,) in s, quaternions (n, 4), scalar first, and the name of the reference frame, "" for none. Named
    columns may be in any order; unnamed ones are those of COLUMNS. A file that ends in .aem is an attitude ephemeris
    message, whose first epoch is time 0.

    Raises OSError, or ValueError that names the line and its error."""
    if path.suffix.lower() == ".aem":
        message = parse_aem(path)
        return message.times, message.attitudes, message.frame
    rows: list[list[float]] = []
    order = list(range(len(COLUMNS)))
    for number, cells in csv_lines(path):
        if not rows and number_in(cells[0]) is None:
            order = _order(cells, number)
            continue
        rows.append(_numbers(cells, order, number))
    if len(rows) < 2:
        raise ValueError(f"{len(rows)} rows of numbers")
    table = np.array(rows)
    backwards = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
    if len(backwards):
        later, earlier = table[backwards[0] + 1, 0], table[backwards[0], 0]
        raise ValueError(f"a time of {later:g} s after one of {earlier:g} s")
    return table[:, 0], table[:, 1:], ""


def _order(names: list[str], line: int) -> list[int]:
    """Return the index of each of COLUMNS among the named columns."""
    given = [name.lower() for name in names]
    if sorted(given) != sorted(COLUMNS):
        raise ValueError(f"line {line}: columns {', '.join(names)}")
    return [given.index(name) for name in COLUMNS]


def _numbers(cells: list[str], order: list[int], line: int) -> list[float]:
    if len(cells) != len(COLUMNS):
        raise ValueError(f"line {line}: {len(cells)} columns")
    row: list[float] = []
    for place in order:
        number = number_in(cells[place])
        if number is None or not math.isfinite(number):
            raise ValueError(f"line {line}: {cells[place]!r}, which is not a finite number")
        row.append(number)
    length = math.hypot(*row[1:])
    if abs(length - 1.0) > OFF_UNIT:
        raise ValueError(f"line {line}: a quaternion of length {length:.6g}")
    return row
