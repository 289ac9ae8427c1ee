"""The mathematics of the checker of equilibria beside a libration point: the loop it reads and the sets it accepts, against
states and flights."""

import math
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from flint import arb, ctx, fmpq
from hypothesis import given, settings
from hypothesis import strategies as some

from starhold.algebra.vector import add, scale
from starhold.certification.station import certify_station
from starhold.checker.equilibrium import EquilibriumLoop, LimitedAxis
from starhold.checker.exact import CheckError, floating, rational
from starhold.laws import l2_equilibrium
from starhold.laws.catalogue import Law
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import linear
from starhold.simulation.lanes import simulate_many
from tests.certification.equilibria import GAINS, PLANT, STEEP, STEEPNESS, STRONG, WEAK, loop_of, station


def axis(gains, limit):
    return LimitedAxis.of(station(gains).equilibrium, rational(limit))


def refused(claim):
    """Whether a claim fails, and nothing else goes wrong."""
    try:
        claim()
    except CheckError:
        return True
    return False


def altered(**parts):
    """The law with other equations."""
    module = ModuleType("l2_equilibrium_altered")
    vars(module).update({name: value for name, value in vars(l2_equilibrium).items() if not name.startswith("__")})
    vars(module).update(parts)
    return Law("l2-equilibrium", module)


def pushed(*more):
    """The feedback and a push that depends on the state."""
    return lambda measurement, gains, plant: add(
        l2_equilibrium.feedback(measurement, gains, plant), tuple(f(measurement, gains, plant) for f in more)
    )


def nothing(measurement, gains, plant):
    return 0.0


@pytest.mark.parametrize(
    "parts",
    [
        {"feedback": pushed(lambda s, g, p: s.position[1], nothing, nothing)},
        {"feedback": pushed(nothing, lambda s, g, p: 1e-12 * s.velocity[0], nothing)},
        {"feedback": pushed(nothing, nothing, lambda s, g, p: 1e-12 + 0.0 * s.position[0])},
        {"feedback": pushed(lambda s, g, p: s.position[0] * s.position[0], nothing, nothing)},
        {"feedback": pushed(nothing, lambda s, g, p: s.period * s.position[1], nothing)},
        {"control": lambda s, g, p, m: ((*l2_equilibrium.feedback(s, g, p)[:2], 0.0), m)},
        {"control": lambda s, g, p, m: (scale(1.0 + 2.0**-50, l2_equilibrium.feedback(s, g, p)), m)},
        {"control": lambda s, g, p, m: (add(l2_equilibrium.control(s, g, p, m)[0], (s.limit, 0.0, 0.0)), m)},
    ],
)
def test_another_law_is_noticed(parts):
    loop = station().equilibrium
    loop.form()
    law = altered(**parts)
    if "feedback" in parts:
        # What flies is the altered feedback as well.
        vars(law.module)["control"] = lambda measurement, gains, plant, memory: (
            law.module.feedback(measurement, gains, plant),
            memory,
        )
    with pytest.raises(CheckError):
        EquilibriumLoop(law, loop.gains, loop.plant, False).form()


def test_the_form_is_that_of_the_motion():
    full, plain = station(GAINS._replace(model=1), model="nonlinear").equilibrium, station().equilibrium
    full.form()
    for one, other in ((full, False), (plain, True)):
        with pytest.raises(CheckError, match="undoes"):
            EquilibriumLoop(one.law, one.gains, one.plant, other).form()
    for k, (stiff, damp) in enumerate(plain.axes):
        assert (stiff, damp) == full.axes[k]
        assert damp == rational(GAINS.k_velocity[k])


@settings(max_examples=100)
@given(some.integers(-50, 50), some.integers(-50, 50), some.integers(1, 60))
def test_signs_with_a_root(a, b, p):
    found = LimitedAxis(fmpq(p), fmpq(1), fmpq(1), fmpq(1)).above(fmpq(a, 3), fmpq(b, 7))
    if a * a * 49 == b * b * 9 * p:
        # Opposite and equal, or twice the same.
        assert found == (a > 0 and b > 0)
    else:
        with ctx.workprec(192):
            assert found == bool(arb(fmpq(a, 3)) + arb(fmpq(b, 7)) * arb(p).sqrt() > 0)


def drawn(random):
    """Numbers of an axis, a set and a witness of which about a half hold."""
    p, share, tilt = random.uniform(1.5, 30.0), random.uniform(1.05, 8.0), random.normal() * 10.0 ** random.uniform(-4, 0)
    limit = random.uniform(0.1, 5.0)
    numbers = LimitedAxis(*(rational(float(x)) for x in (p, p * (share + tilt), share * math.sqrt(p), limit)))
    width = limit / p * random.uniform(0.3, 1.05)
    return numbers, width, width * random.uniform(0.9, 20.0), 10.0 ** random.uniform(-3, 1)


@settings(max_examples=200, deadline=None)
@given(some.integers(0, 2**32 - 1))
def test_what_is_accepted_falls_at_random_states(seed):
    random = np.random.default_rng(seed)
    numbers, width, reach, mu = drawn(random)
    p, k, c, limit = (floating(part) for part in (numbers.p, numbers.k, numbers.c, numbers.limit))
    s = math.sqrt(p)
    # Corners and edges of the set and of smaller copies of it.
    m = random.uniform(0.0, 1.0, 4000)
    side, along = random.choice([-1.0, 1.0], m.size), random.uniform(-1.0, 1.0, m.size)
    S, x = (
        np.concatenate(parts) for parts in ((m * side * width, m * along * width), (m * along * reach, m * side * reach))
    )
    v = s * (S - x)
    swing = p * x - np.clip(k * x + c * v, -limit, limit)
    turn = v + swing / s
    rising = np.where(np.arange(x.size) < m.size, turn * np.sign(S), v * np.sign(x))
    stays = not refused(lambda: numbers.stays(rational(width), rational(reach)))
    strict = not refused(lambda: numbers.strict(rational(width), rational(reach), rational(mu)))
    assert not (strict and not stays)
    if stays:
        assert (rising < 0.0).all()
    if strict:
        assert (S * turn + mu * x * v < 0.0).all()


@pytest.mark.parametrize(("share", "tilt"), [(2.0, 0.0), (1.2, 0.05), (4.0, -0.3), (3.0, 0.5)])
def test_a_set_a_little_larger_is_left(share, tilt):
    """What is accepted reaches to where a motion does leave: the conditions are those of the edges."""
    p, limit = 9.0, 2.0
    numbers = LimitedAxis(*(rational(x) for x in (p, p * (share + tilt), share * 3.0, limit)))
    bound = limit / p
    for reach in (1.1, 2.0, 5.0):
        for width in np.linspace(0.05, 1.2, 60) * bound:
            sigma, x = width, np.linspace(-1.0, 1.0, 2001) * reach
            falls = sigma - np.clip(share * sigma + tilt * x, -bound, bound)
            holds = not refused(lambda w=float(width), r=reach: numbers.stays(rational(w), rational(r)))
            assert holds == bool((falls < 0.0).all())


# --- flights ----------------------------------------------------------------------------------------------------------


def flown_along_x(gains, limit, x, v, time=14.0, step=2e-3):
    """x and x' in the end where the others are held at rest, under the command of the law and the limit that fly."""

    def slope(x, v):
        still = np.zeros_like(x)
        measurement = PointMeasurement((x, gains.y + still, gains.z + still), (v, still, still), step, limit)
        command = l2_equilibrium.feedback(measurement, gains, PLANT)[0]
        return v, linear(measurement.position, measurement.velocity, PLANT)[0] + np.clip(command, -limit, limit)

    for _ in range(round(time / step)):
        a, b = slope(x, v)
        c, d = slope(x + step / 2.0 * a, v + step / 2.0 * b)
        x, v = x + step * c, v + step * d
    return x, v


@pytest.mark.parametrize("gains", [GAINS, STRONG, WEAK])
def test_flights_agree(gains):
    limit = 4.0
    numbers = certify_station(loop_of(gains, limit)).claims[1].numbers
    random = np.random.default_rng(3)
    x, side = random.uniform(-1.0, 1.0, 400), np.where(np.arange(400) % 2 == 0, 1.0, -1.0)
    x = np.where(np.arange(400) < 300, 5.0 * numbers["width"], numbers["reach"]) * x
    for size, returns in ((0.98 * numbers["width"], True), (1.002 * numbers["boundary"], False)):
        end, speed = flown_along_x(gains, limit, x, STEEPNESS * (side * size - x))
        if returns:
            assert np.abs(end).max() < 0.01 * numbers["width"]
        else:
            assert (side * (end + speed / STEEPNESS) > numbers["boundary"]).all()


def test_rest_along_y_at_the_start_is_not_enough():
    """x' makes a Coriolis acceleration along Y that the limit does not let the control undo; y' then one along X."""
    gains, limit = GAINS._replace(y=0.0, z=0.0), 4.0
    states = np.zeros((9, 1))
    states[0] = 10.0 * limit / STEEP
    states[3] = -STEEPNESS * states[0]
    assert simulate_many(replace(loop_of(gains, limit), divergence_bound=1e3), states, 20_000).lost_at[0] >= 0.0
    assert abs(flown_along_x(gains, limit, states[0], states[3])[0][0]) < 1e-3
    assert not refused(lambda: axis(gains, limit).stays(rational(0.4), rational(float(states[0, 0]))))
