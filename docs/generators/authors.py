"""The tables and lists that stand inside pages written by hand, and in README."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Mapping
from dataclasses import is_dataclass
from itertools import pairwise
from textwrap import dedent
from types import ModuleType
from typing import Any

import typer

from generators.kernel import files_table, needed_table
from generators.laws import POINT
from generators.lemmas import lemmas_table
from generators.proved import beside_table, costs_table, starts_table
from generators.sets import sets_table
from generators.sharpness import sharpness_table
from generators.tables import fields_table, first_sentence, signature, table
from starhold.algebra import cosines, elementary, quaternion, rotation, scalar, several, structured
from starhold.algebra import vector as vectors
from starhold.analysis import libration_point, rigid_body
from starhold.analysis.pointing import MEANINGS
from starhold.analysis.ranking import Measure
from starhold.analysis.rigid_body import make_meter
from starhold.certification.unmodelled import READ
from starhold.cli.arguments import clause
from starhold.cli.main import app
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Card, Gain, Measurement, Start
from starhold.laws.point import PointMeasurement
from starhold.parts import roles
from starhold.parts.bodies.libration_point import Libration
from starhold.parts.catalogue import DEMANDED, EITHER, PACKAGES, parts
from starhold.parts.contract import Card as PartCard
from starhold.parts.contract import Parameter
from starhold.parts.craft import Craft
from starhold.parts.random import Dice
from starhold.publications.paper import PAPERS
from starhold.scenario.reading import builtin_names
from starhold.scenario.requirement import BEGINS, CONE
from starhold.studies.deciding import BOUNDS, MARGINS
from starhold.studies.requirements import LOST


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
                shown = f"`{name}({signature(item).removesuffix(', /')})`"
                rows.append([shown, needed, " ".join((item.__doc__ or "").split())])
        text = " ".join((protocol.__doc__ or "").split())
        found += [f"### {role.capitalize()}", "", text, "", table(["equation or attribute", "", "meaning"], rows), ""]
    return "\n".join(found).rstrip()


OPERATORS = ("plus", "minus", "product", "negative", "select")
"""Functions of the scalars that are written as operators, or that `where` stands for."""


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


FOR_FILES = ("from_angles", "to_angles")
"""Functions of attitudes that laws cannot use."""


def functions_table(*modules: ModuleType) -> str:
    """The functions that modules define, and their classes with their methods."""
    rows: list[list[str]] = []
    for module in modules:
        found = {n: x for n, x in vars(module).items() if getattr(x, "__module__", "") == module.__name__}
        for name, item in found.items():
            if name.startswith("_") or name in (*OPERATORS, *FOR_FILES):
                continue
            if inspect.isfunction(item):
                rows.append([f"`{name}({signature(item)})`", first_sentence(item)])
            elif inspect.isclass(item):
                own = [f for n, f in vars(item).items() if inspect.isfunction(f) and not n.startswith("_")]
                methods = "; ".join(f"`.{f.__name__}({signature(f)})`: {first_sentence(f)}" for f in own)
                rows.append([f"`{name}`", f"{first_sentence(item)} {methods}"])
    return table(["function", "meaning"], rows)


def methods_table(cls: Any) -> str:
    """The methods of a class."""
    own = [f for name, f in vars(cls).items() if inspect.isfunction(f) and not name.startswith("_")]
    return table(["method", "meaning"], [[f"`.{f.__name__}({signature(f)})`", first_sentence(f)] for f in own])


def _start_table() -> str:
    """What a design form may ask for, from the sentence that tells it."""
    return (
        " ".join((Start.__doc__ or "").split())
        + f" Fields: {', '.join(f'`{n}`' for n in (*Start.__annotations__, 'angle'))}."
    )


def limits_table() -> str:
    """What each part but laws assumes or leaves out, by its card."""
    rows = [
        [role, f"`{name}`", "; ".join(part.card.assumptions)]
        for role in PACKAGES
        for name, part in parts(role).items()
        if part.card.assumptions
    ]
    return table(["role", "part", "assumes or leaves out"], rows)


def claims_table() -> str:
    """The parts that claims take in, and those that every claim leaves out, by what the certifier looks at."""
    rows: list[list[str]] = []
    for role in PACKAGES:
        if role in ("body", "law"):
            continue
        found: dict[str, list[str]] = {"every claim": [], "pointing": [], "none": []}
        for name, part in parts(role).items():
            tells = any(
                part.hook(hook) is not None
                for hook in ("bound", "direction", "error", "late", "noise", "perturbation", "place", "recursion")
            )
            moves = role == "target" and part.hook("motion") is not None
            by = "every claim" if moves or name in READ.get(role, ()) else "pointing" if tells else "none"
            found[by].append(f"`{name}`")
        rows.append([role, *(", ".join(names) for names in found.values())])
    return table(
        ["role", "taken in by its equations or its motion", 'by its bounds, of "pointing as it flies" alone', "left out"],
        rows,
    )


def required_table() -> str:
    """The metrics that requirements may bound, by the method that decides them."""
    flown = make_meter(1, 1.0, "axis", (1.0, 1.0), rigid_body.EXTRAS, wheels=True).units
    shown = {
        "flight, campaign": [*flown, LOST, CONE, BEGINS],
        "proof": BOUNDS,
        "budget": [index.lower() for index in MEANINGS],
        "margin": MARGINS,
    }
    return table(["method", "metrics"], [[by, ", ".join(f"`{name}`" for name in names)] for by, names in shown.items()])


def counts_text() -> str:
    """How many laws, parts, scenarios, commands and publications there are, with their pages."""
    others = sum(len(parts(role)) for role in PACKAGES if role != "law")
    known = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return (
        f"{len(catalogue())} [laws](docs/laws.md) for attitude and {len(catalogue(POINT))} of station keeping, "
        f"{others} other [parts](docs/parts.md), {len(builtin_names())} scenarios,\n"
        f"{len(known)} [commands](docs/commands.md), and {len(PAPERS)} reproduced [publications](docs/publications.md)."
    )


def metrics_table(measures: Mapping[str, Measure]) -> str:
    """The metrics that a comparison shows, by their headings and by their names in files."""
    rows = [[m.heading, f"`{name}`", m.unit or "1", m.meaning] for name, m in measures.items()]
    return table(["column", "metric", "unit", "meaning"], rows)


def commands_table() -> str:
    """The commands with the first clause of their help."""
    known = typer.main.get_command(app).commands.items()  # type: ignore[attr-defined]
    rows = [[f"`starhold {name}`", clause(command.help)] for name, command in known]
    return table(["command", "purpose"], rows)


TABLES = {
    "claims": claims_table,
    "counts": counts_text,
    "requirement metrics": required_table,
    "metrics": lambda: metrics_table(rigid_body.MEASURES),
    "metrics of station keeping": lambda: metrics_table(libration_point.MEASURES),
    "commands": commands_table,
    "card": lambda: attributes_table(Card),
    "measurement": lambda: fields_table(Measurement),
    "craft": lambda: fields_table(Craft),
    "scalar": lambda: functions_table(scalar),
    "elementary": lambda: functions_table(elementary),
    "attitudes": lambda: functions_table(rotation, cosines),
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
    "limits of models": limits_table,
    "kernel files": files_table,
    "needed of the kernel": needed_table,
    "invariant sets": sets_table,
    "lemmas": lemmas_table,
    "dice": lambda: methods_table(Dice),
    "proved and measured": beside_table,
    "proved starts": starts_table,
    "costs of sources": lambda: costs_table("cubesat-nadir"),
    "sharpness": sharpness_table,
}
MARK = re.compile(r"(<!-- written by docs/generate.py: (.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(text: str) -> str:
    """A page with its tables written anew."""
    return MARK.sub(lambda match: f"{match[1]}\n{TABLES[match[2]]()}\n\n{match[3]}", text)
