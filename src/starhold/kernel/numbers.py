"""Exact rational numbers, matrices of them, and the account of the work that a check may do."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from math import factorial, gcd, isqrt, lcm
from operator import mul
from typing import Any, TypeAlias, cast

Rows: TypeAlias = list[list[Fraction]]

WORK = 8_000_000
"""Units of work that the check of one claim may do: about a fifth of a microsecond each."""
LONGEST = 20_000
"""Bits of the longest number."""
_FLOAT = re.compile(r"(-?)0x([01])(?:\.([0-9a-f]{1,13}))?p([+-][0-9]{1,4})", re.ASCII)
_QUOTIENT = re.compile(r"(-?[0-9]{1,3000})(?:/([0-9]{1,3000}))?", re.ASCII)


class RefusedError(Exception):
    """A certificate is refused; the text says why in one line."""


def demand(truth: bool, otherwise: str) -> None:
    """Refuse unless the condition holds."""
    if not truth:
        raise RefusedError(otherwise)


class Account:
    """The remaining work. It is counted instead of timed, so that a certificate is refused on every machine or on none."""

    left = WORK

    @classmethod
    def open(cls) -> None:
        """Begin the account of a claim."""
        cls.left = WORK

    @classmethod
    def spend(cls, operations: int, bits: int = 64) -> None:
        """Charge for operations on numbers of so many bits before they are done."""
        cls.left -= operations * (2 + bits // 64)
        if bits > LONGEST or cls.left < 0:
            raise RefusedError("a number becomes too long" if bits > LONGEST else "the check takes too much work")


def longest(numbers: Iterable[Fraction]) -> int:
    """Return the bit length of the longest of some numbers."""
    return max((x.numerator.bit_length() + x.denominator.bit_length() for x in numbers), default=0)


def rational(given: Any) -> Fraction:
    """Read an exact number: -2, 3/4, or the hexadecimal form of a float, which is its exact value."""
    return _parsed(given if isinstance(given, str) else "")


@lru_cache(1024)
def _parsed(text: str) -> Fraction:
    """Read the text of a number; those of a symmetric matrix stand twice."""
    if match := _FLOAT.fullmatch(text):
        sign, whole, after, exponent = match.groups(default="")
        demand(abs(int(exponent)) <= 1100, "a float is out of range")
        upper, places = int(sign + whole + after, 16), int(exponent) - 4 * len(after)
        return Fraction(upper << max(places, 0), 1 << max(-places, 0))
    match = _QUOTIENT.fullmatch(text)
    upper, lower = match.groups(default="1") if match else ("", "")
    demand(match is not None, "a number is not written as one")
    demand(int(lower) != 0, "a denominator is zero")
    return Fraction(int(upper), int(lower))


def read_list(given: Any, count: int | None = None) -> list[Any]:
    """Read a list, of a given length if one is stated."""
    demand(isinstance(given, list), "evidence is not a list")
    entries = cast(list[Any], given)
    demand(count is None or len(entries) == count, "a list has another length")
    return entries


def read_dict(given: Any, most: int) -> dict[str, Any]:
    """Read a table with at most so many entries."""
    demand(isinstance(given, dict), "evidence is not a table")
    entries = cast(dict[str, Any], given)
    demand(len(entries) <= most, "a table is too long")
    return entries


def read_table(given: Any, *keys: str) -> list[Any]:
    """Read the entries of a table with exactly these keys."""
    entries = read_dict(given, len(keys))
    demand(set(entries) == set(keys), f"a table has other keys than {', '.join(keys)}")
    return [entries[key] for key in keys]


def matrix(given: Any, rows: int, columns: int) -> Rows:
    """Read a matrix."""
    return [[rational(x) for x in read_list(row, columns)] for row in read_list(given, rows)]


def whole(numbers: Sequence[Fraction | int]) -> tuple[list[int], int]:
    """Return integers and their common denominator."""
    below = lcm(*[x.denominator for x in numbers])
    return [x.numerator * (below // x.denominator) if below > 1 else x.numerator for x in numbers], below


def added(numbers: Sequence[Fraction], times: Sequence[Fraction] | None = None) -> Fraction:
    """Return a sum, of numbers or of their products with others, reduced to lowest terms once."""
    (upper, below), (more, under) = whole(numbers), whole(times) if times else ([], 1)
    return Fraction(sum(map(mul, upper, more)) if times else sum(upper), below * under)


def surely_definite(a: Rows) -> bool:
    """Tell whether a symmetric matrix, scaled so that its diagonal is about 2^128, is found to be LL' + R with integers in L
    and with entries below 2^65 in R beside a diagonal of at least 2^80: it is then positive definite."""
    if any(row[k] <= 0 for k, row in enumerate(a)):
        return False
    Account.spend(len(a) ** 3 // 6, 128)
    scales = [
        64 + (x.denominator.bit_length() - x.numerator.bit_length() + 1) // 2 for x in (a[k][k] for k in range(len(a)))
    ]
    rows: list[list[int]] = []
    for i, line in enumerate(a):
        row: list[int] = []
        for k, x in enumerate(line[: i + 1]):
            places = scales[i] + scales[k]
            scaled = (x.numerator << max(places, 0)) // (x.denominator << max(-places, 0))
            rest = scaled - sum(map(mul, row, rows[k] if k < i else row))
            if k == i and rest <= 2**80:
                return False
            # What the shift and the division leave out is together between 0 and rows[k][k] < 2^65.
            row.append(rest // rows[k][k] if k < i else isqrt(rest - 2**80))
        rows.append(row)
    return True


def definite(a: Rows, strictly: bool = True) -> bool:
    """Tell whether a matrix is symmetric and positive definite (if not strict: positive semidefinite). If it is not clearly
    so, fraction-free elimination (Bareiss) decides: the pivots are the leading minors of the matrix without its zero rows.
    """
    demand(all(len(row) == len(a) for row in a), "a matrix is not square")
    demand(a == transpose(a), "a matrix is not symmetric")
    if surely_definite(a):
        return True
    # Rows and columns alike are multiplied by a positive number, which changes no sign. Rows with long numbers come last.
    scales = sorted((lcm(*(x.denominator for x in row)), k) for k, row in enumerate(a))
    rest = [[int(a[i][k] * s) * t for t, k in scales[n:]] for n, (s, i) in enumerate(scales)]
    common, last = gcd(*(x for row in rest for x in row)) or 1, 1
    rest = [[x // common for x in row] for row in rest]
    for k, (pivot, *others) in enumerate(rest):
        if pivot < 0 or (pivot == 0 and (strictly or any(others))):
            return False
        for i, x in enumerate(others if pivot else (), 1):
            row = rest[k + i]
            Account.spend(len(row), pivot.bit_length() + max(map(int.bit_length, row)))
            rest[k + i] = [(pivot * y - x * z) // last for y, z in zip(row, others[i - 1 :], strict=True)]
        last = pivot or last
    return True


def shortened(a: Rows, places: int) -> Rows:
    """Return a matrix rounded down to a number of binary places."""
    return [[Fraction((x.numerator << places) // x.denominator, 1 << places) for x in row] for row in a]


def inverse(a: Rows) -> Rows:
    """Invert a positive definite matrix exactly, by elimination without pivoting."""
    count = len(a)
    rest = [[*row, *unit] for row, unit in zip(a, scalar(1, count), strict=True)]
    for k in range(count):
        demand(rest[k][k] != 0, "a matrix has no inverse")
        Account.spend(2 * count * count, sum(map(longest, rest)))
        pivot = [x / rest[k][k] for x in rest[k]]
        rest = [plus([row], [pivot], -row[k])[0] if i != k else pivot for i, row in enumerate(rest)]
    return [row[count:] for row in rest]


def times(a: Rows, b: Rows) -> Rows:
    """Return the product of two matrices."""
    columns = transpose(b)
    # Nothing is multiplied by zeros of the first.
    left = [([(k, x) for k, x in enumerate(row) if x], below) for row, below in map(whole, a)]
    count = sum(len(row) for row, _ in left)
    Account.spend((count + len(a)) * len(columns), max(map(longest, a)) + max(map(longest, b)))
    right = list(map(whole, columns))
    return [[Fraction(sum([x * t[k] for k, x in s]), c * d) for t, d in right] for s, c in left]


def plus(a: Rows, b: Rows, c: Fraction | int = 1) -> Rows:
    """Return a + c b."""
    if c == -1:
        return [[x - y if y else x for x, y in zip(s, t, strict=True)] for s, t in zip(a, b, strict=True)]
    more = b if c == 1 else [[c * y if y else y for y in row] for row in b]
    return [[x + y if y else x for x, y in zip(s, t, strict=True)] for s, t in zip(a, more, strict=True)]


def transpose(a: Sequence[Sequence[Fraction]]) -> Rows:
    """Return the transpose of a matrix."""
    return [list(column) for column in zip(*a, strict=True)]


def scalar(c: Fraction | int, count: int = 3) -> Rows:
    """Return c times the identity."""
    entry, zero = Fraction(c), Fraction(0)
    return [[entry if i == k else zero for k in range(count)] for i in range(count)]


def beside(a: Rows, b: Rows) -> Rows:
    """Return the matrix with the columns of both."""
    return [[*s, *t] for s, t in zip(a, b, strict=True)]


def cosine_below(angle: Fraction) -> Fraction:
    """Return a lower bound of the cosine of an angle from 0 to 3: its alternating series, cut after a negative term."""
    demand(0 <= angle <= 3, "an angle is not between 0 and 3")
    Account.spend(80, 40 * longest([angle]))
    total, term = Fraction(0), Fraction(1)
    for k in range(1, 25):
        total, term = total + term, -term * angle * angle / (2 * k * (2 * k - 1))
    return total


def cosine_above(angle: Fraction) -> Fraction:
    """Return an upper bound of the cosine of an angle from 0 to 3: the same series with its next term."""
    return cosine_below(angle) + angle**48 / factorial(48)


def root(x: Fraction) -> Fraction:
    """Return a short, tight upper bound of the square root of a nonnegative number."""
    demand(x >= 0, "a root is of a negative number")
    Account.spend(4, longest([x]))
    places = 64 + max(0, x.denominator.bit_length() - x.numerator.bit_length()) // 2
    return Fraction(isqrt((x.numerator << 2 * places) // x.denominator) + 1, 1 << places) if x else x


def up(x: Fraction) -> Fraction:
    """Return a short, tight upper bound of a number."""
    return up_quotient(x.numerator, x.denominator)


def up_quotient(upper: int, lower: int) -> Fraction:
    """Return a short, tight upper bound of a quotient."""
    over, under = upper.bit_length(), lower.bit_length()
    Account.spend(2, over + under)
    places = 64 + max(0, under - over)
    return Fraction(-((-upper << places) // lower), 1 << places)


def norm(v: Iterable[Fraction]) -> Fraction:
    """Return a tight upper bound of the Euclidean norm."""
    numbers, below = whole([*v])
    return root(Fraction(sum(x * x for x in numbers), below * below))


def reach(a: Rows, v: Sequence[Fraction]) -> list[Fraction]:
    """Return a bound of the image, by a matrix, of vectors whose components do not exceed those of v."""
    (sizes, under), rows = whole(v), list(map(whole, a))
    return [Fraction(sum(abs(x) * y for x, y in zip(row, sizes, strict=True)), below * under) for row, below in rows]
