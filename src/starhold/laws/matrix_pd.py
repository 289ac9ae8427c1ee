"""PD feedback with matrix gains, and the two classical families of stabilising gains."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Matrix, Vector, add, apply, dot, solve, subtract
from starhold.laws.interface import Card, Gain, Measurement, NoMemory, tracking_torque
from starhold.parts.craft import Craft, compact, tensor

CARD = Card(
    title="Matrix-gain PD",
    summary="u = -K_rate w - K_attitude q with 3x3 gains",
    sources=(
        "Quaternion feedback regulator for spacecraft eigenaxis rotations (1989)",
        "published study of inertial stabilisation by closed-form linear-quadratic laws: the matrix-gain family",
    ),
    assumptions=(
        "rigid body",
        "no external torque",
        "torque not limited",
        "K_attitude^-1 J > 0, K_attitude^-1 K_rate > 0 and w.K_attitude^-1(w x Jw) = 0 for all w",
    ),
    claims="almost-global",
)


class Gains(NamedTuple):
    """The gains are damping and stiffness matrices."""

    k_rate: Annotated[Matrix | Vector, Gain("N m s", shape=(3, 3), text="damping")]
    k_attitude: Annotated[Matrix | Vector, Gain("N m", shape=(3, 3), text="stiffness")]


class Inertial(NamedTuple):
    """Gains K_attitude = (a J + b E)^-1, K_rate = d J, for any inertia."""

    a: Annotated[float, Gain("1/(N m kg m^2)", at_least=0.0, text="weight of the inertia in K_attitude^-1")]
    b: Annotated[float, Gain("1/(N m)", at_least=0.0, text="weight of the identity in K_attitude^-1")]
    d: Annotated[float, Gain("1/s", above=0.0, text="damping per inertia")]


class Diagonal(NamedTuple):
    """Gains K_attitude = (a J + b E)^-1, K_rate = diag(d1, d2, d3) J, for a diagonal inertia."""

    a: Annotated[float, Gain("1/(N m kg m^2)", at_least=0.0, text="weight of the inertia in K_attitude^-1")]
    b: Annotated[float, Gain("1/(N m)", at_least=0.0, text="weight of the identity in K_attitude^-1")]
    d: Annotated[Vector, Gain("1/s", above=0.0, shape=(3,), text="damping per inertia of each axis")]


FORMS: dict[str, Any] = {"inertial": Inertial, "diagonal": Diagonal}


def design(craft: Craft, spec: Inertial | Diagonal) -> Gains:
    """Return the gains of one of the two classical families. Raise ValueError if its stability condition is violated."""
    inertia = tensor(craft.inertia)
    if spec.a == 0.0 and spec.b == 0.0:
        raise ValueError("a and b must not both be zero")
    if isinstance(spec, Diagonal) and np.count_nonzero(inertia - np.diag(np.diagonal(inertia))):
        raise ValueError("form 'diagonal' needs a diagonal inertia; use form 'inertial'")
    k_rate = np.diag(np.broadcast_to(np.asarray(spec.d, dtype=float), 3)) @ inertia
    return Gains(compact(k_rate), compact(np.linalg.inv(spec.a * inertia + spec.b * np.eye(3))))


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control torque (N m, body)."""
    feedback = add(apply(gains.k_rate, measurement.rate), apply(gains.k_attitude, vector_part(measurement.attitude)))
    return subtract(tracking_torque(measurement, craft), feedback), memory


def lyapunov(measurement: Measurement, gains: Gains, craft: Craft) -> Scalar:
    """Return V = w.K_attitude^-1 Jw/2 + 2 (1 - q0); V' = -w.K_attitude^-1 K_rate w under the law's assumptions."""
    weighted = solve(gains.k_attitude, apply(craft.inertia, measurement.rate))
    return 0.5 * dot(measurement.rate, weighted) + 2.0 * (1.0 - measurement.attitude[0])


def examples() -> list[Gains]:
    """Return gains for any inertia: stiffness a multiple of the identity (b alone), and a diagonal or full damping."""
    stiffness = (0.009, 0.009, 0.009)
    full = ((0.09, 0.01, 0.0), (0.01, 0.12, 0.02), (0.0, 0.02, 0.15))
    return [Gains((0.09, 0.12, 0.15), stiffness), Gains(full, stiffness)]
