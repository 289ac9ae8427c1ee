"""Certificates for the kernel, of loops of built-in scenarios and of some by hand."""

import copy
import json
from functools import cache

import starhold as sh
from starhold.certification.evidence.claims import find_claims
from starhold.certification.evidence.finding import certificate
from starhold.certification.subject import make_subject
from starhold.kernel.programs import digest
from starhold.scenario.building import build

CRAFT = {"inertia": [2.0, 3.0, 4.0], "torque_limit": "0.01 N m", "limit": "norm"}
QUIET = {"spacecraft": CRAFT, "simulation": {"duration": "1 min", "control_period": 0.1}}
LQR = {"type": "lqr", "form": "II", "q": [0.01] * 3 + [0.004] * 3, "r": [50.0, 60.0, 70.0]}
PD = {"type": "pd", "k_rate": 0.09, "k_attitude": 0.009}
BY_HAND = {"strict": LQR, "norm": PD}

LAWS = [
    ("three-laws", "lyapunov"), ("cubesat-slew", "lyapunov"), ("three-laws", "sliding"), ("cubesat-slew", "pd"),
    ("cubesat-slew", "sliding"), ("flexible-slew", "pd"), ("flexible-slew", "stiff"), ("geostationary", "pd"),
    ("geostationary", "matrix-pd"), ("geostationary", "lyapunov"), ("geostationary", "sliding"), ("wheels-orbital", "wheel"),
    ("wheels-orbital", "uncompensated"), ("cubesat-nadir", "wheel"), ("cubesat-nadir", "lyapunov"),
    ("landing", "fit"), ("landing", "rounded"), ("landing", "searched"), ("landing-limits", "published"),
    ("landing-limits", "own-fit"),
]  # fmt: skip
"""Laws of built-in scenarios of which something is proved."""


@cache
def found(scenario, law):
    """What was found about a law of a built-in scenario, or of one by hand."""
    if scenario == "by hand":
        given = sh.scenario(QUIET | {"name": law, "law": [BY_HAND[law]]})
        loop = build(given, given.laws[0])
    else:
        given = sh.load(scenario)
        loop = build(given, given.pick(law))
    return find_claims(make_subject(loop))


def contents(scenario, law, *claims):
    """A certificate with the claims at these places, or all."""
    known = found(scenario, law)
    picked = [known.claims[k] for k in claims] if claims else known.claims
    return copy.deepcopy(certificate(known.programs, picked))


def rekeyed(content):
    """A certificate whose programs were changed, under their own digests."""
    names = {old: digest(program) for old, program in content["programs"].items()}
    content["programs"] = {names[old]: program for old, program in content["programs"].items()}
    for claim in content["claims"]:
        claim["programs"] = {role: names.get(name, name) for role, name in claim["programs"].items()}
    return content


def text(content):
    """A certificate as a file holds it."""
    return json.dumps(content)
