"""A magnetometer: the Earth's magnetic field with bias and noise."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, sqrt, where
from starhold.algebra.vector import ZERO, Vector, add, scale
from starhold.parts import magnetic_field
from starhold.parts.contract import NO_ERRORS, UNBOUNDED, Card, Errors, Noise, Parameter
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.outage import NEVER, OUTAGE, Window, in_steps, is_out
from starhold.parts.random import Dice

CARD = Card(
    title="Magnetometer",
    summary="B_m = (1 + scale_error) B + bias + noise, B the Earth's magnetic field in body axes",
    sources=(magnetic_field.SOURCE, "Fundamentals of Spacecraft Attitude Determination and Control (2014)"),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
        "axes along the body's",
        "white noise from control step to control step; a density is one-sided, and a reading has what lies below half the "
        "rate of control",
        "magnetic parts on board show as a constant bias: torque rods are off while it measures",
    ),
)
ROLE = "sensor"
NEEDS = ("two-body",)
ABOUT = "Earth"
FIRST = {"magnetic_field": ZERO, "magnetic_field_is_new": 0.0}


class Params(NamedTuple):
    """The errors of the magnetometer, and the epoch."""

    noise: Annotated[float, Parameter("T", at_least=0.0, text="standard deviation of each component")] = 0.0
    bias: Annotated[Vector, Parameter("T", shape=(3,), spread=False, text="added to the field, body axes")] = ZERO
    scale_error: Annotated[float, Parameter("1", at_least=-0.5, at_most=0.5, text="of the scale factor")] = 0.0
    epoch: Annotated[Date, EPOCH] = START
    outage: Annotated[Window, OUTAGE] = NEVER
    noise_density: Annotated[
        float,
        Parameter("T/sqrt(Hz)", at_least=0.0, text="one-sided; with n readings a second sqrt(n/2) of it adds to `noise`"),
    ] = 0.0


class Numbers(NamedTuple):
    """Deviation and bias (T), the scale factor, the field, and the outage (control steps)."""

    noise: Scalar
    bias: Vector
    factor: Scalar
    field: magnetic_field.Numbers
    outage: Window


class Reading(NamedTuple):
    """The field that it shows, and whether it is a new one (1) or that of an earlier control step (0)."""

    magnetic_field: Annotated[Vector, Quantity("T", "as measured, body axes", "axis")]
    magnetic_field_is_new: Annotated[float, Quantity("1", "1 where the magnetic field is a new one, else 0")]


def prepare(params: Params, period: float) -> Numbers:
    """The numbers of a flight. ValueError for an epoch at which the field is not known, and for a bad outage."""
    field, outage = magnetic_field.prepared(params.epoch, period), in_steps(params.outage, period)
    return Numbers(_deviation(params, period), params.bias, 1.0 + params.scale_error, field, outage)


def remember(params: Numbers, state: Any) -> Vector:
    """No reading yet (T)."""
    return ZERO


def measure(state: Any, memory: Vector, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Vector]:
    """The field at this control step, or in an outage the last one before it."""
    true = magnetic_field.field_at(state.position, step, params.field)
    shown = add(add(scale(params.factor, to_body(state.attitude, true)), params.bias), dice.vector(0, params.noise))
    out = is_out(step, params.outage)
    latest: Any = tuple(where(out, old, new) for old, new in zip(memory, shown, strict=True))
    return Reading(latest, where(out, 0.0, 1.0)), latest


def error(params: Params) -> Errors:
    """The largest error beside noise and without outages, wherever there is no ground."""
    if params.outage != NEVER:
        return UNBOUNDED
    scaled = abs(params.scale_error) * magnetic_field.strongest(params.epoch, magnetic_field.GROUND)
    return NO_ERRORS._replace(field=scaled + math.hypot(*params.bias))


def noise(params: Params, period: float) -> Noise:
    """Tell the noise of a reading."""
    return Noise(field=_deviation(params, period))


def _deviation(params: Params, period: float) -> Scalar:
    """The standard deviation of each component of a reading (T)."""
    return sqrt(params.noise * params.noise + params.noise_density * params.noise_density * (0.5 / period))


def examples() -> list[Params]:
    """Return the magnetometer of a CubeSat, and an exact one with an outage and another epoch."""
    small = Params(noise=5e-8, bias=(2e-7, -1e-7, 3e-7), scale_error=0.002)
    return [small, Params(epoch=(2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), outage=(0.5, 1.5))]
