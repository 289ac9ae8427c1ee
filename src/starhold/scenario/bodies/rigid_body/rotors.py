"""From the wheel tables of a scenario to wheels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from starhold.parts.effectors.layouts import nasa_standard, pyramid, three_orthogonal
from starhold.parts.effectors.wheel_units import WHEEL_UNITS
from starhold.parts.effectors.wheels import ALLOCATIONS, Wheels, make_wheels
from starhold.scenario.bodies.rigid_body.tables import Rotor, WheelsTable, WheelTable

LAYOUTS = {"orthogonal": three_orthogonal, "pyramid": pyramid, "nasa-standard": nasa_standard}
NUMBERS = ("inertia", "torque_limit", "momentum_limit", "viscous", "coulomb")


def make_rotors(shared: WheelsTable | None, single: Sequence[WheelTable]) -> Wheels | None:
    """The wheels of the tables; None where there are none. ValueError says what is missing or cannot be."""
    if shared is None and not single:
        return None
    if single:
        axes = [table.axis for table in single]
    else:
        assert shared is not None
        assert shared.layout is not None
        axes = list(LAYOUTS[shared.layout]())
    tables = list(single) if single else [shared] * len(axes)
    columns = {name: [_number(name, table, shared, place) for place, table in enumerate(tables, 1)] for name in NUMBERS}
    allocation = ALLOCATIONS.index("least-squares" if shared is None else shared.allocation)
    return make_wheels(axes, **columns)._replace(allocation=allocation)


def start_momenta(shared: WheelsTable | None, single: Sequence[WheelTable], count: int) -> tuple[float, ...]:
    """The rotors' momenta at the start (N m s); a [[wheel]] table's own, where it says one."""
    common = 0.0 if shared is None else shared.momentum
    if not single:
        return (common,) * count
    return tuple(table.momentum if "momentum" in table.model_fields_set else common for table in single)


def _number(name: str, table: Rotor | None, shared: Rotor | None, place: int) -> float:
    """A number of a wheel: its own, its unit's, what all share, or their unit's."""
    for given in (table, shared):
        if given is None:
            continue
        value: Any = getattr(given, name)
        if value is not None:
            return float(value)
        if given.unit is not None:
            if given.unit not in WHEEL_UNITS:
                raise ValueError(f"no wheel unit {given.unit!r}; one of {', '.join(WHEEL_UNITS)}")
            found = getattr(WHEEL_UNITS[given.unit], name, None)
            if found is not None:
                return float(found)
    if name in ("viscous", "coulomb"):
        return 0.0
    raise ValueError(f"wheel {place} has no {name}: give it, or a unit")
