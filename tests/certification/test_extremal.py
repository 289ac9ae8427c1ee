"""The worst flights that are known, flown again: none leaves what is proved, and they come as near to it as they did."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import starhold as sh
from starhold.certification.certify import Wanted, certify
from starhold.certification.evidence.chains import ALIKE
from starhold.scenario.building import build
from starhold.studies.bodies.rigid_body import STUDY
from tests.certification.borders import Limited
from tests.certification.extremal import Steered
from tests.certification.pointing_hunt import proved_loop
from tests.tiers import leading


def given(claim):
    """A claim as attacks read it."""
    return {"programs": dict(claim.proof.programs)}, claim.proof.claim


QUICK = [(9025, "", None, (-0.264, -0.963, 0.051), 0.948), (9042, "", None, (-0.473, 0.449, -0.758), 0.993)]
"""Seed and kind of a random loop, the tolerance of its inertia, the direction in which its worst flight ends, and how far it
comes as a share of what is proved: noise and wheels, and one that only torques push."""
LONG = [
    (9005, "", None, (-0.907, -0.358, -0.223), 0.955),
    (20020, "every", 0.003365, (-0.266, 0.599, -0.756), 0.887),
    (20010, "every", None, (-0.266, 0.599, -0.756), 0.956),
    (15038, "every", None, (-0.515, 0.553, -0.655), 0.479),
    (15008, "every", 0.00131, (0.112, 0.026, 0.993), 0.75),
    (20004, "every", 0.002648, (-0.988, -0.02, -0.155), 0.649),
    (20021, "every", None, (-0.91, 0.413, 0.024), 0.772),
]
"""The same with a large start, an inertia known to a share, the Sun, an integral, a lost wheel, and random torques."""


@cache
def claimed(seed, tolerance, kind):
    """The claim of a random loop, which reads no files."""
    return proved_loop(seed, Path(), tolerance, kind)[2]


@pytest.mark.parametrize(("seed", "kind", "tolerance", "way", "share"), leading([*QUICK, *LONG], len(QUICK)))
def test_the_worst_flight_of_a_random_loop_ends_within_its_bound(seed, kind, tolerance, way, share):
    claim = claimed(seed, tolerance, kind)
    end = np.array(way)[:, None] / np.linalg.norm(way)
    worst = Steered(*given(claim), 1, 1, 4000).fly(end)
    # A bound that holds sooner may be wider.
    assert share / ALIKE - 0.002 < worst.angle <= 1.0
    assert worst.rate <= 1.0


def test_noise_is_chosen_against_a_claim():
    claim, end = given(claimed(9025, None, "")), np.array(QUICK[0][3])[:, None]
    calm = Steered(*claim, 1, 1)
    calm.noisy = lambda motion, ends, count: [np.zeros((6, 1))] * count
    assert calm.fly(end).angle < 0.995 * QUICK[0][4]


def test_pushes_are_chosen_against_a_claim():
    claim, end = given(claimed(9042, None, "")), np.array(QUICK[1][3])[:, None]
    steered = Steered(*claim, 1, 1)
    fleet, fly = steered.fleet_of, steered.fleet_of.fly

    def unsteered(*begin):
        # As large, another way.
        fleet.push = lambda k, q, w: -np.roll(end, 1, axis=0) / np.linalg.norm(end)
        return fly(*begin)

    fleet.fly = unsteered
    assert 0.5 < steered.fly(end).angle < 0.93 * QUICK[1][4]


@pytest.mark.slow
@pytest.mark.parametrize(("law", "least"), [("lyapunov", 0.85), ("wheel", 0.86)])
def test_extremal_flights_of_the_cubesat_end_near_its_bound(law, least):
    """What is proved is less than 1.2 times what is flown."""
    scenario = sh.load("cubesat-nadir").with_({"fault": None})
    certificate = certify(build(scenario, scenario.pick(law)), law, Wanted(pointing=True, alone=True))
    worst, rounds = Steered(*given(certificate.claim("pointing")), 1, 64).search(2)
    assert least < worst.angle <= 1.0
    assert worst.rate <= 1.0
    # The directions of the second round are about the worst of the first.
    assert rounds[1] > 0.99 * rounds[0]


# Farther off the motors turn as fast as they can: the cubesat's on the way, at a quarter turn the others at once, with the
# worst momentum.
@pytest.mark.slow
@pytest.mark.parametrize(("name", "most"), [("cubesat-nadir", 10.0), ("wheels-orbital", 1.3)])
def test_flights_come_home_within_the_limits_from_where_that_is_proved(name, most):
    scenario = sh.load(name)
    entry = scenario.pick("wheel")
    for one in STUDY.certify(scenario, entry, build(scenario, entry), pointing=True):
        border = Limited(*given(one.certificate.claim("pointing")), 1, 32).border()
        assert border.home >= border.within >= 1.0
        assert border.within < most
