"""Parameters that a scenario gives to all its parts and laws at once, such as the epoch, are those declared as `shared`."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from starhold.errors import InputError
from starhold.parts.contract import Field


def own_fields(declared: Iterable[Field], shared: Collection[str]) -> list[Field]:
    """The parameters that a table of their own gives, in a scenario with these shared keys."""
    return [item for item in declared if item.gain.shared not in shared]


def values_of(declared: Iterable[Field], read: Any, shared: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters by name, from a validated table and the values of the shared keys."""
    return {
        item.name: shared[item.gain.shared] if item.gain.shared in shared else getattr(read, item.name) for item in declared
    }


def shared_values(declared: Iterable[Field], values: Iterable[Any], shared: Collection[str]) -> dict[str, Any]:
    """The values of the shared keys by which a scenario gives these parameters."""
    return {item.gain.shared: value for item, value in zip(declared, values, strict=True) if item.gain.shared in shared}


def refuse_own(table: Mapping[str, Any], declared: Iterable[Field], shared: Collection[str], where: str, key: str) -> None:
    """InputError where a raw table has a parameter that the scenario gives; `key`: what errors call the table."""
    for item in declared:
        if item.name in table and item.gain.shared in shared:
            raise InputError(where, f"{key}.{item.name}", "a key that the whole flight shares", shared_key(item.gain.shared))


def shared_key(shared: str) -> str:
    """The name of a shared key in errors: "epoch in [orbit]"."""
    table, _, name = shared.rpartition(".")
    return f"{name} in [{table}], which gives it to all parts"
