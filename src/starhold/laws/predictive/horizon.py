"""Passes over the horizon of a predictive program, each in time proportional to its length: states under a plan, the
gradient, the Newton step by a backward Riccati sweep, and simulations of a step with the limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

from starhold.algebra.scalar import Scalar, Truth, both, either, less, less_equal, where
from starhold.algebra.structured import Index, function, repeat, unless
from starhold.algebra.vector import Vector, add, dot, subtract
from starhold.laws.predictive import sixes
from starhold.laws.predictive.limits import (
    Limits,
    Symmetric,
    box_inverse,
    inverse,
    loose,
    plane_inverse,
    pressing,
    pressure,
    project,
    repelled,
)
from starhold.laws.predictive.problem import Problem, Store, carve, limits, motion, weights
from starhold.laws.predictive.sixes import Numbers, Rows, entry, form, is_diagonal, transposed, triple

REST: Numbers = (0.0,) * 6
"""The state at rest on target."""


def transition(a: Rows, b: Rows, x: Numbers, v: Vector) -> Numbers:
    """Return A x + B v."""
    return tuple(sixes.dot(row, x, dot(cast(Vector, push), v)) for row, push in zip(a, b, strict=True))


@function
def rollout(problem: Problem) -> Scalar:
    """Compute the states under the plan; return half its cost."""
    store, (a, b), weight = carve(problem), motion(problem), weights(problem)

    def stage(k: Index, cost: Scalar, x: Numbers) -> tuple[Scalar, Numbers]:
        v = triple(store.plan, k)
        after = transition(a, b, x, v)
        store.states.put(k + 1, after)
        return cost + (form(weight.q, x) + form(weight.r, v)), after

    cost, x = repeat(problem.horizon, stage, 0.0, store.states.row(0, 6))
    return 0.5 * (cost + form(weight.p, x))


@function
def adjoint(problem: Problem) -> Scalar:
    """Compute the gradient of half the cost; return a bound on its gap to the optimum, valid if the limits that hold moves
    are the active ones."""
    store, (a, b), weight, bounds = carve(problem), motion(problem), weights(problem), limits(problem)
    n, columns, pushes = problem.horizon, transposed(a), transposed(b)

    def stage(back: Index, gap: Scalar, y: Numbers) -> tuple[Scalar, Numbers]:
        k = n - 1 - back
        v, x = triple(store.plan, k), store.states.row(k, 6)
        g = cast(Vector, tuple(sixes.dot(push, y, r) for push, r in zip(pushes, _weighed(weight.r, v), strict=True)))
        store.gradient.put(k, g)
        return gap + form(weight.r_inverse, loose(bounds, v, g)), _costate(weight.q, columns, x, y)

    gap, _ = repeat(n, stage, 0.0, sixes.apply(weight.p, store.states.row(n, 6)))
    return 0.5 * gap


def _weighed(r: Any, v: Vector) -> Vector:
    """Return R v."""
    return (r[0] * v[0], r[1] * v[1], r[2] * v[2]) if is_diagonal(r) else (dot(r[0], v), dot(r[1], v), dot(r[2], v))


def _costate(q: Any, columns: Rows, x: Numbers, y: Numbers) -> Numbers:
    """Return Q x + A'y, added term by term."""

    def component(i: int) -> Scalar:
        total = 0.0
        for j in range(6):
            term = columns[i][j] * y[j]
            if not is_diagonal(q) or i == j:
                term = entry(q, i, j) * x[j] + term
            total = total + term
        return total

    return tuple(component(i) for i in range(6))


class Value(NamedTuple):
    """Half the optimal cost-to-go of a state x is x'curvature x / 2 + slope'x + constant. The Newton decrement and the
    number of active limits are sums over the moves so far."""

    curvature: Rows
    slope: Numbers
    decrement: Scalar
    holding: Scalar


@function
def sweep(problem: Problem, barrier: Scalar) -> tuple[Scalar, Scalar]:
    """Compute the Newton step by one backward Riccati sweep, as a policy: step + feedback (x - x of the plan). Moves that
    press against a limit are fixed there; with a zero gradient none are, which gives the policy without limits. Return the
    Newton decrement and the number of active limits.

    A barrier above zero gives the step of the interior-point method instead: no move is fixed, and the limits repel."""
    store, (a, b), weight, bounds = carve(problem), motion(problem), weights(problem), limits(problem)
    n, columns, pushes = problem.horizon, transposed(a), transposed(b)
    holds = less_equal(barrier, 0.0)

    def stage(back: Index, value: Value) -> tuple[Value]:
        k = n - 1 - back
        # Columns of P A, P B and B'P A.
        onward = transposed(sixes.product(value.curvature, a))
        pushed = transposed(sixes.product(value.curvature, b))
        cross = transposed(tuple(sixes.apply(onward, push) for push in pushes))
        m = _curvature(weight.r, pushes, pushed)
        store.stiffness[k] = m[0] + m[3] + m[5]
        v, pull = triple(store.plan, k), triple(store.gradient, k)
        g = add(cast(Vector, sixes.apply(pushes, value.slope)), pull)

        def repel(m: Symmetric, g: Vector) -> tuple[Symmetric, Vector]:
            curved, push = repelled(bounds, v, triple(store.multipliers, k), barrier, m)
            return curved, add(g, push)

        m, g = unless(holds, repel, m, g)
        w, holding = _held_inverse(bounds, v, pull, m, holds)
        step = _minus(w, g)
        gains = tuple(_minus(w, cast(Vector, column)) for column in cross)
        store.step.put(k, step)
        store.feedback.put(k, [x for row in transposed(gains) for x in row])
        curvature = tuple(
            tuple(sixes.dot(columns[i], onward[j], sixes.dot(cross[i], gains[j], entry(weight.q, i, j))) for j in range(6))
            for i in range(6)
        )
        slope = tuple(sixes.dot(columns[i], value.slope, dot(cast(Vector, cross[i]), step)) for i in range(6))
        return (Value(_symmetric(curvature), slope, value.decrement - dot(step, g), value.holding + holding),)

    (value,) = repeat(n, stage, Value(weight.p, REST, 0.0, 0.0))
    return value.decrement, value.holding


def _held_inverse(bounds: Limits, v: Vector, g: Vector, m: Symmetric, holds: Truth) -> tuple[Symmetric, Scalar]:
    """Return the inverse of m on the free directions, and the number of active limits."""
    if bounds.ball:
        normal, multiplier = pressure(bounds, v, g)
        pressed = both(holds, less(0.0, multiplier))
        pairs = zip(plane_inverse(m, normal, multiplier), inverse(m), strict=True)
        return cast(Symmetric, tuple(where(pressed, x, y) for x, y in pairs)), where(pressed, 1.0, 0.0)
    x, y, z = pressing(bounds, v, g)
    fixed = (both(holds, x), both(holds, y), both(holds, z))
    count = [where(axis, 1.0, 0.0) for axis in fixed]
    return box_inverse(m, fixed), count[0] + count[1] + count[2]


def _curvature(r: Any, pushes: Rows, pushed: Rows) -> Symmetric:
    """Return R + B'P B."""

    def at(i: int, j: int) -> Scalar:
        return sixes.dot(pushes[i], pushed[j], entry(r, i, j))

    return (at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2))


def _minus(w: Symmetric, x: Vector) -> Vector:
    """Return -w x."""
    return (
        -(w[0] * x[0] + w[1] * x[1] + w[2] * x[2]),
        -(w[1] * x[0] + w[3] * x[1] + w[4] * x[2]),
        -(w[2] * x[0] + w[4] * x[1] + w[5] * x[2]),
    )


def _symmetric(m: Rows) -> Rows:
    """Return the matrix made symmetric: long horizons would amplify the rounding."""

    def at(i: int, j: int) -> Scalar:
        return m[i][i] if i == j else 0.5 * (m[max(i, j)][min(i, j)] + m[min(i, j)][max(i, j)])

    return tuple(tuple(at(i, j) for j in range(6)) for i in range(6))


def policy(store: Store, k: Index, x: Numbers, start: Vector) -> Vector:
    """Return start + feedback x."""

    def component(i: int) -> Scalar:
        return sixes.dot(store.feedback.row(3 * k + i, 6), x, start[i])

    return (component(0), component(1), component(2))


@function
def unroll(problem: Problem) -> None:
    """Turn the policy into a direction: `step` becomes the Newton step without limits."""
    store, (a, b) = carve(problem), motion(problem)

    def stage(k: Index, x: Numbers) -> tuple[Numbers]:
        d = policy(store, k, x, triple(store.step, k))
        store.step.put(k, d)
        return (transition(a, b, x, d),)

    repeat(problem.horizon, stage, REST)


class Trial(NamedTuple):
    """A trial plan: whether a limit cut a move, and the change of half the cost, slope + curvature / 2, which avoids the
    cancellation in a difference of two costs."""

    cut: Truth
    slope: Scalar
    change: Scalar


def fly(problem: Problem, move: Callable[[Index, Numbers, Vector], Vector], start: Numbers) -> Trial:
    """Simulate moves with the limits: compute the trial plan, and the change of the states from `start` on. move(k, x, v)
    is the k-th move, v in the plan, desired for a change x of the state before it."""
    store, (a, b), weight, bounds = carve(problem), motion(problem), weights(problem), limits(problem)

    def stage(k: Index, trial: Trial, x: Numbers) -> tuple[Trial, Numbers]:
        v = triple(store.plan, k)
        w, outside = project(bounds, move(k, x, v))
        d = subtract(w, v)
        after = transition(a, b, x, d)
        store.trial.put(k, w)
        store.bend.put(k, after)
        slope = trial.slope + dot(triple(store.gradient, k), d)
        curvature = trial.change + (form(weight.r, d) + form(weight.q, x))
        return Trial(either(trial.cut, outside), slope, curvature), after

    (cut, slope, curvature), x = repeat(problem.horizon, stage, Trial(False, 0.0, 0.0), start)
    return Trial(cut, slope, slope + 0.5 * (curvature + form(weight.p, x)))


@function
def follow(problem: Problem, start: Numbers) -> Trial:
    """Simulate the policy of a sweep with the limits."""
    store = carve(problem)
    return fly(problem, lambda k, x, v: policy(store, k, x, add(v, triple(store.step, k))), start)


@function
def take_over(problem: Problem) -> None:
    """Replace the plan by the trial plan."""
    store = carve(problem)

    def stage(k: Index) -> None:
        store.plan.put(k, triple(store.trial, k))
        store.states.put(k + 1, sixes.plus(store.states.row(k + 1, 6), store.bend.row(k, 6)))

    repeat(problem.horizon, stage)
