"""Motion near a collinear libration point of two bodies on circular orbits about each other: the state, the linear model,
the full restricted three-body problem, and the constants of real pairs.

Axes: X from the larger body to the smaller one (at L2 away from the Sun), Y along the smaller body's motion, Z completes
the triad; they turn with the two bodies, and the origin is the libration point. Scaled units: the unit of time is 1/Omega,
so that a revolution of the two bodies takes 2 pi; the unit of length is the caller's, by default the Earth's diameter
(`Units`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from starhold.algebra.halving import rising
from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar, Truth, both, is_finite, less, sqrt
from starhold.algebra.structure import rows
from starhold.algebra.vector import ZERO, Vector, add, dot
from starhold.parts.contract import Card
from starhold.parts.roles import Loads, Scene

CARD = Card(
    title="Point near a libration point",
    summary="r'' = field(r, r') + control, in axes that turn with the two bodies",
    sources=("published study of the direct Lyapunov method for compact invariant sets: motion near L2",),
    assumptions=("two bodies on circles about each other", "a craft without mass of its own"),
)
ROLE = "body"
COMMAND = "control"
"""Laws for this body define an equation of this name; the state has a field of this name for the control that acts."""
TIME_UNIT = "1/Omega"
SIGN_POLICIES: dict[str, Callable[..., Any]] = {}

EARTH_DIAMETER = 12_742_000.0
"""The default unit of length (m)."""
POINTS = ("L1", "L2", "L3")
"""L1 lies between the two bodies, L2 beyond the smaller one, L3 beyond the larger one."""


class Libration(NamedTuple):
    """The constants of a libration point in scaled units; the pulls add up to the stiffness."""

    rate: Annotated[float, Quantity("Omega", "at which the axes turn: 1")]
    stiffness: Annotated[float, Quantity("Omega^2", "C of the linear model; the c2 of the literature")]
    from_larger: Annotated[float, Quantity("length", "where the point lies along X as seen from the larger body, with sign")]
    from_smaller: Annotated[float, Quantity("length", "the same from the smaller body")]
    pull_larger: Annotated[float, Quantity("Omega^2", "GM/distance^3 of the larger body at the point")]
    pull_smaller: Annotated[float, Quantity("Omega^2", "the same of the smaller body")]


class PointState(NamedTuple):
    """Position, velocity and control acceleration in the rotating axes, relative to the libration point, scaled. The
    control acceleration has its own dynamics if the actuators lag."""

    position: Vector
    velocity: Vector
    control: Vector


class PointMeasurement(NamedTuple):
    """Quantities that a law reads at a control instant; scaled."""

    position: Annotated[Vector, Quantity("length", "from the libration point, turning axes")]
    velocity: Annotated[Vector, Quantity("length Omega", "relative to the turning axes")]
    period: Annotated[float, Quantity("1/Omega", "for which the control will be held")]
    limit: Annotated[float, Quantity("length Omega^2", "of the control's norm or of each axis; infinite for none")]


class Sample(NamedTuple):
    """One recorded instant: the state, the control that acts, the control commanded."""

    position: Annotated[Vector, Quantity("length unit", "from the libration point, turning axes", "axis")]
    velocity: Annotated[Vector, Quantity("length unit * Omega", "relative to the turning axes", "axis")]
    control: Annotated[Vector, Quantity("length unit * Omega^2", "acceleration that the control gives", "axis")]
    command: Annotated[Vector, Quantity("length unit * Omega^2", "acceleration commanded, within the limit", "axis")]


State, Measurement = PointState, PointMeasurement
ROWS: Any = rows(PointState(ZERO, ZERO, ZERO))
"""The rows of each field in a table of states."""


def linear(position: Vector, velocity: Vector, plant: Libration) -> Vector:
    """Return the acceleration without control, to first order in the distance from the point (scaled)."""
    turning, square = 2.0 * plant.rate, plant.rate * plant.rate
    return (
        turning * velocity[1] + (square + 2.0 * plant.stiffness) * position[0],
        (square - plant.stiffness) * position[1] - turning * velocity[0],
        -plant.stiffness * position[2],
    )


def nonlinear(position: Vector, velocity: Vector, plant: Libration) -> Vector:
    """Return the acceleration without control in the circular restricted three-body problem (scaled).

    The forces at the point itself, which cancel, are eliminated analytically, so the result is exactly zero there and as
    accurate near it as far away."""
    turning, square = 2.0 * plant.rate, plant.rate * plant.rate
    tide = add(
        _tide(position, plant.from_larger, plant.pull_larger), _tide(position, plant.from_smaller, plant.pull_smaller)
    )
    return (
        turning * velocity[1] + square * position[0] + tide[0],
        square * position[1] - turning * velocity[0] + tide[1],
        tide[2],
    )


def _tide(position: Vector, distance: Scalar, pull: Scalar) -> Vector:
    """Return the attraction of a body minus its attraction at the origin, which lies `distance` along X from the body.

    With D the vector from the body to the origin and |D + r|^2 = D^2 (1 + q) it is pull (D ((1+q)^1.5 - 1) - r)/(1+q)^1.5;
    the difference is written as by Encke and Battin (An Introduction to the Mathematics and Methods of Astrodynamics, 8.6).
    """
    q, s = _stretch(position, distance)
    cube = s * s * s
    c = pull / cube
    along = distance * (q * (3.0 + q * (3.0 + q)) / (1.0 + cube))
    return (c * (along - position[0]), -c * position[1], -c * position[2])


def _stretch(position: Vector, distance: Scalar) -> tuple[Scalar, Scalar]:
    """Return q and sqrt(1 + q), the ratio of the distance to a body to that of the origin."""
    inverse = 1.0 / distance
    q = inverse * (2.0 * position[0] + inverse * dot(position, position))
    return q, sqrt(1.0 + q)


def motion(state: PointState, acceleration: Vector, control_rate: Vector | None) -> tuple[Vector, Vector, Vector | None]:
    """Return d(state)/dt under the acceleration of `linear` or `nonlinear` and the control in the state, which changes at
    the given rate (None: held)."""
    return (state.velocity, add(acceleration, state.control), control_rate)


def rates(state: PointState, loads: Loads, control_rate: Vector | None, craft: Libration) -> Any:
    """Return d(state)/dt under the field and the control."""
    return motion(state, loads.acceleration or ZERO, control_rate)


def renormalised(state: PointState) -> PointState:
    """Return the state, which has no constraints."""
    return state


def is_sound(state: PointState, setup: Any) -> Truth:
    """Return whether the motion is finite and within the divergence bound."""
    near = less(dot(state.position, state.position), setup.divergence_bound * setup.divergence_bound)
    return both(is_finite(dot(state.velocity, state.velocity)), near)


def observe(state: PointState, scene: Scene) -> PointMeasurement:
    """Return the law's measurement of a state from sensors or estimators."""
    return PointMeasurement(state.position, state.velocity, scene.period, scene.limit)


def sample(state: PointState, goal: None, applied: Vector, command: Vector) -> Sample:
    """Return the recorded quantities."""
    return Sample(state.position, state.velocity, applied, command)


class Units(NamedTuple):
    """The size of the scaled units of length (m) and rate (1/s)."""

    length: float
    rate: float

    @property
    def time(self) -> float:
        """The unit of time in seconds."""
        return 1.0 / self.rate

    @property
    def velocity(self) -> float:
        """The unit of velocity in m/s."""
        return self.length * self.rate

    @property
    def acceleration(self) -> float:
        """The unit of acceleration in m/s2."""
        return self.length * self.rate**2


class Primaries(NamedTuple):
    """Two bodies on circular orbits about each other: their name, GM of the larger and the smaller body (m3/s2), their
    distance (m) and radii (m)."""

    name: str
    larger: float
    smaller: float
    separation: float
    radius_larger: float
    radius_smaller: float

    @property
    def rate(self) -> float:
        """Omega (rad/s), by Kepler's third law."""
        return math.sqrt((self.larger + self.smaller) / self.separation**3)

    @property
    def period(self) -> float:
        """One revolution (s)."""
        return 2.0 * math.pi / self.rate

    def units(self, length_unit_m: float = EARTH_DIAMETER) -> Units:
        """Return the scaled units of this pair."""
        return Units(length_unit_m, self.rate)

    def point(self, point: str = "L2", length_unit_m: float = EARTH_DIAMETER) -> Libration:
        """Return a libration point of this pair; see `make_libration`."""
        return make_libration(self.larger, self.smaller, self.separation, point, length_unit_m)


AU = 149_597_870_700.0
"""Astronomical unit (m)."""
_SUN, _SUN_RADIUS = 1.32712440041e20, 6.957e8
_EARTH, _MOON = 3.98600435507e14, 4.902800118e12

PRIMARIES: dict[str, Primaries] = {
    "sun-earth": Primaries("Sun and Earth with Moon", _SUN, _EARTH + _MOON, 1.00000261 * AU, _SUN_RADIUS, 6.371e6),
    "sun-earth-alone": Primaries("Sun and Earth without Moon", _SUN, _EARTH, 1.00000261 * AU, _SUN_RADIUS, 6.371e6),
    "sun-venus": Primaries("Sun and Venus", _SUN, 3.24858592e14, 0.72333566 * AU, _SUN_RADIUS, 6.0518e6),
    "sun-mars": Primaries("Sun and Mars", _SUN, 4.2828375816e13, 1.52371034 * AU, _SUN_RADIUS, 3.3895e6),
    "sun-jupiter": Primaries("Sun and Jupiter", _SUN, 1.267127641e17, 5.20288700 * AU, _SUN_RADIUS, 6.9911e7),
    "earth-moon": Primaries("Earth and Moon", _EARTH, _MOON, 3.844e8, 6.371e6, 1.7374e6),
}
"""Pairs by name. GM from the ephemeris DE440 (Park et al. 2021; planets with their moons), mean distances from JPL's
approximate elements of the planets (Standish), radii: IAU 2015. With the Moon or without, the Earth has C = 3.94 at L2."""


def make_libration(
    larger_mass: float, smaller_mass: float, separation_m: float, point: str = "L2", length_unit_m: float = EARTH_DIAMETER
) -> Libration:
    """Return a collinear libration point of two bodies with these masses (kg, or GM in m3/s2: only their ratio matters) at
    this distance (m), in scaled units; its position is correct to the last digit.

    Raises ValueError where a number is not positive and finite, the masses are the wrong way round, or there is no such
    point."""
    given = {"larger mass": larger_mass, "smaller mass": smaller_mass, "separation": separation_m, "length": length_unit_m}
    for name, number in given.items():
        if not 0.0 < number < math.inf:
            raise ValueError(f"the {name} must be positive and finite, not {number:g}")
    if smaller_mass > larger_mass:
        raise ValueError(f"the larger mass comes first, but {larger_mass:g} is less than {smaller_mass:g}")
    if point not in POINTS:
        raise ValueError(f"the collinear points are {', '.join(POINTS)}, not {point}")
    share = smaller_mass / (larger_mass + smaller_mass)
    rest = larger_mass / (larger_mass + smaller_mass)
    larger, smaller = _place(share, rest, point)
    pulls = rest / abs(larger) ** 3, share / abs(smaller) ** 3
    scale = separation_m / length_unit_m
    return Libration(1.0, pulls[0] + pulls[1], scale * larger, scale * smaller, *pulls)


def _place(share: float, rest: float, point: str) -> tuple[float, float]:
    """Return the point's coordinate along X from the larger and from the smaller body, in units of their distance; `share`
    and `rest` are the mass fractions of the smaller and the larger body.

    The balance of forces is written in the distance from the nearer body, which avoids cancellation."""
    if point == "L3":
        distance = rising(lambda g: g * (1.0 + share / g) - rest / (g * g) - share / ((1.0 + g) * (1.0 + g)), 0.5, 1.5)
        return -distance, -1.0 - distance
    side = 1.0 if point == "L2" else -1.0

    def balance(g: float) -> float:
        return g**3 * (1.0 + rest * (2.0 + side * g) / (1.0 + side * g) ** 2) - share

    distance = rising(balance, 0.0, 1.0 if point == "L2" else 0.75)
    return 1.0 + side * distance, side * distance
