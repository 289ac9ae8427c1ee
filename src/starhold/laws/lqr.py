"""Linear-quadratic regulators with closed-form gains."""

from __future__ import annotations

from importlib import import_module
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import equation
from starhold.algebra.vector import Matrix, Vector, add, apply, scale, subtract, swing
from starhold.laws import matrix_pd
from starhold.laws.interface import Card, Gain, NoMemory, Seen, tracking_torque
from starhold.models.craft import Craft, compact, tensor

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


BALANCES = ("none", "least", "q4", "q5", "q6", "r1", "r2", "r3")
"""Weights that `balanced` may move: none, all of them least in logarithm, or the one named."""


class Gains(NamedTuple):
    """Damping and stiffness matrices, and how much of the gyroscopic torque is cancelled."""

    k_rate: Annotated[Matrix | Vector, Gain("N m s", shape=(3, 3), text="damping")]
    k_attitude: Annotated[Matrix | Vector, Gain("N m", shape=(3, 3), text="stiffness")]
    gyroscopic: Annotated[float, Gain("1", at_least=0.0, at_most=1.0, text="share of w x Jw cancelled")] = 0.0


class FormI(NamedTuple):
    """Q = blkdiag(a, b^2) Z^-1 with Z = J^-1 R^-1 J^-1: u = -sqrt(a + b) J w - b J q, for any inertia and any R."""

    a: Annotated[float, Gain("1/s^2", at_least=0.0, text="weight of the rate")]
    b: Annotated[float, Gain("1/s^2", above=0.0, text="weight of the attitude, K_attitude = b J")]
    gyroscopic: Annotated[float, Gain("1", at_least=0.0, at_most=1.0, text="share of w x Jw cancelled")] = 0.0


class FormII(NamedTuple):
    """Diagonal Q and R for a diagonal inertia, in closed form."""

    q: Annotated[Any, Gain("1", above=0.0, shape=(6,), text="weights of the rate (s^2) and of the quaternion's vector part")]
    r: Annotated[Vector, Gain("1/(N m)^2", above=0.0, shape=(3,), text="weights of the torque")]
    balance: Annotated[int, Gain(choices=BALANCES, text="which weights move to make the law globally stable")] = 0


class FormIII(NamedTuple):
    """Form II about the principal axes of any inertia, which are taken in the order of rising moments."""

    q: Annotated[Any, Gain("1", above=0.0, shape=(6,), text="weights of the rate (s^2) and of the quaternion's vector part")]
    r: Annotated[Vector, Gain("1/(N m)^2", above=0.0, shape=(3,), text="weights of the torque")]
    balance: Annotated[int, Gain(choices=BALANCES, text="which weights move to make the law globally stable")] = 0


class Numeric(NamedTuple):
    """Any symmetric weights, by a numerical Riccati solver."""

    q: Annotated[Any, Gain("1", shape=(6, 6), text="weight of the rate (s^2) and of the quaternion's vector part")]
    r: Annotated[Any, Gain("1/(N m)^2", shape=(3, 3), text="weight of the torque")]


FORMS: dict[str, Any] = {"I": FormI, "II": FormII, "III": FormIII, "numeric": Numeric}


@equation
def torque(seen: Seen, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Control torque (N m, body)."""
    feedback = add(apply(gains.k_rate, seen.rate), apply(gains.k_attitude, vector_part(seen.attitude)))
    gyroscopic = scale(gains.gyroscopic, swing(craft.inertia, seen.rate))
    return subtract(add(tracking_torque(seen, craft), gyroscopic), feedback), memory


lyapunov = matrix_pd.lyapunov


def design(craft: Craft, spec: FormI | FormII | FormIII | Numeric) -> Gains:
    """Gains of a form; ValueError where the weights or the inertia do not allow it."""
    inertia = tensor(craft.inertia)
    if isinstance(spec, FormI):
        return Gains(compact(np.sqrt(spec.a + spec.b) * inertia), compact(spec.b * inertia), spec.gyroscopic)
    if isinstance(spec, Numeric):
        q, r = _symmetric(spec.q, 6, "q"), _symmetric(spec.r, 3, "r")
        p = solve_riccati(inertia, q, r)
        feedback = np.linalg.solve(r, np.linalg.solve(inertia, p[:3]))
        return Gains(compact(feedback[:, :3]), compact(feedback[:, 3:]))
    if isinstance(spec, FormIII):
        moments, axes = np.linalg.eigh(inertia)
        k_rate, k_attitude = closed_form(moments, *balanced(moments, spec))
        return Gains(compact(axes * k_rate @ axes.T), compact(axes * k_attitude @ axes.T))
    if np.count_nonzero(inertia - np.diag(np.diagonal(inertia))):
        raise ValueError("form 'II' needs a diagonal inertia; use form 'III'")
    k_rate, k_attitude = closed_form(np.diagonal(inertia), *balanced(np.diagonal(inertia), spec))
    return Gains(compact(np.diag(k_rate)), compact(np.diag(k_attitude)))


def closed_form(moments: Array, q: Array, r: Array) -> tuple[Array, Array]:
    """Diagonal gains for principal moments (3,), weights q (6,), rate first, and r (3,):
    K_attitude = y = sqrt(q_attitude / r), K_rate = sqrt(J y + q_rate / r)."""
    y = np.sqrt(q[3:] / r)
    return np.sqrt(moments * y + q[:3] / r), y


def riccati_problem(craft: Craft, spec: FormI | FormII | FormIII | Numeric) -> tuple[Array, Array, Array | None]:
    """Weights Q (6, 6), rate first, and R (3, 3) of a form, and in closed form P (6, 6); None for numeric weights.

    Form I is the regulator for any R; the identity stands for it here.
    """
    inertia = tensor(craft.inertia)
    if isinstance(spec, Numeric):
        return _symmetric(spec.q, 6, "q"), _symmetric(spec.r, 3, "r"), None
    if isinstance(spec, FormI):
        a, b, root = spec.a, spec.b, float(np.sqrt(spec.a + spec.b))
        squared = inertia @ inertia
        q = np.asarray(np.kron(np.diag([a, b * b]), squared), dtype=np.float64)
        p = np.asarray(np.kron(np.array([[root, b], [b, 2.0 * b * root]]), squared), dtype=np.float64)
        return q, np.eye(3), p
    moments, axes = np.linalg.eigh(inertia) if isinstance(spec, FormIII) else (np.diagonal(inertia), np.eye(3))
    q, r = balanced(moments, spec)
    p12 = moments * np.sqrt(r * q[3:])
    p11 = moments * np.sqrt(r * (q[:3] + p12))
    p22 = 2.0 * np.sqrt(q[3:] * (q[:3] + p12))
    p = np.block([[np.diag(p11), np.diag(p12)], [np.diag(p12), np.diag(p22)]])
    both = np.kron(np.eye(2), axes)
    return both @ np.diag(q) @ both.T, axes @ np.diag(r) @ axes.T, both @ p @ both.T


def explain(craft: Craft, spec: FormI | FormII | FormIII | Numeric) -> list[tuple[str, Any]]:
    """What a design can be judged by: P, its residual, how far it is from the numerical solution, the closed loop's
    eigenvalues, and whether the gyroscopic torque leaves V alone."""
    inertia, gains = tensor(craft.inertia), design(craft, spec)
    q, r, closed = riccati_problem(craft, spec)
    numerical = solve_riccati(inertia, q, r)
    p = numerical if closed is None else closed
    a, b = linear_model(inertia)
    feedback = np.hstack([tensor(gains.k_rate), tensor(gains.k_attitude)])
    modes = np.linalg.eigvals(a - b @ feedback)
    found: list[tuple[str, Any]] = [("P", p), ("Riccati residual, relative", riccati_residual(p, inertia, q, r))]
    if closed is not None:
        found.append(("P against SciPy, relative", float(np.abs(closed - numerical).max() / np.abs(numerical).max())))
    if isinstance(spec, (FormII, FormIII)) and spec.balance:
        moments = np.linalg.eigvalsh(inertia) if isinstance(spec, FormIII) else np.diagonal(inertia)
        for name, given, moved in zip("qr", (spec.q, spec.r), balanced(moments, spec), strict=True):
            found.append((f"weights {name}, balanced", moved))
            found.append((f"of the weights {name} given", moved / np.array(given)))
    found.append(("eigenvalues of the linear loop (1/s)", modes[np.argsort(-modes.real)]))
    found.append(("degree of stability (1/s)", float(-modes.real.max())))
    found.append(("gyroscopic residual (s^2)", gyroscopic_residual(inertia, tensor(gains.k_attitude))))
    return found


def gyroscopic_residual(inertia: Array, k_attitude: Array) -> float:
    """The largest |w.K_attitude^-1(w x Jw)| over |w| = 1 rad/s, from its cubic form; zero means that the law is almost
    globally stable without cancelling the gyroscopic torque. For diagonal matrices it is |kappa| / (3 sqrt 3) with
    kappa = (J3 - J2)/y1 + (J1 - J3)/y2 + (J2 - J1)/y3."""
    moments, axes = np.linalg.eigh(inertia)
    weight = axes.T @ np.linalg.inv(k_attitude) @ axes
    if np.abs(weight - np.diag(np.diagonal(weight))).max() <= 1e-12 * np.abs(weight).max():
        return abs(kappa(moments, 1.0 / np.diagonal(weight))) / (3.0 * np.sqrt(3.0))
    # Not diagonal together: the maximum over a fine grid of directions, a figure for reading and no bound.
    random = np.random.default_rng(0).normal(size=(20_000, 3))
    rates = random / np.linalg.norm(random, axis=1, keepdims=True)
    return float(np.abs(np.einsum("ki,ij,kj->k", rates, weight, np.cross(rates, rates * moments))).max())


def kappa(moments: Array, y: Array) -> float:
    """(J3 - J2)/y1 + (J1 - J3)/y2 + (J2 - J1)/y3 (s2): zero exactly where the gyroscopic torque does no work on V."""
    return float(((np.roll(moments, -2) - np.roll(moments, -1)) / y).sum())


def balanced(moments: Array, spec: FormII | FormIII) -> tuple[Array, Array]:
    """Weights q (6,) and r (3,) moved, as `spec.balance` says, to where kappa vanishes.

    ValueError where no value of the weight that is named does it; that of the middle moment's axis always can.
    """
    q, r = np.array(spec.q, dtype=float), np.array(spec.r, dtype=float)
    how = BALANCES[spec.balance]
    share = np.roll(moments, -2) - np.roll(moments, -1)
    if how == "none" or not share.any():
        return q, r
    y = np.sqrt(q[3:] / r)
    # The share of the middle moment's axis has the other sign than both others, so a positive y there always balances.
    axis = int(np.argmax(np.abs(share))) if how == "least" else (int(how[1]) - 1) % 3
    if how == "least":
        shift = _least_shift(share / y, axis)
        q[3:], r = q[3:] * np.exp(shift), r * np.exp(-shift)
        y = np.sqrt(q[3:] / r)
    rest = float((share / y).sum() - share[axis] / y[axis])
    wanted = -share[axis] / rest if rest else np.nan
    if not (np.isfinite(wanted) and wanted > 0.0):
        middle = int(np.argmax(np.abs(share)))
        raise ValueError(f"no value of {how} balances the weights; q{middle + 4} or r{middle + 1} can")
    if how.startswith("r"):
        r[axis] = q[3 + axis] / wanted**2
    else:
        q[3 + axis] = r[axis] * wanted**2
    return q, r


def _least_shift(parts: Array, axis: int) -> Array:
    """The least change of log y (3,) that makes the sum of `parts` exp(-change) vanish."""
    library: Any = import_module("scipy.optimize")
    start = np.zeros(3)
    start[axis] = np.log(-parts[axis] / (parts.sum() - parts[axis]))
    size = np.abs(parts).max()

    def length(shift: Array) -> float:
        return float(shift @ shift)

    def slope(shift: Array) -> Array:
        return 2.0 * shift

    def condition(shift: Array) -> float:
        return float((parts * np.exp(-shift)).sum() / size)

    found: Any = library.minimize(length, start, jac=slope, constraints={"type": "eq", "fun": condition}, tol=1e-14)
    return found.x if length(found.x) <= length(start) else start


def linear_model(inertia: Array) -> tuple[Array, Array]:
    """A (6, 6) and B (6, 3) of the motion near rest on target, state (w; q): w' = J^-1 u, q' = w/2."""
    a, b = np.zeros((6, 6)), np.zeros((6, 3))
    a[3:, :3] = 0.5 * np.eye(3)
    b[:3] = np.linalg.inv(inertia)
    return a, b


def solve_riccati(inertia: Array, q: Array, r: Array) -> Array:
    """P (6, 6) of the algebraic Riccati equation, by SciPy; ValueError where it finds none."""
    # By name, for the types of the library are too loose for a strict checker.
    library: Any = import_module("scipy.linalg")
    try:
        return library.solve_continuous_are(*linear_model(inertia), q, r)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise ValueError(f"the Riccati equation of these weights has no solution: {error}") from None


def riccati_residual(p: Array, inertia: Array, q: Array, r: Array) -> float:
    """The largest entry of A'P + PA - P B R^-1 B'P + Q, of the largest of its terms."""
    a, b = linear_model(inertia)
    quadratic = p @ b @ np.linalg.solve(r, b.T @ p)
    size = max(np.abs(part).max() for part in (a.T @ p, quadratic, q))
    return float(np.abs(a.T @ p + p @ a - quadratic + q).max() / size)


def _symmetric(given: Any, size: int, name: str) -> Array:
    array = np.array(given, dtype=float).reshape(size, size)
    if not np.allclose(array, array.T, rtol=1e-9, atol=0.0):
        raise ValueError(f"{name} must be symmetric")
    array = 0.5 * (array + array.T)
    moments = np.linalg.eigvalsh(array)
    if moments[0] <= 0.0:
        raise ValueError(f"{name} must be positive definite; its least eigenvalue is {moments[0]:g}")
    return array


def examples() -> list[Gains]:
    """Form I with the gyroscopic torque cancelled and forms II for a body of 2, 3, 4 kg m2."""
    root = float(np.sqrt(0.02))
    first = Gains((2.0 * root, 3.0 * root, 4.0 * root), (0.02, 0.03, 0.04), 1.0)
    moments, y = np.array([2.0, 3.0, 4.0]), 0.02
    rate = np.sqrt(moments * y + 0.01).tolist()
    return [first, Gains((rate[0], rate[1], rate[2]), (y, y, y))]
