"""Does one thing that the studio was asked for, in a process of its own: reads a scenario's text as a line of JSON from
standard input, tells its progress and its result as lines of JSON, and leaves its files in a folder. It ends where its
standard input does."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.errors import InputError
from starhold.scenario.reading import parse

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario

PULSE = 0.2
"""Seconds between two lines of progress at least."""

Tell = Callable[[int, int, str], None]


def _compare(scenario: Scenario, folder: Path, tell: Tell) -> str:
    from starhold.report.results import write_results
    from starhold.studies import compare as studies

    loops = [studies.build(scenario, entry) for entry in scenario.laws]
    flights: list[Any] = []
    for entry, loop in zip(scenario.laws, loops, strict=True):
        flight = studies.fly_law(scenario, entry, loop, lambda name, done, total: tell(done, total, f"{name} flies"))
        tell(0, 0, f"{entry.name} is certified")
        flights.append(studies.prove(scenario, entry, loop, flight))
    flights = [studies.timed(scenario, loop, flight) for loop, flight in zip(loops, flights, strict=True)]
    return write_results(scenario, flights, folder).name


def _certify(scenario: Scenario, folder: Path, tell: Tell) -> str:
    from starhold.report.page_parts import document, versions
    from starhold.report.proved import section
    from starhold.report.results import write_proofs
    from starhold.scenario.building import build
    from starhold.simulation.lane import fly
    from starhold.studies.body import study_of
    from starhold.studies.certificates import certify_scenario
    from starhold.studies.compare import name_samples
    from starhold.studies.flight import Flight

    study, found = study_of(scenario.body), list[Any]()
    for place, entry in enumerate(scenario.laws):
        tell(place, len(scenario.laws), f"{entry.name} is certified")
        loop = build(scenario, entry)
        tried = certify_scenario(scenario, entry.name)
        run = name_samples(scenario, loop, *fly(loop, 1))
        certificates = tuple(one.certificate for one in tried)
        found.append(Flight(entry.name, entry.law.name, run, {}, {}, study.metric_set(run), certificates))
    write_proofs([certificate for flight in found for certificate in flight.certificates], scenario.name, folder)
    text = document(scenario, [section(found)], {"laws": [], "plots": []}, (), f"{versions()}.")
    return _page(folder, text)


def _design(scenario: Scenario, folder: Path, tell: Tell) -> str:
    from starhold.report.page_parts import document, versions
    from starhold.report.text import number_text
    from starhold.scenario.designing import design

    tell(0, 0, "gains are computed")
    parts: list[str] = []
    for found in design(scenario):
        law = scenario.pick(found.name).law
        parts.append(f'<h2>{escape(found.name)}: {escape(law.card.title)}, form "{escape(found.form)}"</h2>')
        for title, items, values in (("from", law.fields(found.form), found.inputs), ("gains", law.fields(), found.gains)):
            rows = "".join(
                f"<tr><td>{escape(item.name)}</td><td>{escape(_shown(values[item.name]))}</td><td>{escape(item.gain.unit)}</td>"
                f"<td>{escape(item.gain.text)}</td></tr>"
                for item in items
            )
            head = "".join(f"<th>{name}</th>" for name in (title, "value", "unit", "meaning"))
            parts.append(
                f'<div class="wide"><table class="text"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
            )
        figures = "".join(
            f"<dt>{escape(name)}</dt><dd>{escape(number_text(value) if isinstance(value, float) else str(value))}</dd>"
            for name, value in found.figures.items()
        )
        parts.append(f"<dl>{figures}</dl>")
    return _page(folder, document(scenario, parts, {"laws": [], "plots": []}, (), f"{versions()}."))


def _shown(value: Any) -> str:
    from starhold.report.text import number_text

    return "—" if value is None else number_text(value)


def _failures(scenario: Scenario, folder: Path, tell: Tell) -> str:
    from starhold.report.failures_picture import draw
    from starhold.report.results import FAILURES
    from starhold.report.tables import write_failures
    from starhold.studies.failures import require_wheels, study

    entry = scenario.about("rigid-body").laws[0]
    require_wheels(scenario)
    found = study(scenario, entry, lambda done, total, name: tell(done, total, f"lost: {name}" if name else "flown"))
    write_failures(found, entry, folder / FAILURES[0])
    draw(found, folder / FAILURES[1], f"{scenario.name}, {entry.name}: loss of wheels")
    return FAILURES[1]


def _campaign(scenario: Scenario, folder: Path, tell: Tell) -> str:
    from starhold.campaign.campaign import Options, fly_campaign, with_campaign
    from starhold.campaign.engines import engine_of
    from starhold.report.campaign_files import write_campaign

    scenario = with_campaign(scenario, {})
    total, done = scenario.table.campaign.runs * len(scenario.laws), [0]

    def notice(law: str, more: int) -> None:
        done[0] += more
        tell(done[0], total, f"{law} flies")

    result = fly_campaign(scenario, folder, None, Options(engine_of(None, None, None), force=True), notice)
    tell(0, 0, "the report is written")
    return write_campaign(scenario, result).name


def _page(folder: Path, text: str) -> str:
    (folder / "report.html").write_text(text, encoding="utf-8", newline="\n")
    return "report.html"


KINDS = {"compare": _compare, "certify": _certify, "design": _design, "failures": _failures, "campaign": _campaign}
"""What can be asked for."""


def main(kind: str, where: str, beside: str, folder: str) -> None:
    """Do it; the last line tells the file to look at, or what was wrong."""
    told, text = [0.0], json.loads(sys.stdin.readline())
    threading.Thread(target=_end_with_studio, daemon=True).start()

    def tell(done: int, total: int, what: str) -> None:
        now = time.monotonic()
        if now - told[0] >= PULSE or done == total:
            told[0] = now
            _say({"done": done, "total": total, "what": what})

    try:
        scenario = parse(text, where, Path(beside))
        _say({"shown": KINDS[kind](scenario, Path(folder), tell)})
    except InputError as error:
        _say({"error": str(error), "key": error.key})


def _end_with_studio() -> None:
    # Not through sys.stdin, which a thread that waits for it would hold at the end of this process.
    while os.read(0, 1):
        pass
    os._exit(1)


def _say(what: dict[str, Any]) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
