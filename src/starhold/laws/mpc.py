"""Model-predictive control: the best sequence of moves over a horizon inside the torque limit, of which the first is
applied."""

from __future__ import annotations

from importlib import import_module
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from starhold.algebra.scalar import equation
from starhold.algebra.vector import Vector, add, clip_axes, clip_norm, scale
from starhold.laws.interface import Card, Gain, Seen, tracking_torque
from starhold.laws.predictive.problem import Problem, carve, compiled, hold, linearise, make_store
from starhold.laws.predictive.solver import advance, improve
from starhold.models.craft import Craft, tensor

CARD = Card(
    title="Predictive",
    summary="minimises the sum of x'Qx + u'Ru over a horizon of the motion linearised anew, inside the torque limit",
    sources=("published comparison of Lyapunov, sliding-mode and predictive attitude control",),
    assumptions=(
        "rigid body",
        "inertia known",
        "no external torque but the gravity gradient",
        "small attitude error, or a horizon short against the turn",
    ),
    claims="local",
    compiled_only=True,
)

TERMINALS = ("riccati", "stage", "none")
LIMITS = ("axis", "norm", "none")
BALL, UNLIMITED = LIMITS.index("norm"), LIMITS.index("none")


class Gains(NamedTuple):
    """Weights of the cost, horizon and limits. Choices are given by their place in the list."""

    q_attitude: Annotated[Vector, Gain("1", above=0.0, shape=(3,), text="weight of the quaternion's vector part")]
    q_rate: Annotated[Vector, Gain("s^2", at_least=0.0, shape=(3,), text="weight of the rate")]
    r: Annotated[Vector, Gain("1/(N m)^2", above=0.0, shape=(3,), text="weight of the torque")]
    horizon: Annotated[int, Gain(at_least=1, at_most=500, whole=True, text="moves planned ahead")] = 10
    terminal: Annotated[int, Gain(choices=TERMINALS, text="weight of the state after the last move: Riccati, Q or 0")] = 0
    limit: Annotated[int, Gain(choices=LIMITS, text="how the craft's torque limit is respected")] = 0
    budget: Annotated[int, Gain(at_least=1, at_most=10000, whole=True, text="most Riccati sweeps a call")] = 50


CALLS, SWEEPS, WORST, EXHAUSTED, SHAPED = range(5)
"""Places in the counters: calls, Riccati sweeps in all, most sweeps in a call, calls that ended at the budget without
the optimum, and whether limits shaped the last plan (1) or not (0), which decides how the next call starts."""


class Memory(NamedTuple):
    """What the law keeps between calls, changed in place and made anew for each trajectory.

    plan (3N): the moves planned, beyond the torque that tracks the target (N m); numbers: weights, matrices and work
    arrays, see `carve`; counters (5): see CALLS.
    """

    plan: Any
    numbers: Any
    counters: Any


def remember(gains: Gains, craft: Craft, period: float) -> Memory:
    """The memory of one trajectory, for control instants `period` apart (s).

    Raises ValueError where the Riccati equation of the terminal weight has no solution in double precision.
    """
    terminal, tail = terminal_weight(gains, craft, period)
    r = np.array(gains.r, dtype=float)
    numbers = make_store(gains.horizon)
    store = carve(numbers, gains.horizon)
    store.q[:] = np.diag(np.array([*gains.q_attitude, *gains.q_rate], dtype=float)).ravel()
    store.r[:] = np.diag(r).ravel()
    store.r_inverse[:] = np.diag(1.0 / r).ravel()
    store.p[:] = terminal.ravel()
    store.tail[:] = tail.ravel()
    return Memory(np.zeros(3 * gains.horizon), numbers, np.zeros(5, dtype=np.int64))


@np.errstate(all="ignore")
def terminal_weight(gains: Gains, craft: Craft, period: float) -> tuple[Any, Any]:
    """The weight P (6, 6) of the state after the last move, and the feedback (3, 6) that is best before it:
    u = -feedback x. For "riccati" they are those of the endless horizon at w = 0 without gravity.

    Raises ValueError where the Riccati equation has no solution in double precision.
    """
    # In periods and in a typical torque, so that the weights of any craft are of comparable size.
    inertia = tensor(craft.inertia)
    typical = np.trace(inertia) / 3.0
    push = typical * np.linalg.inv(inertia)
    a = np.block([[np.eye(3), 0.5 * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    b = cast(Any, np.vstack([0.25 * push, push]))
    q = np.diag([*gains.q_attitude, *(weight / period**2 for weight in gains.q_rate)])
    r = np.diag(gains.r) * (typical / period**2) ** 2
    name = TERMINALS[gains.terminal]
    p: Any = q if name == "stage" else np.zeros((6, 6))
    if name == "riccati":
        # Loaded here, where alone it is needed; by name, its types being too loose for a strict checker.
        riccati = import_module("scipy.linalg").solve_discrete_are
        try:
            p = riccati(a, b, q, r)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise ValueError(f"the weights give no terminal weight: {error}") from None
        p = 0.5 * (p + p.T)
    units = np.array([1.0, 1.0, 1.0, period, period, period])
    try:
        feedback = cast(Any, np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)) * units * (typical / period**2)
    except np.linalg.LinAlgError:
        feedback = np.full((3, 6), np.nan)
    p = p * np.outer(units, units)
    if not (np.isfinite(p).all() and np.isfinite(feedback).all()):
        raise ValueError("the weights give no feedback: they are too large, too small, or differ too much in size")
    return p, feedback


@equation
def torque(seen: Seen, gains: Gains, craft: Craft, memory: Memory) -> tuple[Vector, Memory]:
    """Control torque (N m, body). Weights and horizon are those the memory was made for; the memory is changed."""
    return first_move(seen, gains, craft, memory), memory


@compiled
def first_move(seen: Seen, gains: Gains, craft: Craft, memory: Memory) -> Vector:
    """Linearise, solve, and give the first move (N m, body)."""
    plan, counters = memory.plan, memory.counters
    store = carve(memory.numbers, plan.size // 3)
    space = store.space
    ahead = tracking_torque(seen, craft)
    bound = np.inf if gains.limit == UNLIMITED else craft.torque_limit
    ball = gains.limit == BALL and bound < np.inf
    linearise(seen, craft, store.a, store.b)
    hold(store.a, store.b, seen.period, space.small)
    centre = scale(-1.0, ahead)
    problem = Problem(store.a, store.b, store.q, store.r, store.r_inverse, store.p, centre, bound, ball)
    warm = counters[SHAPED] == 1
    if warm:
        advance(problem, plan, store.tail, space)
    states, q, w = space.states, seen.attitude, seen.rate
    states[0], states[1], states[2], states[3], states[4], states[5] = q[1], q[2], q[3], w[0], w[1], w[2]
    sweeps, solved, shaped = improve(problem, plan, space, gains.budget, warm)
    counters[CALLS] += 1
    counters[SWEEPS] += sweeps
    counters[WORST] = max(counters[WORST], sweeps)
    counters[EXHAUSTED] += 0 if solved else 1
    # A plan that is not finite must not start the next one.
    counters[SHAPED] = 1 if shaped and abs(plan[0]) < np.inf else 0
    command = add((plan[0], plan[1], plan[2]), ahead)
    # Adding the tracking torque back rounds; the limit is kept exactly.
    return clip_norm(command, bound) if ball else clip_axes(command, bound)


def examples() -> list[Gains]:
    """The published weights within a limit on each axis, and within a limit on the norm."""
    q, r = (0.2, 0.2, 0.2), (50.0, 50.0, 50.0)
    return [Gains(q, q, r, limit=LIMITS.index("axis")), Gains(q, q, r, limit=LIMITS.index("norm"))]
