"""Reads the [[law.monitor]] tables of a law of modes, with the unit of the quantity that each monitor checks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field
from pydantic_core import PydanticCustomError

from starhold.algebra.quantity import Quantity, quantities
from starhold.errors import InputError
from starhold.laws.monitors import TIMES, Monitor
from starhold.loop.closed_loop import is_recorded
from starhold.parts.bodies.rigid_body import Sample
from starhold.parts.catalogue import fit
from starhold.parts.part import Fitted
from starhold.scenario.checking import nearest, show
from starhold.scenario.quantity import quantity, raw, reader
from starhold.scenario.tables import Name, Table

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario


class MonitorTable(Table):
    """A monitor of a reading or an estimate; when it trips, the mode `on_loss` begins."""

    name: Annotated[Name, Field(description="its name in errors")]
    kind: Annotated[Literal["range", "rate", "stuck", "residual"], Field(description="property that it checks")]
    reading: Annotated[str | None, Field(description="the name of a sensor's reading")] = None
    estimate: Annotated[str | None, Field(description="in its place the name of an estimated quantity")] = None
    sensor: Annotated[str | None, Field(description="the name of the sensor; the first with this reading if absent")] = None
    limit: Annotated[Any, *raw("limit beyond which it trips, in the quantity's unit; per second for rate, a time for stuck")]
    times: Annotated[int, *quantity(replace(TIMES, whole=True))] = 1
    modes: Annotated[list[str] | None, Field(description="the modes in which it is active; all if absent", min_length=1)] = (
        None
    )


def read_monitor(
    table: MonitorTable, modes: Sequence[str], scenario: Scenario, where: str, key: str
) -> tuple[Monitor, list[float]]:
    """Return the monitor of a table with its numbers, in a law whose modes have these names. InputError where the scenario
    has no such reading or estimate, the law has no such mode, or the limit is in the wrong unit."""
    unknown = next((name for name in table.modes or () if name not in modes), None)
    if unknown is not None:
        raise InputError(where, f"{key}.modes", show(unknown), nearest(unknown, [*modes]))
    if (table.reading is None) == (table.estimate is None):
        raise InputError(where, key, "neither reading nor estimate" if table.reading is None else "both", "one of them")
    estimators = [fitted for fitted in scenario.parts if fitted.role == "estimator"]
    sensor: int | None = None
    if table.reading is None:
        if table.kind == "residual" or table.sensor is not None:
            unfit = "kind" if table.kind == "residual" else "sensor"
            raise InputError(where, f"{key}.{unfit}", show(getattr(table, unfit)), "a reading, in place of an estimate")
        watched, given = str(table.estimate), estimators
    else:
        watched, given = table.reading, _sensors_of(table.reading, scenario)
        names = [fitted.called for fitted in given]
        if table.sensor is not None and table.sensor not in names:
            allowed = nearest(table.sensor, names) if names else f"none, because no sensor gives {watched}"
            raise InputError(where, f"{key}.sensor", show(table.sensor), allowed)
        sensor = 0 if table.sensor is None else names.index(table.sensor)
    what = "estimate" if sensor is None else "reading"
    declared = _known(given[sensor or 0 :][:1])
    if watched not in declared:
        known = _known(estimators if sensor is None else [f for f in scenario.parts if f.part.role == "sensor"])
        raise InputError(where, f"{key}.{what}", show(watched), _one_of(watched, known, f"{what} is there"))
    if table.kind == "residual" and watched not in _known(estimators):
        raise InputError(where, f"{key}.reading", show(watched), _one_of(watched, _known(estimators), "estimator is there"))
    quantity_there = declared[watched]
    size = SIZES[quantity_there.dimension]
    if size == SIZES["quaternion"] and table.kind == "range":
        raise InputError(where, f"{key}.kind", show(table.kind), "rate, stuck or residual of an attitude, which has no size")
    unit = "rad" if size == SIZES["quaternion"] else quantity_there.unit
    looks = tuple(sorted({modes.index(name) for name in table.modes or ()}))
    monitor = Monitor(table.name, table.kind, watched, unit, size, sensor, looks)
    try:
        limit = reader(monitor.fields()[0].gain)(table.limit)
    except PydanticCustomError as error:
        raise InputError(where, f"{key}.limit", show(table.limit), error.message().removeprefix("must be ")) from None
    return monitor, [limit, float(table.times)]


SIZES = {"quaternion": 4, "axis": 3, "": 1}
"""The number of components of a quantity of each dimension."""


def _known(fitted: Iterable[Fitted]) -> dict[str, Quantity]:
    """Return the quantities that these sensors or estimators give, by name."""
    known: dict[str, Quantity] = {}
    for part in (one.part for one in fitted):
        kind = part.module.Estimate if part.role == "estimator" else part.module.Reading
        # Quantities that are not recorded declare no units; they have those of the body's state.
        kinds = quantities(kind if part.role == "estimator" or is_recorded(part) else Sample)
        known |= {name: one for name, one in kinds.items() if name in kind._fields and one.dimension in SIZES}
    return known


def _sensors_of(reading: str, scenario: Scenario) -> list[Fitted]:
    """Return the sensors that give a reading, in the order of the loop."""
    noise = getattr(scenario.table, "sensor", None)
    short = [fit("sensor", "gaussian", 0.0, 0.0)] if noise is not None and any(dict(noise).values()) else []
    sensors = [*short, *(fitted for fitted in scenario.parts if fitted.part.role == "sensor")]
    return [fitted for fitted in sensors if reading in fitted.part.module.Reading._fields]


def _one_of(name: str, known: Mapping[str, Any], what: str) -> str:
    return nearest(name, list(known)) if known else f"none, because no {what}"
