"""The tables of a campaign's page: verdicts, metrics, runs worth flying again, brackets, dispersions."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

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
from starhold.report.campaign_words import headline, outcome_of
from starhold.report.proved import swatch

if TYPE_CHECKING:
    from starhold.campaign.results import Bracket, CampaignResult, LawResult, Spread
    from starhold.campaign.verdicts import Verdict

PILLS = {"met": "proved", "missed": "refuted", "not decided": "undecided"}
"""The style of each outcome."""
NBSP = "\N{NO-BREAK SPACE}"
MOST_AGAIN = 25
"""Runs worth flying again that are listed of a law."""


def pill(outcome: str) -> str:
    """Show an outcome in its colour; nothing where there is none."""
    return f'<span class="outcome {PILLS[outcome]}">{escape(outcome)}</span>' if outcome in PILLS else ""


def named(number: int, law: LawResult) -> str:
    """Show a law's name with its colour."""
    return f"{swatch(number)}{escape(law.law)}"


def table(head: Sequence[str], rows: Sequence[str], kind: str = "", fit: bool = False) -> str:
    """Make a table that scrolls where it is too wide, and no wider than it needs to be if it shall `fit`; heads are
    HTML."""
    heads = "".join(f'<th scope="col">{text}</th>' for text in head)
    attribute = f' class="{kind}"' if kind else ""
    opened = f'<div class="wide{" fit" if fit else ""}"><table{attribute}>'
    return f"{opened}<thead><tr>{heads}</tr></thead>\n<tbody>{''.join(rows)}</tbody></table></div>"


def small(text: str) -> str:
    """Show a text below another, escaped; nothing where it is empty."""
    return f"<small>{escape(text)}</small>" if text else ""


def headlines(result: CampaignResult, words: Wording) -> str:
    """Tell of each law what its verdicts come to."""
    return "".join(
        f'<p class="said">{pill(outcome_of(law))}<span><b>{named(number, law)}</b> '
        f"{escape(headline(law, result.sampling, words).replace(' %', f'{NBSP}%'))}</span></p>\n"
        for number, law in enumerate(result.laws)
    )


def verdicts(result: CampaignResult, words: Wording) -> str:
    """Show one row for each requirement and law."""
    rows: list[str] = []
    for name in dict.fromkeys(verdict.name for law in result.laws for verdict in law.verdicts):
        own = [(number, law, v) for number, law in enumerate(result.laws) for v in law.verdicts if v.name == name]
        head = f"{escape(name)}{small(words.asks(name))}"
        rows += _grouped(head, "", [_verdict(verdict, number, law, words) for number, law, verdict in own])
    if not rows:
        return '<h2>Verdicts</h2>\n<p class="note">The campaign requires nothing, so there are no verdicts.</p>'
    head = (
        "requirement",
        "law",
        "verdict",
        "share of runs<small>and asked of flights</small>",
        "failure probability<small>Clopper–Pearson</small>",
        "margin kept<small>by the share asked</small>",
        "worst margin<small>and its run</small>",
        "worst condition<small>known before flight</small>",
    )
    if any(verdict.until_decided for law in result.laws for verdict in law.verdicts):
        head = (*head[:4], "failure probability<small>whenever stopped</small>", *head[5:])
    told = "".join(
        f"<li>{named(number, law)}: {escape(verdict.sentence())}</li>"
        for number, law in enumerate(result.laws)
        for verdict in law.verdicts
    )
    return (
        f"<h2>Verdicts</h2>\n{table(head, rows, 'verdicts')}\n"
        f'<details><summary>The verdicts in words</summary><ul class="note">{told}</ul></details>'
    )


def _verdict(verdict: Verdict, number: int, law: LawResult, words: Wording) -> str:
    part = verdict.worst_part
    condition = DASH
    if part is not None:
        failed = f"{count_text(part.failures)} of {counted(part.runs, 'run')} miss it: {part.outcome}"
        condition = f"{escape(part.name)}{small(failed)}"
    missed = f"{count_text(verdict.failures)} of {count_text(verdict.runs)} miss it"
    if verdict.independent:
        missed += f", {'none' if verdict.allowed is None else count_text(verdict.allowed)} may"
    bound = f"{bounds_text(verdict)}{small(f'{percent(verdict.confidence)} confidence each')}"
    if verdict.lower is None:
        bound = f"{DASH}{small('draws depend on each other')}"
    return (
        f"<td>{named(number, law)}</td><td>{pill(verdict.outcome)}</td>"
        f"<td>{percent(verdict.observed)} / {percent(verdict.share)}{small(missed)}</td><td>{bound}</td>"
        f"<td>{escape(words.margin(verdict.name, verdict.margin_bound))}</td>"
        f"<td>{escape(words.margin(verdict.name, verdict.worst_margin))}{small(f'run {verdict.worst_run}')}</td>"
        f"<td>{condition}</td>"
    )


def _grouped(head: str, meaning: str, cells: Sequence[str]) -> list[str]:
    """Rows, given as the HTML of their cells, that share one head."""
    title = f' title="{escape(meaning)}"' if meaning else ""
    first = f'<th scope="rowgroup" rowspan="{len(cells)}"{title}>{head}</th>'
    return [f'<tr class="first">{first}{row}</tr>' if k == 0 else f"<tr>{row}</tr>" for k, row in enumerate(cells)]


def laws(result: CampaignResult) -> str:
    """Show how many runs of each law were lost, and how many failed."""
    rows = [
        f'<tr><th scope="row">{named(number, law)}</th><td>{count_text(law.runs)}</td>'
        f"<td>{_of_runs(law.lost, law.runs)}</td><td>{_of_runs(law.failed, law.runs)}</td></tr>"
        for number, law in enumerate(result.laws)
    ]
    return (
        f"<h2>Runs</h2>\n{table(('law', 'runs', 'lost', 'failed'), rows, fit=True)}\n"
        '<p class="note">Lost: the motion left all bounds and has no final values. Failed: lost, or a requirement is '
        "missed.</p>"
    )


def _of_runs(number: int, runs: int) -> str:
    return f"{count_text(number)}{small(percent(number / max(runs, 1))) if number else ''}"


def metrics(result: CampaignResult, words: Wording) -> str:
    """Show the distribution of each metric under each law in numbers."""
    rows: list[str] = []
    for metric in headings_of(result, words):
        measure = words.measure(metric)
        head = f"{escape(measure.heading)}<small>{escape(measure.unit) or '&nbsp;'}</small>"
        found = [(number, law, s) for number, law in enumerate(result.laws) for s in law.spreads if s.metric == metric]
        cells = [f'<td class="whose">{named(number, law)}</td>{_spread(s, measure.scale)}' for number, law, s in found]
        rows += _grouped(head, measure.meaning, cells)
    if not rows:
        return ""
    head = ("metric", "law", "least", "5 %", "median", "95 %", "largest", "mean", "without value")
    return (
        f"<h2>Metrics</h2>\n{table(head, rows, 'spreads')}\n"
        '<p class="note">Over the runs that have the metric; a run that is lost, or never settles, is without one.</p>'
    )


def _spread(spread: Spread, scale: float) -> str:
    least, low, _, median, _, high, most = (scale * value for value in spread.quantiles)
    values = "".join(f"<td>{figure(value)}</td>" for value in (least, low, median, high, most, scale * spread.mean))
    return f"{values}<td>{count_text(spread.missing) if spread.missing else DASH}</td>"


def again(result: CampaignResult) -> str:
    """List the runs that are worth flying again, with what to type."""
    rows = [
        f'<tr><td>{named(number, law)}</td><td class="number">{item.run}</td><td>{escape(item.why)}</td>'
        f"<td>{code(item.command)}</td></tr>"
        for number, law in enumerate(result.laws)
        for item in law.again[:MOST_AGAIN]
    ]
    if not rows:
        return ""
    left = sum(len(law.again[MOST_AGAIN:]) for law in result.laws)
    more = f" {counted(left, 'further run')} are not listed." if left else ""
    return (
        f"<h2>Runs worth flying again</h2>\n{table(('law', 'run', 'why', 'command'), rows, 'text')}\n"
        '<p class="note">The command flies the run again, bit for bit, and writes its full series, pictures and page; a '
        f"click selects it.{more}</p>"
    )


def code(text: str) -> str:
    """Show a text to be typed; a click selects all of it."""
    return f'<code class="copy">{escape(text)}</code>'


def brackets(result: CampaignResult, words: Wording) -> str:
    """Show how bad metrics get: what was flown and what is proved."""
    rows = [_bracket(bracket, number, law, words) for number, law in enumerate(result.laws) for bracket in law.brackets]
    if not rows:
        return ""
    head = ("metric", "law", "flown ≤ true ≤ proved", "flown by", "proved by")
    return (
        f"<h2>Worst cases: flown ≤ true ≤ proved</h2>\n{table(head, rows, 'brackets')}\n"
        '<p class="note">The worst flown is that of all runs and of a search over the box of the dispersions: no smaller '
        "bound can be true. What is proved holds for every flight over what is drawn. The scenario file flies the worst run "
        "that was found.</p>"
    )


def _bracket(bracket: Bracket, number: int, law: LawResult, words: Wording) -> str:
    measure = words.measure(bracket.metric, bracket.unit)
    told = f"<b>{escape(worst_text(bracket, measure))}</b>"
    if bracket.proved is None:
        told += small("nothing is proved of it")
    else:
        told += f" {order(bracket)} <b>{escape(with_unit(bracket.proved, measure))}</b>"
    if bracket.contradicted:
        told += f'<span class="outcome refuted">contradicted</span>{small(CONTRADICTED)}'
    tries = f"after {counted(bracket.evaluations, 'flight')} of the search" if bracket.evaluations else ""
    return (
        f'<tr><th scope="row">{escape(measure.heading)}</th><td class="whose">{named(number, law)}</td>'
        f'<td class="number">{told}</td><td>{code(bracket.file) if bracket.file else DASH}{small(tries)}</td>'
        f"<td>{escape(bracket.assumption) or DASH}</td></tr>"
    )


def dispersions(result: CampaignResult) -> str:
    """List the dispersed keys with their distributions."""
    rows = [f"<tr><td>{escape(key)}</td><td>{escape(how)}</td></tr>" for key, how in result.over.items()]
    if not rows:
        return ""
    return f"<h2>Dispersions flown</h2>\n{table(('key', 'distribution'), rows, 'text')}"
