"""V of which the level set that holds a start asks for little torque: from farther off claims keep the limits."""

import math
from fractions import Fraction

import numpy as np
import pytest

import starhold as sh
from starhold.certification.certify import Wanted, certify
from starhold.certification.evidence import shapes
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.evidence.shapes import Shape, soft
from starhold.certification.evidence.starts import begins
from starhold.certification.matrices import floats
from starhold.certification.subject import make_subject
from starhold.scenario.building import build
from tests.certification.borders import Limited

SCENARIO = sh.load("geostationary")
ANGLE, RATE = math.radians(5.0), 0.0


@pytest.fixture(scope="module")
def pushed():
    loop = Loop(make_subject(build(SCENARIO, SCENARIO.pick("pd"))))
    return Pushed(loop, loop.known.against(loop.known.envelope(False)))


def test_the_set_that_holds_a_start_keeps_the_limits_with_a_softer_potential_or_where_motions_stay(pushed):
    limits = pushed.loop.limits
    kept = []
    for shape in (*pushed.usual, *soft(pushed.sampled(pushed.usual[0]).motion, limits, ANGLE, RATE, ())):
        chain = pushed.chain(shape, ANGLE, RATE)
        numbers = pushed.beginning(ANGLE, RATE, limits) | chain.of_level()
        kept.append(begins(pushed.loop, chain.motion, numbers, chain.scales))
    assert kept[: len(pushed.usual)] == [False] * len(pushed.usual)
    assert any(kept)
    [chosen] = pushed.begun(ANGLE, RATE, limits)
    assert chosen.shape in pushed.usual
    assert chosen.slow
    assert chosen.decreases()


def test_levels_follow_each_other_as_closely_as_v_decreases(pushed):
    """What follows them begins where it leads home soonest: this start took 7132 s with wide steps to the last level."""
    [chain] = pushed.begun(math.radians(2.0), math.radians(0.0245), pushed.loop.limits)
    chain.descend()
    ends = np.array([chain.level, *(float(Fraction(one["end"])) for one in chain.levels)])
    assert 1.1 < (ratios := ends[:-1] / ends[1:]).min() < 0.9 * ratios[0] < ratios.max() < 8.001
    soonest, (angle, _) = chain.nearest()
    assert len(soonest.levels) < len(chain.levels) == len(chain.reached)
    assert soonest.samples * float(chain.motion.h) < 4300.0
    assert math.degrees(angle) < 0.0046


def test_a_start_farther_off_than_the_law_keeps_its_limits_is_not_begun_from(pushed):
    # At rest the law asks for k sin(half the angle) about an axis.
    most = pushed.loop.limits["limit"] / pushed.stiffness
    assert not pushed.begun(2.0 * math.asin(1.001 * most), 0.0, pushed.loop.limits)
    assert pushed.loop.failed["points"]


def test_what_is_recorded_is_the_shape(pushed):
    shape = Shape(0.004, 0.6, 7100.0)
    motion, J = pushed.sampled(shape).motion, floats(pushed.sampled(pushed.usual[0]).motion.loop.given)
    G = floats(motion.G)
    assert float(motion.s) == pytest.approx(2.0 * 0.6 * pushed.stiffness)
    np.testing.assert_allclose(G[:3, :3], 3550.0 * np.eye(3))
    np.testing.assert_allclose(G[:3, 3:], 0.004 * 3550.0 * np.eye(3))
    leant = floats(pushed.sampled(Shape(0.004, 0.6)).motion.G)
    np.testing.assert_allclose(leant[:3, :3], J / 2.0)
    np.testing.assert_allclose(leant[:3, 3:], 0.004 * J / 2.0)


def test_no_state_of_a_start_has_more_than_the_largest_v(pushed):
    r = np.random.default_rng(3)
    for shape in (Shape(0.004, 0.6, 7100.0), Shape(0.004, 0.5)):
        motion = pushed.sampled(shape).motion
        G, s = floats(motion.G), float(motion.s)
        axis, along = (v / np.linalg.norm(v, axis=0) for v in r.normal(size=(2, 3, 4000)))
        half = r.uniform(0.0, 0.5, 4000)
        x = np.concatenate([0.01 * along, np.sin(half) * axis])
        V = s * (1.0 - np.cos(half)) + (x * (G @ x)).sum(0)
        top = shapes.largest_in(motion, 1.0, 0.01)
        assert 0.7 * top < V.max() <= top


@pytest.mark.slow
def test_flights_from_a_proved_start_never_ask_for_more_than_there_is():
    claim = certify(build(SCENARIO, SCENARIO.pick("pd")), "pd", Wanted(pointing=True, alone=True)).claim("pointing")
    assert claim.outcome == "proved"
    assert not any(name.startswith("unlimited") for name in claim.assumptions)
    border = Limited({"programs": dict(claim.proof.programs)}, claim.proof.claim, 1, 8).border()
    assert 1.0 <= border.within < 2.0 < border.home
