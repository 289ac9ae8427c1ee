"""Feedback on the direction cosines, with the momentum of the wheels and the modelled torque compensated."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, add, apply, cross, dot, scale, subtract
from starhold.laws.interface import Card, Gain, Measurement, NoMemory
from starhold.parts.craft import Craft, tensor
from starhold.synthesis.stability_degree import Designed, brute_force, design_gains

CARD = Card(
    title="Reaction-wheel law",
    summary="u = -k_rate w - S + w_abs x (J w_abs + H) + J w_target' - M_ext, S = 4 k q0 q from direction cosines",
    sources=("published study of reaction-wheel attitude control with a given degree of stability",),
    assumptions=("rigid body", "inertia and wheel momentum known", "external torque known", "torque not limited"),
    claims="almost-global",
    quaternion_sign="even",
)

SHARE = Gain("1", at_least=0.0, at_most=1.0, text="share of the gyroscopic, target and external torque compensated")


class Gains(NamedTuple):
    """Damping, stiffness, and the share of the modelled torque that is compensated."""

    k_rate: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k_attitude: Annotated[Vector, Gain("N m", above=0.0, shape=(3,), text="weights of 1 - a_ii: one, or one per axis")]
    compensation: Annotated[float, SHARE] = 1.0


class Stability(NamedTuple):
    """The form gives the largest decay rate (degree of stability) within the torque of the wheels, in closed form."""

    torque: Annotated[float, Gain("N m", above=0.0, text="largest torque about an axis")]
    momentum: Annotated[float, Gain("N m s", above=0.0, text="largest stored momentum about an axis; sets the unit of time")]
    angle: Annotated[float, Gain("rad", at_least=0.0, at_most=math.pi, text="largest error angle at the start")]
    rate: Annotated[float, Gain("rad/s", at_least=0.0, text="largest rate at the start")]
    compensation: Annotated[float, SHARE] = 1.0


FORMS: dict[str, Any] = {"degree-of-stability": Stability}


def design(craft: Craft, spec: Stability) -> Gains:
    """Return the gains of the largest decay rate (degree of stability). Raise ValueError if angle and rate are zero,
    because then nothing bounds them."""
    optimum = _optimum(craft, spec)
    k = optimum.k_attitude
    return Gains(optimum.k_rate, (k, k, k), spec.compensation)


def explain(craft: Craft, spec: Stability) -> list[tuple[str, Any]]:
    """Return the scaled problem, its optimum, and the ratio of that to the best found by a search over all gains within the
    budget."""
    optimum = _optimum(craft, spec)
    budget = (spec.angle, spec.rate * optimum.t0, optimum.L)
    searched = brute_force(optimum.ratios, *budget)
    return [
        ("time scale t0 (s)", optimum.t0),
        ("budget L", optimum.L),
        ("inertia ratios", np.array(optimum.ratios)),
        ("scaled stiffness K_a", optimum.K_a),
        ("scaled damping K_w", optimum.K_w),
        ("degree of stability, scaled", optimum.eta),
        ("degree of stability (1/s)", optimum.eta_per_second),
        ("share of the best that a search over all gains finds", optimum.eta / searched.eta),
    ]


def map_inputs(craft: Craft, spec: Stability) -> tuple[Any, float, float, float]:
    """Return ratios, scaled angle and rate, and budget, from which a map of the decay rate is drawn."""
    optimum = _optimum(craft, spec)
    return optimum.ratios, spec.angle, spec.rate * optimum.t0, optimum.L


def _optimum(craft: Craft, spec: Stability) -> Designed:
    # Scalar gains act alike in any axes, so principal axes suffice.
    moments = np.linalg.eigvalsh(tensor(craft.inertia))
    return design_gains(moments, spec.torque, spec.momentum, spec.angle, spec.rate)


def _twist(k: Vector, q: Vector) -> Vector:
    """Return M q with M = tr(k) - diag(k): sum k_i (1 - a_ii) = 2 q.Mq."""
    return ((k[1] + k[2]) * q[0], (k[2] + k[0]) * q[1], (k[0] + k[1]) * q[2])


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the torque demanded of the wheels (N m, body axes)."""
    q = vector_part(measurement.attitude)
    twist = _twist(gains.k_attitude, q)
    # S = 2 (q0 Mq + Mq x q), which for equal weights is 4 k q0 q.
    cosines = scale(2.0, add(scale(measurement.attitude[0], twist), cross(twist, q)))
    feedback = add(scale(gains.k_rate, measurement.rate), cosines)
    momentum = add(apply(craft.inertia, measurement.body_rate), measurement.wheel_momentum)
    model = add(cross(measurement.body_rate, momentum), apply(craft.inertia, measurement.target_acceleration))
    model = subtract(model, measurement.external_torque)
    return subtract(scale(gains.compensation, model), feedback), memory


def lyapunov(measurement: Measurement, gains: Gains, craft: Craft) -> Scalar:
    """Return V = w.Jw/2 + sum k_i (1 - a_ii) = w.Jw/2 + 2 q.Mq (J); V' = -k_rate |w|^2 with full compensation.

    At rest, S = 0 also at half turns about the three axes or, where weights are equal, about any axis in their plane. V
    decreases from each of these in some direction, so they are unstable."""
    q = vector_part(measurement.attitude)
    return 0.5 * dot(measurement.rate, apply(craft.inertia, measurement.rate)) + 2.0 * dot(q, _twist(gains.k_attitude, q))


def examples() -> list[Gains]:
    """Return gains for a body of a few kg m2."""
    return [Gains(0.09, (0.0045, 0.0045, 0.0045)), Gains(0.5, (0.02, 0.025, 0.03))]
