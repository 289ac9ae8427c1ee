"""The equations of one control step of an attitude loop, which all readers share: `decide` (what the law commands at a
control instant) and `hold` (the motion under the held command)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from starhold.algebra.quaternion import Quaternion, relative, to_body
from starhold.algebra.scalar import both, is_finite, less, opposite, where
from starhold.algebra.structure import move
from starhold.algebra.vector import ZERO, Vector, add, cross, dot, subtract
from starhold.algebra.words import number_of, word_of
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import Carry, Parts
from starhold.parts.actuators.dynamics import ideal
from starhold.parts.targets.target import inertial, orbital


class Sample(NamedTuple):
    """One recorded instant: the true state, the error relative to the target, the command."""

    attitude: Quaternion
    rate: Vector
    position: Vector
    velocity: Vector
    torque: Vector
    command: Vector
    attitude_error: Quaternion
    rate_error: Vector


class Step(NamedTuple):
    """The equations of one control step. `look` gives what the law sees before the double cover is folded."""

    look: Callable[..., Any]
    decide: Callable[..., Any]
    hold: Callable[..., Any]
    check: Callable[..., Any]
    sample: Callable[..., Any]


def runge_kutta(slope: Callable[..., Any]) -> Callable[..., Any]:
    """The classical method of fourth order over a substep, for d(state)/dt = slope(state, begun, carry, craft, setup).

    begun: what the slope is told of the substep's start.
    """

    def advance(state, begun, carry, craft, setup):
        h = setup.substep
        a = slope(state, begun, carry, craft, setup)
        b = slope(move(state, 0.5 * h, a), begun, carry, craft, setup)
        c = slope(move(state, 0.5 * h, b), begun, carry, craft, setup)
        d = slope(move(state, h, c), begun, carry, craft, setup)
        return move(state, h / 6.0, move(move(move(a, 2.0, b), 2.0, c), 1.0, d))

    return advance


def attitude_step(parts: Parts) -> Step:
    """The equations of a control step made of these parts."""
    environment, target, sense, disturb, cover, law, limit, begin, response, *body = parts
    tidy, with_torque, rates, wheel_momentum, record, share = body

    def look(carry, step, key, craft, setup):
        state = carry.state
        goal = target(setup.target, state.position, state.velocity, step, carry.goal)
        attitude, rate = sense(state.attitude, state.rate, setup.noise, key, word_of(step))
        error = relative(goal.attitude, attitude)
        external = environment(state.position, attitude, craft)[1]
        position = to_body(attitude, state.position)
        target_rate, target_acceleration = to_body(error, goal.rate), to_body(error, goal.acceleration)
        error_rate = subtract(rate, target_rate)
        target_acceleration = subtract(target_acceleration, cross(error_rate, target_rate))
        held = wheel_momentum(state, setup.wheels)
        return Measurement(error, error_rate, rate, target_rate, target_acceleration, external, position, setup.period, held)

    def look_at_rest(carry, step, key, craft, setup):
        # The same for a target that does not turn, spared the arithmetic on zeros, which must not be dropped.
        state = carry.state
        goal = target(setup.target, state.position, state.velocity, step, carry.goal)
        attitude, rate = sense(state.attitude, state.rate, setup.noise, key, word_of(step))
        external = environment(state.position, attitude, craft)[1]
        position = to_body(attitude, state.position)
        held = wheel_momentum(state, setup.wheels)
        return Measurement(relative(goal.attitude, attitude), rate, rate, ZERO, ZERO, external, position, setup.period, held)

    def keep(carry, step, setup):
        return carry.goal

    def renew(carry, step, setup):
        return target(setup.target, carry.state.position, carry.state.velocity, step, carry.goal).attitude

    see = look_at_rest if target is inertial else look
    follow = renew if target is orbital else keep

    def decide(carry, step, key, gains, craft, setup):
        measurement = see(carry, step, key, craft, setup)
        shown, h = cover(measurement.attitude, carry.h, setup.width)
        command, memory = law(measurement._replace(attitude=shown), gains, craft, carry.memory)
        command = limit(command, setup.command_limit)
        state = with_torque(carry.state, begin(carry.state.torque, command))
        disturbance = disturb(setup.noise, key, word_of(step))
        return Carry(state, memory, follow(carry, step, setup), h, command, disturbance, carry.lost_at)

    def slope(state, begun, carry, craft, setup):
        acceleration, external = environment(state.position, state.attitude, craft)
        given, shared = begun
        torque_rate = response(state.torque, carry.command, given, setup.substep, setup.dynamics)
        outside = add(carry.disturbance, external)
        split = share if shared is None else lambda torque, wheels: shared
        return rates(state, outside, acceleration, torque_rate, craft, setup.wheels, split)

    advance = runge_kutta(slope)

    def hold(carry, craft, setup):
        """One substep."""
        given = carry.state.torque
        # What is held is shared out once.
        shared = share(given, setup.wheels) if setup.wheels and response is ideal else None
        end = advance(carry.state, (given, shared), carry, craft, setup)
        return carry._replace(state=tidy(end))

    def check(carry, step, setup):
        """Note the step at which the motion is not finite, or turns by more than a radian in one substep."""
        s = carry.state
        turn = setup.substep * setup.substep * dot(s.rate, s.rate)
        sound = both(less(turn, 1.0), both(is_finite(s.attitude[0]), is_finite(dot(s.position, s.position))))
        lost = where(both(opposite(sound), less(carry.lost_at, 0.0)), number_of(step), carry.lost_at)
        return carry._replace(lost_at=lost)

    def sample(carry, step, setup):
        s = carry.state
        goal = target(setup.target, s.position, s.velocity, step, carry.goal)
        error = relative(goal.attitude, s.attitude)
        rate = subtract(s.rate, to_body(error, goal.rate))
        body = Sample(s.attitude, s.rate, s.position, s.velocity, s.torque, carry.command, error, rate)
        return record(body, s, setup.wheels, share)

    return Step(see, decide, hold, check, sample)
