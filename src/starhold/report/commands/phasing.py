"""The command `phasing`, sheets for the test of signs and axes before launch."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from starhold.report.commands import Block, Column, Command, Option, Result, Table, later

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.phasing_verdict import Phasing, Seen

MANUAL = (
    "The craft is at rest on target, without external torque and with its rotors at rest. Each stimulus is given by "
    "hand, by coil or by telecommand, and all stages in its rows are read. Signs count, and which component of a vector "
    "is largest; magnitudes need not be exact. An attitude is given as the rotation from the attitude on target.",
    "Numbers, or +, - and 0, go into the column seen of phasing.csv, which has a row for each number of this sheet; "
    "starhold phasing FILE --check phasing.csv -o DIR judges them.",
)


def present(scenario: Scenario, entry: LawEntry, seen: Seen | None, result: Phasing) -> Result:
    """Return the result: the number of rows of each stage, the outcome, and the sheet as a page and a table."""
    from starhold.report.document import Section

    sheet = result.sheet
    stages = list(dict.fromkeys(cell.stage for cell in sheet.cells))
    counts = [[stage, sum(cell.stage == stage for cell in sheet.cells)] for stage in stages]
    blocks: list[Block] = ["", Table([Column("stage"), Column("rows", "", "d")], counts), "", *sheet.notes]
    blocks = blocks if seen is None else list(result.verdict)
    sections = [Section("How the sheet is used", MANUAL)]
    sections += [Section("What was found", result.verdict)] * (result.seen is not None)
    sections.append(Section("Expected and seen", [_page(result)], fresh=True))
    sections += [Section("What the sheet leaves out", sheet.notes)] * bool(sheet.notes)
    title = f"{scenario.name}, {entry.name}: signs and axes"
    return Result(title, blocks, _numbers(result), document=sections, outcome=result.outcome)


def _seen(result: Phasing) -> list[Any]:
    return result.seen or [None] * len(result.sheet.cells)


def _numbers(result: Phasing) -> Table:
    columns = ("stimulus", "stage", "axis", "expected sign", "expected value", "unit", "seen")
    rows = [[*cell[:6], seen] for cell, seen in zip(result.sheet.cells, _seen(result), strict=True)]
    return Table([*map(Column, columns)], rows)


def _page(result: Phasing) -> Table:
    """Return a table with a row per vector."""
    rows: list[list[Any]] = []
    ends: list[int] = []
    for stimulus, stage, unit, cells in _vectors(result):
        if rows and rows[-1][0] != stimulus:
            ends.append(len(rows) - 1)
        expected = ", ".join(f"{cell.axis} {'0' if cell.sign == '0' else f'{cell.value:+.3g}'}" for cell, _ in cells)
        shown = [
            f"{cell.axis} {'…' if seen is None else seen if isinstance(seen, str) else f'{seen:+.3g}'}"
            for cell, seen in cells
        ]
        rows.append([stimulus, stage, " ".join(cell.sign for cell, _ in cells), expected, unit, ", ".join(shown)])
    heads = ("stimulus", "stage", "signs", "expected", "unit", "seen")
    return Table([*map(Column, heads)], rows, ends=ends)


def _vectors(result: Phasing) -> Iterator[tuple[str, str, str, list[Any]]]:
    """Yield the stimulus, stage and unit of each vector, and its cells with their observations."""
    vectors: dict[Any, list[Any]] = {}
    for cell, seen in zip(result.sheet.cells, _seen(result), strict=True):
        vectors.setdefault((cell.stimulus, cell.stage, cell.unit), []).append((cell, seen))
    for head, cells in vectors.items():
        yield *head, cells


COMMAND = Command(
    "Write the sheets of expected signs and axes for a bench test: phasing.html, phasing.csv; judge observations.",
    "phasing",
    later("studies.phasing_verdict.study"),
    present,
    doing=None,
    options={
        "check": Option(
            "", "judge this sheet, phasing.csv with `seen` filled in", content=later("studies.phasing_verdict.opened")
        )
    },
    unstable=True,
    kinds=("csv", "html", "md"),
)
