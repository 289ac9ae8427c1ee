"""The torque of solar radiation pressure on a spacecraft of flat plates, with eclipse, and the force if it is to move the
orbit."""

from __future__ import annotations

import math
from operator import mul
from typing import Annotated, Any, NamedTuple, TypeAlias

from starhold.algebra.quaternion import to_body, to_reference
from starhold.algebra.scalar import Scalar, less
from starhold.algebra.structured import when
from starhold.algebra.vector import ZERO, Vector, add, cross, scale
from starhold.algebra.words import number_of
from starhold.parts import sun
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.craft import Craft
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.plates import BOX, COLUMNS, TEXT, constant, cosines, largest_torque, plates_of, total
from starhold.parts.pushes import MASS, MOVES, inverse_mass
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
        'the torque alone, unless moves_orbit = "yes": then the orbit is pushed by it',
        "no light from the Earth",
        "unknown to all laws",
    ),
)
ROLE = "environment"
NEEDS = ("two-body",)
ABOUT = "Earth"
Row: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]


class Params(NamedTuple):
    """The plates and the epoch."""

    plates: Annotated[
        tuple[Row, ...],
        Parameter(
            "m^2, 1, 1, 1, m, m, m, 1, 1",
            columns=(*COLUMNS, "specular", "diffuse"),
            text=f"{TEXT}; shares of the light that are reflected specularly and diffusely",
        ),
    ]
    epoch: Annotated[Date, EPOCH] = START
    moves_orbit: Annotated[int, MOVES] = 0
    mass: Annotated[float, MASS] = math.inf
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """For each plate its normal, and the arms (m3) of absorbed, specular and diffuse light: area times share times the
    centre, or times centre x normal; the Sun, and the control period (s).

    push: if the orbit is moved, for each plate the area over the mass (m2/kg) times the share of absorbed light, and along
    its normal twice that times the specular and 2/3 of it times the diffuse share; else ()."""

    normals: tuple[Vector, ...]
    taken: tuple[Vector, ...]
    mirrored: tuple[Vector, ...]
    scattered: tuple[Vector, ...]
    sun: sun.Numbers
    period: Scalar
    push: tuple[Any, ...] = ()

    SIZES_IN_COMMON = ("taken", "mirrored", "scattered")  # pyright: ignore


class Memory(NamedTuple):
    """The direction to the Sun (unit vector, inertial axes), and the pressure of its light (N/m2)."""

    direction: Vector
    pressure: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an impossible plate, a bad epoch, and a force without a mass."""
    shares = [row[7:] for row in params.plates]
    for number, (specular, diffuse) in enumerate(shares, 1):
        if not (specular >= 0.0 and diffuse >= 0.0 and specular + diffuse <= 1.0):
            raise ValueError(f"plate {number} needs shares of reflected light from 0 to 1 in all")
    areas, normals, centres = plates_of(params.plates)
    across = [scale(area, cross(*pair)) for area, *pair in zip(areas, centres, normals, strict=True)]
    inverse, push = inverse_mass(params.moves_orbit, params.mass), ()
    if inverse is not None:
        light = [(area * inverse, normal, *share) for area, normal, share in zip(areas, normals, shares, strict=True)]
        taken = tuple(area * (1.0 - s) for area, _, s, _ in light)
        mirrored = tuple(scale(2.0 * s * area, normal) for area, normal, s, _ in light)
        push = taken, mirrored, tuple(scale(2.0 / 3.0 * d * area, normal) for area, normal, _, d in light)
    return Numbers(
        normals,
        tuple(constant(scale(area * (1.0 - s), c)) for area, c, (s, _) in zip(areas, centres, shares, strict=True)),
        tuple(constant(scale(2.0 * s, arm)) for arm, (s, _) in zip(across, shares, strict=True)),
        tuple(constant(scale(2.0 / 3.0 * d, arm)) for arm, (_, d) in zip(across, shares, strict=True)),
        sun.prepared(params.epoch, params.ephemeris),
        period,
        push,
    )


def remember(params: Numbers) -> Memory:
    """Return the initial memory, without light."""
    return Memory((1.0, 0.0, 0.0), 0.0)


def update(memory: Memory, state: Any, params: Numbers, dice: Dice, step: int) -> Memory:
    """Return the sunlight at the start of the control step."""
    seen = sun.sun(number_of(step) * params.period, params.sun)
    return Memory(seen.direction, sun.pressure(seen) * sun.in_view(state.position, seen))


def _seen(state: Any, params: Numbers, memory: Memory) -> tuple[Vector, tuple[Scalar, ...], tuple[Scalar, ...]]:
    """Return the direction to the Sun (body axes), the cosines of the plates' angles to it, 0 for those facing away, and
    their squares."""
    toward = to_body(state.attitude, memory.direction)
    seen = cosines(params.normals, toward)
    return toward, seen, tuple(cosine * cosine for cosine in seen)


def acceleration(state: Any, params: Numbers, craft: Craft, memory: Memory) -> Vector | None:
    """Return the acceleration of the centre of mass (inertial, m/s2), None if the orbit is not moved."""
    if not params.push:
        return None
    toward, seen, squares = _seen(state, params, memory)
    taken, mirrored, scattered = params.push
    along = total((*squares, *seen), (*mirrored, *scattered), 2 * params.normals)
    push = add(scale(sum(map(mul, taken, seen)), toward), along)
    return to_reference(state.attitude, scale(-memory.pressure, push))


def torque(state: Any, params: Numbers, craft: Craft, memory: Memory) -> Vector:
    """Return the torque on the body (N m, body axes)."""

    def pushed(_: Vector) -> tuple[Vector]:
        toward, seen, squares = _seen(state, params, memory)
        along = total((*squares, *seen), (*params.mirrored, *params.scattered), 2 * params.normals)
        return (scale(-memory.pressure, add(cross(total(seen, params.taken, params.normals), toward), along)),)

    # A third of many orbits lies in the Earth's shadow.
    (torque,) = when(less(0.0, memory.pressure), pushed, ZERO)
    return torque


def bound(params: Params, envelope: Envelope) -> Push:
    """Return a bound on the norm of the torque in any attitude, at the perihelion."""
    numbers = prepare(params, 1.0)
    return Push(sun.STRONGEST * largest_torque(*numbers[:4]))


def examples() -> list[Params]:
    """Return the six sides of a 6U CubeSat, and one mirror at another time that moves the orbit."""
    sides = tuple((*row, 0.1, 0.3) for row in BOX)
    mirror, epoch = ((0.5, 0.0, 0.6, 0.8, 0.1, -0.2, 0.3, 0.9, 0.05),), (2027.0, 6.0, 21.0, 12.0, 30.0, 15.0)
    return [Params(sides), Params(mirror, epoch, moves_orbit=1, mass=12.0, ephemeris=1)]
