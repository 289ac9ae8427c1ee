"""The command `design`, the gains that design forms compute."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from starhold.report.commands import Block, Column, Command, Heading, Option, Result, Table, later

if TYPE_CHECKING:
    from starhold.scenario.designing import Design
    from starhold.scenario.reading import Scenario

WIDE = 132
"""The most characters in a line of a matrix."""


def present(scenario: Scenario, law: str | None, designs: Sequence[Design]) -> Result:
    """Return the result: the inputs of each design, its gains, and its figures of merit."""
    from starhold.report.stability_map import draw_map
    from starhold.scenario.designing import map_inputs

    blocks = [block for design in designs for block in _blocks(scenario, design)]
    return Result(f"{scenario.name}: designed laws", blocks, figure=lambda: draw_map(*map_inputs(scenario, law)))


def _blocks(scenario: Scenario, design: Design) -> list[Block]:
    import numpy as np
    from rich.markup import escape

    from starhold.report.text import number_text

    law = scenario.pick(design.name).law
    blocks: list[Block] = [Heading(design.name, f': {law.card.title}, form "{design.form}"')]
    for title, items, values in (("from", law.fields(design.form), design.inputs), ("gains", law.fields(), design.gains)):
        cells = [(item.name, number_text(values[item.name]), item.gain.unit, item.gain.text) for item in items]
        rows = [[*map(escape, row)] for row in cells]
        blocks.append(Table([*map(Column, (title, "value", "unit", "meaning"))], rows))
    # Significant digits, not decimals, because entries of P may differ by orders of magnitude.
    digits: Any = {"float_kind": lambda number: f"{number:12.6g}", "complex_kind": lambda number: f"{number:.6g}"}
    for name, value in design.figures.items():
        shown = f"{value:.3g}" if isinstance(value, float) else np.array2string(value, max_line_width=WIDE, formatter=digits)
        blocks.append(f"{name}: " + ("\n" if "\n" in shown else "") + shown)
    return [*blocks, ""]


COMMAND = Command(
    "Print the gains that formulas give: every law of a file that has a `form`.",
    "",
    later("scenario.designing.design"),
    present,
    lambda scenario, law: law,
    law="which law of the file; by default all that have a form",
    doing=None,
    options={"map": Option("", "draw the degree of stability over all gains", file="png")},
    unstable=True,
    body="",
)
