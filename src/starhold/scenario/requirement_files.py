"""Reads and writes requirements in files of other tools: CSV from spreadsheets or DOORS, and ReqIF."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from starhold.errors import InputError
from starhold.files import atomic_write
from starhold.scenario import reqif
from starhold.scenario.checking import show, validate
from starhold.scenario.csv_files import number_in
from starhold.scenario.requirement import KEYS, RequirementTable, key_of

NUMBERS = ("at_most", "at_least", "after", "share", "confidence")
LISTS = ("window", "axis", "direction")
_COMMA = re.compile(r"(?<=\d),(?=\d)")
SUFFIXES = (".csv", ".reqif")


def read_requirement_file(path: Path) -> list[dict[str, Any]]:
    """Return the raw [[requirement]] tables of a CSV or ReqIF file. InputError where the file cannot be read as such."""
    where = str(path)
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(where, "", getattr(error, "strerror", None) or "no file", "a file that can be read") from None
    rows = {".csv": _csv_rows, ".reqif": reqif.read}.get(path.suffix.lower(), _unknown)(data, where)
    tables: list[dict[str, Any]] = []
    for number, row in enumerate(rows, 1):
        table = _table(row, f"requirement {number}", where)
        validate(RequirementTable, table, where, f"requirement {number}{' ' + table['id'] if 'id' in table else ''}")
        tables.append(table)
    return tables


def write_requirement_file(tables: Sequence[RequirementTable], path: Path, original: Path | None = None) -> None:
    """Write requirements with their attributes as CSV or ReqIF, depending on the file's suffix. original: a ReqIF file that
    is kept except for requirements that differ. InputError for another suffix, and where the original is not ReqIF or
    cannot be changed as needed."""
    rows = [_row(table) for table in tables]
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES or (original is not None and suffix != ".reqif"):
        raise InputError(str(path), "", show(path.suffix), ".reqif" if original is not None else " or ".join(SUFFIXES))
    if suffix == ".csv":
        columns = list(
            dict.fromkeys([key for key in KEYS if any(key in row for row in rows)] + [k for r in rows for k in r])
        )
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        content = text.getvalue()
    else:
        content = reqif.written(rows, path.stem, None if original is None else original.read_bytes(), str(original))
    with atomic_write(path) as hidden:
        hidden.write_text(content, encoding="utf-8", newline="")


def _unknown(data: bytes, where: str) -> list[dict[str, str]]:
    raise InputError(where, "", show(Path(where).suffix), f"a file of requirements, {' or '.join(SUFFIXES)}")


def _csv_rows(data: bytes, where: str) -> list[dict[str, str]]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(where, "", "text in another encoding", "CSV in UTF-8") from None
    head = text.partition("\n")[0]
    # The separator is the one that splits the heading into the most known columns.
    separator = max(",;\t", key=lambda one: sum(key_of(name.strip('" \r')) is not None for name in head.split(one)))
    try:
        lines = [line for line in csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True) if any(line)]
    except csv.Error as error:
        raise InputError(where, "", f"not CSV: {error}", "a table of a spreadsheet") from None
    columns = [name.strip() for name in lines[0]] if lines else []
    known = [key_of(name) or name for name in columns]
    if not {"id", "metric"} & {*known}:
        raise InputError(where, "", "no column id" if columns else "an empty file", f"columns such as {', '.join(KEYS[:5])}")
    for place, name in enumerate(known):
        if name in known[:place]:
            raise InputError(where, show(columns[place]), "a second column for the same key", "one column for each key")
    rows: list[dict[str, str]] = []
    for number, line in enumerate(lines[1:], 1):
        if len(line) > len(columns) and any(line[len(columns) :]):
            raise InputError(where, f"requirement {number}", f"{len(line)} cells", f"{len(columns)}, as the heading has")
        row = dict(zip(columns, line, strict=False))
        # With semicolons as separators, a comma may be a decimal comma.
        pairs = ((name, cell, separator == ";" and key_of(name) in NUMBERS) for name, cell in row.items() if cell.strip())
        rows.append({name: _COMMA.sub(".", cell) if decimal else cell for name, cell, decimal in pairs})
    return rows


def _table(row: Mapping[str, str], key: str, where: str) -> dict[str, Any]:
    """Return a row of texts as a raw [[requirement]] table."""
    table: dict[str, Any] = {}
    more: dict[str, str] = {}
    for column, text in row.items():
        name = key_of(column)
        if name is None:
            more[column] = text
        elif name in LISTS:
            try:
                table[name] = json.loads(text)
            except ValueError:
                raise InputError(
                    where, f"{key}.{name}", show(text), 'a list such as [0, 0, 1] or ["1 min", "2 min"]'
                ) from None
        else:
            number = number_in(text) if name in NUMBERS else None
            table[name] = text if name == "text" else text.strip() if number is None else number
    return table | ({"attributes": more} if more else {})


def _row(table: RequirementTable) -> dict[str, str]:
    """Return a requirement as texts by column, without absent values."""
    given = {key: getattr(table, key) for key in KEYS if key in table.model_fields_set and getattr(table, key) is not None}
    row = {key: value if isinstance(value, str) else json.dumps(value) for key, value in given.items()}
    return {"id": table.called} | row | dict(table.attributes)


def with_files(data: Mapping[str, Any], folder: Path, where: str) -> dict[str, Any]:
    """Return a scenario's raw tables, with each requirement table that names a file replaced by the requirements in it."""
    given = data.get("requirement")
    if not isinstance(given, list):
        return dict(data)
    tables: list[Any] = []
    for number, table in enumerate(given, 1):
        if not isinstance(table, dict) or "file" not in table:
            tables.append(table)
            continue
        key = f"requirement[{number}]"
        if len(table) > 1:
            other = next(name for name in table if name != "file")
            raise InputError(where, f"{key}.{other}", "a key beside a file", "only the file, which holds whole requirements")
        if not isinstance(table["file"], str):
            raise InputError(where, f"{key}.file", show(table["file"]), "the name of a CSV or ReqIF file")
        tables += read_requirement_file(folder / table["file"])
    return dict(data) | {"requirement": tables}
