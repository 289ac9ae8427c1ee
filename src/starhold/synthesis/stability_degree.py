"""Gains of u = -k_rate w - k_attitude S, S = 4 q0 q, with the largest decay rate (degree of stability) within the torque
limit of a wheel.

With the gyroscopic torque compensated, each axis obeys, near the target and with time in units of t0,

    i l^2 + K_w l + 2 K_a = 0,    i = J_axis / J_x,  K_a = t0^2 k_attitude / J_x,  K_w = t0 k_rate / J_x,

and the decay rate (degree of stability) is eta = -max Re l over the axes. The initial error (alpha, rad) and the initial
rate (omega, 1/t0) must not demand more than the wheel's torque: 2 K_a alpha + K_w omega <= L. The compensating torque is
not counted.

Why `optimum` is the optimum. Every root lies left of -h exactly where i (m - h)^2 + K_w (m - h) + 2 K_a has no root with a
positive real part, that is, where K_w >= 2 i h and 2 K_a >= K_w h - i h^2. Over all axes, with a the smallest and b the
largest ratio,

    eta >= h  <=>  K_w >= 2 b h  and  2 K_a >= K_w h - a h^2.

Both bounds increase with K_w, so for any alpha and omega no gains with eta >= h demand less torque than the corner K_w = 2
b h, 2 K_a = (2 b - a) h^2, where K_a = c K_w^2 with c = (2 b - a) / (8 b^2) = (1 - (1 - a/b)^2) / (8 a). The corner's
demand, (2 b - a) alpha h^2 + 2 b omega h, increases with h: the largest h uses the whole budget. For alpha > 0 the corner
is the only optimum. For alpha = 0 the budget bounds only K_w, and any larger K_a is as good: the corner is the least of
them. For omega = 0 it bounds only K_a, and the corner is still the only optimum, because more damping slows axis a. For
equal moments c = 1/(8a): the critically damped double root. The order of the axes does not matter.

Source: study of reaction-wheel attitude control, degree of stability.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from starhold.parts.craft import check_inertia

Array = NDArray[np.floating[Any]]

OUT_OF_RANGE = "the gains leave the range of floating-point numbers"


class Optimum(NamedTuple):
    """Optimal scaled gains and their scaled decay rate."""

    K_a: float
    K_w: float
    eta: float


class Scale(NamedTuple):
    """The units in which the equations have no dimension.

    moment: J_x (kg m2); t0: H_max / Hdot_max (s); L: the wheel's torque, Hdot_max t0^2 / J_x, which is also its momentum
    in units of J_x / t0; ratios: J_axis / J_x of the three axes."""

    moment: float
    t0: float
    L: float
    ratios: tuple[float, float, float]

    def gains(self, K_a: float, K_w: float) -> tuple[float, float]:
        """Return k_attitude (N m) and k_rate (N m s) from scaled gains."""
        return K_a * self.moment / self.t0 / self.t0, K_w * self.moment / self.t0

    def scaled(self, k_attitude: float, k_rate: float) -> tuple[float, float]:
        """Return the scaled K_a and K_w from gains in N m and N m s."""
        return k_attitude * self.t0 * self.t0 / self.moment, k_rate * self.t0 / self.moment


class Designed(NamedTuple):
    """A design: t0 (s); L, ratios (3,), K_a, K_w and eta, all scaled; eta in 1/s, k_attitude (N m), k_rate (N m s)."""

    t0: float
    L: float
    ratios: tuple[float, float, float]
    K_a: float
    K_w: float
    eta: float
    eta_per_second: float
    k_attitude: float
    k_rate: float


def degree(K_a: ArrayLike, K_w: ArrayLike, ratios: ArrayLike) -> Array:
    """Return the decay rate (degree of stability), -max Re l over the axes (1/t0), of scaled gains of any sign.

    K_a and K_w have any shapes (...) that broadcast; ratios is (n,), or (..., n) with one set of ratios for each pair of
    gains; the result is (...). Raise ValueError if a ratio is not positive."""
    i = np.asarray(ratios, dtype=float)
    if i.ndim == 0 or i.shape[-1] == 0 or not (i > 0.0).all():
        raise ValueError("ratios must be positive, one for each axis")
    stiffness, damping = (np.asarray(value, dtype=float)[..., None] for value in (K_a, K_w))
    inside = damping * damping - 8.0 * i * stiffness
    root = np.sqrt(np.maximum(inside, 0.0))
    slowest = (damping - root) / (2.0 * i)
    # The same root without the cancellation that occurs with strong damping.
    total = damping + root
    rationalised = 4.0 * stiffness / np.where(total > 0.0, total, 1.0)
    return np.where((inside > 0.0) & (damping > 0.0), rationalised, slowest).min(axis=-1)


def boundary(ratios: ArrayLike) -> float:
    """Return c of the curve K_a = c K_w^2: above it the oscillation about the axis of the largest moment determines eta,
    below it the slow aperiodic motion about that of the smallest. ratios: (3,). Raise ValueError unless positive."""
    a, b = _extremes(ratios)
    return (2.0 - a / b) / (8.0 * b)


def optimum(ratios: ArrayLike, alpha: float, omega: float, budget: float) -> Optimum:
    """Return the scaled gains of the largest decay rate within 2 K_a alpha + K_w omega <= budget.

    ratios: (3,), J_axis / J_x in any order; alpha: largest initial error (rad); omega: largest initial rate (1/t0); budget:
    L. Raise ValueError if ratios or the budget are not positive, if alpha or omega is negative or both are zero, because
    then nothing bounds the gains, and if the gains leave the range of floats."""
    a, b = _extremes(ratios)
    alpha, omega, budget = _demands(alpha, omega, budget)
    # The positive root of (2 b - a) alpha h^2 + 2 b omega h = L, in the form valid for alpha = 0 too.
    turn = b * omega
    lower = turn + math.hypot(turn, math.sqrt(2.0 * b - a) * math.sqrt(alpha) * math.sqrt(budget))
    eta = budget / lower if lower > 0.0 else math.inf
    best = Optimum(0.5 * (2.0 * b - a) * eta * eta, 2.0 * b * eta, eta)
    if not all(0.0 < value < math.inf for value in best):
        raise ValueError(OUT_OF_RANGE)
    return best


def brute_force(ratios: ArrayLike, alpha: float, omega: float, budget: float, points: int = 41, rounds: int = 8) -> Optimum:
    """Return the best of a grid of gains along and below the budget line, `points` each way, refined `rounds` times
    around it.

    It uses only `degree` and the budget, independently of `optimum`, whose arguments and errors it shares. The sets of
    gains with eta above a value are convex, so the best lies next to the best point of a line and of the grid: the relative
    error of eta is about 1e-9.
    """
    a, b = _extremes(ratios)
    alpha, omega, budget = _demands(alpha, omega, budget)
    if points < 5 or rounds < 1:
        raise ValueError(f"points must be at least 5 and rounds at least 1, not {points} and {rounds}")
    most_a = budget / (2.0 * alpha) if alpha > 0.0 else math.inf
    most_w = budget / omega if omega > 0.0 else math.inf
    # If all axes oscillate, more stiffness changes nothing, and if none does, more damping only slows.
    most_a, most_w = min(most_a, most_w * most_w / (8.0 * a)), min(most_w, math.sqrt(8.0 * b * most_a))
    if not (0.0 < most_a < math.inf and 0.0 < most_w < math.inf):
        raise ValueError(OUT_OF_RANGE)
    best = Optimum(0.0, 0.0, -math.inf)
    low, high = 0.0, most_w
    for _ in range(rounds):
        K_w = np.linspace(low, high, points)
        left = (budget - K_w * omega) / (2.0 * alpha) if alpha > 0.0 else np.full_like(K_w, most_a)
        K_a, eta = _best_stiffness(K_w, np.clip(left, 0.0, most_a), ratios, points, rounds)
        at = int(np.argmax(eta))
        if eta[at] > best.eta:
            best = Optimum(float(K_a[at]), float(K_w[at]), float(eta[at]))
        low, high = float(K_w[max(at - 1, 0)]), float(K_w[min(at + 1, points - 1)])
    return best


def scale(moments: ArrayLike, torque: float, momentum: float) -> Scale:
    """Return units for principal moments (3,) (kg m2), a wheel's largest torque Hdot_max (N m) and momentum H_max (N m s).

    Raise ValueError if these are not positive and finite, or no rigid body has these moments."""
    if np.shape(moments) != (3,):
        raise ValueError(f"moments must be three numbers, not an array of shape {np.shape(moments)}")
    x, y, z = (float(moment) for moment in np.diagonal(check_inertia(moments)))
    torque, momentum = _positive("torque", torque), _positive("momentum", momentum)
    t0 = momentum / torque
    units = Scale(x, t0, momentum * t0 / x, (1.0, y / x, z / x))
    if not all(0.0 < value < math.inf for value in (*units[:3], *units.ratios)):
        raise ValueError("these moments, torque and momentum leave the range of floating-point numbers")
    return units


def design_gains(moments: ArrayLike, torque: float, momentum: float, angle: float, rate: float) -> Designed:
    """Return the gains of the largest decay rate whose demand in the initial state is within the torque limit.

    moments: principal, (3,) (kg m2); torque: Hdot_max (N m) and momentum: H_max (N m s) of each axis' wheel; angle: largest
    initial error (rad, at most pi); rate: largest initial rate (rad/s). Errors as in `scale` and `optimum`. A momentum J
    rate above H_max, which no wheel started at rest can absorb, is not refused: no gains change that. H_max only sets the
    unit of time; the gains in N m and N m s do not depend on it."""
    units = scale(moments, torque, momentum)
    angle, rate = _not_negative("angle", angle), _not_negative("rate", rate)
    if angle > math.pi:
        raise ValueError(f"angle must be at most pi rad, not {angle:g}")
    if angle == 0.0 and rate == 0.0:
        raise ValueError("angle and rate are both 0: the torque bounds no gain")
    best = optimum(units.ratios, angle, rate * units.t0, units.L)
    k_attitude, k_rate = units.gains(best.K_a, best.K_w)
    if not (0.0 < k_attitude < math.inf and 0.0 < k_rate < math.inf):
        raise ValueError(OUT_OF_RANGE)
    return Designed(units.t0, units.L, units.ratios, *best, best.eta / units.t0, k_attitude, k_rate)


def _extremes(ratios: ArrayLike) -> tuple[float, float]:
    """Return the smallest and the largest ratio."""
    values = np.asarray(ratios, dtype=float)
    if values.shape != (3,) or not (np.isfinite(values).all() and (values > 0.0).all()):
        raise ValueError("ratios must be three positive numbers, J_axis / J_x")
    return float(values.min()), float(values.max())


def _demands(alpha: float, omega: float, budget: float) -> tuple[float, float, float]:
    """Return the three as floats. Raise ValueError if they bound no gain."""
    given = _not_negative("alpha", alpha), _not_negative("omega", omega), _positive("budget", budget)
    if given[0] == 0.0 and given[1] == 0.0:
        raise ValueError("alpha and omega are both 0: the budget bounds no gain")
    return given


def _positive(name: str, value: float) -> float:
    if not 0.0 < value < math.inf:
        raise ValueError(f"{name} must be positive and finite, not {value:g}")
    return float(value)


def _not_negative(name: str, value: float) -> float:
    if not 0.0 <= value < math.inf:
        raise ValueError(f"{name} must be at least 0 and finite, not {value:g}")
    return float(value)


def _best_stiffness(K_w: Array, most: Array, ratios: ArrayLike, points: int, rounds: int) -> tuple[Array, Array]:
    """Return the best stiffness up to `most` (n,) for each damping (n,), from a grid refined around its best, and eta."""
    low, high = np.zeros_like(most), most
    rows = np.arange(len(K_w))
    best = low, low
    for _ in range(rounds):
        K_a = np.linspace(low, high, points, axis=1)
        eta = degree(K_a, K_w[:, None], ratios)
        at = np.argmax(eta, axis=1)
        best = K_a[rows, at], eta[rows, at]
        low, high = K_a[rows, np.maximum(at - 1, 0)], K_a[rows, np.minimum(at + 1, points - 1)]
    return best
