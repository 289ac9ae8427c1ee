"""Certificates for the kernel, of loops of built-in scenarios and of some by hand."""

import copy
import json
import math
from functools import cache

import starhold as sh
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.claims import find_claims, find_taken_over
from starhold.certification.evidence.finding import NotFoundError, certificate, evidence, obligations, read
from starhold.certification.evidence.noise import find_radii
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.evidence.recorded import sign_words
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.kernel.loops import OUTSIDE, AttitudeLoop
from starhold.kernel.numbers import RefusedError
from starhold.kernel.programs import digest
from starhold.scenario.building import build
from tests.making import built
from tests.proofs import shared

CRAFT = {"inertia": [2.0, 3.0, 4.0], "torque_limit": "0.01 N m", "limit": "norm"}
QUIET = {"spacecraft": CRAFT, "simulation": {"duration": "1 min", "control_period": 0.1}}
LQR = {"type": "lqr", "form": "II", "q": [0.01] * 3 + [0.004] * 3, "r": [50.0, 60.0, 70.0]}
PD = {"type": "pd", "k_rate": 0.09, "k_attitude": 0.009}
BY_HAND = {
    "strict": LQR,
    "norm": PD,
    "near": LQR | {"quaternion_sign": "shortest"},
    "jumping": LQR | {"quaternion_sign": "hysteresis", "hysteresis_width": 0.1},
    "clipped": PD | {"limit": "axis"},
}

LAWS = [
    ("three-laws", "lyapunov"), ("cubesat-slew", "lyapunov"), ("three-laws", "sliding"), ("cubesat-slew", "pd"),
    ("cubesat-slew", "sliding"), ("flexible-slew", "pd"), ("flexible-slew", "stiff"), ("geostationary", "pd"),
    ("geostationary", "matrix-pd"), ("geostationary", "lyapunov"), ("geostationary", "sliding"), ("wheels-orbital", "wheel"),
    ("wheels-orbital", "uncompensated"), ("cubesat-nadir", "wheel"), ("cubesat-nadir", "lyapunov"),
    ("landing", "fit"), ("landing", "rounded"), ("landing", "searched"), ("landing-limits", "published"),
    ("landing-limits", "own-fit"),
]  # fmt: skip
"""Laws of built-in scenarios of which something is proved."""


K_RATE, K_ATTITUDE = 0.0292368, 0.0081213333
WHEEL_ERROR = K_RATE * 1.2e-4 + K_ATTITUDE * math.radians(24 / 3600) / 2 + 0.04 * 0.2 * 1.2e-4
"""What a gyro that errs by 1.2e-4 rad/s and an attitude that errs by 24 arc seconds make of the command (N m)."""
SKEW = [[0.05, 0.001, 0.002], [0.001, 0.065, 0.003], [0.002, 0.003, 0.025]]
POINTING = {
    "body": (([2.0, 3.0, 4.0], 0.09, 0.009, 0.1), (3.5e-6, 1e-6, math.radians(90))),
    "moving": (([2.0, 3.0, 4.0], 0.09, 0.009, 0.1), (3.5e-6, 1e-6, math.radians(60), 0.02, {"limit": 0.03})),
    "cubesat": (([0.05, 0.065, 0.025], K_RATE, K_ATTITUDE, 0.25), (7.9e-7, WHEEL_ERROR, math.radians(29))),
    "calm": (([0.05, 0.065, 0.025], K_RATE, K_ATTITUDE, 0.25), (7.9e-7, WHEEL_ERROR, math.radians(3))),
    "skew": ((SKEW, K_RATE, K_ATTITUDE, 0.25), (7.9e-7, WHEEL_ERROR, math.radians(10))),
    "noisy": (([0.05, 0.065, 0.025], K_RATE, K_ATTITUDE, 0.25), (7.9e-7, 0.0, math.radians(10))),
    "shaken": (([0.05, 0.065, 0.025], K_RATE, K_ATTITUDE, 0.25), (7.9e-7, 0.0, math.radians(10))),
    "half turn": (([2.0, 3.0, 4.0], 0.09, 0.009, 0.5), (1e-8, 0.0, math.radians(178))),
    "overdamped": (([1.0, 1.0, 1.0], 1.95, 0.75, 1.0), (1e-6, 0.0, math.radians(0.5))),
}
"""Inertia, gains and period; outside torque, error of the command, and the start."""
ERRORS = {"half turn": 0.05}
"""By how much the attitude is off that laws are told (rad)."""
KALMAN = {"noise": 2e-5, "bias_walk": 1e-5, "cross": "10 arcsec", "roll": "60 arcsec", "boresight": [0, -1, 0]}
NOISY = {
    "noisy": [
        {"type": "gyro", "noise": 2e-5, "bias_walk": 1e-5},
        {"type": "star-tracker", "cross": "10 arcsec", "roll": "60 arcsec", "boresight": [0, -1, 0], "interval": 1.0},
        {"type": "mekf", "bias": 1e-3, **KALMAN},
    ],
    "shaken": [{"type": "random-torque", "deviation": "2 uN m"}],
}
"""The parts that noise comes with."""


def radii_of(loop):
    """The numbers that a claim tells of noise, and the evidence for them."""
    words = [word for word in loop.words if word != OUTSIDE] + sign_words(loop.loop)
    wired = read(loop.claim("points", words, None, **loop.bounds(words)), loop.by_digest)
    return find_radii(loop, AttitudeLoop(wired))


@cache
@shared
def flying(name):
    """What was found about a loop with a held torque, errors and torques from outside."""
    (inertia, k_rate, k_attitude, period), told = POINTING[name]
    law = {"type": "lyapunov", "k_rate": k_rate, "k_attitude": k_attitude}
    kept = {"simulation": {"duration": "1 min", "control_period": period}, "name": name, "law": [law]}
    loop = Loop(make_subject(built(sh.scenario({"spacecraft": {"inertia": inertia}, "part": NOISY.get(name, [])} | kept))))
    outside, error, *start = told
    assert Pushed(loop, Pushes(outside, attitude=ERRORS.get(name, 0.0), command=error), noisy=True).find(*start), loop.failed
    return loop


@cache
@shared
def found(scenario, law):
    """What was found about a law of a built-in scenario, of one by hand, of one with its torque held, or of one that takes
    over."""
    if scenario == "flying":
        return flying(law)
    if scenario == "by hand":
        limited = {"spacecraft": CRAFT | {"limit": "axis" if law == "clipped" else "norm"}}
        given = sh.scenario(QUIET | limited | {"name": law, "law": [BY_HAND[law]]})
        loop = build(given, given.laws[0])
    else:
        given = sh.load("cubesat-slew" if scenario == "taken over" else scenario)
        loop = build(given, given.pick(law))
    if scenario == "taken over":
        handed = find_taken_over(make_subject(loop), 0.01, 1.0)
        assert handed is not None
        return handed
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


def with_program(content, role, program):
    """A certificate of one claim with another program in this role."""
    (claim,) = content["claims"]
    content["programs"][claim["programs"][role]] = program
    return rekeyed(content)


def text(content):
    """A certificate as a file holds it."""
    return json.dumps(content)


def failing(claim, programs):
    """The names, without places, of what cannot be shown of a claim, of which everything told is read."""
    wanted, known = obligations(claim, programs)
    assert not any(told.unread for told in (known.taken, known.programs, known.subject, known.numbers))
    failed = set()
    for name, obligation in wanted.items():
        try:
            obligation.check(claim["evidence"].get(name))
        except RefusedError:
            try:
                evidence(name, wanted, {})
            except NotFoundError:
                failed.add(name.rstrip("-+0123456789 "))
    return failed
