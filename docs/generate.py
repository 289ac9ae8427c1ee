"""Writes docs/laws.md from the laws' own files: cards, gains, and the torque as SymPy reads it; and the tables of
docs/law-authors.md from the code that they describe."""

from __future__ import annotations

import ast
import inspect
import re
from dataclasses import is_dataclass
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

import sympy

from starhold.algebra import quaternion, scalar, several, structured
from starhold.algebra import vector as vectors
from starhold.algebra.quantity import quantities
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.interface import Card, Gain, Measurement, NoMemory, Start
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import Libration
from starhold.parts.craft import Craft, make_craft

CRAFT = make_craft([2.0, 3.0, 4.0])


def vector(name: str) -> tuple[Any, ...]:
    """Three symbols."""
    return sympy.symbols(f"{name}_1:4", real=True)


def first_component(law: Law) -> str:
    """The first component of the torque at a target at rest, for a body with principal axes, as text."""
    q, w = sympy.symbols("q_0:4", real=True), vector("w")
    zero = (sympy.Integer(0),) * 3
    measurement = Measurement(q, w, w, zero, zero, vector("M"), vector("R"), sympy.Symbol("T"))
    gains: list[Any] = []
    for item in law.fields():
        if item.gain.shape == (3, 3):
            k = sympy.Symbol(item.name, real=True)
            gains.append((k, k, k))
        else:
            gains.append(vector(item.name) if item.gain.shape else sympy.Symbol(item.name, real=True))
    moments = vector("J")
    craft = Craft(moments, tuple(1 / m for m in moments), sympy.Symbol("u_max"), sympy.Symbol("mu"))
    torque, _ = law.command(measurement, law.gains(*gains), craft, NoMemory())
    return str(sympy.simplify(torque[0]))


def described(law: Law) -> list[str]:
    """A law's card, gains and forms."""
    card = law.card
    lines = [f"## {law.name}: {card.title}", "", card.summary, "", f"* claims: {card.claims}"]
    lines += [f"* assumes: {'; '.join(card.assumptions)}", f"* sources: {'; '.join(card.sources)}", ""]
    for form in (None, *law.forms):
        lines += [
            "Gains:" if form is None else f'Form `"{form}"`:',
            "",
            "| key | unit | meaning | default |",
            "|---|---|---|---|",
        ]
        for item in law.fields(form):
            default = item.gain.choices[item.default] if item.gain.choices and not item.required else item.default
            shown = "required" if item.required else f"`{default}`"
            lines.append(f"| `{item.name}` | {item.gain.unit} | {item.gain.text} | {shown} |")
        lines.append("")
    return lines


def page() -> str:
    """The page."""
    lines = ["# Laws", "", "Written from the laws' own files by `make docs`.", ""]
    for law in catalogue().values():
        lines += described(law)
        if law.remember(law.examples()[0], CRAFT, 0.1) == NoMemory():
            text = "First component of the torque, target at rest, principal axes, matrix gains multiples of the identity:"
            lines += [text, "", f"    u_1 = {first_component(law)}", ""]
    lines += ["# Laws of station keeping", "", "Numbers are scaled, see [station keeping](station-keeping.md).", ""]
    for law in catalogue("libration-point").values():
        lines += described(law)
    return "\n".join(lines)


OPERATORS = ("plus", "minus", "product", "negative", "select")
"""Functions of the scalars that are written as operators, or that `where` stands for."""


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|").replace("*", "\\*") for cell in line) + " |" for line in lines
    )


def fields_table(cls: Any) -> str:
    """The fields of a state that are annotated with their quantities."""
    return table(["field", "unit", "meaning"], [[f"`{name}`", q.unit, q.text] for name, q in quantities(cls).items()])


def attributes_table(cls: Any) -> str:
    """The fields of a dataclass and of those it derives from, each told by the docstring that follows it."""
    rows: dict[str, list[str]] = {}
    for base in filter(is_dataclass, reversed(cls.__mro__)):
        body = ast.parse(dedent(inspect.getsource(base))).body[0].body  # type: ignore[attr-defined]
        for statement, told in pairwise(body):
            if isinstance(statement, ast.AnnAssign):
                default = "required" if statement.value is None else f"`{ast.unparse(statement.value)}`"
                name = ast.unparse(statement.target)
                rows[name] = [f"`{name}`", default, " ".join(told.value.value.split())]
    return table(["keyword", "default", "meaning"], [*rows.values()])


def functions_table(module: ModuleType) -> str:
    """The functions that a module defines, and its classes with their methods."""
    rows: list[list[str]] = []
    for name, item in vars(module).items():
        if name.startswith("_") or getattr(item, "__module__", "") != module.__name__ or name in OPERATORS:
            continue
        if inspect.isfunction(item):
            rows.append([f"`{name}({_parameters(item)})`", _first(item)])
        elif inspect.isclass(item):
            own = [f for n, f in vars(item).items() if inspect.isfunction(f) and not n.startswith("_")]
            methods = "; ".join(f"`.{f.__name__}({_parameters(f)})`: {_first(f)}" for f in own)
            rows.append([f"`{name}`", f"{_first(item)} {methods}"])
    return table(["function", "meaning"], rows)


def _parameters(function: Any) -> str:
    shown = [str(p).partition(":")[0] for p in inspect.signature(function).parameters.values()]
    return ", ".join(name for name in shown if name != "self")


def _first(item: Any) -> str:
    """The docstring's first sentence."""
    text = " ".join((item.__doc__ or "").split())
    return re.split(r"(?<=\.)\s", text)[0]


def _start_table() -> str:
    """What a design form may ask for, from the sentence that tells it."""
    return (
        " ".join((Start.__doc__ or "").split())
        + f" Fields: {', '.join(f'`{n}`' for n in (*Start.__annotations__, 'angle'))}."
    )


TABLES = {
    "card": lambda: attributes_table(Card),
    "measurement": lambda: fields_table(Measurement),
    "craft": lambda: fields_table(Craft),
    "scalar": lambda: functions_table(scalar),
    "vector": lambda: functions_table(vectors),
    "quaternion": lambda: functions_table(quaternion),
    "structured": lambda: functions_table(structured),
    "several": lambda: functions_table(several),
    "gain": lambda: attributes_table(Gain),
    "start": _start_table,
    "measurement point": lambda: fields_table(PointMeasurement),
    "plant": lambda: fields_table(Libration),
}
MARK = re.compile(r"(<!-- written by docs/generate.py: (.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(text: str) -> str:
    """A page with its tables written anew."""
    return MARK.sub(lambda match: f"{match[1]}\n{TABLES[match[2]]()}\n\n{match[3]}", text)


if __name__ == "__main__":
    Path(__file__).with_name("laws.md").write_text(page(), encoding="utf-8")
    authors = Path(__file__).with_name("law-authors.md")
    authors.write_text(filled(authors.read_text(encoding="utf-8")), encoding="utf-8")
