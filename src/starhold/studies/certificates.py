"""Certificates of a scenario's laws, each tested by flights."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.studies.body import study_of

if TYPE_CHECKING:
    from pathlib import Path

    from starhold.analysis.trial import Trial
    from starhold.certification.certificate import Certificate
    from starhold.certification.hand_over import Ends
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import Scenario


class Tried(NamedTuple):
    """A certificate, the flights that tested it (None: it claims nothing that can be flown), and for each kind of claim
    about a set whether the scenario starts inside it."""

    certificate: Certificate
    trial: Trial | None
    start_inside: dict[str, bool]


def compare_programs(path: Path, scenario: Scenario) -> list[str]:
    """Describe how the proofs of a checked file are about other loops than those of a scenario; empty where they are not."""
    from starhold.certification.comparison import differences, station_differences
    from starhold.studies.bodies.rigid_body import certified_loops, handed_over

    content: Any = json.loads(path.read_text(encoding="utf-8"))
    if not content["claims"] or "certificates" not in content:
        raise InputError(
            str(path), "", "no proofs about loops of a scenario", "a certificate with such proofs, or no --scenario"
        )
    loops: dict[str, ClosedLoop] = {}
    ends: dict[str, Ends] = {}
    for entry in scenario.laws:
        loop = build(scenario, entry)
        loops |= certified_loops(scenario, entry, loop) if scenario.body == "rigid-body" else {entry.name: loop}
        ends |= handed_over(scenario, entry, loop) if scenario.body == "rigid-body" else {}
    differing: list[str] = []
    for given in content["certificates"]:
        places = [claim["proof"] for claim in given["claims"] if "proof" in claim]
        if places and given["name"] not in loops:
            differing.append(f"{given['name']}: the scenario has no such law")
            continue
        if not places:
            continue
        loop = loops[given["name"]]
        station = loop.body.name == "libration-point"
        if any(station != ("field" in content["claims"][place]["programs"]) for place in places):
            differing.append(f"{given['name']}: the scenario is about another body")
            continue
        compare = station_differences if station else partial(differences, ends=ends.get(given["name"]))
        texts = [text for place in places for text in compare(content["claims"][place], loop)]
        differing += [f"{given['name']}: {text}" for text in dict.fromkeys(texts)]
    return differing


def certify_scenario(scenario: Scenario, law: str | None = None) -> list[Tried]:
    """Certificates of all laws of a scenario, or of one. Raises `BrokenClaimError` where a flight contradicts one."""
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
