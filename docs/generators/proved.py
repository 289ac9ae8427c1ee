"""The tables of how near to their targets the built-in scenarios are proved to stay and from where, beside what is measured
and the worst flights, and of what each source costs. Run it in the repository's root, with src, docs and the root itself in
PYTHONPATH, to prove, measure and fly them anew, all or those of the scenarios that are named; with `--flown` first only what
is proved and flown, which is what `tests/certification` flies."""

from __future__ import annotations

import json
import math
import sys
import warnings
from collections.abc import Collection
from functools import partial
from pathlib import Path
from typing import Any

import starhold as sh
from generators.tables import table
from starhold.analysis.pointing import ANGLE
from starhold.certification.certificate import Claim
from starhold.scenario.building import build
from starhold.studies.bodies.rigid_body import STUDY
from starhold.studies.budget import COMBINED, LOOP, TOGETHER, faultless, sources, study, without
from starhold.studies.pointing import ProvedPointing, prove_pointing

STORED = Path(__file__).with_name("proved.json")
"""By scenario and certificate what is proved: the start (rad, rad/s), the ultimate bounds (rad, rad/s), from when on (s), in
which share of orbits, what it leaves out of how many parts, and whether it is about a torque without limits. The largest
angle of the worst flights as a share of the bound, and how many times the start may be for flights to come home, and to do
so within limits. Of laws without faults also by how much the bound is lower without each source and without any,
None where that is not told, and the levels of the absolute error that are measured, together and of each source."""
SCENARIOS = ("three-laws", "geostationary", "wheels-orbital", "flexible-slew", "cubesat-nadir", "cubesat-mission")
REST = "all of these"
LONGER, MOST = 2, 1e6
"""A flight lasts at least so many times the time after which the bound holds."""
LANES, FEWER, LASTING, SWAYING, ROUNDS, DIRECTIONS = 2500, 250, 1000, 32, 4, 32
"""Flights of a round, of one of flights with more samples than the third number, and of one with appendages; rounds;
directions of each start."""
MISSING = "—"


def claims(name: str, law: str) -> dict[str, tuple[Claim, int]]:
    """What is proved now of all certificates of a law, as it starts, after faults and of modes, with the number of parts."""
    scenario, rows = sh.load(name), dict[str, tuple[Claim, int]]()
    for one in STUDY.certify(scenario, entry := scenario.pick(law), build(scenario, entry), pointing=True):
        for kind in ("appendages", "pointing"):
            claim = one.certificate.claim(kind)
            if claim is not None and claim.outcome == "proved":
                more = " with appendages" if kind == "appendages" else ""
                rows[f"{name} {one.certificate.name}{more}"] = claim, one.certificate.subject["parts"]
    return rows


def flown(name: str, law: str) -> dict[str, dict[str, Any]]:
    """The numbers of all these claims, and the worst flights."""
    return {key: told(claim, parts) | worst(claim) for key, (claim, parts) in claims(name, law).items()}


def told(claim: Claim, parts: int) -> dict[str, Any]:
    """The numbers of a claim."""
    n = claim.numbers
    return {
        "start": [n["slew_angle"], n["rate_start"]],
        **{name: n[name] for name in ("angle", "rate", "settling", "share")},
        "parts": parts,
        "left_out": list(claim.left_out),
        "unlimited": any(name.startswith("unlimited") for name in claim.assumptions),
    }


def worst(claim: Claim) -> dict[str, Any]:
    """The largest angle of the worst flights as a share of the bound, and the largest starts as multiples of the claim's."""
    from tests.certification.borders import Limited
    from tests.certification.extremal import Steered
    from tests.kernel.swaying import Swaying

    proof: Any = claim.proof
    content = {"programs": dict(proof.programs), "claims": [proof.claim]}
    if claim.kind == "appendages":
        return {"flown": float(Swaying(content, 1, SWAYING).worst(ROUNDS)), "flights": SWAYING * ROUNDS}
    # Flights that last long are fewer.
    samples = Steered(content, proof.claim, 1, 16).search(1)[0].samples
    lanes = LANES if samples < LASTING else FEWER
    steered = Steered(content, proof.claim, 1, lanes).search(ROUNDS)
    border = Limited(content, proof.claim, 1, DIRECTIONS).border()
    return {"flown": steered[0].angle, "flights": lanes * ROUNDS, "home": border.home, "within": border.within}


def proved(name: str, law: str) -> dict[str, Any] | None:
    """What each source costs now in a law's bound, and what is measured of it; None where no bound is proved."""
    proof = costs(name, law)
    if proof.angle is None:
        return None
    return {"shares": dict(proof.shares), "measured": measured(name, law, proof.settling or 0.0)}


def costs(name: str, law: str, only: Collection[str] = ()) -> ProvedPointing:
    """What is proved now of a law without faults, and what each source costs in it, or only those that are named."""
    scenario = sh.load(name)
    entry, flown = scenario.pick(law), faultless(scenario)
    every = sources(flown)
    others = {one.name: partial(without, flown, entry, [one]) for one in every}
    others |= {REST: partial(without, flown, entry, every)} if every else {}
    others = {source: made for source, made in others.items() if not only or source in only}
    return prove_pointing(flown, without(flown, entry, []), others)


def measured(name: str, law: str, settling: float) -> dict[str, float]:
    """The levels (rad) of the absolute error from when the bound holds (s), of all sources together and of each."""
    flown, settled = faultless(sh.load(name)), math.ceil(settling)
    later = flown.with_(
        {"budget.start": settled, "simulation.duration": max(LONGER * settled, flown.table.simulation.duration)}
    )
    with warnings.catch_warnings(action="ignore"):
        budget = study(later, later.pick(law))
    return {row.name: row.figures["APE"][ANGLE].level for row in budget.rows if row.name not in (LOOP, COMBINED)}


def stored() -> dict[str, dict[str, Any]]:
    """The entries by scenario and law."""
    return json.loads(STORED.read_text(encoding="utf-8"))


def beside_table() -> str:
    """Every bound beside the level that 99.73 % of the errors keep, and the worst flights."""
    rows: list[list[str]] = []
    for key, entry in stored().items():
        scenario, name = key.split(" ", 1)
        share = "all" if entry["share"] is None else f"{100.0 * entry['share']:.6g} % of orbits"
        left = ", ".join([*entry["left_out"], *["limits of the torque"] * entry["unlimited"]])
        parts = f"{entry['parts'] - len(entry['left_out'])} of {entry['parts']}"
        angle, rate = entry["start"]
        begin = _start(angle, rate)
        bound = [begin, _degrees(entry["angle"], up=True), share, f"{entry['settling']:.4g}", parts, left or "nothing"]
        worst = [_degrees(entry["angle"] * entry["flown"]), f"{1.0 / entry['flown']:.3g}", str(entry["flights"])]
        measured = [MISSING, MISSING]
        if "measured" in entry:
            level = entry["measured"][TOGETHER]
            over = f"{entry['angle'] / level:.3g}" if entry["angle"] < MOST * level else "over 10⁶"
            measured = [_degrees(level), over]
        rows.append([f"`{scenario}`", name, *bound, *worst, *measured])
    heads = ["scenario", "certificate", "from, deg", "proved within, deg", "of flights", "after, s", "parts in", "left out"]
    return table([*heads, "worst flown, deg", "ratio", "flights", "measured 99.73 %, deg", "ratio"], rows)


def starts_table() -> str:
    """Every start beside the farthest from which flights still come home."""
    rows: list[list[str]] = []
    for key, entry in stored().items():
        if entry["unlimited"] or "home" not in entry:
            continue
        scenario, name = key.split(" ", 1)
        angle, rate = entry["start"]
        cells = list[str]()
        for kind in ("within", "home"):
            times = entry[kind]
            far = _start(min(angle * times, math.pi), rate * times) if times else MISSING
            cells += [far, f"{1.0 / times:.2g}" if times else MISSING]
        rows.append([f"`{scenario}`", name, _start(angle, rate), *cells])
    heads = ["scenario", "certificate", "proved from, deg", "home within the limits from, deg", "share"]
    return table([*heads, "home from, deg", "share"], rows)


def costs_table(scenario: str) -> str:
    """By how much the bound of each law of a scenario is lower without each source, and what that source alone causes."""
    laws = {key.split()[1]: e for key, e in stored().items() if key.split()[0] == scenario and "shares" in e}
    names = list(dict.fromkeys(name for entry in laws.values() for name in entry["shares"]))
    rows = [
        [f"without {name}", *(cell for entry in laws.values() for cell in _costs(entry, name))]
        for name in sorted(names, key=lambda name: (name == REST, names.index(name)))
    ]
    rows.append(["as it is", *(_degrees(x) for e in laws.values() for x in (e["angle"], e["measured"][TOGETHER]))])
    heads = ["", *(f"{law}, {what}" for law in laws for what in ("proved", "measured"))]
    return table(heads, rows)


def _start(angle: float, rate: float) -> str:
    return f"{_degrees(angle)} at {_degrees(rate)}/s" if rate > 0.0 else f"{_degrees(angle)} at rest"


def _costs(entry: dict[str, Any], name: str) -> list[str]:
    pairs = (entry["shares"].get(name), "−"), (entry["measured"].get(name), "")
    return ["—" if x is None else f"{sign}{_degrees(x)}" for x, sign in pairs]


def _degrees(x: float, up: bool = False) -> str:
    degrees = math.degrees(x)
    digits = 2 - math.floor(math.log10(degrees)) if degrees else 0
    shown = (math.ceil if up else round)(degrees * 10.0**digits) / 10.0**digits
    return f"{shown:.3g}"


if __name__ == "__main__":
    entries = stored() if STORED.exists() else {}
    again, names = "--flown" not in sys.argv, [one for one in sys.argv[1:] if one != "--flown"]
    for name in names or SCENARIOS:
        for law in (entry.name for entry in sh.load(name).laws):
            kept = {key: entries.pop(key) for key in list(entries) if key.split()[:2] == [name, law.split()[0]]}
            kept |= {key: entries.pop(key) for key in list(entries) if key.startswith(f"{name} {law}:")}
            for key, entry in flown(name, law).items():
                old = {part: x for part, x in kept.get(key, {}).items() if part in ("shares", "measured")}
                entries[key] = entry | ((proved(name, law) or {}) if again and key == f"{name} {law}" else old)
                print(key, entry, flush=True)
            entries = dict(sorted(entries.items(), key=lambda pair: SCENARIOS.index(pair[0].split()[0])))
            STORED.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
