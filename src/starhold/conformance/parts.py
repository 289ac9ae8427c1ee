"""The checks that every part except laws must pass, in any role."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from math import inf
from pathlib import Path
from typing import Any, cast

import numpy as np

from starhold.algebra.quaternion import NO_TURN, conjugate, multiply, normalise, to_reference, vector_part
from starhold.algebra.structure import flatten, leaves
from starhold.algebra.vector import ZERO, Vector, add, apply, norm, scale, subtract
from starhold.certification.measured import bounded
from starhold.certification.target_motion import motion_of
from starhold.certification.unmodelled import COMMANDED, envelope_of
from starhold.conformance.bench import PERIOD, Jumping, anywhere, moving, sample_loop
from starhold.conformance.directions import misdirected, tells
from starhold.conformance.units import SYSTEMS, rescale, rescale_params
from starhold.conformance.verdicts import STEPS, NotApplicableError, Verdict, agree, find, require, run
from starhold.errors import InputError
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import fly_plainly, numbers_of
from starhold.parts.catalogue import as_part, from_file, parts, read_module, role_of
from starhold.parts.contract import UNBOUNDED, Card, Errors, Push
from starhold.parts.craft import make_craft
from starhold.parts.orbit import at_anomaly
from starhold.parts.part import Fitted, Part
from starhold.parts.random import Dice
from starhold.scenario.bodies import bodies
from starhold.scenario.bodies.any_body import tables_of
from starhold.scenario.parts import ROLES, part_model, read_parts
from starhold.scenario.tables import shared_values
from starhold.scenario.writing import part_table
from starhold.simulation.lane import fly, label, recorded
from starhold.studies.body import body_module


def examine_part(part: Part) -> Iterator[Verdict]:
    """Run every check over a part, in order, and continue after failures; return the verdicts."""
    return run(CHECKS, part)


def find_part(given: str) -> Part:
    """Return the part installed under a name, or in a file. Raise InputError if there is none."""
    installed = {part.name: part for role in ("body", *ROLES) for part in parts(role).values()}

    def read(path: Path) -> Part:
        role = role_of(read_module(path))
        return from_file(path, parts(role) if role in ROLES else {}, as_part)

    return find(given, installed, read, "part")


def loop_with(part: Part, params: Any) -> ClosedLoop:
    """Return a loop with a part and the parts that it needs."""
    return body_module("starhold.conformance.bodies", part.body or "rigid-body").loop_with(part, params)


def declares_itself(part: Part) -> None:
    """The file declares a card, parameters with units, examples within their bounds, and what it records."""
    card = part.card
    require(isinstance(card, Card) and bool(card.title and card.summary), "CARD is not a Card with a title and a summary")
    if part.role == "body":
        if part.name in bodies():
            raise NotApplicableError("a body's numbers come from tables of its own")
        tables_of(part)
        return
    require(bool(part.examples()), "examples() is empty")
    for params in part.examples():
        require(isinstance(params, part.params), f"the example {params} is not a Params")
        for item, value in zip(part.fields() if not part.table else (), params, strict=not part.table):
            known = item.default is value or item.gain.check(item.written(value)) == value
            require(known, f"the example's {item.name} = {value} changes when it is read")
        recorded(loop_with(part, params))


def reads_alike(part: Part) -> None:
    """Plain Python, one lane and every lane of a batch agree bit for bit."""
    _loops_only(part)
    for params in part.examples():
        loop = loop_with(part, params)
        # Each lane is a run of its own, with its own random numbers.
        agree(loop, [loop.start] * 3, (0,))


def is_pure(part: Part) -> None:
    """A flight depends on nothing but its loop."""
    _loops_only(part)
    for params in part.examples():
        # Plain Python runs the file at every step, so few steps suffice; recording a kernel runs it once.
        ends = [numbers_of(fly_plainly(loop_with(part, params), STEPS // 4)) for _ in range(2)]
        require(bool(np.array_equal(*ends, equal_nan=True)), "two flights of the same loop differ")


def stays_finite(part: Part) -> None:
    """All its outputs are finite at rest, at a half turn and at a fast spin."""
    _loops_only(part)
    for params in part.examples():
        loop = loop_with(part, params)
        starts = [loop.start]
        if loop.aims:
            poses = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.6, -0.8))
            starts += [loop.start._replace(attitude=q, rate=w) for q in poses for w in (ZERO, (0.5, -0.4, 0.3))]
        for start in starts:
            samples, end = fly(replace(loop, start=start), STEPS)
            # Samples end where the motion is lost.
            require(bool(np.isfinite(samples).all()) and end.lost_at < 0.0, f"not finite from {start}")


def survives_toml(part: Part) -> None:
    """Parameters written to a [[part]] table and read back are the same; unknown keys are refused."""
    if part.table or part.role == "body":
        raise NotApplicableError("it has no [[part]] table: one of its own gives it")
    for params in part.examples():
        table = part_table(part, params)
        body = part.body or "rigid-body"
        shared = shared_values(
            part.fields(), params, {i.gain.shared for i in part.fields() if i.gain.shared and i.name not in table}
        )
        read = read_parts([table], body, Path(), part.name, shared)[0].params
        require(read == params, f"{params} becomes {read} on the way through TOML")
        try:
            read_parts([table | {"no_such_key": 1}], body, Path(), part.name, shared)
        except InputError:
            continue
        raise InputError(part.name, "", "an unknown key is accepted", "only the part's own keys")
    require(bool(part_model(part, ()).model_json_schema()["properties"]), "its table has no JSON Schema")


def keeps_units(part: Part) -> None:
    """The declared units are right: the physics is the same in any system of units."""
    if part.role not in ("environment", "actuator") or part.body not in ("", "rigid-body") or part.hook("update"):
        raise NotApplicableError("only for torques, forces and actuators without random numbers and tables")
    craft = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]], 0.05)
    loop = sample_loop(catalogue()["lyapunov"], catalogue()["lyapunov"].examples()[0])
    for params in part.examples():
        for name, unit in (("torque", "N m"), ("acceleration", "m/s^2"), ("command", "N m"), ("rates", "N m/s")):
            equation = part.hook(name)
            if equation is None:
                continue

            def value(system: Any, name: str = name, equation: Any = equation, params: Any = params) -> Any:
                period = rescale((PERIOD,), ("s",), system)[0]
                fitted = Fitted(part, rescale_params(part, params, system))
                taken = fitted.prepared(period)
                state = rescale(loop.start, ("1", "rad/s", "m", "m/s", "N m"), system)
                if part.role == "actuator":
                    output, target = rescale(((1e-3, 2e-3, -1e-3), (3e-3, -1e-3, 2e-3)), ("N m", "N m"), system)
                    return equation(target, taken) if name == "command" else equation(output, target, output, period, taken)
                return equation(state, taken, rescale(craft, CRAFT_UNITS, system), fitted.remembered(taken))

            plain = np.array(value((1.0, 1.0, 1.0)))
            for system in SYSTEMS:
                back = rescale((1.0,), (unit,), system)[0]
                error = float(np.abs(np.array(value(system)) / back - plain).max()) / max(float(np.abs(plain).max()), 1e-300)
                require(error < 1e-6, f"with kg, m, s scaled by {system} {name} changes by {error:.1e} of itself")


CRAFT_UNITS = ("kg m^2", "1/(kg m^2)", "N m", "m^3/s^2", "1")


def keeps_momentum(part: Part) -> None:
    """Without external torque the angular momentum of body and effector is conserved."""
    if part.role != "effector":
        raise NotApplicableError("only effectors share the body's momentum")
    if part.flag("OUTSIDE"):
        raise NotApplicableError("its torque comes from outside")
    for params in part.examples():
        loop = loop_with(part, params).without("environment")
        # The command of a law is an external torque if the effector does not take it.
        loop = loop if part.flag("ACTS") else replace(loop, limit="axis", command_limit=0.0)
        loop = replace(loop, start=loop.start._replace(position=ZERO, velocity=ZERO), period=PERIOD / 10.0)
        carries = [loop.carry(), fly(loop, 10 * STEPS)[1]]
        totals = [to_reference(carry.state.attitude, _momentum(loop, carry)) for carry in carries]
        apart = float(np.abs(np.subtract(totals[0], totals[1])).max()) / max(float(np.abs(totals).max()), 1e-300)
        require(apart < 1e-7, f"the angular momentum changes by {apart:.1e} of itself")


def _momentum(loop: ClosedLoop, carry: Any) -> Vector:
    """Return the angular momentum of body and effectors (N m s, body axes)."""
    total = apply(loop.craft.inertia, carry.state.rate)
    for fitted, state, prepared in zip(loop.used("effector"), carry.effectors, loop.setup().effectors, strict=True):
        module = fitted.part.module
        total = add(total, module.momentum(state, prepared))
        if fitted.part.hook("inertia_change") is not None:
            total = add(total, apply(module.inertia_change(state, prepared), carry.state.rate))
    return total


def measures_what_it_says(part: Part) -> None:
    """The fields of readings and estimates have the shapes of the body's state fields of the same names."""
    if part.role not in ("sensor", "estimator"):
        raise NotApplicableError("only sensors and estimators give the state")
    for params in part.examples():
        loop = loop_with(part, params)
        memories = fly(loop, 3)[1].memories
        values = [*memories.readings, memories.estimate] if part.role == "estimator" else memories.readings
        for value in values:
            for name in getattr(value, "_fields", ()):
                if name in loop.start._fields:
                    same = len(flatten((getattr(value, name),))) == len(flatten((getattr(loop.start, name),)))
                    require(same, f"{name} has another shape than that of the body")


def draws_in_its_range(part: Part) -> None:
    """Random numbers differ from step to step and from run to run, and the seed reproduces them."""
    if part.hook("measure") is None and part.hook("update") is None:
        raise NotApplicableError("it draws no random numbers")
    loop = loop_with(part, part.examples()[0])
    flights = [label(one, *fly(one, STEPS, run=run), 1) for one, run in ((loop, 0), (loop, 0), (loop, 1))]
    arrays = [np.concatenate([np.ravel(values) for values in flight.arrays.values()]) for flight in flights]
    require(bool(np.array_equal(arrays[0], arrays[1])), "the same run differs from itself")
    if any(isinstance(x, float) and x > 0.0 for x in leaves(part.examples()[0])) and _draws(part):
        require(not np.array_equal(arrays[0], arrays[2]), "another run has the same random numbers")


def keeps_what_it_says(part: Part) -> None:
    """No torque is larger than its `bound` or changes faster than its `torque_change`, no error is larger than its `error`,
    `direction` or `combined`, besides its `noise`, and no motion of a target than its `motion`; outputs follow commands as
    it says by `late`."""
    if part.hook("late") is not None:
        _follows_as_it_says(part)
        return
    # A body has an equation of this name.
    if part.role == "target" and part.hook("motion") is not None:
        _moves_as_it_says(part)
        return
    tell_torque, tell_errors, tell_change = part.hook("bound"), part.hook("error"), part.hook("torque_change")
    if not (tells(part) or tell_torque or tell_errors or tell_change):
        raise NotApplicableError("it says no bound of its torque, of its errors or of its motion")
    for params in part.examples():
        loop = loop_with(part, params)
        # In a few steps external torques contribute little momentum.
        envelope = envelope_of(loop, 1.01 * norm(_momentum(loop, loop.carry())), noisy=True)
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
        for turned in random.normal(size=(STEPS, 4)):
            attitude: Any = tuple((turned / np.linalg.norm(turned)).tolist())
            torques: list[Vector] = []
            for t in (-time, time):
                state = loop.start._replace(
                    attitude=normalise(multiply(attitude, (1.0, *scale(0.5 * t, rate)))),
                    rate=rate,
                    position=add(loop.start.position, scale(t, loop.start.velocity)),
                )
                torques.append(module.torque(state, numbers, loop.craft, memory))
            size = norm(subtract(torques[1], torques[0])) / (2.0 * time)
            yield "change of the torque", size, change.torque + change.per_rate * norm(rate)


def _follows_as_it_says(part: Part) -> None:
    """An actuator's output, in fine steps, comes nearer to a held command as `late` says, whatever it is off by at first."""
    module, random, steps = cast(Any, part.module), np.random.default_rng(4), 2000
    for params in part.examples():
        numbers, late = Fitted(part, params).prepared(PERIOD), module.late(params, PERIOD)
        require(0.0 <= late.kept < 1.0 and 0.0 < late.mean <= 1.0 and late.most > 0.0, f"{late} is not of what is late")
        for _ in range(STEPS):
            target = random.normal(size=3)
            off = random.uniform(-1.0, 1.0, size=3) * min(late.most, 1.0) * 0.999
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


def _moves_as_it_says(part: Part) -> None:
    """Check a target's rate and acceleration at points of the orbit and instants of a year or of the time that it states."""
    for params in part.examples():
        loop, random = loop_with(part, params), np.random.default_rng(3)
        motion = motion_of(loop)
        if motion is None:
            continue
        numbers, module, seen = Fitted(part, params).prepared(loop.period), cast(Any, part.module), NO_TURN
        for step in np.linspace(0.0, min(motion.until, 3e7) / loop.period, 20 * STEPS):
            state = loop.start
            if loop.has("two-body"):
                position, velocity = at_anomaly(state.position, state.velocity, loop.craft.gravity, 6.3 * random.uniform())
                state = state._replace(position=position, velocity=velocity)
            seen, *moved = module.goal(numbers, state, int(step), seen)
            for name, vector, most in zip(("rate", "acceleration"), moved, motion, strict=False):
                require(norm(vector) <= most * (1.0 + 1e-9), f"the {name} is {norm(vector):g}, larger than {most:g}")


def _pushes(part: Part, loop: ClosedLoop, errors: Errors, torque: Push, command: Push) -> Iterator[tuple[str, float, float]]:
    """Yield torques and errors of a part at states of a flight and at other attitudes, with their bounds."""
    dice = Jumping() if part.hook("noise") else Dice((1, 2), 3, 0)
    fitted, module, random = next(f for f in loop.parts if f.part == part), part.module, np.random.default_rng(1)
    numbers = fitted.prepared(loop.period)

    def most(push: Push, state: Any) -> float:
        return push.torque + push.per_rate * norm(state.rate)

    memory = fitted.remembered(numbers, *([loop.start] if part.role in ("sensor", "estimator") else []))
    states = (moving if errors.grow else anywhere)(loop, random)
    for step, (state, fast, hurried) in enumerate(islice(states, STEPS)):
        if part.role == "environment":
            memory = module.update(memory, state, numbers, dice, step) if part.hook("update") else memory
            yield "torque", norm(module.torque(state, numbers, loop.craft, memory)), most(torque, state)
        elif part.role == "sensor":
            reading, memory = module.measure(state, memory, numbers, dice, step)
            if hasattr(reading, "attitude"):
                # The angle, for either sign of the quaternion.
                turn = 2.0 * norm(vector_part(multiply(conjugate(state.attitude), reading.attitude)))
                yield "error of the attitude", turn, errors.attitude + errors.turning * fast
            if hasattr(reading, "rate"):
                yield (
                    "error of the rate",
                    norm(subtract(reading.rate, state.rate)),
                    errors.rate + errors.turned * fast + errors.late * hurried,
                )
        elif part.role == "actuator" and part.hook("command"):
            torque_wanted: Any = tuple(random.normal(scale=10.0 ** random.uniform(-6, 0), size=3).tolist())
            yield (
                "error of the command",
                norm(subtract(module.command(torque_wanted, numbers), torque_wanted)),
                command.torque,
            )
    if part.role == "effector":
        for step in (1, 5, STEPS):
            end = fly(loop, step)[1]
            effector = end.effectors[[f.part for f in loop.used("effector")].index(part)]
            if part.hook("bound"):
                yield "torque", norm(module.reaction(effector, None, end.state, numbers)), most(torque, end.state)
            if part.hook("error"):
                torque_wanted = scale(
                    0.1 * module.sure_torque(numbers, "norm"), cast(Any, tuple(random.uniform(-1, 1, 3).tolist()))
                )
                torque_given = module.applied(effector, module.command(torque_wanted, numbers), end.state, numbers)
                yield "error of the command", norm(subtract(torque_given, torque_wanted)), most(command, end.state)


def _draws(part: Part) -> bool:
    """Return whether a part's equation draws random numbers."""
    places: list[int] = []

    class Watched(Dice):
        def vectors(self, place: int, *deviations: Any) -> Any:
            places.append(place)
            return super().vectors(place, *deviations)

    loop = loop_with(part, part.examples()[0])
    fitted = next(f for f in loop.parts if f.part == part)
    numbers, dice = fitted.prepared(loop.period), Watched((1, 2), 3, 0)
    if part.hook("measure") is not None:
        part.module.measure(loop.start, fitted.remembered(numbers, loop.start), numbers, dice, 3)
    else:
        part.module.update(fitted.remembered(numbers), loop.start, numbers, dice, 3)
    return bool(places)


def _loops_only(part: Part) -> None:
    if part.role == "body":
        raise NotApplicableError("a body flies under its laws, which have their own checks")


CHECKS = (
    declares_itself,
    is_pure,
    reads_alike,
    stays_finite,
    survives_toml,
    keeps_units,
    keeps_momentum,
    measures_what_it_says,
    draws_in_its_range,
    keeps_what_it_says,
)
