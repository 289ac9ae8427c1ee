"""The torque of thin air on a spacecraft of flat plates."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, TypeAlias

from starhold.algebra.elementary import exp
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, maximum, sqrt
from starhold.algebra.several import weighted
from starhold.algebra.vector import Vector, cross, dot, scale, subtract, unit
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.craft import Craft
from starhold.parts.epoch import DAY, SIDEREAL
from starhold.parts.orbit import BODIES
from starhold.parts.plates import BOX, COLUMNS, TEXT, largest_torque, plates_of
from starhold.parts.random import Dice

CARD = Card(
    title="Drag",
    summary="M = sum of c_i x F_i, F_i = -C_D rho v^2/2 A_i max(n_i.v, 0) v, v a unit vector, rho = rho_0 exp((h_0 - h)/H)",
    sources=(
        "Fundamentals of Spacecraft Attitude Determination and Control (2014)",
        "Fundamentals of Astrodynamics and Applications (2013): exponential atmosphere",
    ),
    assumptions=(
        "density falls exponentially with the height over a sphere of the equatorial radius",
        "plates do not shade one another",
        "density and direction of the wind are held for a control period",
        "the torque alone: the orbit does not decay by it",
        "unknown to all laws",
    ),
)
ROLE = "environment"
NEEDS = ("two-body",)
ABOUT = "Earth"
Row: TypeAlias = tuple[float, float, float, float, float, float, float]
TURN = math.tau * SIDEREAL / DAY
"""The Earth's rate (rad/s)."""


class Params(NamedTuple):
    """The plates, and the air; by default that of a quiet day between 500 and 600 km."""

    plates: Annotated[
        tuple[Row, ...],
        Parameter("m^2, 1, 1, 1, m, m, m", columns=COLUMNS, text=TEXT),
    ]
    coefficient: Annotated[float, Parameter("1", at_least=0.0, text="of drag, of each plate")] = 2.2
    density: Annotated[float, Parameter("kg/m^3", at_least=0.0, text="at the height of reference")] = 6.967e-13
    height: Annotated[float, Parameter("m", text="of reference, above the equatorial radius")] = 5e5
    scale_height: Annotated[float, Parameter("m", above=0.0, text="over which the density falls to 1/e")] = 6.3822e4
    rotation: Annotated[float, Parameter("1", at_least=0.0, text="of the air, as a share of the Earth's")] = 1.0


class Numbers(NamedTuple):
    """For each plate its normal, and its area times its centre (m3); the coefficient of drag, half the density (kg/m3) at a
    distance (m) from the Earth's centre, the scale height (m), and the rate of the air (rad/s)."""

    normals: tuple[Vector, ...]
    arms: tuple[Vector, ...]
    coefficient: Scalar
    density: Scalar
    distance: Scalar
    scale_height: Scalar
    turn: Scalar


class Memory(NamedTuple):
    """The direction of motion relative to the air (unit vector, inertial axes), and the dynamic pressure (N/m2)."""

    course: Vector
    pressure: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for a plate without direction."""
    reference = BODIES["Earth"].radius + params.height
    areas, normals, centres = plates_of(params.plates)
    return Numbers(
        normals,
        tuple(map(scale, areas, centres)),
        params.coefficient,
        0.5 * params.density,
        reference,
        params.scale_height,
        params.rotation * TURN,
    )


def remember(params: Numbers) -> Memory:
    """No air yet."""
    return Memory((1.0, 0.0, 0.0), 0.0)


def update(memory: Memory, state: Any, params: Numbers, dice: Dice, step: int) -> Memory:
    """The air that the craft meets as the control step begins."""
    position = state.position
    wind = (-params.turn * position[1], params.turn * position[0], 0.0)
    through = subtract(state.velocity, wind)
    square = dot(position, position)
    # In the form that the Earth's attraction has, so that a kernel computes it once.
    distance = square * sqrt(1.0 / square)
    thinned = exp((params.distance - distance) * (1.0 / params.scale_height))
    return Memory(unit(through), params.density * thinned * dot(through, through))


def torque(state: Any, params: Numbers, craft: Craft, memory: Memory) -> Vector:
    """Torque on the body (N m, body axes)."""
    course = to_body(state.attitude, memory.course)
    # All forces are against the course.
    shown = tuple(maximum(dot(normal, course), 0.0) for normal in params.normals)
    return scale(params.coefficient * memory.pressure, cross(course, weighted(shown, params.arms)))


def bound(params: Params, envelope: Envelope) -> Push:
    """The largest norm of the torque, from any side, against the fastest wind in the densest air of the orbit."""
    numbers, lowest = prepare(params, 1.0), envelope.distance
    wind, turn = envelope.speed, params.rotation * TURN
    # rho (v + turn r)^2 is largest at the lowest place, or higher up where air that hardly thins turns fast.
    place = max(lowest, 2.0 * params.scale_height - wind / turn) if turn else lowest
    density = numbers.density * math.exp((numbers.distance - place) / params.scale_height)
    size = largest_torque(numbers.normals, numbers.arms)
    return Push(params.coefficient * density * (wind + turn * place) ** 2 * size)


def examples() -> list[Params]:
    """The six sides of a 6U CubeSat with its centre of mass off the middle, and one plate in denser air."""
    return [Params(BOX), Params(((0.5, 0.0, 0.6, 0.8, 0.1, -0.2, 0.3),), 2.0, 2.418e-11, 3e5, 5.3628e4, 0.0)]
