"""Numbers of sensors that estimators assume are those of the sensors, where an estimator's table does not state its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from starhold.algebra.structure import leaves
from starhold.parts.part import Fitted


def with_assumed(parts: Sequence[Fitted], tables: Sequence[Mapping[str, Any]]) -> tuple[Fitted, ...]:
    """Return the parts of raw tables with these numbers."""
    made: list[Fitted] = []
    for fitted, table in zip(parts, tables, strict=True):
        added: dict[str, Any] = {}
        for keys, more, sensors in _assumed(fitted, parts):
            rows = [{key: getattr(one.params, key) for key in keys} for one in sensors]
            added |= {key: value for key, value in rows[0].items() if key not in table}
            added |= {} if more in table else {more: tuple(tuple(leaves(tuple(row.values()))) for row in rows[1:])}
        made.append(replace(fitted, params=fitted.params._replace(**added)) if added else fitted)
    return tuple(made)


def is_assumed(parts: Sequence[Fitted], tables: Sequence[Mapping[str, Any]], place: int, key: str) -> bool:
    """Whether an estimator assumes this number of the part at a place, because its table does not state its own."""
    return any(
        key in keys and parts[place] in sensors and (key if parts[place] is sensors[0] else more) not in table
        for fitted, table in zip(parts, tables, strict=True)
        for keys, more, sensors in _assumed(fitted, parts)
    )


def _assumed(fitted: Fitted, parts: Sequence[Fitted]) -> list[tuple[tuple[str, ...], str, list[Fitted]]]:
    """The keys that an estimator may leave to sensors, the key of a row for each sensor after the first, and those that
    have them all."""
    module, listed = fitted.part.module, list[tuple[tuple[str, ...], str, list[Fitted]]]()
    for reading, keys in getattr(module, "ASSUMES", {}).items():
        sensors = [one for one in parts if one.part.role == "sensor" and reading in one.part.module.Reading._fields]
        if sensors and all(hasattr(one.params, key) for one in sensors for key in keys):
            listed.append((keys, module.SEVERAL[reading], sensors))
    return listed
