"""Cosine and sine are computed by arithmetic alone, for equations that need the angle turned since the start."""

from __future__ import annotations

from fractions import Fraction
from math import factorial, tau

from starhold.algebra.dual import Dual
from starhold.algebra.scalar import Scalar, absolute, less, side, where

SHIFT = 1.5 * 2.0**52
"""Adding this constant rounds a number: doubles of this size are integers."""
COSINE = tuple(float(Fraction((-1) ** n, factorial(2 * n))) for n in range(9))
_SINE = tuple(float(Fraction((-1) ** n, factorial(2 * n + 1))) for n in range(8))
"""Taylor coefficients, truncated so that the remainder is below 2^-54 up to an eighth of a turn."""


def nearest(x: Scalar) -> Scalar:
    """Return the integer nearest to x, ties to even, for |x| < 2^51."""
    # Rounding has zero slope, although the sum that performs it has slope one.
    x = x.value if isinstance(x, Dual) else x
    return (x + SHIFT) - SHIFT


def cosine_sine(turns: Scalar) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of an angle in turns, below 2^49 turns in size, with errors below 3e-16."""
    quarters = 4.0 * (turns - nearest(turns))
    whole = nearest(quarters)
    angle = (0.25 * tau) * (quarters - whole)
    square = angle * angle
    return quartered(whole, series(COSINE, square), angle * series(_SINE, square))


def quartered(whole: Scalar, cosine: Scalar, sine: Scalar) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of an angle plus `whole` quarter turns, from -2 to 2, given cosine and sine of the angle."""
    # Two quarter turns change both signs; one exchanges cosine and sine.
    size, sense = absolute(whole), side(whole)
    odd, half = less(absolute(size - 1.0), 0.5), less(1.5, size)
    turned = where(half, -1.0, 1.0)
    return where(odd, -sense * sine, turned * cosine), where(odd, sense * cosine, turned * sine)


def series(c: tuple[float, ...], x: Scalar) -> Scalar:
    """Return c[0] + c[1] x + c[2] x^2 + ..."""
    total = c[-1]
    for term in c[-2::-1]:
        total = total * x + term
    return total
