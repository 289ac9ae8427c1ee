"""The checks that every part except laws must pass, in any role."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from starhold.algebra.quaternion import to_reference
from starhold.algebra.structure import flatten, leaves
from starhold.algebra.vector import ZERO
from starhold.conformance.bench import PERIOD, loop_with, momentum_of, sample_loop
from starhold.conformance.recursion import errs_as_it_says
from starhold.conformance.saying import keeps_what_it_says
from starhold.conformance.scatter import draws_as_it_says
from starhold.conformance.units import SYSTEMS, rescale, rescale_params
from starhold.conformance.verdicts import STEPS, NotApplicableError, Verdict, agree, find, require, run
from starhold.errors import InputError
from starhold.laws.catalogue import catalogue
from starhold.loop.kernels import fly_plainly, numbers_of
from starhold.parts.catalogue import as_part, from_file, parts, read_module, role_of
from starhold.parts.contract import Card
from starhold.parts.craft import make_craft
from starhold.parts.part import Fitted, Part
from starhold.parts.random import Dice
from starhold.scenario.bodies import bodies
from starhold.scenario.bodies.any_body import tables_of
from starhold.scenario.parts import ROLES, part_model, read_parts
from starhold.scenario.tables import shared_values
from starhold.scenario.writing import part_table
from starhold.simulation.lane import fly, label, recorded


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
        totals = [to_reference(carry.state.attitude, momentum_of(loop, carry)) for carry in carries]
        apart = float(np.abs(np.subtract(totals[0], totals[1])).max()) / max(float(np.abs(totals).max()), 1e-300)
        require(apart < 1e-7, f"the angular momentum changes by {apart:.1e} of itself")


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
    draws_as_it_says,
    errs_as_it_says,
)
