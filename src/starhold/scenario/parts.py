"""Reads the [[part]] tables of a scenario: parts of any role that stand in a file of their own, here or in another
package."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import Field, create_model
from pydantic_core import PydanticCustomError

from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.catalogue import PACKAGES, as_part, from_file, parts, read_module, role_of, told
from starhold.parts.part import Fitted, Part
from starhold.scenario.checking import free_name, nearest, show, validate
from starhold.scenario.quantity import any_quantity
from starhold.scenario.tables import Name, Table, check_name

ROLES = tuple(role for role in PACKAGES if role != "body")
"""Roles of parts that stand in [[part]] tables; a law has its own, and so has the body."""
SINGLE = {"estimator": "one estimator", "target": "one target"}
"""Roles that only one part of a loop plays."""


class PartTable(Table):
    """All that a part's table may say beside the part's own parameters."""

    type: str
    name: Annotated[Name | None, Field(description="how recordings and errors call it; the type if absent")] = None


def installed() -> dict[str, Part]:
    """The parts that may stand in [[part]] tables, by name."""
    return {name: part for role in ROLES for name, part in parts(role).items() if not part.table}


@cache
def part_model(part: Part) -> type[Any]:
    """The table of a part."""
    entries: dict[str, Any] = {"type": (Literal[part.name], part.name)}
    for item in part.fields():
        written = item.gain.choices[item.default] if item.gain.choices and not item.required else item.default
        # What is unlimited by default may be left out.
        written = None if isinstance(written, float) and not math.isfinite(written) else written
        kind = Annotated[Any, *any_quantity(item.gain), Field(validate_default=written is not None)]
        entries[item.name] = (kind, ... if item.required else written)
    title = part.name.replace("-", " ").title().replace(" ", "")
    return create_model(title, __base__=PartTable, __doc__=part.card.summary, **entries)


def read_parts(tables: Any, body: str, folder: Path, where: str, units: Any = None) -> tuple[Fitted, ...]:
    """The parts of the [[part]] tables of a file, for a body; file names in them are relative to a folder; units: of a body
    whose numbers are scaled. InputError for the first that is wrong in itself; `check_fit` looks at all of them together."""
    if tables is None:
        return ()
    if not isinstance(tables, list):
        raise InputError(where, "part", show(tables), "[[part]] tables, with double brackets")
    found: list[Fitted] = []
    for number, data in enumerate(cast(list[Any], tables), 1):
        key = f"part[{number}]"
        if not isinstance(data, dict):
            raise InputError(where, key, show(data), "a [[part]] table")
        table = cast(dict[str, Any], data)
        part = _in_file(table, folder, where, key) if "file" in table else _of_type(table, where, key)
        if part.body not in ("", body):
            raise InputError(where, key, f"{part.name}, for the body {part.body}", f"a part for {body}")
        table = {name: value for name, value in table.items() if name != "file"} | {"type": part.name}
        table = _with_rows(part, table, folder, where, key)
        read = validate(part_model(part), table, where, key, ["file"], units)
        taken = {fitted.name for fitted in found}
        values = {item.name: getattr(read, item.name) for item in part.fields()}
        params = part.params(**{name: value for name, value in values.items() if value is not None})
        found.append(Fitted(part, params, free_name(read.name, part.name, taken, where, key)))
    return tuple(found)


def _of_type(table: dict[str, Any], where: str, key: str) -> Part:
    known, name = installed(), table.get("type")
    if isinstance(name, str) and name in known:
        return known[name]
    given = next((part for role in PACKAGES for part in parts(role).values() if part.name == name and part.table), None)
    if given is not None:
        raise InputError(where, f"{key}.type", show(name), f"the [{given.table}] table, which gives it")
    found = "nothing" if name is None else show(name)
    raise InputError(where, f"{key}.type", found, f"{nearest(str(name), list(known))}; or a file")


def _in_file(table: dict[str, Any], folder: Path, where: str, key: str) -> Part:
    given, key = table["file"], f"{key}.file"
    if not isinstance(given, str):
        raise InputError(where, key, show(given), 'the name of a Python file, such as "mine.py"')
    if "type" in table:
        raise InputError(where, key, show(given), "either a type or a file, not both")
    try:
        role = role_of(read_module(folder / given))
        if role not in ROLES:
            raise ValueError(f"its role must be one of {', '.join(ROLES)}, not {role}" if role else "it declares no ROLE")
        part = from_file(folder / given, parts(role), as_part)
        check_name(part.name)
    except OSError as error:
        raise InputError(where, key, f"{show(given)}: {error.strerror}", "a Python file that holds a part") from None
    except PydanticCustomError as error:
        raise InputError(where, key, show(given), f"a file named with {error.message()}") from None
    except ValueError as error:
        raise InputError(where, key, "", f"{show(given)}: {error}") from None
    return part


def _with_rows(part: Part, table: dict[str, Any], folder: Path, where: str, key: str) -> dict[str, Any]:
    """The table with the rows of CSV files in place of their names."""
    found = dict(table)
    for item in part.fields():
        given = table.get(item.name)
        if item.gain.columns and isinstance(given, str):
            allowed = f"a CSV file of {', '.join(item.gain.columns)}, a line of names first or none"
            try:
                text = (folder / given).read_text(encoding="utf-8")
                lines = [line.split(",") for line in text.splitlines() if line.strip() and not line.startswith("#")]
                if lines and not _is_number(lines[0][0]):
                    lines = lines[1:]
                found[item.name] = [[float(cell) for cell in line] for line in lines]
            except OSError as error:
                raise InputError(where, f"{key}.{item.name}", f"{given}: {error.strerror}", allowed) from None
            except ValueError as error:
                raise InputError(where, f"{key}.{item.name}", f"{given}: {error}", allowed) from None
    return found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def check_fit(loop: ClosedLoop, where: str) -> None:
    """InputError where the parts of a loop do not go together."""
    fitted = loop.parts
    for role, most in SINGLE.items():
        found = loop.used(role)
        if len(found) > 1:
            raise InputError(where, _key(found[1]), f"a second {role}, beside {found[0].called}", most)
    acting = [f for f in loop.used("effector") if f.part.flag("ACTS")]
    if len(acting) > 1:
        raise InputError(where, _key(acting[1]), f"a second effector for the command, beside {acting[0].called}", "one")
    readings: dict[str, str] = {}
    for sensor in loop.used("sensor"):
        for name in sensor.part.module.Reading._fields:
            if name in readings and name in loop.body.module.State._fields:
                raise InputError(where, _key(sensor), f"a second sensor of {name}, beside {readings[name]}", "one of each")
            readings[name] = sensor.called
    there = {f.part.name for f in fitted}
    for one in fitted:
        estimates = one.part.role == "estimator"
        for need in one.part.needs:
            if need not in (readings if estimates else there):
                allowed = f"a sensor that measures {need}" if estimates else f"the part {need}"
                raise InputError(where, _key(one), f"no {need}, which {one.called} needs", allowed)
    if loop.used("effector") and "rate" not in loop.body.module.State._fields:
        raise InputError(
            where, _key(loop.used("effector")[0]), f"an effector on the body {loop.body.name}", "a body that turns"
        )


def _key(fitted: Fitted) -> str:
    return f"part {fitted.called}"


def try_parts(loop: ClosedLoop, where: str) -> None:
    """InputError where a part cannot work with its numbers, or a part's file fails: a control step is flown in plain Python,
    which goes through all of it."""
    for fitted in loop.parts:
        try:
            fitted.prepared(loop.period)
        except Exception as error:
            raise InputError(where, _key(fitted), "", _why(error, fitted.part)) from None
    files = [f.part for f in loop.parts if f.part.file is not None]
    if not files:
        return
    try:
        step, carry, setup = make_step(loop.composition()), loop.carry(), loop.setup()
        carry = step.update(carry, 0, (loop.seed, 0), loop.gains, loop.craft, setup)
        after = step.propagate(carry, loop.craft, setup)
        step.sample(after, 1, setup)
        again = step.update(after, 1, (loop.seed, 0), loop.gains, loop.craft, setup)
    except Exception as error:
        guilty = next((part for part in files if _line_of(error, part)), None)
        if guilty is None:
            raise
        raise InputError(where, f"part {guilty.name}", "", _why(error, guilty)) from None
    if not _alike(carry, again):
        raise InputError(
            where, f"part {files[0].name}", "", "its equations must return states formed as those they are given"
        )


def _alike(one: Any, other: Any) -> bool:
    if isinstance(one, tuple):
        same = isinstance(other, tuple) and len(cast(Any, one)) == len(cast(Any, other))
        return same and all(_alike(a, b) for a, b in zip(cast(Any, one), cast(Any, other), strict=True))
    return not isinstance(other, tuple) and np.ndim(one) == np.ndim(other)


def _line_of(error: BaseException, part: Part) -> bool:
    return part.file is not None and part.file.name in told(error, part.file).partition(": ")[0]


def _why(error: Exception, part: Part) -> str:
    return str(error) if type(error) is ValueError and part.file is None else told(error, part.file)


def part_schemas() -> list[dict[str, Any]]:
    """JSON Schemas of [[part]] tables: one for each installed part, and one for a part from a file."""
    found = [part_model(part).model_json_schema() for part in installed().values()]
    for table in found:
        table["required"] = sorted({"type", *table.get("required", [])})
    file = {"type": "string", "description": "a Python file that holds a part, relative to this one; it is run"}
    name = PartTable.model_json_schema()["properties"]["name"]
    own = {"title": "PartFromFile", "type": "object", "properties": {"file": file, "name": name}, "required": ["file"]}
    return [*found, own | {"not": {"required": ["type"]}}]


def names_of(fitted: Iterable[Fitted]) -> Sequence[str]:
    """How the parts of a loop are called."""
    return [one.called for one in fitted]
