"""Control by sunlight: the force on a flat reflecting panel, the panel setting for a force, the set of available forces,
and the visible share of the Sun past a body.

Light travels along +X (at L1 and L2 the X axis of `libration`). A panel is set by its area, by the cone angle between
the light and the panel's normal on its dark side, and by the clock angle of that normal about X, from Y towards Z.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.halving import rising
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector, add, norm, scale

LAMBERT = 2.0 / 3.0
"""Recoil of light scattered by Lambert's law, as a share of its momentum."""
MIRROR_RADIUS = 4.0 / (3.0 * math.sqrt(3.0))
"""Radius of the largest ball of forces of a perfect mirror, in units of pressure times area: 0.3849 of its largest force."""
MIRROR_CENTRE = 4.0 / 3.0 * math.sqrt(2.0 / 3.0)
"""Distance of that ball's centre from zero force, away from the Sun."""


class Sail(NamedTuple):
    """A sail: the pressure of sunlight on a black surface facing it (N/m2), area (m2), mass of the craft (kg), specular and
    diffuse reflectivity; the remaining light is absorbed, and emitted equally on both sides."""

    pressure: float
    area: float
    mass: float
    specular: float
    diffuse: float


class Setting(NamedTuple):
    """A panel setting: the area used (m2), cone angle (rad, 0 to pi/2) and clock angle (rad, -pi to pi)."""

    area: float
    cone: float
    clock: float


class Ball(NamedTuple):
    """A ball of forces about a point on the X axis, in units of pressure times area."""

    centre: float
    radius: float


def make_sail(pressure: float, area: float, mass: float, specular: float = 1.0, diffuse: float = 0.0) -> Sail:
    """Return a validated sail. Raise ValueError if a number is out of range or the reflectivities add up to more than 1."""
    for name, number in {"pressure": pressure, "area": area, "mass": mass}.items():
        if not 0.0 < number < math.inf:
            raise ValueError(f"the {name} must be positive and finite, not {number:g}")
    check_optics(specular, diffuse)
    return Sail(float(pressure), float(area), float(mass), float(specular), float(diffuse))


def check_optics(specular: float, diffuse: float) -> None:
    """Raise ValueError unless both reflectivities lie in 0 .. 1 and their sum in (0, 1], so that some light is reflected."""
    for name, number in {"specular": specular, "diffuse": diffuse}.items():
        if not 0.0 <= number <= 1.0:
            raise ValueError(f"the {name} reflectivity must be between 0 and 1, not {number:g}")
    if not 0.0 < specular + diffuse <= 1.0:
        raise ValueError(
            f"specular and diffuse reflectivity must add up to more than 0 and at most 1, not {specular + diffuse:g}"
        )


def force(normal: Vector, area: Scalar, sail: Sail) -> Vector:
    """Return the force (N) on a flat panel of this area (m2) whose unit normal points away from the Sun, normal_x >= 0.

    With c the cosine of the cone angle: pressure area c ((1 - specular) X + (2 specular c + 2/3 diffuse) normal)
    (McInnes, Solar Sailing, 2.6; without the recoil of its heat)."""
    c = normal[0]
    strength = sail.pressure * area * c
    along = scale(strength * (2.0 * sail.specular * c + LAMBERT * sail.diffuse), normal)
    return add(along, (strength * (1.0 - sail.specular), 0.0, 0.0))


def normal_of(setting: Setting) -> Vector:
    """Return the unit normal of a panel."""
    across = math.sin(setting.cone)
    return (math.cos(setting.cone), across * math.cos(setting.clock), across * math.sin(setting.clock))


def given(setting: Setting, sail: Sail) -> Vector:
    """Return the force (N) of a panel."""
    return force(normal_of(setting), setting.area, sail)


def set_for(wanted: Vector, sail: Sail) -> Setting:
    """Return the panel of the least area that gives this force (N). In closed form for a mirror, else by bisection of
    the cone angle.

    Raise ValueError if the force points too far from the light, or needs more area than the sail has."""
    across = math.hypot(wanted[1], wanted[2])
    if across == 0.0 == wanted[0]:
        return Setting(0.0, 0.0, 0.0)
    lean, widest = math.atan2(across, wanted[0]), max_lean(sail.specular, sail.diffuse)
    if lean > widest or lean >= 0.5 * math.pi:
        shown = f"{math.degrees(widest):.4g} deg from the light; this one has {math.degrees(lean):.4g} deg"
        raise ValueError(f"the force of this sail leans at most {shown}")
    cone = cone_for(lean, sail.specular, sail.diffuse)
    clock = math.atan2(wanted[2], wanted[1]) if across else 0.0
    area = norm(wanted) / norm(given(Setting(1.0, cone, clock), sail))
    if area > sail.area * (1.0 + 1e-12):
        raise ValueError(f"the force needs {area:.6g} m2 of sail; there are {sail.area:g} m2")
    return Setting(min(area, sail.area), cone, clock)


def steer(control: Vector, sail: Sail) -> Setting:
    """Return the panel for a control acceleration (m/s2) measured from the centre of the ball of forces: the sail gives it
    together with the steady push `push(sail)` away from the Sun. Every control within `reach(sail)` is available. Errors as
    in `set_for`."""
    return set_for(scale(sail.mass, (control[0] + push(sail), control[1], control[2])), sail)


def steered(setting: Setting, sail: Sail) -> Vector:
    """Return the control acceleration (m/s2) of a panel setting, the inverse of `steer`."""
    x, y, z = scale(1.0 / sail.mass, given(setting, sail))
    return (x - push(sail), y, z)


def push(sail: Sail) -> float:
    """Return the acceleration (m/s2) at the centre of the ball of forces; it moves the equilibrium towards the Sun by
    push/(Omega^2 + 2 C)."""
    return ball(sail.specular, sail.diffuse).centre * sail.pressure * sail.area / sail.mass


def reach(sail: Sail) -> float:
    """Return the radius (m/s2) of the largest ball of control accelerations."""
    return ball(sail.specular, sail.diffuse).radius * sail.pressure * sail.area / sail.mass


def lean_of(cone: float, specular: float, diffuse: float) -> float:
    """Return the angle between light and force (rad) for this cone angle."""
    c, along = math.cos(cone), 2.0 * specular * math.cos(cone) + LAMBERT * diffuse
    return math.atan2(along * math.sin(cone), 1.0 - specular + along * c)


def widest_cosine(specular: float, diffuse: float) -> float:
    """Return the cosine of the cone angle of the largest angle between light and force. Beyond it the same directions
    recur, with less force."""
    a, b, e = 1.0 - specular, 2.0 * specular, LAMBERT * diffuse
    # The sign of d(lean)/d(cone) is that of (b^2 + 2ab) c^2 + (2be + ae) c + e^2 - ab, which grows with c.
    if e * e >= a * b:
        return 0.0
    half = 0.5 * (2.0 * b + a) * e
    return (a * b - e * e) / (half + math.sqrt(half * half + b * (b + 2.0 * a) * (a * b - e * e)))


def max_lean(specular: float, diffuse: float) -> float:
    """Return the largest angle between light and force (rad)."""
    return lean_of(math.acos(widest_cosine(specular, diffuse)), specular, diffuse)


def cone_for(lean: float, specular: float, diffuse: float) -> float:
    """Return the smallest cone angle (rad) at which the force leans this far from the light (rad, at most `max_lean`)."""
    if specular == 1.0:
        return lean
    widest = math.acos(widest_cosine(specular, diffuse))
    return rising(lambda cone: lean_of(cone, specular, diffuse) - lean, 0.0, widest)


def outline(specular: float, diffuse: float, count: int = 181) -> NDArray[np.float64]:
    """Return the outline (count, 2) of the forces with the full area, along X and across it, in units of pressure times
    area, from zero to the largest angle. The set of all forces is the region between it and the origin, rotated about X; it
    is convex."""
    cone = np.linspace(0.0, math.acos(widest_cosine(specular, diffuse)), count)
    c, along = np.cos(cone), 2.0 * specular * np.cos(cone) + LAMBERT * diffuse
    return np.stack([c * (1.0 - specular + along * c), c * along * np.sin(cone)], axis=1)


@cache
def ball(specular: float, diffuse: float) -> Ball:
    """Return the largest ball about a point of the X axis within the forces that a sail can give. It is exact for a mirror,
    else correct to ten digits: the radius is a concave function of the centre, because the set is convex. Without diffuse
    reflection it is `specular` times that of a mirror."""
    check_optics(specular, diffuse)
    if specular == 1.0:
        return Ball(MIRROR_CENTRE, MIRROR_RADIUS)
    low, high = 0.0, 1.0 + specular + LAMBERT * diffuse
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    for _ in range(60):
        left, right = high - golden * (high - low), low + golden * (high - low)
        if room(left, specular, diffuse) < room(right, specular, diffuse):
            low = left
        else:
            high = right
    centre = 0.5 * (low + high)
    return Ball(centre, room(centre, specular, diffuse))


def room(centre: float, specular: float, diffuse: float) -> float:
    """Return the distance from a point of the X axis to the nearest unavailable force, in units of pressure times area."""
    a, b, e = 1.0 - specular, 2.0 * specular, LAMBERT * diffuse
    # The squared distance to the outline is a polynomial in the cosine c of the cone angle. Between the extrema of its
    # slope, the slope changes sign at most once: trying all such intervals finds every minimum.
    c4, c3, c2 = b * (b + 2.0 * a), 2.0 * (a + b) * e - 2.0 * centre * b, a * a + e * e - 2.0 * centre * e
    c1, c0 = -2.0 * centre * a, centre * centre
    edge = widest_cosine(specular, diffuse)
    knots = sorted([edge, *(c for c in _quadratic(6.0 * c4, 3.0 * c3, c2) if edge < c < 1.0), 1.0])

    def slope(c: float) -> float:
        return c1 + c * (2.0 * c2 + c * (3.0 * c3 + c * 4.0 * c4))

    near = knots + [rising(slope, low, high) for low, high in pairwise(knots)]
    arc = math.sqrt(max(0.0, min(c0 + c * (c1 + c * (c2 + c * (c3 + c * c4))) for c in near)))
    # Besides the outline, the boundary of the set is the cone of the largest angle.
    return min(arc, centre * math.sin(max_lean(specular, diffuse)))


def _quadratic(a: float, b: float, c: float) -> list[float]:
    """Return the real roots of a x^2 + b x + c, also for a nearly zero."""
    inside = b * b - 4.0 * a * c
    if inside < 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(inside), b))
    return [part / whole for part, whole in ((q, a), (c, q)) if abs(part) < abs(whole)]


def lit(offset: Any) -> NDArray[np.float64]:
    """Return the visible share of the Sun's disc at an offset from the axis in radii of the occulting body (any shape), for
    apparently equal discs, nearly as at the Earth's L2: 1 - (2/pi)(arccos s - s sqrt(1 - s^2)), s = offset/2."""
    s = np.minimum(0.5 * np.abs(np.asarray(offset, dtype=float)), 1.0)
    return 1.0 - (2.0 / math.pi) * (np.arccos(s) - s * np.sqrt(1.0 - s * s))


def lit_discs(separation: Any, sun: float, body: float) -> NDArray[np.float64]:
    """Return the visible share of the Sun's disc (angular radius `sun`) past a disc of angular radius `body` at this
    separation of their centres (any shape); small angles in the same unit, the Sun uniformly bright."""
    t = np.clip(np.abs(np.asarray(separation, dtype=float)), max(abs(sun - body), 1e-300), sun + body)
    ours = sun * sun * np.arccos(np.clip((t * t + (sun - body) * (sun + body)) / (2.0 * t * sun), -1.0, 1.0))
    theirs = body * body * np.arccos(np.clip((t * t - (sun - body) * (sun + body)) / (2.0 * t * body), -1.0, 1.0))
    sides = (sun + body - t) * (t + sun - body) * (t - sun + body) * (t + sun + body)
    return 1.0 - (ours + theirs - 0.5 * np.sqrt(np.maximum(sides, 0.0))) / (math.pi * sun * sun)
