"""Claims about the loop that flies of laws that keep a memory: whatever is in it, it adds a bounded torque."""

import copy
import random
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import add, clip_axes, scale
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import certificate
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.evidence.recorded import ASKED
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.kernel.check import check
from starhold.kernel.numbers import RefusedError, rational
from starhold.laws import pid
from starhold.parts.craft import make_craft
from starhold.trace.straight_line import straight_line
from tests.kernel.certificates import failing, text, with_program
from tests.kernel.mutations import refusals
from tests.kernel.oracle import is_kept
from tests.laws.motion import fly
from tests.making import built
from tests.tiers import fewer

GAINS = pid.Gains(0.36, 0.036, 8e-4, 2e-4)
MOMENTS, OUTSIDE, PERIOD = [2.0, 3.0, 4.0], 1e-4, 0.5


@cache
def pointing():
    law = {"type": "pid", **GAINS._asdict()}
    kept = {"simulation": {"duration": "1 min", "control_period": PERIOD}, "name": "pid", "law": [law]}
    loop = Loop(make_subject(built(sh.scenario({"spacecraft": {"inertia": MOMENTS}} | kept))))
    assert Pushed(loop, Pushes(OUTSIDE)).find(np.radians(90.0)), loop.failed
    return certificate(loop.programs, loop.claims)


def claimed(name):
    return float(rational(pointing()["claims"][0]["numbers"][name]))


def test_the_claim_says_what_the_memory_adds():
    (proved,) = check(text(pointing()))
    assert claimed("memory") == GAINS.integral_limit
    assert "a memory that adds up to 0.0002 N m about each axis" in proved.statement.text


def pumped(sign):
    """The law with a memory at its worst: its torque is with the rate, or the other way."""

    def torque(measurement, gains, craft, memory):
        base = add(scale(-gains.k_rate, measurement.rate), scale(-gains.k_attitude, vector_part(measurement.attitude)))
        worst = tuple(sign * gains.integral_limit * float(np.sign(x)) for x in measurement.rate)
        return add(base, worst), memory

    return SimpleNamespace(torque=torque, remember=pid.remember)


@pytest.mark.parametrize(("law", "least"), [(pid, 0.0), (pumped(1.0), 0.25), (pumped(-1.0), 0.0)])
def test_flights_end_as_near_as_is_claimed(law, least):
    start = np.array([np.cos(np.radians(45.0)), 0.0, np.sin(np.radians(45.0)), 0.0])
    steps = int(claimed("settling") / PERIOD) + 300
    push = OUTSIDE * np.array([0.6, -0.64, 0.48])
    outside = lambda t: push * np.sign(np.sin(0.11 * t))  # noqa: E731
    inertia = np.diag(MOMENTS)
    attitudes, rates, _ = fly(law, GAINS, make_craft(MOMENTS), inertia, start, np.zeros(3), PERIOD, steps, outside)
    angles = 2.0 * np.arcsin(np.linalg.norm(attitudes[-300:, 1:], axis=1))
    assert least * claimed("end.angle") < angles.max() < claimed("end.angle")
    assert np.linalg.norm(rates[-300:], axis=1).max() < claimed("end.rate")


def other(law):
    """The certificate with another law."""
    memory = pid.remember(GAINS, None, PERIOD)
    program = straight_line(law, measurement=ASKED, gains=GAINS, craft=make_craft(MOMENTS), memory=memory)
    return with_program(copy.deepcopy(pointing()), "law", program)


def plain(measurement, gains, added):
    base = add(scale(-gains.k_rate, measurement.rate), scale(-gains.k_attitude, vector_part(measurement.attitude)))
    return add(base, scale(-gains.k_integral, added))


def unclipped(measurement, gains, craft, memory):
    return plain(measurement, gains, memory.integral), memory


def stronger(measurement, gains, craft, memory):
    """Adds 1 % more than is claimed."""
    return plain(measurement, gains, clip_axes(memory.integral, 1.01 * gains.integral_limit / gains.k_integral)), memory


def steeper(measurement, gains, craft, memory):
    """Adds a stiffness that the memory chooses."""
    torque = plain(measurement, gains, clip_axes(memory.integral, gains.integral_limit / gains.k_integral))
    return add(torque, scale(memory.integral[0], vector_part(measurement.attitude))), memory


@pytest.mark.parametrize("law", [unclipped, stronger, steeper])
def test_a_memory_that_adds_more_is_refused(law):
    with pytest.raises(RefusedError, match="memory adds"):
        check(text(other(law)))


OTHERS = ["converges", "stays stable between samples", "converges strictly", "reaches its surface"]


@pytest.mark.parametrize("theorem", OTHERS)
def test_no_other_theorem_takes_a_law_with_a_memory(theorem):
    content = copy.deepcopy(pointing())
    (claim,) = content["claims"]
    with pytest.raises(RefusedError, match=r"asks for memory|lack surface|taken with nothing"):
        failing(claim | {"theorem": theorem, "evidence": {}}, content["programs"])


def test_a_law_with_a_memory_is_told_to_have_one():
    content = copy.deepcopy(pointing())
    content["claims"][0]["taken"].remove("memory")
    with pytest.raises(RefusedError, match="asks for memory"):
        check(text(content))


@pytest.mark.slow
def test_nothing_false_is_accepted():
    count = fewer(100)
    assert refusals(pointing(), random.Random(7), count, is_kept) > count / 2
