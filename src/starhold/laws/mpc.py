"""Model-predictive control plans the optimal sequence of moves over a horizon within the torque limit, and applies the
first."""

from __future__ import annotations

import math
from functools import lru_cache
from importlib import import_module
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import less, maximum, where
from starhold.algebra.structured import Buffer, when
from starhold.algebra.vector import Matrix, Vector, add, clip_axes, clip_norm, scale
from starhold.laws.interface import Card, Gain, Measurement, tracking_torque
from starhold.laws.predictive.free import Plan, free_moves
from starhold.laws.predictive.motion import linearise, sample
from starhold.laws.predictive.problem import COUNTERS, Problem, Store, carve, put_limits, size
from starhold.laws.predictive.sixes import triple
from starhold.laws.predictive.solver import STALLED, Solved, advance, improve
from starhold.parts.craft import Craft, tensor

CARD = Card(
    title="Predictive",
    summary="minimises the sum of x'Qx + u'Ru over a horizon of the motion linearised at each step, within the torque limit",
    sources=("published comparison of Lyapunov, sliding-mode and predictive attitude control",),
    assumptions=(
        "rigid body",
        "inertia known",
        "no external torque but the gravity gradient",
        "small attitude error, or a horizon short compared with the slew",
    ),
    claims="local",
)

TERMINALS = ("riccati", "stage", "none")
LIMITS = ("axis", "norm", "none")
BALL, UNLIMITED = LIMITS.index("norm"), LIMITS.index("none")


class Gains(NamedTuple):
    """Weights of the cost, horizon and limits. Choices are given by their index in the list."""

    q_attitude: Annotated[Vector, Gain("1", above=0.0, shape=(3,), text="weight of the quaternion's vector part")]
    q_rate: Annotated[Vector, Gain("s^2", at_least=0.0, shape=(3,), text="weight of the rate")]
    r: Annotated[Vector, Gain("1/(N m)^2", above=0.0, shape=(3,), text="weight of the torque")]
    horizon: Annotated[int, Gain(at_least=1, at_most=500, whole=True, text="moves planned ahead")] = 10
    terminal: Annotated[int, Gain(choices=TERMINALS, text="weight of the state after the last move: Riccati, Q or 0")] = 0
    limit: Annotated[int, Gain(choices=LIMITS, text="how the craft's torque limit is respected")] = 0
    budget: Annotated[int, Gain(at_least=1, at_most=10000, whole=True, text="most Riccati sweeps in a call")] = 50


CALLS, SWEEPS, WORST, EXHAUSTED, SHAPED = range(COUNTERS)
"""Indices of the counters: calls, total Riccati sweeps, most sweeps in a call, calls that used up the budget without
reaching the optimum, and whether limits were active in the last plan (1, else 0), which decides how the next call starts."""


class Memory(NamedTuple):
    """The numbers of the quadratic program (see `predictive.problem`), changed in place from call to call and new for each
    trajectory."""

    numbers: Buffer


def remember(gains: Gains, craft: Craft, period: float) -> Memory:
    """Return the memory of one trajectory, for control instants `period` apart (s).

    Raise ValueError if the Riccati equation of the terminal weight has no solution in double precision."""
    terminal, tail = terminal_weight(gains, craft.inertia, period)
    memory = Memory(Buffer([0.0] * size(gains.horizon)))
    store = carve(program(gains, memory))
    diagonals = [*gains.q_attitude, *gains.q_rate, *gains.r, *(1.0 / weight for weight in gains.r)]
    store.weights.put(0, [float(weight) for weight in (*diagonals, *terminal.ravel())])
    store.tail.put(0, tail.ravel().tolist())
    return memory


def program(gains: Gains, memory: Memory) -> Problem:
    """Return the quadratic program of a memory."""
    return Problem(memory.numbers, gains.horizon, gains.limit == BALL)


def counters(memory: Memory) -> tuple[int, ...]:
    """Return the counters of a memory, outside kernels; see CALLS."""
    return tuple(int(memory.numbers[place]) for place in range(COUNTERS))


@lru_cache(maxsize=64)
@np.errstate(all="ignore")
def terminal_weight(gains: Gains, moments: Matrix | Vector, period: float) -> tuple[Any, Any]:
    """Return the weight P (6, 6) of the state after the last move, and the feedback (3, 6) that is optimal for that move: u
    = -feedback x. For "riccati" they are those of the infinite horizon at w = 0 without gravity.

    Raises ValueError where the Riccati equation has no solution in double precision."""
    # In units of the period and of a typical torque, so that the weights of any craft have comparable size.
    inertia = tensor(moments)
    typical = np.trace(inertia) / 3.0
    push = typical * np.linalg.inv(inertia)
    a = np.block([[np.eye(3), 0.5 * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    b = cast(Any, np.vstack([0.25 * push, push]))
    q = np.diag([*gains.q_attitude, *(weight / period**2 for weight in gains.q_rate)])
    r = np.diag(gains.r) * (typical / period**2) ** 2
    name = TERMINALS[gains.terminal]
    p: Any = q if name == "stage" else np.zeros((6, 6))
    if name == "riccati":
        # Loaded only here, where it is needed, and by name, because its types are too loose for a strict checker.
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


def plan(gains: Gains, craft: Craft, period: float) -> Plan:
    """Return the law's plan, for proofs. Errors as in `remember`."""
    end, _ = terminal_weight(gains, craft.inertia, period)
    order = [3, 4, 5, 0, 1, 2]
    end, state = end[np.ix_(order, order)], (*gains.q_rate, *gains.q_attitude)
    limit = math.inf if gains.limit == UNLIMITED else craft.torque_limit
    free, cost = free_moves(state, gains.r, end, tensor(craft.inertia), period, gains.horizon)
    return Plan(gains.horizon, state, gains.r, end, limit, gains.limit == BALL, STALLED, free, cost)


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: Memory) -> tuple[Vector, Memory]:
    """Return the control torque (N m, body axes), the first move of the optimal plan. Weights and horizon must be those of
    `remember`; the memory is changed."""
    problem = program(gains, memory)
    store = carve(problem)
    ahead = tracking_torque(measurement, craft)
    bound = math.inf if gains.limit == UNLIMITED else craft.torque_limit
    sample(problem, linearise(measurement, craft), measurement.period)
    put_limits(problem, scale(-1.0, ahead), bound)
    warm = less(0.0, store.counters[SHAPED])
    when(warm, lambda: advance(problem))
    store.states.put(0, (*vector_part(measurement.attitude), *measurement.rate))
    _count(store, improve(problem, gains.budget, warm))
    command = add(triple(store.plan, 0), ahead)
    # Adding the tracking torque back rounds; clipping keeps the limit exactly.
    return (clip_norm if problem.ball else clip_axes)(command, bound), memory


def _count(store: Store, end: Solved) -> None:
    """Bring the counters up to date."""
    before = store.counters.row(0, COUNTERS)
    now = {
        CALLS: before[CALLS] + 1.0,
        SWEEPS: before[SWEEPS] + end.sweeps,
        WORST: maximum(before[WORST], end.sweeps),
        EXHAUSTED: before[EXHAUSTED] + where(end.solved, 0.0, 1.0),
        SHAPED: where(end.shaped, 1.0, 0.0),
    }
    store.counters.put(0, [now[place] for place in range(COUNTERS)])


def examples() -> list[Gains]:
    """Return the published weights, with a limit on each axis and with a limit on the norm."""
    q, r = (0.2, 0.2, 0.2), (50.0, 50.0, 50.0)
    return [Gains(q, q, r, limit=LIMITS.index("axis")), Gains(q, q, r, limit=LIMITS.index("norm"))]
