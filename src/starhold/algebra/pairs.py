"""Sums, products and quotients with their rounding errors: a pair of numbers stands for their exact sum.

They are valid where nothing overflows and no product comes near underflow (Dekker 1971; Knuth, The Art of Computer
Programming, 4.2.2).
"""

from __future__ import annotations

from typing import TypeAlias

from starhold.algebra.scalar import Scalar, divide

Pair: TypeAlias = tuple[Scalar, Scalar]
"""A number and its correction: their exact sum is meant."""


def sum_of(a: Scalar, b: Scalar) -> Pair:
    """Return a + b and its rounding error."""
    total = a + b
    kept = total - a
    return total, (a - (total - kept)) + (b - kept)


def upper_half(a: Scalar) -> Scalar:
    """Return a number rounded to 26 bits, so that its square is exact."""
    spread = 134217729.0 * a
    return spread - (spread - a)


def product_of(a: Scalar, b: Scalar) -> Pair:
    """Return a b and its rounding error."""
    total, upper, other = a * b, upper_half(a), upper_half(b)
    low, other_low = a - upper, b - other
    return total, ((upper * other - total) + upper * other_low + low * other) + low * other_low


def times(a: Pair, b: Pair) -> Pair:
    """Return the product of two pairs, to about 100 bits."""
    total, error = product_of(a[0], b[0])
    return total, error + (a[0] * b[1] + a[1] * b[0])


def plus(a: Pair, b: Pair) -> Pair:
    """Return the sum of two pairs, to about 100 bits of the larger."""
    total, error = sum_of(a[0], b[0])
    return total, error + (a[1] + b[1])


def quotient(a: Scalar, b: Pair) -> Pair:
    """Return a divided by a pair, to about 100 bits; infinite or NaN where the pair is zero."""
    first = divide(a, b[0])
    total, error = product_of(first, b[0])
    return first, divide(((a - total) - error) - first * b[1], b[0])
