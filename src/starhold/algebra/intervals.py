"""Interval arithmetic works on whole arrays of boxes: every answer encloses the exact one, as balls do, a few million a
second.

IEEE sums, products, quotients and square roots are the float nearest to the exact value, so that the next float outward
bounds it, and so does any beyond. NaN (an infinity less itself, say) becomes the whole line.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
_SHARE, _LEAST = 2.0**-52, 5e-324
"""|x| _SHARE + _LEAST is at least the distance from x to the next float, for normal and subnormal numbers."""


class Intervals:
    """The arrays hold intervals low <= high of one shape, which arithmetic broadcasts."""

    __slots__ = ("high", "low")
    # NumPy arrays on the left leave the operation to this class.
    __array_ufunc__ = None

    def __init__(self, low: ArrayLike, high: ArrayLike | None = None) -> None:
        self.low: Array = np.asarray(low, dtype=float)
        self.high: Array = self.low if high is None else np.asarray(high, dtype=float)

    def __add__(self, other: Any) -> Intervals:
        b = _read(other)
        return _outward(self.low + b.low, self.high + b.high)

    __radd__ = __add__

    def __neg__(self) -> Intervals:
        return Intervals(-self.high, -self.low)

    def __sub__(self, other: Any) -> Intervals:
        b = _read(other)
        return _outward(self.low - b.high, self.high - b.low)

    def __rsub__(self, other: Any) -> Intervals:
        return _read(other) - self

    def __mul__(self, other: Any) -> Intervals:
        b = _read(other)
        if b.low is b.high:
            return _hull(np.multiply, self, b.low, b.low)
        return _hull(np.multiply, self, b.low, b.high)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Intervals:
        """Return the whole line where the divisor may be zero."""
        b = _read(other)
        quotient = _hull(np.divide, self, b.low, b.high)
        around = (b.low <= 0.0) & (b.high >= 0.0)
        return Intervals(np.where(around, -np.inf, quotient.low), np.where(around, np.inf, quotient.high))

    def __rtruediv__(self, other: Any) -> Intervals:
        return _read(other) / self

    def square(self) -> Intervals:
        """Return x x, which is tighter than the product of two intervals."""
        size, least = np.maximum(-self.low, self.high), np.maximum(np.maximum(self.low, -self.high), 0.0)
        squares = _outward(least * least, size * size)
        return Intervals(np.maximum(squares.low, 0.0), squares.high)

    def sqrt(self) -> Intervals:
        """Return the square root of the part of the interval that is not negative."""
        roots = _outward(np.sqrt(np.maximum(self.low, 0.0)), np.sqrt(np.maximum(self.high, 0.0)))
        return Intervals(np.maximum(roots.low, 0.0), roots.high)

    def clipped(self, low: float, high: float) -> Intervals:
        """Return the intersection with low .. high, for numbers that are known to lie there."""
        return Intervals(np.clip(self.low, low, high), np.clip(self.high, low, high))


def _read(value: Any) -> Intervals:
    return value if isinstance(value, Intervals) else Intervals(value)


def _outward(low: Array, high: Array) -> Intervals:
    # By at least the distance to the next float, in a fraction of nextafter's time; infinities may become NaN.
    with np.errstate(invalid="ignore", over="ignore", under="ignore"):
        low = low - (np.abs(low) * _SHARE + _LEAST)
        high = high + (np.abs(high) * _SHARE + _LEAST)
    return Intervals(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def _hull(operation: Callable[[Any, Any], Any], a: Intervals, low: Array, high: Array) -> Intervals:
    """Return the hull of the operation's values at the ends, where a monotonic operation has its extremes."""
    with np.errstate(all="ignore"):
        ends = [operation(x, y) for x in (a.low, a.high) for y in ((low,) if low is high else (low, high))]
    least, most = ends[0], ends[0]
    for end in ends[1:]:
        least, most = np.minimum(least, end), np.maximum(most, end)
    return _outward(least, most)
