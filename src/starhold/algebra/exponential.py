"""The exponential function is computed by arithmetic alone, for equations, which have no library."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

from starhold.algebra.circular import nearest
from starhold.algebra.scalar import Scalar, clip
from starhold.algebra.words import rotate_left, whole_word, with_bits

_LOGARITHM = Fraction("0.693147180559945309417232121458176568")
_HIGH = round(_LOGARITHM * 2**40) / 2**40
_LOW = float(_LOGARITHM - Fraction(_HIGH))
"""The logarithm of 2 in two parts; the first times a whole number of up to ten bits is exact."""
_SERIES = tuple(float(Fraction(1, factorial(n))) for n in range(14))
_MOST = 700.0


def exponential(x: Scalar) -> Scalar:
    """Return e^x with a relative error below 4e-16, for x clipped to [-700, 700]."""
    within = clip(x, _MOST)
    power = nearest(within * float(1 / _LOGARITHM))
    rest = (within - power * _HIGH) - power * _LOW
    series = _SERIES[-1]
    for term in _SERIES[-2::-1]:
        series = series * rest + term
    # The exponent of a double stands above its fraction of 52 bits.
    return series * with_bits(rotate_left(whole_word(power + 1023.0), 52))
