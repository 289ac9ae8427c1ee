"""The spacecraft, states and loops with which laws are examined."""

import math
from collections import deque
from collections.abc import Iterator
from itertools import count
from typing import Any, cast

import numpy as np

from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import ZERO, Vector, add, apply, norm, scale
from starhold.laws.catalogue import Law
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import fit, telling
from starhold.parts.contract import DEVIATIONS
from starhold.parts.craft import Craft, make_craft
from starhold.parts.part import Part
from starhold.parts.random import Silent
from starhold.studies.body import body_module

CRAFT = make_craft([2.0, 3.0, 4.0], torque_limit=0.05)
PERIOD = 0.1


def random_quaternions(count: int, seed: int = 7) -> list[Quaternion]:
    """Return attitudes uniformly distributed on the rotation group."""
    numbers = np.random.default_rng(seed).normal(size=(count, 4))
    return [unflatten(q / np.linalg.norm(q), NO_TURN) for q in numbers]


def random_measurements(count: int, external: bool = True) -> Iterator[Measurement]:
    """Return a law's measurements at random states of a body with a target at rest, with or without a modelled torque."""
    random, magnetic = np.random.default_rng(11), np.random.default_rng(13)
    for attitude in random_quaternions(count, 12):
        rate: Vector = unflatten(random.normal(scale=0.05, size=3), ZERO)
        torque: Vector = unflatten(random.normal(scale=1e-5, size=3), ZERO) if external else ZERO
        position: Vector = unflatten(random.normal(scale=4e6, size=3), ZERO) if external else ZERO
        wheel_momentum: Vector = unflatten(random.normal(scale=0.1, size=3), ZERO) if external else ZERO
        field: Vector = unflatten(magnetic.normal(scale=3e-5, size=3), ZERO)
        yield Measurement(attitude, rate, rate, ZERO, ZERO, torque, position, PERIOD, wheel_momentum, field)


ORBIT = (fit("environment", "two-body"), fit("environment", "gravity-gradient"))
"""The environments of an orbit with gravity gradient."""


def sample_loop(law: Law, gains: Any) -> ClosedLoop:
    """Return a loop with a full 3x3 inertia in orbit with gravity gradient, hysteresis and a limit on each axis."""
    craft = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]], torque_limit=0.05)
    start = State((0.2, 0.4, -0.7, 0.5567764362830022), (0.04, 0.03, 0.02), (7e6, 1e5, 0.0), (0.0, 7.4e3, 1.2e3), ZERO)
    goal: Quaternion = (0.6, 0.0, 0.8, 0.0)
    return ClosedLoop(
        craft,
        law,
        gains,
        start,
        PERIOD,
        parts=(fit("target", "inertial", goal), *ORBIT, *telling(law.reads)),
        limit="axis",
        sign_policy="hysteresis",
    )


class Jumping(Silent):
    """Random vectors that are all 0, for readings without noise, and single random numbers, as of an instant's jitter, that
    are as far from 0 as they are assumed to be, now and then on either side."""

    sign = 1.0

    def normals(self, place: int, count: int) -> tuple[float, ...]:
        """Return a number that is large, or zeros for several."""
        self.sign = -self.sign
        return (self.sign * DEVIATIONS,) if count == 1 else (0.0,) * count


def call(law: Law, measurement: Measurement, gains: Any, craft: Craft = CRAFT) -> Vector:
    """Return the torque of a law called once, with its initial memory."""
    return law.command(measurement, gains, craft, law.remember(gains, craft, measurement.period))[0]


def any_attitude(random: np.random.Generator) -> Quaternion:
    """Return a random attitude."""
    drawn = random.normal(size=4)
    return cast(Quaternion, tuple((drawn / np.linalg.norm(drawn)).tolist()))


def turned(attitude: Quaternion, before: Vector, after: Vector, period: float) -> Quaternion:
    """Return the attitude after a period in which the body turns at the mean of two rates (rad/s)."""
    turn = scale(0.25 * period, add(before, after))
    half = norm(turn)
    return normalise(multiply(attitude, (math.cos(half), *scale(math.sin(half) / half if half else 1.0, turn))))


def anywhere(loop: ClosedLoop, random: np.random.Generator) -> Iterator[tuple[Any, float, float]]:
    """Yield states of a rigid body at any attitudes and rates, of which some are small, and two zeros."""
    for place in count():
        size = 10.0 ** random.uniform(-8.0, 0.0) if place % 4 == 3 else 1.0
        attitude, rate = any_attitude(random), tuple((size * random.normal(size=3)).tolist())
        yield loop.start._replace(attitude=attitude, rate=rate), 0.0, 0.0


def moving(loop: ClosedLoop, random: np.random.Generator, ago: float) -> Iterator[tuple[Any, float, float]]:
    """Yield states of a rigid body that accelerates anyhow and rests now and then, with its largest rate and acceleration of
    the last `ago` seconds: errors that grow with these have bounds there."""
    state, recent = loop.start, deque([(norm(loop.start.rate), 0.0)], math.ceil(ago / loop.period) + 1)
    for step in count(1):
        yield state, *(max(sizes) for sizes in zip(*recent, strict=True))
        change: Any = tuple(random.normal(size=3).tolist())
        if step % 15 >= 8:
            change = scale(-1.0 / loop.period, state.rate)
        rate = add(state.rate, scale(loop.period, change))
        state = state._replace(rate=rate, attitude=turned(state.attitude, state.rate, rate, loop.period))
        recent.append((norm(rate), norm(change)))


def loop_with(part: Part, params: Any) -> ClosedLoop:
    """Return a loop with a part and the parts that it needs."""
    return body_module("starhold.conformance.bodies", part.body or "rigid-body").loop_with(part, params)


def momentum_of(loop: ClosedLoop, carry: Any) -> Vector:
    """Return the angular momentum of body and effectors (N m s, body axes)."""
    total = apply(loop.craft.inertia, carry.state.rate)
    for fitted, state, prepared in zip(loop.used("effector"), carry.effectors, loop.setup().effectors, strict=True):
        module = fitted.part.module
        total = add(total, module.momentum(state, prepared))
        if fitted.part.hook("inertia_change") is not None:
            total = add(total, apply(module.inertia_change(state, prepared), carry.state.rate))
    return total
