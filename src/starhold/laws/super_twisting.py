"""Super-twisting control: a second-order sliding mode on s = w + K q with a continuous torque."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import absolute, sqrt
from starhold.algebra.vector import ZERO, Matrix, Vector, add, apply, decays, scale, signs, subtract, times
from starhold.laws.interface import Card, Gain, Measurement
from starhold.laws.sliding import SURFACE, equivalent_torque
from starhold.parts.craft import Craft

CARD = Card(
    title="Super-twisting",
    summary="u = u_eq - J (sqrt(k1 |s|) sign(s) - v), v' = -k2 sign(s), s = w + K q; u_eq holds s where nothing disturbs",
    sources=(
        "Levant, Sliding order and sliding accuracy in sliding mode control (1993)",
        "Moreno and Osorio, Strict Lyapunov functions for the super-twisting algorithm (2012)",
    ),
    assumptions=(
        "rigid body",
        "inertia known",
        "each component of d/dt J^-1 M_ext at most L: L < k2 where k1 >= 4 k2, else L^2 < k1/4 (2 k2 - k1/4)",
        "torque not limited",
        "control period short: s stays within the order of its square",
        "q0 > 0 on the surface",
    ),
    claims="local",
)


class Gains(NamedTuple):
    """The surface gain, and the gains of the reaching motion s' = -sqrt(k1 |s|) sign(s) + v + disturbance."""

    surface_gain: Annotated[Matrix | Vector, SURFACE]
    k1: Annotated[Vector, Gain("rad/s^3", above=0.0, shape=(3,), text="under the root: s vanishes in about 2 sqrt(s/k1)")]
    k2: Annotated[Vector, Gain("rad/s^3", above=0.0, shape=(3,), text="slope of v, above the rate of the disturbance")]


class Memory(NamedTuple):
    """v (rad/s2), which on the surface is minus the acceleration due to the disturbance."""

    acceleration: Vector


def remember(gains: Gains, craft: Craft, period: float) -> Memory:
    """Return the initial memory, v = 0."""
    return Memory(ZERO)


def check(gains: Gains, craft: Craft) -> None:
    """Raise ValueError if motion on the surface, q' = -K q/2 near the target, diverges from the target."""
    slope: Any = gains.surface_gain
    backwards: Any = tuple(scale(-1.0, row) for row in slope) if isinstance(slope[0], tuple) else scale(-1.0, slope)
    if not decays(backwards):
        raise ValueError("surface_gain needs eigenvalues with positive real parts, or the surface leads off the target")


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: Memory) -> tuple[Vector, Memory]:
    """Return the control torque (N m, body)."""
    s = add(measurement.rate, apply(gains.surface_gain, vector_part(measurement.attitude)))
    direction = signs(s)
    v = subtract(memory.acceleration, scale(measurement.period, times(gains.k2, direction)))
    size = times(gains.k1, (absolute(s[0]), absolute(s[1]), absolute(s[2])))
    root = (sqrt(size[0]), sqrt(size[1]), sqrt(size[2]))
    reaching = apply(craft.inertia, subtract(v, times(root, direction)))
    return add(equivalent_torque(measurement, gains.surface_gain, craft), reaching), Memory(v)


def examples() -> list[Gains]:
    """Return gains for a body of a few kg m2 with 1e-2 N m: one surface gain for all axes, and a full matrix."""
    slanted = ((0.08, 0.01, 0.0), (0.01, 0.1, 0.0), (0.0, 0.0, 0.12))
    plain = Gains((0.08, 0.08, 0.08), (1.2e-4, 1.2e-4, 1.2e-4), (3e-5, 3e-5, 3e-5))
    return [plain, Gains(slanted, (4e-4, 3e-4, 2e-4), (6e-5, 8e-5, 5e-5))]
