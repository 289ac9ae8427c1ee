"""Combines the attitudes that several sensors give at a control step."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

from starhold.algebra.quaternion import Quaternion, multiply, normalise, relative, vector_part
from starhold.algebra.scalar import Truth, either, less, side
from starhold.algebra.structure import chosen
from starhold.algebra.vector import IDENTITY, ZERO, Matrix, Vector, add, apply, combine, inverse, scale


def attitudes_of(readings: Any) -> list[tuple[Quaternion, Truth]]:
    """Return each attitude among an estimator's readings, and whether it is new: without a flag, at each step."""
    shown = [one for one in getattr(readings, "every", (readings,)) if hasattr(one, "attitude")]
    return [(one.attitude, less(0.5, getattr(one, "attitude_is_new", 1.0))) for one in shown]


def together(seen: Sequence[tuple[Quaternion, Truth]], weights: Sequence[Matrix]) -> tuple[Quaternion, Matrix, Truth]:
    """Return the most likely attitude given those that are new, the covariance of its error (rad2, body axes), and whether
    one is new; weights: the inverse covariances of the attitudes' errors. For a filter this equals using them one after the
    other."""
    (near, new), *others = seen
    for attitude, fresh in others:
        near, new = chosen(new, near, attitude), either(new, fresh)
    counted = [chosen(fresh, weight, (ZERO, ZERO, ZERO)) for (_, fresh), weight in zip(seen, weights, strict=True)]
    total = reduce(lambda a, b: combine(1.0, a, 1.0, b), counted)
    # If none is new the result is not used, but stays finite.
    spread = inverse(chosen(new, total, IDENTITY))
    # The second iteration removes the quadratic error of the first.
    for _ in range(2):
        pulls = [apply(weight, small_turn(near, attitude)) for (attitude, _), weight in zip(seen, counted, strict=True)]
        near = turned_by(near, apply(spread, reduce(add, pulls)))
    return near, spread, new


def small_turn(begin: Quaternion, end: Quaternion) -> Vector:
    """Return the rotation vector (rad, body axes) from one attitude to another near it."""
    error = relative(begin, end)
    return scale(2.0 * side(error[0]), vector_part(error))


def turned_by(attitude: Quaternion, turn: Vector) -> Quaternion:
    """Return an attitude turned further by a small rotation vector (rad, body axes)."""
    return normalise(multiply(attitude, (1.0, *scale(0.5, turn))))
