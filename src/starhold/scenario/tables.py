"""The base class of all tables of a scenario file, their errors, and parameters shared by all parts of a scenario."""

from collections.abc import Collection, Iterable, Mapping
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from starhold.errors import InputError
from starhold.parts.contract import Field as Parameter


class Table(BaseModel):
    """A table that refuses unknown keys. Modules of tables do without `from __future__ import annotations` where they can:
    Pydantic would evaluate each annotation anew from its text."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


Flag: TypeAlias = Annotated[bool, Field(strict=True)]
"""A strict boolean: true or false, not a word or a number instead."""


def refuse(reason: str) -> PydanticCustomError:
    """Return an error whose text says what is allowed."""
    return PydanticCustomError("quantity", "{reason}", {"reason": reason})


def at_key(key: str, reason: str, value: Any) -> PydanticCustomError:
    """Return an error about one key of a table that is read."""
    return PydanticCustomError("quantity_at", "{reason}", {"reason": reason, "key": key, "found": value})


def told_at(key: str, given: str, allowed: str) -> PydanticCustomError:
    """Return an error about one key of the table being read, with a description in place of its value."""
    return PydanticCustomError("told_at", "{reason}", {"reason": allowed, "key": key, "found": given})


LONGEST_NAME = 100
_RESULTS = (".json", ".html", ".nc", ".png", ".csv")


def check_name(name: str) -> str:
    """Return the name; raise an error where it could be a path, markup or a file of results."""
    sound = bool(name) and all(c.isalnum() or c in "-_. " for c in name) and name == name.strip(" .")
    if not sound or len(name) > LONGEST_NAME or name.lower().endswith(_RESULTS):
        allowed = "letters, digits and, between them, '-', '_', '.' and spaces"
        raise refuse(f"{allowed}; at most {LONGEST_NAME}, and not the name of a file of results")
    return name


Name: TypeAlias = Annotated[str, AfterValidator(check_name)]
"""The name of a scenario or a law, which also names folders and appears in tables and pages."""


def own_fields(declared: Iterable[Parameter], shared: Collection[str]) -> list[Parameter]:
    """Return the parameters that a part's own table holds, in a scenario with these shared keys."""
    return [item for item in declared if item.gain.shared not in shared]


def values_of(declared: Iterable[Parameter], read: Any, shared: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a part by name, from its validated table and the values of the shared keys."""
    return {
        item.name: shared[item.gain.shared] if item.gain.shared in shared else getattr(read, item.name) for item in declared
    }


def shared_values(declared: Iterable[Parameter], values: Iterable[Any], shared: Collection[str]) -> dict[str, Any]:
    """Return the values of those shared keys that set one of these parameters."""
    return {item.gain.shared: value for item, value in zip(declared, values, strict=True) if item.gain.shared in shared}


def refuse_own(
    table: Mapping[str, Any], declared: Iterable[Parameter], shared: Collection[str], where: str, key: str
) -> None:
    """Raise InputError where a raw table sets a parameter that a shared key sets; `key`: the table's name in errors."""
    for item in declared:
        if item.name in table and item.gain.shared in shared:
            raise InputError(where, f"{key}.{item.name}", "a key that the whole flight shares", shared_key(item.gain.shared))


def shared_key(shared: str) -> str:
    """Return the name of a shared key in errors: "epoch in [orbit]"."""
    table, _, name = shared.rpartition(".")
    return f"{name} in [{table}], which gives it to all parts"
