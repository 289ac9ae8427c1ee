"""Writes docs/laws.md and docs/parts.md from the files of laws and of other parts: cards, gains, parameters, and the torque
as SymPy reads it; and the tables of docs/law-authors.md and docs/part-authors.md from the code that they describe."""

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
from starhold.parts import roles
from starhold.parts.bodies.libration_point import Libration
from starhold.parts.catalogue import DEMANDED, EITHER, PACKAGES, parts
from starhold.parts.contract import Card as PartCard
from starhold.parts.contract import Field, Parameter
from starhold.parts.craft import Craft, make_craft
from starhold.parts.part import Part
from starhold.parts.random import Dice

CRAFT = make_craft([2.0, 3.0, 4.0])


def vector(name: str) -> tuple[Any, ...]:
    """Three symbols."""
    return sympy.symbols(f"{name}_1:4", real=True)


def first_component(law: Law) -> Any:
    """The first component of the torque at a target at rest, for a body with principal axes, as the law computes it."""
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
    return torque[0]


def described(law: Law) -> list[str]:
    """A law's card, gains and forms."""
    card = law.card
    lines = [f"## {law.name}: {card.title}", "", card.summary, "", f"* claims: {card.claims}"]
    lines += [f"* assumes: {'; '.join(card.assumptions)}", f"* sources: {'; '.join(card.sources)}", ""]
    for form in (None, *law.forms):
        lines += ["Gains:" if form is None else f'Form `"{form}"`:', "", *keys(law.fields(form)), ""]
    return lines


def keys(fields: list[Field]) -> list[str]:
    """A table of gains or parameters."""
    lines = ["| key | unit | meaning | default |", "|---|---|---|---|"]
    for item in fields:
        default = item.gain.choices[item.default] if item.gain.choices and not item.required else item.default
        shown = "required" if item.required else f"`{default}`"
        lines.append(f"| `{item.name}` | {item.gain.unit} | {item.gain.text} | {shown} |")
    return lines


def page() -> str:
    """The page of laws."""
    lines = ["# Laws", "", "Written from the laws' own files by `make docs`.", ""]
    for law in catalogue().values():
        lines += described(law)
        if law.remember(law.examples()[0], CRAFT, 0.1) == NoMemory():
            text = "First component of the torque, target at rest, principal axes, matrix gains multiples of the identity:"
            lines += [text, "", f"    u_1 = {sympy.simplify(first_component(law))}", ""]
    lines += ["# Laws of station keeping", "", "Numbers are scaled, see [station keeping](station-keeping.md).", ""]
    for law in catalogue("libration-point").values():
        lines += described(law)
    return "\n".join(lines)


def described_part(part: Part) -> list[str]:
    """A part's card, parameters, and what is recorded of it."""
    card = part.card
    lines = [f"### {part.name}: {card.title}", "", card.summary.replace("*", "\\*"), ""]
    if part.role != "body":
        lines.append(f"* body: {part.body or 'any'}")
    lines += [
        f"* {head}: {'; '.join(told)}" for head, told in (("needs", part.needs), ("assumes", card.assumptions)) if told
    ]
    lines += [f"* sources: {'; '.join(card.sources)}", ""]
    if part.table:
        lines += [f"Given by the `[{part.table}]` table.", ""]
    elif part.role != "body" and part.fields():
        lines += [*keys(part.fields()), ""]
    kind = next((getattr(part.module, n) for n in ("Sample", "Reading", "Estimate") if hasattr(part.module, n)), None)
    if kind is not None and getattr(part.module, "RECORDED", True):
        rows = [f"| `{name}` | {q.unit} | {q.text} |" for name, q in quantities(kind).items()]
        lines += ["| recorded | unit | meaning |", "|---|---|---|", *rows, ""]
    return lines


def page_of_parts() -> str:
    """The page of all other parts."""
    lines = [
        "# Parts",
        "",
        "Written from the parts' own files by `make docs`. A part that names no table here is given by a `[[part]]`",
        "table with its `type` and its keys, see [scenario files](scenarios.md#further-parts). Laws have",
        "[a page of their own](laws.md), and so have [parts of your own](part-authors.md).",
        "",
    ]
    for role, package in PACKAGES.items():
        lines += [f"## {package.rpartition('.')[2].capitalize()}", ""]
        for part in parts(role).values():
            lines += described_part(part)
    return "\n".join(lines)


def roles_text() -> str:
    """The roles of parts but bodies and laws: for each the attributes and the equations of its protocol."""
    found: list[str] = []
    for role in PACKAGES:
        if role == "body":
            continue
        protocol = getattr(roles, role.capitalize())
        either = EITHER.get(role, ())
        rows: list[list[str]] = []
        for name, kind in protocol.__annotations__.items():
            needed = "required" if name in DEMANDED[role] else ""
            rows.append([f"`{name}`", needed, {"type": "a NamedTuple", "bool": "True or False"}.get(kind, "names")])
        for name, item in vars(protocol).items():
            if inspect.isfunction(item) and not name.startswith("_"):
                needed = (
                    "required" if name in DEMANDED[role] else f"or `{'`, `'.join({*either} - {name})}`" * (name in either)
                )
                shown = f"`{name}({_parameters(item).removesuffix(', /')})`"
                rows.append([shown, needed, " ".join((item.__doc__ or "").split())])
        text = " ".join((protocol.__doc__ or "").split())
        found += [f"### {role.capitalize()}", "", text, "", table(["equation or attribute", "", "meaning"], rows), ""]
    return "\n".join(found).rstrip()


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


def methods_table(cls: Any) -> str:
    """The methods of a class."""
    own = [f for name, f in vars(cls).items() if inspect.isfunction(f) and not name.startswith("_")]
    return table(["method", "meaning"], [[f"`.{f.__name__}({_parameters(f)})`", _first(f)] for f in own])


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
    "part card": lambda: attributes_table(PartCard),
    "parameter": lambda: attributes_table(Parameter),
    "roles": roles_text,
    "dice": lambda: methods_table(Dice),
}
MARK = re.compile(r"(<!-- written by docs/generate.py: (.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(text: str) -> str:
    """A page with its tables written anew."""
    return MARK.sub(lambda match: f"{match[1]}\n{TABLES[match[2]]()}\n\n{match[3]}", text)


if __name__ == "__main__":
    here = Path(__file__).parent
    (here / "laws.md").write_text(page(), encoding="utf-8")
    (here / "parts.md").write_text(page_of_parts(), encoding="utf-8")
    for name in ("law-authors.md", "part-authors.md"):
        authors = here / name
        authors.write_text(filled(authors.read_text(encoding="utf-8")), encoding="utf-8")
