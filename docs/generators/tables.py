"""Tables in Markdown that several pages have."""

from __future__ import annotations

import inspect
import re
from typing import Any

from starhold.algebra.quantity import quantities
from starhold.parts.contract import Field


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|").replace("*", "\\*") for cell in line) + " |" for line in lines
    )


def fields_table(cls: Any) -> str:
    """The fields of a state that are annotated with their quantities."""
    return table(["field", "unit", "meaning"], [[f"`{name}`", q.unit, q.text] for name, q in quantities(cls).items()])


def keys(fields: list[Field]) -> list[str]:
    """A table of gains or parameters."""
    lines = ["| key | unit | meaning | default |", "|---|---|---|---|"]
    for item in fields:
        default = item.gain.choices[item.default] if item.gain.choices and not item.required else item.default
        shown = "required" if item.required else f"`{default}`"
        lines.append(f"| `{item.name}` | {item.gain.units} | {item.gain.text} | {shown} |")
    return lines


def signature(function: Any) -> str:
    """The names of a function's parameters."""
    shown = [str(p).partition(":")[0] for p in inspect.signature(function).parameters.values()]
    return ", ".join(name for name in shown if name != "self")


def told(item: Any) -> str:
    """The docstring in one line."""
    return " ".join((item.__doc__ or "").split())


def first_sentence(item: Any) -> str:
    """The docstring's first sentence."""
    return re.split(r"(?<=\.)\s", told(item))[0]
