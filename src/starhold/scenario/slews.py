"""Reads the `slew` table of a mode: the rotation to the mode's target when the mode begins."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from starhold.errors import input_at
from starhold.laws.interface import Gain
from starhold.loop.slews import Slew
from starhold.parts import sun
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH
from starhold.parts.targets.eigenaxis import ACCELERATION, AXIS, KEEP_OUT, RATE, cone_of
from starhold.scenario.quantity import quantity
from starhold.scenario.tables import Table

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

TORQUE = Gain(
    "N m",
    above=0.0,
    plain=(1e3, "mN m"),
    text="largest about each body axis, for which rate and acceleration are lowered; none if absent",
)


class SlewTable(Table):
    """The rotation from the craft's attitude when a mode begins to the mode's target."""

    rate: Annotated[Any, *quantity(RATE)]
    acceleration: Annotated[Any, *quantity(ACCELERATION)]
    torque_limit: Annotated[Any, *quantity(TORQUE)] = None
    axis: Annotated[Any, *quantity(AXIS)] = (0.0, 0.0, 1.0)
    keep_out: Annotated[Any, *quantity(KEEP_OUT)] = 0.0


def slew_of(table: SlewTable | None, scenario: Scenario, key: str) -> Slew | None:
    """Return the slew of a mode's table, named `key` in errors, or None. InputError for a cone without a body axis."""
    if table is None:
        return None
    with input_at(scenario.where, key):
        cone = cone_of(table.axis, table.keep_out)
        shared = scenario.table.shared
        seen = sun.prepared(shared[EPOCH.shared], shared.get(EPHEMERIS.shared, 0)) if cone else ()
    torque = math.inf if table.torque_limit is None else table.torque_limit
    return Slew(table.rate, table.acceleration, torque, cone, seen)
