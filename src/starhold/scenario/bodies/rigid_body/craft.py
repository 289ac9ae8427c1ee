"""From the tables of a spacecraft to the numbers that laws act on, and its wheels."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from starhold.errors import InputError
from starhold.parts.craft import Craft, compact, inverse, make_craft
from starhold.parts.effectors.envelope import authority
from starhold.parts.effectors.wheels import Wheels, body_inertia
from starhold.scenario.bodies.rigid_body.rotors import make_rotors
from starhold.scenario.bodies.rigid_body.tables import RigidBodyTable

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario


class Made(NamedTuple):
    """The numbers of a spacecraft; with wheels, its inertia is without the rotors' moments about their own axes."""

    craft: Craft
    wheels: Wheels | None


def make(table: RigidBodyTable, where: str) -> Made:
    """The spacecraft of these tables. InputError where it cannot be."""
    try:
        wheels = make_rotors(table.wheels, table.wheel)
        return Made(_craft(table, wheels, table.spacecraft.inertia), wheels)
    except ValueError as error:
        raise InputError(where, "wheel" if table.wheels or table.wheel else "spacecraft", "", str(error)) from None


def wheels_of(scenario: Scenario) -> Wheels | None:
    """The reaction wheels of a scenario, None for a craft without. A torque is shared out among them as laws suppose them
    to be."""
    made, supposed = (cast(Made, one.made).wheels for one in (scenario, scenario.known))
    if made is supposed or made is None or supposed is None or len(made.axes) != len(supposed.axes):
        return made
    return made._replace(least=supposed.least)


def craft_with(scenario: Scenario, inertia: Any) -> Craft:
    """The scenario's craft with another inertia (3, 3; kg m2), its wheels included; ValueError where it cannot be."""
    return _craft(scenario.table, wheels_of(scenario), inertia)


def _craft(table: RigidBodyTable, wheels: Wheels | None, inertia: Any) -> Craft:
    gravity = {} if table.orbit is None else {"gravity": table.orbit.gravitational_parameter}
    craft = make_craft(inertia, torque_limit(table, wheels), **gravity)
    if wheels is None:
        return craft
    rest = body_inertia(inertia, wheels)
    return craft._replace(inertia=compact(rest), inverse_inertia=inverse(compact(rest)), with_rotors=craft.inertia)


def torque_limit(table: RigidBodyTable, wheels: Wheels | None) -> float:
    """The torque that a law may reckon with (N m): the limit of [spacecraft], or what these wheels surely give in its
    way where that is less."""
    own, least = table.spacecraft, sure_torque(table, wheels)
    return least if own.limit == "none" and wheels is not None else min(own.torque_limit, least)


def sure_torque(table: RigidBodyTable, wheels: Wheels | None) -> float:
    """The torque that these wheels surely give (N m), in norm where the limit of [spacecraft] is one of it, else about each
    axis at once; infinite without wheels."""
    if wheels is None:
        return math.inf
    peak = table.wheels is not None and table.wheels.allocation == "least-peak"
    return authority(wheels, "norm" if table.spacecraft.limit == "norm" else "axis", peak=peak)
