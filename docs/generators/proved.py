"""The tables of how near to their targets the built-in scenarios are proved to stay, beside what is measured, and of what
each source costs. Run it to prove and measure them anew, all or those of the scenarios that are named."""

from __future__ import annotations

import json
import math
import sys
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import starhold as sh
from generators.tables import table
from starhold.analysis.pointing import ANGLE
from starhold.studies.budget import COMBINED, LOOP, TOGETHER, faultless, sources, study, without
from starhold.studies.pointing import prove_pointing

STORED = Path(__file__).with_name("proved.json")
"""By scenario and law: the proved bound (rad), what it leaves out, by how much it is lower without each source and without
any, None where that is not told, and the levels of the absolute error that are measured, together and of each source."""
SCENARIOS = ("three-laws", "geostationary", "wheels-orbital", "flexible-slew", "cubesat-nadir")
REST = "all of these"
LONGER, MOST = 2, 1e6
"""A flight lasts at least so many times the time after which the bound holds."""


def proved(name: str, law: str) -> dict[str, Any] | None:
    """What is proved and measured now of a law of a built-in scenario; None where no bound is proved."""
    scenario = sh.load(name)
    entry, flown = scenario.pick(law), faultless(scenario)
    every = sources(flown)
    others = {one.name: partial(without, flown, entry, [one]) for one in every}
    others |= {REST: partial(without, flown, entry, every)} if every else {}
    proof = prove_pointing(flown, without(flown, entry, []), others)
    if proof.angle is None:
        return None
    return {
        "angle": proof.angle,
        "settling": proof.settling,
        "share": proof.share,
        "left_out": list(proof.left_out),
        "shares": dict(proof.shares),
        "measured": measured(name, law, proof.settling or 0.0),
    }


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
    """Every bound beside the level that 99.73 % of the errors keep."""
    rows: list[list[str]] = []
    for key, entry in stored().items():
        level, name = entry["measured"][TOGETHER], key.split()
        share = "all" if entry["share"] is None else f"{100.0 * entry['share']:.6g} % of orbits"
        left = ", ".join(entry["left_out"]) or "no part"
        ratio = f"{entry['angle'] / level:.3g}" if entry["angle"] < MOST * level else "over 10⁶"
        bound = [_degrees(entry["angle"], up=True), share, f"{entry['settling']:.4g}", left]
        rows.append([*(f"`{word}`" for word in name), *bound, _degrees(level), ratio])
    heads = ["scenario", "law", "proved, deg", "of flights", "after, s", "left out", "measured 99.73 %, deg", "ratio"]
    return table(heads, rows)


def costs_table(scenario: str) -> str:
    """By how much the bound of each law of a scenario is lower without each source, and what that source alone causes."""
    laws = {key.split()[1]: entry for key, entry in stored().items() if key.split()[0] == scenario}
    names = list(dict.fromkeys(name for entry in laws.values() for name in entry["shares"]))
    rows = [
        [f"without {name}", *(cell for entry in laws.values() for cell in _costs(entry, name))]
        for name in sorted(names, key=lambda name: (name == REST, names.index(name)))
    ]
    rows.append(["as it is", *(_degrees(x) for e in laws.values() for x in (e["angle"], e["measured"][TOGETHER]))])
    heads = ["", *(f"{law}, {what}" for law in laws for what in ("proved", "measured"))]
    return table(heads, rows)


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
    for name in sys.argv[1:] or SCENARIOS:
        for law in (entry.name for entry in sh.load(name).laws):
            if (now := proved(name, law)) is not None:
                entries[f"{name} {law}"] = now
                print(name, law, now["angle"], flush=True)
            else:
                entries.pop(f"{name} {law}", None)
            STORED.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
