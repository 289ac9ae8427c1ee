"""Solves and checks the Riccati equation of regulators at rest on target, for any inertia and weights.

State (w; q) of body rate (rad/s) and the quaternion's vector part, J w' = u, q' = w/2, cost x'Qx + u'Ru: Q is (6, 6) with
the rate first, R (3, 3). Weights and moments may span so many orders of magnitude that doubles lose every digit, so
`solve_riccati`, `riccati_residual` and `linear_modes` work with BITS binary digits; `scipy_axes` is independent.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.synthesis.weights import SAME

if TYPE_CHECKING:
    from flint import arb_mat

Array = NDArray[np.floating[Any]]

BITS = 400
"""Working precision: rates of a loop and gains may each span a hundred binary digits, and the equations contain products."""

AGREED = 1e-40
"""Newton's iteration ends when no entry of P changes by more than this share of the scale of its row and column."""

MOST_STEPS = 300

OUT_OF_RANGE = "the weights are too large or too small for gains to be computed"


class Regulator(NamedTuple):
    """P (6, 6) of the Riccati equation, rate first, and the feedback [K_rate, K_attitude] (3, 6) of u = -K x."""

    p: Array
    feedback: Array


def closed_form(moments: Array, q: Array, r: Array) -> tuple[Array, Array]:
    """Return diagonal gains for principal moments (3,), weights q (6,), rate first, and r (3,): K_attitude = y =
    sqrt(q_attitude / r), K_rate = sqrt(J y + q_rate / r)."""
    y = np.sqrt(q[3:] / r)
    return np.sqrt(moments * y + q[:3] / r), y


def linear_model(inertia: Array) -> tuple[Array, Array]:
    """Return A (6, 6) and B (6, 3) of the motion near rest on target, state (w; q): w' = J^-1 u, q' = w/2."""
    a, b = np.zeros((6, 6)), np.zeros((6, 3))
    a[3:, :3] = 0.5 * np.eye(3)
    b[:3] = np.linalg.inv(inertia)
    return a, b


def is_full(inertia: Array) -> bool:
    """Return whether any entry off the diagonal is not zero."""
    return bool(np.count_nonzero(inertia - np.diag(np.diagonal(inertia))))


def principal(inertia: Array) -> tuple[Array, Array]:
    """Return the principal moments (3,) of a symmetric inertia (3, 3) in ascending order, and their axes as columns (3, 3),
    to the last digit.

    In doubles the error of a small moment is the rounding of the largest, and that of the axes is larger by the inverse of
    the relative difference of moments. So they are refined as by Ogita and Aishima (Japan Journal of Industrial and Applied
    Mathematics 35, 2018). Axes of equal moments, which are arbitrary, are not refined."""
    from flint import arb_mat, ctx

    if not is_full(inertia):
        order = np.argsort(np.diagonal(inertia), kind="stable")
        return np.diagonal(inertia)[order], np.eye(3)[:, order]
    rough, start = np.linalg.eigh(inertia)
    apart = np.abs(np.subtract.outer(rough, rough)) > SAME * rough[2]
    with ctx.workprec(BITS):
        body, axes, one = _exact(inertia), _exact(start), _exact(np.eye(3))
        # Each step squares the error, which is at most a millionth after eigh.
        for _ in range(5):
            skew, turned = one - axes.transpose() * axes, axes.transpose() * body * axes
            moments = [turned[i, i] / (1 - skew[i, i]) for i in range(3)]
            step = [
                [
                    (turned[i, j] + moments[j] * skew[i, j]) / (moments[j] - moments[i]) if apart[i, j] else skew[i, j] / 2
                    for j in range(3)
                ]
                for i in range(3)
            ]
            axes = (axes + axes * arb_mat(step)).mid()
        return np.diagonal(_floats(axes.transpose() * body * axes)), _floats(axes)


def solve_riccati(inertia: Array, q: Array, r: Array) -> Regulator:
    """Return the regulator of positive definite Q and R, correct to the last digit for the given numbers.

    Newton's method in Kleinman's form (IEEE Transactions on Automatic Control 13, 1968): each step solves a Lyapunov
    equation for the cost P of a stable feedback and continues with the feedback of P, which decreases and converges
    quadratically in the end. Raise ValueError if numbers overflow or no solution is reached."""
    from flint import ctx

    with ctx.workprec(BITS):
        body, weight, cost = _exact(inertia), _exact(q), _exact(r)
        a, b = _exact_model(body)
        reply = (cost.inv() * b.transpose()).mid()
        feedback = _stable_feedback(inertia, q, r)
        before = None
        for _ in range(MOST_STEPS):
            p = _lyapunov((a - b * feedback).mid(), weight + feedback.transpose() * cost * feedback)
            feedback = (reply * p).mid()
            if before is not None and _moved(p, before) < AGREED:
                return Regulator(_floats(p), _floats(feedback))
            before = p
    raise ValueError("the Riccati equation of these weights has no solution that can be computed")


def _stable_feedback(inertia: Array, q: Array, r: Array) -> arb_mat:
    """Return the closed form for the weights' diagonals about the principal axes. With any symmetric positive definite
    gains the motion is that of a damped spring, hence stable for any off-diagonal weights."""
    from flint import arb_mat

    with np.errstate(all="ignore"):
        moments, axes = np.linalg.eigh(inertia)
        both = np.kron(np.eye(2), axes)
        cost = 1.0 / np.diagonal(axes.T @ np.linalg.inv(r) @ axes)
        k_rate, k_attitude = closed_form(moments, np.diagonal(both.T @ q @ both), cost)
    if not all(np.isfinite(k).all() and (k > 0.0).all() for k in (k_rate, k_attitude)):
        raise ValueError(OUT_OF_RANGE)
    # Rotated without rounding, so that they stay positive definite.
    turn = _exact(axes)
    gains = [turn * _exact(np.diag(k)) * turn.transpose() for k in (k_rate, k_attitude)]
    return arb_mat([[gain[i, j] for gain in gains for j in range(3)] for i in range(3)])


def riccati_residual(p: Array, inertia: Array, q: Array, r: Array) -> float:
    """Return the largest entry of A'P + PA - P B R^-1 B'P + Q, relative to the terms on the diagonal of its row and column,
    which makes it independent of units; without rounding except that of P itself."""
    from flint import ctx

    with ctx.workprec(BITS):
        cost, given, weight = _exact(p), _exact(r), _exact(q)
        a, b = _exact_model(_exact(inertia))
        linear = a.transpose() * cost
        linear = linear + linear.transpose()
        quadratic = cost * b * given.inv() * b.transpose() * cost
        left = _floats(linear - quadratic + weight)
        sizes = np.array([np.abs(np.diagonal(_floats(term))) for term in (linear, quadratic, weight)]).max(axis=0)
    root = np.sqrt(sizes)
    return float((np.abs(left) / root / root[:, None]).max())


def linear_modes(inertia: Array, feedback: Array) -> NDArray[np.complexfloating[Any]]:
    """Return the eigenvalues (6,), in 1/s, slowest first, of the motion near rest on target under u = -feedback x."""
    from flint import acb_mat, ctx

    with ctx.workprec(BITS):
        a, b = _exact_model(_exact(inertia))
        modes = [complex(mode) for mode in acb_mat(a - b * _exact(feedback)).eig(algorithm="approx")]
    return np.array(sorted(modes, key=lambda mode: (-mode.real, mode.imag)))


def scipy_axes(moments: Array, q: Array, r: Array) -> tuple[Array, Array, Array]:
    """Return P11, P12, P22 (each (3,)) for principal moments (3,) and diagonal weights q (6,) and r (3,), by SciPy: the
    decoupled axes one by one, each in units in which r, J and the weight of the attitude are one."""
    # By name, for the types of the library are too loose for a strict checker.
    library: Any = import_module("scipy.linalg")
    blocks = np.zeros((3, 3))
    for axis, (moment, rate, attitude, cost) in enumerate(zip(moments, q[:3], q[3:], r, strict=True)):
        # Time in units of `time`, P11 in units of J^2 r / time, an attitude of q as q / (2 time).
        time = np.sqrt(2.0 * moment) * (cost / attitude) ** 0.25
        weight = np.diag([rate / cost * (time / moment) ** 2, 1.0])
        p = library.solve_continuous_are(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[1.0], [0.0]]), weight, np.eye(1))
        size = moment**2 * cost / time
        blocks[:, axis] = size * p[0, 0], size * 2.0 / time * p[0, 1], size * 4.0 / time**2 * p[1, 1]
    return blocks[0], blocks[1], blocks[2]


def _lyapunov(a: arb_mat, weight: arb_mat) -> arb_mat:
    """Return P of A'P + PA + weight = 0, symmetric."""
    from flint import arb_mat

    size = a.nrows()
    pairs = [(i, j) for i in range(size) for j in range(size)]
    # Row (i, j) reads sum over k of a[k, i] P[k, j] + P[i, k] a[k, j].
    rows = [[(a[k, i] if m == j else 0) + (a[m, j] if k == i else 0) for k, m in pairs] for i, j in pairs]
    right = arb_mat(size * size, 1, [-weight[i, j].mid() for i, j in pairs])
    try:
        p = arb_mat(size, size, arb_mat(rows).solve(right, algorithm="approx").entries())
    except ZeroDivisionError:
        raise ValueError("the Riccati equation of these weights is singular to working precision") from None
    return ((p + p.transpose()) / 2).mid()


def _moved(p: arb_mat, before: arb_mat) -> float:
    """Return the largest change of an entry, relative to the root of the diagonal entries of its row and column."""
    size = range(p.nrows())
    shares = [(p[i, j] - before[i, j]) ** 2 / (p[i, i] * p[j, j]) for i in size for j in size]
    return float(max(float(share) for share in shares)) ** 0.5


def _exact_model(body: arb_mat) -> tuple[arb_mat, arb_mat]:
    """Return `linear_model` in working precision."""
    a, _ = linear_model(np.eye(3))
    zero = np.zeros((3, 3))
    return _exact(a), (_exact(np.vstack([np.eye(3), zero])) * body.inv()).mid()


def _exact(array: Any) -> arb_mat:
    from flint import arb_mat

    return arb_mat(np.asarray(array, dtype=float).tolist())


def _floats(matrix: arb_mat) -> Array:
    array = np.array([[float(matrix[i, j].mid()) for j in range(matrix.ncols())] for i in range(matrix.nrows())])
    # Zeros result as tiny numbers; the entries of a block have the same unit.
    for block in (array[i : i + 3, j : j + 3] for i in range(0, array.shape[0], 3) for j in range(0, array.shape[1], 3)):
        block[np.abs(block) < AGREED * np.abs(block).max()] = 0.0
    return array
