"""Sliding-mode control on the surface w + K q = 0."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar, clip, less, maximum, sign, where
from starhold.algebra.vector import Matrix, Vector, add, apply, cross, gyroscopic_torque, scale, subtract, times
from starhold.laws.interface import Card, Gain, Measurement, NoMemory, Start
from starhold.parts.craft import Craft, tensor, vector
from starhold.synthesis import response
from starhold.synthesis.response import largest_moment, slew_figures
from starhold.synthesis.slews import Search

CARD = Card(
    title="Sliding mode",
    summary="reaches the surface w + K q = 0 against any torque below `switching_gain`, then slides to the target",
    sources=(
        "Smooth sliding-mode control for spacecraft attitude tracking maneuvers (1995)",
        "published comparison of Lyapunov, sliding-mode and predictive attitude control, eq. (18)",
    ),
    assumptions=(
        "rigid body",
        "inertia known",
        "|M_ext| < switching_gain on every axis",
        "torque not limited",
        "q0 > 0 on the surface",
    ),
    claims="local",
)

SURFACE = Gain("1/s", shape=(3, 3), text="K of the surface w + K q = 0, symmetric positive definite")


class Gains(NamedTuple):
    """The surface gain, the switching gain and, to trade accuracy for less chatter, the thickness of a boundary layer."""

    surface_gain: Annotated[Matrix | Vector, SURFACE]
    switching_gain: Annotated[Vector, Gain("N m", above=0.0, shape=(3,), text="switching torque, above the disturbance")]
    boundary_layer: Annotated[float, Gain("rad/s", at_least=0.0, text="boundary layer; 0 switches by sign")] = 0.0


class Layered(NamedTuple):
    """The form takes the natural frequency and damping ratio of the linear loop in a boundary layer, which has two real
    roots, those of the surface and of the layer. It is exact about every axis for a diagonal inertia, whose reaching torques
    are in proportion to the moments; else exact about the axis of the largest moment, and faster about the others."""

    bandwidth: Annotated[float, Gain("rad/s", above=0.0, plain=(1e3, "deg/s"), text="lowest natural frequency of all axes")]
    switching_gain: Annotated[float, Gain("N m", above=0.0, text="switching torque about the axis of the largest moment")]
    damping: Annotated[float, Gain("1", at_least=1.0, text="damping ratio; 1: a double root")] = 1.0


class Settling(NamedTuple):
    """The form takes the smallest surface gain that settles in time within the available torque, by integrating the slew to
    a target at rest without external torque."""

    time: Annotated[float, Gain("s", above=0.0, text="after which angle and rate stay within their tolerances")]
    switching_gain: Annotated[
        float | None, Gain("N m", above=0.0, text="switching torque; torque / (2 sqrt 3) if absent")
    ] = None
    boundary_layer: Annotated[float, Gain("rad/s", at_least=0.0, text="boundary layer; 0 switches by sign")] = 0.0
    torque: Annotated[float | None, response.TORQUE] = None
    momentum: Annotated[float | None, response.MOMENTUM] = None
    attitude: Annotated[Any, response.TURN] = None
    rate: Annotated[Any, response.RATE] = None
    wheel_momentum: Annotated[Any, response.STORED] = None
    attitude_tolerance: Annotated[float | None, response.ANGLE_LEFT] = None
    rate_tolerance: Annotated[float | None, response.RATE_LEFT] = None


FORMS: dict[str, Any] = {"bandwidth": Layered, "settling": Settling}


def complete(spec: Layered | Settling, start: Callable[[], Start]) -> Layered | Settling:
    """Return the inputs of a form; the form for a settling time is completed from the scenario's start."""
    spec = response.complete(spec, start)
    if isinstance(spec, Layered) or spec.switching_gain is not None:
        return spec
    if spec.torque is None or math.isinf(spec.torque):
        raise ValueError("switching_gain must be given where the torque is not limited")
    return spec._replace(switching_gain=spec.torque / (2.0 * math.sqrt(3.0)))


def _layered(craft: Craft, spec: Layered) -> Gains:
    apart = spec.damping + math.sqrt(spec.damping**2 - 1.0)
    slope, moments = 2.0 * spec.bandwidth / apart, tensor(craft.inertia)
    most = largest_moment(craft)
    layer = spec.switching_gain / (spec.bandwidth * apart * most)
    reach = (spec.switching_gain, spec.switching_gain, spec.switching_gain)
    if np.count_nonzero(moments - np.diag(np.diagonal(moments))) == 0:
        reach = vector(spec.switching_gain * np.diagonal(moments) / most)
    if not (0.0 < layer < math.inf and math.isfinite(slope) and min(reach) > 0.0):
        raise ValueError("the gains leave the range of numbers")
    return Gains((slope, slope, slope), reach, layer)


def _search(craft: Craft, spec: Settling) -> Search:
    reach = spec.switching_gain
    if reach is None:
        raise ValueError("switching_gain must be given")
    least = float(np.linalg.eigvalsh(tensor(craft.inertia))[0])

    def gains_of(x: float) -> Gains:
        return Gains((x, x, x), (reach, reach, reach), spec.boundary_layer)

    def fastest(gains: Gains) -> float:
        return float(tensor(gains.surface_gain)[0, 0]) + (
            reach / (spec.boundary_layer * least) if spec.boundary_layer > 0.0 else 0.0
        )

    return Search(gains_of, fastest, craft, spec)


def explain(craft: Craft, spec: Layered | Settling) -> list[tuple[str, Any]]:
    """Return figures of the slew, and eigenvalues of the linear loop: in the boundary layer, else on the surface."""
    figures: list[tuple[str, Any]] = []
    if isinstance(spec, Settling):
        gains, turn = _settled(craft, spec)
        figures = slew_figures(turn)
    else:
        gains = design(craft, spec)
    slope, inertia = tensor(gains.surface_gain), tensor(craft.inertia)
    if gains.boundary_layer == 0.0:
        return [*figures, ("eigenvalues on the surface (1/s)", np.linalg.eigvals(-0.5 * slope))]
    hold = np.linalg.solve(inertia, np.diag(gains.switching_gain)) / gains.boundary_layer
    loop = np.block([[np.zeros((3, 3)), np.eye(3)], [-0.5 * hold @ slope, -0.5 * slope - hold]])
    return [*figures, ("eigenvalues of the linear loop in the layer (1/s)", np.linalg.eigvals(loop))]


def surface(measurement: Measurement, gains: Gains) -> Vector:
    """Return s = w + K q (rad/s)."""
    return add(measurement.rate, apply(gains.surface_gain, vector_part(measurement.attitude)))


def switch(s: Scalar, layer: Scalar) -> Scalar:
    """Return sign(s), or s/layer within the layer."""
    inside = less(0.0, layer)
    return where(inside, clip(s / maximum(layer, 1e-300), 1.0), sign(s))


def equivalent_torque(measurement: Measurement, surface_gain: Matrix | Vector, craft: Craft) -> Vector:
    """Return the torque (N m) that keeps s = w + K q constant without external torque."""
    q = vector_part(measurement.attitude)
    q_rate = scale(0.5, add(scale(measurement.attitude[0], measurement.rate), cross(q, measurement.rate)))
    wanted = subtract(measurement.target_acceleration, apply(surface_gain, q_rate))
    return add(gyroscopic_torque(craft.inertia, measurement.body_rate), apply(craft.inertia, wanted))


def torque(measurement: Measurement, gains: Gains, craft: Craft, memory: NoMemory) -> tuple[Vector, NoMemory]:
    """Return the control torque (N m, body)."""
    s = surface(measurement, gains)
    switching = (switch(s[0], gains.boundary_layer), switch(s[1], gains.boundary_layer), switch(s[2], gains.boundary_layer))
    equivalent = equivalent_torque(measurement, gains.surface_gain, craft)
    return subtract(equivalent, times(gains.switching_gain, switching)), memory


design, design_all, _settled = response.settling(torque, Settling, _search, _layered)


def examples() -> list[Gains]:
    """Return the published slope with the sign, and a full matrix with a boundary layer."""
    reach = (5e-3, 5e-3, 5e-3)
    slanted = ((0.08, 0.01, 0.0), (0.01, 0.1, 0.0), (0.0, 0.0, 0.12))
    return [Gains((0.08, 0.08, 0.08), reach, 0.0), Gains(slanted, reach, 2e-3)]
