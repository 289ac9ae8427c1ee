"""Turns the tables of a spacecraft into the craft that laws use, its effectors, and the parts that [wheels], [sensor],
[environment] and other tables declare as short forms of [[part]]."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from starhold.errors import input_at
from starhold.parts.catalogue import find, fit
from starhold.parts.craft import Craft, bare_inertia, compact, inverse, make_craft
from starhold.parts.effectors.layouts import nasa_standard, pyramid, three_orthogonal
from starhold.parts.effectors.wheel_motion import mounted, with_more
from starhold.parts.effectors.wheel_units import WHEEL_UNITS
from starhold.parts.effectors.wheels import ALLOCATIONS, Wheels, make_wheels, remember
from starhold.parts.part import Fitted
from starhold.scenario.bodies.rigid_body.tables import RigidBodyTable, Rotor, WheelsTable

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario


LAYOUTS = {"orthogonal": three_orthogonal, "pyramid": pyramid, "nasa-standard": nasa_standard}
NUMBERS = ("inertia", "torque_limit", "momentum_limit", "viscous", "coulomb")
FASTEST = 1e4
"""A speed (rad/s) that no rotor withstands: rims of the strongest fibres burst below it."""
NONE: dict[str, Any] = {
    "static_friction": 0.0,
    "stribeck_speed": 0.0,
    "power_limit": math.inf,
    "static_imbalance": 0.0,
    "dynamic_imbalance": 0.0,
    "position": (0.0, 0.0, 0.0),
}
"""Optional parameters of wheels, each with the value that means its absence."""


def written_out(scenario: Scenario, target: Fitted, effectors: tuple[Fitted, ...]) -> tuple[Fitted, ...]:
    """Return all parts of the scenario in the order in which they act: the target, the effectors, the parts of the other
    short forms, and those of [[part]] tables."""
    table = scenario.table
    around, noise, body = table.environment, table.sensor, table.spacecraft
    lag, rate_limit = body.actuator_lag, body.torque_rate_limit
    fitted_parts = (
        target,
        *_where(table.orbit is not None, "environment", "two-body"),
        *_where(around.gravity_gradient, "environment", "gravity-gradient"),
        *_where(around.torque_noise > 0.0, "environment", "random-torque", around.torque_noise),
        *effectors,
        *_where(any(dict(noise).values()), "sensor", "gaussian", noise.attitude_noise, noise.rate_noise),
        *_where(lag > 0.0, "actuator", "lag", lag, rate_limit),
        *_where(lag == 0.0 and math.isfinite(rate_limit), "actuator", "rate-limit", rate_limit),
    )
    return (*fitted_parts, *(fitted for fitted in scenario.parts if fitted not in fitted_parts))


def _where(there: bool, role: str, name: str, *numbers: float) -> tuple[Fitted, ...]:
    return (fit(role, name, *numbers),) if there else ()


def effectors_in(table: RigidBodyTable) -> tuple[Fitted, ...]:
    """Return the effectors of the tables: reaction wheels, if any. ValueError names what is missing or impossible."""
    if table.wheels is None and not table.wheel:
        return ()
    axes, columns, momenta = rotors_in(table)
    shared = table.wheels or WheelsTable()
    rotors: list[Rotor] = [*table.wheel] or [shared] * len(axes)
    for place, (most, inertia) in enumerate(zip(columns["momentum_limit"], columns["inertia"], strict=True), 1):
        if FASTEST * inertia < most < math.inf:
            speed = f"{most / inertia * 30.0 / math.pi:.3g} rpm"
            raise ValueError(
                f"wheel {place} turns at {speed} at its largest momentum, {most:.3g} N m s: is another unit meant?"
            )
    wheels = make_wheels(axes, **columns)._replace(allocation=ALLOCATIONS.index((table.wheels or WheelsTable()).allocation))
    wheels = mounted(wheels, [_given("mounting_error", rotor, shared) or (0.0, 0.0, 0.0) for rotor in rotors])
    more = {name: [_given(name, rotor, shared) for rotor in rotors] for name in NONE}
    if any(value is not None for column in more.values() for value in column):
        filled = ([NONE[name] if x is None else x for x in column] for name, column in more.items())
        wheels = with_more(wheels, *filled)
    return (Fitted(find("effector", "wheels"), wheels, start=remember(wheels)._replace(momentum=tuple(momenta))),)


def rotors_in(table: RigidBodyTable) -> tuple[list[Any], dict[str, list[Any]], list[Any]]:
    """Return the axes of the wheels, their parameters by name, and their initial momenta (N m s), one per wheel. ValueError
    names what is missing."""
    shared, single = table.wheels or WheelsTable(), table.wheel
    axes = [wheel.axis for wheel in single] or list(LAYOUTS[shared.layout or ""]())
    rotors: list[Rotor] = [*single] or [shared] * len(axes)
    columns = {name: [_number(name, rotor, shared, place) for place, rotor in enumerate(rotors, 1)] for name in NUMBERS}
    started = [rotor if {"momentum", "speed"} & rotor.model_fields_set else shared for rotor in rotors]
    pairs = zip(started, columns["inertia"], strict=True)
    return axes, columns, [one.momentum if one.speed is None else inertia * one.speed for one, inertia in pairs]


def _given(name: str, table: Rotor, shared: Rotor) -> Any:
    """Return a parameter of a wheel from its own table, or else from [wheels]; None where neither gives it."""
    value = getattr(table, name)
    return getattr(shared, name) if value is None else value


def _number(name: str, table: Rotor, shared: Rotor, place: int) -> Any:
    """Return a parameter of a wheel from the first of its own table, its catalogue unit, [wheels], and the unit there."""
    for given in (table, shared):
        value: Any = getattr(given, name)
        if value is not None:
            return value
        if name == "momentum_limit" and given.top_speed is not None:
            return _number("inertia", table, shared, place) * given.top_speed
        if given.unit is not None:
            if given.unit not in WHEEL_UNITS:
                raise ValueError(f"no wheel unit {given.unit!r}; one of {', '.join(WHEEL_UNITS)}")
            wheel_unit = getattr(WHEEL_UNITS[given.unit], name, None)
            if wheel_unit is not None:
                return wheel_unit
    if name in ("viscous", "coulomb"):
        return 0.0
    raise ValueError(f"wheel {place} has no {name}: give it, or a unit")


class Made(NamedTuple):
    """A spacecraft and its effectors. With wheels, the craft's inertia excludes the rotors' moments of inertia about their
    spin axes."""

    craft: Craft
    effectors: tuple[Fitted, ...]


def make(table: RigidBodyTable, where: str) -> Made:
    """Return the spacecraft that these tables define. InputError where it is impossible."""
    with input_at(where, "wheel" if table.wheels or table.wheel else "spacecraft"):
        effectors = effectors_in(table)
        return Made(_craft(table, effectors, table.spacecraft.inertia), effectors)


def effectors_of(scenario: Scenario) -> tuple[Fitted, ...]:
    """Return the effectors of a scenario's tables, which allocate a torque by the law's model of them. Beside the functions
    of its role, each has `sure_torque(params, kind)`, the torque (N m) that it can always give, in norm or about all axes at
    once; `capacity(own, params)`, the momentum (N m s) that it can still store; `axial_inertia(params)`, the part of the
    body's inertia (3, 3; kg m2) due to its rotors about their spin axes; and `shared_as(params, known, like)`, its
    parameters with the allocation that a law computes from the parameters it knows."""
    made, supposed = (cast(Made, one.made).effectors for one in (scenario, scenario.known))
    if made is supposed or len(made) != len(supposed):
        return made
    pairs = zip(made, supposed, strict=True)
    return tuple(
        replace(fitted, params=fitted.part.module.shared_as(fitted.params, known.params)) for fitted, known in pairs
    )


def wheels_of(scenario: Scenario) -> Wheels | None:
    """Return the reaction wheels of a scenario's tables, or None."""
    return next((fitted.params for fitted in effectors_of(scenario) if fitted.part.name == "wheels"), None)


def craft_with(scenario: Scenario, inertia: Any) -> Craft:
    """Return the scenario's craft with another inertia (3, 3; kg m2), which includes the wheels. ValueError where it is
    impossible."""
    return _craft(scenario.table, effectors_of(scenario), inertia)


def _craft(table: RigidBodyTable, effectors: tuple[Fitted, ...], inertia: Any) -> Craft:
    gravity = {} if table.orbit is None else {"gravity": table.orbit.gravitational_parameter}
    craft = make_craft(inertia, torque_limit(table, effectors), **gravity)
    if not effectors:
        return craft
    rest = compact(bare_inertia(inertia, axial_inertia(effectors)))
    return craft._replace(inertia=rest, inverse_inertia=inverse(rest), with_rotors=craft.inertia)


def axial_inertia(effectors: tuple[Fitted, ...]) -> Any:
    """Return the part of the body's inertia (3, 3; kg m2) due to the effectors' rotors about their own axes."""
    return np.sum([fitted.part.module.axial_inertia(fitted.params) for fitted in effectors], axis=0)


def torque_limit(table: RigidBodyTable, parts: Iterable[Fitted]) -> float:
    """Return the torque (N m) on which a law may rely: the smaller of the limit of [spacecraft] and the torque that the
    effectors among these parts can always give, both per axis or both in norm."""
    craft, least = table.spacecraft, sure_torque(table, parts)
    return least if craft.limit == "none" and least < math.inf else min(craft.torque_limit, least)


def sure_torque(table: RigidBodyTable, parts: Iterable[Fitted]) -> float:
    """Return the torque (N m) that the effectors among these parts can always give: in norm if the limit of [spacecraft] is
    a norm, else about all axes at once; infinite if no effector limits it."""
    kind = "norm" if table.spacecraft.limit == "norm" else "axis"
    telling = ((fitted.part.hook("sure_torque"), fitted.params) for fitted in parts)
    return min((tell(params, kind) for tell, params in telling if tell is not None), default=math.inf)
