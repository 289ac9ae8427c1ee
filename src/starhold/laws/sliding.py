"""Sliding-mode control on the surface w + K q = 0."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar, clip, less, maximum, sign, where
from starhold.algebra.vector import Matrix, Vector, add, apply, cross, scale, subtract, swing, times
from starhold.laws.interface import Card, Gain, NoMemory, Seen
from starhold.models.craft import Craft

CARD = Card(
    title="Sliding mode",
    summary="reaches the surface w + K q = 0 against any torque below `reach`, then slides to the target",
    sources=(
        "Smooth sliding-mode control for spacecraft attitude tracking maneuvers (1995)",
        "published comparison of Lyapunov, sliding-mode and predictive attitude control, eq. (18)",
    ),
    assumptions=(
        "rigid body",
        "inertia known",
        "|M_ext| < reach on every axis",
        "torque not limited",
        "q0 > 0 on the surface",
    ),
    claims="local",
)


class Gains(NamedTuple):
    """Surface slope, reaching torque and, to trade chatter for accuracy, the thickness of a boundary layer."""

    slope: Annotated[
        Matrix | Vector, Gain("1/s", shape=(3, 3), text="K of the surface w + K q = 0, symmetric positive definite")
    ]
    reach: Annotated[Vector, Gain("N m", above=0.0, shape=(3,), text="switching torque, above the disturbance")]
    layer: Annotated[float, Gain("rad/s", at_least=0.0, text="boundary layer; 0 switches by sign")] = 0.0


def surface(seen: Seen, gains: Gains) -> Vector:
    """s = w + K q (rad/s)."""
    return add(seen.rate, apply(gains.slope, vector_part(seen.attitude)))


def switch(s: Scalar, layer: Scalar) -> Scalar:
    """sign(s), or s/layer within the layer."""
    inside = less(0.0, layer)
    return where(inside, clip(s / maximum(layer, 1e-300), 1.0), sign(s))


def torque(seen: Seen, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Control torque (N m, body)."""
    q = vector_part(seen.attitude)
    q_rate = scale(0.5, add(scale(seen.attitude[0], seen.rate), cross(q, seen.rate)))
    wanted = subtract(seen.target_acceleration, apply(gains.slope, q_rate))
    equivalent = add(swing(craft.inertia, seen.body_rate), apply(craft.inertia, wanted))
    s = surface(seen, gains)
    switching = (switch(s[0], gains.layer), switch(s[1], gains.layer), switch(s[2], gains.layer))
    return subtract(equivalent, times(gains.reach, switching)), memory


def examples() -> list[Gains]:
    """The published slope with the sign, and a full matrix with a boundary layer."""
    reach = (5e-3, 5e-3, 5e-3)
    slanted = ((0.08, 0.01, 0.0), (0.01, 0.1, 0.0), (0.0, 0.0, 0.12))
    return [Gains((0.08, 0.08, 0.08), reach, 0.0), Gains(slanted, reach, 2e-3)]
