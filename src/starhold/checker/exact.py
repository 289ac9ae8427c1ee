"""Exact matrices and polynomials, derivatives, and bounds that only round away from what they bound, by which the checker
decides.

A matrix is a list of rows of rationals (`fmpq`).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import combinations, zip_longest
from operator import mul
from time import thread_time
from typing import Any, Literal, TypeAlias

import numpy as np
from flint import acb, acb_poly, arb, fmpq, fmpq_mat, fmpq_poly

from starhold.algebra.polynomial import Condition, Monomial, Polynomial

Rows: TypeAlias = list[list[Any]]
Truths: TypeAlias = Sequence[tuple[Condition, bool]]
Interval: TypeAlias = tuple[Any, Any]
"""Ends of a closed interval; None for an end at infinity."""
Verdict: TypeAlias = Literal["holds", "fails", "not checked", "not claimed"]
Obligation: TypeAlias = tuple[str, str, Callable[[], str]]
"""Its name, how it is to be shown ("" for numbers that are no obligation of their own), and what shows it: the reason, or a
CheckError."""
ZERO, ONE = fmpq(0), fmpq(1)
SECONDS = 60.0
"""Processor time for one claim."""
SHARES = (0.0, *(2.0**k for k in range(-52, 4)))
"""By which share of the largest eigenvalue a guess of one is raised, the first that suffices."""


class CheckError(Exception):
    """Why something in a certificate does not hold, or cannot be verified."""


class NotCheckedError(CheckError):
    """Why the checker's methods neither showed something nor found it false."""


_late: ContextVar[float] = ContextVar("late", default=float("inf"))


@contextmanager
def limited(seconds: float = SECONDS) -> Generator[None]:
    """Give the work within so many seconds of processor time, no more than what it is part of has; `in_time` stops it."""
    before = _late.set(min(thread_time() + seconds, _late.get()))
    try:
        yield
    finally:
        _late.reset(before)


def in_time() -> None:
    """A CheckError where the check of a claim takes longer than it may. What all checks are made of calls it: demands,
    numbers of the file, products and determinants of matrices. Only loops without any of these have to call it themselves.
    """
    if thread_time() >= _late.get():
        raise CheckError(f"the check takes longer than {SECONDS:g} s of processor time")


def demand(holds: bool, otherwise: str) -> None:
    """Raise a CheckError unless something holds, or where time is up."""
    if not holds:
        raise CheckError(otherwise)
    in_time()


def rational(x: Any) -> Any:
    """The exact value of a number of the file."""
    in_time()
    return fmpq(*Fraction(x).as_integer_ratio())


def floating(x: Any) -> float:
    """A float near a rational, for guesses only."""
    return int(x.p) / int(x.q)


def up(x: Any) -> Any:
    """A rational that nothing in a ball exceeds."""
    demand(bool(x.is_finite()), "a ball is not finite")
    return x.mid().fmpq() + x.rad().fmpq()


def down(x: Any) -> Any:
    """A rational that everything in a ball reaches."""
    return -up(-x)


def root_above(x: Any) -> Any:
    """A rational not below the square root of a rational."""
    return up(arb(x).sqrt()) if x > 0 else ZERO


# --- matrices ---------------------------------------------------------------------------------------------------------


def identity(count: int, c: Any = ONE) -> Rows:
    """c times the unit matrix."""
    return [[c if i == j else ZERO for j in range(count)] for i in range(count)]


def plus(a: Rows, b: Rows, c: Any = ONE) -> Rows:
    """a + c b."""
    return [[x + c * y for x, y in zip(s, t, strict=True)] for s, t in zip(a, b, strict=True)]


def times(c: Any, a: Rows) -> Rows:
    """c a."""
    return [[c * x for x in row] for row in a]


def transpose(a: Rows) -> Rows:
    """The transposed matrix."""
    return [list(column) for column in zip(*a, strict=True)]


def matmul(a: Rows, b: Rows) -> Rows:
    """The product a b."""
    columns = transpose(b)
    return [[_product(row, column) for column in columns] for row in a]


def _product(a: Sequence[Any], b: Sequence[Any]) -> Any:
    in_time()
    return sum((x * y for x, y in zip(a, b, strict=True)), ZERO)


def symmetric_part(a: Rows) -> Rows:
    """The symmetric part."""
    return times(fmpq(1, 2), plus(a, transpose(a)))


def block(a: Rows, b: Rows, d: Rows) -> Rows:
    """[[a, b], [b', d]]."""
    return [s + t for s, t in zip(a, b, strict=True)] + [s + t for s, t in zip(transpose(b), d, strict=True)]


def inverse(a: Rows) -> Rows:
    """The exact inverse of a matrix of rationals."""
    found = fmpq_mat(a).inv()
    return [[found[i, j] for j in range(len(a))] for i in range(len(a))]


def determinant(a: Rows) -> Any:
    """The exact determinant."""
    in_time()
    return fmpq_mat(a).det()


def definite(a: Rows, strictly: bool = True) -> bool:
    """Whether a symmetric matrix is positive definite, or at least nowhere negative.

    Sylvester: the leading minors tell definite from not; to allow zero takes all the principal ones.
    """
    for k in range(1, len(a) + 1):
        for kept in [tuple(range(k))] if strictly else combinations(range(len(a)), k):
            minor = determinant([[a[i][j] for j in kept] for i in kept])
            if minor < 0 or (strictly and minor == 0):
                return False
    return True


def greatest(a: Rows) -> Any:
    """A rational that no eigenvalue of a symmetric matrix exceeds: the largest diagonal entry where it is one, else guessed
    in floats; shown by minors."""
    values = np.linalg.eigvalsh([[floating(x) for x in row] for row in a])
    guesses = (rational(float(values[-1]) + share * float(np.abs(values).max())) for share in SHARES)
    for bound in (max(row[k] for k, row in enumerate(a)), *guesses):
        if definite(plus(identity(len(a), bound), a, -ONE), strictly=False):
            return bound
    raise CheckError("no bound of an eigenvalue was found")


def least(a: Rows) -> Any:
    """A rational that no eigenvalue of a symmetric matrix falls below; positive where all of them are."""
    return 1 / greatest(inverse(a)) if definite(a) else -greatest(times(-ONE, a))


def radius_of(a: Rows) -> Any:
    """A rational that the modulus of no eigenvalue of a symmetric matrix exceeds."""
    return max(greatest(a), greatest(times(-ONE, a)), ZERO)


# --- polynomials in one variable, lowest coefficient first ------------------------------------------------------------


def hurwitz(coefficients: Sequence[Any]) -> bool:
    """Whether all roots have a negative real part: Routh's array has a first column of one sign."""
    row, following = list(coefficients)[::-1][0::2], list(coefficients)[::-1][1::2]
    if row[0] < 0:
        row, following = [-c for c in row], [-c for c in following]
    while following:
        if not (row[0] > 0 and following[0] > 0):
            return False
        share = row[0] / following[0]
        below = [c - share * d for c, d in zip_longest(row[1:], following[1:], fillvalue=ZERO)]
        row, following = following, below
    return bool(row[0] > 0)


def within_circle(coefficients: Sequence[Any], radius: Any) -> bool:
    """Whether all roots z have |z| < radius: z = radius (1 + x)/(1 - x) takes the circle to the left half plane."""
    count = len(coefficients) - 1
    above, beneath, total = fmpq_poly([1, 1]), fmpq_poly([1, -1]), fmpq_poly([0])
    for k, c in enumerate(coefficients):
        total += c * radius**k * above**k * beneath ** (count - k)
    return total.degree() == count and hurwitz(total.coeffs())


def saddle(coefficients: Sequence[Any]) -> bool:
    """Whether surely no root has a zero real part and some have a positive one."""
    even_part, odd_part = (fmpq_poly(list(coefficients)[k::2]) for k in (0, 1))
    # A root iy makes -y2 a root of both parts. Their common divisor has no negative root if its signs alternate (Descartes).
    common = even_part.gcd(odd_part).coeffs()
    alternate = [c if k % 2 == 0 else -c for k, c in enumerate(common) if c != 0 or k == 0]
    one_sign = all(c >= 0 for c in alternate) or all(c <= 0 for c in alternate)
    return coefficients[0] != 0 and (len(common) == 1 or one_sign) and not hurwitz(coefficients)


def has_root_near(coefficients: Sequence[Any], real: Any, imaginary: Any, distance: Any) -> bool:
    """Whether a root is surely within a distance: with the Taylor coefficients c_k at the point, one of n roots is within
    (n over k |c_0/c_k|)^(1/k) for every k, since c_k/c_0 is a sum of products of k inverse distances."""
    shifted = acb_poly([acb(arb(c)) for c in coefficients])(acb_poly([acb(arb(real), arb(imaginary)), acb(1)])).coeffs()
    count, ways = len(coefficients) - 1, 1
    for k in range(1, count + 1):
        ways = ways * (count - k + 1) // k
        if abs(shifted[0]) * ways <= abs(shifted[k]) * arb(distance) ** k:
            return True
    return False


# --- derivatives and conditions ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Dual:
    """A polynomial with its rate of change: what the equations make of duals has the derivative along the motion."""

    value: Any
    slope: Any

    def __add__(self, other: Any) -> Dual:
        b = dual(other)
        return Dual(self.value + b.value, self.slope + b.slope)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __sub__(self, other: Any) -> Dual:
        return self + (-dual(other))

    def __rsub__(self, other: Any) -> Dual:
        return dual(other) + (-self)

    def __mul__(self, other: Any) -> Dual:
        b = dual(other)
        return Dual(self.value * b.value, self.value * b.slope + self.slope * b.value)

    def __truediv__(self, other: Any) -> Dual:
        b = dual(other)
        demand(not b.slope.terms, "something is divided by what moves")
        return Dual(self.value / b.value, self.slope / b.value)

    def __rtruediv__(self, other: Any) -> Dual:
        return dual(other) / self

    __radd__, __rmul__ = __add__, __mul__


def dual(value: Any) -> Any:
    """A number, tuple or NamedTuple with every number in it, unless a dual already, one that does not change."""
    if isinstance(value, tuple):
        parts: list[Any] = [dual(part) for part in value]  # pyright: ignore[reportUnknownVariableType]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)  # pyright: ignore
    if isinstance(value, Dual):
        return value
    return Dual(value if isinstance(value, Polynomial) else Polynomial.constant(value), Polynomial({}))


def replaced(polynomial: Polynomial, values: Mapping[str, Any]) -> Polynomial:
    """A polynomial with polynomials in place of some variables."""
    found: dict[Monomial, Any] = {}
    for monomial, c in polynomial.terms.items():
        factors = [values[name] for name in monomial if name in values]
        kept = Polynomial({tuple(name for name in monomial if name not in values): c})
        for m, d in reduce(mul, factors, kept).terms.items():
            found[m] = found[m] + d if m in found else d
    return Polynomial(found)


def intervals(truths: Truths, axes: Sequence[Polynomial]) -> list[Interval] | None:
    """Closed intervals that conditions keep the axes in, None where they contradict one another; a CheckError where a
    condition speaks of anything but one axis."""
    found: list[Interval] = [(None, None)] * len(axes)
    for condition, truth in truths:
        place, share, border = _axis(condition.positive, axes)
        low, high = found[place]
        if (share > 0) == truth:
            low = border if low is None else max(low, border)
        else:
            high = border if high is None else min(high, border)
        found[place] = (low, high)
    return None if any(low is not None and high is not None and low > high for low, high in found) else found


def _axis(positive: Polynomial, axes: Sequence[Polynomial]) -> tuple[int, Any, Any]:
    """The axis y of a condition share (y - border) > 0, with share and border."""
    for place, axis in enumerate(axes):
        first = next(iter(axis.terms))
        share = positive.terms.get(first, ZERO) / axis.terms[first]
        offset = (positive - share * axis).value
        if share != 0 and offset is not None:
            return place, share, -offset / share
    raise CheckError(f"the law switches on {positive}")


def falls(linear: Any, quadratic: Any, interval: Interval) -> bool:
    """Whether linear y + quadratic y2 < 0 for every y but 0 in an interval."""
    for sign in (1, -1):
        ends = interval if sign > 0 else tuple(None if end is None else -end for end in interval[::-1])
        a, b = sign * linear, quadratic
        low, high = max(ends[0] or ZERO, ZERO), ends[1]
        if high is not None and (high <= 0 or high < low):
            continue
        # a + b y must be negative for low <= y <= high, but for y = 0.
        first, last = a + b * low, b if high is None else a + b * high
        at_first = first < 0 or (first == 0 and low == 0)
        at_last = last < 0 or (high is None and last == 0 and first < 0)
        if not (at_first and at_last):
            return False
    return True
