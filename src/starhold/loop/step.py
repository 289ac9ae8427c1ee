"""The equations of one control step, composed of those of a loop's parts and shared by all interpreters: `measure` (the
law's measurement), `update` (its command at a control instant) and `propagate` (the motion under the held command)."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

from starhold.algebra.scalar import both, less, opposite, side, where
from starhold.algebra.structure import chosen, runge_kutta
from starhold.algebra.vector import ZERO, add
from starhold.algebra.words import number_of, word_of
from starhold.laws.conditions import Sight
from starhold.laws.modes import Modes
from starhold.loop.closed_loop import Carry, Composition, can_be_inactive, is_recorded
from starhold.parts.actuators.limits import LIMITS
from starhold.parts.contract import CLOCK, FIX, IS_VALID
from starhold.parts.part import Part
from starhold.parts.random import RANGE, Dice
from starhold.parts.roles import Loads, Scene


class Step(NamedTuple):
    """The equations of one control step. `measure` returns the law's measurement before the quaternion sign policy, `sense`
    the inputs of the law at a control instant, from external readings if there are any; `update` decides the command from
    them or takes an external one; `slope` returns the rates of (state, effectors, outputs of actuators followed by
    another), which `propagate` integrates."""

    measure: Callable[..., Any]
    sense: Callable[..., Sensed]
    update: Callable[..., Any]
    propagate: Callable[..., Any]
    check: Callable[..., Any]
    sample: Callable[..., Any]
    slope: Callable[..., Any]


class Sensed(NamedTuple):
    """The inputs of a law at a control instant (its measurement, the readings of the sensors and the estimate), and the
    inputs of the rest of the step (the carry, the memories and the sign of the quaternion)."""

    measurement: Any
    readings: Any
    estimate: Any
    carry: Any
    memories: Any
    h: Any


def total(vectors: Any) -> Any:
    """Return the sum of vectors from the first to the last, some of which may be None; None without any."""
    result = None
    for vector in vectors:
        if vector is not None:
            result = vector if result is None else add(result, vector)
    return result


def make_equations(parts: Composition, dice: Callable[..., Dice] = Dice) -> Step:
    """Return the equations of a control step of these parts; dice: the source of their random numbers, such as `Dice`."""
    body, target = parts.body.module, parts.target
    limit = LIMITS[parts.limit]
    policy = getattr(body, "SIGN_POLICIES", {}).get(parts.sign_policy)
    named = _Named(parts)
    still = target is None or target.flag("STILL")
    follows = target is not None and target.flag("FOLLOWS")
    by_mode = target is not None and target.flag("BY_MODE")
    slews = target is not None and target.flag("SLEWS")
    # Such a law of modes needs more than its measurement to decide which mode commands.
    watches = named.modes is not None and named.modes.WATCHES
    asked_for = {name for part in (parts.law, *parts.effectors) for name in part.reads}
    command_of = parts.law.module.command if by_mode or watches else parts.law.command

    def goal_of(carry, state, step, setup):
        if target is None:
            return None
        mode = (carry.memory.mode,) if by_mode else ()
        return target.module.goal(setup.target, state, step, carry.memories.followed, *mode)

    def observed(carry, step, key, craft, setup, seen=None):
        """Return a function that returns the law's measurement for a goal and the memories of sensors and estimator, the
        goal, and the readings of the sensors."""
        state, memories = carry.state, carry.memories
        goal = goal_of(carry, state, step, setup)
        readings, kept, every = SimpleNamespace(), [], []
        shown = []
        for sensor, memory, params, first in zip(parts.sensors, memories.sensors, setup.sensors, named.sensors, strict=True):
            reading, memory = sensor.module.measure(state, memory, params, dice(key, word_of(step), first), step)
            reading = reading if seen is None else seen[len(every)]
            # Parts that do not ask for several readings of a name get the first.
            vars(readings).update(reading._asdict() | vars(readings))
            kept.append(memory)
            every.append(reading)
            if is_recorded(sensor):
                shown.append(reading)
        if CLOCK in asked_for and not hasattr(readings, CLOCK):
            vars(readings)[CLOCK] = number_of(step) * setup.period
        estimate, estimator, values = memories.estimate, memories.estimator, vars(readings)
        estimates, watching = estimated(values, tuple(every), memories, craft, setup)
        if parts.estimator is not None:
            (estimate, *estimates), (estimator, *watching) = estimates, watching
            values = estimate._asdict()
        if IS_VALID in asked_for:
            vars(readings)[IS_VALID] = getattr(estimate, IS_VALID, 1.0)
        shown += estimates
        known = state._replace(**{name: x for name, x in values.items() if name in state._fields})
        telling = [one for one in named.torques if one.part.flag("MODELLED")]
        torque = total(
            one.part.module.torque(known, setup.environments[one.place], craft, memories.environments[one.place])
            for one in telling
        )
        # Effectors that take the command measure their speeds; others have no sensor.
        turning = zip(parts.effectors, carry.effectors, setup.effectors, strict=True)
        momentum = total(_measured(e)(inner, params) for e, inner, params in turning if e.flag("ACTS"))

        def show(goal, before=memories.followed):
            if goal is not None and follows:
                before = before._replace(attitude=goal.attitude) if slews else goal.attitude
            scene = Scene(
                goal,
                still,
                ZERO if torque is None else torque,
                ZERO if momentum is None else momentum,
                setup.period,
                setup.limit,
                _readings(tuple(vars(readings)))(*vars(readings).values()),
            )
            return body.observe(known, scene), memories._replace(
                followed=before,
                sensors=tuple(kept),
                readings=tuple(shown),
                estimator=estimator,
                estimate=estimate,
                watchers=tuple(watching),
            )

        return show, goal, Sight(known, tuple(every), estimate)

    def estimated(values, every, memories, craft, setup):
        """Return the estimates and memories of the law's estimator and of those that watch."""
        used = parts.estimator is not None
        before = (*([memories.estimator] if used else []), *memories.watchers)
        numbers = (*([setup.estimator] if used else []), *setup.watchers)
        estimates, after = list(before), list(before)
        for one, place, starter in named.estimating:
            fix = {} if starter < 0 else {FIX: estimates[starter]}
            readings = SimpleNamespace(**values, every=every, **fix)
            estimates[place], after[place] = one.module.estimate(
                readings, before[place], numbers[place], craft, setup.period
            )
        return estimates, after

    def measure(carry, step, key, craft, setup):
        show, goal, _ = observed(carry, step, key, craft, setup)
        return show(goal)[0]

    def sense(carry, step, key, gains, craft, setup, seen=None):
        show, goal, sight = observed(carry, step, key, craft, setup, seen)
        measurement, memories = show(goal)
        h = carry.h
        if by_mode or watches:
            watched = (sight,) if watches else ()
            carry = carry._replace(memory=parts.law.module.decide(measurement, gains, carry.memory, *watched))
        if by_mode:
            # The law of a mode that begins gets a measurement relative to the mode's own target.
            before = carry.memories.followed
            if target is not None and slews:
                attitude = sight.state.attitude
                before = target.module.begun(setup.target, carry.state, attitude, step, craft, before, carry.memory)
                carry = carry._replace(memories=carry.memories._replace(followed=before))
            measurement, memories = show(goal_of(carry, carry.state, step, setup), before)
            h = where(less(carry.memory.age, 0.5), side(measurement.attitude[0]), h)
        if policy is not None:
            attitude, h = policy(measurement.attitude, h, setup.width)
            measurement = measurement._replace(attitude=attitude)
        return Sensed(measurement, sight.readings, memories.estimate, carry, memories, h)

    def update(carry, step, key, gains, craft, setup, given=None, seen=None):
        measurement, _, _, carry, memories, h = sense(carry, step, key, gains, craft, setup, seen)
        command, memory = command_of(measurement, gains, craft, carry.memory)
        command = limit(command if given is None else given, setup.limit)
        passed = command
        for actuator, params in zip(parts.actuators, setup.actuators, strict=True):
            if actuator.hook("command") is not None:
                passed = actuator.module.command(passed, params)
        effectors = tuple(
            inner if e.hook("switch") is None else switched(e, inner, passed, measurement, carry.state, p, step, memory)
            for e, inner, p in zip(parts.effectors, carry.effectors, setup.effectors, strict=True)
        )
        state = carry.state if named.dynamic else carry.state._replace(**{body.COMMAND: passed})
        environments = [
            e.module.update(m, carry.state, p, dice(key, word_of(step), first), step) if e.hook("update") else m
            for e, m, p, first in zip(
                parts.environments, memories.environments, setup.environments, named.environments, strict=True
            )
        ]
        memories = memories._replace(environments=tuple(environments))
        return Carry(state, effectors, carry.actuators, memory, memories, h, passed, carry.lost_at)

    def switched(effector, inner, wanted, measurement, state, params, step, memory):
        """Return the state of an effector at the start of a control step. If it is inactive in the present mode, this is
        the state for a zero command or, if it takes no command, its initial state."""
        inactive = named.inactive(effector, memory)
        switch = effector.module.switch
        if inactive is None:
            return switch(inner, wanted, measurement, state, params, step)
        if effector.flag("ACTS"):
            return switch(inner, chosen(inactive, ZERO, wanted), measurement, state, params, step)
        return chosen(inactive, effector.module.remember(params), switch(inner, wanted, measurement, state, params, step))

    def outside(kind, state, craft, memories, setup):
        """Return the sum of the environments' torques or accelerations."""
        sources = named.torques if kind == "torque" else named.accelerations
        return total(
            getattr(one.part.module, kind)(state, setup.environments[one.place], craft, memories.environments[one.place])
            for one in sources
        )

    def slope(moving, begun, carry, craft, setup):
        state, effectors, outputs = moving
        applied = getattr(state, body.COMMAND)
        commands = begun.commands
        if commands is None:
            commands = tuple(_commands(applied, effectors, setup, carry.memory))
        reactions, inertias, pushes = [], [], [outside("acceleration", state, craft, carry.memories, setup)]
        for effector, inner, command, params in zip(parts.effectors, effectors, commands, setup.effectors, strict=True):
            if effector.hook("push") is not None:
                pushes.append(effector.module.push(inner, command, state, params))
            reactions.append(effector.module.reaction(inner, command, state, params))
            if effector.hook("inertia") is not None:
                inertias.append(effector.module.inertia(inner, params))
        loads = Loads(
            total(pushes),
            outside("torque", state, craft, carry.memories, setup),
            total(reactions),
            None if not inertias else _matrices(inertias),
            not named.acting,
        )
        output_rates, command_rate = _driven(outputs, applied, carry, begun, setup)
        rates = body.rates(state, loads, command_rate, craft)
        turning = rates[state._fields.index("rate")] if parts.effectors else None
        effector_rates = tuple(
            effector.module.rates(inner, command, state, turning, params)
            for effector, inner, command, params in zip(parts.effectors, effectors, commands, setup.effectors, strict=True)
        )
        return (rates, effector_rates, output_rates)

    def _commands(applied, effectors, setup, memory):
        for effector, inner, params in zip(parts.effectors, effectors, setup.effectors, strict=True):
            if effector.hook("pulse") is not None:
                yield effector.module.pulse(inner, setup.substep, params)
            elif effector.flag("ACTS") and effector.hook("switch") is None:
                inactive = named.inactive(effector, memory)
                yield effector.module.command(applied if inactive is None else chosen(inactive, ZERO, applied), params)
            else:
                yield ()

    def _driven(outputs, applied, carry, begun, setup):
        """Return d(output)/dt of the actuators with dynamics: of all except the last, and of the last, whose output acts on
        the body."""
        if not named.dynamic:
            return (), None
        inputs, values = (carry.command, *outputs), (*outputs, applied)
        starts = (*begun.outputs, begun.applied)
        rates = tuple(
            actuator.module.rates(value, given, start, setup.substep, params)
            for actuator, value, given, start, params in zip(
                named.dynamic, values, inputs, starts, [setup.actuators[k] for k in named.dynamic_places], strict=True
            )
        )
        return rates[:-1], rates[-1]

    advance = runge_kutta(slope)

    def propagate(carry, craft, setup):
        """Return the carry after one substep."""
        applied = getattr(carry.state, body.COMMAND)
        # A held command is allocated only once.
        commands = tuple(_commands(applied, carry.effectors, setup, carry.memory)) if not named.dynamic else None
        begun = _Begun(commands, applied, carry.actuators)
        state, effectors, outputs = advance(
            (carry.state, carry.effectors, carry.actuators), setup.substep, begun, carry, craft, setup
        )
        return carry._replace(state=body.renormalised(state), effectors=effectors, actuators=outputs)

    def check(carry, step, setup):
        """Return the carry with the step at which the motion diverges: when it is no longer finite, too fast for the
        integration, or beyond the divergence bound."""
        sound = body.is_sound(carry.state, setup)
        lost = where(both(opposite(sound), less(carry.lost_at, 0.0)), number_of(step), carry.lost_at)
        return carry._replace(lost_at=lost)

    def sample(carry, step, setup):
        state = carry.state
        applied = getattr(state, body.COMMAND)
        commands = tuple(_commands(applied, carry.effectors, setup, carry.memory))
        users = list(zip(parts.effectors, carry.effectors, commands, setup.effectors, strict=True))
        given = total(e.module.applied(inner, command, state, p) for e, inner, command, p in users if e.flag("ACTS"))
        whole = body.sample(state, goal_of(carry, state, step, setup), applied if given is None else given, carry.command)
        records = tuple(e.module.record(s, command, state, p) for e, s, command, p in users if e.hook("record"))
        if parts.law.hook("record") is not None:
            records = (*records, parts.law.module.record(carry.memory, setup.period))
        return (whole, records, carry.memories.readings, carry.memories.estimate)

    def slope_of(carry, craft, setup):
        applied = getattr(carry.state, body.COMMAND)
        begun = _Begun(None, applied, carry.actuators)
        return slope((carry.state, carry.effectors, carry.actuators), begun, carry, craft, setup)

    return Step(measure, sense, update, propagate, check, sample, slope_of)


def _measured(effector: Part) -> Callable[..., Any]:
    return effector.hook("measured_momentum") or effector.module.momentum


class _Begun(NamedTuple):
    """The inputs of a substep: the effectors' held commands, and the actuators' outputs."""

    commands: Any
    applied: Any
    outputs: Any


class _Placed(NamedTuple):
    """A part and its index among those of its role."""

    part: Part
    place: int


class _Named:
    """Properties of a composition that are known before any equation runs."""

    def __init__(self, parts: Composition) -> None:
        environments = [_Placed(part, place) for place, part in enumerate(parts.environments)]
        self.torques = [one for one in environments if one.part.hook("torque") is not None]
        self.accelerations = [one for one in environments if one.part.hook("acceleration") is not None]
        self.dynamic_places = [k for k, part in enumerate(parts.actuators) if part.hook("rates") is not None]
        self.dynamic = [parts.actuators[k] for k in self.dynamic_places]
        self.acting = any(effector.flag("ACTS") for effector in parts.effectors)
        module: Any = parts.law.module
        self.modes = module if isinstance(module, Modes) else None
        ranges = _ranges([*parts.environments, *parts.sensors])
        self.environments, self.sensors = ranges[: len(environments)], ranges[len(environments) :]
        self.estimating = _in_turn(parts)

    def inactive(self, effector: Part, memory: Any) -> Any:
        """Return whether an effector is inactive in the present mode; None for one that never is."""
        return self.modes.inactive(effector.name, memory) if self.modes is not None and can_be_inactive(effector) else None


def _in_turn(parts: Composition) -> list[tuple[Part, int, int]]:
    """Return the law's estimator and those that watch, each with its index and that of its starter (-1: none), which comes
    before it."""
    every = ([] if parts.estimator is None else [parts.estimator]) + [*parts.watchers]
    starters = parts.starters or (-1,) * len(every)

    def depth(place: int) -> int:
        return 0 if starters[place] < 0 else 1 + depth(starters[place])

    return [(every[place], place, starters[place]) for place in sorted(range(len(every)), key=depth)]


def _ranges(parts: list[Part]) -> list[int]:
    """Return the index of the first random number of each part: the one that it requests if it is the first of its name,
    else the start of a range of its own."""
    firsts: list[int] = []
    for place, part in enumerate(parts):
        requested = getattr(part.module, "NUMBERS_FROM", None)
        firsts.append((place + 1) * RANGE if requested is None or part in parts[:place] else requested)
    return firsts


def _matrices(inertias: Any) -> Any:
    """Return the sum of 3x3 matrices."""
    inertia = inertias[0]
    for more in inertias[1:]:
        inertia = tuple(add(a, b) for a, b in zip(inertia, more, strict=True))
    return inertia


@cache
def _readings(names: tuple[str, ...]) -> Any:
    """Return the class of all readings of a loop's sensors."""
    return namedtuple("Readings", names)
