"""Does one job of the studio in a separate process: reports its progress and result, and writes its files to a folder."""

from __future__ import annotations

import shutil
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from functools import partial
from html import escape
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.errors import InputError
from starhold.report import commands
from starhold.scenario.reading import Scenario, parse
from starhold.studio.apart import begin

if TYPE_CHECKING:
    from starhold.campaign.worst import Sought
    from starhold.studies.body import Notice

PULSE = 0.2
"""The least time (s) between two reports of progress."""


def _compare(scenario: Scenario, folder: Path, tell: Notice) -> str:
    from starhold.report.results import write_results
    from starhold.studies.compare import compare

    flights = compare(scenario, lambda name, done, total: tell(done, total, f"{name} flies"))
    return write_results(scenario, flights, folder).name


def _certify(scenario: Scenario, folder: Path, tell: Notice) -> str:
    from starhold.report.answer import proofs
    from starhold.report.page_parts import fold
    from starhold.report.proved import section
    from starhold.report.results import write_proofs
    from starhold.scenario.building import build
    from starhold.simulation.lane import fly
    from starhold.studies.body import study_of
    from starhold.studies.certificates import certify_scenario
    from starhold.studies.compare import name_samples
    from starhold.studies.flight import Flight

    study, flights = study_of(scenario.body), list[Any]()
    for place, entry in enumerate(scenario.laws):
        tell(place, len(scenario.laws), f"{entry.name} is certified")
        loop = build(scenario, entry)
        tried = certify_scenario(scenario, entry.name)
        run = name_samples(scenario, loop, *fly(loop, 1))
        certificates = tuple(one.certificate for one in tried)
        flights.append(Flight(entry.name, entry.law.name, run, {}, {}, study.metric_set(run), certificates))
    write_proofs([certificate for flight in flights for certificate in flight.certificates], scenario.name, folder)
    return _document(scenario, folder, [proofs(flights), fold("Proofs", section(flights))])


def _studied(name: str, scenario: Scenario, folder: Path, tell: Notice) -> str:
    """Run a study and write its page with the picture, the text, and links to the files; return the page's name."""
    from starhold.report.document import block_html
    from starhold.report.figures import address
    from starhold.report.results import write_result
    from starhold.report.tables import pill

    command = commands.command(name)
    subject = command.prepare(scenario)
    result = command.result(subject, tell)
    files = write_result(result, name, scenario.name, folder) if command.suffix else {}
    parts = [f"<h2>{escape(result.title)}</h2>", *map(block_html, result.blocks)]
    if "Picture" in files:
        source = address(files["Picture"].read_bytes())
        parts.append(f'<p><img src="{source}" alt="{escape(result.title)}" style="max-width:100%"></p>')
    links = (f'{what}: <a href="{path.name}" download>{path.name}</a>' for what, path in files.items())
    parts += [f"<p>{'. '.join(links)}.</p>"] if files else []
    judged = any('class="outcome' in part for part in parts)
    return _document(scenario, folder, parts, pill(result.outcome.replace("undecided", "not decided")) if judged else "")


def _export(scenario: Scenario, folder: Path, tell: Notice) -> str:
    from starhold.api import export_c

    parts: list[str] = []
    for place, entry in enumerate(scenario.laws):
        tell(place, len(scenario.laws), f"{entry.name} is written and certified")
        parts.append(f"<h2>{escape(entry.name)}</h2>")
        try:
            made = export_c(scenario, folder / entry.name, entry.name)
        except InputError as error:
            parts.append(f"<p>{escape(str(error))}</p>")
            continue
        archive = shutil.make_archive(str(folder / f"{entry.name}-c"), "zip", folder, entry.name)
        said = made.proof.warning or f"Proved: {made.proof.file}, sha256 {made.proof.digest}."
        costs = "".join(
            f"<li>{escape(cost.target)}: {cost.flash} bytes of flash, {cost.stack} of stack</li>" for cost in made.costs
        )
        parts.append(
            f'<p><a href="{escape(Path(archive).name)}" download>{escape(Path(archive).name)}</a>: '
            f"{escape(', '.join(made.files))}</p><p>{escape(said)}</p><ul>{costs}</ul>"
        )
    return _document(scenario, folder, parts)


def _document(scenario: Scenario, folder: Path, parts: list[str], answer: str = "") -> str:
    from starhold.report.page_parts import document, versions

    text = document(scenario, parts, {"laws": [], "plots": []}, (), f"{versions()}.", answer=answer)
    (folder / "report.html").write_text(text, encoding="utf-8", newline="\n")
    return "report.html"


def _rerun(campaign: Path, law: str, run: int, folder: Path, tell: Notice) -> str:
    from starhold.campaign.again import fly_again
    from starhold.report.results import write_results

    tell(0, 0, f"run {run} of {law} flies")
    again = fly_again(campaign, run, law)
    return write_results(again.scenario, [again.flight], folder).name


def _campaign(scenario: Scenario, folder: Path, tell: Notice) -> str:
    from starhold.campaign.campaign import Options, fly_campaign, with_campaign
    from starhold.campaign.engines import engine_of
    from starhold.report.campaign_page import write_campaign

    scenario = with_campaign(scenario, {})
    runs, done = scenario.table.campaign.runs * len(scenario.laws), Counter[str]()

    def notice(law: str, more: int, sought: Sought | None = None) -> None:
        what, total = (f"{law} flies", runs) if sought is None else (f"{sought.name} of {law}", sought.flights)
        key = "" if sought is None else what
        done[key] += more
        tell(done[key], total, what)

    result = fly_campaign(scenario, folder, None, Options(engine_of(None, None, None), force=True), notice)
    tell(0, 0, "the report is written")
    return write_campaign(scenario, result).name


KINDS = {
    "compare": _compare,
    "certify": _certify,
    **{name: partial(_studied, name) for name in commands.names() if commands.command(name).offered},
    "campaign": _campaign,
    "export": _export,
}
"""The kinds of jobs."""
RERUN = "rerun"
"""The further kind of job that flies one run of a campaign again."""


def work(teller: Connection, kind: str, text: str, where: str, beside: Path, folder: Path, laws: Sequence[str]) -> None:
    """Do a job in its process; the last report names the page to open, or the error. laws: those of the scenario; for a run
    of the campaign in the folder `where`, the law and the run's number."""
    begin()
    reported = [0.0]

    def tell(done: int, total: int, what: str) -> None:
        now = time.monotonic()
        if now - reported[0] >= PULSE or done == total:
            reported[0] = now
            teller.send({"done": done, "total": total, "what": what})

    try:
        if kind == RERUN:
            shown = _rerun(Path(where), laws[0], int(laws[1]), folder, tell)
        else:
            shown = KINDS[kind](parse(text, where, beside), folder, tell)
        teller.send({"shown": shown})
    except InputError as error:
        teller.send({"error": str(error), "key": error.key})
    except Exception:
        teller.send({"error": traceback.format_exc(-10).strip()})
