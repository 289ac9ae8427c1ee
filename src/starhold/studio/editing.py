"""The data for the editor: the line of an error in a file, and the keys and values allowed in each table."""

import re
from pathlib import Path
from typing import Any, cast

from starhold.campaign.verify import check as check_requirements
from starhold.errors import InputError
from starhold.laws.catalogue import catalogue
from starhold.scenario.building import build
from starhold.scenario.checking import read_toml
from starhold.scenario.json_schema import json_schema
from starhold.scenario.parts import installed
from starhold.scenario.reading import builtin_names, parse
from starhold.scenario.writing import law_table, part_table, toml_text

TABLES = (".csv", ".aem", ".reqif")
"""The suffixes of files of numbers; other files that a scenario names are Python."""

_HEAD = re.compile(r"\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?$")


def check(text: str, where: str, folder: Any) -> dict[str, Any]:
    """Return the name and laws of a scenario that can be flown and verified, or the first error in its text."""
    try:
        scenario = parse(text, where, folder)
        for entry in scenario.laws:
            build(scenario, entry)
        if scenario.table.requirement:
            check_requirements(scenario, scenario.laws[0])
    except InputError as error:
        line = line_of(text, error.key, str(error))
        return {"error": str(error), "key": error.key, "line": line}
    return {"name": scenario.name, "laws": [entry.name for entry in scenario.laws], "body": scenario.body}


def files_run(text: str) -> list[str]:
    """Return the files that are run as Python when a scenario with this text is read."""
    try:
        tables = read_toml(text, "")
    except InputError:
        return []
    files: set[str] = set()
    left: list[Any] = [tables]
    while left:
        value = left.pop()
        if isinstance(value, dict):
            given = cast(dict[str, Any], value)
            file = given.get("file")
            if isinstance(file, str) and Path(file).suffix.lower() not in TABLES:
                files.add(file)
            left += given.values()
        elif isinstance(value, list):
            left += cast(list[Any], value)
    return sorted(files)


def line_of(text: str, key: str, message: str = "") -> int | None:
    """Return the line, from 1, of a key named as in errors ("law[2].k_rate", "spacecraft.inertia"), of its table where the
    key is missing, or that of a TOML error; None where there is none."""
    if place := re.search(r"at line (\d+)", message):
        return int(place[1])
    parts = re.findall(r"([^.\[\]]+)(?:\[(\d+)\])?", key.replace("law ", "law."))
    if not parts:
        return None
    counts: dict[str, int] = {}
    table, best, wanted = "", None, (parts[0][0], int(parts[0][1] or 1))
    leaf = parts[1][0] if len(parts) > 1 else None
    for number, line in enumerate(text.splitlines(), 1):
        if head := _HEAD.match(line):
            table = head[2]
            counts[table] = counts.get(table, 0) + 1
            if (table, counts[table]) == wanted or table == key:
                best = number
        elif "=" in line and not line.lstrip().startswith("#"):
            name = line.partition("=")[0].strip().strip('"')
            here = (table, counts.get(table, 0))
            if (here == wanted and name == leaf) or (not table and name == key) or (table == parts[0][0] == name):
                return number
    return best


def words() -> dict[str, Any]:
    """Return the tables of scenario files of every body, by name, and those of laws and parts, by type; each has its keys
    with their meanings and the words that are allowed as values, if any."""
    schema = json_schema()
    tables: dict[str, dict[str, Any]] = {}
    kinds: dict[str, dict[str, Any]] = {"law": {}, "part": {}}

    def opened(what: Any) -> Any:
        while isinstance(what, dict) and "$ref" in what:
            what = schema["$defs"][what["$ref"].rpartition("/")[2]]
        return what

    def keys(table: Any) -> dict[str, Any]:
        return {name: _meaning(opened(item)) for name, item in opened(table).get("properties", {}).items()}

    for body in schema["anyOf"]:
        for name, item in body["properties"].items():
            if name in kinds:
                for one in opened(item)["items"]["anyOf"]:
                    kind_table = opened(one)
                    kind = kind_table["properties"].get("type", {})
                    label = kind.get("const") or kind.get("default")
                    if label:
                        kinds[name].setdefault(str(label), {}).update(keys(kind_table))
                continue
            item = opened(item)
            options = [opened(one) for one in item.get("anyOf", [item])]
            described = next(
                (one for one in (*options, *(opened(o.get("items", {})) for o in options)) if "properties" in one), None
            )
            if described is None:
                tables.setdefault("", {})[name] = _meaning(item)
            else:
                tables.setdefault(name, {}).update(keys(described))
    return {"tables": tables, **kinds}


def _meaning(item: Any) -> dict[str, Any]:
    options = [item, *item.get("anyOf", [])]
    choices = next((one["enum"] for one in options if isinstance(one, dict) and "enum" in one), None)
    if choices is None and item.get("type") == "boolean":
        choices = [True, False]
    return {"text": item.get("description", ""), **({} if choices is None else {"words": choices})}


def choices() -> dict[str, Any]:
    """Return the available laws and parts, each with a line about it and a table to insert into a file, and the built-in
    scenarios."""

    laws = [
        {"name": name, "text": law.card.summary, "table": law_table(law, law.examples()[0])}
        for name, law in catalogue().items()
        if law.examples()
    ]
    parts: list[dict[str, str]] = []
    for name, part in installed().items():
        examples = part.module.examples() if hasattr(part.module, "examples") else []
        if part.role in ("body", "law") or not examples:
            continue
        try:
            table = toml_text({"part": [part_table(part, examples[0])]}).lstrip("\n")
        except (InputError, TypeError, ValueError):
            # A part with a table of samples, which does not fit on a line of a file.
            continue
        parts.append({"name": name, "text": f"{part.role}: {part.module.CARD.summary}", "table": table})
    return {"laws": laws, "parts": parts, "scenarios": builtin_names()}
