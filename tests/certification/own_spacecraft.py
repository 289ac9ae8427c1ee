"""Own spacecraft, claims about them and attacks on these; one has late sensors, used directly and through a filter."""

from dataclasses import replace
from functools import cache

import numpy as np

from starhold.certification.certify import certify
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.studies.bodies.rigid_body import certified_loops, wanted_of
from tests.certification.attack import Attack, flown
from tests.certification.extremal import Steered

OWN = """
name = "own"
[spacecraft]
inertia = [1.0, 1.2, 0.8]
[initial]
angles = ["20 deg", "-10 deg", "5 deg"]
[target]
mode = "inertial"
[simulation]
duration = 200.0
control_period = 0.25
[certify]
disturbance = "1e-5 N m"
[[law]]
type = "lyapunov"
form = "bandwidth"
bandwidth = 0.1
damping = 0.9
"""
LATE = """
[[part]]
type = "star-tracker"
cross = 0.0
roll = 0.0
delay = 0.6
interval = 0.5
[[part]]
type = "gyro"
delay = "0.1 s"
scale_error = 0.001
"""
FILTERED = """
[[part]]
type = "star-tracker"
cross = "10 arcsec"
roll = "60 arcsec"
interval = 0.5
delay = 0.2
[[part]]
type = "gyro"
noise = 2e-5
bias = ["0.02 deg/s", "-0.01 deg/s", "0.015 deg/s"]
bias_walk = 1e-5
[[part]]
type = "complementary-filter"
attitude_gain = 0.2
bias_gain = 0.01
"""
TEXTS = {"late": OWN + LATE, "filtered": OWN + FILTERED}


@cache
def loop_with(text):
    """The scenario of a text, and the loop of its first law."""
    scenario = parse(text, "own.toml", None)
    entry = scenario.laws[0]
    (loop,) = certified_loops(scenario, entry, build(scenario, entry)).values()
    return scenario, loop


@cache
def claim_of(text):
    """The claim about that loop as it flies."""
    scenario, loop = loop_with(text)
    return certify(loop, "own", replace(wanted_of(scenario, True), alone=True)).claim("pointing")


def worst_of(text, flights, lanes, steered, rounds=1):
    """The worst steered flight under the claim, which neither this nor flights of the loop itself nor pushes break. steered:
    the lanes and the most samples of those flights."""
    claim = claim_of(text)
    assert flown(loop_with(text)[1], claim, np.random.default_rng(1), flights) < 1.0
    given = {"programs": dict(claim.proof.programs)}, claim.proof.claim, 1
    attack = Attack(*given, lanes)
    attack.longest = 800
    assert not attack.worst()[0]
    worst = Steered(*given, *steered).search(rounds)[0]
    assert worst.angle < 1.0
    assert worst.rate < 1.0
    return worst
