"""Attitude from the measured directions of the Sun and the magnetic field and those computed for position and time; the
gyro propagates it while one of them is missing."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.cosines import to_quaternion
from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar, Truth, both, less, maximum, sqrt
from starhold.algebra.structure import chosen
from starhold.algebra.vector import IDENTITY, Matrix, Vector, cross, dot, scale, transpose
from starhold.algebra.vector import multiply as product
from starhold.parts import directions, magnetic_field, sun
from starhold.parts.contract import Card, Direction, Errors, Noise
from starhold.parts.craft import Craft
from starhold.parts.directions import APART, Estimate, Memory, attitude_at_start, fixed, measured_or_carried
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date

CARD = Card(
    title="TRIAD",
    summary="A = [s, u, s x u] measured times [s, u, s x u] computed, transposed, with u = unit(s x B)",
    sources=("A passive system for determining the attitude of a satellite (1964)", *sun.SOURCES, magnetic_field.SOURCE),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "the Sun is better known than the field: its direction is kept, and of the field only the plane through both",
        "the gyro's bias is small while the Sun is out of sight",
    ),
)
ROLE = "estimator"
ABOUT = "Earth"
NEEDS = ("sun", "sun_is_seen", "magnetic_field", "position", "rate")
FIRST = {"attitude_age": 0.0, "is_valid": 0.0}
TINY = 1e-30
remember, recursion = attitude_at_start, directions.recursion


class Params(NamedTuple):
    """The epoch, and the least angle between the two directions."""

    epoch: Annotated[Date, EPOCH] = START
    apart: Annotated[float, APART] = math.radians(5.0)
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """The Sun, the field, and the squared sine of the least angle."""

    sun: sun.Numbers
    field: magnetic_field.Numbers
    sine_squared: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an epoch at which the field is not known."""
    light = sun.prepared(params.epoch, params.ephemeris)
    return Numbers(light, magnetic_field.prepared(params.epoch), math.sin(params.apart) ** 2)


def estimate(readings: Any, memory: Memory, params: Numbers, craft: Craft, period: Scalar) -> tuple[Estimate, Memory]:
    """Return the attitude from both directions if available, else the one propagated by the gyro, and the new memory."""

    def observe(time: Scalar) -> tuple[Quaternion, Truth]:
        there = both(less(0.5, readings.sun_is_seen), less(0.5, getattr(readings, "magnetic_field_is_new", 1.0)))
        axes, clear = triad(readings.sun, readings.magnetic_field, params.sine_squared)
        reference, _ = triad(
            sun.sun(time, params.sun).direction, magnetic_field.field(readings.position, time, params.field), 0.0
        )
        usable = both(there, clear)
        # An unusable measurement is replaced by finite numbers.
        return to_quaternion(chosen(usable, product(axes, transpose(reference)), IDENTITY)), usable

    return measured_or_carried(readings, memory, period, observe)


def triad(first: Vector, second: Vector, sine_squared: Scalar) -> tuple[Matrix, Truth]:
    """Return three axes as columns, the first along the first vector (of unit length), the second perpendicular to both;
    and whether the angle between them exceeds that of this squared sine."""
    across = cross(first, second)
    square = dot(across, across)
    clear = less(sine_squared * dot(second, second), square)
    middle = scale(1.0 / sqrt(maximum(square, TINY)), across)
    return transpose((first, middle, cross(first, middle))), clear


def combined(params: Params, seen: tuple[Direction, ...]) -> tuple[Errors, Noise] | None:
    """Return errors and noise of the attitude from these directions of Sun and field; None for too large errors,
    and without either.

    Let s and b be the true unit vectors, a their angle, u = s x b/sin a; s' and b' the measured ones, those of s + x and
    b + y, and a' their angle, no less than `apart` from 0 and half a turn. The estimate is the shortest rotation from s to
    s', by an angle D about c, followed by one about s' by P. It is e = s x x + p s off, p = (y.u - cos a x.u)/sin a, to the
    first order. Of independent x and y of the deviations S and B across the vectors, e has the covariance S^2 u u' and that
    of (-S n1, (B n2 + cos a S n1)/sin a), whose largest eigenvalue has the trace (S^2 + B^2)/sin^2 a and the determinant
    S^2 B^2/sin^2 a with the other one, as of Shuster and Oh (1981). It grows as sin a falls.

    Beyond the first order: D is at most asin |x|, d = asin |y|. The rotated b and b' are within D + d, so for D + d < apart
    sin |P| <= sin(D + d)/sin a'. With the first rotation R sin P = b'.Ru/sin a', where b'.Ru is sin a p but for D^2/2 + D d
    + |x|^2/(1 - |x|) + |y|^2/(1 - |y|), and sin a/sin a' is 1 but for (D + d)/sin a'. The product of both rotations has the
    vector part c sin D/2 cos P/2 + s' cos D/2 sin P/2 + s' x c sin D/2 sin P/2. Twice this is D c + P s but for
    3/2 D P + (D^3 + P^3)/24 + D P (D + P)/8, and its rotation vector but for T^3/24 more, T^2 = D^2 + P^2. D c is s x x but
    for D^3/6 + |x|^2/(1 - |x|)."""
    if {one.of for one in seen} != {"sun", "field"}:
        return None
    sun, field = sorted(seen, key=lambda one: one.of, reverse=True)
    x, y = sun.most, field.most
    if not max(x, y) < 0.5 or not (reach := math.asin(x) + math.asin(y)) < params.apart:
        return None
    # sin a and sin a' at least; angles are as near to half a turn at most.
    true, measured = math.sin(params.apart - reach), math.sin(params.apart)
    tilt, turn = math.asin(x), math.asin(min(math.sin(reach) / measured, 1.0))
    angle = math.hypot(tilt, turn)
    rest = x * x / (1.0 - x) + tilt * tilt / 2.0 + y * y / (1.0 - y) + tilt * math.asin(y)
    error = (x + y) / true * reach / measured + rest / measured + (turn - math.sin(turn))
    error += 1.5 * tilt * turn + (tilt**3 + turn**3 + angle**3) / 24.0 + tilt * turn * (tilt + turn) / 8.0
    error += tilt**3 / 6.0 + x * x / (1.0 - x)
    error += math.hypot(sun.error, (field.error + sun.error * math.cos(params.apart - reach)) / true)
    total, both = sun.deviation**2 + field.deviation**2, 2.0 * sun.deviation * field.deviation * true
    return fixed(seen, error, math.sqrt((total + math.sqrt(max(total * total - both * both, 0.0))) / 2.0) / true)


def examples() -> list[Params]:
    """Return the default epoch, and another one."""
    return [Params(), Params((2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), math.radians(20.0))]
