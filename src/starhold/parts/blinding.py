"""Blinding of an optical head by the Sun, the Moon and the Earth's limb within cones about its boresight."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any, NamedTuple

from starhold.algebra.quaternion import to_reference
from starhold.algebra.scalar import Scalar, Truth, both, either, less, maximum, minimum, sqrt, where
from starhold.algebra.vector import Vector, add, dot, norm, scale, subtract, unit
from starhold.algebra.words import number_of
from starhold.parts import moon, sun
from starhold.parts.contract import Parameter
from starhold.parts.craft import Craft
from starhold.parts.epoch import Date
from starhold.parts.orbit import BODIES, body_of

SOURCES = (*sun.SOURCES, *moon.SOURCES)
ASSUMPTIONS = (
    *sun.ASSUMPTIONS,
    *moon.ASSUMPTIONS,
    "a cone is a half angle about the boresight; within it the centre of Sun or Moon blinds, and the Earth to its limb",
    "the Sun does not blind where the Earth hides it; the Moon does at any phase",
    "the limb is that of a sphere, lit where its point nearest the boresight is in sunlight",
)
SUN, MOON = (
    Parameter("rad", at_least=0.0, text=f"angle from the boresight within which the {name} blinds; none if 0")
    for name in ("Sun", "Moon")
)
LIMB = Parameter(
    "rad",
    shape=(2,),
    spread=False,
    at_least=0.0,
    text="angles from the boresight within which the Earth's limb blinds: where it is lit, where it is dark; none if both 0",
)
"""The declaration of the limb's cones, common to all sensors."""
NONE = (0.0, 0.0)
RADIUS = BODIES["Earth"].radius


class Cones(NamedTuple):
    """The unit vector of the boresight (body axes); cosines of the cones of Sun and Moon, cosines and sines of those of
    the lit and of the dark limb, () for none; Sun and Moon at the start; the control period (s)."""

    boresight: Vector
    sun: tuple[Scalar, ...]
    moon: tuple[Scalar, ...]
    lit: tuple[Scalar, ...]
    dark: tuple[Scalar, ...]
    solar: sun.Numbers
    lunar: moon.Numbers | tuple[()]
    period: Scalar


def prepared(
    boresight: Vector,
    sun_cone: float,
    moon_cone: float,
    limb_cones: tuple[float, float],
    epoch: Date,
    ephemeris: int,
    period: float,
) -> Cones | tuple[()]:
    """Return the cones of a head, () without any. Raise ValueError for a cone that always blinds, and for a bad epoch."""
    for name, cone in (("Sun", sun_cone), ("Moon", moon_cone), ("lit limb", limb_cones[0]), ("dark limb", limb_cones[1])):
        if cone >= math.pi:
            shown = f"{math.degrees(cone):g} deg about the boresight"
            raise ValueError(f"a cone of {shown} is the whole sky: the {name} blinds always; it is half the cone's opening")
    if not sun_cone and not moon_cone and tuple(limb_cones) == NONE:
        return ()
    lit, dark = ((math.cos(cone), math.sin(cone)) for cone in limb_cones)
    earth = tuple(limb_cones) != NONE
    return Cones(
        boresight,
        (math.cos(sun_cone),) if sun_cone else (),
        (math.cos(moon_cone),) if moon_cone else (),
        lit if earth else (),
        dark if earth else (),
        sun.prepared(epoch, ephemeris),
        moon.prepared(epoch, ephemeris) if moon_cone else (),
        period,
    )


def check(cones: Cones | tuple[()], start: Any, craft: Craft) -> None:
    """Raise ValueError if the cones have no orbit about the Earth, or the limb lies within one in every attitude."""
    if not cones:
        return
    distance = norm(start.position)
    if body_of(craft.gravity) != "Earth" or not distance > RADIUS:
        raise ValueError("cones of Sun, Moon and limb need an orbit about the Earth: see [orbit]")
    edge = math.asin(RADIUS / distance)
    if cones.lit and min(math.atan2(s, c) for c, s in (cones.lit, cones.dark)) >= math.pi - edge:
        limb = f"{math.degrees(edge):.4g} deg from its centre on this orbit"
        raise ValueError(f"the Earth's limb, {limb}, blinds always: limb_cones must be less than what is left of 180 deg")


def is_blind(state: Any, cones: Cones, step: int) -> Truth:
    """Tell whether a head with these cones is blinded at a control step."""
    time, along = number_of(step) * cones.period, to_reference(state.attitude, cones.boresight)
    seen = sun.sun(time, cones.solar)
    blind: list[Truth] = []
    if cones.sun:
        near = less(cones.sun[0], dot(along, seen.direction))
        blind.append(both(near, less(0.0, sun.in_view(state.position, seen))))
    if cones.lunar:
        toward = unit(subtract(moon.position(time, cones.lunar), state.position))
        blind.append(less(cones.moon[0], dot(along, toward)))
    if cones.lit:
        blind.append(_by_limb(state.position, along, seen.direction, cones))
    return reduce(either, blind)


def _by_limb(position: Vector, along: Vector, light: Vector, cones: Cones) -> Truth:
    """Return whether the Earth blinds: the boresight is nearer to its centre than the limb's angle plus the cone."""
    inverse = sqrt(1.0 / dot(position, position))
    up, sine = scale(inverse, position), minimum(RADIUS * inverse, 1.0)
    cosine, toward = sqrt(maximum(1.0 - sine * sine, 0.0)), -inverse * dot(position, along)
    # The direction of the limb's point nearest the boresight, times the sine of that one's angle from the centre.
    beside = add(along, scale(toward, up))
    lit = less(0.0, sine * norm(beside) * dot(up, light) + cosine * dot(beside, light))
    (c, s), (dark_c, dark_s) = cones.lit, cones.dark
    c, s = where(lit, c, dark_c), where(lit, s, dark_s)
    # Half a turn from the centre is the whole sky.
    return either(less(cosine * c - sine * s, toward), less(sine * c + cosine * s, 0.0))
