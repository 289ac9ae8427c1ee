"""The aerodynamic torque on a spacecraft of flat plates, and the drag force if it is to move the orbit."""

from __future__ import annotations

import math
from itertools import accumulate, pairwise
from operator import mul
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from starhold.algebra.elementary import exp
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, maximum, sqrt
from starhold.algebra.structured import Buffer, repeat
from starhold.algebra.vector import Vector, cross, dot, scale, subtract, unit
from starhold.parts.contract import Card, Envelope, Parameter, Push
from starhold.parts.craft import Craft
from starhold.parts.epoch import DAY, SIDEREAL
from starhold.parts.orbit import BODIES, highest, lowest
from starhold.parts.plates import BOX, COLUMNS, TEXT, constant, cosines, largest_torque, plates_of, total
from starhold.parts.pushes import MASS, MOVES, inverse_mass
from starhold.parts.random import Dice

CARD = Card(
    title="Drag",
    summary="M = sum of c_i x F_i, F_i = -C_D rho v^2/2 A_i max(n_i.v, 0) v, v a unit vector, rho = rho_0 exp((h_0 - h)/H)",
    sources=(
        "Fundamentals of Spacecraft Attitude Determination and Control (2014)",
        "Fundamentals of Astrodynamics and Applications (2013): exponential atmosphere",
    ),
    assumptions=(
        "density falls exponentially with the height over a sphere of the equatorial radius, or between the rows of a table",
        "below and above a table the density goes on as in its last layer; the solar flux is that of the whole flight",
        "plates do not shade one another",
        "density and direction of the wind are held for a control period",
        'the torque alone, unless moves_orbit = "yes": then the orbit decays by it',
        "unknown to all laws",
    ),
)
ROLE = "environment"
NEEDS = ("two-body",)
ABOUT = "Earth"
Row: TypeAlias = tuple[float, float, float, float, float, float, float]
RADIUS = BODIES["Earth"].radius
Layer: TypeAlias = tuple[float, float, float]
TURN = math.tau * SIDEREAL / DAY
"""The Earth's rate (rad/s)."""


class Params(NamedTuple):
    """The plates, and the air; by default that of a quiet day between 500 and 600 km."""

    plates: Annotated[tuple[Row, ...], Parameter("m^2, 1, 1, 1, m, m, m", columns=COLUMNS, text=TEXT)]
    coefficient: Annotated[float, Parameter("1", at_least=0.0, text="of drag, of each plate")] = 2.2
    density: Annotated[float, Parameter("kg/m^3", at_least=0.0, text="at the reference height")] = 6.967e-13
    height: Annotated[float, Parameter("m", text="of reference, above the equatorial radius")] = 5e5
    scale_height: Annotated[float, Parameter("m", above=0.0, text="over which the density falls to 1/e")] = 6.3822e4
    rotation: Annotated[float, Parameter("1", at_least=0.0, text="of the air, as a share of the Earth's")] = 1.0
    table: Annotated[
        tuple[Layer, ...],
        Parameter(
            "m, 1, kg/m^3",
            columns=("height", "flux", "density"),
            text="densities in place of the one above, a row for each height above the equatorial radius and solar flux; "
            "between rows their logarithm is interpolated linearly",
        ),
    ] = ()
    flux: Annotated[float, Parameter("1", at_least=0.0, text="solar flux F10.7 (1e-22 W/(m^2 Hz)), for a table")] = 150.0
    moves_orbit: Annotated[int, MOVES] = 0
    mass: Annotated[float, MASS] = math.inf


class Numbers(NamedTuple):
    """For each plate its normal, and its area times its centre (m3); the drag coefficient, half the density (kg/m3) at a
    reference distance (m) from the Earth's centre, the scale height (m), and the rotation rate of the air (rad/s).

    bends: for a table, the further distances (m) and the change of the logarithm's slope (1/m) at each, 0 at the last;
    areas: of each plate, over the mass (m2/kg), () if the orbit is not moved."""

    normals: tuple[Vector, ...]
    arms: tuple[Vector, ...]
    coefficient: Scalar
    density: Scalar
    distance: Scalar
    scale_height: Scalar
    turn: Scalar
    bends: Buffer | tuple[()] = ()
    areas: tuple[Scalar, ...] = ()

    SIZES_IN_COMMON = ("arms",)  # pyright: ignore


class Memory(NamedTuple):
    """The direction of motion relative to the air (unit vector, inertial axes), and the dynamic pressure (N/m2)."""

    course: Vector
    pressure: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for a plate without direction, a table with gaps or without this
    solar flux, and a force without a mass."""
    air = (params.density, params.height, params.scale_height, ())
    density, height, scale_height, bends = _layers(params.table, params.flux) if params.table else air
    areas, normals, centres = plates_of(params.plates)
    inverse = inverse_mass(params.moves_orbit, params.mass)
    return Numbers(
        normals,
        tuple(constant(scale(*pair)) for pair in zip(areas, centres, strict=True)),
        params.coefficient,
        0.5 * density,
        RADIUS + height,
        scale_height,
        params.rotation * TURN,
        bends,
        () if inverse is None else tuple(area * inverse for area in areas),
    )


def _layers(table: tuple[Layer, ...], flux: float) -> tuple[float, float, float, Buffer]:
    """Return density (kg/m3) and height (m) of a table's lowest row, the scale height (m) above it, and the bends."""
    given = {(height, at): density for height, at, density in table}
    heights, fluxes = (np.unique(column) for column in np.array(table)[:, :2].T)
    if len(heights) < 2 or len(given) != len(table) or len(table) != len(heights) * len(fluxes):
        raise ValueError("the table needs one row for each pair of its heights, at least two, and its solar fluxes")
    densities = np.array([[given[height, at] for at in fluxes] for height in heights])
    if not (densities > 0.0).all() or not (np.diff(densities, axis=0) < 0.0).all():
        raise ValueError("the table needs densities above 0 that fall with the height")
    if not fluxes[0] <= flux <= fluxes[-1]:
        raise ValueError(f"a flux of {flux:g} is outside the table's, {fluxes[0]:g} to {fluxes[-1]:g}")
    rows: list[list[float]] = np.log(densities).tolist()
    logs = [float(np.interp(flux, fluxes, row)) for row in rows]
    slopes: list[float] = (np.diff(logs) / np.diff(heights)).tolist()
    turns = [after - before for before, after in pairwise(slopes)] + [0.0]
    bends = [x for height, turn in zip(heights[1:].tolist(), turns, strict=True) for x in (RADIUS + height, turn)]
    return math.exp(logs[0]), float(heights[0]), -1.0 / slopes[0], Buffer(bends)


def check_start(params: Numbers, start: Any, craft: Craft) -> None:
    """Raise ValueError if a table does not cover the heights of the orbit at the start."""
    if params.bends:
        ends = params.distance, params.bends[params.bends.size - 2]
        met = [find(start.position, start.velocity, craft.gravity) for find in (lowest, highest)]
        if met[0] < ends[0] or met[1] > ends[1]:
            (low, high), (bottom, top) = (((a - RADIUS) / 1e3, (b - RADIUS) / 1e3) for a, b in (met, ends))
            shown = f"heights of {bottom:.6g} to {top:.6g} km, the orbit has {low:.6g} to {high:.6g} km"
            raise ValueError(f"the table of densities has {shown}; plain numbers are in m")


def remember(params: Numbers) -> Memory:
    """Return the initial memory, without air."""
    return Memory((1.0, 0.0, 0.0), 0.0)


def update(memory: Memory, state: Any, params: Numbers, dice: Dice, step: int) -> Memory:
    """Return the air flow at the craft as the control step begins."""
    position = state.position
    wind = (-params.turn * position[1], params.turn * position[0], 0.0)
    through = subtract(state.velocity, wind)
    square = dot(position, position)
    # In the form used by the Earth's attraction, so that a kernel computes it once.
    distance = square * sqrt(1.0 / square)
    fallen = (params.distance - distance) * (1.0 / params.scale_height)
    if params.bends:
        bends = params.bends

        def bent(k: Any, value: Scalar) -> tuple[Scalar]:
            begin, turn = bends.row(k, 2)
            return (value + turn * maximum(distance - begin, 0.0),)

        (fallen,) = repeat(bends.size // 2, bent, fallen)
    thinned = exp(fallen)
    return Memory(unit(through), params.density * thinned * dot(through, through))


def acceleration(state: Any, params: Numbers, craft: Craft, memory: Memory) -> Vector | None:
    """Return the acceleration of the centre of mass (inertial, m/s2), None if the orbit is not moved."""
    if not params.areas:
        return None
    shown = cosines(params.normals, to_body(state.attitude, memory.course))
    area = sum(map(mul, params.areas, shown))
    return scale(-params.coefficient * memory.pressure * area, memory.course)


def torque(state: Any, params: Numbers, craft: Craft, memory: Memory) -> Vector:
    """Return the torque on the body (N m, body axes)."""
    course = to_body(state.attitude, memory.course)
    # All forces point against the velocity relative to the air.
    shown = cosines(params.normals, course)
    return scale(params.coefficient * memory.pressure, cross(course, total(shown, params.arms, params.normals)))


def bound(params: Params, envelope: Envelope) -> Push:
    """Return a bound on the norm of the torque in any attitude, for the fastest wind and the densest air of the orbit."""
    numbers, nearest = prepare(params, 1.0), envelope.distance
    wind, turn = envelope.speed, params.rotation * TURN
    density, distance, thinning = numbers.density, numbers.distance, numbers.scale_height
    if numbers.bends:
        rows = [numbers.bends.row(k, 2) for k in range(numbers.bends.size // 2)]
        fallen = (distance - nearest) / thinning + sum(bend * max(nearest - begin, 0.0) for begin, bend in rows)
        slopes = accumulate((bend for _, bend in rows), initial=-1.0 / thinning)
        density, distance, thinning = density * math.exp(fallen), nearest, -1.0 / max(slopes)
    # rho (v + turn r)^2 is largest at the lowest point, or higher up in fast air of nearly constant density.
    place = max(nearest, 2.0 * thinning - wind / turn) if turn else nearest
    density = density * math.exp((distance - place) / thinning)
    size = largest_torque(numbers.normals, numbers.arms)
    return Push(params.coefficient * density * (wind + turn * place) ** 2 * size)


def examples() -> list[Params]:
    """Return the six sides of a 6U CubeSat with its centre of mass off the middle, one plate in denser air, and one plate
    with a density table that moves the orbit."""
    plate = ((0.5, 0.0, 0.6, 0.8, 0.1, -0.2, 0.3),)
    air = ((2e5, 70.0, 1.8e-10), (2e5, 250.0, 3.5e-10), (9e5, 70.0, 1e-15), (9e5, 250.0, 5e-14))
    thick = Params(plate, 2.0, 2.418e-11, 3e5, 5.3628e4, 0.0)
    return [Params(BOX), thick, thick._replace(table=air, flux=180.0, moves_orbit=1, mass=12.0)]
