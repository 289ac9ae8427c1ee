"""Signs of polynomials over boxes by their Bernstein coefficients: no polynomial exceeds the largest of them, and those of
half a box follow from those of the whole by averages. Coefficients are whole numbers that are only ever rounded up, so that
what is found negative is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb
from typing import Any, TypeAlias

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from starhold.algebra.polynomial import Polynomial
from starhold.checker.exact import ONE, ZERO, in_time

Box: TypeAlias = Mapping[str, tuple[Any, Any]]
"""Ends of each variable's interval, rationals."""
Whole: TypeAlias = NDArray[np.int64]
SIZE, SHARE, GREATEST = 40, 12, 20
"""Coefficients are 2^SIZE at most, weights multiples of 2^-SHARE up to 2^GREATEST of these: what `decided` adds up is below
2^62."""
MOST = 20_000
"""So many boxes are looked at, at most."""
CLEAR = 2**14
"""Rounding up adds less than this in the course of the halvings: at most the degree for each."""


def negative_where(fall: Polynomial, room: Polynomial, box: Box) -> bool:
    """Whether `fall` is surely negative wherever `room` is not, in a box.

    In each part of it fall + weight room < 0 with some weight that is not negative. That leaves out parts where room is
    negative all over, and decides those on its border, where neither polynomial has one sign.
    """
    degrees = [max(_degree(p, name) for p in (fall, room)) for name in box]
    waiting = stacked((fall, room), box, degrees)
    seen = 0
    while len(waiting):
        in_time()
        seen += len(waiting)
        if seen > MOST or _fails_at_a_corner(waiting):
            return False
        left = waiting[~decided(waiting)]
        axes = steepest(left)
        waiting = np.concatenate([halves(left[axes == axis], axis) for axis in range(2, waiting.ndim)])
    return True


def positive_on(polynomial: Polynomial, name: str, low: Any, high: Any, pieces: int = 64) -> bool:
    """Whether a polynomial in one variable is surely positive on an interval, cut into equal pieces; exactly."""
    step = (high - low) / pieces
    return all(
        c > 0
        for k in range(pieces)
        for c in bernstein(polynomial, {name: (low + k * step, low + (k + 1) * step)}, [_degree(polynomial, name)])
    )


def stacked(polynomials: Sequence[Polynomial], box: Box, degrees: Sequence[int]) -> Whole:
    """The coefficients of several polynomials over one box, each in units of its own."""
    return np.stack([_rounded(bernstein(p, box, degrees)) for p in polynomials])[None]


def bernstein(polynomial: Polynomial, box: Box, degrees: Sequence[int]) -> NDArray[Any]:
    """The exact Bernstein coefficients over a box, an axis for each variable."""
    found = np.full([n + 1 for n in degrees], ZERO, dtype=object)
    for monomial, c in polynomial.terms.items():
        found[tuple(monomial.count(name) for name in box)] += c
    for axis, ((low, high), n) in enumerate(zip(box.values(), degrees, strict=True)):
        change = np.array([[_of_power(k, j, n, low, high) for k in range(n + 1)] for j in range(n + 1)], dtype=object)
        found = np.moveaxis(np.tensordot(change, found, (1, axis)), 0, axis)
    return found


def _of_power(k: int, j: int, n: int, low: Any, high: Any) -> Any:
    """The jth Bernstein coefficient of x^k = (low (1 - t) + high t)^k ((1 - t) + t)^(n - k)."""
    ways = sum(
        (comb(k, i) * comb(n - k, j - i) * high**i * low ** (k - i) for i in range(max(0, j - n + k), min(j, k) + 1)), ZERO
    )
    return fmpq(ways) / comb(n, j)


def _degree(polynomial: Polynomial, name: str) -> int:
    return max((monomial.count(name) for monomial in polynomial.terms), default=0)


def _rounded(coefficients: NDArray[Any]) -> Whole:
    """In units that make the largest 2^SIZE, rounded up. The unit does not matter: only signs are asked for."""
    largest = max(abs(c) for c in coefficients.flat)
    unit = (largest or ONE) / 2**SIZE
    return np.array([int((c / unit).ceil()) for c in coefficients.flat], dtype=np.int64).reshape(coefficients.shape)


def decided(boxes: Whole) -> NDArray[np.bool_]:
    """The boxes where room is negative, or fall + weight room for the weight that floats guess."""
    rows: Any = boxes.reshape(len(boxes), 2, -1)
    fall, room = rows[:, 0], rows[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: Any = np.abs(fall / room)
    least: Any = np.where(room < 0, np.where(fall >= 0, ratio, 0.0), 0.0).max(axis=1)
    most: Any = np.where(room > 0, np.where(fall < 0, ratio, 0.0), np.inf).min(axis=1)
    endless: Any = np.isinf(most)
    most[endless] = 3.0 * least[endless]
    weights: Any = np.clip(np.rint((least + most) * 2.0 ** (SHARE - 1)), 0, 2**GREATEST).astype(np.int64)
    # Where fall is negative all over, no weight is as good as any.
    weights[(fall < 0).all(axis=1)] = 0
    weighed = (fall << SHARE) + weights[:, None] * room
    return (weighed < 0).all(axis=1) | (room < 0).all(axis=1)


def _fails_at_a_corner(boxes: Whole) -> bool:
    """Whether at a corner, where the coefficients are values, both polynomials are clearly positive."""
    corners = boxes
    for axis in range(2, boxes.ndim):
        corners = corners.take([0, -1], axis=axis)
    return bool((corners > CLEAR).all(axis=1).any())


def steepest(boxes: Whole) -> NDArray[np.intp]:
    """The axis along which the coefficients of either polynomial change most."""
    steps = [
        np.abs(np.diff(boxes, axis=axis)).max(axis=tuple(range(2, boxes.ndim)), initial=0).sum(axis=1) * boxes.shape[axis]
        for axis in range(2, boxes.ndim)
    ]
    return np.argmax(steps, axis=0) + 2


def halves(boxes: Whole, axis: int) -> Whole:
    """Both halves of boxes along an axis, by de Casteljau's averages rounded up."""
    row = np.moveaxis(boxes, axis, 0)
    first, last = [row[0]], [row[-1]]
    while len(row) > 1:
        row = (row[:-1] + row[1:] + 1) >> 1
        first.append(row[0])
        last.append(row[-1])
    return np.concatenate([np.moveaxis(np.stack(part), 0, axis) for part in (first, last[::-1])])
