"""Annotations give the fields of states and arguments a unit and a meaning, for tables, recordings and checks."""

from __future__ import annotations

from typing import Any, NamedTuple, get_args, get_type_hints


class Quantity(NamedTuple):
    """Unit and meaning of a field. `dimension` names the index of its components in recordings: "axis" for vectors,
    "quaternion", "wheel"; "" for a single number."""

    unit: str
    text: str
    dimension: str = ""


def quantities(cls: Any) -> dict[str, Quantity]:
    """Return the quantities of a NamedTuple by field name, in order. Raise TypeError if a field is not annotated with
    one."""
    hints = get_type_hints(cls, include_extras=True)
    known = {name: next((a for a in get_args(hints[name]) if isinstance(a, Quantity)), None) for name in cls._fields}
    if None in known.values():
        bare = ", ".join(name for name, quantity in known.items() if quantity is None)
        raise TypeError(f"{cls.__name__} declares no unit of {bare}: annotate it with Quantity")
    return {name: quantity for name, quantity in known.items() if quantity is not None}
