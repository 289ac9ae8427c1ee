"""The command `verify`, which reports whether a law meets its requirements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from starhold.report.commands import Block, Column, Command, Result, Table, coloured, later

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.verification import RequirementVerdict

NUMBERS = (Column("number", "", ">"), Column("limit", "", ">"), Column("margin", "", ">"))


def present(scenario: Scenario, entry: LawEntry, verdicts: Sequence[RequirementVerdict]) -> Result:
    """Return the result: a row per requirement, and below the table the reasons why one is not met."""
    from rich.markup import escape

    rows: list[list[Any]] = []
    for one in verdicts:
        shown = f"{coloured(one.verdict)}{escape(one.sentence.removeprefix(one.verdict))}"
        rows.append([escape(one.id), *numbers(one), one.method, shown])
    blocks: list[Block] = ["", Table([Column("requirement"), *NUMBERS, Column("method"), Column("verdict")], rows), ""]
    blocks += [f"{one.id}: {one.evidence}." for one in verdicts if one.verdict != "met"]
    outcomes = {one.verdict for one in verdicts}
    outcome = "missed" if "missed" in outcomes else "undecided" if "not decided" in outcomes else "met"
    title = f"{scenario.name}, {entry.name}: what is required"
    return Result(title, blocks, _matrix(verdicts), xml=junit(title, entry.name, verdicts), outcome=outcome)


def numbers(one: RequirementVerdict) -> list[str | None]:
    """Return number, limit and margin as text."""
    limit = amount(one, one.limit)
    return [amount(one, one.number), limit and f"{'≤' if one.at_most else '≥'} {limit}", amount(one, one.margin)]


def amount(one: RequirementVerdict, value: float | None) -> str | None:
    """Return a number as text in the unit in which the limit is typed, rounded."""
    if value is None:
        return None
    unit = one.typed_unit or ("" if one.unit == "1" else one.unit)
    return f"{value * one.scale:.5g} {unit}".rstrip()


def _matrix(verdicts: Sequence[RequirementVerdict]) -> Table:
    """Return a table with all fields of each verdict, numbers in SI."""
    columns = ("id", "parent", "text", "rationale", "method", "metric", "verdict", "number", "limit", "margin", "unit")
    rows: list[list[Any]] = []
    for one in verdicts:
        left = "; ".join(one.left_out)
        side = "" if one.limit is None else "at most" if one.at_most else "at least"
        rows.append([*(getattr(one, name) for name in columns), side, left, one.evidence])
    return Table([*map(Column, (*columns, "side", "leaving out", "evidence"))], rows)


def junit(title: str, law: str, verdicts: Sequence[RequirementVerdict]) -> str:
    """Return the verdicts as JUnit XML: a missed requirement is a failure and an undecided one an error, so that only met
    ones pass."""
    from xml.etree import ElementTree as Tree

    counts = {name: sum(one.verdict == kind for one in verdicts) for kind, name in JUNIT.items()}
    totals = {"tests": str(len(verdicts)), **{f"{name}s": str(count) for name, count in counts.items()}}
    suite = Tree.Element("testsuite", {"name": title, **totals})
    for one in verdicts:
        case = Tree.SubElement(suite, "testcase", {"classname": law, "name": one.id})
        if one.verdict in JUNIT:
            number, limit = (amount(one, value) or "none" for value in (one.number, one.limit))
            message = f"{one.verdict}: {number}, limit {limit}"
            Tree.SubElement(case, JUNIT[one.verdict], {"message": message, "type": one.method or "derived"})
        Tree.SubElement(case, "system-out").text = f"{one.text}\n{one.sentence}\n{one.evidence}".strip()
    Tree.indent(suite)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{Tree.tostring(suite, encoding="unicode")}\n'


JUNIT = {"missed": "failure", "not decided": "error"}
"""JUnit's elements for verdicts; a met requirement has none."""

COMMAND = Command(
    "Report which requirements of a file are met, each by its own method: a table, verify.csv, and verify.xml for JUnit.",
    "verify",
    later("campaign.verify.study"),
    present,
    doing="by {}",
    unstable=True,
    body="",
    kinds=("csv", "xml"),
)
