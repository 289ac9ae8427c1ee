"""The interior-point method of the predictive law, for programs on which the projected Newton method is slow."""

from __future__ import annotations

from typing import Any, NamedTuple

from starhold.algebra.scalar import Scalar, Truth, divide, either, less, less_equal, minimum, sqrt, where
from starhold.algebra.structured import Index, function, repeat, unless, until
from starhold.algebra.vector import Vector, add, scale, subtract, times
from starhold.algebra.words import number_of
from starhold.laws.predictive.horizon import adjoint, rollout, sweep, unroll
from starhold.laws.predictive.limits import project, slack
from starhold.laws.predictive.problem import Problem, carve, limits
from starhold.laws.predictive.sixes import triple

MOST_SWEEPS = 30
INWARD = 0.9
"""A move starts at this share of its distance from the centre."""
SHORT_OF = 0.95
"""A step covers this share of the way to the nearest limit."""


class Turn(NamedTuple):
    """The state of the method: the barrier parameter, the sweeps so far, and whether it has ended."""

    barrier: Scalar
    sweeps: Scalar
    done: Truth


@function
def interior(problem: Problem, half: Scalar, most: Scalar) -> tuple[Scalar, Scalar]:
    """Solve by the primal-dual interior-point method (Boyd and Vandenberghe 2004, section 11.7): it approaches the optimum
    in a number of sweeps that hardly depends on the program, and then moves that are near a limit are put on it. The better
    of its plan and the given one, of this half cost, is kept. Return the sweeps, at most `most`, and half the cost."""
    count = number_of(_pairs(problem) * problem.horizon)
    barrier = 0.1 * half / count
    _begin(problem, barrier)
    rollout(problem)

    def done(now: Turn) -> Truth:
        return now.done

    def turn(now: Turn) -> tuple[Turn]:
        return (_turn(problem, now, count, most),)

    def restore(_half: Scalar) -> tuple[Scalar]:
        return (_restore(problem),)

    (end,) = until(done, turn, Turn(barrier, 0.0, less_equal(most, 0.0)), at_most=MOST_SWEEPS)
    _settle(problem)
    reached = rollout(problem)
    (kept,) = unless(less_equal(reached, half), restore, reached)
    return end.sweeps, kept


def _pairs(problem: Problem) -> int:
    """Return pairs of a multiplier and a slack for each move."""
    return 1 if problem.ball else 3


def _begin(problem: Problem, barrier: Scalar) -> None:
    """Store the plan, and start well inside the limits."""
    store, bounds = carve(problem), limits(problem)

    def stage(k: Index) -> None:
        v = triple(store.plan, k)
        store.spare.put(k, v)
        w = add(bounds.centre, scale(INWARD, subtract(v, bounds.centre)))
        store.plan.put(k, w)
        store.multipliers.put(k, [divide(barrier, s) for s in slack(bounds, w)])

    repeat(problem.horizon, stage)


def _turn(problem: Problem, now: Turn, count: Scalar, most: Scalar) -> Turn:
    """Take one step towards the optimum for this barrier, then lower the barrier."""
    adjoint(problem)
    sweep(problem, now.barrier)
    unroll(problem)
    length = _length(problem, now.barrier)
    gap = _go(problem, length)
    half = rollout(problem)
    sweeps, long = now.sweeps + 1.0, less(0.5, length)
    # Short steps near the end: the slacks have lost their digits.
    near = less_equal(gap, where(long, 1e-8, 1e-5) * half)
    return Turn(where(long, 0.1, 0.5) * gap / count, sweeps, either(near, less_equal(most, sweeps)))


def _length(problem: Problem, barrier: Scalar) -> Scalar:
    """Return the share of the step that keeps slacks and multipliers positive; put the multipliers' steps into `trial`."""
    store, bounds = carve(problem), limits(problem)

    def stage(k: Index, length: Scalar) -> tuple[Scalar]:
        v, d = triple(store.plan, k), triple(store.step, k)
        room, away = slack(bounds, v), subtract(v, bounds.centre)
        inner, square = _joined(problem, times(away, d)), _joined(problem, times(d, d))
        for i in range(_pairs(problem)):
            old = store.multipliers[3 * k + i]
            step = divide(barrier, room[i]) - old + divide(old, room[i]) * inner[i]
            store.trial[3 * k + i] = step
            shorter = minimum(divide(-SHORT_OF * old, step), length)
            length = where(less(step, 0.0), shorter, length)
            # Where the step leaves the limit: slack(v + t d) = 0.
            ahead = inner[i] + sqrt(inner[i] * inner[i] + 2.0 * room[i] * square[i])
            shorter = minimum(divide(SHORT_OF * 2.0 * room[i], ahead), length)
            length = where(less(0.0, ahead), shorter, length)
        return (length,)

    (length,) = repeat(problem.horizon, stage, 1.0)
    return length


def _joined(problem: Problem, x: Vector) -> Vector:
    """Return the components of x; for a ball, three times their sum."""
    total = x[0] + x[1] + x[2]
    return (total, total, total) if problem.ball else x


def _go(problem: Problem, length: Scalar) -> Scalar:
    """Take that share of the step; return the sum of slack times multiplier."""
    store, bounds = carve(problem), limits(problem)

    def stage(k: Index, gap: Scalar) -> tuple[Scalar]:
        w = add(triple(store.plan, k), scale(length, triple(store.step, k)))
        store.plan.put(k, w)
        room = slack(bounds, w)
        for i in range(_pairs(problem)):
            multiplier = store.multipliers[3 * k + i] + length * store.trial[3 * k + i]
            store.multipliers[3 * k + i] = multiplier
            gap = gap + multiplier * room[i]
        return (gap,)

    (gap,) = repeat(problem.horizon, stage, 0.0)
    return gap


def _settle(problem: Problem) -> None:
    """Put moves that are near a limit on it."""
    store, bounds = carve(problem), limits(problem)
    near = 1e-5 * bounds.bound * bounds.bound

    def stage(k: Index) -> None:
        v = triple(store.plan, k)
        room = slack(bounds, v)
        stretch: Any = [where(less(s, near), 2.0, 1.0) for s in room]
        w, _ = project(bounds, add(bounds.centre, times(stretch, subtract(v, bounds.centre))))
        store.plan.put(k, w)

    repeat(problem.horizon, stage)


def _restore(problem: Problem) -> Scalar:
    """Restore the stored plan; return half its cost."""
    store = carve(problem)

    def stage(k: Index) -> None:
        store.plan.put(k, triple(store.spare, k))

    repeat(problem.horizon, stage)
    return rollout(problem)
