"""Certificates of a scenario's laws, each tested by flights."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.studies.body import Issued, study_of

if TYPE_CHECKING:
    from pathlib import Path

    from starhold.analysis.trial import Trial
    from starhold.certification.certificate import Certificate
    from starhold.certification.hand_over import Ends
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import Scenario


class Tried(NamedTuple):
    """A certificate, the flights that tested it (None: it has no claim that flights can test), and for each kind of claim
    about a set, whether the scenario starts inside the set."""

    certificate: Certificate
    trial: Trial | None
    start_inside: dict[str, bool]


class Flown(NamedTuple):
    """A certificate of a checked file: its claims that have proofs, by their places, and the loop of a scenario that has its
    name. ends: where the previous mode hands over to it; begins: whether the scenario's flight begins with it."""

    name: str
    places: list[int]
    loop: ClosedLoop
    ends: Ends | None
    begins: bool


def compare_programs(path: Path, scenario: Scenario) -> list[str]:
    """Return the differences between the loops that the proofs of a checked file are about and those of a scenario."""
    from starhold.certification.comparison import differences, station_differences

    content = _content(path)
    flown, differing = _flown(content, scenario)
    for one in flown:
        compare = station_differences if _is_station(one.loop) else partial(differences, ends=one.ends)
        texts = [text for place in one.places for text in compare(content["claims"][place], one.loop)]
        differing += [f"{one.name}: {text}" for text in dict.fromkeys(texts)]
    return differing


def left_open(path: Path, scenario: Scenario) -> list[str]:
    """Return what the proofs of a checked file leave open about the loops of a scenario, from which they do not differ: what
    the claims leave out or assume beside, assumptions that the loops do not meet, and starts outside of the claims' sets."""
    from starhold.analysis.departure import Span
    from starhold.certification.assumptions import texts
    from starhold.certification.certificate import Certificate
    from starhold.certification.evidence.attitude import Loop
    from starhold.certification.evidence.station import Station
    from starhold.certification.proofs import made
    from starhold.certification.station import made_of_station
    from starhold.certification.subject import make_subject
    from starhold.certification.unmodelled import named
    from starhold.kernel.check import check
    from starhold.simulation.lane import fly, label

    content, study, left = _content(path), study_of(scenario.body), list[str]()
    proofs, programs = check(json.dumps(content)), [*content["programs"].values()]
    for one in _flown(content, scenario)[0]:
        if _is_station(one.loop):
            claimed = partial(made_of_station, station=Station(one.loop))
        else:
            claimed = partial(made, loop=Loop(make_subject(one.loop), programs))
        plain = [claimed(proofs[k], content["claims"][k]) for k in one.places if not proofs[k].statement.refutes]
        every = [x for claim in plain for x in named([claim], one.loop, claim.numbers.get("momentum", 0.0))]
        issued = Issued(Certificate(one.name, {}, tuple(every)), one.loop)
        inside = study.start_inside(issued) if one.begins else {}
        span = Span(one.loop, label(one.loop, *fly(one.loop, 1), 1))
        said: dict[str, list[str]] = {}
        for before, claim in zip(plain, every, strict=True):
            about = [*texts(claim.assumptions[len(before.assumptions) :]), *span.unmet_throughout(before)]
            about += [] if inside.get(claim.kind, True) else ["the flight starts outside of its set"]
            said.setdefault("; ".join(dict.fromkeys(about)), []).append(claim.kind)
        left += [f"{one.name}: {', '.join(kinds)}: {text}" for text, kinds in said.items() if text]
    return left


def _content(path: Path) -> Any:
    """Return the content of a checked file; InputError where it has no proofs about loops of a scenario."""
    content: Any = json.loads(path.read_text(encoding="utf-8"))
    if not content["claims"] or "certificates" not in content:
        raise InputError(
            str(path), "", "no proofs about loops of a scenario", "a certificate with such proofs, or no --scenario"
        )
    return content


def _flown(content: Any, scenario: Scenario) -> tuple[list[Flown], list[str]]:
    """Return the certificates with proofs and the loops of a scenario that they name, and which it has not."""
    from starhold.studies.bodies.rigid_body import certified_loops, handed_over

    loops: dict[str, ClosedLoop] = {}
    ends: dict[str, Ends] = {}
    flown, differing = list[Flown](), list[str]()
    for entry in scenario.laws:
        loop = build(scenario, entry)
        loops |= certified_loops(scenario, entry, loop) if scenario.body == "rigid-body" else {entry.name: loop}
        ends |= handed_over(scenario, entry, loop) if scenario.body == "rigid-body" else {}
    begin = {entry.name for entry in scenario.laws}
    for given in content["certificates"]:
        name, places = given["name"], [claim["proof"] for claim in given["claims"] if "proof" in claim]
        if not places:
            continue
        if name not in loops:
            differing.append(f"{name}: the scenario has no such law")
        elif any(_is_station(loops[name]) != ("field" in content["claims"][place]["programs"]) for place in places):
            differing.append(f"{name}: the scenario is about another body")
        else:
            flown.append(Flown(name, places, loops[name], ends.get(name), name in begin))
    return flown, differing


def _is_station(loop: ClosedLoop) -> bool:
    return loop.body.name == "libration-point"


def certify_scenario(scenario: Scenario, law: str | None = None) -> list[Tried]:
    """Return the certificates of all laws of a scenario, or of one. Raises `BrokenClaimError` if a flight contradicts
    one."""
    study, entries = study_of(scenario.body), scenario.laws if law is None else (scenario.pick(law),)
    if scenario.supposed is not None:
        raise InputError(
            scenario.where, "nominal", "a [nominal] table that differs from the craft", "no [nominal], for certification"
        )
    # All are read before the first proof, so that an error in the last is reported at once.
    loops = [build(scenario, entry) for entry in entries]
    issued = [
        one
        for entry, loop in zip(entries, loops, strict=True)
        for one in study.certify(scenario, entry, loop, pointing=True)
    ]
    return [Tried(one.certificate, study.fly_claims(one), study.start_inside(one)) for one in issued]
