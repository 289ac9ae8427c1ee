"""The command `identify`, which fits numbers of a scenario to telemetry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from starhold.errors import InputError
from starhold.report.commands import Block, Column, Command, Option, Result, Table, as_given, later
from starhold.report.commands.replay import READABLE, TELEMETRY

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.identify import Identified
EXAMPLE = '"spacecraft.inertia, part.gyro.bias"'
WHOSE = "recorded, law or none: source of the commands; by default the recorded ones if any, else the law"
POINTS = 4000
"""The number of samples of a drawn curve."""


def present(scenario: Scenario, entry: LawEntry, *given: Any) -> Result:
    """Return the result: a row per free number, undetermined combinations, the residuals, and keys to be pasted."""
    result: Identified = given[-1]
    title = f"{scenario.name}: numbers fitted to {result.telemetry}"
    pasted = [f"{key} = {value}" for key, value in result.fitted().items()]
    blocks: list[Block] = ["", _table(result), *_words(result), "", *pasted]
    try:
        learnt = result.learnt().text
    except InputError as error:
        # A fit of an incomplete model may end at numbers that a file must not have.
        learnt = None
        blocks.append(
            f"The scenario refuses these numbers, so that there is no identify.toml: {error.key}: {error.allowed}."
        )
    summary = {entry.name: result.summary()}
    return Result(title, blocks, _numbers(result), lambda: draw(result, title), summary, toml=learnt)


def _table(result: Identified) -> Table:
    from starhold.studies.observable import WIDTH

    posterior, barely = result.posterior, result.posterior.barely(result.free)
    columns = [Column("number"), Column("unit"), Column("file", "", ".6g"), Column("estimate", "", ".6g")]
    columns += [Column("± 95 %", "", ".2g"), Column("determined")]
    rows: list[list[Any]] = []
    numbers = zip(result.free.names, result.free.units, result.free.values, result.values, strict=True)
    for k, (name, unit, before, value) in enumerate(numbers):
        width = WIDTH * posterior.deviations[k] if posterior.is_determined[k] else None
        words = "[red]no[/red]" if width is None else "barely" if barely[k] else "yes"
        rows.append([name, unit, before, value, width, words])
    return Table(columns, rows)


def _words(result: Identified) -> list[str]:
    from starhold.studies.identify import COMMANDS

    degrees, spread = result.degrees, (result.chi2 / result.degrees) ** 0.5
    fits = "consistent with the stated noise" if result.consistent >= 0.01 else "more than the stated noise explains"
    worst = min(result.whiteness, key=lambda name: result.whiteness[name])
    white = "no residual is correlated in time"
    if not result.white:
        white = f"{worst} is correlated in time (Ljung-Box, p = {result.whiteness[worst]:.1g}): the scenario lacks an effect"
        white += " of the real flight, and the intervals are too narrow"
    ended = "" if result.settled else f"The fit has not converged in {result.iterations} steps. "
    return [
        "",
        COMMANDS[result.commands],
        f"{ended}Residuals are {spread:.3f} deviations (root mean square of {degrees} degrees of freedom): {fits}; {white}.",
        *result.posterior.sentences,
        *result.notes,
    ]


def _numbers(result: Identified) -> Table:
    """Return the estimates with their covariance, NaN where undetermined."""
    posterior = result.posterior
    heads = ["number", "unit", "file", "estimate", "deviation", *(f"covariance {name}" for name in result.free.names)]
    values = zip(result.free.names, result.free.units, result.free.values, result.values, strict=True)
    rows = [[*row, posterior.deviations[k], *posterior.covariance[k]] for k, row in enumerate(values)]
    return Table([*map(Column, heads)], rows)


def draw(result: Identified, title: str) -> Any:
    """Return a figure with a row per sensor: its readings with the fit, and the residuals in standard deviations."""
    from starhold.report.figures import framed, plain
    from starhold.report.plots import COLOURS
    from starhold.report.ticks import label_ticks

    count = len(result.residuals)
    figure, grid = framed(
        (9.0, 1.2 + 2.0 * count), title, count, 2, (0.9, 0.2, 0.5, 0.6), sharex=True, hspace=0.16, wspace=0.2
    )
    for (name, (times, errors)), (left, right) in zip(result.residuals.items(), grid, strict=True):
        every = max(1, len(times) // POINTS)
        read, fitted = (rows[::every] for rows in result.readings[name])
        for axis in (left, right):
            plain(axis)
        for k in range(read.shape[1]):
            left.plot(times[::every], read[:, k], ".", color=COLOURS[k], markersize=2.0)
            left.plot(times[::every], fitted[:, k], color=COLOURS[k], linewidth=0.9)
        for k in range(errors.shape[1]):
            right.plot(times[::every], errors[::every, k], ".", color=COLOURS[k], markersize=2.0)
        for level in (-1.96, 1.96):
            right.axhline(level, color="0.35", linewidth=0.9, dashes=(5, 3))
        label_ticks(left.yaxis)
        left.set_ylabel(f"{name.replace('_', ' ')}, {result.units[name]}", fontsize=8)
    for axis, words in zip(grid[-1], ("readings and fit (lines)", "residuals in deviations, 95 % dashed"), strict=True):
        axis.set_xlabel(f"time, s; {words}", fontsize=8.5)
    return figure


COMMAND = Command(
    "Fit numbers of a scenario to telemetry: identify.csv, identify.png, and identify.toml, the fitted scenario.",
    "identify",
    later("studies.identify.study"),
    present,
    doing=None,
    options=TELEMETRY
    | {
        "free": Option("", f"keys of the numbers to fit, separated by commas: {EXAMPLE}", content=as_given),
        "commands": Option("", WHOSE, content=as_given),
    },
    unstable=True,
    check=READABLE,
    kinds=("csv", "png", "toml"),
)
