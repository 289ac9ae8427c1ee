"""Writes changed scenarios and tables from Python as TOML and reads them like a file, so that both mean the same."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from starhold.errors import InputError
from starhold.scenario.checking import nearest, show

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

_PART = re.compile(r"([^.\[\]]+)(?:\[(\d+)\])?")


def changed(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return the scenario with other values of some keys. Keys are written as in errors, "spacecraft.inertia" or
    "law[2].k_rate", and in laws and parts also by name, "law.pd.k_rate"; None removes a key, a table or a law."""
    return next(variants(scenario, [changes]))


def variants(scenario: Scenario, changes: Iterable[Mapping[str, Any]]) -> Iterator[Scenario]:
    """Yield the scenario with each set of changes in turn; errors name the changes."""
    names = names_of(scenario)
    for change in changes:
        # To fit on one line, errors show only the first of many changes.
        described = ", ".join(f"{key} = {show(value)}" for key, value in list(change.items())[:4])
        described = " ".join(described.split()).encode(errors="backslashreplace").decode()
        where = f"{scenario.where} with {described}" if described else scenario.where
        try:
            other = deepcopy(scenario.raw)
            for key, value in change.items():
                _put(other, path_of(key, names, where), deepcopy(value), where, scenario.table)
            yield scenario._of(plain(other, where, ""))  # pyright: ignore[reportPrivateUsage]
        except InputError as error:
            raise InputError(where, error.key, error.given, error.allowed) from None


def names_of(scenario: Scenario) -> dict[str, list[str]]:
    """Return the names of laws and of parts, by the names of their arrays of tables."""
    return {"law": [entry.name for entry in scenario.laws], "part": [fitted.called for fitted in scenario.parts]}


def path_of(key: Any, names: Mapping[str, Sequence[str]], where: str) -> list[str | int]:
    """Return the path of a key of `with_`: names of tables and keys, and indices in lists from 0; `names`: the result of
    `names_of`. InputError where it is not a key."""
    if not isinstance(key, str):
        raise InputError(where, show(key), "a key that is not a string", 'keys such as "spacecraft.inertia"')
    array, dot, rest = key.partition(".")
    if dot and array in names:
        # The longest name first, because names may contain dots.
        for name in sorted(names[array], key=len, reverse=True):
            if rest == name or rest.startswith(f"{name}."):
                after = rest[len(name) + 1 :]
                return [array, names[array].index(name), *(path_of(after, {}, where) if after else [])]
        given = rest.partition(".")[0]
        raise InputError(where, key, show(given), nearest(given, list(names[array])))
    path: list[str | int] = []
    for part in key.split("."):
        match = _PART.fullmatch(part)
        if match is None:
            raise InputError(where, show(key), "not a key", 'keys such as "spacecraft.inertia" or "wheel[2].torque_limit"')
        path += [match[1]] if match[2] is None else [match[1], int(match[2]) - 1]
    return path


def _put(tables: Any, path: Sequence[str | int], value: Any, where: str, validated: Any) -> None:
    """Put a value into raw tables; validated: the validated tables, which supply vectors that the file leaves out."""
    here: Any = tables
    seen = ""
    for part, after in zip(path, [*path[1:], None], strict=True):
        last = after is None
        if isinstance(part, int):
            if not isinstance(here, list) or not 0 <= part < len(cast(list[Any], here)):
                count = len(cast(list[Any], here)) if isinstance(here, list) else 0
                allowed = f"1 to {count}" if count else f"a scenario that has {seen}, or all of it"
                raise InputError(where, f"{seen}[{part + 1}]", "no such table" if count else "nothing", allowed)
            seen = f"{seen}[{part + 1}]"
        else:
            seen = f"{seen}.{part}".lstrip(".")
            if not isinstance(here, dict):
                raise InputError(where, seen, "a value that is not a table", "keys of tables")
            validated = getattr(validated, part, None)
            if not last:
                known = list(cast(Any, validated)) if isinstance(validated, tuple) else []
                cast(dict[str, Any], here).setdefault(part, known if isinstance(after, int) else {})
        if last:
            cast(Any, here)[part] = value
        else:
            here = cast(Any, here)[part]


def plain(value: Any, where: str, key: str) -> Any:
    """Return the value converted to types of TOML. InputError where this is impossible."""
    # Unless this module is loaded, the value cannot be a rotation.
    transform: Any = sys.modules.get("scipy.spatial.transform")
    if transform is not None and isinstance(value, transform.Rotation):
        return cast(Any, value).as_quat(scalar_first=True).tolist()
    if isinstance(value, np.generic | np.ndarray):
        value = cast(Any, value).tolist()
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, Mapping):
        table: dict[str, Any] = {}
        for name, item in cast(Mapping[Any, Any], value).items():
            if not isinstance(name, str):
                raise InputError(where, key, f"the key {show(name)}", "keys that are strings")
            if item is not None:
                table[name] = plain(item, where, f"{key}.{name}".lstrip("."))
        return table
    if isinstance(value, list | tuple):
        items = list(cast(Sequence[Any], value))
        return [plain(item, where, f"{key}[{n}]") for n, item in enumerate(items, 1) if item is not None]
    raise InputError(where, key, show(value), "numbers, strings, booleans, dates, rotations, and lists and tables of them")
