"""Random loops of which a pointing bound is proved, and flights that are steered against it: `python -m
tests.certification.pointing_hunt SEED COUNT [TOLERANCE | KIND]` prints what came of each; KIND: "plans" for loops with
the predictive law, "targets" for ones that move, "shaken" for random torques, "integral" for a law with an integral,
"lost" for a wheel that is lost, "late" for an actuator that lags, "every" for all of these, each now and then; and
"delayed" for sensors that are late and the complementary filter."""

import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from starhold.certification.certify import certify
from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.studies.bodies.rigid_body import certified_loops, wanted_of
from tests.certification.attack import LANES, Attack, Planned
from tests.certification.drawn_loops import random_loop
from tests.certification.extremal import Steered

LASTING = 3000
"""The most samples of extremal flights."""


def proved_loop(seed, folder, tolerance=None, kind=""):
    """A random loop, after its last fault if it has one, with its text and its claim; or why there is none, in place of the
    claim."""
    text = random_loop(np.random.default_rng(seed), kind)
    try:
        scenario = parse(text, "hunted.toml", folder)
        entry = scenario.laws[0]
        loop = [*certified_loops(scenario, entry, build(scenario, entry)).values()][-1]
    except InputError as reason:
        return None, text, f"refused: {reason}"
    certificate = certify(loop, "hunted", replace(wanted_of(scenario, True), alone=True, inertia_tolerance=tolerance))
    claim = certificate.claim("pointing")
    if claim is None or claim.outcome != "proved":
        why = [o.evidence.get("reason", "") for one in certificate.claims for o in one.obligations]
        return loop, text, "undecided: " + "; ".join(why or [certificate.unflown])
    return loop, text, claim


def hunted(seed, folder, tolerance=None, kind=""):
    """What became of a random loop: the text, why there is no claim or "", what contradicts it or "", and shares."""
    _, text, claim = proved_loop(seed, folder, tolerance, kind)
    if isinstance(claim, str):
        return text, claim, "", None
    attack, lanes = (Planned, LANES // 3) if "plan_error" in claim.numbers else (Attack, LANES)
    given = {"programs": dict(claim.proof.programs)}, claim.proof.claim, seed
    found, (highest, *ends) = attack(*given, lanes).worst()
    worst = Steered(*given, LANES, LASTING).search(2)[0]
    found = found or ("" if max(worst.angle, worst.rate) <= 1.0 else f"an extremal flight comes to {worst[:2]} of the ends")
    return text, "", found, (claim, [highest, max(ends[0], worst.angle), max(ends[1], worst.rate)])


def main(first, count, tolerance=None, of=""):
    """Print a line for each loop, and how many of each kind there were. Of the kind "every" a quarter has a tolerance."""
    begun, tally = time.time(), dict.fromkeys(("refused", "undecided", "proved", "broken"), 0)
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            off = tolerance
            if of == "every" and seed % 4 == 0:
                off = 10.0 ** np.random.default_rng([seed, 1]).uniform(-3.0, -1.5)
            text, why, found, more = hunted(seed, Path(folder), off, of)
            kind, shown = why.split(":")[0] or "proved", why
            if more:
                claim, (V, angle, rate) = more
                kept = f"share {claim.numbers['share']} off {claim.numbers.get('tolerance', 0.0):.4g}"
                kept += f" without {claim.left_out}" if claim.left_out else ""
                n = claim.numbers
                ends = f"{math.degrees(n['angle']):.3g} of {math.degrees(n['slew_angle']):.3g} deg"
                shown = f"V {V:.3f} angle {angle:.3f} rate {rate:.3f}, {ends}, {kept} {found and 'BROKEN ' + found}"
            tally[kind] += 1
            tally["broken"] += bool(found)
            types = [line.split('"')[1] for line in text.splitlines() if line.startswith("type")]
            print(seed, *types[-1:], *types[:-1], *["lost"] * ("[[fault]]" in text), kind, shown, flush=True)
    print(tally, f"{time.time() - begun:.0f} s")


if __name__ == "__main__":
    asked = sys.argv[3:4]
    main(*map(int, sys.argv[1:3]), *([None, *asked] if asked[:1] and asked[0].isalpha() else map(float, asked)))
