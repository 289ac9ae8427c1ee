"""A body axis swings about the direction to the centre of attraction, sinusoidally or line by line."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from starhold.algebra.circular import cosine_sine, nearest
from starhold.algebra.quaternion import Quaternion
from starhold.algebra.scalar import Scalar, absolute, less, side, where
from starhold.algebra.vector import ZERO, Matrix, Vector, cross, norm, scale
from starhold.algebra.words import number_of
from starhold.parts.contract import Card, Motion, Orbit, Parameter
from starhold.parts.craft import EARTH
from starhold.parts.roles import Goal
from starhold.parts.targets.alignment import AXIS, GRAVITY, OTHER, ROOM, Moving, aligned, body_axes, opposite_of, orbiting
from starhold.parts.targets.eigenaxis import onto

CARD = Card(
    title="Scan",
    summary="a body axis at x(t) from the centre of attraction, x a sine, or straight lines to and fro (raster)",
    sources=("Spacecraft Dynamics and Control (1997): the orbital frame", "kinematics of two turns, one after the other"),
    assumptions=("two-body motion", "the lines of a raster are apart by the motion along the orbit"),
)
ROLE = "target"
NEEDS = ("two-body",)
FOLLOWS = True


class Params(NamedTuple):
    """Amplitude, period and shape of the swings, and the body axes."""

    amplitude: Annotated[float, Parameter("rad", above=0.0, at_most=1.5, text="to either side of nadir")]
    swing: Annotated[float, Parameter("s", above=0.0, text="time from one side to the other and back")]
    shape: Annotated[int, Parameter(choices=("sinusoidal", "raster"), text="of the angle over time")] = 0
    turning: Annotated[
        float, Parameter("1", above=0.0, at_most=1.0, text="share of a raster's time in which it reverses, evenly")
    ] = 0.2
    axis: Annotated[Vector, AXIS] = (0.0, 0.0, 1.0)
    other: Annotated[Vector, OTHER] = (0.0, 1.0, 0.0)
    about: Annotated[Vector, Parameter("1", shape=(3,), spread=False, text="body axis that it swings about")] = (
        1.0,
        0.0,
        0.0,
    )
    gravity: Annotated[float, GRAVITY] = EARTH


class Numbers(NamedTuple):
    """The amplitude (rad), swings per second, the shape, the share in which it reverses, the triad of the body axes and the
    axis of the swings, the gravitational parameter (m3/s2), and the control period (s)."""

    amplitude: Scalar
    often: Scalar
    shape: int
    turning: Scalar
    axes: Matrix
    about: Vector
    gravity: Scalar
    period: Scalar


def prepare(params: Params, period: float) -> Numbers:
    """Return the numbers of a flight. Raise ValueError for axes that do not determine the attitude."""
    if not norm(params.about) > 0.0:
        raise ValueError("the axis that it swings about needs a direction")
    axes, about = body_axes(params.axis, params.other), scale(1.0 / norm(params.about), params.about)
    swings = params.amplitude, 1.0 / params.swing, params.shape, params.turning
    return Numbers(*swings, axes, about, params.gravity, period)


def goal(params: Numbers, state: Any, step: int, before: Quaternion) -> Goal:
    """Return the goal at this control step: nadir, with the second axis as near as possible to the negative orbit normal,
    and a turn from there."""
    down = opposite_of(orbiting(state.position, state.velocity, params.gravity))
    against = scale(-1.0, cross(state.position, state.velocity))
    nadir = aligned(down, Moving(against, ZERO, ZERO), params.axes, before)
    angle, rate, slope = (_sine, _raster)[params.shape](params, number_of(step) * params.period * params.often)
    cosine, sine = cosine_sine(angle / (2.0 * math.tau))
    swung = Goal((cosine, *scale(sine, params.about)), scale(rate, params.about), scale(slope, params.about))
    return onto(nadir, swung, before)


def _sine(params: Numbers, swings: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Return the angle (rad) of a sine after `swings` swings, its rate and its acceleration."""
    cosine, sine = cosine_sine(swings)
    often = math.tau * params.often
    return params.amplitude * sine, often * params.amplitude * cosine, -often * often * params.amplitude * sine


def _raster(params: Numbers, swings: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Return the angle (rad) on straight lines with constant acceleration at their ends, its rate and its acceleration."""
    phase = swings - nearest(swings)
    quarter = 0.25 - absolute(0.25 - absolute(phase))
    sense, towards = side(phase), side(0.25 - absolute(phase))
    round_, rate, bend = _lines(params.amplitude, params.turning)
    left = 0.25 - quarter
    turns = less(left, round_)
    angle = where(turns, params.amplitude - 0.5 * bend * left * left, rate * quarter)
    speed, slope = where(turns, bend * left, rate), where(turns, -bend, 0.0)
    often = params.often
    return sense * angle, often * towards * speed, often * often * sense * slope


def _lines(amplitude: Scalar, turning: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Return, with time in swings, half the time of a reversal, the rate between reversals, and the acceleration."""
    round_ = 0.25 * turning
    rate = amplitude / (0.25 - 0.5 * round_)
    return round_, rate, rate / round_


def motion(params: Params, orbit: Orbit) -> Motion:
    """That of the orbital frame, and of the swings in it."""
    often = ROOM / params.swing
    if params.shape:
        _, rate, slope = _lines(params.amplitude, params.turning)
    else:
        rate, slope = math.tau * params.amplitude, math.tau**2 * params.amplitude
    rate, slope = often * rate, often**2 * slope
    off = orbit.off_acceleration + orbit.off_rate * rate
    return Motion(orbit.rate + rate, orbit.acceleration + slope + orbit.rate * rate, orbit.off_rate, off)


def examples() -> list[Params]:
    """Return a sine across the motion, and a raster with other axes."""
    return [Params(0.3, 40.0), Params(0.1, 20.0, 1, 0.3, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0))]
