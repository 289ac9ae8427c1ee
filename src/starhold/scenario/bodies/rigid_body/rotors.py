"""The reaction wheels of many runs at once, from the draws for the keys of [wheels] and [[wheel]]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.parts.effectors.envelope import WORST_CONDITION
from starhold.parts.effectors.wheel_arrays import axial, least_squares, most_of_each, unit_axes
from starhold.parts.effectors.wheels import CREEP, Wheels
from starhold.scenario.bodies.rigid_body.craft import axial_inertia, effectors_of, rotors_in, sure_torque, wheels_of
from starhold.scenario.checking import RESOLVED
from starhold.scenario.making import path_of

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

Array: TypeAlias = NDArray[np.float64]


class Rotors(NamedTuple):
    """Wheels, the inertia (3, 3; kg m2) of their rotors about their spin axes, and the torque (N m) that they can always
    give, or None where lanes differ in its allocation. Numbers that differ between lanes are arrays (lanes,)."""

    wheels: Wheels
    axial: Any
    sure: Any


def rotors_over(scenario: Scenario, columns: Mapping[str, Array]) -> Rotors | None:
    """Return the wheels of lanes that differ in the values of some keys, (components..., lanes) by key; None where none of
    these keys belongs to a wheel."""
    like, table = wheels_of(scenario), scenario.table
    paths = {key: path_of(key, {}, "") for key in columns}
    drawn = {key: path for key, path in paths.items() if path[0] in ("wheels", "wheel")}
    if not drawn or like is None:
        return None
    for key, path in drawn.items():
        table = _with(table, path, columns[key] if columns[key].ndim == 1 else tuple(columns[key]))
    rows, numbers, _ = rotors_in(table)
    lanes = len(columns[next(iter(drawn))].T)
    wheels = like._replace(**{name: tuple(values) for name, values in numbers.items()})
    turned, limited = _differ(rows), _differ(wheels.torque_limit)
    limits = stacked(wheels.torque_limit, lanes)
    working = np.flatnonzero(np.array(like.torque_limit) > 0.0).tolist()
    axes = unit_axes(stacked(rows, lanes)) if turned else np.array(like.axes)
    if turned:
        units = _numbers(axes)
        pairs = zip(like.axes, rows, units, strict=True)
        wheels = wheels._replace(
            axes=tuple(unit if _differ(row) else axis for axis, row, unit in pairs),
            least=_numbers(least_squares(axes, working)),
        )
    around: Any = axial_inertia(effectors_of(scenario)).tolist()
    if turned or _differ(wheels.inertia):
        around = _numbers(axial(axes, stacked(wheels.inertia, lanes)))
    sure: Any = sure_torque(scenario.table, effectors_of(scenario))
    if limited or turned:
        least = stacked(wheels.least, lanes)[:, working]
        kind = "norm" if scenario.table.spacecraft.limit == "norm" else "axis"
        alike = not like.allocation and ((limits > 0.0) == (np.array(like.torque_limit) > 0.0)).all()
        sure = (limits[:, working] / most_of_each(least, kind)).min(axis=1) if alike else None
    return Rotors(wheels, tuple(map(tuple, around)), sure)


def impossible(scenario: Scenario, wheels: Wheels, lanes: int) -> NDArray[np.bool_]:
    """Return a mask (lanes,) of the lanes whose wheels `check_authority`, or whose friction `check_substeps`, refuses."""
    viscous, coulomb, inertia = (stacked(column, lanes) for column in (wheels.viscous, wheels.coulomb, wheels.inertia))
    timing = scenario.table.simulation
    least = timing.control_period * ((viscous + coulomb / CREEP) / inertia).max(axis=1) / RESOLVED * (1.0 - 1e-12)
    working = np.flatnonzero([np.all(limit) for limit in wheels.torque_limit])
    sizes = np.linalg.svd(stacked(wheels.axes, lanes)[:, working], compute_uv=False)
    return (sizes[:, 0] > WORST_CONDITION * sizes[:, 2]) | (timing.substeps < least)


def stacked(values: Any, lanes: int) -> Array:
    """Return an array (lanes, ...) of nested tuples whose numbers are single, the same for all lanes, or arrays (lanes,)."""
    if isinstance(values, list | tuple):
        return np.stack([stacked(value, lanes) for value in values], axis=1)
    return np.broadcast_to(np.asarray(values, dtype=float), (lanes,))


def _with(table: Any, path: Sequence[str | int], value: Any) -> Any:
    """Return a validated table with another value at a path."""
    if not path:
        return value
    name, rest = path[0], path[1:]
    if isinstance(name, str):
        return table.model_copy(update={name: _with(getattr(table, name), rest, value)})
    return type(table)([_with(item, rest, value) if place == name else item for place, item in enumerate(table)])


def _differ(values: Any) -> bool:
    """Return whether lanes differ in one of these numbers."""
    return any(_differ(value) if isinstance(value, list | tuple) else isinstance(value, np.ndarray) for value in values)


def _numbers(array: Array) -> tuple[Any, ...]:
    """Return an array (lanes, m, n) as m tuples of n arrays (lanes,)."""
    return tuple(tuple(array[:, i, j] for j in range(array.shape[2])) for i in range(array.shape[1]))
