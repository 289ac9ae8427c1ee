"""The torque of sunlight on a spacecraft of flat plates, which the Earth's shadow ends."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, TypeAlias

from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, maximum
from starhold.algebra.several import weighted
from starhold.algebra.vector import Vector, add, cross, dot, scale
from starhold.algebra.words import number_of
from starhold.parts import sun
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.craft import Craft
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.plates import BOX, COLUMNS, TEXT, largest_torque, plates_of
from starhold.parts.random import Dice

CARD = Card(
    title="Solar pressure",
    summary="M = sum of c_i x F_i, F_i = -P A_i c ((1 - specular) s + 2 (specular c + diffuse/3) n_i), c = max(n_i.s, 0)",
    sources=("Fundamentals of Spacecraft Attitude Determination and Control (2014)", *sun.SOURCES),
    assumptions=(
        *sun.ASSUMPTIONS,
        sun.SHADOW,
        "plates do not shade one another",
        "the light is held for a control period",
        "the torque alone: the orbit is not pushed by it",
        "no light from the Earth",
        "unknown to all laws",
    ),
)
ROLE = "environment"
NEEDS = ("two-body",)
ABOUT = "Earth"
Row: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]


class Params(NamedTuple):
    """The plates, and when they fly."""

    plates: Annotated[
        tuple[Row, ...],
        Parameter(
            "m^2, 1, 1, 1, m, m, m, 1, 1",
            columns=(*COLUMNS, "specular", "diffuse"),
            text=f"{TEXT}; shares of the light that are reflected specularly and diffusely",
        ),
    ]
    epoch: Annotated[Date, EPOCH] = START


class Numbers(NamedTuple):
    """For each plate its normal, and the arms (m3) of absorbed, mirrored and scattered light: area and share times the
    centre, or times centre x normal; the Sun, and the control period (s)."""

    normals: tuple[Vector, ...]
    taken: tuple[Vector, ...]
    mirrored: tuple[Vector, ...]
    scattered: tuple[Vector, ...]
    sun: sun.Numbers
    period: Scalar


class Memory(NamedTuple):
    """The direction to the Sun (unit vector, inertial axes), and the pressure of its light (N/m2)."""

    direction: Vector
    pressure: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for an impossible plate or a bad epoch."""
    shares = [row[7:] for row in params.plates]
    for number, (specular, diffuse) in enumerate(shares, 1):
        if not (specular >= 0.0 and diffuse >= 0.0 and specular + diffuse <= 1.0):
            raise ValueError(f"plate {number} needs shares of reflected light from 0 to 1 in all")
    areas, normals, centres = plates_of(params.plates)
    across = [scale(area, cross(*pair)) for area, *pair in zip(areas, centres, normals, strict=True)]
    return Numbers(
        normals,
        tuple(scale(area * (1.0 - s), centre) for area, centre, (s, _) in zip(areas, centres, shares, strict=True)),
        tuple(scale(2.0 * s, arm) for arm, (s, _) in zip(across, shares, strict=True)),
        tuple(scale(2.0 / 3.0 * d, arm) for arm, (_, d) in zip(across, shares, strict=True)),
        sun.prepared(params.epoch),
        period,
    )


def remember(params: Numbers) -> Memory:
    """No light yet."""
    return Memory((1.0, 0.0, 0.0), 0.0)


def update(memory: Memory, state: Any, params: Numbers, dice: Dice, step: int) -> Memory:
    """The light where the control step begins."""
    seen = sun.sun(number_of(step) * params.period, params.sun)
    return Memory(seen.direction, sun.pressure(seen) * sun.in_view(state.position, seen))


def torque(state: Any, params: Numbers, craft: Craft, memory: Memory) -> Vector:
    """Torque on the body (N m, body axes)."""
    toward = to_body(state.attitude, memory.direction)
    cosines = tuple(maximum(dot(normal, toward), 0.0) for normal in params.normals)
    squares = tuple(cosine * cosine for cosine in cosines)
    along = weighted((*squares, *cosines), (*params.mirrored, *params.scattered))
    return scale(-memory.pressure, add(cross(weighted(cosines, params.taken), toward), along))


def bound(params: Params, envelope: Envelope) -> Push:
    """The largest norm of the torque, from any side, at the perihelion."""
    numbers = prepare(params, 1.0)
    return Push(sun.STRONGEST * largest_torque(*numbers[:4]))


def examples() -> list[Params]:
    """The six sides of a 6U CubeSat, and one mirror at another time."""
    sides = tuple((*row, 0.1, 0.3) for row in BOX)
    return [Params(sides), Params(((0.5, 0.0, 0.6, 0.8, 0.1, -0.2, 0.3, 0.9, 0.05),), (2027.0, 6.0, 21.0, 12.0, 30.0, 15.0))]
