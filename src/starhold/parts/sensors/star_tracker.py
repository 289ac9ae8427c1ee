"""A star tracker: the attitude with a noise rotation, at its own update rate and with a delay."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise, to_reference
from starhold.algebra.scalar import Scalar, both, less, less_equal, opposite, where
from starhold.algebra.structured import when
from starhold.algebra.vector import ZERO, Vector, add, along_axis, dot, scale, subtract
from starhold.parts import as_built, blinding
from starhold.parts.boresight import BORESIGHT, THIRD, unit_boresight
from starhold.parts.contract import NO_ERRORS, UNBOUNDED, Card, Errors, Noise, Parameter
from starhold.parts.craft import Craft
from starhold.parts.ephemeris import EPHEMERIS
from starhold.parts.epoch import EPOCH, START, Date
from starhold.parts.outage import INTERVAL, NEVER, OUTAGE, Silence, Window, in_steps, is_out, steps_of
from starhold.parts.random import Dice

CARD = Card(
    title="Star tracker",
    summary="q_m = q(t - delay) turned by Gaussian angles, more about the boresight; held between updates",
    sources=("Fundamentals of Spacecraft Attitude Determination and Control (2014)", *blinding.SOURCES),
    assumptions=(
        "stars are in view except during the outage, above the rate limit and, as a reading is due, within cones that blind",
        *blinding.ASSUMPTIONS,
        "errors independent from update to update",
        "before its first update it shows the inertial axes",
    ),
)
ROLE = "sensor"
FIRST = {"attitude_is_new": 0.0}
SEEN = ("attitude",)


class Params(NamedTuple):
    """The errors of the star tracker."""

    cross: Annotated[
        float,
        Parameter(
            "rad", at_least=0.0, plain=(0.1, "arcsec"), text="standard deviation about each axis across the boresight"
        ),
    ]
    roll: Annotated[
        float, Parameter("rad", at_least=0.0, plain=(0.1, "arcsec"), text="standard deviation about the boresight")
    ]
    boresight: Annotated[Vector, BORESIGHT] = THIRD
    interval: Annotated[float, INTERVAL] = 0.0
    delay: Annotated[float, as_built.DELAY] = 0.0
    outage: Annotated[Window, OUTAGE] = NEVER
    sun_cone: Annotated[float, blinding.SUN] = 0.0
    moon_cone: Annotated[float, blinding.MOON] = 0.0
    limb_cones: Annotated[tuple[float, float], blinding.LIMB] = blinding.NONE
    rate_limit: Annotated[
        float,
        Parameter(
            "rad/s", above=0.0, plain=(0.5, "deg/s"), text="above which stars smear and there is no reading; none if absent"
        ),
    ] = math.inf
    epoch: Annotated[Date, EPOCH] = START
    jitter: Annotated[float, as_built.JITTER] = 0.0
    mounting_error: Annotated[Vector, as_built.MOUNTING] = ZERO
    ephemeris: Annotated[int, EPHEMERIS] = 0


class Numbers(NamedTuple):
    """Standard deviations (rad), unit vector of the boresight, control steps from update to update, delay, and control steps
    of the outage; the blinding cones, the squared rate limit (rad2/s2) and the rotation of its mounting, () for none."""

    cross: Scalar
    roll: Scalar
    boresight: Vector
    every: Scalar
    late: as_built.Late
    outage: Silence
    cones: blinding.Cones | tuple[()] = ()
    square: tuple[Scalar, ...] = ()
    mounted: as_built.Turn = ()


class Memory(NamedTuple):
    """The last reading, and control steps until the next update."""

    shown: Quaternion
    left: Scalar


class Reading(NamedTuple):
    """The measured attitude, and whether it is new (1) or from an earlier control step (0)."""

    attitude: Annotated[
        Quaternion, Quantity("1", "attitude as the star tracker measures it, inertial to body, scalar first", "quaternion")
    ]
    attitude_is_new: Annotated[float, Quantity("1", "1 where the attitude is a new one, else 0")]


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a control step. Raise ValueError for a boresight without direction, too long a delay, a bad
    outage, and cones that always blind."""
    boresight, mounted = unit_boresight(params.boresight), as_built.turn_of(params.mounting_error)
    looks = to_reference(mounted, boresight) if mounted else boresight
    return Numbers(
        params.cross,
        params.roll,
        boresight,
        steps_of(params.interval, period),
        as_built.late_by(params.delay, period, params.jitter),
        in_steps(params.outage, period),
        blinding.prepared(
            looks, params.sun_cone, params.moon_cone, params.limb_cones, params.epoch, params.ephemeris, period
        ),
        (params.rate_limit * params.rate_limit,) if params.rate_limit < math.inf else (),
        mounted,
    )


def check_start(params: Numbers, start: Any, craft: Craft) -> None:
    """Raise ValueError if cones have no orbit, or always blind."""
    blinding.check(params.cones, start, craft)


def remember(params: Numbers, state: Any) -> Any:
    """Return the initial memory: an update is due. Until the delayed initial attitude arrives, readings are the inertial
    axes."""
    return as_built.awaited(Memory(NO_TURN, 0.0), params.late, state, SEEN)


def measure(state: Any, memory: Any, params: Numbers, dice: Dice, step: int) -> tuple[Reading, Any]:
    """Return the last update, or a new one if it is due, and the memory."""
    then, memory, waiting = as_built.arrived(state, memory, params.late, SEEN, dice, 3)
    seen = then.attitude
    due = both(less(memory.left, 0.5), opposite(is_out(step, params.outage)))
    if params.cones:
        due = both(due, opposite(blinding.is_blind(state, params.cones, step)))
    if params.square:
        due = both(due, less_equal(dot(state.rate, state.rate), params.square[0]))

    def fresh(_: Quaternion) -> tuple[Quaternion]:
        angles = dice.vector(0, 1.0)
        along = scale(dot(angles, params.boresight), params.boresight)
        error = add(scale(0.5 * params.cross, subtract(angles, along)), scale(0.5 * params.roll, along))
        mounted = multiply(seen, params.mounted) if params.mounted else seen
        return (normalise(multiply(mounted, (1.0, *error))),)

    (shown,) = when(due, fresh, memory.shown)
    left = where(due, params.every - 1.0, memory.left - 1.0)
    return Reading(shown, where(due, 1.0, 0.0)), as_built.kept(Memory(shown, left), waiting)


def error(params: Params) -> Errors:
    """Return the mounting error, and the craft's rotation during a delay with jitter; no bound where readings may stop."""
    silent = params.outage != NEVER or params.sun_cone or params.moon_cone or any(params.limb_cones)
    if silent or params.rate_limit < math.inf:
        return UNBOUNDED
    late, gaussian = as_built.latest(params.delay, params.jitter), int(params.jitter > 0.0)
    turned = math.hypot(*params.mounting_error)
    return NO_ERRORS._replace(attitude=turned, turning=as_built.behind(late), ago=late, gaussian=gaussian)


def noise(params: Params, period: float) -> Noise:
    """Return the noise of the angles across the boresight and about it."""
    numbers = prepare(params, period)
    return Noise(along_axis(numbers.boresight, numbers.roll, numbers.cross), int(numbers.every))


def examples() -> list[Params]:
    """Return a small star tracker with four readings per second, an exact but misaligned one, and one with cones."""
    arcsec = math.radians(1.0 / 3600.0)
    sun, moon, lit, dark = (math.radians(angle) for angle in (40.0, 10.0, 30.0, 5.0))
    blinded = Params(1e-5, 1e-4, (0.0, 0.0, -1.0), 0.2, 0.0, NEVER, sun, moon, (lit, dark), math.radians(3.0))
    return [
        Params(6.0 * arcsec, 40.0 * arcsec, (0.0, 0.6, 0.8), 0.25, 0.2),
        Params(0.0, 0.0, mounting_error=(1e-3, -2e-3, 5e-4)),
        blinded._replace(ephemeris=1),
    ]
