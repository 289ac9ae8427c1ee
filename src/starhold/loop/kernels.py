"""The step of a closed loop, and the compiled kernels that repeat it over one lane or many.

All readers share `decide` (what the law commands at a control instant) and `hold` (the motion under the held command),
so one lane, any lane of a batch and plain Python agree bit for bit. No fast-math anywhere.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba

from starhold.algebra.quaternion import Quaternion, relative, to_body
from starhold.algebra.scalar import absolute, both, equation, is_finite, less, maximum, opposite, where
from starhold.algebra.structure import LANES, load, move, store
from starhold.algebra.vector import ZERO, Vector, add, cross, dot, subtract
from starhold.laws.interface import Seen, with_attitude
from starhold.loop.closed_loop import Carry, Parts
from starhold.loop.fingerprint import fingerprint, outside_modules
from starhold.models.target import inertial, orbital


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


class Ends(NamedTuple):
    """When a transient counts as over: one over sin2(angle / 2) and one over rate2 ((rad/s)^-2)."""

    angle: float
    rate: float


class Watched(NamedTuple):
    """What is noted of a transient: squares of the error angle's half sine and of the relative rate, both over their ends,
    at the last instant; the control step, with its fraction, at which each was last above 1; the largest square of the
    body's rate (rad2/s2), and of each of its components the largest mean rate of change over a control step (rad/s2)."""

    angle: float
    rate: float
    angle_step: float
    rate_step: float
    peak_rate: float
    peak_acceleration: Vector


class Kernels(NamedTuple):
    """Compiled: `one` flies a trajectory and records it, `many` flies the columns of an array."""

    one: Callable[..., Any]
    many: Callable[..., Any]


@cache
def make_step(parts: Parts) -> Step:
    """The equations of a control step made of these parts."""
    environment, target, sense, disturb, cover, law, limit, begin, response, *body = parts
    tidy, with_torque, rates, stored, given, record, share = body

    @equation
    def look(carry, step, run, craft, setup):
        state = carry.state
        goal = target(setup.target, state.position, state.velocity, step, carry.goal)
        attitude, rate = sense(state.attitude, state.rate, setup.noise, setup.seed, run, step)
        error = relative(goal.attitude, attitude)
        external = environment(state.position, attitude, craft)[1]
        position = to_body(attitude, state.position)
        target_rate, target_acceleration = to_body(error, goal.rate), to_body(error, goal.acceleration)
        error_rate = subtract(rate, target_rate)
        target_acceleration = subtract(target_acceleration, cross(error_rate, target_rate))
        held = stored(state, setup.wheels)
        return Seen(error, error_rate, rate, target_rate, target_acceleration, external, position, setup.period, held)

    @equation
    def look_at_rest(carry, step, run, craft, setup):
        # The same for a target that does not turn, spared the arithmetic on zeros that a compiler may not drop.
        state = carry.state
        goal = target(setup.target, state.position, state.velocity, step, carry.goal)
        attitude, rate = sense(state.attitude, state.rate, setup.noise, setup.seed, run, step)
        external = environment(state.position, attitude, craft)[1]
        position = to_body(attitude, state.position)
        held = stored(state, setup.wheels)
        return Seen(relative(goal.attitude, attitude), rate, rate, ZERO, ZERO, external, position, setup.period, held)

    @equation
    def keep(carry, step, setup):
        return carry.goal

    @equation
    def renew(carry, step, setup):
        return target(setup.target, carry.state.position, carry.state.velocity, step, carry.goal).attitude

    see = look_at_rest if target is inertial else look
    follow = renew if target is orbital else keep

    @equation
    def decide(carry, step, run, gains, craft, setup):
        seen = see(carry, step, run, craft, setup)
        shown, h = cover(seen.attitude, carry.h, setup.width)
        command, memory = law(with_attitude(seen, shown), gains, craft, carry.memory)
        command = limit(command, craft.torque_limit)
        state = with_torque(carry.state, begin(carry.state.torque, command))
        disturbance = disturb(setup.noise, setup.seed, run, step)
        return Carry(state, memory, follow(carry, step, setup), h, command, disturbance, carry.lost_at)

    @equation
    def slope(state, begun, carry, craft, setup):
        acceleration, external = environment(state.position, state.attitude, craft)
        torque_rate = response(state.torque, carry.command, begun, setup.substep, setup.dynamics)
        outside = add(carry.disturbance, external)
        return rates(state, outside, acceleration, torque_rate, craft, setup.wheels, share)

    @equation
    def hold(carry, craft, setup):
        """One substep: the classical Runge-Kutta method of fourth order."""
        s, h = carry.state, setup.substep
        a = slope(s, s.torque, carry, craft, setup)
        b = slope(move(s, 0.5 * h, a), s.torque, carry, craft, setup)
        c = slope(move(s, 0.5 * h, b), s.torque, carry, craft, setup)
        d = slope(move(s, h, c), s.torque, carry, craft, setup)
        end = move(s, h / 6.0, move(move(move(a, 2.0, b), 2.0, c), 1.0, d))
        return Carry(tidy(end), carry.memory, carry.goal, carry.h, carry.command, carry.disturbance, carry.lost_at)

    @equation
    def check(carry, step, setup):
        """Note the step at which the motion is not finite, or turns by more than a radian in one substep."""
        s = carry.state
        turn = setup.substep * setup.substep * dot(s.rate, s.rate)
        sound = both(less(turn, 1.0), both(is_finite(s.attitude[0]), is_finite(dot(s.position, s.position))))
        lost = where(both(opposite(sound), less(carry.lost_at, 0.0)), 1.0 * step, carry.lost_at)
        return Carry(s, carry.memory, carry.goal, carry.h, carry.command, carry.disturbance, lost)

    @equation
    def sample(carry, step, setup):
        s = carry.state
        goal = target(setup.target, s.position, s.velocity, step, carry.goal)
        error = relative(goal.attitude, s.attitude)
        rate = subtract(s.rate, to_body(error, goal.rate))
        torque = given(s, setup.wheels, share)
        body = Sample(s.attitude, s.rate, s.position, s.velocity, torque, carry.command, error, rate)
        return record(body, s, setup.wheels, share)

    return Step(see, decide, hold, check, sample)


@cache
def make_kernels(parts: Parts) -> Kernels:
    """Kernels for these parts, from the disk cache where nothing they are built from has changed."""
    return Kernels(_one(parts), _many(parts))


def _compile(function: Callable[..., Any], parts: Parts) -> Callable[..., Any]:
    """Compile a kernel, or find it in the disk cache under a name made of its parts and all their sources.

    A name of its own for each kernel also means that a law which is no longer there spoils no other law's cache entry.
    """
    sources = fingerprint()[:16]
    mark = fingerprint(outside_modules(parts)) + "".join(f"{part.__module__}.{part.__qualname__}" for part in parts)
    function.__qualname__ = f"{function.__name__}-{sources}-{hashlib.sha256(mark.encode()).hexdigest()[:32]}"
    kernel: Any = numba.njit(error_model="numpy", cache=True, nogil=True)(function)
    _drop_stale(Path(kernel.stats.cache_path), sources)
    return kernel


@cache
def _drop_stale(folder: Path, sources: str) -> None:
    """Delete the cached kernels of sources that have changed since; no process will ask for them again."""
    for file in folder.glob("kernels.*-*-*.nb[ic]"):
        if f"-{sources}-" not in file.name:
            with suppress(OSError):
                file.unlink()


def _one(parts: Parts) -> Callable[..., Any]:
    _, decide, hold, check, sample = make_step(parts)

    def one(carry, first, count, finish, every, run, gains, known, craft, setup, substeps, out, end):
        """Fly control steps first .. first+count-1; write every `every`-th into a column of `out`, and with `finish` the
        last state as well. What is carried on goes into the one column of `end`; stops where the motion is lost. `known` is
        the craft that the law takes it for."""
        # Nothing is returned: a result made of Python objects would be built by code that a signal can break into.
        for step in range(first, first + count):
            carry = check(carry, step, setup)
            if carry.lost_at >= 0.0:
                break
            carry = decide(carry, step, run, gains, known, setup)
            if step % every == 0:
                store(out, step // every, sample(carry, step, setup))
            for _ in range(substeps):
                carry = hold(carry, craft, setup)
        last = first + count
        carry = check(carry, last, setup)
        if finish and carry.lost_at < 0.0 and last % every == 0:
            store(out, last // every, sample(decide(carry, last, run, gains, known, setup), last, setup))
        store(end, 0, carry)

    return _compile(one, parts)


def _many(parts: Parts) -> Callable[..., Any]:
    _, decide, hold, check, _ = make_step(parts)

    def many(x, like, first, count, run, gains, like_gains, known, craft, setup, substeps):
        """Fly control steps first .. first+count-1 of every lane of the block x, in place; lane 0 is
        run number `run`. Gains are a NamedTuple shared by all lanes, or a block too."""
        for step in range(first, first + count):
            for k in range(LANES):
                c = check(load(x, k, like), step, setup)
                store(x, k, decide(c, step, run + k, load(gains, k, like_gains), known, setup))
            for _ in range(substeps):
                for k in range(LANES):
                    store(x, k, hold(load(x, k, like), craft, setup))
        for k in range(LANES):
            store(x, k, check(load(x, k, like), first + count, setup))

    return _compile(many, parts)


@cache
def make_replay(parts: Parts) -> Callable[..., Any]:
    """A kernel that repeats the control calls of a run, to time them: from the state to the limited command."""
    decide = make_step(parts).decide

    def replay(samples, first, last, carry, gains, craft, setup, end):
        """Decide on the states in columns first .. last-1 of recorded samples, each call after the one before."""
        for k in range(first, last):
            # The first rows of a sample are the state; every number of it waits for the torque of the call before.
            u = carry.command
            wait = 0.0 * (u[0] + u[1] + u[2])
            state = move(load(samples, k, carry.state), wait, load(samples, k, carry.state))
            carry = Carry(state, carry.memory, carry.goal, carry.h, u, carry.disturbance, carry.lost_at)
            carry = decide(carry, k, 0, gains, craft, setup)
        store(end, 0, carry)

    return _compile(replay, parts)


@cache
def make_watch(parts: Parts) -> Callable[..., Any]:
    """A kernel that flies many lanes as `many` does, and notes a `Watched` of each."""
    _, decide, hold, check, _ = make_step(parts)
    target = parts.target

    @equation
    def last_above(then, now, before, step):
        # A fraction of the step before, by a line through the two squares.
        crossing = step - 1.0 + (before - 1.0) / (before - now)
        return where(less(1.0, now), 1.0 * step, where(less(1.0, before), crossing, then))

    @equation
    def note(seen, before, carry, step, ends, setup):
        """What is seen once step `step` is reached; `before` is the body's rate a control step ago."""
        s = carry.state
        goal = target(setup.target, s.position, s.velocity, step, carry.goal)
        error = relative(goal.attitude, s.attitude)
        left = subtract(s.rate, to_body(error, goal.rate))
        angle = ends.angle * (error[1] * error[1] + error[2] * error[2] + error[3] * error[3])
        rate = ends.rate * dot(left, left)
        moved, most = subtract(s.rate, before), seen.peak_acceleration
        return Watched(
            angle,
            rate,
            last_above(seen.angle_step, angle, seen.angle, step),
            last_above(seen.rate_step, rate, seen.rate, step),
            maximum(seen.peak_rate, dot(s.rate, s.rate)),
            (
                maximum(most[0], absolute(moved[0]) / setup.period),
                maximum(most[1], absolute(moved[1]) / setup.period),
                maximum(most[2], absolute(moved[2]) / setup.period),
            ),
        )

    def watch(x, like, first, count, run, gains, like_gains, known, craft, setup, substeps, ends, seen, like_seen, rates):
        """Fly control steps first .. first+count-1 of every lane of the block x, in place, and go on noting in the block
        `seen`; `rates` is a block of three for the kernel's own use. The rest is as in `many`."""
        for step in range(first, first + count):
            for k in range(LANES):
                c = check(load(x, k, like), step, setup)
                store(rates, k, c.state.rate)
                store(x, k, decide(c, step, run + k, load(gains, k, like_gains), known, setup))
            for _ in range(substeps):
                for k in range(LANES):
                    store(x, k, hold(load(x, k, like), craft, setup))
            for k in range(LANES):
                now = note(load(seen, k, like_seen), load(rates, k, ZERO), load(x, k, like), step + 1, ends, setup)
                store(seen, k, now)
        for k in range(LANES):
            store(x, k, check(load(x, k, like), first + count, setup))

    return _compile(watch, parts)
