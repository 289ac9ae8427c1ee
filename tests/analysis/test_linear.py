"""The linear loop: against the flying step, certified roots, python-control, and loops that fly at their margins."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.linalg import expm

from starhold.algebra.quaternion import to_body
from starhold.algebra.structure import flatten
from starhold.analysis.linear import COMMAND, LinearityError, linearise, sampled
from starhold.analysis.margins import margins, response
from starhold.certification.certify import certify
from starhold.laws.catalogue import catalogue, from_file
from starhold.loop.kernels import make_step
from starhold.parts.catalogue import fit
from tests.making import built


def loop_of(scenario, law):
    return built(scenario, law)


def with_integral():
    loop = loop_of("cubesat-slew", "pd")
    law = catalogue()["pid"]
    return replace(loop, law=law, gains=law.gains(0.02, 0.004, 1e-4, 1e-3))


LOOPS = {
    "pd behind a lag": lambda: loop_of("cubesat-slew", "pd"),
    "sliding with a layer": lambda: loop_of("cubesat-slew", "sliding"),
    "full inertia": lambda: loop_of("geostationary", "pd"),
    "gravity gradient": lambda: loop_of("three-laws", "lyapunov"),
    "wheels": lambda: loop_of("wheels-orbital", "wheel"),
    "integral": with_integral,
}


def at_rest(loop):
    """The loop alone at rest on a target that is still, without what the matrices leave out."""
    still = loop.without("sensor", "target").with_parts(fit("target", "inertial", (1.0, 0.0, 0.0, 0.0)))
    start = loop.start
    goal = loop.first_attitude()
    start = start._replace(
        attitude=(1.0, 0.0, 0.0, 0.0), rate=(0.0,) * 3, position=to_body(goal, start.position),
        velocity=to_body(goal, start.velocity),
    )  # fmt: skip
    return replace(still, start=start, events=())


@pytest.mark.parametrize("name", LOOPS)
def test_the_closed_step_is_the_derivative_of_the_step_that_flies(name):
    loop = at_rest(LOOPS[name]())
    # Many substeps, so that the integration's own error is out of sight; no orbital motion in a step.
    loop = replace(loop, substeps=40, start=loop.start._replace(velocity=(0.0,) * 3)).without("two-body")
    linear, step, setup, first = linearise(loop), make_step(loop.composition()), loop.setup(), loop.carry()
    lags = len(linear.stepped.states) > 6

    def flown(x):
        """theta, rate, lagged torque and memory after a control step."""
        half = 0.5 * np.array(x[:3])
        state = first.state._replace(attitude=(float(np.sqrt(1 - half @ half)), *half.tolist()), rate=tuple(x[3:6].tolist()))
        if lags:
            state = state._replace(torque=tuple(x[6:9].tolist()))
        memory = x[9 if lags else 6 :].tolist()
        carry = first._replace(state=state)
        if memory:
            carry = carry._replace(memory=type(first.memory)(tuple(memory)))
        carry = step.update(carry, 0, loop.seed, loop.gains, loop.craft, setup)
        for _ in range(loop.substeps):
            carry = step.propagate(carry, loop.craft, setup)
        state = carry.state
        after = [*(2.0 * q for q in state.attitude[1:]), *state.rate, *(state.torque if lags else ())]
        return np.array([*after, *flatten((carry.memory,))])

    A = linear.stepped_closed.A
    assert A.shape == (len(flown(np.zeros(len(A)))),) * 2
    scale = 1e-6 * loop.period
    for k in range(len(A)):
        move = np.eye(len(A))[k] * scale
        slope = (flown(move) - flown(-move)) / (2 * scale)
        np.testing.assert_allclose(A[:, k], slope, atol=2e-6 * np.abs(A).max(), rtol=1e-5)


def test_poles_are_the_certified_roots():
    loop = loop_of("cubesat-slew", "pd").without("sensor", "actuator", "environment")
    (claim,) = [claim for claim in certify(loop, "law").claims if claim.kind == "sampling"]
    told = [complex(*pair) for pair in claim.numbers["eigenvalues"]]
    found = linearise(loop).poles
    np.testing.assert_allclose(np.poly(found), np.poly(told), atol=1e-12)
    assert np.abs(found).max() <= claim.numbers["radius"] * (1 + 1e-12)


@pytest.mark.parametrize("parts", [0, 3, 10, 13, 20, 27])
def test_a_delayed_command_is_sampled_exactly(parts):
    """Against steps of a tenth of a period, in which the command in force is looked up."""
    plant = linearise(loop_of("cubesat-slew", "pd")).plant
    period, size = 0.1, len(plant.states)
    found = sampled(plant, period, parts / 10 * period)
    inputs = plant.B.shape[1]
    whole = np.zeros((size + inputs,) * 2)
    whole[:size] = np.hstack([plant.A, plant.B])
    fine = expm(whole * period / 10)[:size]
    commands = np.random.default_rng(1).standard_normal((12, inputs))
    commands[:, 3:] = 0.0
    x, z = np.zeros(size), np.zeros(len(found.states))
    for k in range(12):
        for part in range(10):
            acting = (10 * k + part - parts) // 10
            u = commands[acting] if acting >= 0 else np.zeros(inputs)
            x = fine @ np.concatenate([x, u])
        z = found.A @ z + found.B @ commands[k]
        np.testing.assert_allclose(z[:size], x, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "delay"),
    [("pd behind a lag", 0.0), ("sliding with a layer", 0.3), ("full inertia", 2.5), ("integral", 0.0), ("wheels", 1.0)],
)
def test_a_loop_at_its_gain_margin_is_about_to_lose_its_stability(name, delay):
    loop = LOOPS[name]()
    linear = linearise(loop, delay * loop.period)
    assert linear.is_stable
    for k, found in enumerate(margins(linear)):
        for gain in (g for g in (found.gain, found.less) if 0.0 < g < np.inf):
            scale = np.ones(3)
            radii = []
            for factor in (0.999 * gain, 1.001 * gain):
                scale[k] = factor
                law = linear.stepped_law
                louder = replace(linear, stepped_law=law._replace(C=scale[:, None] * law.C, D=scale[:, None] * law.D))
                radii.append(abs(louder.poles[0]))
            assert min(radii) < 1.0 < max(radii)
        assert found.gain < np.inf


@pytest.mark.parametrize("name", ["pd behind a lag", "sliding with a layer", "integral"])
def test_a_loop_delayed_by_its_delay_margin_is_about_to_lose_its_stability(name):
    loop = LOOPS[name]()
    # These axes are not coupled, so that a delay of all of them is one of the weakest.
    least = min(found.delay for found in margins(linearise(loop)))
    assert linearise(loop, 0.99 * least).is_stable
    assert not linearise(loop, 1.01 * least).is_stable


def test_margins_are_those_of_python_control():
    linear = linearise(loop_of("cubesat-slew", "pd"), 0.25)
    shown = response(linear)
    for k, found in enumerate(margins(linear)):
        told = control.FrequencyResponseData(shown.loops[k], shown.frequencies)
        gain, phase, sensitivity, _, crossover, _ = control.stability_margins(told)
        assert found.gain == pytest.approx(gain, rel=1e-3)
        assert found.phase == pytest.approx(np.radians(phase), rel=1e-3)
        assert found.crossover == pytest.approx(crossover, rel=1e-3)
        assert found.sensitivity == pytest.approx(1.0 / sensitivity, rel=1e-2)


def test_a_torque_that_pushes_is_held_up_by_the_stiffness():
    linear = linearise(loop_of("cubesat-slew", "pd").without("environment"))
    closed = linear.stepped_closed
    found = closed.at(np.array([1.0 + 0j]))[0].real
    k_attitude = loop_of("cubesat-slew", "pd").gains.k_attitude
    np.testing.assert_allclose(found[:3], np.eye(3) * 2.0 / k_attitude, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found[[closed.outputs.index(name) for name in COMMAND]], -np.eye(3), atol=1e-9)


def test_what_is_left_out_is_named():
    assert linearise(loop_of("cubesat-slew", "pd")).left_out == ("sensor gaussian",)
    assert linearise(loop_of("geostationary", "pd")).left_out == ("the target's own turning",)


LAW = """
from typing import Annotated, NamedTuple
from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import less, where
from starhold.algebra.vector import add, scale
from starhold.laws.interface import Card, Gain

CARD = Card(title="Remembers", summary="u", sources=("definition",), assumptions=(), claims="none")

class Gains(NamedTuple):
    damping: Annotated[float, Gain("N m s")] = 0.02

class Memory(NamedTuple):
    kept: float
    constant: float

def remember(gains, craft, period):
    return Memory({first}, 2.0)

def torque(told, gains, craft, memory):
    factor, kept = {factor}, {after}
    feedback = add(scale(gains.damping * factor, told.rate), scale(0.004, vector_part(told.attitude)))
    return scale(-1.0, feedback), Memory(kept, memory.constant)

def examples():
    return [Gains()]
"""


def remembering(tmp_path, factor, after, first="0.0"):
    (tmp_path / "law.py").write_text(LAW.format(factor=factor, after=after, first=first))
    law = from_file(tmp_path / "law.py")
    return replace(loop_of("cubesat-slew", "pd"), law=law, gains=law.gains(0.02))


@pytest.mark.parametrize(
    ("factor", "after", "first"),
    [
        # A flag of having started, and one that is never put back.
        ("where(less(0.5, memory.kept), 1.0, 0.0)", "1.0", "0.0"),
        ("where(less(0.5, memory.kept), 1.0, 0.0)", "where(less(0.5, memory.kept), memory.kept, 1.0)", "0.0"),
        # A filter that takes a million calls to come to rest, at 1, and one that needs a few.
        ("memory.kept", "memory.kept + 1e-5 * (1.0 - memory.kept)", "7.0"),
        ("memory.kept", "memory.kept + 0.5 * (1.0 - memory.kept)", "7.0"),
        # What the command does not depend on.
        ("1.0", "0.5 * memory.kept + told.rate[0]", "3.0"),
    ],
)
def test_memory_is_that_at_rest(tmp_path, factor, after, first):
    linear, plain = linearise(remembering(tmp_path, factor, after, first)), linearise(remembering(tmp_path, "1.0", "0.0"))
    assert linear.is_stable
    reached = np.abs(linear.poles[: len(plain.poles)])
    assert np.abs(linear.stepped_law.D - plain.stepped_law.D).max() < 1e-9
    if linear.law.states == ():
        np.testing.assert_allclose(reached, np.abs(plain.poles), rtol=1e-9)
    for ours, theirs in zip(margins(linear), margins(plain), strict=True):
        np.testing.assert_allclose(ours[1:], theirs[1:], rtol=1e-6)


def test_damping_in_the_first_call_alone_is_none(tmp_path):
    loop = remembering(tmp_path, "where(less(0.5, memory.kept), 0.0, 1.0)", "1.0")
    assert not linearise(loop).is_stable
    assert linearise(remembering(tmp_path, "1.0", "0.0")).is_stable


@pytest.mark.parametrize("after", ["memory.kept + told.period", "1.0 - memory.kept", "2.0 * memory.kept + 1.0"])
def test_memory_that_never_rests_is_refused(tmp_path, after):
    """A clock, one that goes to and fro, and one that runs away."""
    loop = remembering(tmp_path, "1.0", after)
    with pytest.raises(LinearityError, match="does not settle"):
        linearise(loop)


def test_a_delay_is_neither_negative_nor_endless():
    for delay in (-0.1, 1e9, float("nan")):
        with pytest.raises(LinearityError, match="a delay between 0 and 1000 control periods"):
            linearise(loop_of("cubesat-slew", "pd"), delay)
