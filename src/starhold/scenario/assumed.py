"""An estimator assumes the parameters of the sensors in its loop, such as their noise, unless its own table states them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from starhold.algebra.structure import leaves
from starhold.parts.part import Fitted


def with_assumed(parts: Sequence[Fitted], tables: Sequence[Mapping[str, Any]]) -> tuple[Fitted, ...]:
    """Return the parts with the assumed sensor parameters filled in; tables: the raw table of each part."""
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
    """Return whether an estimator assumes the parameter `key` of the sensor `parts[place]`, not stated in its own table."""
    return any(
        key in keys and parts[place] in sensors and (key if parts[place] is sensors[0] else more) not in table
        for fitted, table in zip(parts, tables, strict=True)
        for keys, more, sensors in _assumed(fitted, parts)
    )


def _assumed(fitted: Fitted, parts: Sequence[Fitted]) -> list[tuple[tuple[str, ...], str, list[Fitted]]]:
    """Return, for each reading, the keys that an estimator may take from sensors, its key for the rows of the second and
    further sensors, and the sensors, all of which have these keys."""
    module, listed = fitted.part.module, list[tuple[tuple[str, ...], str, list[Fitted]]]()
    for reading, keys in getattr(module, "ASSUMES", {}).items():
        sensors = [one for one in parts if one.part.role == "sensor" and reading in one.part.module.Reading._fields]
        if sensors and all(hasattr(one.params, key) for one in sensors for key in keys):
            listed.append((keys, module.SEVERAL[reading], sensors))
    return listed
