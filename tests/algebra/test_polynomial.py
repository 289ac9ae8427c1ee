"""Exact polynomials against SymPy, and the splitting into cases."""

from fractions import Fraction

import pytest
import sympy
from flint import arb, fmpq
from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.polynomial import Cases, Polynomial, constants, exact, jointly, pieces
from starhold.algebra.scalar import absolute, both, clip, less, maximum, sign, sqrt, where
from starhold.algebra.vector import solve

NAMES = ("x", "y", "z")
number = st.floats(-8.0, 8.0, allow_subnormal=False)


@st.composite
def pair(draw, depth=3):
    """The same expression as a polynomial and in SymPy."""
    kind = draw(st.sampled_from(["name", "number"] if depth == 0 else ["name", "number", "+", "-", "*", "/", "neg"]))
    if kind == "name":
        name = draw(st.sampled_from(NAMES))
        return Polynomial.variable(name), sympy.Symbol(name)
    if kind == "number":
        value = draw(number)
        return Polynomial.constant(value), sympy.Rational(Fraction(value))
    p, s = draw(pair(depth - 1))
    if kind == "neg":
        return -p, -s
    if kind == "/":
        value = draw(number.filter(lambda v: abs(v) > 0.1))
        return p / value, s / sympy.Rational(Fraction(value))
    q, t = draw(pair(depth - 1))
    return {"+": (p + q, s + t), "-": (p - q, s - t), "*": (p * q, s * t)}[kind]


def as_sympy(polynomial):
    return sum(
        (sympy.Rational(int(c.p), int(c.q)) * sympy.Mul(*(sympy.Symbol(n) for n in m)) for m, c in polynomial.terms.items()),
        sympy.Integer(0),
    )


@given(pair(), st.tuples(number, number, number))
def test_arithmetic_derivatives_and_values_are_those_of_sympy(both_readings, point):
    p, s = both_readings
    assert sympy.expand(as_sympy(p) - s) == 0
    for name in NAMES:
        assert sympy.expand(as_sympy(p.slope(name)) - sympy.diff(s, sympy.Symbol(name))) == 0
    values = dict(zip(NAMES, map(exact, point), strict=True))
    expected = sympy.sympify(s).subs({n: sympy.Rational(Fraction(v)) for n, v in zip(NAMES, point, strict=True)})
    found = p.at(values)
    assert sympy.Rational(int(found.p), int(found.q)) == expected


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_what_has_no_exact_value_is_refused(value):
    with pytest.raises(ValueError, match="no exact value"):
        exact(value)


@given(st.floats(-3.0, 3.0), st.floats(0.1, 2.0))
def test_the_cases_of_a_clip_cover_all_and_agree_with_it(x, limit):
    found = clip(Polynomial.variable("x"), Polynomial.constant(limit))
    holding = [case for case in pieces(found) if holds(case.truths, {"x": exact(x)})]
    assert len(holding) == 1
    assert holding[0].value.at({"x": exact(x)}) == exact(clip(x, limit))


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_products_of_cases(x, y):
    point = {"x": exact(x), "y": exact(y)}
    found = sign(Polynomial.variable("x")) * clip(Polynomial.variable("y"), 1.0) + Polynomial.variable("x")
    assert isinstance(found, Cases)
    assert len(pieces(found)) == 9
    values = [case.value.at(point) for case in pieces(found) if holds(case.truths, point)]
    # At x = 0 the sign is x itself, which is zero.
    assert values == [exact(sign(x)) * exact(clip(y, 1.0)) + exact(x)]
    together = [parts for truths, parts in jointly([found, found]) if holds(truths, point)]
    assert len(together) == 1
    assert len(jointly([found, found])) == 9


def holds(truths, point):
    return all((condition.positive.at(point) > 0) == truth for condition, truth in truths)


def test_comparisons_of_constants_are_decided():
    two, three = Polynomial.constant(2), Polynomial.constant(3)
    assert less(two, three) is True
    assert less(three, two) is False
    assert maximum(two, three).value == 3
    assert where(less(two, three), Polynomial.variable("x"), 0.0).variables() == {"x"}
    with pytest.raises(ValueError, match="undecided"):
        less(Polynomial.constant(arb(0, 1)), 0.0)


def test_constants_reach_into_tuples_and_vectors_are_solved_exactly():
    matrix = constants(((2.0, 0.1, 0.0), (0.1, 3.0, 0.2), (0.0, 0.2, 4.0)))
    x = solve(matrix, constants((1.0, 0.0, 0.0)))
    back = [sum((m[i] * x[i] for i in range(3)), Polynomial({})) for m in matrix]
    assert [part.value for part in back] == [1, 0, 0]


def test_what_a_polynomial_cannot_do_is_said():
    x = Polynomial.variable("x")
    with pytest.raises(TypeError, match="square root"):
        sqrt(x)
    with pytest.raises(TypeError, match="constants only"):
        1.0 / x
    with pytest.raises(TypeError, match="not joined"):
        both(less(x, 0.0), less(0.0, x))
    assert (x - x).value == fmpq(0)


def test_piecewise_polynomials_are_compared_piece_by_piece():
    x = Polynomial.variable("x")
    # max(|x| - 1, x - 2, 0)
    value = maximum(maximum(absolute(x) - 1, x - 2), 0)
    for number, wanted in ((-3, 2), (-1, 0), (0, 0), (1, 0), (5, 4)):
        at = {"x": exact(number)}
        found = {c.value.at(at) for c in pieces(value) if all((k.positive.at(at) > 0) == t for k, t in c.truths)}
        assert found == {exact(wanted)}
    assert where(less(sign(x), 2.0), 1, 0).pieces
