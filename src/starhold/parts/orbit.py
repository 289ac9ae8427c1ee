"""Two-body orbits: Keplerian elements to position and velocity, the extreme distances of an orbit, and its intersection
with a surface; central bodies."""

from __future__ import annotations

import math
from typing import NamedTuple

from starhold.algebra.vector import Vector


class Body(NamedTuple):
    """A central body: gravitational parameter GM (m3/s2) and equatorial radius (m)."""

    gravity: float
    radius: float


BODIES: dict[str, Body] = {
    "Sun": Body(1.32712440041e20, 6.957e8),
    "Mercury": Body(2.2031868e13, 2.4405e6),
    "Venus": Body(3.24858592e14, 6.0518e6),
    "Earth": Body(3.98600435507e14, 6.378137e6),
    "Moon": Body(4.902800118e12, 1.7374e6),
    "Mars": Body(4.2828375816e13, 3.39619e6),
    "Jupiter": Body(1.26712764e17, 7.1492e7),
    "Saturn": Body(3.79405848418e16, 6.0268e7),
    "Uranus": Body(5.7945564e15, 2.5559e7),
    "Neptune": Body(6.83652710058e15, 2.4764e7),
}
"""Central bodies by name. GM from the ephemeris DE440 (Park et al. 2021), equatorial radii of the IAU (Archinal et al.
2018), the Earth's of WGS 84."""
ALIKE = 0.01
"""The relative difference up to which a gravitational parameter is recognised as that of a known body."""
NEWTON = 6.6743e-11
"""Constant of gravitation, m3/(kg s2)."""


def body_of(gravity: float) -> str | None:
    """Return the name of the body with this gravitational parameter (m3/s2), None if it is not known."""
    return next((name for name, body in BODIES.items() if abs(gravity / body.gravity - 1.0) < ALIKE), None)


class Elements(NamedTuple):
    """Keplerian elements: semi-major axis (m; negative for a hyperbola), eccentricity (not 1), inclination, right ascension
    of the ascending node, argument of periapsis and true anomaly (rad)."""

    semi_major_axis: float
    eccentricity: float
    inclination: float
    raan: float
    argument_of_perigee: float
    true_anomaly: float


def from_elements(elements: Elements, gravity: float) -> tuple[Vector, Vector]:
    """Return position (m) and velocity (m/s) in inertial axes, third axis along the pole (Vallado, Fundamentals of
    Astrodynamics and Applications, algorithm COE2RV).

    Raise ValueError if the semi-major axis does not fit the eccentricity, or a hyperbola has no such true anomaly."""
    a, e, i, node, periapsis, anomaly = elements
    if e == 1.0 or a * (1.0 - e) <= 0.0:
        raise ValueError("a positive semi-major axis for an eccentricity below 1, a negative one above")
    parameter, ahead = a * (1.0 - e) * (1.0 + e), 1.0 + e * math.cos(anomaly)
    if ahead <= 0.0:
        raise ValueError(f"a true anomaly within {math.degrees(math.acos(-1.0 / e)):.6g} deg, where the hyperbola lies")
    distance, speed = parameter / ahead, math.sqrt(gravity / parameter)
    angle = periapsis + anomaly
    along, across = math.cos(angle), math.sin(angle)
    onward = -(math.sin(angle) + e * math.sin(periapsis)), math.cos(angle) + e * math.cos(periapsis)
    # Axes in the plane of the orbit: towards the ascending node, and a quarter turn ahead.
    ascent = math.cos(node), math.sin(node), 0.0
    quarter = -math.sin(node) * math.cos(i), math.cos(node) * math.cos(i), math.sin(i)

    def placed(size: float, x: float, y: float) -> Vector:
        u, v, w = (size * (x * p + y * q) for p, q in zip(ascent, quarter, strict=True))
        return (u, v, w)

    return placed(distance, along, across), placed(speed, *onward)


def lowest(position: Vector, velocity: Vector, gravity: float) -> float:
    """Return the least distance (m) of the orbit from the centre."""
    distance, parameter, eccentricity = _conic(position, velocity, gravity)
    return min(distance, parameter / (1.0 + eccentricity))


def highest(position: Vector, velocity: Vector, gravity: float) -> float:
    """Return the largest distance (m) of the orbit from the centre; infinity for an unbound orbit."""
    distance, parameter, eccentricity = _conic(position, velocity, gravity)
    return max(distance, parameter / (1.0 - eccentricity)) if eccentricity < 1.0 else math.inf


def angular_momentum(position: Vector, velocity: Vector) -> float:
    """Return the norm of the specific angular momentum (m2/s)."""
    return math.sqrt(_invariants(position, velocity, 0.0)[3])


def period_of(position: Vector, velocity: Vector, gravity: float) -> float:
    """Return the period (s) of an orbit; infinity for an unbound orbit."""
    energy = _invariants(position, velocity, gravity)[1]
    return math.tau * gravity / math.sqrt((-2.0 * energy) ** 3) if energy < 0.0 else math.inf


def highest_speed(position: Vector, velocity: Vector, gravity: float) -> float:
    """Return the largest speed (m/s) of the orbit, which is at periapsis."""
    energy = _invariants(position, velocity, gravity)[1]
    nearest = lowest(position, velocity, gravity)
    return math.sqrt(max(2.0 * (energy + gravity / nearest), math.hypot(*velocity) ** 2))


def meets_at(position: Vector, velocity: Vector, gravity: float, radius: float) -> float:
    """Return the time (s) at which the motion first descends to this distance (m) from the centre, infinity if never. The
    motion starts above it."""
    distance, energy, radial, _ = _invariants(position, velocity, gravity)
    if lowest(position, velocity, gravity) >= radius:
        return math.inf
    # A parabola is treated as an ellipse with a very long period.
    energy = energy if abs(energy) > 1e-12 * gravity / distance else -1e-12 * gravity / distance
    a = -0.5 * gravity / energy
    size, rate = abs(a), math.sqrt(gravity / abs(a) ** 3)
    sine = radial / math.sqrt(gravity * size)
    if a > 0.0:
        cosine, ended = 1.0 - distance / a, 1.0 - radius / a
        eccentricity = math.hypot(cosine, sine)
        begun = math.atan2(sine, cosine)
        end = math.tau - math.acos(max(-1.0, min(1.0, ended / eccentricity)))
        passed = (end - eccentricity * math.sin(end)) - (begun - sine)
        return (passed % math.tau) / rate
    cosine = 1.0 + distance / size
    eccentricity = math.sqrt(max(1.0, (cosine - sine) * (cosine + sine)))
    begun, end = math.asinh(sine / eccentricity), -math.acosh(max(1.0, (1.0 + radius / size) / eccentricity))
    if begun > end:
        return math.inf
    return ((eccentricity * math.sinh(end) - end) - (sine - begun)) / rate


def at_anomaly(position: Vector, velocity: Vector, gravity: float, anomaly: float) -> tuple[Vector, Vector]:
    """Return position (m) and velocity (m/s) on the orbit at a true anomaly `anomaly` (rad) ahead of a position."""
    distance, _, radial, h2 = _invariants(position, velocity, gravity)
    c, s, parameter, h = math.cos(anomaly), math.sin(anomaly), h2 / gravity, math.sqrt(h2)
    e_c, e_s = parameter / distance - 1.0, h * radial / (gravity * distance)
    r = parameter / (1.0 + e_c * c - e_s * s)
    # Lagrange's coefficients (Battin).
    f, g = 1.0 - r / parameter * (1.0 - c), r * distance * s / h
    f1, g1 = gravity / (h * distance) * (radial / h * (1.0 - c) - s), 1.0 - distance / parameter * (1.0 - c)

    def summed(a: float, b: float) -> Vector:
        x, y, z = (a * p + b * v for p, v in zip(position, velocity, strict=True))
        return (x, y, z)

    return summed(f, g), summed(f1, g1)


def _conic(position: Vector, velocity: Vector, gravity: float) -> tuple[float, float, float]:
    """Return distance (m), semi-latus rectum (m) and eccentricity."""
    distance, _, radial, h2 = _invariants(position, velocity, gravity)
    parameter = h2 / gravity
    # From e cos(anomaly) and e sin(anomaly): for nearly circular orbits the energy would lose the eccentricity in rounding.
    return distance, parameter, math.hypot(parameter / distance - 1.0, math.sqrt(parameter / gravity) * radial / distance)


def _invariants(position: Vector, velocity: Vector, gravity: float) -> tuple[float, float, float, float]:
    """Return distance, specific energy, position times velocity, and the square of the specific angular momentum."""
    distance = math.hypot(*position)
    radial = sum(r * v for r, v in zip(position, velocity, strict=True))
    x, y, z = position
    u, v, w = velocity
    h = math.hypot(y * w - z * v, z * u - x * w, x * v - y * u)
    return distance, 0.5 * math.hypot(*velocity) ** 2 - gravity / distance, radial, h**2
