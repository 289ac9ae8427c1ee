"""The numbers of the quadratic program of predictive control lie in one buffer, in the order given here.

    minimise   sum over k < N of x_k'Q x_k + v_k'R v_k,  plus x_N'P x_N,   x_{k+1} = A x_k + B v_k,
    subject to |v_k - centre| <= bound, on each axis (box) or in norm (ball).

`carve` gives names to the parts of the buffer: a trajectory carries one buffer, not twenty, which all passes over the
horizon share.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple

from starhold.algebra.scalar import Scalar
from starhold.algebra.structured import Buffer, Index
from starhold.algebra.vector import Vector
from starhold.laws.predictive.limits import Limits, make_limits
from starhold.laws.predictive.sixes import Rows, Weight, matrix, triple

COUNTERS = 5
"""The number of counters."""


class Problem(NamedTuple):
    """A quadratic program: `horizon` moves, its numbers, limits in norm (ball) or on each axis, and Q and R full (dense) or
    diagonal."""

    numbers: Buffer
    horizon: Index
    ball: bool
    dense: bool = False


class Store(NamedTuple):
    """The parts of a program's numbers. Counters, weights, tail, plan and states are kept from call to call; the rest is
    written before it is read. Matrices are stored row by row, a diagonal Q or R as its diagonal alone."""

    counters: Any
    """Counters of the law; they come first."""
    weights: Any
    """Q, R, R^-1, P (36)."""
    tail: Any
    """The feedback (18) for the last move of a shifted plan."""
    motion: Any
    """A (36), B (18)."""
    limits: Any
    """The centre (3) and the bound."""
    mean: Any
    """Workspace: a matrix (36), column by column, for discretising the motion."""
    term: Any
    """A second such matrix (36)."""
    plan: Any
    """The moves (3 each)."""
    states: Any
    """The states (6 each) under the plan, from the first to the one after the last move."""
    gradient: Any
    """The gradient of half the cost with respect to each move (3 each)."""
    step: Any
    """The step of each move (3 each), to which the feedback adds."""
    feedback: Any
    """The feedback of each move on a change of the state before it (18 each)."""
    stiffness: Any
    """The trace of each move's curvature."""
    trial: Any
    """A plan on trial (3 each)."""
    bend: Any
    """The change that the trial plan makes to the state after each move (6 each)."""
    multipliers: Any
    """Multipliers of the limits, in the interior-point method (3 each)."""
    spare: Any
    """A stored plan (3 each)."""


def _sizes(n: Index, *, dense: bool) -> Store:
    q, r = (36, 9) if dense else (6, 3)
    return Store(
        counters=COUNTERS,
        weights=q + r + r + 36,
        tail=18,
        motion=54,
        limits=4,
        mean=36,
        term=36,
        plan=3 * n,
        states=6 * n + 6,
        gradient=3 * n,
        step=3 * n,
        feedback=18 * n,
        stiffness=n,
        trial=3 * n,
        bend=6 * n,
        multipliers=3 * n,
        spare=3 * n,
    )


def carve(problem: Problem) -> Store:
    """Return the parts of a program's numbers as views; nothing is copied."""
    sizes = _sizes(problem.horizon, dense=problem.dense)
    starts = accumulate(sizes, initial=0)
    return Store(*(problem.numbers.part(start, size) for start, size in zip(starts, sizes, strict=False)))


def size(horizon: int, *, dense: bool = False) -> int:
    """Return the number of numbers in a program of that many moves."""
    *_, end = accumulate(_sizes(horizon, dense=dense))
    return end


class Weights(NamedTuple):
    """The weights Q and R, full or as their diagonals, the inverse of R, and P."""

    q: Weight
    r: Weight
    r_inverse: Weight
    p: Rows


def weights(problem: Problem) -> Weights:
    """Return the weights of the cost."""
    numbers = carve(problem).weights
    q, r = (36, 9) if problem.dense else (6, 3)
    parts = [numbers.part(start, length) for start, length in ((0, q), (q, r), (q + r, r), (q + r + r, 36))]
    if problem.dense:
        return Weights(matrix(parts[0], 6), matrix(parts[1], 3), matrix(parts[2], 3), matrix(parts[3], 6))
    return Weights(parts[0].row(0, 6), parts[1].row(0, 3), parts[2].row(0, 3), matrix(parts[3], 6))


def motion(problem: Problem) -> tuple[Rows, Rows]:
    """Return A (6, 6) and B (6, 3)."""
    numbers = carve(problem).motion
    return matrix(numbers.part(0, 36), 6), matrix(numbers.part(36, 18), 3)


def limits(problem: Problem) -> Limits:
    """Return the limits of every move."""
    numbers = carve(problem).limits
    return make_limits(triple(numbers, 0), numbers[3], ball=problem.ball)


def put_limits(problem: Problem, centre: Vector, bound: Scalar) -> None:
    """Set the limits: their centre and their bound (inf: none)."""
    carve(problem).limits.put(0, (*centre, bound))
