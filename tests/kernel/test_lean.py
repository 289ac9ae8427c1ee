"""Loops that lean on their wheels' momentum: false claims that stand where a part of what is shown of that is left out."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import add, cross, dot, scale
from starhold.certification.evidence.blends import Blended, Shared
from starhold.certification.evidence.chains import Chain
from starhold.certification.evidence.finding import read
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import RefusedError
from starhold.kernel.regions import AT_REST
from tests.kernel.certificates import failing
from tests.kernel.flights import Around, Surroundings, along, turn
from tests.kernel.handmade import case
from tests.kernel.oracle import Oracle, run
from tests.tiers import leading

K, LEAN, LEVEL = 0.02, 0.005, Fraction("0.0005")
SLOW, SWINGING = (0.005, 0.14), (0.1, 0.06)
"""A target's rate (rad/s) and a law's damping (N m s): the slow torque turns slowly, or as fast as the loop swings."""


def leaning_law(damping):
    """Feedback that cancels what the wheels make of the body's own rate, and not what they make of the target's."""

    def law(m):
        own = add(cross(m.rate, add(m.wheel_momentum, m.body_rate)), m.target_acceleration)
        return add(own, add(scale(-damping, m.rate), scale(-K, vector_part(m.attitude))))

    return law


def lyapunov(damping):
    def level(m, craft):
        crossed = damping / 4.0 * dot(m.rate, vector_part(m.attitude))
        return 0.5 * dot(m.rate, m.rate) + 2.0 * K * (1.0 - m.attitude[0]) + crossed

    return level


def begun(rate, damping):
    """A claim, not yet shown, about a body with an inertia of 1 under such a law, its programs and its loop."""
    claim, programs = case(
        leaning_law(damping), lyapunov(damping), "points", taken=["moving target", "wheels"], period=0.5, outside=1e-8,
        error=0.0, target_rate=rate, target_acceleration=0.0, momentum=LEAN * K / rate, level=float(LEVEL), highest=1.0,
    )  # fmt: skip
    return claim, programs, Blended(AttitudeLoop(read(claim, programs)), Shared())


@cache
def claimed(rate, damping, dropped):
    """What the kernel as it is shows of such a body."""
    claim, programs, held = begun(rate, damping)
    chain = Chain(held, "", float(LEVEL))
    tube = held.tube(held.region(Fraction(chain.descend())))
    angle, fastest = chain.tighten(tube)
    exact = {"end.angle": angle, "end.rate": fastest, "settling": float(held.h * chain.samples) * 1.001}
    claim["numbers"] |= {name: x.hex() for name, x in exact.items()}
    claim["evidence"] = {"levels": chain.levels, "ellipsoids": chain.ellipsoids}
    assert chain.ellipsoids
    return claim, programs


def without(monkeypatch, **parts):
    """Leave parts out of the kernel."""
    begin = Held.__init__

    def dropped(self, loop):
        begin(self, loop)
        for name, x in parts.items():
            setattr(self, name, x)

    monkeypatch.setattr(Held, "__init__", dropped)


def refused(claim, programs):
    """Why the kernel refuses a claim."""
    try:
        return failing(claim, programs)
    except RefusedError as fault:
        return {str(fault)}


def farthest(claim, programs):
    """The largest turn, in the claimed one, of flights after the claimed time, with all the momentum across the rate."""
    oracle = Oracle({"programs": programs}, claim)
    n, rng, lanes, zero = oracle.numbers, oracle.rng, 6, np.zeros((3, 6))
    around = Around(
        Surroundings([0.0] * 3, n["target.rate"], 0.0, n["momentum"], 0.0, 0.0),
        oracle.J,
        np.linalg.inv(oracle.J),
        rng,
        lanes,
    )
    around.phase = np.zeros(lanes)
    around.axis = along(rng.normal(size=(3, lanes)))
    around.kept = n["momentum"] * along(np.cross(around.axis.T, rng.normal(size=3)).T)
    q, w, h, most = np.array([[1.0], [0.0], [0.0], [0.0]]) * np.ones(lanes), zero, n["period"], 0.0

    def asked(q, w, *told):
        return run(oracle.programs["law"], oracle.inputs(q, w, *told)[0])

    for k in range(int(n["settling"] / h) + 200):
        q, w = around.after(q, w, k * h, around.command(asked, q, w, k * h, zero), zero, h)
        if (k + 1) * h > n["settling"]:
            most = max(most, float(turn(q).max()))
    assert np.linalg.norm(around.kept, axis=0).max() <= n["momentum"] * (1.0 + 1e-6)
    return most / n["end.angle"]


NARROW = {"the angle is too small"}
DROPPED = {
    "x stands where z does": (SLOW, {"leant": AT_REST}, NARROW, 3.0),
    "the slow torque is nowhere": (SLOW, {"leant": AT_REST, "soft": Fraction(0)}, NARROW, 100.0),
    "the place to lean to does not move": (SWINGING, {"soft": Fraction(0)}, {"ellipsoid"}, 1.05),
}
"""A loop, what is left out of the kernel, why the whole one refuses the claim, and how many times farther it then flies."""


@pytest.mark.parametrize("part", leading(DROPPED))
def test_without_a_part_of_the_lean_a_false_claim_stands(part, monkeypatch):
    loop, parts, wanted, times = DROPPED[part]
    without(monkeypatch, **parts)
    claim, programs = claimed(*loop, part)
    assert failing(claim, programs) == set()
    monkeypatch.undo()
    assert refused(claim, programs) == wanted
    assert farthest(claim, programs) > times


@pytest.mark.parametrize(("loop", "times"), leading([(SLOW, 0.75), (SWINGING, 0.2)]))
def test_with_all_of_it_no_flight_is_farther_than_claimed(loop, times):
    claim, programs = claimed(*loop, "")
    assert failing(claim, programs) == set()
    assert times < farthest(claim, programs) <= 1.0


def test_the_place_to_lean_to_moves_in_a_period_as_far_as_is_said():
    """On target the momentum turns over at the target's rate, and the torque with it: no less would be enough."""
    rate, damping = SWINGING
    held = begun(rate, damping)[2]
    *_, (_, moved) = held.linear(held.tube(held.region(held.s / 2**40)))
    true = 2.0 * LEAN * np.sin(rate * float(held.h) / 2.0)
    assert 0.98 * float(moved) < true <= float(moved)
