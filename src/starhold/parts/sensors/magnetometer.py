"""A magnetometer: the Earth's magnetic field with bias and noise."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import to_body
from starhold.algebra.scalar import Scalar, sqrt, where
from starhold.algebra.vector import ZERO, Matrix, Vector, add, scale
from starhold.parts import as_built, magnetic_field
from starhold.parts.contract import DEVIATIONS, NO_ERRORS, UNBOUNDED, Card, Direction, Errors, Noise, Parameter, Sky
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.outage import INTERVAL, NEVER, OUTAGE, Silence, Window, in_steps, is_out, steps_of
from starhold.parts.random import Dice

CARD = Card(
    title="Magnetometer",
    summary="B_m = (1 + scale_error) B + bias + noise, B the Earth's magnetic field in body axes",
    sources=(magnetic_field.SOURCE, "Fundamentals of Spacecraft Attitude Determination and Control (2014)"),
    assumptions=(
        *magnetic_field.ASSUMPTIONS,
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

    noise: Annotated[
        float, Parameter("T", at_least=0.0, plain=(1e-5, "nT"), text="standard deviation of each component")
    ] = 0.0
    bias: Annotated[Vector, Parameter("T", shape=(3,), spread=False, text="added to the field, body axes")] = ZERO
    scale_error: Annotated[float, Parameter("1", at_least=-0.5, at_most=0.5, text="of the scale factor")] = 0.0
    epoch: Annotated[Date, EPOCH] = START
    outage: Annotated[Window, OUTAGE] = NEVER
    noise_density: Annotated[
        float,
        Parameter("T/sqrt(Hz)", at_least=0.0, text="one-sided; with n readings a second sqrt(n/2) of it adds to `noise`"),
    ] = 0.0
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO
    axis_errors: Annotated[Matrix | Vector, as_built.AXES] = ZERO
    resolution: Annotated[float, as_built.resolution("T")] = 0.0
    limit: Annotated[float, as_built.limit("T")] = math.inf
    jitter: Annotated[float, as_built.JITTER] = 0.0
    delay: Annotated[float, as_built.DELAY] = 0.0
    interval: Annotated[float, INTERVAL] = 0.0


class Numbers(NamedTuple):
    """Standard deviation and bias (T), the scale factor, the field, and outage and interval (control steps); its axes and
    its resolution (T), () for none, its limit (T), and the delay."""

    noise: Scalar
    bias: Vector
    factor: Scalar
    field: magnetic_field.Numbers
    outage: Silence
    axes: as_built.Axes = ()
    step: as_built.Step = ()
    limit: tuple[Scalar, ...] = ()
    late: as_built.Late = ()


class Reading(NamedTuple):
    """The measured field, and whether it is new (1) or from an earlier control step (0)."""

    magnetic_field: Annotated[Vector, Quantity("T", "as measured, body axes", "axis")]
    magnetic_field_is_new: Annotated[float, Quantity("1", "1 where the magnetic field is a new one, else 0")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for an epoch at which the field is not known, for a bad outage and
    too long a delay."""
    field, outage = magnetic_field.prepared(params.epoch, period), in_steps(params.outage, period, params.interval)
    return Numbers(
        _deviation(params, period),
        params.bias,
        1.0 + params.scale_error,
        field,
        outage,
        as_built.axes_of(params.mounting_error, params.axis_errors),
        as_built.step_of(params.resolution),
        (params.limit,) if params.limit < math.inf else (),
        as_built.late_by(params.delay, period, params.jitter),
    )


def remember(params: Numbers, state: Any) -> Any:
    """Return the initial memory: a zero reading (T), and the initial state if the sensor is delayed."""
    return as_built.awaited(ZERO, params.late, state, as_built.PLACE)


def measure(state: Any, memory: Any, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Any]:
    """Return the field at this control step, or in an outage the last one before it, and the memory."""
    state, memory, waiting = as_built.arrived(state, memory, params.late, as_built.PLACE, dice, 3)
    true = magnetic_field.field_at(state.position, step, params.field)
    seen = as_built.along(params.axes, to_body(state.attitude, true))
    shown = add(add(scale(params.factor, seen), params.bias), dice.vector(0, params.noise))
    if params.step or params.limit:
        shown = as_built.shown(shown, params.step, params.limit[0] if params.limit else math.inf)
    out = is_out(step, params.outage)
    latest: Any = tuple(where(out, old, new) for old, new in zip(memory, shown, strict=True))
    return Reading(latest, where(out, 0.0, 1.0)), as_built.kept(latest, waiting)


def error(params: Params) -> Errors:
    """Return the largest error besides noise of a reading that is always new, anywhere above ground."""
    late = as_built.is_given(params.interval, params.jitter, params.delay)
    if params.outage != NEVER or params.limit < math.inf or late:
        return UNBOUNDED
    skewed = as_built.stretch(as_built.axes_of(params.mounting_error, params.axis_errors))
    share = abs(params.scale_error) * (1.0 + skewed) + skewed
    scaled = share * magnetic_field.strongest(params.epoch, magnetic_field.GROUND)
    return NO_ERRORS._replace(field=scaled + math.hypot(*params.bias) + as_built.off_step(params.resolution))


def direction(params: Params, period: float, sky: Sky) -> Direction:
    """Return what axes, bias, resolution and a delay of the position do to the direction of a new reading, and its noise; no
    bound with jitter, and where the field may reach the limit. A scale factor turns no direction."""
    every, deviation = int(steps_of(params.interval, period)), float(_deviation(params, period))
    added, factor = math.hypot(*params.bias) + as_built.off_step(params.resolution), 1.0 + params.scale_error
    skewed = as_built.stretch(as_built.axes_of(params.mounting_error, params.axis_errors))
    largest = magnetic_field.strongest(params.epoch, magnetic_field.GROUND) if params.limit < math.inf else 0.0
    clipped = factor * (1.0 + skewed) * largest + added + DEVIATIONS * deviation > params.limit
    if as_built.is_given(params.jitter) or clipped:
        return Direction("field", math.inf, every=every)
    least = factor * sky.weakest
    # The axes act on the field of where the craft was.
    error = skewed + (1.0 + skewed) * params.delay * sky.speed * sky.turning + added / least
    return Direction("field", error, deviation / least, params.delay, every)


def noise(params: Params, period: float) -> Noise:
    """Return the noise of a reading."""
    return Noise(field=_deviation(params, period))


def _deviation(params: Params, period: float) -> Scalar:
    """Return the standard deviation of each component of a reading (T)."""
    return sqrt(params.noise * params.noise + params.noise_density * params.noise_density * (0.5 / period))


def examples() -> list[Params]:
    """Return the magnetometer of a CubeSat, an exact one with an outage and another epoch, and one with errors of
    manufacture."""
    small = Params(noise=5e-8, bias=(2e-7, -1e-7, 3e-7), scale_error=0.002)
    built = small._replace(mounting_error=(0.0, 0.01, -0.02), axis_errors=(1e-3, -2e-3, 5e-4), resolution=1.5e-8, limit=1e-4)
    return [small, Params(epoch=(2027.0, 6.0, 21.0, 12.0, 30.0, 15.0), outage=(0.5, 1.5)), built]
