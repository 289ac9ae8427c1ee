"""Roots, powers, exponentials, logarithms and the functions of angles are computed by arithmetic alone.

Each is an equation over the operations of `scalar` and `words`, so floats and every compiled form give the same bits. Errors
are stated in units in the last place of the result, and measured by `tests/algebra/test_elementary.py`. NaN gives NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from math import factorial
from typing import Any

from starhold.algebra.circular import COSINE, nearest, quartered, series
from starhold.algebra.operations import library, whole
from starhold.algebra.pairs import Pair, plus, product_of, quotient, sum_of, times, upper_half
from starhold.algebra.scalar import Scalar, Truth, absolute, both, clip, divide, either, less, less_equal, side, where
from starhold.algebra.words import (
    bits_of,
    lowest_bit,
    number_in,
    rotate_left,
    shift_right,
    whole_word,
    with_bits,
    word_and,
    word_or,
)

_LOGARITHM = Fraction("0.693147180559945309417232121458176568")
_QUARTER = Fraction("1.57079632679489661923132169163975144209858469968755291048747229615390820314310449931401741267105853")
"""The logarithm of 2, and half of pi."""
_HIGH = round(_LOGARITHM * 2**40) / 2**40
_LOW = float(_LOGARITHM - Fraction(_HIGH))
"""The logarithm of 2 in two parts; the first times a whole number of up to ten bits is exact."""
FASTEST = 2.0**30
"""The largest angle (rad) that has a sine."""
_SMALL, _LARGE = 2.0**-1022, 1.7976931348623157e308
_TINY = 2.0**-30


def _pair(number: Fraction) -> tuple[float, float]:
    return float(number), float(number - Fraction(float(number)))


def _shares(count: int, bits: int, number: Fraction) -> tuple[float, ...]:
    """Split a number into `count` floats whose sum it is, each of `bits` bits except the last."""
    shares: list[float] = []
    for place in range(1, count):
        scale = 1 << bits * place
        shares.append(float(Fraction(math.floor(number * scale), scale)))
        number -= Fraction(shares[-1])
    return (*shares, float(number))


_GROWTH = tuple(float(Fraction(1, factorial(n))) for n in range(1, 14))
_QUARTERS = _shares(6, 23, _QUARTER)
_SINE = tuple(float(Fraction((-1) ** n, factorial(2 * n + 1))) for n in range(1, 10))
_TURN, _HALF, _EIGHTH = (_pair(part * _QUARTER) for part in (Fraction(2), Fraction(1), Fraction(1, 2)))
_ARC = _pair(Fraction("0.463647609000806116214256231461214402"))
"""Angles in two parts: half a turn, a quarter, an eighth, and atan(1/2)."""
_ARCTANGENT = tuple((-1.0) ** n / (2 * n + 1) for n in range(1, 15))
_LOGARITHMIC = tuple(2.0 / (2 * n + 1) for n in range(1, 12))
_THIRD = _pair(Fraction(1, 3))
_FIFTHS = tuple(1.0 / (2 * n + 1) for n in range(2, 13))


def _power_of_two(exponent: Scalar) -> Scalar:
    """Return 2^exponent for an integer exponent from -1022 to 1023."""
    # The exponent of a double stands above its fraction of 52 bits.
    return with_bits(rotate_left(whole_word(exponent + 1023.0), 52))


def _scaled(x: Scalar, exponent: Scalar) -> Scalar:
    """Return 2^exponent x, rounded once, for |exponent| up to 2000."""
    first = nearest(0.5 * exponent)
    return (x * _power_of_two(first)) * _power_of_two(exponent - first)


def _binary(x: Scalar) -> tuple[Scalar, Scalar]:
    """Return e and m with x = 2^e m and 1 <= m < 2, for positive x."""
    small = less(x, _SMALL)
    bits = bits_of(where(small, x * 2.0**54, x))
    exponent = number_in(shift_right(bits, 52)) - where(small, 1077.0, 1023.0)
    return exponent, with_bits(word_or(word_and(bits, (1 << 52) - 1), 0x3FF << 52))


def _inside(x: Scalar) -> Truth:
    """Tell whether a number is positive and finite."""
    return both(less(0.0, x), less_equal(x, _LARGE))


def _is_negative(x: Scalar) -> Truth:
    """Tell whether the sign bit is set, for zero too."""
    return lowest_bit(shift_right(bits_of(x), 63))


def _split(x: Scalar, low: Scalar | None = None) -> tuple[Scalar, Scalar]:
    """Return an integer k and the remainder x + low - k log 2."""
    power = nearest(x * float(1 / _LOGARITHM))
    less_of_it = power * _LOW
    return power, (x - power * _HIGH) - (less_of_it if low is None else less_of_it - low)


def _raised(x: Scalar, low: Scalar | None = None) -> Scalar:
    """Return e^(x + low) for |x| up to 800."""
    power, rest = _split(x, low)
    return _scaled(series((1.0, *_GROWTH), rest), power)


def _symbolic(name: str) -> Callable[..., Any]:
    def call(*values: Any) -> Any:
        return getattr(library("sympy"), name)(*values)

    return call


@whole(_symbolic("exp"), lambda x: exp(x))
def exp(x: Scalar) -> Scalar:
    """Return e^x, to 1.2 units; 0 below -746, infinite above 709.79."""
    return _raised(clip(x, 800.0))


@whole(_symbolic("tanh"), lambda x: 1.0 - tanh(x) * tanh(x))
def tanh(x: Scalar) -> Scalar:
    """Return the hyperbolic tangent, to 3.5 units; 1 and -1 at infinity."""
    size = absolute(x)
    power, rest = _split(2.0 * clip(size, 20.0))
    raised = _power_of_two(power)
    # e^(2 |x|) - 1.
    growth = raised * (rest * series(_GROWTH, rest)) + (raised - 1.0)
    return where(less(size, _TINY), x, side(x) * growth / (growth + 2.0))


def _near_one(x: Scalar) -> tuple[Scalar, Scalar]:
    """Return e and f with x = 2^e (1 + f), and 1 + f between the roots of 1/2 and 2."""
    exponent, m = _binary(x)
    high = less(math.sqrt(2.0), m)
    return where(high, exponent + 1.0, exponent), where(high, 0.5 * m, m) - 1.0


@whole(_symbolic("log"), lambda x: 1.0 / x)
def log(x: Scalar) -> Scalar:
    """Return the natural logarithm, to 1 unit; minus infinity at 0, NaN for negative numbers."""
    inside = _inside(x)
    exponent, f = _near_one(where(inside, x, 1.0))
    s = f / (2.0 + f)
    square, half = s * s, 0.5 * f * f
    # log(1 + f) = 2 atanh(s) = f - f^2/2 + s (f^2/2 + R).
    rest = s * (half + square * series(_LOGARITHMIC, square)) + exponent * _LOW
    result = exponent * _HIGH - ((half - rest) - f)
    return where(inside, result, where(less(0.0, x), x, where(less_equal(0.0, x), -math.inf, math.nan)))


def _precise_log(x: Scalar) -> Pair:
    """Return the logarithm of a positive number to 64 bits."""
    exponent, f = _near_one(x)
    below = 2.0 + f
    s = quotient(f, (below, f - (below - 2.0)))
    square = times(s, s)
    more, error = sum_of(_THIRD[0], square[0] * series(_FIFTHS, square[0]))
    cubed = times(s, times(square, (more, error + _THIRD[1])))
    small, error = plus(s, cubed)
    return plus((exponent * _HIGH, exponent * _LOW), (2.0 * small, 2.0 * error))


@whole(_symbolic("Pow"), lambda x, p: p * power(x, p - 1.0), lambda x, p: log(x) * power(x, p))  # pyright: ignore[reportUnknownLambdaType]
def power(x: Scalar, p: Scalar) -> Scalar:
    """Return x^p for x from 0 on, to 1.2 units; 1 for p = 0, NaN for negative x."""
    inside, p = _inside(x), clip(p, 2.0**65)
    logarithm = _precise_log(where(inside, x, 1.0))
    exponent, error = product_of(logarithm[0], p)
    low = where(less(absolute(exponent), 800.0), error + logarithm[1] * p, 0.0)
    result = _raised(clip(exponent, 800.0), low)
    end = where(less(p, 0.0), divide(1.0, x + 0.0), where(less(0.0, p), x + 0.0, p + 1.0))
    return where(inside, result, where(less_equal(0.0, x), end, math.nan))


@whole(
    lambda x: library("sympy").sign(x) * library("sympy").cbrt(library("sympy").Abs(x)),
    lambda x: divide(1.0, 3.0 * cbrt(x) * cbrt(x)),
)
def cbrt(x: Scalar) -> Scalar:
    """Return the cube root, negative for negative x, to 1 unit."""
    size = absolute(x)
    inside = _inside(size)
    exponent, m = _binary(where(inside, size, 1.0))
    third = nearest(exponent / 3.0)
    # The scaled argument lies between 1/2 and 4.
    a = m * _power_of_two(exponent - 3.0 * third)
    root = 0.5606 + a * (0.4906 - 0.0585 * a)
    for _ in range(2):
        cube = root * root * root
        root = root * ((cube + 2.0 * a) / (2.0 * cube + a))
    # The square of a root of 26 bits is exact.
    root = upper_half(root)
    over = a / (root * root)
    root = root + root * ((over - root) / (2.0 * root + over))
    return where(inside, side(x) * root * _power_of_two(third), x)


def _turned(x: Scalar) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of an angle (rad)."""
    inside = less_equal(absolute(x), FASTEST)
    x = where(inside, x, math.nan)
    whole_quarters = nearest(x * float(1 / _QUARTER))
    rest, error = x - whole_quarters * _QUARTERS[0], 0.0
    for share in _QUARTERS[1:-1]:
        rest, more = sum_of(rest, -(whole_quarters * share))
        error = error + more
    error = error - whole_quarters * _QUARTERS[-1]
    square = rest * rest
    half = 0.5 * square
    most = 1.0 - half
    cosine = most + (((1.0 - most) - half) + (square * square * series(COSINE[2:], square) - rest * error))
    sine = rest + (error * most + rest * (square * series(_SINE, square)))
    return quartered(whole_quarters - 4.0 * nearest(0.25 * whole_quarters), cosine, sine)


@whole(_symbolic("cos"), lambda x: -sin(x))
def cos(x: Scalar) -> Scalar:
    """Return the cosine of an angle (rad), to 1 unit; NaN beyond 2^30 rad."""
    return _turned(x)[0]


@whole(_symbolic("sin"), lambda x: cos(x))
def sin(x: Scalar) -> Scalar:
    """Return the sine of an angle (rad), to 1 unit; NaN beyond 2^30 rad."""
    return where(less(absolute(x), _TINY), x, _turned(x)[1])


@whole(_symbolic("atan2"), lambda y, x: x / (x * x + y * y), lambda y, x: -y / (x * x + y * y))
def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Return the angle (rad) from the first axis to (x, y), to 1 unit, with the sign of y; zeros and infinities as in C."""
    across, along = absolute(y) + 0.0, absolute(x) + 0.0
    steep = less(along, across)
    small, large = where(steep, along, across), where(steep, across, along)
    # Two infinities count as equal numbers, and two zeros give angle zero; NaN stays.
    endless = less(_LARGE, large)
    small = where(endless, where(less(_LARGE, small), 1.0, 0.0 * small), small)
    large = where(either(endless, less_equal(large, 0.0)), 1.0, large)
    ratio = small / large
    exponent, _ = _binary(where(_inside(large), large, 1.0))
    a, b = _scaled(large, -exponent), _scaled(small, -exponent)
    # atan(b/a) = atan(c) + atan((b - c a)/(a + c b)) for c = 0, 1/2, 1.
    middle, high = less(0.25 * a, b), less(0.75 * a, b)
    u, error = quotient(
        b - where(high, a, where(middle, 0.5 * a, 0.0)), sum_of(a, where(high, b, where(middle, 0.5 * b, 0.0)))
    )
    first, more = (where(high, e, where(middle, m, 0.0)) for e, m in zip(_EIGHTH, _ARC, strict=True))
    square = u * u
    angle = plus((first, more), (u, error + u * (square * series(_ARCTANGENT, square))))
    tiny = less(ratio, _TINY)
    angle = _where(tiny, (ratio, 0.0), angle)
    angle = _where(steep, plus(_HALF, (-angle[0], -angle[1])), angle)
    angle = _where(_is_negative(x), plus(_TURN, (-angle[0], -angle[1])), angle)
    result = angle[0] + angle[1]
    return where(_is_negative(y), -result, result)


def _where(truth: Truth, a: Pair, b: Pair) -> Pair:
    return where(truth, a[0], b[0]), where(truth, a[1], b[1])
