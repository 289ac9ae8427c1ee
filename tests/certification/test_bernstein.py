"""Signs of polynomials over boxes, as the checker finds them."""

import math

import numpy as np
from flint import fmpq
from hypothesis import assume, given
from hypothesis import strategies as some

from starhold.algebra.polynomial import Polynomial
from starhold.checker import bernstein as bounds
from starhold.checker.exact import rational

UNIT = some.floats(-1.0, 1.0)
POLYNOMIALS = some.dictionaries(
    some.tuples(some.integers(0, 3), some.integers(0, 2)), some.integers(-9, 9), min_size=1, max_size=7
)


def two_variables(terms):
    return Polynomial({("x",) * i + ("y",) * j: fmpq(c) for (i, j), c in terms.items()})


@given(POLYNOMIALS, POLYNOMIALS, some.integers(-5, 4), some.integers(1, 4))
def test_what_is_negative_by_its_coefficients_is(fall, room, low, width):
    polynomials = two_variables(fall), two_variables(room)
    box = {"x": (fmpq(low, 2), fmpq(low + width, 2)), "y": (fmpq(-1), fmpq(1, 3))}
    x, y = np.meshgrid(np.linspace(low / 2.0, (low + width) / 2.0, 61), np.linspace(-1.0, 1.0 / 3.0, 61))
    values = [np.zeros_like(x) + sum(float(int(c)) * x**i * y**j for (i, j), c in p.items()) for p in (fall, room)]
    most = values[0][values[1] >= 0.0].max(initial=-math.inf)
    if bounds.negative_where(*polynomials, box):
        assert most < 0.0
    # What is clearly negative, also a little beyond the border of room, is found to be.
    beyond = values[0][values[1] >= -0.05].max(initial=-math.inf)
    assume(beyond < -0.05)
    assert bounds.negative_where(*polynomials, box)


@given(POLYNOMIALS, some.integers(-5, 4), some.integers(1, 4), UNIT, UNIT)
def test_halves_have_the_coefficients_of_halves(terms, low, width, x, y):
    found = two_variables(terms)
    middle = fmpq(2 * low + width, 2)
    whole = {"x": (fmpq(low), fmpq(low + width)), "y": (fmpq(-1), fmpq(1))}
    left = whole | {"x": (fmpq(low), middle)}
    ends = bounds.bernstein(found, whole, [3, 2])
    assert ends[0, 0] == found.at({"x": fmpq(low), "y": fmpq(-1)})
    assert ends[-1, -1] == found.at({"x": fmpq(low + width), "y": fmpq(1)})
    at = found.at({"x": fmpq(low) + rational(0.5 * x + 0.5) * width, "y": rational(y)})
    assert ends.min() <= at <= ends.max()
    # In whole numbers that may only be too large, by less than one for each average.
    scaled = bounds.bernstein(found * 1024, whole, [3, 2])
    rows = np.array([[int(c.ceil()) for c in row] for row in scaled], dtype=np.int64)[None, None]
    half = bounds.halves(np.concatenate([rows, rows], axis=1), 2)[0, 0]
    wanted = bounds.bernstein(found * 1024, left, [3, 2])
    excess = [int(a) - b for a, b in zip(half.flat, wanted.flat, strict=True)]
    assert all(0 <= e <= 4 for e in excess)


def test_one_variable():
    x = Polynomial.variable("x")
    assert bounds.positive_on(x * x - x + fmpq(26, 100), "x", fmpq(0), fmpq(1))
    assert not bounds.positive_on(x * x - x + fmpq(1, 4), "x", fmpq(0), fmpq(1))
    assert not bounds.positive_on(x, "x", fmpq(0), fmpq(1))
