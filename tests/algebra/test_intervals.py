"""Intervals hold what exact arithmetic finds between their ends."""

import math
import operator
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from starhold.certification.spline import Intervals

finite = st.floats(-1e60, 1e60, allow_subnormal=True)
pairs = st.tuples(finite, finite).map(sorted)
shares = st.fractions(0, 1)


def between(ends, share):
    low, high = (Fraction(x) for x in ends)
    return low + share * (high - low)


def contains(interval, value):
    low, high = float(interval.low), float(interval.high)
    return (low == -math.inf or Fraction(low) <= value) and (high == math.inf or value <= Fraction(high))


@pytest.mark.parametrize("operation", [operator.add, operator.sub, operator.mul, operator.truediv])
@given(pairs, pairs, shares, shares)
def test_hold_the_exact_result_of_points_inside(operation, first, second, s, t):
    x, y = between(first, s), between(second, t)
    assume(operation is not operator.truediv or y != 0)
    assert contains(operation(Intervals(*first), Intervals(*second)), operation(x, y))
    assert contains(operation(Intervals(*first), second[0]), operation(x, Fraction(second[0]))) or second[0] == 0.0
    assert contains(operation(second[0], Intervals(*first)), operation(Fraction(second[0]), x)) if x != 0 else True


@given(pairs, shares)
def test_squares_and_roots_hold_theirs(ends, share):
    x, interval = between(ends, share), Intervals(*ends)
    assert contains(interval.square(), x * x)
    assert float(interval.square().low) >= 0.0
    assert contains(-interval, -x)
    if x >= 0:
        root = interval.sqrt()
        low, high = Fraction(float(root.low)), Fraction(float(root.high))
        assert low * low <= x <= high * high


def test_what_is_not_known_is_the_whole_line():
    over_zero = 1.0 / Intervals(-1.0, 2.0)
    assert (float(over_zero.low), float(over_zero.high)) == (-math.inf, math.inf)
    endless = Intervals(1.0, math.inf)
    lost = endless - endless
    assert (float(lost.low), float(lost.high)) == (-math.inf, math.inf)


def test_arrays_on_either_side():
    x = Intervals(np.array([1.0, 2.0]), np.array([2.0, 3.0]))
    for sum_ in (x + np.array([1.0, 1.0]), np.array([1.0, 1.0]) + x):
        assert isinstance(sum_, Intervals)
        np.testing.assert_array_less(sum_.low, [2.0 + 1e-12, 3.0 + 1e-12])
