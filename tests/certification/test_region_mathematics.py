"""The mathematics of the checker of regions of the law `modal`, against states and the equations that fly."""

import math

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as some

from starhold.algebra.quaternion import derivative
from starhold.algebra.vector import ZERO
from starhold.checker import modal as reading
from starhold.checker.exact import CheckError, floating, rational
from starhold.checker.modal import Shares
from starhold.laws import modal
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.parts.craft import tensor
from tests.certification.loops import random_craft
from tests.certification.regions import BETTER, PLAIN, A, B, by_formula, file, read, region
from tests.tiers import fewer

UNIT = some.floats(-1.0, 1.0)


@given(some.integers(0, 2**32 - 1))
def test_v_falls_as_the_law_turns_the_body(seed):
    """The checker's V' against the derivative of V along the law's own equations, in floats."""
    random = np.random.default_rng(seed)
    craft = random_craft(random)
    a, b = -random.uniform(0.1, 2.0), -random.uniform(0.001, 0.1)
    p, c2, g, m = random.normal(size=4)
    q = random.normal(size=4)
    q /= np.linalg.norm(q)
    w = random.normal(size=3) * random.uniform(0.1, 3.0)
    q, w = tuple(q.tolist()), tuple(w.tolist())
    gains = modal.Gains((a,) * 3, (a,) * 3, b)
    measurement = Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, 0.25, ZERO)
    swing = angular_acceleration(w, modal.torque(measurement, gains, craft, NoMemory())[0], craft)
    turning = derivative(q, w)

    def energy(step):
        # A complex step differentiates a polynomial up to rounding.
        x, v = np.array(q) + 1j * step * np.array(turning), np.array(w) + 1j * step * np.array(swing)
        u = 1.0 - x[0]
        return v @ v / 2.0 + a * a * (p * u + c2 * u * u) - a * (g + m * u) * (v @ x[1:])

    expected = float(energy(1e-30).imag) / 1e-30
    claim = region(1.0, (p, c2, g, m), a=a, slew_angle=0.0, rate=0.0)
    own = read(file(claim, a, b, inertia=tensor(craft.inertia).tolist()))
    own.form()
    alpha = floating(own.alpha)
    u, y, s = 1.0 - q[0], float(np.dot(w, w)) / alpha**2, float(np.dot(w, q[1:])) / alpha
    u, y, s = rational(u), rational(y), rational(s)
    l2 = u * (2 - u)
    found = floating(own.fall(u, y, s, Shares(y, s * s, s, l2)) / (1 + l2)) * alpha**3
    size = alpha**3 * (1.0 + floating(y)) ** 2 * (1.0 + sum(map(abs, (p, c2, g, m))))
    assert found == pytest.approx(expected, abs=1e-12 * size)
    assert floating(own.height(u, y, s)) * alpha**2 == pytest.approx(float(energy(0.0).real), abs=1e-12 * size)


def test_another_motion_or_another_slope_is_noticed():
    for name in ("a", "b", "beta", "alpha", "m", "g", "p", "c2"):
        own = read(file(region(1.0, BETTER)))
        own.form()
        setattr(own, name, getattr(own, name) + fmpq(1, 10**12))
        if name in ("m", "g", "p", "c2"):
            own.height = read(file(region(1.0, BETTER))).height
        with pytest.raises(CheckError):
            own.form()


def test_every_state_of_the_set_is_in_a_box(monkeypatch):
    """What is shown of boxes is shown of states: the same V and, but for a positive factor, the same V'."""
    for witness, c in ((BETTER, 9.0), (PLAIN, 3.58), ((4.5, 0.1, 1.5, -0.3), 5.0)):
        asked = []
        monkeypatch.setattr(reading, "negative_where", lambda *given, to=asked: to.append(given) or True)
        assert read(file(region(c, witness)))._falls(fmpq(8))
        (slow, slow_room, slow_box), (fast, fast_room, fast_box) = asked
        random = np.random.default_rng(5)
        kinds = set()
        for _ in range(fewer(4000)):
            u, w, x = 2.0 * random.random() ** random.choice([1, 8]), 9.0 * random.random(), 2.0 * random.random() - 1.0
            V, slope = by_formula(A, B, witness, u, w, x)
            if c < V:
                continue
            long = math.sqrt(u * (2.0 - u))
            if w <= 8.0 * long:
                kinds.add("slow")
                given, fall, room, box, over = {"u": u, "r": w / long, "x": x}, slow, slow_room, slow_box, long**2
            else:
                kinds.add("fast")
                given = {"y": w * w, "n": math.sqrt(u / 2.0) / w, "x": x * math.sqrt(1.0 - u / 2.0)}
                fall, room, box, over = fast, fast_room, fast_box, w * w
            if witness is PLAIN:
                over = w * w
            assert all(floating(low) <= given[name] <= floating(high) for name, (low, high) in box.items())
            values = {name: rational(value) for name, value in given.items()}
            assert floating(room.at(values)) == pytest.approx(c - V, rel=1e-6, abs=1e-9)
            assert floating(fall.at(values)) == pytest.approx((1.0 + long**2) * slope / over, rel=1e-6, abs=1e-9)
        assert kinds == {"slow", "fast"}


def test_each_box_is_looked_at():
    for c, witness, missed in (
        (9.15, BETTER, "_slow"),
        # Without attitude V' is |w|2 (g/2 - 2).
        (1e-3, (5.0, 0.0, 4.1, 0.0), "_fast"),
        (9.21, BETTER, "_beyond"),
    ):
        assert not getattr(read(file(region(c, witness))), missed)(fmpq(8))
    own = read(file(region(9.0, BETTER)))
    assert own._slow(fmpq(8))
    assert own._fast(fmpq(8))
    assert own._beyond(fmpq(8))
    # A bound of |w| that the strength of the product exceeds is none.
    assert not own._beyond(fmpq(3))
