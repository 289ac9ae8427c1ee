"""The parts that short forms stand for: [wheels], [sensor], [environment] and other tables in place of [[part]]."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from starhold.parts.catalogue import find, fit
from starhold.parts.effectors.layouts import nasa_standard, pyramid, three_orthogonal
from starhold.parts.effectors.wheel_units import WHEEL_UNITS
from starhold.parts.effectors.wheels import ALLOCATIONS, State, make_wheels
from starhold.parts.part import Fitted
from starhold.scenario.bodies.rigid_body.tables import RigidBodyTable, Rotor, WheelsTable

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

LAYOUTS = {"orthogonal": three_orthogonal, "pyramid": pyramid, "nasa-standard": nasa_standard}
NUMBERS = ("inertia", "torque_limit", "momentum_limit", "viscous", "coulomb")


def written_out(scenario: Scenario, target: Fitted, effectors: tuple[Fitted, ...]) -> tuple[Fitted, ...]:
    """The parts of the scenario in the order in which they act: its target and its effectors, those that its other short
    forms stand for, and those of [[part]] tables."""
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
    """The effectors of the tables: their reaction wheels, if any. ValueError says what is missing or cannot be."""
    shared, single = table.wheels or WheelsTable(), table.wheel
    if table.wheels is None and not single:
        return ()
    axes = [wheel.axis for wheel in single] or list(LAYOUTS[shared.layout or ""]())
    rotors: list[Rotor] = [*single] or [shared] * len(axes)
    columns = {name: [_number(name, rotor, shared, place) for place, rotor in enumerate(rotors, 1)] for name in NUMBERS}
    wheels = make_wheels(axes, **columns)._replace(allocation=ALLOCATIONS.index(shared.allocation))
    momenta = tuple((rotor if "momentum" in rotor.model_fields_set else shared).momentum for rotor in rotors)
    return (Fitted(find("effector", "wheels"), wheels, start=State(momenta)),)


def _number(name: str, table: Rotor, shared: Rotor, place: int) -> float:
    """A number of a wheel: its own, its unit's, what all share, or their unit's."""
    for given in (table, shared):
        value: Any = getattr(given, name)
        if value is not None:
            return float(value)
        if given.unit is not None:
            if given.unit not in WHEEL_UNITS:
                raise ValueError(f"no wheel unit {given.unit!r}; one of {', '.join(WHEEL_UNITS)}")
            wheel_unit = getattr(WHEEL_UNITS[given.unit], name, None)
            if wheel_unit is not None:
                return float(wheel_unit)
    if name in ("viscous", "coulomb"):
        return 0.0
    raise ValueError(f"wheel {place} has no {name}: give it, or a unit")
