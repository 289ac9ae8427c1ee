"""Checks that what parts say of their torques, errors and motions bounds these."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from math import inf, isfinite, pi
from typing import Any, cast

import numpy as np

from starhold.algebra.quaternion import multiply, normalise, to_body
from starhold.algebra.structure import move
from starhold.algebra.vector import ZERO, Vector, add, dot, norm, scale, subtract, unit
from starhold.certification.measured import bounded
from starhold.certification.unmodelled import COMMANDED, envelope_of, is_read
from starhold.conformance.bench import (
    PERIOD,
    Jumping,
    any_attitude,
    anywhere,
    loop_with,
    momentum_of,
    moving,
    random_measurements,
)
from starhold.conformance.directions import LATER, field_at, misdirected, tells, turn_between
from starhold.conformance.motions import moves_as_it_says, pulls_as_it_says
from starhold.conformance.verdicts import STEPS, NotApplicableError, require
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import UNBOUNDED, Errors, Push
from starhold.parts.orbit import at_anomaly
from starhold.parts.part import Fitted, Part
from starhold.parts.random import Dice
from starhold.simulation.lane import fly

FEW, LONG = 4, 1000
"""Commands and starts of flights that are tried, and the control steps of a long flight."""


def keeps_what_it_says(part: Part) -> None:
    """No torque is larger than its `bound` or changes faster than its `torque_change`, no error is larger than its `error`,
    `direction` or `combined`, besides its `noise`, no motion of a target than its `motion`, and no acceleration than its
    `perturbation`; outputs follow commands as it says by `late`."""
    if part.hook("late") is not None:
        _follows_as_it_says(part)
        return
    # A body has an equation of this name.
    if part.role == "target" and part.hook("motion") is not None:
        moves_as_it_says(part)
        return
    tell_torque, tell_errors, tell_change = part.hook("bound"), part.hook("error"), part.hook("torque_change")
    bounds = tells(part) or tell_torque or tell_errors or tell_change
    if part.hook("perturbation") is not None:
        pulls_as_it_says(part)
        if not bounds:
            return
    if not bounds:
        raise NotApplicableError("it says no bound of its torque, of its errors or of its motion")
    for params in part.examples():
        loop = loop_with(part, params)
        # In a few steps external torques contribute little momentum.
        envelope = envelope_of(loop, 1.01 * norm(momentum_of(loop, loop.carry())), noisy=True)
        errors, command = UNBOUNDED, Push(inf)
        if tell_errors and part.role in COMMANDED:
            command = tell_errors(params, envelope)
        elif tell_errors:
            errors = bounded(next(f for f in loop.parts if f.part == part), loop.period) or UNBOUNDED
        torque = tell_torque(params, envelope) if tell_torque else Push(inf)
        change = tell_change(params, loop.craft, envelope) if tell_change else Push(inf)
        limits = (*errors, *torque, *command, *change)
        require(min(limits) >= 0.0, f"the bounds {limits} are not all positive or 0")
        pushed = _pushes(part, loop, errors, torque, command)
        for name, size, bound in (*pushed, *(_changes(part, loop, change) if tell_change else ()), *misdirected(part, loop)):
            require(size <= bound * (1.0 + 1e-9) + 1e-12, f"the {name} is {size:g}, larger than {bound:g}")


def _changes(part: Part, loop: ClosedLoop, change: Push) -> Iterator[tuple[str, float, float]]:
    """Yield the rate of change of a part's torque on the orbit, on rotating and non-rotating bodies, and its bounds."""
    module, numbers = part.module, next(f for f in loop.parts if f.part == part).prepared(loop.period)
    random, time = np.random.default_rng(2), 1e-3
    memory = module.remember(numbers) if part.hook("remember") else None
    for rate in (ZERO, *(cast(Any, tuple(x)) for x in random.normal(size=(STEPS, 3)).tolist())):
        for _ in range(STEPS):
            attitude, there = any_attitude(random), _on_orbit(loop, loop.start, random)
            torques: list[Vector] = []
            for t in (-time, time):
                state = there._replace(
                    attitude=normalise(multiply(attitude, (1.0, *scale(0.5 * t, rate)))),
                    rate=rate,
                    position=add(there.position, scale(t, there.velocity)),
                )
                torques.append(module.torque(state, numbers, loop.craft, memory))
            size = norm(subtract(torques[1], torques[0])) / (2.0 * time)
            yield "change of the torque", size, change.torque + change.per_rate * norm(rate)


def _on_orbit(loop: ClosedLoop, state: Any, random: np.random.Generator) -> Any:
    """Return a state anywhere on its orbit, if it has one."""
    place, speed = at_anomaly(state.position, state.velocity, loop.craft.gravity, 2.0 * pi * random.uniform())
    return state._replace(position=place, velocity=speed) if loop.has("two-body") else state


def _follows_as_it_says(part: Part) -> None:
    """An actuator's output, in fine steps, comes nearer to a held command as `late` says, whatever it is off by at first."""
    module, random, steps = cast(Any, part.module), np.random.default_rng(4), 2000
    for params in part.examples():
        numbers, late = Fitted(part, params).prepared(PERIOD), module.late(params, PERIOD)
        require(0.0 <= late.kept < 1.0 and 0.0 < late.mean <= 1.0 and late.most > 0.0, f"{late} is not of what is late")
        for place in range(STEPS):
            # Of all sizes, and now and then about one axis alone.
            size, shares = 10.0 ** random.uniform(-8.0, 0.0) if place % 2 else 1.0, random.uniform(-1.0, 1.0, size=3)
            target = size * random.normal(size=3)
            off = (np.eye(3)[place // 8 % 3] if place % 8 == 7 else shares) * min(late.most, size) * 0.999
            *outputs, wanted = (cast(Vector, tuple(x.tolist())) for x in (target + off, target))
            for _ in range(steps):
                rate = module.rates(outputs[-1], wanted, outputs[0], PERIOD, numbers)
                outputs.append(add(outputs[-1], scale(PERIOD / steps, rate)))
            sizes = np.linalg.norm(np.array(outputs) - target, axis=1) / np.linalg.norm(off)
            between = (sizes[:-1] + sizes[1:]) / 2.0
            mean, moment = (float((between * share).mean()) for share in (1.0, 1.0 - (np.arange(steps) + 0.5) / steps))
            require(bool(np.diff(sizes).max() < 1e-9), "it goes away from the command")
            for name, size, most in (("mean", mean, late.mean), ("kept", sizes[-1], late.kept)):
                require(size <= most + 1e-3, f"{name} is {size:g}, larger than {most:g}")
                require(late.moment is None or size >= most - 1e-3, f"{name} is {size:g}, and not exactly {most:g}")
            if late.moment is None:
                continue
            require(abs(moment - late.moment) <= 1e-3, f"the mean by the time left is {moment:g}, and not {late.moment}")
            aside = float(np.linalg.norm(np.cross(outputs[-1] - target, off)))
            require(aside <= 1e-9 * float(off @ off), "it comes nearer otherwise in each component")


def _pushes(part: Part, loop: ClosedLoop, errors: Errors, torque: Push, command: Push) -> Iterator[tuple[str, float, float]]:
    """Yield torques and errors of a part at states of a flight and at other attitudes, with their bounds."""
    dice = Jumping() if part.hook("noise") else Dice((1, 2), 3, 0)
    fitted, module, random = next(f for f in loop.parts if f.part == part), part.module, np.random.default_rng(1)
    numbers = fitted.prepared(loop.period)

    def most(push: Push, state: Any) -> float:
        return push.torque + push.per_rate * norm(state.rate)

    memory = fitted.remembered(numbers, *([loop.start] if part.role in ("sensor", "estimator") else []))
    states = moving(loop, random, errors.ago) if errors.grow else anywhere(loop, random)
    begun, at_first = ZERO, 0.0
    for count, (state, fast, hurried) in enumerate(islice(states, STEPS)):
        # Now and then much later, at a step of the same phase of all that comes every few.
        step = count + LATER * (count // 8)
        if part.role == "environment":
            state = _on_orbit(loop, state, random)
            memory = module.update(memory, state, numbers, dice, step) if part.hook("update") else memory
            acting = module.torque(state, numbers, loop.craft, memory)
            yield "torque", norm(acting), most(torque, state)
            if part.flag("ACROSS_FIELD"):
                along = unit(to_body(state.attitude, field_at(fitted.params, state.position, step * loop.period)))
                yield "part of the torque along the field", abs(dot(acting, along)), 1e-3 * torque.torque
        elif part.role == "sensor":
            reading, memory = module.measure(state, memory, numbers, dice, step)
            if hasattr(reading, "attitude"):
                turn = turn_between(state.attitude, reading.attitude)
                yield "error of the attitude", norm(turn), errors.attitude + errors.turning * fast
            if hasattr(reading, "magnetic_field") and getattr(reading, "magnetic_field_is_new", 1.0) > 0.5:
                true = to_body(state.attitude, field_at(fitted.params, state.position, step * loop.period))
                yield "error of the field", norm(subtract(reading.magnetic_field, true)), errors.field
            if hasattr(reading, "rate"):
                off = subtract(reading.rate, state.rate)
                grown = errors.turned * fast + errors.late * hurried
                begun, at_first = (off, grown) if count == 0 else (begun, at_first)
                yield "error of the rate", norm(off), errors.rate + grown
                # All but the bias is that off at two readings.
                yield (
                    "change of the error of the rate",
                    norm(subtract(off, begun)),
                    2.0 * (errors.rate - errors.bias) + grown + at_first,
                )
        elif part.role == "actuator" and part.hook("command"):
            torque_wanted: Any = tuple(random.normal(scale=10.0 ** random.uniform(-9, 0), size=3).tolist())
            yield (
                "error of the command",
                norm(subtract(module.command(torque_wanted, numbers), torque_wanted)),
                command.torque,
            )
    if part.role == "effector":
        yield from _reactions(fitted, loop, torque, command)


def _reactions(fitted: Fitted, loop: ClosedLoop, torque: Push, command: Push) -> Iterator[tuple[str, float, float]]:
    """Yield how far the torque of an effector is from the one that it takes for applied, and this from the command, in
    flights from some attitudes, with their bounds."""
    module, numbers, random = cast(Any, fitted.part.module), fitted.prepared(loop.period), np.random.default_rng(7)
    place, acts = [*loop.used("effector")].index(fitted), fitted.part.flag("ACTS")
    begun = (state._replace(rate=scale(0.02, state.rate)) for state, *_ in islice(anywhere(loop, random), FEW))
    for start in (loop.start, *begun):
        for steps in (1, 5, STEPS, LONG):
            end = fly(replace(loop, start=start), steps)[1]
            body = end.state
            for wanted in _commands(fitted, numbers, random) if acts else (ZERO,):
                inner, given = _commanded(fitted, numbers, end.effectors[place], wanted, body)
                applied = module.applied(inner, given, body, numbers) if acts else ZERO
                if fitted.part.hook("bound"):
                    besides = subtract(module.reaction(inner, given, body, numbers), applied)
                    yield "torque", norm(besides), torque.torque + torque.per_rate * norm(body.rate)
                if fitted.part.hook("error"):
                    off = norm(subtract(applied, wanted))
                    yield "error of the command", off, command.torque + command.per_rate * norm(body.rate)
    if fitted.part.hook("error") and not is_read(loop, fitted):
        # What it stores must not run out.
        body, wanted = loop.start, [*_commands(fitted, numbers, random)][-1]
        inner, given = _commanded(fitted, numbers, loop.carry().effectors[place], wanted, body)
        for _ in range(5 * LONG):
            inner = move(inner, loop.period, module.rates(inner, given, body, ZERO, numbers))
        off = norm(subtract(module.applied(inner, given, body, numbers), wanted))
        yield "error of a command that is held for long", off, command.torque + command.per_rate * norm(body.rate)


def _commands(effector: Fitted, numbers: Any, random: np.random.Generator) -> Iterator[Vector]:
    """Yield commands (N m) that an effector surely gives, some of the largest; any, if it does not say which."""
    tell: Any = effector.part.hook("sure_torque")
    ball, cube = (inf, inf) if tell is None else (tell(numbers, kind) * (1.0 - 1e-9) for kind in ("norm", "axis"))
    for _ in range(FEW):
        drawn, size = random.normal(size=3), 10.0 ** random.uniform(-9.0, 0.0)
        yield _vector(size * min(ball, 1e3) * drawn / np.linalg.norm(drawn))
        if isfinite(ball):
            yield _vector(ball * drawn / np.linalg.norm(drawn))
            yield _vector(min(cube, 1e3) * np.sign(drawn))


def _vector(array: Any) -> Vector:
    x, y, z = array.tolist()
    return x, y, z


def _commanded(effector: Fitted, numbers: Any, inner: Any, wanted: Vector, body: Any) -> tuple[Any, Any]:
    """Return the state of an effector, on a body in its state, and the command that it takes, for a wanted torque (N m)."""
    module: Any = effector.part.module
    if not effector.part.flag("ACTS"):
        return inner, ()
    if effector.part.hook("switch"):
        seen = next(random_measurements(1))._replace(attitude=body.attitude, rate=body.rate, body_rate=body.rate)
        inner = module.switch(inner, wanted, seen, body, numbers, 0)
        return inner, module.pulse(inner, PERIOD, numbers) if effector.part.hook("pulse") else ()
    return inner, module.command(wanted, numbers)
