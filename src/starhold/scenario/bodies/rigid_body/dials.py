"""Equations for the inertia, torque limit and initial state of a spacecraft, which may vary within one loop's program."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.cosines import from_angles
from starhold.algebra.scalar import both, less_equal, minimum, where
from starhold.algebra.structure import leaves
from starhold.algebra.vector import apply
from starhold.errors import input_at
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.craft import Craft, check_moments, check_rest, compact, inverse, total_inertia
from starhold.parts.stated_attitude import check_attitude
from starhold.scenario.bodies.interface import Body, Moved
from starhold.scenario.bodies.rigid_body.craft import axial_inertia, effectors_of, sure_torque
from starhold.scenario.bodies.rigid_body.orbits import impossible_orbits, orbits_over
from starhold.scenario.bodies.rigid_body.rotors import Rotors, impossible, rotors_over, stacked
from starhold.scenario.bodies.rigid_body.start import start_of, stated, target_of, unit_of

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

Array: TypeAlias = NDArray[np.float64]

KNOWN, TRUE = "spacecraft.inertia", "fault[1].inertia"
"""The keys of the inertia that laws know, and of the true inertia where laws do not know it."""
LIMIT, ATTITUDE, RATE = "spacecraft.torque_limit", "initial.attitude", "initial.rate"
ANGLES = "initial.angles"
"""A key that cannot be varied, because equations have no sine: `moved` takes the quaternion of the angles instead."""
ROTORS, ORBIT = "wheels", "orbit"
"""Entries of `moved` that are not keys: the wheels, and position and velocity, computed from the keys of their tables."""


class Dials(Body):
    """A body whose inertia, torque limit and initial state may vary from run to run."""

    linked = MappingProxyType({TRUE: KNOWN})

    def dials(self, scenario: Scenario) -> dict[str, Any]:
        """Return the keys that may vary, with their values; an attitude given by angles becomes a quaternion, and an
        infinite limit is left out. With faults or a nominal model there are none, because no equations describe their
        effects."""
        table = scenario.table
        if table.fault or table.nominal:
            return {}
        inertia = compact(table.spacecraft.inertia)
        dials: dict[str, Any] = {KNOWN: inertia, TRUE: inertia}
        if math.isfinite(table.spacecraft.torque_limit) and table.spacecraft.limit != "none":
            dials[LIMIT] = table.spacecraft.torque_limit
        attitude = table.initial.attitude or stated(table.initial)
        return dials | {ATTITUDE: tuple(map(float, attitude)), RATE: tuple(map(float, table.initial.rate))}

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the changes of a file that set keys to these values; a true inertia unknown to laws becomes a fault at the
        start, without a reaction."""
        changes = {key: value for key, value in values.items() if key != TRUE}
        if ATTITUDE in changes:
            changes[ANGLES] = None
        if TRUE in values:
            changes["fault"] = [{"time": 0.0, "inertia": values[TRUE], "action": "none"}]
        return changes

    def moved(self, scenario: Scenario, loop: ClosedLoop, values: Mapping[str, Any]) -> Moved:
        """Return the numbers of a loop for these values, equal to those of `build` and `make_events`."""
        nominal, flown = _crafts(scenario, values, loop.craft)
        saturation_limit = values.get(LIMIT, loop.saturation_limit())
        attitude = unit_of(values[ATTITUDE]) if ATTITUDE in values else values.get(ANGLES)
        begun = start_of(scenario, target_of(scenario), attitude, values.get(RATE), values.get(ORBIT))
        # An inertia that changes as the motion begins keeps the angular momentum, as in `Phase.rate_from`.
        pairs = zip(leaves(flown.inertia), leaves(nominal.inertia), strict=True)
        same = reduce(both, (both(less_equal(a, b), less_equal(b, a)) for a, b in pairs))
        jumped = apply(flown.inverse_inertia, apply(nominal.inertia, begun.rate))
        rate: Any = tuple(where(same, kept, other) for kept, other in zip(begun.rate, jumped, strict=True))
        rotors, parts = values.get(ROTORS), loop.parts
        if rotors is not None:
            parts = tuple(replace(f, params=rotors.wheels) if f.part.name == "wheels" else f for f in parts)
        return Moved(begun._replace(rate=rate), begun, flown, nominal, saturation_limit, parts)

    def admitted(self, scenario: Scenario, values: Mapping[str, Any]) -> Craft:
        """Return the craft that laws know for these values, which may be recorded numbers. InputError for values that would
        be refused in a file."""
        crafts = _crafts(scenario, values, scenario.craft)
        for key, craft in zip((KNOWN, TRUE), crafts, strict=True):
            with input_at("", key):
                if key in values:
                    check_moments(values[key])
                if key in values and craft.with_rotors:
                    check_rest(craft.inertia)
        if ATTITUDE in values:
            with input_at("", ATTITUDE):
                check_attitude(values[ATTITUDE])
        return crafts[0]

    def drawn(self, scenario: Scenario, columns: Mapping[str, Array]) -> dict[str, Any]:
        """Return the arguments of `moved`, with an array (lanes,) in place of each number; columns: values (components...,
        lanes) by key, of whole vectors or of single components. ValueError where lanes do not differ in numbers alone."""
        initial, moved = scenario.table.initial, dict[str, Any]()
        for key, given in ((ATTITUDE, initial.attitude), (ANGLES, initial.angles), (RATE, initial.rate)):
            values = _whole(columns, key, given)
            if values is not None and key == ANGLES:
                # One by one, because the sine of an array may differ from that of a number.
                values = np.array([from_angles(*lane) for lane in values.T.tolist()]).T
            if values is not None:
                moved[key] = tuple(values)
        moments, rotors = _moments(scenario, columns), rotors_over(scenario, columns)
        if moments is not None:
            moved[KNOWN] = _inertia(moments, isinstance(total_inertia(scenario.craft)[0], tuple))
        if LIMIT in columns:
            moved[LIMIT] = columns[LIMIT]
        orbits = orbits_over(scenario, columns)
        if orbits is not None:
            starts = np.array([orbit.start for orbit in orbits])
            moved[ORBIT] = tuple(map(tuple, np.moveaxis(starts, 0, -1)))
        if rotors is not None and rotors.sure is None:
            raise ValueError("lanes differ in the torque allocation of their wheels")
        return moved if rotors is None else moved | {ROTORS: rotors}

    def refused(self, scenario: Scenario, columns: Mapping[str, Array]) -> NDArray[np.bool_] | None:
        """Return a mask (lanes,) of the lanes with an impossible inertia, wheel or orbit; None where none is drawn."""
        every = (self._refused(scenario, columns), impossible_orbits(scenario, columns))
        known = [lanes for lanes in every if lanes is not None]
        return reduce(np.logical_or, known) if known else None

    def _refused(self, scenario: Scenario, columns: Mapping[str, Array]) -> NDArray[np.bool_] | None:
        """Return a mask (lanes,) of the lanes with an impossible inertia or wheel; None where neither is drawn."""
        moments, rotors = _moments(scenario, columns), rotors_over(scenario, columns)
        if moments is None and rotors is None:
            return None
        lanes = next(iter(columns.values())).shape[-1]
        moments = np.asarray(scenario.table.spacecraft.inertia)[..., None] if moments is None else moments
        full = np.moveaxis(moments * np.eye(3)[:, :, None] if moments.ndim == 2 else moments, -1, 0)
        ordered = np.sort(moments, axis=0).T if moments.ndim == 2 else _principal(full)
        no_body = (ordered[:, 0] <= 0.0) | (ordered[:, 2] > (ordered[:, 0] + ordered[:, 1]) * (1.0 + 1e-9))
        if not effectors_of(scenario):
            return no_body
        axial = axial_inertia(effectors_of(scenario)) if rotors is None else stacked(rotors.axial, lanes)
        no_rest = _principal(full - axial)[:, 0] <= 0.0
        return no_body | no_rest | (False if rotors is None else impossible(scenario, rotors.wheels, lanes))


def _crafts(scenario: Scenario, values: Mapping[str, Any], like: Craft) -> tuple[Craft, Craft]:
    """Return the craft that laws know and the true one, both with the structure of `like`."""
    craft, rotors = scenario.craft, values.get(ROTORS)
    if LIMIT in values or rotors is not None:
        table = scenario.table
        limit = values.get(LIMIT, table.spacecraft.torque_limit)
        sure = sure_torque(table, effectors_of(scenario)) if rotors is None else rotors.sure
        if rotors is not None or sure < math.inf:
            limit = sure if table.spacecraft.limit == "none" else minimum(limit, sure)
        craft = craft._replace(torque_limit=limit)
    nominal = craft
    if KNOWN in values or rotors is not None:
        nominal = _with_inertia(scenario, craft, values.get(KNOWN, total_inertia(craft)), like, rotors)
    return nominal, _with_inertia(scenario, craft, values[TRUE], like) if TRUE in values else nominal


def _with_inertia(scenario: Scenario, craft: Craft, inertia: Any, like: Craft, rotors: Rotors | None = None) -> Craft:
    """Return the craft with another inertia, which includes the wheels; the result has the structure of `like`."""
    if not craft.with_rotors:
        return craft._replace(inertia=inertia, inverse_inertia=inverse(inertia))
    axial: Any = axial_inertia(effectors_of(scenario)).tolist() if rotors is None else rotors.axial
    form: Any = like.inertia

    def left(i: int, j: int) -> Any:
        whole = inertia[i][j] if isinstance(inertia[0], tuple) else inertia[i] if i == j else 0.0
        return whole - axial[i][j]

    # Products of inertia that are zero in `like` stay zero: here they are only rounding errors.
    without_rotors: Any = tuple(
        tuple(left(i, j) if form[i][j] != 0.0 else 0.0 for j in range(3)) if isinstance(form[0], tuple) else left(i, i)
        for i in range(3)
    )
    return craft._replace(inertia=without_rotors, inverse_inertia=inverse(without_rotors), with_rotors=inertia)


def _moments(scenario: Scenario, columns: Mapping[str, Array]) -> Array | None:
    return _whole(columns, KNOWN, np.diagonal(np.asarray(scenario.table.spacecraft.inertia)))


def _whole(columns: Mapping[str, Array], key: str, nominal: Any) -> Array | None:
    """Return the vectors (components, lanes), or matrices, of a key of which some or all components are drawn; None if none
    is."""
    if key in columns:
        return columns[key]
    drawn = {name: values for name, values in columns.items() if name.startswith(f"{key}[")}
    if not drawn or nominal is None or any("][" in name for name in drawn):
        return None
    vectors = np.repeat(np.asarray(nominal, dtype=float)[:, None], len(next(iter(drawn.values()))), axis=1)
    for name, values in drawn.items():
        vectors[int(name[len(key) + 1 :].partition("]")[0]) - 1] = values
    return vectors


def _inertia(moments: Array, matrix: bool) -> Any:
    """Return inertias (3, lanes) or (3, 3, lanes) as the craft has them."""
    if moments.ndim == 2:
        moments = np.eye(3)[:, :, None] * moments
    rows = 0.5 * (moments + moments.swapaxes(0, 1))
    return tuple(tuple(row) for row in rows) if matrix else tuple(rows[k, k] for k in range(3))


def _principal(inertias: Array) -> NDArray[np.floating[Any]]:
    """Return the principal moments (lanes, 3), in increasing order, of inertias (lanes, 3, 3)."""
    return np.linalg.eigvalsh(0.5 * (inertias + inertias.swapaxes(1, 2)))
