"""The moves of a predictive program without active limits, to first order in the rate, for proofs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.exponential import exponential
from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import Vector, add, skew
from starhold.laws.interface import Measurement, tracking_torque
from starhold.parts.craft import Craft

Array = NDArray[np.float64]
STEP = 1e-5
"""The rotation (rad) within the horizon over which slopes are taken."""
NOTHING = 1e-9
"""The share of the largest factor below which a factor counts as zero."""


class Plan(NamedTuple):
    """A plan of moves for the proof kernel: their number; the weights of the state (w, q) (6,) and of the command (3,), and
    P of the last state (6, 6); the limit (N m) on each axis or, if `ball`, on the norm; the share of the least cost by
    which a plan may exceed it; and the unlimited moves (moves, 4, 3, 6), as factors of (w, q) and their slopes with respect
    to each component of w. The least cost of a state x is x.cost x, where w = 0."""

    moves: int
    state: Sequence[float]
    command: Sequence[float]
    end: Array
    limit: float
    ball: bool
    gap: float
    free: Array
    cost: Array


def free_moves(state: Any, command: Any, end: Any, inertia: Array, period: float, count: int) -> tuple[Array, Array]:
    """Return the unlimited moves (count, 4, 3, 6) and the cost (6, 6) of a plan with these weights, for the motion
    linearised about a rate, without gravity."""

    def at(rate: Array) -> tuple[Array, Array]:
        A, B = motion(inertia, rate, period)
        onward: Array = end
        feedback = list[Array]()
        for _ in range(count):
            gain: Any = np.linalg.solve(np.diag(command) + B.T @ onward @ B, B.T @ onward @ A)
            feedback.append(gain)
            onward = np.diag(state) + A.T @ onward @ (A - B @ gain)
            onward = 0.5 * (onward + onward.T)
        moves, state_of = list[Array](), np.eye(6)
        for one in reversed(feedback):
            moves.append(-one @ state_of)
            state_of = A @ state_of + B @ moves[-1]
        return np.array(moves), onward

    small = STEP / (count * period)
    slopes = [(at(small * axis)[0] - at(-small * axis)[0]) / (2.0 * small) for axis in np.eye(3)]
    still, cost = at(np.zeros(3))
    moves = np.stack([still, *slopes], axis=1)
    # Zeros up to rounding.
    return np.where(np.abs(moves) > NOTHING * np.abs(moves).max(axis=(0, 2), keepdims=True), moves, 0.0), cost


def motion(inertia: Array, rate: Array, period: float) -> tuple[Array, Array]:
    """Return A (6, 6) and B (6, 3) of small (w, q) about a constant rate (rad/s), sampled with a held torque."""
    inverse, turn = np.linalg.inv(inertia), np.array(skew(tuple(rate)))  # pyright: ignore
    spun = np.array(skew(tuple(inertia @ rate))) - turn @ inertia  # pyright: ignore
    rates = np.zeros((9, 9))
    rates[:3, :3], rates[:3, 6:], rates[3:6, :3], rates[3:6, 3:6] = inverse @ spun, inverse, 0.5 * np.eye(3), -turn
    moved = exponential(rates * period)
    return moved[:6, :6], moved[:6, 6:]


def first_move(measurement: Measurement, move: Array, craft: Craft) -> Vector:
    """Return the torque (N m) of an unlimited move (4, 3, 6), and the torque that tracks the target."""
    w = measurement.rate
    x = (*w, *vector_part(measurement.attitude))

    def component(i: int) -> Any:
        terms = [float(move[0, i, j]) * y for j, y in enumerate(x) if move[0, i, j]]
        turned = [float(move[k + 1, i, j]) * (w[k] * y) for k in range(3) for j, y in enumerate(x) if move[k + 1, i, j]]
        return sum([*terms, *turned], 0.0)

    return add((component(0), component(1), component(2)), tracking_torque(measurement, craft))
