"""The tables that summarize a campaign and explain why runs fail, for the terminal and the page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from starhold.campaign.verdicts import percent
from starhold.report.campaign_units import (
    CONTRADICTED,
    DASH,
    Wording,
    bounds_text,
    count_text,
    counted,
    figure,
    headings_of,
    order,
    with_unit,
    worst_text,
)
from starhold.report.commands import Cell, Column, Table
from starhold.report.tables import table_html

if TYPE_CHECKING:
    from starhold.campaign.drivers import Drivers, FailureDriver, MetricDriver, PairDriver
    from starhold.campaign.results import ByClaim, CampaignResult
    from starhold.campaign.sensitivity import Morris, Sobol
    from starhold.campaign.verdicts import Verdict
    from starhold.report.campaign_units import Measure


def numbers(*names: str) -> list[Column]:
    """Return columns of numbers, aligned right, with these headings; "|" begins the second line of a heading."""
    return [Column(name, below, ">") for name, _, below in (one.partition("|") for one in names)]


def law_cell(result: CampaignResult, number: int) -> Cell:
    """Return a cell with a law's name in its colour."""
    return Cell(result.laws[number].law, "law", number)


def verdicts(result: CampaignResult, words: Wording) -> Table | None:
    """Return a table with a row for each requirement and law; None where nothing is required."""
    rows: list[list[Any]] = []
    ends: set[int] = set()
    for name in dict.fromkeys(verdict.name for law in result.laws for verdict in law.verdicts):
        heading: Any = words.called(name)
        for number, law in enumerate(result.laws):
            for verdict in law.verdicts:
                if verdict.name == name:
                    rows.append([heading, law_cell(result, number), *_verdict(verdict, words)])
                    heading = ""
        ends.add(len(rows) - 1)
    if not rows:
        return None
    stopped = any(verdict.until_decided for law in result.laws for verdict in law.verdicts)
    columns = [
        *map(Column, ("requirement", "law", "verdict")),
        *numbers("meet it|and must", "miss it|and may"),
        *numbers(f"failure probability|{'whenever stopped' if stopped else 'Clopper–Pearson'}"),
        *numbers("worst margin|and its run", "margin kept|by the required share"),
    ]
    return Table(columns, rows, "Verdicts", ends=ends, note=" ".join(_conditions(result)))


def _verdict(verdict: Verdict, words: Wording) -> list[Any]:
    allowed = "none" if verdict.allowed is None else count_text(verdict.allowed)
    return [
        Cell(verdict.outcome, verdict.outcome),
        f"{percent(verdict.observed)} / {percent(verdict.share)}",
        f"{count_text(verdict.failures)} / {allowed if verdict.independent else DASH}",
        bounds_text(verdict),
        f"{words.margin(verdict.name, verdict.worst_margin)}, {verdict.worst_run}",
        words.margin(verdict.name, verdict.margin_bound),
    ]


def _conditions(result: CampaignResult) -> list[str]:
    """Return sentences on conditions known before flight under which requirements are not met."""
    sentences: list[str] = []
    for law in result.laws:
        for verdict in law.verdicts:
            part = verdict.worst_part
            if part is not None and part.outcome != "met" and verdict.independent:
                missed = f"{count_text(part.failures)} of {counted(part.runs, 'run')} miss it"
                where = f"with {part.name}, known before flight"
                sentences.append(f"{law.law}: {where}, {verdict.name} is {part.outcome}: {missed}.")
    return sentences


def runs(result: CampaignResult) -> Table:
    """Return a table of the numbers of lost and of failed runs of each law."""

    def of_runs(number: int, among: int) -> str:
        return f"{count_text(number)} ({percent(number / max(among, 1))})" if number else "0"

    rows = [
        [law_cell(result, number), count_text(law.runs), of_runs(law.lost, law.runs), of_runs(law.failed, law.runs)]
        for number, law in enumerate(result.laws)
    ]
    note = "Lost: the motion diverged and has no final values. Failed: lost, or misses a requirement."
    return Table([Column("law"), *numbers("runs", "lost", "failed")], rows, "Runs", note=note)


def metrics(result: CampaignResult, words: Wording, most: int | None = None) -> Table | None:
    """Return a table of the distribution of each metric for each law, required metrics first; most: of how many metrics."""
    headings, required = headings_of(result, words), {item.column for item in words.requirements.values()}
    rows: list[list[Any]] = []
    ends: set[int] = set()
    for metric in sorted(headings, key=lambda metric: (metric not in required, headings.index(metric)))[:most]:
        measure = words.measure(metric)
        cells: list[Any] = [Cell(measure.heading, detail=measure.meaning), measure.unit]
        for number, law in enumerate(result.laws):
            for spread in law.spreads:
                if spread.metric == metric:
                    least, low, _, median, _, high, largest = spread.quantiles
                    values = (figure(measure.scale * x) for x in (least, low, median, high, largest, spread.mean))
                    missing = count_text(spread.missing) if spread.missing else DASH
                    rows.append([*cells, law_cell(result, number), *values, missing])
                    cells = ["", ""]
        ends.add(len(rows) - 1)
    if not rows:
        return None
    heads = numbers("least", "5 %", "median", "95 %", "largest", "mean", "without|value")
    note = "Over the runs that have the metric; a run that is lost, or never settles, has none."
    return Table([*map(Column, ("metric", "unit", "law")), *heads], rows, "Metrics", ends=ends, note=note)


def again(result: CampaignResult, most: int) -> Table | None:
    """Return a table of runs worth flying again, at most `most` of each law, with the commands."""
    rows = [
        [law_cell(result, number), str(item.run), item.why, Cell(item.command, "typed")]
        for number, law in enumerate(result.laws)
        for item in law.again[:most]
    ]
    if not rows:
        return None
    left = sum(len(law.again[most:]) for law in result.laws)
    more = f" {counted(left, 'further run')} are not listed." if left else ""
    note = f"The command flies the run again, bit for bit, and writes its full series, pictures and page.{more}"
    columns = [Column("law"), *numbers("run"), Column("why"), Column("command")]
    return Table(columns, rows, "Runs worth flying again", note=note)


def brackets(result: CampaignResult, words: Wording) -> Table | None:
    """Return a table of the worst value flown and the bound proved for each metric."""
    rows: list[list[Any]] = []
    faults: list[str] = []
    for number, law in enumerate(result.laws):
        for item in law.brackets:
            measure = words.measure(item.metric, item.unit)
            text, why = worst_text(item, measure), "nothing is proved about it"
            if item.proved is not None:
                text, why = f"{text} {order(item)} {with_unit(item.proved, measure)}", item.assumption
            tries = f"{counted(item.evaluations, 'flight')} of the search" if item.evaluations else DASH
            rows.append([measure.heading, law_cell(result, number), text, why, tries, Cell(item.file, "typed")])
            faults += [f"{law.law}, {measure.heading}: {CONTRADICTED}"] if item.contradicted else []
    if not rows:
        return None
    note = (
        "The worst value flown is that of all runs and of a search over the box of the dispersions: no smaller bound can "
        "be true. The proved bound holds for every flight within the dispersions. The scenario file flies the worst run "
        "found."
    )
    columns = [*map(Column, ("metric", "law")), *numbers("flown ≤ true ≤ proved")]
    columns += [*map(Column, ("proved by", "looked for by", "flown by"))]
    return Table(columns, rows, "Worst cases: flown ≤ true ≤ proved", note=" ".join([*faults, note]))


def claims(result: CampaignResult, words: Wording) -> Table | None:
    """Return a table of the metrics bounded by the claim about each loop as it flies, for flights that meet its premises;
    None where no proof was requested."""
    rows: list[list[Any]] = []
    sentences: list[str] = []
    for number, claim in ((number, claim) for number, law in enumerate(result.laws) for claim in law.claims):
        sentences += [f"{claim.about}: {CONTRADICTED}"] if claim.contradicted else []
        sentences.append(f"{claim.about}: {_claimed(claim)}")
        for item in claim.within:
            measure = words.measure(item.metric, item.unit)
            text = f"{'no value' if math.isnan(item.flown) else with_unit(item.flown, measure)} ≤ "
            beyond = f"{count_text(item.beyond)} of {count_text(item.covered)}"
            named = law_cell(result, number)._replace(text=claim.about)
            rows.append([measure.heading, named, text + with_unit(item.proved, measure), beyond])
    if not sentences:
        return None
    columns = [*map(Column, ("metric", "law")), *numbers("worst flown ≤ proved", "flights beyond")]
    return Table(columns, rows, "Proved of the loop as it flies", note=" ".join(sentences))


def _claimed(claim: ByClaim) -> str:
    """Return sentences on a claim, the number of flights that meet its premises, and how often its noise bound holds."""
    if not claim.runs:
        return f"nothing is proved: {claim.text}."
    left = "".join(f", {count_text(count)} {why}" for why, count in claim.left.items())
    said = f"{claim.text}. Of {counted(claim.runs, 'flight')} {count_text(claim.covered)} meet its premises{left}."
    if claim.share is None:
        return said
    share = f"{said} It holds for at least {percent(claim.share)} of flights of this duration"
    if claim.misled is None:
        return f"{share}; the readings that the law is given are not recorded."
    return f"{share}, and measurement errors exceed its assumption in {count_text(claim.misled)} of these."


def dispersions(result: CampaignResult) -> Table | None:
    """Return a table of the dispersed keys with their distributions."""
    rows = [[key, how] for key, how in result.over.items()]
    return Table([Column("key"), Column("distribution")], rows, "Dispersions flown") if rows else None


UP, DOWN, BOTH = "213,94,0", "0,114,178", "123,63,160"
"""The colours (red, green, blue) of effects that increase, decrease, or otherwise change with an input."""


def drivers(causes: Drivers, words: Wording, most: int) -> Table:
    """Return a table of the drivers of failures and metrics of a law, at most `most` of each kind."""
    kinds = [
        [_failure(item) for item in causes.inputs if item.significant],
        [_pair(item) for item in causes.pairs if item.significant],
        [_metric(item, words) for item in causes.metrics if item.significant],
    ]
    rows = [row for kind in kinds for row in kind[:most]]
    left = sum(map(len, kinds)) - len(rows)
    sentences = [f"{causes.failures} of {counted(causes.runs, 'run')} failed."]
    sentences += [] if rows else ["No input tested is significant."]
    sentences += [f"{counted(left, 'weaker significant driver')} not listed in the table."] if left else []
    sentences += [f"{causes.remark[:1].upper()}{causes.remark[1:]}."] if causes.remark else []
    if causes.skipped:
        sentences.append(f"Not tested, because they are constant or lack values: {', '.join(causes.skipped)}.")
    columns = [*map(Column, ("what happens", "with", "how", "strength")), *numbers("p, corrected")]
    return Table(columns, rows, note=" ".join(sentences))


def _failure(item: FailureDriver) -> list[Any]:
    if isinstance(item.range, str):
        how = f"most often where {item.range}"
    else:
        side = "" if item.above is None else f"; greater than in a passed run with probability {item.above:.2f}"
        how = "nine in ten failed runs from {:.4g} to {:.4g}{}".format(*item.range, side)
    return ["runs fail", item.input, how, Cell(f"distance {item.distance:.2f}", "share", item.distance), _chance(item)]


def _pair(item: PairDriver) -> list[Any]:
    how = f"most often where {item.where}"
    if item.drawn_together:
        how += "; they are drawn together, so one may stand for the other"
    share = Cell(f"{percent(item.failed)} fail there", "share", item.failed)
    return ["runs fail together", " and ".join(item.inputs), how, share, _chance(item)]


def _metric(item: MetricDriver, words: Wording) -> list[Any]:
    verb = "changes" if item.words else "grows" if item.correlation > 0.0 else "falls"
    kind = "correlation ratio" if item.words else "rank correlation"
    share = Cell(f"{kind} {item.correlation:.2f}", "share", abs(item.correlation))
    return [f"{words.measure(item.metric).heading} {verb}", item.input, DASH, share, _chance(item)]


def _chance(item: FailureDriver | PairDriver | MetricDriver) -> str:
    """Return a corrected p-value as text; one that underflows is shown as a bound."""
    return f"{item.corrected:.2g}" if item.corrected > 1e-300 else "< 1e-300"


def indices(result: CampaignResult, words: Wording) -> list[Table]:
    """Return tables of the sensitivity indices of each law's metrics, or the reasons why there are none; empty where none
    were requested."""
    from starhold.campaign.sensitivity import Morris, Refused

    shown: list[Table] = []
    for law in result.laws:
        for metric, outcome in law.indices.items():
            measure = words.measure(metric)
            heading = f"{law.law}: {measure.heading}"
            if isinstance(outcome, Refused):
                shown.append(Table([], [], heading, note=f"No sensitivity indices: {outcome.reason}."))
            else:
                shown.append(_morris(outcome, measure, heading) if isinstance(outcome, Morris) else _sobol(outcome, heading))
    return shown


def _morris(effects: Morris, measure: Measure, heading: str) -> Table:
    most, scale = max(map(abs, effects.mu_star), default=0.0) or 1.0, measure.scale
    rows = [
        [
            effects.names[i],
            Cell(_with_width(effects.mu_star[i], effects.mu_star_width[i], scale), "share", effects.mu_star[i] / most),
            *(figure(scale * x[i]) for x in (effects.mu, effects.sigma)),
        ]
        for i in _strongest(effects.mu_star)
    ]
    note = (
        "Elementary effects from the lowest to the highest level of each input, beyond which an eighth of its probability "
    )
    note += f"lies on each side; ± holds with {percent(effects.confidence)} confidence."
    if effects.dropped:
        note += f" {effects.dropped} of {effects.trajectories} trajectories were dropped, because they contain failed runs."
    columns = [Column("input"), Column("mean magnitude μ*", measure.unit)]
    columns += numbers(f"mean μ|{measure.unit}", f"spread σ|{measure.unit}")
    return Table(columns, rows, heading, note=note)


def _sobol(shares: Sobol, heading: str) -> Table:
    kinds = ((shares.first, shares.first_width), (shares.total, shares.total_width))
    rows = [
        [shares.names[i], *(Cell(_with_width(share[i], width[i]), "share", share[i]) for share, width in kinds)]
        for i in _strongest(shares.total)
    ]
    note = f"Shares of the metric's variance; ± holds with {percent(shares.confidence)} confidence."
    return Table([*map(Column, ("input", "by itself", "with all others"))], rows, heading, note=note)


def _with_width(value: float, width: float, scale: float = 1.0) -> str:
    return f"{figure(scale * value, 3)} ± {figure(scale * width, 2)}"


def _strongest(values: Iterable[float]) -> Sequence[int]:
    """Return the indices of values in decreasing order of these, NaN last."""
    listed = list(values)
    return sorted(range(len(listed)), key=lambda i: (math.isnan(listed[i]), -listed[i]))


def picture(causes: Drivers, words: Wording) -> str:
    """Return HTML that shows the strengths of all significant inputs as colours: a row per input, a column per effect."""
    cells = {
        (item.input, ""): Cell(f"{item.distance:.2f}", "shade", item.distance, BOTH)
        for item in causes.inputs
        if item.significant
    }
    for item in causes.metrics:
        if item.significant:
            colour = BOTH if item.words else UP if item.correlation > 0.0 else DOWN
            text = f"{item.correlation:{'' if item.words else '+'}.2f}".replace("-", "−")
            cells[item.input, item.metric] = Cell(text, "shade", item.correlation, colour)
    if not cells:
        return ""
    metrics = list(dict.fromkeys(metric for _, metric in cells))
    columns = [Column("input"), *numbers(*(words.measure(name).heading if name else "failure" for name in metrics))]
    rows = [[name, *(cells.get((name, metric), "·") for metric in metrics)] for name in dict.fromkeys(n for n, _ in cells)]
    keys = ((UP, "increases with the input"), (DOWN, "decreases with it"), (BOTH, "depends on it"))
    legend = " ".join(
        f'<span class="legend"><span class="key" style="background:rgba({colour},.6)"></span>{escape(meaning)}</span>'
        for colour, meaning in keys
    )
    return (
        f'{table_html(Table(columns, rows), "heat", fit=True)}\n<p class="note">{legend}. Failure: distance between the '
        "distributions of the input in failed and in passed runs. Metrics: rank correlation, or correlation ratio for "
        "words. A dot: not significant.</p>"
    )
