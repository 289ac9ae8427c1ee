"""Bounds of the rate and of the acceleration of a target that follows a rotation spline, over all of its time.

Between two knots the attitude is q_k exp(phi) with a rotation vector phi(s) = a s + b s^2 + c s^3, s = (t - t_k)/h, that
ends at the next knot and gives the rates of both. With x = |phi|^2, k1 = (1 - cos |phi|)/x, k2 = (|phi| - sin |phi|)/|phi|^3

    rate = phi' - k1 phi x phi' + k2 phi x (phi x phi').

Floats guess the peaks; that nothing exceeds them by much is shown by intervals on ever smaller parts of each stretch.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from flint import arb, ctx, fmpq
from numpy.typing import ArrayLike, NDArray

from starhold.algebra.polynomial import exact
from starhold.algebra.quaternion import relative
from starhold.algebra.vector import add, cross, dot, scale, subtract
from starhold.certification.matrices import number
from starhold.parts.targets.history import Knots

Array: TypeAlias = NDArray[np.float64]
_SHARE, _LEAST = 2.0**-52, 5e-324
"""|x| _SHARE + _LEAST is at least the distance from x to the next float, for normal and subnormal numbers."""


class Intervals:
    """The arrays hold intervals low <= high of one shape, which arithmetic broadcasts: every answer encloses the exact one.

    IEEE sums, products, quotients and square roots are the float nearest to the exact value, so that the next float outward
    bounds it, and so does any beyond. NaN (an infinity less itself, say) becomes the whole line."""

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


BITS = 192
POINTS = 17
"""The number of points on each stretch at which peaks are guessed."""
MOST = 4_000_000
"""The most parts of stretches in one proof."""
MARGINS = (1.01, 1.1, 2.0, 10.0)
BESIDE = 1e-3
"""The bound of the acceleration has this much room in addition to a share of the peak, in squares of the rate: a uniform
rotation has no acceleration at all."""


def spline_bounds(knots: Knots) -> tuple[Any, Any]:
    """Rationals, exactly floats, that rate (rad/s) and acceleration (rad/s2) do not exceed; ArithmeticError where none are
    shown."""
    spans = np.diff(knots.times)
    with ctx.workprec(BITS):
        cubics = [_cubic(knots, k) for k in range(len(spans))]
    turns = [k for k, cubic in enumerate(cubics) if any(not x.is_zero() for v in cubic for x in v)]
    if not turns:
        return fmpq(0), fmpq(0)
    cubic = tuple(tuple(_enclosing([cubics[k][i][j] for k in turns]) for j in range(3)) for i in range(3))
    times = Intervals(knots.times)
    lengths = Intervals(times.low[1:][turns]) - Intervals(times.low[:-1][turns])
    rate, acceleration = _peaks(cubic, spans[turns])
    for margin in MARGINS:
        bounds = rate * margin, acceleration * margin + BESIDE * rate * rate
        if _within(cubic, lengths, *bounds):
            return exact(bounds[0]), exact(bounds[1])
    raise ArithmeticError("no bound of the target's motion was found")


def _cubic(knots: Knots, k: int) -> tuple[Any, Any, Any]:
    """a, b and c of a stretch, as balls."""
    first, last = (tuple(exact(float(x)) for x in knots.attitudes[i]) for i in (k, k + 1))
    turn: Any = relative(first, last)  # pyright: ignore
    if turn[0] < 0:
        turn = tuple(-x for x in turn)
    if turn[0] <= 0:
        raise ArithmeticError("two attitudes of the target are half a turn apart")
    span = exact(float(knots.times[k + 1])) - exact(float(knots.times[k]))
    a, end = (tuple(arb(exact(float(x)) * span) for x in knots.rates[i]) for i in (k, k + 1))
    rest: Any = (arb(0),) * 3
    if any(x != 0 for x in turn[1:]):
        vector: Any = tuple(arb(x) for x in turn[1:])
        length: Any = dot(vector, vector)
        angle: Any = 2 * arb.atan2(length.sqrt(), arb(turn[0]))
        axis = scale(1 / length.sqrt(), vector)
        across: Any = cross(axis, end)  # pyright: ignore
        share = 1 - angle / 2 * (angle / 2).cot()
        rest, end = scale(angle, axis), add(end, add(scale(angle / 2, across), scale(share, cross(axis, across))))  # pyright: ignore
    b = subtract(scale(3, rest), add(scale(2, a), end))  # pyright: ignore
    return a, b, subtract(add(a, end), scale(2, rest))  # pyright: ignore


def _enclosing(balls: list[Any]) -> Intervals:
    middles = np.array([number(ball) for ball in balls])
    zero = np.array([bool(ball.is_zero()) for ball in balls])
    low, high = (np.where(zero, 0.0, np.nextafter(middles, end)) for end in (-np.inf, np.inf))
    if not all(arb(a) <= ball <= arb(b) for a, b, ball in zip(low.tolist(), high.tolist(), balls, strict=True)):
        raise ArithmeticError("the target's motion is known too imprecisely")
    return Intervals(low, high)


def _peaks(cubic: Any, spans: Array) -> tuple[float, float]:
    """The largest rate and acceleration at points of each stretch, in floats."""
    a, b, c = (tuple((x.low + x.high) / 2.0 for x in v) for v in cubic)
    largest = [0.0, 0.0]
    for s in np.linspace(0.0, 1.0, POINTS):
        phi = tuple(s * (x + s * (y + s * z)) for x, y, z in zip(a, b, c, strict=True))
        slope = tuple(x + s * (2.0 * y + 3.0 * s * z) for x, y, z in zip(a, b, c, strict=True))
        bend = tuple(2.0 * y + 6.0 * s * z for y, z in zip(b, c, strict=True))
        for place, (peak, unit) in enumerate(zip(_motion(phi, slope, bend, 0.5, 40), (spans, spans**2), strict=True)):
            largest[place] = max(largest[place], float((np.sqrt(dot(peak, peak)) / unit).max()))
    return largest[0], largest[1]


def _within(cubic: Any, lengths: Intervals, rate: float, acceleration: float) -> bool:
    """Whether rate and acceleration are shown not to exceed bounds."""
    limits = [(rate * lengths).square(), (acceleration * lengths.square()).square()]
    lane: NDArray[np.intp] = np.arange(len(lengths.low), dtype=np.intp)
    low, high = np.zeros(len(lane)), np.ones(len(lane))
    # So many that the remainder is below the rounding.
    terms = int(8.0 + 2.0 * np.sum([np.abs(x.high) for v in cubic for x in v], axis=0).max())
    looked = 0
    while len(lane):
        looked += len(lane)
        if looked > MOST:
            return False
        middle = 0.5 * (low + high)
        a, b, c = (tuple(Intervals(x.low[lane], x.high[lane]) for x in v) for v in cubic)
        # About the middle, where the powers of the remaining part are smallest.
        m, r = Intervals(middle), Intervals(low - middle, high - middle)
        square = r.square()
        phi, slope, bend = list[Any](), list[Any](), list[Any]()
        for x, y, z in zip(a, b, c, strict=True):
            curved = y + 3.0 * m * z
            here, steep = m * (x + m * (y + m * z)), x + m * (2.0 * y + 3.0 * m * z)
            phi.append(here + r * steep + square * curved + square * r * z)
            slope.append(steep + 2.0 * r * curved + 3.0 * square * z)
            bend.append(2.0 * curved + 6.0 * r * z)
        left = np.zeros(len(lane), dtype=bool)
        for peak, limit in zip(
            _motion(tuple(phi), tuple(slope), tuple(bend), Intervals(0.0, 1.0), terms), limits, strict=True
        ):
            size: Any = peak[0].square() + peak[1].square() + peak[2].square()
            left |= ~(size.high <= limit.low[lane])
        lane, low, middle, high = lane[left], low[left], middle[left], high[left]
        if ((middle <= low) | (middle >= high)).any():
            return False
        lane = np.concatenate([lane, lane])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return True


def _motion(phi: Any, slope: Any, bend: Any, tail: Any, terms: int) -> tuple[Any, Any]:
    """Rate and acceleration for a rotation vector with its derivatives; `tail`: what ends a series that alternates."""
    x, along = dot(phi, phi), 2.0 * dot(phi, slope)
    k1, k2 = 0.5 * _series(x, 1, tail, terms), _series(x, 2, tail, terms) / 6.0
    d1, d2 = _series(x, 1, tail, terms, True) / -24.0, _series(x, 2, tail, terms, True) / -120.0
    turned, swung = cross(phi, slope), cross(phi, bend)
    rate = add(subtract(slope, scale(k1, turned)), scale(k2, cross(phi, turned)))
    steady = add(subtract(bend, scale(k1, swung)), scale(k2, add(cross(phi, swung), cross(slope, turned))))
    changing = subtract(scale(d2, cross(phi, turned)), scale(d1, turned))
    return rate, add(steady, scale(along, changing))


def _series(x: Any, j: int, tail: Any, terms: int, derived: bool = False) -> Any:
    """2 k1 (j = 1) or 6 k2 (j = 2), or -24 or -120 times its derivative by x, as 1 - r_1 x (1 - r_2 x (...)). The remainder
    is between 0 and 1, for the terms alternate and shrink from there on where (2 terms + 2)^2 exceeds x."""
    for n in range(terms, 0, -1):
        above, below = (n + 1, n * (2 * n + j + 2) * (2 * n + j + 3)) if derived else (1, (2 * n + j) * (2 * n + j + 1))
        tail = 1.0 - x * float(above) / float(below) * tail
    return tail
