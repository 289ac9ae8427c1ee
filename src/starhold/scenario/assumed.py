"""Numbers of sensors that estimators assume are those of the sensors, where an estimator's table does not state its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from starhold.algebra.structure import flatten
from starhold.errors import InputError
from starhold.parts.part import Fitted
from starhold.scenario.checking import show


def with_assumed(parts: Sequence[Fitted], tables: Sequence[Mapping[str, Any]], where: str) -> tuple[Fitted, ...]:
    """Return the parts of raw tables with these numbers. InputError where a table lacks one that no sensor gives, or one
    that the estimator cannot assume."""
    return tuple(
        replace(fitted, params=fitted.params._replace(**_missing(fitted, table, parts, where, f"part[{number}]")))
        if hasattr(fitted.part.module, "ASSUMES")
        else fitted
        for number, (fitted, table) in enumerate(zip(parts, tables, strict=True), 1)
    )


def _missing(fitted: Fitted, table: Mapping[str, Any], parts: Sequence[Fitted], where: str, place: str) -> dict[str, Any]:
    module, added = fitted.part.module, dict[str, Any]()
    gains = {item.name: item.gain for item in fitted.part.fields()}
    for reading, keys in module.ASSUMES.items():
        first, *others = _sensors(parts, reading) or [Fitted(fitted.part)]
        for key in keys:
            if key in table:
                continue
            value = getattr(first.params, key, None)
            try:
                added[key] = gains[key].check(value)
            except ValueError as error:
                allowed = f"{error}, in this table" if value is not None else "this key, for no sensor gives it"
                given = "nothing" if value is None else f"{show(value)}, of {first.called}"
                raise InputError(where, f"{place}.{key}", given, allowed.removeprefix("must be ")) from None
        more = module.SEVERAL[reading]
        if more not in table and all(hasattr(other.params, key) for other in others for key in keys):
            rows = [[getattr(other.params, key) for key in keys] for other in others]
            added[more] = tuple(tuple(flatten(tuple(row))) for row in rows)
    return added


def is_assumed(parts: Sequence[Fitted], tables: Sequence[Mapping[str, Any]], place: int, key: str) -> bool:
    """Whether an estimator assumes this number of the part at a place, because its table does not state its own."""
    for fitted, table in zip(parts, tables, strict=True):
        for reading, keys in getattr(fitted.part.module, "ASSUMES", {}).items():
            sensors = _sensors(parts, reading)
            if key in keys and parts[place] in sensors:
                stated = key if parts[place] is sensors[0] else fitted.part.module.SEVERAL[reading]
                return stated not in table
    return False


def _sensors(parts: Sequence[Fitted], reading: str) -> list[Fitted]:
    """The sensors of a reading, in order."""
    return [one for one in parts if one.part.role == "sensor" and reading in one.part.module.Reading._fields]
