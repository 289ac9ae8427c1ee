"""The scalar operations mean the same to every reader."""

import decimal
import itertools
import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.scalar import (
    absolute,
    both,
    clip,
    either,
    is_finite,
    less,
    maximum,
    minimum,
    opposite,
    side,
    sign,
    sqrt,
    where,
)
from tests.algebra.balls import UNDECIDED, Ball
from tests.algebra.readers import anything, contains, numbers, same

TRUTHS = (True, False, UNDECIDED)


@given(anything, anything)
def test_floats_mean_what_the_names_say(x, y):
    assert less(x, y) is (x < y)
    assert is_finite(x) is math.isfinite(x)
    if not math.isnan(x):
        assert absolute(x) == abs(x)
        assert sign(x) == (x > 0.0) - (x < 0.0)
        if not math.isnan(y):
            assert minimum(x, y) == min(x, y)
            assert maximum(x, y) == max(x, y)
            assert clip(x, abs(y)) == max(-abs(y), min(abs(y), x))
    assert side(x) == (-1.0 if x < 0.0 else 1.0)


def test_not_a_number():
    for operation in (absolute, sign, sqrt):
        assert math.isnan(operation(math.nan))
    assert math.isnan(clip(math.nan, 1.0))
    assert side(math.nan) == 1.0
    assert is_finite(math.nan) is False
    assert is_finite(math.inf) is False
    assert is_finite(-math.inf) is False
    assert is_finite(1.7976931348623157e308) is True
    # Only a NaN in the second place is seen.
    assert math.isnan(minimum(1.0, math.nan))
    assert math.isnan(maximum(1.0, math.nan))
    assert minimum(math.nan, 1.0) == 1.0
    assert maximum(math.nan, 1.0) == 1.0


def test_square_root_outside_its_domain():
    assert math.isnan(same(sqrt, -1.0))
    assert math.isnan(same(sqrt, -math.inf))
    assert same(sqrt, math.inf) == math.inf
    assert math.copysign(1.0, same(sqrt, -0.0)) == -1.0
    assert not sqrt(Ball(-1)).arb.is_finite()
    assert sqrt(sympy.Integer(-1)) == sympy.I


def completions(truth):
    return (True, False) if truth is UNDECIDED else (truth,)


def known(values):
    """The truth that holds whatever the undecided ones are, or that it is undecided."""
    values = set(values)
    return values.pop() if len(values) == 1 else UNDECIDED


@pytest.mark.parametrize(("a", "b"), list(itertools.product(TRUTHS, TRUTHS)))
def test_three_valued_tables(a, b):
    pairs = list(itertools.product(completions(a), completions(b)))
    assert both(a, b) is known(p and q for p, q in pairs)
    assert either(a, b) is known(p or q for p, q in pairs)
    assert opposite(a) is known(not p for p in completions(a))


def test_undecided_comparison_gives_the_hull():
    wide = Ball(1.0, 0.5)
    assert less(wide, Ball(1.25)) is UNDECIDED
    assert less(wide, Ball(2.0)) is True
    assert less(wide, Ball(0.25)) is False
    # An exact tie is decided, a tie at the edge of a ball is not.
    assert less(Ball(1), Ball(1)) is False
    assert less(wide, wide) is UNDECIDED
    hull = where(less(wide, 1.25), -3.0, 7.0)
    assert contains(hull, -3.0)
    assert contains(hull, 7.0)
    assert contains(where(UNDECIDED, 1.0, 2.0), 1.5)
    assert where(less(wide, 2.0), Ball(5), Ball(9)).arb == 5
    assert is_finite(Ball("nan")) is not True
    assert is_finite(Ball("inf")) is not True
    assert is_finite(Ball(3)) is True


def inside(x, dx, u):
    """A point of the ball with centre x and radius dx; u = +-1 gives its ends, moved inwards by the rounding."""
    return min(max(x + dx * u, math.nextafter(x - dx, math.inf)), math.nextafter(x + dx, -math.inf)) if dx else x


shares = st.floats(-1.0, 1.0)
radii = st.just(0.0) | st.floats(1e-6, 10.0)


@given(numbers, numbers, radii, radii, shares, shares)
def test_a_ball_encloses_the_value_at_each_of_its_points(x, y, dx, dy, u, v):
    wide_x, wide_y = Ball(x, dx), Ball(y, dy)
    at_x, at_y = Ball(inside(x, dx, u)), Ball(inside(y, dy, v))
    assert contains(wide_x, at_x)
    assert contains(wide_y, at_y)
    for operation in (absolute, sign, side):
        assert contains(operation(wide_x), operation(at_x)), operation
    for operation in (minimum, maximum):
        assert contains(operation(wide_x, wide_y), operation(at_x, at_y)), operation
    assert contains(clip(wide_x, absolute(wide_y)), clip(at_x, absolute(at_y)))
    assert less(wide_x, wide_y) in (UNDECIDED, less(at_x, at_y))


def test_numpy_scalars_are_plain_numbers():
    x = np.float64(2.0)
    assert clip(x, 1.0) == 1.0
    assert maximum(1.0, x) == 2.0
    assert less(x, 3.0) is True
    assert both(less(x, 3.0), less(x, 1.0)) is False
    assert is_finite(x) is True


@settings(max_examples=10)
@given(numbers)
def test_other_kinds_of_numbers_are_refused(x):
    for stranger in (decimal.Decimal(x), complex(x), str(x), np.array([x])):
        with pytest.raises(TypeError, match="no reader"):
            sqrt(stranger)
        with pytest.raises(TypeError, match="no reader"):
            less(x, stranger)
