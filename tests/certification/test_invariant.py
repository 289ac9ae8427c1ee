"""The theorems on invariant sets: what is proved, what is refuted and by which state, what stays undecided."""

from fractions import Fraction

import numpy as np
import pytest

from starhold.algebra.scalar import clip, less, maximum, where
from starhold.certification.invariant import InvariantProblem, System, WantedSet, certify, prove
from starhold.certification.invariant.search import Candidate, Values
from starhold.certification.invariant.wording import sentence
from tests.certification.invariants import SQUARE, claim, expression, fractions, outcomes, system
from tests.tiers import leading

ORIGIN = (0, 0)
ROUND = "x**2 + y**2"
TURNS, DAMPED, SPIRALS = ("y", "-x"), ("y", "-x - y"), ("y", "-x + y/10")
BUMP, REPELS = ("-x + x**3", "-y"), (f"-y + x*({ROUND} - 1)", f"x + y*({ROUND} - 1)")
AT, ANY = {"equilibrium": ORIGIN}, {"parameters": "a", "equilibrium": ORIGIN}
BALL, THREE = "x**2 + y**2 + z**2", {"box": (*SQUARE, (-2.0, 2.0)), "equilibrium": (0, 0, 0), "variables": "x y z"}
STRONG = ("4*x**3 - x**2*y - 6*x*y**2 - y**3", "x**3 + 4*x**2*y + x*y**2 - 6*y**3")
FAR = {"box": ((-9.0, 9.0), (-9.0, 9.0)), "equilibrium": ORIGIN, "level": 80.0}
CLAIMS = {
    "a centre": (TURNS, "stable", ROUND, AT, "proved"),
    "a semidefinite form that does not factor": (("-x", "-y", "0"), "stable", BALL, THREE, "proved"),
    "strict descent": (("-x + y", "-x - y"), "attracts", ROUND, AT, "proved"),
    "descent that cannot vanish for long": (DAMPED, "attracts", ROUND, AT, "proved"),
    "a centre, which does not attract": (TURNS, "attracts", ROUND, AT, "undecided"),
    "descent of the fourth power": (("-x**3", "-y"), "region", ROUND, AT, "proved"),
    "descent of the sixth power": (("-x**5", "-y"), "region", ROUND, AT, "proved"),
    "a level": (BUMP, "region", ROUND, AT | {"level": 0.99}, "proved"),
    "an empty set": (("-x", "-y"), "region", f"{ROUND} + 1", {}, "undecided"),
    "a set on the border": (("-x", "-y"), "region", f"{ROUND} - 5", {}, "refuted"),
    "every parameter": (("-a*x", "-y"), "region", ROUND, ANY | {"box": (*SQUARE, (0.5, 2.0))}, "proved"),
    # All motions come to rest, but V' of no polynomial V is negative everywhere (Ahmadi, Krstic, Parrilo 2011).
    "what no polynomial shows": (("-x + x*y", "-y"), "region", ROUND, FAR, "refuted"),
    "what no quadratic form shows": (STRONG, "region", ROUND, FAR, "refuted"),
    "a saddle": (("x", "-y"), "unstable", "x**2 - y**2", AT, "proved"),
    "rest outside of the box": (("x", "y"), "unstable", ROUND, AT | {"box": ((1.0, 2.0), (1.0, 2.0))}, "undecided"),
    "a stable node, which is not unstable": (("-x", "-y"), "unstable", ROUND, AT, "refuted"),
    "a set that repels": (REPELS, "unstable", f"{ROUND} - 1", {}, "proved"),
    "what one of two functions leaves": (("x", "-y"), "intersection", ("x**2 - 1", "y**2 - 1"), {}, "refuted"),
    # The centre is at equilibrium, with V = 1; where a function stands still nothing is known.
    "a set whose middle rests": (REPELS, "unstable", f"({ROUND} - 1)**2", {}, "refuted"),
    "where one function stands still": (("0", "-y"), "intersection", ("x**2 - 1", "y**2 - 1"), {}, "undecided"),
    "some parameters": (("-a*x", "-y"), "region", ROUND, ANY | {"box": (*SQUARE, (-0.5, 2.0))}, "refuted"),
}


@pytest.mark.parametrize("name", leading(CLAIMS, len(CLAIMS) - 3))
def test_outcomes(name):
    rates, theorem, V, more, outcome = CLAIMS[name]
    found = claim(rates, theorem, V, **more)
    assert found.outcome == outcome
    assert "level" not in more or outcome != "proved" or found.numbers["level"] == more["level"]


# --- theorem 1 -----------------------------------------------------------------------------------------------------------


def test_what_spirals_out_is_refuted_however_near_the_rest():
    found = claim(SPIRALS, "stable", ROUND, equilibrium=ORIGIN)
    assert found.outcome == "refuted"
    s = fractions(found.refutation().evidence["state"])
    assert s["y"] != 0


def test_a_form_is_semidefinite_as_a_sum_of_squares():
    squares = tuple(expression(name, "x y z") for name in "xy")
    box = (*SQUARE, (-2.0, 2.0))
    found = claim(("-x", "-y", "0"), "stable", "x**2 + y**2 + z**2", box, (0, 0, 0), variables="x y z", squares=squares)
    assert found.outcome == "proved"
    no_sum = claim(("-x", "y", "0"), "stable", "x**2 + y**2 + z**2", box, (0, 0, 0), variables="x y z", squares=squares)
    assert no_sum.outcome == "refuted"


# --- theorem 2 and the corollary ------------------------------------------------------------------------------------------


def test_largest_level_is_bounded_by_the_box_or_by_v():
    free = claim(("-x", "-y"), "region", ROUND, equilibrium=ORIGIN)
    assert 3.9 < free.numbers["level"] < 4.0
    assert free.numbers["limited_by"] == "border"
    # x' = -x + x^3: everything up to |x| = 1.
    held = claim(("-x + x**3", "-y"), "region", ROUND, equilibrium=ORIGIN)
    assert 0.99 < held.numbers["level"] < 1.0 <= held.numbers["refuted_level"] < 1.001
    assert held.numbers["size"] == pytest.approx(np.pi * held.numbers["level"], rel=5e-3)
    assert held.numbers["limited_by"] == "V rises"


def test_too_large_a_level_is_refuted_by_an_exact_state():
    found = claim(("-x + x**3", "-y"), "region", ROUND, equilibrium=ORIGIN, level=1.5)
    assert found.outcome == "refuted"
    s = fractions(found.refutation().evidence["state"])
    x, y = s["x"], s["y"]
    assert 0 < x * x + y * y <= Fraction(3, 2)
    assert 2 * x * (-x + x**3) - 2 * y * y >= 0


def test_level_that_reaches_the_border_is_refuted_there():
    found = claim(("-x", "-y"), "region", ROUND, equilibrium=ORIGIN, level=4.5)
    s = fractions(found.refutation().evidence["state"])
    assert found.refutation().name == "bounded"
    assert max(abs(s["x"]), abs(s["y"])) == 2
    assert s["x"] ** 2 + s["y"] ** 2 <= Fraction(9, 2)


@pytest.mark.slow
def test_false_indicators_are_refuted():
    not_positive = claim(("-x", "-y"), "region", "x**2 - y**2", equilibrium=ORIGIN)
    assert outcomes(not_positive)["positive"] == "refuted"
    s = fractions(not_positive.refutation().evidence["state"])
    assert s["x"] ** 2 - s["y"] ** 2 <= 0
    shifted = claim(("-x", "-y"), "region", f"{ROUND} + 1", equilibrium=ORIGIN)
    assert shifted.outcome != "proved"
    no_equilibrium = claim(("1 - x", "-y"), "region", ROUND, equilibrium=ORIGIN)
    assert no_equilibrium.outcome == "refuted"
    jumps_at_zero = claim(("-x", "-y"), "region", "max(where(y <= 0, 1, 2)*(x**2 + y**2) - 1, 0)")
    assert outcomes(jumps_at_zero)["continuous"] == "refuted"
    s = fractions(jumps_at_zero.refutation().evidence["state"])
    assert s["y"] == 0
    assert s["x"] ** 2 > Fraction(1, 2)


def test_equal_powers_of_a_limit_cycle():
    f = f"({ROUND} - 1)"
    found = claim((f"-y - x*{f}", f"x - y*{f}"), "region", f"{f}**2")
    assert found.outcome == "proved"
    assert 0.999 < found.numbers["level"] < 1.0


PENDULUM = ("v", "-sin(x) - v")
ENERGY = "2*(1 - cos(x)) + x*v/2 + v**2"


def test_sine_and_cosine_of_an_angle():
    box = ((-2.0, 2.0), (-4.0, 4.0))
    found = claim(PENDULUM, "attracts", ENERGY, box, (0, 0), 1.0, variables="x v", angles="x")
    assert found.outcome == "proved"
    for theorem, point, said in (("unstable", (0, 0), "no exact values"), ("region", (1, 0), "not zero")):
        with pytest.raises(ValueError, match=said):
            claim(PENDULUM, theorem, ENERGY, box, point, variables="x v", angles="x")


def test_v_along_an_angle_is_what_differences_say():
    what = Candidate(system(PENDULUM, "x v", angles="x"), expression(ENERGY, "x v", "x"), ((-2.0, 2.0), (-4.0, 4.0)))
    state, step = np.array([[0.7], [-0.3]]), 1e-6
    ahead = state + step * np.array([state[1], -np.sin(state[0]) - state[1]])
    now, then = (Values(what, points) for points in (state, ahead))
    assert now.V[0] == pytest.approx(2 * (1 - np.cos(0.7)) - 0.105 + 0.09)
    assert now.slope[0] == pytest.approx((then.V[0] - now.V[0]) / step, abs=1e-5)


def nested(V, core=ROUND, rates=("-x + x**3", "-y"), **more):
    return claim(rates, "region", V, core=expression(core), equilibrium=ORIGIN, **more)


@pytest.mark.slow
def test_v_that_has_no_least_value_at_the_equilibrium_leads_into_a_proved_set():
    V = f"{ROUND} + x/50 - 1/5"
    alone = claim(("-x + x**3", "-y"), "region", V.removesuffix(" - 1/5"), equilibrium=ORIGIN)
    assert alone.outcome != "proved"
    found = nested(V)
    assert found.outcome == "proved"
    # V is 1/5 less than about x^2 + y^2, which falls up to 1.
    assert 0.75 < found.numbers["level"] < 0.83
    assert 0.99 < found.numbers["core"] < 1.0
    assert "come to the equilibrium" in sentence(found)
    assert claim(("-x + x**3", "-y"), "region", V, core=expression(f"{ROUND} - 1/10")).outcome == "proved"


@pytest.mark.parametrize(
    ("V", "core", "rates"),
    leading(
        [
            # The core holds less than the zero of V; V does not decrease up to it; the core does not attract.
            (f"{ROUND} - 1/2", f"({ROUND})*(1 - 4*({ROUND}))", ("-x", "-y")),
            (f"{ROUND} - 2", ROUND, ("-x + x**3", "-y")),
            (f"{ROUND} - 1", ROUND, (f"-x*({ROUND} - 1/2)", f"-y*({ROUND} - 1/2)")),
        ]
    ),
)
def test_what_does_not_lead_into_a_proved_set_is_not_proved(V, core, rates):
    assert nested(V, core, rates).outcome != "proved"


# --- theorem 4 ------------------------------------------------------------------------------------------------------------


def test_a_square_is_an_intersection():
    found = claim(("-x", "-y"), "intersection", ("x**2 - 1", "y**2 - 1"))
    assert found.outcome == "proved"
    assert 2.9 < found.numbers["level"] < 3.0


# --- barriers -------------------------------------------------------------------------------------------------------------


def between(rates, V, unsafe=("x + y - 3",), **more):
    sets = {"start": ("1 - x**2", "1 - y**2"), "unsafe": unsafe}
    return claim(rates, "avoids", V, **{name: tuple(map(expression, own)) for name, own in sets.items()}, **more)


def test_a_barrier_parts_what_starts_from_what_is_unsafe():
    found = between(("-x", "-y"), f"{ROUND} - 3")
    assert (found.outcome, found.numbers["within"]) == ("proved", False)
    assert sentence(found) == "no motion from the start set comes to the unsafe set"
    # Where only the box holds motions back from x^2 + y^2 > 8.
    boxed = between(("-x*(8 - x**2 - y**2)", "-y*(8 - x**2 - y**2)"), f"({ROUND} - 3)*(9 - x**2 - y**2)")
    assert (boxed.outcome, boxed.numbers["within"]) == ("proved", True)
    assert "while it stays in the box" in sentence(boxed)


@pytest.mark.parametrize(
    ("rates", "V", "name"),
    [
        (("-x", "-y"), f"{ROUND} - 1.5", "start"),
        (("-x", "-y"), f"{ROUND} - 6", "unsafe"),
        (("x", "y"), f"{ROUND} - 3", "barrier"),
        (("1", "0"), f"{ROUND} - 3", "barrier"),
    ],
)
def test_a_false_barrier_is_not_proved(rates, V, name):
    found = between(rates, V)
    assert (found.outcome, found.obligations[0].name) == ("undecided", name)


# --- right-hand sides that jump ------------------------------------------------------------------------------------------


def test_sliding_to_rest():
    found = claim(("-sign(x) + y/4", "-y"), "region", ROUND, ((-1.0, 1.0), (-1.0, 1.0)), ORIGIN)
    assert found.outcome == "proved"
    assert "filippov" in found.assumptions
    assert "all motions, in Filippov's sense, that start in" in sentence(found)
    assert "Filippov" not in sentence(claim(DAMPED, "attracts", ROUND, equilibrium=ORIGIN))


# --- systems with pieces -----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_published_example_with_the_function_as_it_is_printed():
    # Without a factor of four the two halves do not meet, but at (0, 0) and (2, 0).
    below, above = "(2*x + y)**2 - 8*(x + y)", "(x - 1)**2 + y**2 - 1"
    circle = "(x**2 + y**2 - 2*x)"
    rates = (
        f"y if y <= 0 else 2*x*y if {circle} <= 0 else (x**2 + y**2)*y",
        f"-2*x - 3*y if y <= 0 else y**2 - x**2 if {circle} <= 0 else (x**2 + y**2)*(1 - x)",
    )
    box = ((-4.0, 7.0), (-9.0, 4.0))
    printed = claim(rates, "region", f"max({below} if y <= 0 else {above}, 0)", box, escape="4*x + y - x*y")
    assert outcomes(printed) == {"continuous": "refuted"}
    scaled = claim(rates, "region", f"max({below} if y <= 0 else 4*({above}), 0)", box, escape="4*x + y - x*y")
    assert scaled.outcome == "proved"
    assert scaled.numbers["level"] > 31.9
    # Without a function that escapes, motions on the circles of the upper half are not excluded.
    alone = claim(rates, "region", f"max({below} if y <= 0 else 4*({above}), 0)", box)
    assert alone.outcome == "undecided"


@pytest.mark.slow
def test_a_python_function_is_a_system():
    saturated = System.of(("x", "v"), lambda x, v: (-x, -clip(2.0 * v, 1.0)))
    V = saturated.function(lambda x, v: maximum(v * v, x * x / 2.0))
    assert prove(saturated, WantedSet("region", V, SQUARE, (0, 0), level=0.9)).outcome == "proved"
    pieces = System.of(("x", "y"), lambda x, y: (y, where(less(0.0, y), 1.0 - x, -2.0 * x - 3.0 * y)))
    wanted = WantedSet("unstable", pieces.function(lambda x, y: y), ((-0.5, 0.5), (-0.5, 0.5)), (0, 0))
    assert certify(InvariantProblem("origin", pieces, (wanted,))).outcome == "proved"
    with pytest.raises(ValueError, match="derivatives"):
        System.of(("x", "y"), lambda x, y: (y,))
