"""Linear-quadratic regulators have gains in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import Matrix, Vector, add, apply, gyroscopic_torque, scale, subtract
from starhold.laws import matrix_pd
from starhold.laws.interface import Card, Gain, Measurement, NoMemory, tracking_torque
from starhold.parts.craft import Craft, compact, tensor, vector
from starhold.synthesis.riccati import (
    OUT_OF_RANGE,
    closed_form,
    is_full,
    linear_modes,
    principal,
    riccati_residual,
    scipy_axes,
    solve_riccati,
)
from starhold.synthesis.weights import (
    BALANCES,
    MOST_SPREAD,
    balance,
    check_axes,
    check_spreads,
    kappa,
    positive,
    positive_definite,
    spread,
)

CARD = Card(
    title="Closed-form LQR",
    summary="u = -K_rate w - K_attitude q (+ w x Jw), optimal for the linearised motion; gains from formulas by `form`",
    sources=("published study of inertial stabilisation by closed-form linear-quadratic laws",),
    assumptions=(
        "rigid body",
        "inertia known",
        "no external torque",
        "torque not limited",
        "K_attitude^-1 J > 0, K_attitude^-1 K_rate > 0",
        "w.K_attitude^-1(w x Jw) = 0 for all w, or the gyroscopic torque cancelled",
    ),
    claims="almost-global",
)

Array = NDArray[np.floating[Any]]


class Gains(NamedTuple):
    """Damping and stiffness matrices, and the share of the gyroscopic torque that is cancelled."""

    k_rate: Annotated[Matrix | Vector, Gain("N m s", shape=(3, 3), text="damping")]
    k_attitude: Annotated[Matrix | Vector, Gain("N m", shape=(3, 3), text="stiffness")]
    gyroscopic: Annotated[float, Gain("1", at_least=0.0, at_most=1.0, text="share of w x Jw cancelled")] = 0.0


class FormI(NamedTuple):
    """The weights are Q = blkdiag(a, b^2) Z^-1 with Z = J^-1 R^-1 J^-1: u = -sqrt(a + b) J w - b J q, for any inertia and
    any R."""

    a: Annotated[float, Gain("1/s^2", at_least=0.0, text="weight of the rate")]
    b: Annotated[float, Gain("1/s^2", above=0.0, text="weight of the attitude, K_attitude = b J")]
    gyroscopic: Annotated[float, Gain("1", at_least=0.0, at_most=1.0, text="share of w x Jw cancelled")] = 0.0


class FormII(NamedTuple):
    """The weights Q and R are diagonal, for a diagonal inertia, and the gains have a closed form. Weights of the same unit
    differ by a factor of at most 1e12."""

    q: Annotated[Any, Gain("1", above=0.0, shape=(6,), text="weights of the rate (s^2) and of the quaternion's vector part")]
    r: Annotated[Vector, Gain("1/(N m)^2", above=0.0, shape=(3,), text="weights of the torque")]
    balance: Annotated[int, Gain(choices=BALANCES, text="whose weights change to make the law globally stable")] = 0


class FormIII(NamedTuple):
    """The weights are those of form II about the principal axes of any inertia, in ascending order of moments; axes of
    equal moments need equal weights unless the inertia is diagonal."""

    q: Annotated[Any, Gain("1", above=0.0, shape=(6,), text="weights of the rate (s^2) and of the quaternion's vector part")]
    r: Annotated[Vector, Gain("1/(N m)^2", above=0.0, shape=(3,), text="weights of the torque")]
    balance: Annotated[int, Gain(choices=BALANCES, text="whose weights change to make the law globally stable")] = 0


class Numeric(NamedTuple):
    """The weights are any symmetric positive definite ones; the gains come from a numerical solution that is correct to the
    last digit. Eigenvalues of weights of the same unit differ by a factor of at most 1e12."""

    q: Annotated[Any, Gain("1", shape=(6, 6), text="weight of the rate (s^2) and of the quaternion's vector part")]
    r: Annotated[Any, Gain("1/(N m)^2", shape=(3, 3), text="weight of the torque")]


FORMS: dict[str, Any] = {"I": FormI, "II": FormII, "III": FormIII, "numeric": Numeric}


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control torque (N m, body)."""
    feedback = add(apply(gains.k_rate, measurement.rate), apply(gains.k_attitude, vector_part(measurement.attitude)))
    gyroscopic = scale(gains.gyroscopic, gyroscopic_torque(craft.inertia, measurement.rate))
    return subtract(add(tracking_torque(measurement, craft), gyroscopic), feedback), memory


lyapunov = matrix_pd.lyapunov


def design(craft: Craft, spec: FormI | FormII | FormIII | Numeric) -> Gains:
    """Return the gains of a form. Raise ValueError if the weights or the inertia do not allow it.

    Gains that are symmetric in theory, such as those of forms I, II and III, are exactly symmetric."""
    inertia, share = tensor(craft.inertia), 0.0
    with np.errstate(all="ignore"):
        if isinstance(spec, FormI):
            if not (spec.a >= 0.0 and spec.b > 0.0):
                raise ValueError(f"a must be at least 0 and b above 0, not {spec.a:g} and {spec.b:g}")
            k_rate, k_attitude, share = np.sqrt(spec.a + spec.b) * inertia, spec.b * inertia, spec.gyroscopic
        elif isinstance(spec, Numeric):
            feedback = solve_riccati(inertia, *_numeric_weights(spec)).feedback
            k_rate, k_attitude = _without_rounding(feedback[:, :3]), _without_rounding(feedback[:, 3:])
        else:
            moments, axes, q, r = _by_axes(inertia, spec)
            k_rate, k_attitude = (_turned(axes, k) for k in closed_form(moments, q, r))
    for gain in (k_rate, k_attitude):
        # Weights that couple the axes may give a negative entry; nothing else does within the range of doubles.
        if not np.isfinite(gain).all() or not (isinstance(spec, Numeric) or (np.diagonal(gain) > 0.0).all()):
            raise ValueError(OUT_OF_RANGE)
    return Gains(compact(k_rate), compact(k_attitude), share)


def design_all(cases: Sequence[tuple[Craft, Any]]) -> list[Gains]:
    """Return the gains for many pairs of craft and inputs of one form, equal to those of `design`. Forms II and III with
    diagonal inertias and without `balance` decouple the axes and are solved in one pass."""
    closed = all(isinstance(spec, FormII | FormIII) and not spec.balance for _, spec in cases)
    if not (closed and all(isinstance(craft.inertia[0], float) for craft, _ in cases)):
        return [design(*case) for case in cases]
    moments = np.array([craft.inertia for craft, _ in cases]).T
    q, r = (np.array(list(weights), dtype=float).T for weights in zip(*((spec.q, spec.r) for _, spec in cases), strict=True))
    order = np.argsort(moments, axis=0, kind="stable")
    if isinstance(cases[0][1], FormII):
        order = np.broadcast_to(np.arange(3)[:, None], order.shape)
    with np.errstate(all="ignore"):
        sorted_gains = np.array(closed_form(np.take_along_axis(moments, order, 0), q, r))
        # Back from the order of the principal axes to that of the body axes.
        gains: Array = np.take_along_axis(sorted_gains, np.argsort(order, axis=0)[None], 1)
        fine = (np.vstack([q, r]) > 0.0).all() and all(spread(part).max() <= MOST_SPREAD for part in (q[:3], q[3:], r))
        # `design` refuses invalid cases and gives the reason.
        if not (fine and (gains > 0.0).all() and np.isfinite(2.0 * gains).all()):
            return [design(*case) for case in cases]
    return [Gains(vector(k_rate), vector(k_attitude)) for k_rate, k_attitude in zip(gains[0].T, gains[1].T, strict=True)]


class Solution(NamedTuple):
    """The closed-form solution of the Riccati equation about the principal axes (the columns of `axes`), where all matrices
    are diagonal: moments (3,), weights q (6,), rate first, and r (3,), and the blocks of P, each (3,)."""

    moments: Array
    axes: Array
    q: Array
    r: Array
    p11: Array
    p12: Array
    p22: Array

    @property
    def p(self) -> Array:
        """Return P (6, 6) about the principal axes."""
        return np.block([[np.diag(self.p11), np.diag(self.p12)], [np.diag(self.p12), np.diag(self.p22)]])


def solution(craft: Craft, spec: FormI | FormII | FormIII) -> Solution:
    """Return the closed-form solution. Form I is optimal for any R; here R is the identity."""
    inertia = tensor(craft.inertia)
    if isinstance(spec, FormI):
        moments, axes = principal(inertia)
        a, b, root, squared = spec.a, spec.b, np.sqrt(spec.a + spec.b), moments**2
        q = np.r_[a * squared, b * b * squared]
        return Solution(moments, axes, q, np.ones(3), root * squared, b * squared, 2.0 * b * root * squared)
    moments, axes, q, r = _by_axes(inertia, spec)
    p12 = moments * np.sqrt(r * q[3:])
    p11 = moments * np.sqrt(r * (q[:3] + p12))
    p22 = 2.0 * np.sqrt(q[3:] * (q[:3] + p12))
    return Solution(moments, axes, q, r, p11, p12, p22)


def riccati_problem(craft: Craft, spec: FormI | FormII | FormIII) -> tuple[Array, Array, Array]:
    """Return the weights Q (6, 6), rate first, and R (3, 3) of a form, and its P (6, 6), in body axes; for form I, R is the
    identity."""
    closed = solution(craft, spec)
    both = np.kron(np.eye(2), closed.axes)
    return both * closed.q @ both.T, closed.axes * closed.r @ closed.axes.T, both @ closed.p @ both.T


def explain(craft: Craft, spec: FormI | FormII | FormIII | Numeric) -> list[tuple[str, Any]]:
    """Return the figures of merit of a design: P, its residual, its distance from the numerical solution, the closed loop's
    eigenvalues, and whether the gyroscopic torque leaves V unchanged."""
    inertia, gains = tensor(craft.inertia), design(craft, spec)
    k_rate, k_attitude = tensor(gains.k_rate), tensor(gains.k_attitude)
    figures: list[tuple[str, Any]] = []
    if isinstance(spec, Numeric):
        q, r = _numeric_weights(spec)
        p = solve_riccati(inertia, q, r).p
        figures += [("P", p), ("Riccati residual, relative", riccati_residual(p, inertia, q, r))]
        power = gyroscopic_residual(inertia, k_attitude)
    else:
        closed = solution(craft, spec)
        # About the principal axes: in body axes, small entries would be lost in the rounding of large ones.
        about = (closed.p, np.diag(closed.moments), np.diag(closed.q), np.diag(closed.r))
        others = zip(closed[4:], scipy_axes(closed.moments, closed.q, closed.r), strict=True)
        figures.append(("P", riccati_problem(craft, spec)[2]))
        figures.append(("Riccati residual, relative", riccati_residual(*about)))
        figures.append(("P against SciPy, relative", max(float(np.abs(a / b - 1.0).max()) for a, b in others)))
        y = spec.b * closed.moments if isinstance(spec, FormI) else np.sqrt(closed.q[3:] / closed.r)
        power = abs(kappa(closed.moments, y)) / (3.0 * np.sqrt(3.0))
        if not isinstance(spec, FormI) and spec.balance:
            for name, given, moved in (("q", spec.q, closed.q), ("r", spec.r, closed.r)):
                figures.append((f"weights {name}, balanced", moved))
                figures.append((f"of the weights {name} given", moved / np.array(given)))
    modes = linear_modes(inertia, np.hstack([k_rate, k_attitude]))
    figures.append(("eigenvalues of the linear loop (1/s)", modes))
    figures.append(("degree of stability (1/s)", float(-modes.real.max())))
    figures.append(("gyroscopic residual (s^2)", float(power)))
    return figures


def _by_axes(inertia: Array, spec: FormII | FormIII) -> tuple[Array, Array, Array, Array]:
    """Return moments (3,), axes (3, 3) as columns, and the weights q (6,) and r (3,) about them."""
    if isinstance(spec, FormIII):
        moments, axes = principal(inertia)
        if is_full(inertia):
            check_axes(moments, positive(spec.q, 6, "q"), positive(spec.r, 3, "r"))
    elif is_full(inertia):
        raise ValueError("form 'II' needs a diagonal inertia; use form 'III'")
    else:
        moments, axes = np.diagonal(inertia), np.eye(3)
    return moments, axes, *balanced(moments, spec)


def _turned(axes: Array, diagonal: Array) -> Array:
    turned = axes * diagonal @ axes.T
    return 0.5 * (turned + turned.T)


def _without_rounding(gain: Array) -> Array:
    """Return the matrix, made exactly symmetric if it is symmetric up to rounding."""
    if np.abs(gain - gain.T).max() <= 1e-14 * np.abs(gain).max():
        return 0.5 * (gain + gain.T)
    return gain


def gyroscopic_residual(inertia: Array, k_attitude: Array) -> float:
    """Return the largest |w.K_attitude^-1(w x Jw)| over |w| = 1 rad/s, from its cubic form; zero means that the law is
    almost globally stable without cancelling the gyroscopic torque. For diagonal matrices it is |kappa| / (3 sqrt 3) with
    kappa = (J3 - J2)/y1 + (J1 - J3)/y2 + (J2 - J1)/y3."""
    moments, axes = np.linalg.eigh(inertia)
    weight = axes.T @ np.linalg.inv(k_attitude) @ axes
    if np.abs(weight - np.diag(np.diagonal(weight))).max() <= 1e-12 * np.abs(weight).max():
        return abs(kappa(moments, 1.0 / np.diagonal(weight))) / (3.0 * np.sqrt(3.0))
    # If not both are diagonal, the maximum over a fine grid of directions is an estimate, not a bound.
    random = np.random.default_rng(0).normal(size=(20_000, 3))
    rates = random / np.linalg.norm(random, axis=1, keepdims=True)
    return float(np.abs(np.einsum("ki,ij,kj->k", rates, weight, np.cross(rates, rates * moments))).max())


def balanced(moments: Array, spec: FormII | FormIII) -> tuple[Array, Array]:
    """Return weights q (6,) and r (3,) for moments (3,), with those named by `spec.balance` changed so that kappa vanishes.

    Raise ValueError if kappa vanishes for no value of the named weight (for the axis of the middle moment it always does),
    and if weights, given or changed, are not positive or differ by a factor above MOST_SPREAD."""
    q, r = positive(spec.q, 6, "q"), positive(spec.r, 3, "r")
    check_spreads(q[:3], q[3:], r)
    if BALANCES[spec.balance] != "none":
        q, r = balance(moments, q, r, BALANCES[spec.balance])
        check_spreads(q[:3], q[3:], r, kind="balanced ")
    return q, r


def _numeric_weights(spec: Numeric) -> tuple[Array, Array]:
    q, r = positive_definite(spec.q, 6, "q"), positive_definite(spec.r, 3, "r")
    check_spreads(*(np.linalg.eigvalsh(part / np.abs(part).max()) for part in (q[:3, :3], q[3:, 3:], r)))
    return q, r


def examples() -> list[Gains]:
    """Return form I with the gyroscopic torque cancelled and forms II for a body of 2, 3, 4 kg m2."""
    root = float(np.sqrt(0.02))
    first = Gains((2.0 * root, 3.0 * root, 4.0 * root), (0.02, 0.03, 0.04), 1.0)
    moments, y = np.array([2.0, 3.0, 4.0]), 0.02
    rate = np.sqrt(moments * y + 0.01).tolist()
    return [first, Gains((rate[0], rate[1], rate[2]), (y, y, y))]
