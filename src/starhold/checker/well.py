"""Bounds on a level set of V by branch and bound: products of attitude and rate as functions of the part of V that the
attitude holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from flint import arb

from starhold.checker.exact import ONE, ZERO, demand, in_time

SHAPES = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
"""Powers of |q| and of the rate's bound z, by which the bound of a torque is sorted."""


@dataclass(frozen=True)
class Well:
    """How the attitude's part t = s x of V grows with x. `shapes`: powers of |q|, z and, where there is a third, |q0|, those
    of SHAPES first; `beside`: what stands beside q_i in the torque of a spring, which the shape `spring` bounds; `most`: the
    largest x; `squares`: at x those of |q| and |q0|, concave in x, each with its slope."""

    shapes: Sequence[Sequence[int]]
    beside: tuple[str, ...]
    spring: int
    most: Any
    squares: Callable[[Any], Sequence[tuple[Any, Any]]]


ODD = Well(SHAPES, (), 1, 2, lambda x: [(x * (2 - x), 2 - 2 * x)])
"""x = 1 - q0."""
EVEN = Well((*((p, r, 0) for p, r in SHAPES), (1, 0, 1)), ("q0",), len(SHAPES), 1, lambda x: [(x, ONE), (1 - x, -ONE)])
"""x = |q|2."""


def keeps_below(
    ways: Sequence[tuple[Sequence[Sequence[Sequence[Any]]], Sequence[Any]]],
    limit: Any,
    level: Any,
    s: Any,
    well: Well = ODD,
) -> bool:
    """Whether at each t, 0 <= t <= min(level, s most), in one of several ways sum_k common_k f_k(t) and, of each group of
    loads, |(sum_k loads_ik f_k(t))_i| together are at most limit. A way is (groups, common), and the f_k are the products of
    a well's shapes, with z2 = 2 (level - t).

    Each f_k is concave in t, being the root of at most two factors that are concave and not negative. So it lies under its
    tangents, and over a tangent the whole is convex: no more than at the ends of the piece.
    """
    demand(level > 0, "the level is not positive")
    waiting = [(ZERO, min(level, well.most * s))]
    for _ in range(4096):
        if not waiting:
            return True
        in_time()
        low, high = waiting.pop()
        tangents = _tangents((low + high) / 2, level, s, well)
        half = (high - low) / 2
        heights = [[height + slope * step for height, slope in tangents] for step in (ZERO, -half, half)]
        # At the middle the tangents touch.
        left = [way for way in ways if not _size(way, heights[0]) > limit]
        if not left:
            return False
        if not any(all(_size(way, ends) <= limit for ends in heights[1:]) for way in left):
            waiting += [(low, low + half), (low + half, high)]
    return False


def _size(way: tuple[Sequence[Sequence[Sequence[Any]]], Sequence[Any]], heights: Sequence[Any]) -> Any:
    groups, common = way
    sums = [[_sum(load, heights) for load in loads] for loads in groups]
    # Not ** 2, which has no value for a ball around zero.
    squares = [sum((part * part for part in parts), arb(0)) for parts in sums]
    return sum((square.nonnegative_part().sqrt() for square in squares), _sum(common, heights))


def _sum(load: Sequence[Any], heights: Sequence[Any]) -> Any:
    return sum((c * h for c, h in zip(load, heights, strict=True)), arb(0))


def _tangents(at: Any, level: Any, s: Any, well: Well) -> list[tuple[Any, Any]]:
    """Value and slope at t of each shape, as balls."""
    turn, *others = ((value, slope / s) for value, slope in well.squares(at / s))
    squares = [turn, (2 * (level - at), -2 * ONE), *others]
    found: list[tuple[Any, Any]] = []
    for powers in well.shapes:
        inner, share = ONE, ZERO
        for power, (value, slope) in zip(powers, squares[: len(powers)], strict=True):
            inner *= value**power
            share += power * slope / value
        height = arb(inner).sqrt()
        found.append((height, height * share / 2))
    return found
