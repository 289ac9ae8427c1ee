"""The page of the keys of scenario files, from the JSON Schema that `starhold schema` prints."""

from __future__ import annotations

import re
from typing import Any

from generators.tables import table
from starhold.scenario.json_schema import json_schema
from starhold.scenario.modes import Condition, ModeTable, modes_model
from starhold.scenario.monitors import MonitorTable
from starhold.scenario.schema import LawTable

HEAD = """# Scenario keys

Written from the JSON Schema of scenario files by `make docs`; `starhold schema` prints it, for completion and checks in
editors. [Scenario files](scenarios.md) explains how the tables belong together. The gains of `[[law]]` tables stand on
the pages of [laws](laws.md), the parameters of `[[part]]` tables on those of [parts](parts.md).

Plain numbers are in the unit given here, strings carry their own: `"20 mNm"`. *scaled*: a plain number counts in the units
of the scenario's libration point. A default of `none` means that the key may be left out.
"""
BODIES = {
    "spacecraft": "A spacecraft that turns",
    "libration": "A craft near a libration point",
    "body": "A body of your own",
}
"""What a file is about, by the table that says so."""
MODES = """A `[[law]]` of `type = "modes"` has two or more `[[law.mode]]` tables, which hold the gains of their laws too;
[Modes](modes.md) tells what they mean."""
APART = ("law", "part")
LONGEST = 60
"""Characters of a default that is shown."""


def page() -> str:
    """Every table of every kind of file."""
    schema = json_schema()
    known = schema["$defs"]
    lines = [HEAD]
    seen: list[str] = []
    order = {name: n for n, name in enumerate(BODIES)}
    for file in sorted(schema["anyOf"], key=lambda f: min(order.get(k, 9) for k in f["properties"])):
        mark = next(name for name in BODIES if name in file["properties"])
        lines += [f"## {BODIES[mark]}", "", *keys_of(file, {*APART, *tables_of(file)}), ""]
        for key, item in file["properties"].items():
            name = _referred(item)
            if name is None or key in APART:
                continue
            many = item.get("type") == "array" or any(x.get("type") == "array" for x in item.get("anyOf", ()))
            head = f"[[{key}]]" if many else f"[{key}]"
            lines += _table(head, name, known, seen)
    lines += ["## Modes", "", MODES, ""]
    heads = {"[[law]]": modes_model(LawTable), "[[law.mode]]": ModeTable, "until, back": Condition}
    for head, model in (heads | {"[[law.monitor]]": MonitorTable}).items():
        told = model.model_json_schema()
        lines += [f"### `{head}`", "", " ".join(told["description"].split()), "", *keys_of(told), ""]
    return "\n".join(lines)


def tables_of(file: dict[str, Any]) -> list[str]:
    """The keys of a file that are tables."""
    return [key for key, item in file["properties"].items() if _referred(item)]


def _table(head: str, name: str, known: dict[str, Any], seen: list[str]) -> list[str]:
    """A table with its keys, or a line where it was told before."""
    model = known[name]
    lines = [f"### `{head}`", "", " ".join(model.get("description", "").split()), ""]
    if name in seen:
        return [*lines[:2], "As above.", ""]
    seen.append(name)
    lines += [*keys_of(model), ""]
    for key, item in model["properties"].items():
        inner = _referred(item)
        if inner is not None and inner in known and known[inner].get("properties"):
            inside = f"{head.strip('[]')}.{key}"
            lines += _table(f"[[{inside}]]" if item.get("type") == "array" else f"[{inside}]", inner, known, seen)
    return lines


def keys_of(model: dict[str, Any], without: Any = ()) -> list[str]:
    """The keys of a table."""
    required = model.get("required", [])
    rows: list[list[str]] = []
    for key, item in model["properties"].items():
        if key in without:
            continue
        text, unit = _meaning(item.get("description", ""))
        default = "required" if key in required else _default(item.get("default"))
        rows.append([f"`{key}`", _allowed(item), unit, default, text])
    return [table(["key", "value", "unit", "default", "meaning"], rows)] if rows else []


def _meaning(description: str) -> tuple[str, str]:
    """A description without its unit, and the unit."""
    found = re.fullmatch(r"(.*) \(([^()]*(?:\([^()]*\)[^()]*)*)\)", description, flags=re.DOTALL)
    if found is None or (" " in found[2] and not re.match(r"no unit|scaled|[\w^/() ]+$", found[2])):
        return description, ""
    unit = found[2].replace("no unit", "1")
    return found[1], re.sub(r"scaled, or with a unit such as (.*)", r"scaled, or \1", unit)


def _default(value: Any) -> str:
    if value is None:
        return "`none`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    text = f'"{value}"' if isinstance(value, str) else f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"`{text}`" if len(text) <= LONGEST else "a list"


def _allowed(item: dict[str, Any]) -> str:
    """What may stand there, in words."""
    if "const" in item:
        return f"`{item['const']}`"
    if "enum" in item:
        return ", ".join(f"`{word}`" for word in item["enum"])
    if "anyOf" in item:
        # A string may stand in the place of every number, with a unit.
        kinds = [x.get("description") or _allowed(x) for x in item["anyOf"] if x.get("type") != "null"]
        kinds = [k for n, k in enumerate(kinds) if k not in kinds[:n]]
        numbers = any("number" in k for k in kinds)
        return " or ".join(k for k in kinds if not (numbers and k == "text"))
    if "$ref" in item:
        return "a table"
    if item.get("type") in ("number", "integer"):
        return _bounded(item)
    if item.get("type") == "array":
        few = item.get("maxItems") if item.get("maxItems") == item.get("minItems") else None
        of = _allowed(item.get("items", {}))
        return f"{few or 'a list of'} {_several(of) or 'values'}"
    return {"boolean": "`true` or `false`", "string": "text", "object": "a table"}.get(item.get("type", ""), "")


def _bounded(item: dict[str, Any]) -> str:
    word = "a whole number" if item["type"] == "integer" else "a number"
    bounds = [
        f"{sign} {item[name]:g}"
        for name, sign in (("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤"), ("exclusiveMaximum", "<"))
        if name in item and abs(item[name]) < 2**53
    ]
    return " ".join([word, " and ".join(bounds)]).strip()


def _referred(item: Any) -> str | None:
    """The table that a key refers to, be it in a list or beside null."""
    if isinstance(item, dict):
        if "$ref" in item:
            return item["$ref"].rpartition("/")[2]
        for inner in (item.get("items"), *item.get("anyOf", ())):
            found = _referred(inner)
            if found is not None:
                return found
    return None


def _several(word: str) -> str:
    """The plural of a kind of value."""
    return re.sub(r"^a (number|table)", r"\1s", word).replace("a list of numbers", "rows of numbers")
