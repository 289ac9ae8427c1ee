"""Solves quadratic programs of predictive control by equations, with bounded work and without allocation or libraries.

The method is a two-metric projected Newton method (Bertsekas 1982, "Projected Newton methods for optimization problems with
simple constraints"). Moves that press against a limit are fixed there (on a ball, with the curvature of the sphere); the
others take the Newton step, computed by one backward Riccati sweep in time proportional to N. The step is simulated with
its feedback and the limits, so later moves already respond to those that were limited; where that does not reduce the cost,
a search along the projected line does. Programs on which this is slow go to an interior-point method, whose result is the
next start; a scaled gradient step, which always descends, is the last resort. A run ends when the optimality gap is proved
small: for multipliers of the right sign, strong convexity bounds the gap of half the cost by g'R^-1 g / 2, with g the
gradient of the free moves.
"""

from __future__ import annotations

from typing import NamedTuple

from starhold.algebra.scalar import Scalar, Truth, both, divide, either, is_finite, less, less_equal, opposite, where
from starhold.algebra.structured import Index, function, repeat, unless, until, when
from starhold.algebra.vector import ZERO, Vector, add, scale
from starhold.algebra.words import number_of
from starhold.laws.predictive import sixes
from starhold.laws.predictive.horizon import REST, adjoint, fly, follow, rollout, sweep, take_over, unroll
from starhold.laws.predictive.interior import interior
from starhold.laws.predictive.limits import project
from starhold.laws.predictive.problem import Problem, carve, limits
from starhold.laws.predictive.sixes import triple

TOLERANCE = 1e-16
"""Relative gap of the objective at which a solution is accepted."""
STALLED = 1e-12
"""Relative Newton decrement below which a plan that cannot be improved counts as solved."""
ENOUGH = 0.25
"""Share of the Newton decrement by which the simulated step must reduce the cost to be taken without a search."""
SUFFICIENT = 1e-4
"""Share of the decrease predicted by the slope that a step must achieve."""
HALVINGS, MOST_HALVINGS = 8, 60
"""Most lengths tried along the Newton step, and along the gradient."""
PATIENCE = 12
"""Sweeps without a solution after which the interior-point method takes over."""


class Solved(NamedTuple):
    """Result of a run: the number of Riccati sweeps, whether the optimum was reached, and whether limits are active."""

    sweeps: Scalar
    solved: Truth
    shaped: Truth


class Progress(NamedTuple):
    """Progress of a run: half the cost of the plan, the sweeps so far, whether the interior-point method has been used,
    whether the run is over, and the fields of `Solved` so far."""

    half: Scalar
    sweeps: Scalar
    rescued: Truth
    over: Truth
    solved: Truth
    shaped: Truth


class Attempt(NamedTuple):
    """Result of a Newton step, and whether the interior-point method is to be used."""

    progress: Progress
    rescue: Truth


def improve(problem: Problem, budget: Index, warm: Truth) -> Solved:
    """Solve the program from its first state, starting from its plan if `warm`; the plan is overwritten. At most `budget`
    sweeps are made; the plan respects the limits in any case."""

    def fly_freely(_sweeps: Scalar, _cut: Truth) -> tuple[Scalar, Truth]:
        return 1.0, _fly_freely(problem)

    def descend(start: Solved) -> tuple[Solved]:
        return (_descend(problem, budget, start.sweeps),)

    sweeps, cut = unless(warm, fly_freely, 0.0, True)
    (end,) = when(cut, descend, Solved(sweeps, True, False))
    return end


def _fly_freely(problem: Problem) -> Truth:
    """Simulate the unlimited policy with the limits; if they cut no move, it is the optimum."""
    store = carve(problem)

    def clear(k: Index) -> None:
        store.plan.put(k, ZERO)
        store.gradient.put(k, ZERO)

    repeat(problem.horizon, clear)
    sweep(problem, 0.0)
    trial = follow(problem, store.states.row(0, 6))

    def keep(k: Index) -> None:
        store.plan.put(k, triple(store.trial, k))

    repeat(problem.horizon, keep)
    return trial.cut


def _descend(problem: Problem, budget: Index, sweeps: Scalar) -> Solved:
    """Improve the plan until it is optimal or the sweeps are used up."""

    def over(now: Progress) -> Truth:
        return now.over

    def turn(now: Progress) -> tuple[Progress]:
        return (_turn(problem, budget, now),)

    begun = Progress(rollout(problem), sweeps, False, False, False, True)
    # Each iteration except the last makes a sweep.
    (end,) = until(over, turn, begun, at_most=budget + 1)
    # A plan that is not finite must not start the next one.
    return Solved(end.sweeps, end.solved, both(end.shaped, is_finite(end.half)))


def _turn(problem: Problem, budget: Index, now: Progress) -> Progress:
    """End the run or improve the plan in one turn."""
    optimal = less_equal(adjoint(problem), TOLERANCE * now.half)
    used_up = less_equal(number_of(budget), now.sweeps)

    def better(_ended: Progress) -> tuple[Progress]:
        return (_better(problem, budget, now),)

    (then,) = unless(either(optimal, used_up), better, now._replace(over=True, solved=optimal))
    return then


def _better(problem: Problem, budget: Index, now: Progress) -> Progress:
    """Take a Newton step, or use the interior-point method where that fails."""

    def newton(_tried: Attempt) -> tuple[Attempt]:
        return (_newton(problem, budget, now),)

    def rescue(before: Progress) -> tuple[Progress]:
        sweeps, half = interior(problem, before.half, number_of(budget) - before.sweeps)
        return (before._replace(half=half, sweeps=before.sweeps + sweeps, rescued=True),)

    slow = both(less_equal(PATIENCE, now.sweeps), opposite(now.rescued))
    (tried,) = unless(slow, newton, Attempt(now, slow))
    (then,) = when(tried.rescue, rescue, tried.progress)
    return then


def _newton(problem: Problem, budget: Index, now: Progress) -> Attempt:
    """Take the projected Newton step, a search along it, or a gradient step, whichever first reduces the cost."""

    def search(_change: Scalar) -> tuple[Scalar]:
        return (_search(problem),)

    def gradient_step(_change: Scalar) -> tuple[Scalar]:
        return (_gradient_step(problem),)

    decrement, holding = sweep(problem, 0.0)
    sweeps = now.sweeps + 1.0
    trial = follow(problem, REST)
    none_held = less_equal(holding, 0.0)
    # The simulated step gives the exact optimum of the free moves; on a ball only if all moves are free.
    free = opposite(trial.cut)
    free = both(free, none_held) if problem.ball else free
    change = where(free, -(0.5 * decrement), trial.change)
    enough = either(free, less_equal(change, -ENOUGH * decrement))
    (change,) = unless(enough, search, change)
    failed = both(opposite(free), _is_zero(change))
    hopeful = both(less(STALLED * now.half, decrement), less(sweeps, number_of(budget)))
    rescue = both(failed, both(hopeful, opposite(now.rescued)))
    (change,) = when(both(failed, opposite(rescue)), gradient_step, change)
    moves = either(free, opposite(_is_zero(change)))
    when(moves, lambda: take_over(problem))
    half = now.half + where(moves, change, 0.0)
    # Where nothing moves, rounding hides any further descent.
    stuck = both(opposite(moves), opposite(rescue))
    unshaped = both(free, none_held)
    exact = both(free, either(none_held, less_equal(decrement, TOLERANCE * half)))
    solved = either(exact, both(stuck, less_equal(decrement, STALLED * half)))
    return Attempt(Progress(half, sweeps, now.rescued, either(exact, stuck), solved, opposite(unshaped)), rescue)


def _is_zero(x: Scalar) -> Truth:
    return both(less_equal(x, 0.0), less_equal(0.0, x))


def _search(problem: Problem) -> Scalar:
    """Make a trial plan along the Newton step without limits; return the change of half the cost, zero if there is no
    decrease."""
    unroll(problem)
    return shorten(problem, float(HALVINGS))


def _gradient_step(problem: Problem) -> Scalar:
    """Make a trial plan along the gradient, with a scale for each move: the projection guarantees descent for short steps.
    Return the change of half the cost, zero where rounding hides any."""
    store = carve(problem)

    def stage(k: Index) -> None:
        store.step.put(k, scale(divide(-1.0, store.stiffness[k]), triple(store.gradient, k)))

    repeat(problem.horizon, stage)
    return shorten(problem, float(MOST_HALVINGS))


@function
def shorten(problem: Problem, halvings: Scalar) -> Scalar:
    """Search along the projection arc of the step (Armijo), halved at most `halvings` times, until the cost decreases
    enough. Return the change of half the cost, zero if it never does."""
    store = carve(problem)

    def over(_length: Scalar, change: Scalar, left: Scalar) -> Truth:
        return either(less(change, 0.0), less_equal(left, 0.0))

    def turn(length: Scalar, _change: Scalar, left: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        trial = fly(problem, lambda k, x, v: add(v, scale(length, triple(store.step, k))), REST)
        falls = both(less(trial.slope, 0.0), less_equal(trial.change, SUFFICIENT * trial.slope))
        return 0.5 * length, where(falls, trial.change, 0.0), left - 1.0

    _, change, _ = until(over, turn, 1.0, 0.0, halvings, at_most=MOST_HALVINGS)
    return change


def advance(problem: Problem) -> None:
    """Shift a solved plan by one move; the feedback of the tail gives the last one."""
    store, bounds, n = carve(problem), limits(problem), problem.horizon
    against = [-x for x in store.states.row(n, 6)]
    last: Vector = (
        sixes.dot(store.tail.row(0, 6), against),
        sixes.dot(store.tail.row(1, 6), against),
        sixes.dot(store.tail.row(2, 6), against),
    )

    # Within the limits, whose centre moves with the target.
    def shift(k: Index) -> None:
        w, _ = project(bounds, triple(store.plan, k + 1))
        store.plan.put(k, w)

    repeat(n - 1, shift)
    store.plan.put(n - 1, project(bounds, last)[0])
