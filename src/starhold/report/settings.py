"""The settings of a scenario as tables: all values of its file and the defaults, with their meanings."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from pydantic import BaseModel

from starhold.report.tables import listed, titled
from starhold.report.text import number_text, pretty_unit
from starhold.scenario.quantity import meaning

if TYPE_CHECKING:
    from starhold.parts.part import Fitted
    from starhold.scenario.reading import Scenario

MANY = 9
"""A setting with more numbers than this is shown by its first and its last."""


def settings(scenario: Scenario) -> str:
    """Return all tables of a scenario as HTML, including those of its parts."""
    parts: list[str] = []
    written = scenario.raw
    shared = {key: scenario.table.shared[key] for key in _taken(scenario)}
    for name in type(scenario.table).model_fields:
        table = getattr(scenario.table, name)
        # The draws of a campaign are not flown here, nor is [target] if a part replaces it.
        is_part = any(fitted.part.role == name for fitted in scenario.parts)
        if isinstance(table, BaseModel) and name != "campaign" and not is_part:
            parts.append(_table(name, table, shared, written.get(name, {})))
        elif table is None:
            # Shown with each part if the table is absent.
            shared = {key: value for key, value in shared.items() if not key.startswith(f"{name}.")}
    parts += [
        _part(fitted, shared, is_part) for fitted, is_part in zip(scenario.parts, written.get("part", []), strict=True)
    ]
    return f'<div class="columns">{"".join(parts)}</div>'


def _taken(scenario: Scenario) -> set[str]:
    """Return the keys that set parameters of the parts and laws of a scenario, including targets of modes."""
    fitted = [*scenario.parts, *(target for entry in scenario.laws for target in entry.targets)]
    declared = [item for one in fitted if not one.part.table for item in one.part.fields()]
    declared += [item for entry in scenario.laws for item in entry.law.fields(entry.form)]
    return {item.gain.shared for item in declared} & {*scenario.table.shared}


def _table(name: str, table: Any, shared: Mapping[str, Any], written: Any) -> str:
    """Return one table of the scenario with the descriptions of its keys, and numbers with units as in the file; keys
    without a value are left out, unless parts supply a default."""
    rows: list[tuple[str, ...]] = []
    for key, field in type(table).model_fields.items():
        value, given = getattr(table, key), ""
        if value is None and shared.get(f"{name}.{key}") not in (None, 0, math.inf):
            value, given = shared[f"{name}.{key}"], ", by default"
        if isinstance(value, BaseModel):
            texts = written.get(key, {})
            for name_within in type(value).model_fields:
                if (number := getattr(value, name_within)) is not None:
                    text = with_units(texts.get(name_within), number) or _value(number)
                    rows.append((f"{key}.{name_within}", text, ""))
        elif value is not None:
            text = (with_units(written.get(key), value) or _value(value)) + given
            rows.append((key, text, pretty_unit(meaning(field))))
    return titled(name.replace("_", " "), listed(rows))


def with_units(written: Any, value: Any) -> str:
    """Return the text of numbers in the file, if they have units there; else ""."""
    texts = cast(list[Any], written) if isinstance(written, list) else [written]
    numbers = isinstance(value, (int, float, tuple, list, np.ndarray)) and not isinstance(value, bool)
    return ", ".join(texts) if numbers and texts and all(isinstance(text, str) for text in texts) else ""


def _part(fitted: Fitted, shared: Collection[str], written: Mapping[str, Any]) -> str:
    """Return the parameters of a part with their units and meanings; numbers that the file gives with units are shown as
    written. Parameters set by shared keys are left out."""
    rows: list[tuple[str, ...]] = []
    for item, value in zip(fitted.part.fields(), fitted.params, strict=True):
        if item.gain.shared in shared:
            continue
        text = _value(item.written(value))
        unit = "" if item.gain.unit == "1" or item.gain.choices else f" {item.gain.unit}"
        rows.append((item.name, with_units(written.get(item.name), value) or text + unit, item.gain.text))
    return titled(f"{fitted.part.role} {fitted.called}", listed(rows))


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and math.isinf(value):
        return "none"
    if isinstance(value, tuple) and len(value) > MANY:
        return f"{number_text(value[0])} to {number_text(value[-1])}, {len(value)} values"
    return number_text(value) if isinstance(value, (int, float, tuple, list, np.ndarray)) else str(value)
