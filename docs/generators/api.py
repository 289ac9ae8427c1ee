"""The page of the Python interface."""

from __future__ import annotations

import ast
import inspect
import re
from functools import cached_property
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from typing import Any

import starhold
from generators.tables import signature, table, told
from starhold.api import make_scenario
from starhold.campaign.results import CampaignResult
from starhold.certification.certificate import Certificate, Claim
from starhold.certification.invariant import InvariantProblem, WantedSet
from starhold.scenario.designing import Design
from starhold.scenario.reading import Scenario
from starhold.studies.budget import Budget, Contribution, Settings
from starhold.studies.failures import Failure
from starhold.studies.flight import Flight
from starhold.studies.modal_roots import Study

HEAD = """# Python API

Written from the code by `make docs`. `import starhold as sh` gives all of it; what is not listed here may change from one
version to the next. Numbers are SI and radians, near a libration point scaled. [From Python](python.md) shows it in use.
"""
CLASSES = (
    Scenario,
    Flight,
    Certificate,
    Claim,
    Design,
    CampaignResult,
    Failure,
    Budget,
    Contribution,
    Settings,
    Study,
    InvariantProblem,
    WantedSet,
)


def page() -> str:
    """Functions, and the classes of what they take and return."""
    lines = [HEAD, "## Functions", ""]
    for name in starhold.__all__:
        item = make_scenario if name == "scenario" else _function(name)
        if inspect.isfunction(item):
            lines += [f"### sh.{name}", "", "```text", f"sh.{name}{_written(item)}", "```", "", *_paragraphs(item)]
    lines += ["## Errors", "", f"`sh.InputError`: {_plain(told(starhold.InputError))}", "", "## Classes", ""]
    for cls in CLASSES:
        lines += [f"### {cls.__name__}", "", _plain(told(cls)), ""]
        lines += [table(["attribute or method", "type", "meaning"], [*_attributes(cls), *_members(cls)]), ""]
    return "\n".join(lines)


def _function(name: str) -> Any:
    return getattr(import_module("starhold.api"), name, None)


def _written(function: Any) -> str:
    """A signature with its types, one parameter a line where there are many."""
    sig = inspect.signature(function)
    given = [p.replace(default=str(p.default)) if isinstance(p.default, Path) else p for p in sig.parameters.values()]
    inner = [f"{str(p.replace(default=p.empty)).replace(chr(39), '')}" for p in given]
    inner = [t if p.default is p.empty else f"{t} = {p.default!r}" for t, p in zip(inner, given, strict=True)]
    first = next((n for n, p in enumerate(given) if p.kind is p.KEYWORD_ONLY), None)
    if first is not None:
        inner.insert(first, "*")
    returns = f" -> {sig.return_annotation}".replace("'", "")
    text = f"({', '.join(inner)}){returns}"
    text = text if len(text) < 90 else "(\n    " + ",\n    ".join(inner) + f",\n){returns}"
    return re.sub(r"\b(?:reading|designing|xr)\.", "", text)


def _paragraphs(item: Any) -> list[str]:
    """A docstring with its paragraphs."""
    return [
        line for text in inspect.cleandoc(item.__doc__ or "").split("\n\n") for line in (_plain(" ".join(text.split())), "")
    ]


def _attributes(cls: Any) -> list[list[str]]:
    """The fields of a dataclass or a NamedTuple, with their types and the strings that follow them in the source."""
    body = ast.parse(dedent(inspect.getsource(cls))).body[0].body  # type: ignore[attr-defined]
    rows: list[list[str]] = []
    for statement, after in pairwise([*body, None]):
        if not isinstance(statement, ast.AnnAssign) or ast.unparse(statement.target).startswith("_"):
            continue
        told_of = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
        kind = ast.unparse(statement.annotation)
        rows.append([f"`.{ast.unparse(statement.target)}`", f"`{kind}`", _plain(" ".join(str(told_of).split()))])
    return rows


def _members(cls: Any) -> list[list[str]]:
    """Public methods and properties."""
    rows: list[list[str]] = []
    for name, item in vars(cls).items():
        if name.startswith("_") or not (inspect.isfunction(item) or isinstance(item, property | cached_property)):
            continue
        function = item if inspect.isfunction(item) else item.fget if isinstance(item, property) else item.func
        shown = f"`.{name}({signature(item)})`" if inspect.isfunction(item) else f"`.{name}`"
        # As it is written: evaluated types tell of what stands behind their names.
        returns = ast.parse(dedent(inspect.getsource(function))).body[0].returns  # type: ignore[attr-defined]
        kind = "" if returns is None else ast.unparse(returns).replace("xr.", "")
        rows.append([shown, f"`{kind}`" if kind else "", _plain(told(function))])
    return rows


def _plain(text: str) -> str:
    """A docstring as Markdown: what would be read as markup is not."""
    return re.sub(r"(?<!`)([*<])", r"\\\1", text)
