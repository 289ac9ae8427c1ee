"""The command `replay`, which passes recorded readings through the estimator and the law of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from starhold.report.commands import Block, Column, Command, Option, Result, Table, later

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.replay import Comparison, Replay

TELEMETRY = {
    "telemetry": Option(
        "",
        "recorded telemetry: CSV, Parquet, AEM, a run.nc or its folder",
        content=later("studies.telemetry_files.existing"),
        argument="TELEMETRY",
    ),
    "mapping": Option(
        "",
        "a TOML file that defines its columns, or the name of a built-in one",
        content=later("studies.telemetry_files.existing_mapping"),
    ),
}
"""The arguments that name recorded telemetry and its mapping."""
READABLE = later("studies.telemetry.check")
"""The function that refuses unreadable telemetry."""
MOST_PANELS = 6
"""The most quantities in a figure, which shows those that differ first."""


def present(scenario: Scenario, entry: LawEntry, telemetry: Any, mapping: Any, tolerance: Any, result: Replay) -> Result:
    """Return the result: a row per quantity, the first differences, and gaps in the telemetry."""
    title = f"{scenario.name}, {entry.name}: replay of {result.telemetry.name}"
    heads = [Column("quantity"), Column("unit"), Column("samples", "", "d"), Column("rms difference", "", ".3g")]
    heads += [Column("largest", "", ".3g"), Column("at", "s", ".6g")]
    heads += [Column("beyond", "%", ".3g"), Column("parts at", "s", ".6g")]
    rows = [_row(one) for one in result.comparisons]
    blocks: list[Block] = [result.sentence, *(["", Table(heads, rows)] if rows else []), *result.notes]
    outcome = "undecided" if not rows else "met" if result.parted is None else "missed"
    return Result(title, blocks, _numbers(result), (lambda: draw(result, title)) if rows else None, outcome=outcome)


def _row(one: Comparison) -> list[Any]:
    import numpy as np

    sizes = one.difference
    largest = int(np.argmax(np.where(np.isnan(sizes), np.inf, sizes)))
    rms, share = float(np.sqrt(np.mean(sizes**2))), 100.0 * float(np.mean(one.beyond))
    numbers = [rms, float(sizes[largest]), float(one.times[largest]), share, one.parted_at]
    name = one.name if one.name == one.against else f"{one.name}, {one.against} recorded"
    return [name, one.unit, len(one.times), *numbers]


def _numbers(result: Replay) -> Table:
    """Return a table of all computed quantities at each control step, with the recorded ones."""
    import numpy as np

    from starhold.studies.telemetry_files import heads_of

    run, times = result.run, result.run["time"]
    columns, arrays = [Column("time", "s")], [times]
    for name, meant in run.columns.items():
        numbers = run[name].reshape(len(times), -1)
        columns += [Column(head, meant.unit) for head in heads_of(name, meant, numbers.shape[1])]
        arrays += list(numbers.T)
    for one in result.comparisons:
        meant = run.columns[one.name]
        full = np.full((len(times), one.recorded.shape[1]), np.nan)
        full[np.searchsorted(times, one.times)] = one.recorded
        columns += [Column(f"recorded {head}", meant.unit) for head in heads_of(one.against, meant, full.shape[1])]
        arrays += list(full.T)
    rows = [[None if number != number else number for number in row] for row in np.column_stack(arrays).tolist()]
    return Table(columns, rows)


def draw(result: Replay, title: str) -> Any:
    """Return a figure with a panel per quantity: the difference from the recorded values, and the allowed one, dashed."""
    import numpy as np

    from starhold.report.figures import framed, plain
    from starhold.report.plots import colour
    from starhold.report.ticks import label_ticks

    shown = sorted(result.comparisons, key=lambda one: np.inf if one.parted_at is None else one.parted_at)[:MOST_PANELS]
    height = 0.9 + 1.5 * len(shown)
    figure, axes = framed((8.0, height), title, len(shown), 1, (0.95, 0.2, 0.48, 0.5), sharex=True, hspace=0.16)
    for axis, one in zip(axes.ravel(), shown, strict=True):
        plain(axis)
        axis.plot(one.times, one.difference, color=colour(0), linewidth=0.9)
        axis.plot(one.times, one.allowed, color="0.35", linewidth=0.9, dashes=(5, 3))
        if one.parted_at is not None:
            axis.axvline(one.parted_at, color=colour(1), linewidth=1.2)
        label_ticks(axis.yaxis)
        axis.yaxis.get_offset_text().set_size(8.5)
        axis.set_ylabel(f"{one.name.replace('_', ' ')}\n{one.unit}", fontsize=8)
    axes.ravel()[-1].set_xlabel("time, s; differences (dashed: allowed; vertical line: first excess)", fontsize=8.5)
    return figure


COMMAND = Command(
    "Replay telemetry through the estimator and the law, and show where the results first differ from the recorded ones.",
    "replay",
    later("studies.replay.study"),
    present,
    doing=None,
    options=TELEMETRY
    | {
        "tolerance": Option(
            "",
            "share of the largest value by which others may differ; 0.01 if not given",
            content=later("studies.replay.tolerance_of"),
        )
    },
    unstable=True,
    check=READABLE,
    kinds=("csv", "png"),
)
