"""The orbits of many runs, from the draws for keys of [orbit]: one by one, because the sine of an array may differ from
that of a number."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.parts.orbit import body_of
from starhold.scenario.orbit import AIR, ANGLES, FARTHEST, LOWEST, Orbit

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

Array: TypeAlias = NDArray[np.float64]

STATE, SHAPE = ("position", "velocity", "semi_major_axis"), ("eccentricity", *ANGLES)


def orbits_over(scenario: Scenario, columns: Mapping[str, Array]) -> list[Orbit] | None:
    """Return the unchecked orbits of lanes that differ in the values of some keys, (components..., lanes) by key; None
    where none of these is a key of [orbit]. ValueError where lanes differ in more than their initial states."""
    orbit: Orbit | None = scenario.table.orbit
    drawn = {key.removeprefix("orbit."): values for key, values in columns.items() if key.startswith("orbit.")}
    if orbit is None or not drawn:
        return None
    lanes, changes = next(iter(drawn.values())).shape[-1], dict[str, Array]()
    for key, values in drawn.items():
        name, _, component = key.partition("[")
        if not _may_differ(orbit, name, values):
            raise ValueError("lanes differ in more of their orbits than the initial state")
        if component:
            whole = changes.setdefault(name, np.repeat(np.array(getattr(orbit, name))[:, None], lanes, axis=1))
            whole[int(component[:-1]) - 1] = values
        else:
            changes[name] = values
    lists = ([tuple(x) if isinstance(x, list) else x for x in values.T.tolist()] for values in changes.values())
    rows = zip(*lists, strict=True)
    return [orbit.model_copy(update=dict(zip(changes, row, strict=True))) for row in rows]


def _may_differ(orbit: Orbit, name: str, values: Array) -> bool:
    """Return whether all lanes may have these plain values of a key of [orbit], which must stay given by the same keys."""
    if name == "altitude" and orbit.altitude is not None:
        low, about = max(AIR, LOWEST * (orbit.surface or 0.0)), body_of(orbit.gravitational_parameter)
        return bool((values > low).all() and (about != "Earth" or (values < FARTHEST).all()))
    if name in SHAPE and orbit.position is None:
        return name != "eccentricity" or orbit.altitude is None
    return name in STATE and getattr(orbit, name) is not None


def impossible_orbits(scenario: Scenario, columns: Mapping[str, Array]) -> NDArray[np.bool_] | None:
    """Return a mask (lanes,) of the lanes whose orbit would be refused in a file; None where no orbit is drawn, or where
    only reading a file decides this."""
    try:
        orbits = orbits_over(scenario, columns)
    except ValueError:
        return None
    if orbits is None:
        return None
    duration = scenario.table.simulation.duration

    def fails(orbit: Orbit) -> bool:
        try:
            start = orbit.start
            orbit.check_start(*start)
            orbit.check_flight(duration, start)
        except ValueError:
            return True
        return False

    # Warnings concern the file, not each run.
    with warnings.catch_warnings(action="ignore"):
        return np.array([fails(orbit) for orbit in orbits])
