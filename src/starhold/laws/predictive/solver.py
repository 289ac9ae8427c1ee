# pyright: basic
# Basic, not strict: every function is compiled, and Numba's own types are not visible to a type checker.
"""Quadratic programs of predictive control, solved inside a compiled kernel: no allocation, no Python, no library.

The method is a projected Newton method of two metrics (Bertsekas 1982, "Projected Newton methods for optimization
problems with simple constraints"). What presses against a limit is held there, for a ball with the curvature of the
sphere; the rest takes the Newton step, which one backward Riccati sweep gives in time proportional to N. The step is
flown with its feedback through the limits, so moves further on already answer to those that were cut; where that does
not bring the cost down, a search along the projected line does. Programs on which this is slow are handed to an
interior-point method, whose answer is the next start; a scaled gradient step, which always descends, is the last
resort. A run ends when the gap to the optimum is proved small: for multipliers of the right sign, strong convexity
bounds the gap of half the cost by g'R^-1 g / 2, g being the gradient that is not held.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from starhold.laws.predictive.horizon import adjoint, form, form3, rollout, sweep, transition, unroll
from starhold.laws.predictive.limits import project, put, slack, triple
from starhold.laws.predictive.problem import Problem, carve, compiled, make_store

TOLERANCE = 1e-16
"""Relative gap of the objective at which a solution is accepted."""
SUFFICIENT = 1e-4
"""Share of the decrease promised by the slope that a step must bring."""
HALVINGS = 8
PATIENCE = 12
"""Sweeps without a solution after which the interior-point method takes over."""
INTERIOR_SWEEPS = 30


@compiled
def follow(problem, plan, space):
    """Fly the policy of a sweep through the limits from space.bend[0:6]: the trial plan, and its change of the states.
    Says whether a limit cut anything."""
    cut = False
    bend, feedback = space.bend, space.feedback
    for k in range(plan.size // 3):
        v = triple(plan, k)
        w0, w1, w2 = v[0] + space.step[3 * k], v[1] + space.step[3 * k + 1], v[2] + space.step[3 * k + 2]
        o = 18 * k
        for j in range(6):
            s = bend[6 * k + j]
            w0 += feedback[o + j] * s
            w1 += feedback[o + 6 + j] * s
            w2 += feedback[o + 12 + j] * s
        w, outside = project((w0, w1, w2), problem)
        cut = cut or outside
        put(space.trial, k, w)
        transition(problem, bend, 6 * k, (w[0] - v[0], w[1] - v[1], w[2] - v[2]), bend, 6 * k + 6)
    return cut


@compiled
def along(problem, plan, space, length):
    """The trial plan at that length of the step, brought within the limits, and its change of the states."""
    for k in range(plan.size // 3):
        v, d = triple(plan, k), triple(space.step, k)
        w, _ = project((v[0] + length * d[0], v[1] + length * d[1], v[2] + length * d[2]), problem)
        put(space.trial, k, w)
        transition(problem, space.bend, 6 * k, (w[0] - v[0], w[1] - v[1], w[2] - v[2]), space.bend, 6 * k + 6)


@compiled
def change(problem, plan, space):
    """Slope and curvature of half the cost towards the trial plan: it changes by slope + curvature / 2, free of the
    cancellation that a difference of two costs suffers."""
    slope, curvature = 0.0, 0.0
    n = plan.size // 3
    for k in range(n):
        v, w, g = triple(plan, k), triple(space.trial, k), triple(space.gradient, k)
        d = (w[0] - v[0], w[1] - v[1], w[2] - v[2])
        slope += g[0] * d[0] + g[1] * d[1] + g[2] * d[2]
        curvature += form3(problem.r, d) + form(problem.q, space.bend, 6 * k)
    return slope, curvature + form(problem.p, space.bend, 6 * n)


@compiled
def shorten(problem, plan, space, halvings):
    """Armijo's search along the projection arc of `space.step`, the step halved until the cost falls enough. Returns the
    change of half the cost, zero where it never did."""
    length = 1.0
    for _ in range(halvings):
        along(problem, plan, space, length)
        slope, curvature = change(problem, plan, space)
        if slope < 0.0 and slope + 0.5 * curvature <= SUFFICIENT * slope:
            return slope + 0.5 * curvature
        length *= 0.5
    return 0.0


@compiled
def search(problem, plan, space, decrement):
    """A trial plan along the Newton step that brings the cost down; returns the change of half the cost, zero where
    none was found."""
    slope, curvature = change(problem, plan, space)
    if slope + 0.5 * curvature <= -0.25 * decrement:
        return slope + 0.5 * curvature
    unroll(plan, problem, space)
    return shorten(problem, plan, space, HALVINGS)


@compiled
def descend(problem, plan, space):
    """A trial plan along the gradient, each move in its own scale: the projection guarantees descent for short steps.
    Returns the change of half the cost, zero where rounding hides any."""
    for k in range(plan.size // 3):
        s = -1.0 / space.stiffness[k]
        g = triple(space.gradient, k)
        put(space.step, k, (s * g[0], s * g[1], s * g[2]))
    return shorten(problem, plan, space, 60)


@compiled
def accept(plan, space):
    """Take the trial plan over."""
    for i in range(plan.size):
        plan[i] = space.trial[i]
    for i in range(6, space.states.size):
        space.states[i] += space.bend[i]


@compiled
def interior(problem, plan, space, half, budget):
    """The primal-dual interior-point method (Boyd and Vandenberghe 2004, section 11.7), for programs on which the
    projected Newton method is slow: it comes near the optimum in a number of sweeps that hardly depends on the program,
    and what then lies near a limit is put on it. The better of its plan and the one given is kept. Returns the sweeps.
    """
    n = plan.size // 3
    c, bound, spare, multipliers, x = problem.centre, problem.bound, space.spare, space.multipliers, space.states
    per = 1 if problem.ball else 3
    count = per * n
    barrier = 0.1 * half / count
    for k in range(n):
        v = triple(plan, k)
        put(spare, k, v)
        w = (c[0] + 0.9 * (v[0] - c[0]), c[1] + 0.9 * (v[1] - c[1]), c[2] + 0.9 * (v[2] - c[2]))
        put(plan, k, w)
        s = slack(problem, w)
        put(multipliers, k, (barrier / s[0], barrier / s[1], barrier / s[2]))
    now = rollout(problem, plan, x)
    sweeps = 0
    while sweeps < min(budget, INTERIOR_SWEEPS):
        adjoint(problem, plan, space)
        sweep(problem, plan, space, barrier)
        sweeps += 1
        unroll(plan, problem, space)
        length = 1.0
        for k in range(n):
            v, d, s = triple(plan, k), triple(space.step, k), slack(problem, triple(plan, k))
            e = (v[0] - c[0], v[1] - c[1], v[2] - c[2])
            dot = (e[0] * d[0], e[1] * d[1], e[2] * d[2])
            square = (d[0] * d[0], d[1] * d[1], d[2] * d[2])
            if problem.ball:
                total, long = dot[0] + dot[1] + dot[2], square[0] + square[1] + square[2]
                dot, square = (total, total, total), (long, long, long)
            for i in range(per):
                old = multipliers[3 * k + i]
                new = barrier / s[i] - old + old / s[i] * dot[i]
                space.trial[3 * k + i] = new
                if new < 0.0:
                    length = min(length, -0.95 * old / new)
                # Where the step leaves the limit: slack(v + t d) = 0.
                ahead = dot[i] + math.sqrt(dot[i] * dot[i] + 2.0 * s[i] * square[i])
                if ahead > 0.0:
                    length = min(length, 0.95 * 2.0 * s[i] / ahead)
        gap = 0.0
        for k in range(n):
            v, d = triple(plan, k), triple(space.step, k)
            w = (v[0] + length * d[0], v[1] + length * d[1], v[2] + length * d[2])
            put(plan, k, w)
            s = slack(problem, w)
            for i in range(per):
                multipliers[3 * k + i] += length * space.trial[3 * k + i]
                gap += multipliers[3 * k + i] * s[i]
        now = rollout(problem, plan, x)
        barrier = (0.1 if length > 0.5 else 0.5) * gap / count
        # Short steps near the end: the slacks have lost their digits.
        if gap <= (1e-8 if length > 0.5 else 1e-5) * now:
            break
    for k in range(n):
        v, s = triple(plan, k), slack(problem, triple(plan, k))
        near = 1e-5 * bound * bound
        d = (v[0] - c[0], v[1] - c[1], v[2] - c[2])
        stretch = (
            2.0 if s[0] < near else 1.0,
            2.0 if s[per // 2] < near else 1.0,
            2.0 if s[per - 1] < near else 1.0,
        )
        w, _ = project((c[0] + stretch[0] * d[0], c[1] + stretch[1] * d[1], c[2] + stretch[2] * d[2]), problem)
        put(plan, k, w)
    now = rollout(problem, plan, x)
    if not now <= half:
        for i in range(plan.size):
            plan[i] = spare[i]
        rollout(problem, plan, x)
    return sweeps


@compiled
def improve(problem: Any, plan: Any, space: Any, budget: int, warm: bool) -> tuple[int, bool, bool]:
    """Solve the program from the state in space.states[0:6], starting with `plan` if warm; the plan is overwritten.

    Returns the number of Riccati sweeps, whether the optimum was reached within `budget` of them, and whether limits
    shape it. The plan respects the limits in any case.
    """
    x = space.states
    sweeps = 0
    if not warm:
        # The policy without limits, flown through them: the optimum if nothing is cut, else a good start.
        for i in range(plan.size):
            plan[i], space.gradient[i] = 0.0, 0.0
        for i in range(6):
            space.bend[i] = x[i]
        for i in range(6, x.size):
            x[i] = 0.0
        sweep(problem, plan, space, 0.0)
        sweeps = 1
        cut = follow(problem, plan, space)
        accept(plan, space)
        if not cut:
            return sweeps, True, False
    half = rollout(problem, plan, x)
    rescued = False
    while True:
        if adjoint(problem, plan, space) <= TOLERANCE * half:
            return sweeps, True, True
        if sweeps >= budget:
            return sweeps, False, True
        if sweeps >= PATIENCE and not rescued:
            sweeps += interior(problem, plan, space, half, budget - sweeps)
            half = rollout(problem, plan, x)
            rescued = True
            continue
        decrement, holding = sweep(problem, plan, space, 0.0)
        sweeps += 1
        for i in range(6):
            space.bend[i] = 0.0
        cut = follow(problem, plan, space)
        if not cut and (holding == 0 or not problem.ball):
            # The exact optimum of what is not held.
            accept(plan, space)
            half -= 0.5 * decrement
            if holding == 0:
                return sweeps, True, False
            if decrement <= TOLERANCE * half:
                return sweeps, True, True
            continue
        fall = search(problem, plan, space, decrement)
        if fall == 0.0 and decrement > 1e-12 * half and not rescued and sweeps < budget:
            sweeps += interior(problem, plan, space, half, budget - sweeps)
            half = rollout(problem, plan, x)
            rescued = True
            continue
        if fall == 0.0:
            fall = descend(problem, plan, space)
        if fall == 0.0:
            # Rounding hides any further descent.
            return sweeps, decrement <= 1e-12 * half, True
        accept(plan, space)
        half += fall


@compiled
def advance(problem: Any, plan: Any, tail: Any, space: Any) -> None:
    """Shift a solved plan by one move; the last is the feedback -tail x at its end."""
    n = plan.size // 3
    last = 6 * n
    for i in range(plan.size - 3):
        plan[i] = plan[i + 3]
    v0, v1, v2 = 0.0, 0.0, 0.0
    for j in range(6):
        s = space.states[last + j]
        v0 -= tail[j] * s
        v1 -= tail[6 + j] * s
        v2 -= tail[12 + j] * s
    put(plan, n - 1, (v0, v1, v2))
    for k in range(n):
        # The centre moves with the target.
        w, _ = project(triple(plan, k), problem)
        put(plan, k, w)


class Solution(NamedTuple):
    """plan (N, 3), its cost, the number of Riccati sweeps, and whether the optimum was reached."""

    plan: np.ndarray
    cost: float
    sweeps: int
    solved: bool


@compiled
def solve(a, b, q, r, p, x, horizon, bound, centre, ball, budget):
    """Solve one program from scratch: A (6, 6), B (6, 3), Q (6, 6), R (3, 3) and P (6, 6) symmetric, Q and P positive
    semidefinite, R positive definite; x (6); limits |v - centre| <= bound per axis or, with ball, in norm (inf: none).
    For use outside kernels: it allocates.
    """
    space = carve(make_store(horizon), horizon).space
    problem = Problem(a.ravel(), b.ravel(), q.ravel(), r.ravel(), np.linalg.inv(r).ravel(), p.ravel(), centre, bound, ball)
    plan = np.zeros(3 * horizon)
    space.states[:6] = x
    sweeps, solved, _ = improve(problem, plan, space, budget, False)
    space.states[:6] = x
    cost = 2.0 * rollout(problem, plan, space.states)
    return Solution(plan.reshape((horizon, 3)), cost, sweeps, solved)
