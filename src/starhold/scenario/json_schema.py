"""The JSON Schema of scenario files, with the installed laws and parts."""

from typing import Any

from starhold.scenario.bodies import bodies, others
from starhold.scenario.bodies.interface import Body
from starhold.scenario.modes import ModeTable, modes_model
from starhold.scenario.parts import EstimatorTable, installed, part_model
from starhold.scenario.schema import LawTable, law_model


def json_schema() -> dict[str, Any]:
    """Return a JSON Schema of scenario files for every body, with which editors complete and check them."""
    known = [_file_schema(body) for body in (*bodies().values(), *others())]
    shared: dict[str, Any] = {}
    for schema in known:
        shared |= schema.pop("$defs", {})
    title = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "starhold scenario", "type": "object"}
    return {**title, "anyOf": known, "$defs": shared}


def _file_schema(body: Body) -> dict[str, Any]:
    """Return a JSON Schema of the files of one body: its tables, those of its laws, gains and design forms, and of its
    parts."""
    base = body.law_table
    schema = body.tables.model_json_schema()
    known = schema.setdefault("$defs", {})
    tables = _law_schemas(body, base, known)
    if body.modes:
        table = modes_model(base).model_json_schema()
        known.update(table.pop("$defs", {}))
        table["properties"]["mode"] = {
            "type": "array",
            "minItems": 2,
            "items": {"anyOf": _law_schemas(body, ModeTable, known)},
        }
        table["required"] = ["type", "mode"]
        tables.append(table)
    schema["properties"]["law"] = {"type": "array", "minItems": 1, "items": {"anyOf": tables}}
    schema["properties"]["part"] = {"type": "array", "items": {"anyOf": part_schemas(body.name, tuple(body.tables.SHARED))}}
    schema["required"].append("law")
    return schema


def _law_schemas(body: Body, base: type[LawTable], known: dict[str, Any]) -> list[dict[str, Any]]:
    """Return JSON Schemas of the tables of all laws for a body, and of a law from a file, with the keys of `base` besides
    the gains; add their definitions to the known ones."""
    tables: list[dict[str, Any]] = []
    for model in (
        law_model(law, form, base, tuple(body.tables.SHARED)) for law in body.laws().values() for form in (None, *law.forms)
    ):
        table = model.model_json_schema()
        known.update(table.pop("$defs", {}))
        # A TOML table must state its type, although pydantic has a default for it.
        table["required"] = sorted({"type", *table.get("required", [])} | ({"form"} & set(table["properties"])))
        tables.append(table)
    shared = base.model_json_schema()
    shared["properties"].pop("type")
    file = {"type": "string", "description": "a Python file that holds a law, relative to this one; it is run"}
    from_file = {"title": "LawFromFile", "type": "object", "properties": {"file": file, **shared["properties"]}}
    needed = [name for name in shared.get("required", []) if name != "type"]
    known.update(shared.get("$defs", {}))
    return [*tables, from_file | {"required": ["file", *needed], "not": {"required": ["type"]}}]


def part_schemas(body: str, shared: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return JSON Schemas of the [[part]] tables of a body: one for each installed part, and one for a part from a file;
    shared: scenario keys that set parameters of all parts."""
    schemas = [part_model(part, shared).model_json_schema() for part in installed().values() if part.body in ("", body)]
    for table in schemas:
        table["required"] = sorted({"type", *table.get("required", [])})
    file = {"type": "string", "description": "a Python file that holds a part, relative to this one; it is run"}
    keys = {name: key for name, key in EstimatorTable.model_json_schema()["properties"].items() if name != "type"}
    from_file = {"title": "PartFromFile", "type": "object", "properties": {"file": file, **keys}, "required": ["file"]}
    return [*schemas, from_file | {"not": {"required": ["type"]}}]
