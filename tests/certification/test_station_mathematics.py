"""The mathematics of the checker of circles round a libration point: V' and the control, against the equations that fly."""

import math
from types import ModuleType

import numpy as np
import pytest
from flint import ctx, fmpq
from hypothesis import given, settings
from hypothesis import strategies as some

from starhold.algebra.scalar import where
from starhold.algebra.vector import add, scale, subtract
from starhold.checker.circle import CircleLoop
from starhold.checker.exact import CheckError, floating, rational
from starhold.checker.polar import keeps_within, phases
from starhold.laws import l2_circle
from starhold.laws.catalogue import Law
from starhold.laws.interface import NoMemory
from starhold.laws.point import PointMeasurement, along
from starhold.parts.bodies.libration_point import linear, nonlinear
from tests.certification.circles import BACK, BEST, PLANT, RELAY, SOFT, WIDE, peak, station


def within(gains, kind, limit, level):
    with ctx.workprec(192):
        return keeps_within(station(gains).circle, rational(level), rational(limit), kind == "axis")


# --- its mathematics: V' ----------------------------------------------------------------------------------------------


def drawn_gains(random):
    feedback, layer = int(random.integers(2)), float(random.uniform(0.01, 1.0))
    low, high = (0.3, 3.0)
    return BEST._replace(
        radius=float(random.uniform(low, high)),
        rate=float(random.choice([-1, 1]) * random.uniform(low, high)),
        alpha=float(random.uniform(low, high)),
        k=float(random.uniform(0.1, 2.0)),
        feedback=feedback,
        boundary_layer=layer,
    )


def command(measurement, gains):
    return l2_circle.control(measurement, gains, PLANT, NoMemory())[0]


@settings(max_examples=60)
@given(some.integers(0, 2**32 - 1))
def test_v_changes_as_the_law_moves_the_craft(seed):
    """The derivative that was read against that of V along the equations that fly, in floats by a complex step."""
    random = np.random.default_rng(seed)
    model = int(random.integers(2))
    gains = drawn_gains(random)._replace(model=model)
    x, v = (tuple(random.normal(size=3).tolist()) for _ in range(2))
    measurement = PointMeasurement(x, v, 1e-3, math.inf)
    swing = add((linear, nonlinear)[model](x, v, PLANT), command(measurement, gains))
    moved = PointMeasurement(*(tuple(np.array(a) + 1e-30j * np.array(b)) for a, b in ((x, v), (v, swing))), 1e-3, math.inf)
    expected = l2_circle.lyapunov(moved, gains, PLANT).imag / 1e-30
    circle = station(gains, model=("linear", "nonlinear")[model]).circle
    circle.form()
    f2, f3 = v[1] + gains.rate * x[2], v[2] - gains.rate * x[1]
    share = gains.k if gains.feedback == 0 else gains.k / max(math.hypot(f2, f3), gains.boundary_layer)
    values = dict(zip(("x1", "x2", "x3", "v1", "v2", "v3", "t2", "t3"), (*x, *v, share * f2, share * f3), strict=True))
    found = floating(circle.lyapunov.slope.at({name: rational(value) for name, value in values.items()}))
    # The full problem is near the linear one, but for cancellation of what the law undoes.
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-8)
    assert found <= 0.0


def altered(**parts):
    """The law with other equations."""
    module = ModuleType("l2_circle_altered")
    vars(module).update({name: value for name, value in vars(l2_circle).items() if not name.startswith("__")})
    vars(module).update(parts)
    return Law("l2-circle", module)


def less_damping(measurement, gains, plant, taken):
    return subtract(l2_circle.neutral(measurement, gains, plant), taken)


def with_damping(taken):
    return lambda measurement, gains, plant, memory: (
        less_damping(measurement, gains, plant, taken(measurement, gains, plant)),
        memory,
    )


def wrong_of(measurement, gains):
    return (0.0, *l2_circle.errors(measurement, gains)[1:])


@pytest.mark.parametrize("gains", [BEST, RELAY, SOFT])
@pytest.mark.parametrize(
    "taken",
    [
        lambda measurement, gains, plant: scale(-gains.k, wrong_of(measurement, gains)),
        lambda measurement, gains, plant: scale(gains.k + 1e-9, wrong_of(measurement, gains)),
        lambda measurement, gains, plant: (0.0, gains.k * measurement.velocity[1], gains.k * measurement.velocity[2]),
        lambda measurement, gains, plant: along(wrong_of(measurement, gains), gains.k, 2.0 * gains.boundary_layer + 1e-3),
        lambda measurement, gains, plant: scale(gains.k * measurement.period, wrong_of(measurement, gains)),
        # The rate of the plant's axes in place of the circle's.
        lambda measurement, gains, plant: scale(gains.k, wrong_of(measurement, gains._replace(rate=plant.rate))),
    ],
)
def test_other_damping_is_noticed(gains, taken):
    circle = station(gains).circle
    circle.form()
    other = CircleLoop(altered(control=with_damping(taken)), circle.gains, circle.plant, False)
    with pytest.raises(CheckError, match="damps in another way"):
        other.form()


def test_the_damping_as_published_is_taken():
    for gains in (BEST, RELAY, SOFT):
        circle = station(gains).circle

        def taken(measurement, gains, plant):
            smooth, relayed = (
                scale(gains.k, wrong_of(measurement, gains)),
                along(wrong_of(measurement, gains), gains.k, gains.boundary_layer),
            )
            return tuple(where(gains.feedback == 1, a, b) for a, b in zip(relayed, smooth, strict=True))

        CircleLoop(altered(control=with_damping(taken)), circle.gains, circle.plant, False).form()


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        (
            {
                "lyapunov": lambda measurement, gains, plant: (
                    l2_circle.lyapunov(measurement, gains, plant) + measurement.position[0] * measurement.position[0]
                )
            },
            "V is not",
        ),
        (
            {
                "neutral": lambda measurement, gains, plant: add(
                    l2_circle.neutral(measurement, gains, plant), (0.0, measurement.position[1], 0.0)
                )
            },
            "does not keep V",
        ),
        (
            {
                "neutral": lambda measurement, gains, plant: add(
                    l2_circle.neutral(measurement, gains, plant), (measurement.position[1], 0.0, 0.0)
                )
            },
            "along X depends on the other axes",
        ),
        # What turns (f2, f3) keeps V, and moves them in another way.
        (
            {
                "neutral": lambda measurement, gains, plant: add(
                    l2_circle.neutral(measurement, gains, plant),
                    (0.0, l2_circle.errors(measurement, gains)[2], -l2_circle.errors(measurement, gains)[1]),
                )
            },
            "f2 changes in another way",
        ),
    ],
)
def test_another_v_or_neutral_control_is_noticed(parts, reason):
    circle = station().circle
    with pytest.raises(CheckError, match=reason):
        CircleLoop(altered(**parts), circle.gains, circle.plant, False).form()


# --- its mathematics: the control -------------------------------------------------------------------------------------


def sizes(gains, kind, r, n, angle, turn):
    """The control at many states of the plane x = 0, by the law's neutral control and its damping in floats."""
    y, z, f2, f3 = r * np.cos(turn), r * np.sin(turn), n * np.cos(angle), n * np.sin(angle)
    zero = np.zeros_like(y)
    measurement = PointMeasurement((zero, y, z), (zero, f2 - gains.rate * z, f3 + gains.rate * y), 1e-3, math.inf)
    share = gains.k if gains.feedback == 0 else gains.k / np.maximum(n, gains.boundary_layer)
    x, *rest = (np.asarray(part) for part in l2_circle.neutral(measurement, gains, PLANT))
    u = np.array([x, rest[0] - share * f2, rest[1] - share * f3])
    return np.sqrt((u * u).sum(axis=0)) if kind == "norm" else np.abs(u).max(axis=0)


def largest(gains, kind, level, random, count=30_000):
    """The largest control that was found on {V <= level}: random states, and ever closer ones round the best of them."""
    best, spread = np.array([[0.0, math.pi / 4.0, 0.0, 0.0]]), np.array([math.pi, math.pi, math.pi, math.pi])
    found = 0.0
    for step in range(8):
        states = best[random.integers(len(best), size=count)] + spread * random.uniform(-1.0, 1.0, (count, 4))
        lean, share = np.sin(states[:, 0]), np.abs(np.sin(states[:, 1]))
        error = math.sqrt(2.0 * level) * share
        r = np.sqrt(np.maximum(gains.radius**2 + lean * error / math.sqrt(gains.alpha), 0.0))
        size = sizes(gains, kind, r, error * np.sqrt(1.0 - lean * lean), states[:, 2], states[:, 3])
        found, best, spread = max(found, float(size.max())), states[np.argsort(size)[-20:]], spread / (2.0 if step else 1.0)
    return found


CASES = [(BEST, "norm", 1.05), (BEST, "norm", 1.4), (BEST, "axis", 1.2), (SOFT, "norm", 1.2), (SOFT, "axis", 1.3)]


@pytest.mark.parametrize(("gains", "kind", "margin"), [*CASES, (WIDE, "norm", 1.2), (BACK, "axis", 1.1)])
def test_levels_up_to_where_the_limit_is_reached_hold(gains, kind, margin):
    random, limit = np.random.default_rng(6), margin * peak(gains, kind)
    low, high = 0.0, gains.alpha * gains.radius**4 / 2.0
    assert largest(gains, kind, high, random) > limit
    for _ in range(10):
        level = (low + high) / 2.0
        low, high = (level, high) if largest(gains, kind, level, random) <= limit else (low, level)
    assert within(gains, kind, limit, 0.99 * low)
    assert within(gains, kind, limit, 1e-6 * low)
    # A state that needs more was found there.
    assert not within(gains, kind, limit, high)
    assert not within(gains, kind, limit, min(1.1 * high, 0.999 * gains.alpha * gains.radius**4 / 2.0))


@settings(max_examples=25, deadline=None)
@given(some.integers(0, 2**32 - 1))
def test_no_state_of_what_holds_needs_more(seed):
    random = np.random.default_rng(seed)
    gains, kind = drawn_gains(random), str(random.choice(["norm", "axis"]))
    level = float(random.uniform(0.0, 0.999)) * gains.alpha * gains.radius**4 / 2.0
    need = largest(gains, kind, level, random, 4000)
    assert not within(gains, kind, 0.999 * need, level)
    assert within(gains, kind, 1.02 * need, level)


@given(some.integers(0, 2**32 - 1))
def test_the_control_turns_with_the_phase(seed):
    """C c + S s against the command of the law in floats."""
    random = np.random.default_rng(seed)
    gains = drawn_gains(random)
    r, n = random.uniform(0.1, 2.0, 2)
    angle, turn = random.uniform(0.0, 2.0 * math.pi, 2)
    c, s = math.cos(turn), math.sin(turn)
    a, b = n * math.cos(angle), n * math.sin(angle)
    y, z, f2, f3 = r * c, r * s, a * c - b * s, a * s + b * c
    told = command(PointMeasurement((0.0, y, z), (0.0, f2 - gains.rate * z, f3 + gains.rate * y), 1e-3, math.inf), gains)
    share = gains.k if gains.feedback == 0 else gains.k / max(n, gains.boundary_layer)
    values = {"r": r, "a": a, "b": b, "p": share * a, "q": share * b}
    exactly = {name: rational(float(value)) for name, value in values.items()}
    for (C, S), have in zip(phases(station(gains).circle), told, strict=True):
        assert floating(C.at(exactly)) * c + floating(S.at(exactly)) * s == pytest.approx(have, abs=1e-10)


@given(some.floats(-10.0, 10.0))
def test_a_state_on_the_circle(angle):
    with ctx.workprec(192):
        state = station(BACK).circle.on_it(rational(angle))
    y, z, v, w = (state[name] for name in ("x2", "x3", "v2", "v3"))
    assert y * y + z * z == fmpq(25)
    assert (v, w) == (2 * z, -2 * y)
    assert (floating(y), floating(z)) == pytest.approx((5.0 * math.cos(angle), 5.0 * math.sin(angle)), abs=1e-12)
