"""Measured directions that are known in inertial axes: of Sun, magnetic field and the Earth's centre."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

from starhold.algebra.quaternion import Quaternion, to_body
from starhold.algebra.scalar import Scalar, Truth, divide, less, maximum, where
from starhold.algebra.vector import ZERO, Matrix, Vector, add, along_axis, combine, cross, norm, scale
from starhold.parts import magnetic_field, sun
from starhold.parts.contract import Parameter
from starhold.parts.epoch import Date

Pair: TypeAlias = tuple[Vector, Vector, Scalar, Truth]
"""A unit vector as measured (body axes) and as computed (inertial axes), its weight, and whether it is available."""
KINDS = {"sun": ("sun", "sun_is_seen"), "field": ("magnetic_field", "position"), "nadir": ("nadir", "position")}
"""The readings that each kind of direction needs, by the name of the parameter with its standard deviation."""
SEVERAL = dict.fromkeys(("sun", "sun_is_seen", "magnetic_field", "nadir"), "")
"""Readings that are taken from all sensors."""
TINY = 1e-30


def deviation(of: str) -> Parameter:
    """Return the declaration of a direction's standard deviation, which selects the direction."""
    return Parameter("rad", above=0.0, text=f"assumed standard deviation of {of}, which is then used; not used if absent")


def needed(deviations: Any) -> tuple[str, ...]:
    """Return the readings that the directions with these standard deviations need."""
    return tuple(name for kind, names in KINDS.items() if getattr(deviations, kind) < math.inf for name in names)


class Known(NamedTuple):
    """The models of Sun and field, and the weight of each kind of direction; () for directions that are not used."""

    sun: sun.Numbers | tuple[()]
    field: magnetic_field.Numbers | tuple[()]
    weights: tuple[tuple[Scalar, ...], ...]


def known_from(deviations: Any, epoch: Date, ephemeris: int, unit: float = 1.0) -> Known:
    """Return the numbers of a flight, for parameters with the standard deviations `sun`, `field` and `nadir` (rad), `inf`
    for a direction that is not used. Weights are inverse variances in units of 1/unit^2. Raise ValueError for an epoch at
    which Sun or field are not known."""
    each = [getattr(deviations, kind) for kind in KINDS]
    weights = tuple(((unit / deviation) ** 2,) if deviation < math.inf else () for deviation in each)
    light = sun.prepared(epoch, ephemeris) if weights[0] else ()
    return Known(light, magnetic_field.prepared(epoch) if weights[1] else (), weights)


def pairs_of(readings: Any, time: Scalar, known: Known) -> list[Pair]:
    """Return all directions among the readings of all sensors at a time (s) after the start."""
    every = getattr(readings, "every", (readings,))
    light = sun.sun(time, known.sun).direction if known.sun else ZERO
    pull = magnetic_field.field(readings.position, time, known.field) if known.field else ZERO
    kinds = (
        ("sun", "sun_is_seen", light),
        ("magnetic_field", "magnetic_field_is_new", pull),
        ("nadir", "nadir_is_seen", scale(-1.0, getattr(readings, "position", ZERO))),
    )
    return [
        (_unit(getattr(one, name)), _unit(reference), weight, less(0.5, getattr(one, flag, 1.0)))
        for (name, flag, reference), taken in zip(kinds, known.weights, strict=True)
        for weight in taken
        for one in every
        if hasattr(one, name)
    ]


def _unit(vector: Vector) -> Vector:
    return scale(divide(1.0, maximum(norm(vector), TINY)), vector)


def information(pairs: list[Pair], attitude: Quaternion) -> tuple[Matrix, Vector]:
    """Return the inverse covariance (1/rad2) of the small turn from an attitude to the true one (rad, body axes) given all
    directions, whose weights are inverse variances (1/rad2), and this times the turn.

    A turn e moves a direction b to b + b x e. A direction gives no information about turns about itself."""
    total, pull = (ZERO, ZERO, ZERO), ZERO
    for seen, reference, weight, there in pairs:
        foretold, counted = to_body(attitude, reference), where(there, weight, 0.0)
        total = combine(1.0, total, 1.0, along_axis(foretold, 0.0, counted))
        pull = add(pull, scale(counted, cross(seen, foretold)))
    return total, pull
