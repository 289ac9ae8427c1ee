"""Modal control places the poles of the motion exactly, level by level, and linearises it again at every step."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from starhold.algebra.quaternion import derivative, vector_part
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import (
    Matrix,
    Vector,
    add,
    apply,
    cross,
    decays,
    dot,
    gyroscopic_torque,
    principal_moments,
    scale,
    subtract,
)
from starhold.laws.interface import Card, Gain, Measurement, NoMemory, Start
from starhold.parts.craft import Craft, tensor

CARD = Card(
    title="Modal",
    summary="u = -M - K x, x = (q0 - 1, q, w): K gives the linear motion around x the spectra phi_0, phi_1 and b |w|2",
    sources=(
        "published work on modal control of a spacecraft's angular motion on quaternions, by multi-level decomposition",
    ),
    assumptions=("rigid body", "inertia known", "external torque known", "torque not limited"),
    claims="local",
)


class Gains(NamedTuple):
    """The gains are the spectra of the three levels."""

    phi_0: Annotated[Matrix | Vector, Gain("1/s", shape=(3, 3), text="of the rates; a number a stands for a E")]
    phi_1: Annotated[Matrix | Vector, Gain("1/s", shape=(3, 3), text="of the quaternion's vector part")]
    b: Annotated[float, Gain("s", text="of its scalar part, over |w|2")]


class Equal(NamedTuple):
    """The form places one real root on all axes, for the rates and for the quaternion's vector part."""

    a: Annotated[float, Gain("1/s", text="the root, on all axes")]
    b: Annotated[float, Gain("s", text="of the quaternion's scalar part, over |w|2")] = -0.01


class Fit(NamedTuple):
    """The form takes the root of the fastest slew within limits, from a fit over the initial angle; the default is the
    published fit."""

    angle: Annotated[
        float | None,
        Gain("rad", at_least=0.0, at_most=math.pi, text="initial error angle; that of the scenario's start if absent"),
    ] = None
    below: Annotated[
        Vector, Gain("1", shape=(3,), spread=False, text="c, d, e of c exp(d angle) + e, 1/s, up to the split")
    ] = (-1.018, -2.071, -0.849)
    above: Annotated[Vector, Gain("1", shape=(3,), spread=False, text="the same beyond it")] = (-2.177, -0.726, -0.155)
    split: Annotated[float, Gain("rad", at_least=0.0, at_most=math.pi, text="where the second piece begins")] = math.radians(
        85.0
    )
    b: Annotated[float, Gain("s", text="of the quaternion's scalar part, over |w|2")] = -0.01


FORMS: dict[str, Any] = {"equal": Equal, "fit": Fit}


def complete(spec: Equal | Fit, start: Callable[[], Start]) -> Equal | Fit:
    """Return the inputs of a form, completed with the error angle (rad) at the start if they have none."""
    return spec._replace(angle=start().angle) if isinstance(spec, Fit) and spec.angle is None else spec


def design(craft: Craft, spec: Equal | Fit) -> Gains:
    """Return gains with phi_0 = phi_1 = a E. Raise ValueError for a fit without an angle."""
    if isinstance(spec, Equal):
        a = spec.a
    elif spec.angle is None:
        raise ValueError("the fit needs the error angle at the start of the run")
    else:
        with np.errstate(all="ignore"):
            a = float(fitted(spec.angle, spec.below, spec.above, spec.split))
        if not math.isfinite(a):
            raise ValueError("c exp(d angle) + e is too large at this angle")
    return Gains((a, a, a), (a, a, a), spec.b)


def fitted(angle: ArrayLike, below: Vector, above: Vector, split: float) -> NDArray[np.float64]:
    """Return c exp(d angle) + e (1/s) at an angle (rad; number or array), with one triple up to the split and another
    beyond it."""
    first, second = (c * np.exp(d * np.asarray(angle, dtype=float)) + e for c, d, e in (below, above))
    return np.where(np.asarray(angle) <= split, first, second)


def explain(craft: Craft, spec: Equal | Fit) -> list[tuple[str, Any]]:
    """Return the root and its time constant."""
    a = design(craft, spec).phi_0[0]
    return [("root a (1/s)", a), ("time constant (s)", -1.0 / a)]  # type: ignore[operator]


def check(gains: Gains, craft: Craft) -> None:
    """Raise ValueError where a spectrum is not stable."""
    for name in ("phi_0", "phi_1"):
        phi: Any = getattr(gains, name)
        if not decays(phi):
            if isinstance(phi[0], tuple):
                raise ValueError(f"{name} has a root with a real part of zero or more, which is not stable")
            raise ValueError(f"{name} has the root {principal_moments(phi)[2]:.4g} 1/s, which is not stable")
    if not gains.b < 0.0:
        raise ValueError(f"b = {gains.b:g} s gives the scalar part a root that is not stable")


def single_root(gains: Gains) -> tuple[float, float] | None:
    """Return a (1/s) and b (s) where phi_0 = phi_1 = a E: the closed loop is then the same for every inertia."""
    first, second = (tensor(phi) for phi in gains[:2])
    a = float(first[0, 0])
    return (a, gains.b) if (first == a * np.eye(3)).all() and (second == first).all() else None


def _straighten(q: Vector, v: Vector) -> Vector:
    """Return D^-1 v with D v = v + q x v."""
    # D is regular for every q, and needs no pivoting.
    return scale(1.0 / (1.0 + dot(q, q)), add(subtract(v, cross(q, v)), scale(dot(q, v), q)))


def _upper(q: Vector, w: Vector, gains: Gains, craft: Craft, first: Scalar, rest: Vector) -> Vector:
    """Return K_1 (first, rest), which would give the quaternion the spectra phi_1 and b |w|^2 if the momentum were its
    input."""
    half = apply(craft.inertia, _straighten(q, w))
    doubled = scale(2.0, apply(craft.inertia, _straighten(q, rest)))
    last = scale(4.0 * gains.b, half)
    pulled = apply(gains.phi_1, add(scale(first, last), doubled))
    return subtract(subtract(scale(first, half), scale(0.5 * dot(w, rest), last)), pulled)


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control torque (N m, body).

    With x' = (q0', q') the upper level gives K_0 x = K_1 x' - phi_0 (K_1 (q0 - 1, q) + J w) in addition to the known
    torque, whose Jacobians cancel. There is no division by w: where w vanishes, the scalar part has no pole to place."""
    q, w = vector_part(measurement.attitude), measurement.rate
    turning = derivative(measurement.attitude, w)
    steered = _upper(q, w, gains, craft, measurement.attitude[0] - 1.0, q)
    moved = _upper(q, w, gains, craft, turning[0], vector_part(turning))
    feedback = subtract(moved, apply(gains.phi_0, add(steered, apply(craft.inertia, w))))
    model = add(
        gyroscopic_torque(craft.inertia, measurement.body_rate), cross(measurement.body_rate, measurement.wheel_momentum)
    )
    model = subtract(add(model, apply(craft.inertia, measurement.target_acceleration)), measurement.external_torque)
    return subtract(model, feedback), memory


def examples() -> list[Gains]:
    """Return the published spectrum, and one that differs from axis to axis."""
    a = (-0.428, -0.428, -0.428)
    return [Gains(a, a, -0.01), Gains((-0.5, -0.6, -0.7), ((-0.4, 0.1, 0.0), (0.0, -0.3, 0.05), (0.0, 0.0, -0.5)), -0.01)]
