"""Writes laws and parts as TOML."""

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping
from functools import reduce
from typing import Any

from starhold.errors import InputError
from starhold.laws.catalogue import Law
from starhold.parts.catalogue import telling
from starhold.parts.contract import Field
from starhold.parts.part import Part
from starhold.scenario.bodies import bodies, body_for
from starhold.scenario.checking import read_toml
from starhold.scenario.tables import shared_values

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return tables as TOML that reads back unchanged. InputError where a text contains half of a surrogate pair."""
    lines = [f"{_key(name)} = {_value(item)}" for name, item in tables.items() if not _is_table(item)]
    for name, item in tables.items():
        if _is_table(item):
            head = f"[{_key(name)}]" if isinstance(item, dict) else f"[[{_key(name)}]]"
            for table in [item] if isinstance(item, dict) else item:
                lines += ["", head, *(f"{_key(key)} = {_value(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _is_table(item: Any) -> bool:
    return isinstance(item, dict) or (isinstance(item, list) and bool(item) and all(isinstance(x, dict) for x in item))


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:
            raise InputError("", "", json.dumps(value), "text of whole characters") from None
        # JSON's strings are TOML's, except for a character that JSON leaves unescaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(name)} = {_value(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    # TOML writes finite floats, infinity and NaN as JSON does, except for capitals.
    return str(value).lower() if isinstance(value, bool) else repr(value)


def law_table(law: Law, gains: Any) -> str:
    """Return a [[law]] table with these gains, without those set by shared keys; floats read back exactly."""
    which = f'type = "{law.name}"' if law.file is None else f"file = {json.dumps(str(law.file))}"
    lines = ["[[law]]", which]
    for item, value in _own(law.fields(), gains, body_for(law).tables.SHARED):
        # JSON's strings, integers, finite floats and arrays are TOML's too.
        lines.append(f"{item.name} = {json.dumps(item.written(value), allow_nan=False)}")
    return "\n".join(lines) + "\n"


def scenario_with(law: Law, gains: Any) -> str:
    """Return a small scenario of a law's body, as TOML, with this law alone and the sensors that it reads."""
    body, sensors = body_for(law), telling(law.reads)
    given = shared_values(law.fields(), gains, body.tables.SHARED)
    orbits = bool(given) or any("two-body" in sensor.part.needs for sensor in sensors)
    tables = read_toml(body.example + (body.orbit if orbits else ""), law.name)
    for key, value in given.items():
        *path, name = key.split(".")
        reduce(lambda table, inner: table.setdefault(inner, {}), path, tables)[name] = list(value)
    text = toml_text(tables)
    if sensors:
        text += toml_text({"part": [part_table(sensor.part, sensor.params) for sensor in sensors]})
    return text + law_table(law, gains)


def part_table(part: Part, params: Any) -> dict[str, Any]:
    """Return a [[part]] table with these parameters, without infinite or empty ones and those set by shared keys."""
    table: dict[str, Any] = {"type": part.name} if part.file is None else {"file": str(part.file)}
    body = bodies().get(part.body or "rigid-body")
    for item, value in _own(part.fields(), params, body.tables.SHARED if body else ()):
        if value == () or (isinstance(value, float) and not math.isfinite(value)):
            continue
        table[item.name] = json.loads(json.dumps(item.written(value)))
    return table


def _own(declared: list[Field], values: Iterable[Any], shared: Collection[str]) -> list[tuple[Field, Any]]:
    """Return the parameters that a part's own table holds, with their values."""
    return [(item, value) for item, value in zip(declared, values, strict=True) if item.gain.shared not in shared]


def template_text(body: str) -> str:
    """Return a commented scenario for the body of this name, which runs as it is and names every key."""
    return bodies()[body].template
