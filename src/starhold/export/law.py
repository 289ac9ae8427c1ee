"""The part of a closed loop that runs on the flight computer: from sensor readings to the command, with all memories."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity, quantities
from starhold.algebra.structure import buffers, floats, leaves, rebuild
from starhold.algebra.vector import ZERO
from starhold.errors import InputError
from starhold.export.recording import Copies
from starhold.loop.closed_loop import Carry, ClosedLoop, Composition, Memories, is_recorded
from starhold.loop.step import make_equations
from starhold.parts.contract import CLOCK, NoMemory
from starhold.parts.part import Part
from starhold.parts.random import Silent
from starhold.parts.roles import Goal
from starhold.trace.recording import Recorder

UNITS = {
    "attitude": Quantity("1", "inertial to body, unit quaternion, scalar first"),
    "rate": Quantity("rad/s", "angular velocity, body axes"),
    "position": Quantity("m", "from the centre of attraction, inertial axes"),
    "velocity": Quantity("m/s", "inertial axes"),
    "acceleration": Quantity("rad/s^2", "angular acceleration, target axes"),
}
"""Units and meanings of members whose class does not state them."""


class Parameters(NamedTuple):
    """Constants of the flight code."""

    gains: Any
    craft: Any
    setup: Any


@dataclass(frozen=True)
class FlightLaw:
    """The step of a law, `equations`, made by `make` from the parts of its loop: step(parameters, state, inputs) ->
    (command, state). `parameters`, `start` and `inputs` are its numbers from the scenario."""

    loop: ClosedLoop
    parts: Composition
    parameters: Parameters
    start: Any
    inputs: Any
    given: tuple[dict[str, str], ...]
    """Readings for an estimator or the law, each with the name of its input: the first of each name, then those of further
    sensors with the same reading."""
    command: Any
    """The class of the command."""

    def equation(self, copies: Copies | None = None) -> Callable[..., Any]:
        """Return the step, made of `copies` of the equations if given."""
        if copies is None:
            update = make_equations(self.parts).update
        else:
            update = copies.copy(make_equations)(_seen(self.parts, copies)).update

        command: Any = self.command

        def step(parameters: Parameters, state: Any, inputs: Any) -> tuple[Any, Any]:
            body, gains, craft = self.loop.start, parameters.gains, parameters.craft
            now = body._replace(**{name: getattr(inputs, name) for name in body._fields if hasattr(inputs, name)})
            kept = state._asdict()
            setup, wheels = parameters.setup, getattr(inputs, "wheels", None)
            if hasattr(inputs, "target"):
                setup = setup._replace(target=inputs.target)
            elif "steps" in kept:
                setup = setup._replace(target=(setup.target, kept["steps"]))
            readings = tuple(
                _Reading(**{name: getattr(inputs, member) for name, member in one.items()}) for one in self.given
            )
            estimate = () if self.parts.estimator is None else self.loop.carry().memories.estimate
            memories = Memories(
                kept.get("followed", NoMemory()),
                tuple(NoMemory() for _ in self.parts.environments),
                readings,
                (),
                kept.get("estimator", NoMemory()),
                estimate,
                tuple(kept.get("watchers", ())),
            )
            owns = tuple(wheels for _ in self.parts.effectors)
            sign = kept.get("sign", self.loop.carry().h)
            carry = Carry(now, owns, (), kept.get("law", NoMemory()), memories, sign, ZERO, -1.0)
            after = update(carry, 0, (0, 0), gains, craft, setup)
            then = {
                "sign": after.h,
                "law": after.memory,
                "estimator": after.memories.estimator,
                "watchers": rebuild(kept["watchers"], after.memories.watchers) if after.memories.watchers else (),
                "followed": after.memories.followed,
                "steps": kept.get("steps", 0.0) + 1.0,
            }
            return command(after.command), type(state)(*(then[name] for name in state._fields))

        return step


def flight_law(loop: ClosedLoop) -> FlightLaw:
    """Return the part of a loop that runs on the flight computer. Raise InputError for a part that has no form in C."""
    loop = loop.as_commanded()
    parts, setup, carry = loop.composition(), loop.setup(), loop.carry()
    modelled = [place for place, part in enumerate(parts.environments) if part.flag("MODELLED")]
    for place in modelled:
        part = parts.environments[place]
        if part.hook("update") or buffers((setup.environments[place],)) or carry.memories.environments[place] != NoMemory():
            raise _no_form(part.name, "a modelled torque that is a function of the state")
    # Effectors that decide at control instants have their own drive electronics, which gets the command.
    acting = [k for k, part in enumerate(parts.effectors) if part.flag("ACTS") and part.hook("switch") is None]
    if len(acting) > 1:
        raise _no_form(", ".join(parts.effectors[place].name for place in acting), "one effector that takes the command")
    module = parts.body.module
    fields = {name: getattr(loop.start, name) for name in loop.start._fields if name != module.COMMAND}
    notes = {name: UNITS.get(name) or quantities(module.Sample).get(name) for name in fields}
    given: tuple[dict[str, str], ...] = ()
    if parts.estimator is not None or parts.law.reads:
        firsts, again, readings, shown = {}, [], {}, {}
        for sensor, memory, params in zip(loop.used("sensor"), carry.memories.sensors, setup.sensors, strict=True):
            part = sensor.part
            first = part.module.measure(loop.start, memory, params, Silent(), 0)[0]._asdict()
            # Without an estimator, attitude and rate are inputs.
            taken = [name for name in first if parts.estimator is not None or name in parts.law.reads]
            repeated = not firsts.keys().isdisjoint(taken)
            inputs = {name: f"{sensor.prefix}{name}" if repeated else name for name in taken}
            again += [inputs] if repeated else []
            firsts |= {} if repeated else inputs
            readings.update({inputs[name]: first[name] for name in taken})
            units = quantities(part.module.Reading) if is_recorded(part) else {}
            shown.update({inputs.get(name, name): one for name, one in units.items()})
        if CLOCK in parts.law.reads and CLOCK not in firsts:
            firsts[CLOCK], readings[CLOCK] = CLOCK, 0.0
            shown[CLOCK] = quantities(module.Measurement)[CLOCK]._replace(text="since the start")
        fields.update(readings)
        notes.update({name: one for name, one in shown.items() if notes.get(name) is None or name not in UNITS})
        given = (firsts, *again) if readings else ()
    target, numbers = parts.target, setup.target
    if target is not None and buffers((numbers,)):
        if target.flag("BY_MODE"):
            raise _no_form(target.name, "one target for all modes, or none that follows a history")
        fields["target"] = _Target(*target.module.goal(numbers, loop.start, 0, None))
        notes["target"] = Quantity("", "the attitude to be reached, from inertial axes, at this instant")
        target, numbers = Part(target.name, _GOAL), ()  # pyright: ignore[reportArgumentType]
    timed = target is not None and "target" not in fields and _tells_time(loop)
    if target is not None and timed:
        target = Part(target.name, Counted(target.module))  # pyright: ignore[reportArgumentType]
    if acting:
        fields["wheels"] = carry.effectors[acting[0]]
        notes["wheels"] = Quantity("", "as their tachometers measure")
    composition = parts._replace(
        target=target,
        environments=tuple(parts.environments[place] for place in modelled),
        effectors=tuple(parts.effectors[place] for place in acting),
        sensors=(Part("readings", _READINGS),) * len(given),  # pyright: ignore[reportArgumentType]
        actuators=(),
    )
    watching = [fitted.called for fitted in loop.used("watcher")]
    named = setup._replace(
        target=numbers,
        environments=_named("Environments", [(parts.environments[k].name, setup.environments[k]) for k in modelled]),
        effectors=_named("Effectors", [(parts.effectors[k].name, setup.effectors[k]) for k in acting]),
        sensors=((),) * len(given),
        actuators=(),
        watchers=_named("Watchers", [*zip(watching, setup.watchers, strict=True)]),
    )
    kept = {"sign": carry.h if _keeps_sign(composition, module) else (), "law": carry.memory}
    kept |= {"estimator": carry.memories.estimator, "followed": carry.memories.followed}
    kept["watchers"] = _named("WatcherStates", [*zip(watching, carry.memories.watchers, strict=True)])
    kept |= {"steps": 0.0} if timed else {}
    start = _named("FlightState", [(name, value) for name, value in kept.items() if any(True for _ in leaves(value))])
    inputs = _noted("FlightInput", fields, notes)
    quantity = quantities(module.Sample).get("command", Quantity("", ""))._replace(dimension="")
    command = NamedTuple("FlightCommand", [(module.COMMAND, Annotated[Any, quantity])])
    return FlightLaw(loop, composition, Parameters(loop.gains, loop.known, named), start, inputs, given, command)


def _seen(parts: Composition, copies: Copies) -> Composition:
    """Return the parts with copies of their equations."""

    def seen(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(seen(part) for part in value)  # pyright: ignore
        if isinstance(value, Part) and isinstance(value.module, Counted):
            return replace(value, module=Counted(copies.seen(value.module.module)))
        return replace(value, module=copies.seen(value.module)) if isinstance(value, Part) else value

    return Composition(*(seen(value) for value in parts))


class _Reading(SimpleNamespace):
    def _asdict(self) -> dict[str, Any]:
        return vars(self)


class _Target(NamedTuple):
    attitude: Annotated[Any, UNITS["attitude"]]
    rate: Annotated[Any, Quantity("rad/s", "angular velocity, target axes")]
    acceleration: Annotated[Any, UNITS["acceleration"]]


_GOAL = SimpleNamespace(ROLE="target", goal=lambda params, state, step, before: Goal(*params))
_READINGS = SimpleNamespace(
    ROLE="sensor", RECORDED=False, measure=lambda state, memory, params, dice, step: (memory, memory)
)


@dataclass(frozen=True)
class Counted:
    """Replaces the module of a target: its numbers include the count of control steps, which the law keeps because it flies
    without the clock of a simulation."""

    module: Any

    def __getattr__(self, name: str) -> Any:
        return getattr(self.module, name)

    def goal(self, params: tuple[Any, Any], state: Any, step: Any, before: Any, *mode: Any) -> Goal:
        """Return the goal of the module at the counted step."""
        return self.module.goal(params[0], state, params[1], before, *mode)

    def begun(self, params: tuple[Any, Any], state: Any, attitude: Any, step: Any, *more: Any) -> Any:
        """Return the memory of the module at the counted step."""
        return self.module.begun(params[0], state, attitude, params[1], *more)


class _Clock:
    """A control step that records whether it is read."""

    reader, seen = "itself", False

    def read(self, operation: Any, values: Any) -> float:
        self.seen = True
        return 0.0


def _tells_time(loop: ClosedLoop) -> bool:
    """Return whether the goal of a loop's target depends on time, as for targets at the Sun and at stations."""
    clock, mode = _Clock(), (0.0,) if loop.target.part.flag("BY_MODE") else ()
    loop.target.part.module.goal(loop.setup().target, loop.start, clock, loop.carry().memories.followed, *mode)
    return clock.seen


def _keeps_sign(parts: Composition, body: Any) -> bool:
    """Return whether the quaternion sign policy has a memory."""
    policy = getattr(body, "SIGN_POLICIES", {}).get(parts.sign_policy)
    if policy is None:
        return False
    recorder = Recorder()
    with recorder.recording():
        cells = recorder.memory("cells")
        h = cells[5]
        return policy((cells[0], cells[1], cells[2], cells[3]), h, cells[4])[1] is not h


def _named(title: str, pairs: list[tuple[str, Any]]) -> Any:
    """Return a NamedTuple of these values."""
    return _noted(title, dict(pairs), {})


def _noted(title: str, fields: dict[str, Any], notes: dict[str, Any]) -> Any:
    kinds = [(name.replace("-", "_"), Annotated[Any, notes[name]] if notes.get(name) else Any) for name in fields]
    return NamedTuple(title, kinds)(*fields.values())  # pyright: ignore


def _no_form(name: str, allowed: str) -> InputError:
    return InputError("export c", "", f"{name}, which has no form in C", allowed)


def numbers(value: Any) -> list[float]:
    """Return the numbers of a value in their order in C: its floats, then those of its buffers."""
    return floats(value) + [leaf[k] for leaf in buffers(value) for k in range(leaf.size)]
