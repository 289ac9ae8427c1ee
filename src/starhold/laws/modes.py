"""A supervisor switches between laws: each mode has one, and conditions on the measurement begin another mode.

At a control instant the conditions of the present mode are evaluated, and the law of the mode that they lead to commands,
so the state in which a mode begins fulfils its switch's condition. A mode's law begins with its initial memory each time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.quaternion import half_angle_sine
from starhold.algebra.scalar import Scalar, Truth, absolute, both, either, less, less_equal, maximum, opposite, where
from starhold.algebra.structure import buffers, chosen
from starhold.algebra.structured import Buffer, repeat, when
from starhold.algebra.vector import ZERO, norm
from starhold.laws.catalogue import Law
from starhold.laws.interface import Card, Field, Gain, Measurement

NAME = "modes"
"""The type of such a law in a scenario."""
UNITS = {"rate": "rad/s", "body_rate": "rad/s", "angle": "rad", "wheel_momentum": "N m s"}
TEXTS = {
    "rate": "the rate relative to the target",
    "body_rate": "the absolute rate",
    "angle": "the angle to the target",
    "wheel_momentum": "the norm of the wheels' momentum",
}
TESTS = tuple(f"{name}_{side}" for name in UNITS for side in ("below", "above"))
"""Quantities that a condition may test, beside time: a measured norm below or above a level."""
ENDS = ("rate_below", "body_rate_below", "angle_below")
"""The tests that bound where a mode ends."""
AFTER = Gain("s", at_least=0.0, text="least time in the mode")
DWELL = Gain("s", at_least=0.0, text="time for which all of it must have held without a break")


def level_of(test: str) -> Gain:
    """The declaration of a test's level."""
    name, _, side = test.rpartition("_")
    most = 3.141592653589793 if name == "angle" else None
    return Gain(UNITS[name], above=0.0, at_most=most, text=f"where {TEXTS[name]} is {side} this")


class Switch(NamedTuple):
    """A switch begins another mode (`to`, counted from 0) once all tests have held for a while; `key`: "until" or "back"."""

    key: str
    to: int
    tests: tuple[str, ...]


class Mode(NamedTuple):
    """A mode has a name, a law, switches to other modes, of which the last one due counts, and the names of the
    effectors that work in it (None: all)."""

    name: str
    law: Law
    switches: tuple[Switch, ...]
    effectors: tuple[str, ...] | None = None

    def has(self, effector: str) -> bool:
        """Whether an effector of this name works in the mode."""
        return self.effectors is None or effector in self.effectors


class Memory(NamedTuple):
    """The law remembers the mode, counted from 0, its age in control periods, for how many control instants each of its
    switches has held, and the memories of the laws, present and initial."""

    mode: float
    age: float
    instants: tuple[float, ...]
    memories: tuple[Any, ...]
    fresh: tuple[Any, ...]


class Sample(NamedTuple):
    """The mode is recorded."""

    mode: Annotated[float, Quantity("1", "mode that commands, counted from 1")]
    time_in_mode: Annotated[float, Quantity("s", "since that mode began")]


@dataclass(frozen=True)
class Modes:
    """A law of modes has this for a module, with all that a law file holds; equal for the same modes with any gains."""

    modes: tuple[Mode, ...]

    @property
    def CARD(self) -> Card:  # noqa: N802
        """The law's card; its quaternion sign is even only where that of every mode is."""
        laws = [mode.law for mode in self.modes]
        return Card(
            title="Modes",
            summary=", then ".join(f"{mode.name} ({mode.law.name})" for mode in self.modes),
            sources=("supervisor by conditions with dwell times",),
            assumptions=tuple(dict.fromkeys(text for law in laws for text in law.card.assumptions)),
            claims="none",
            quaternion_sign="even" if all(law.card.quaternion_sign == "even" for law in laws) else "odd",
        )

    @property
    def READS(self) -> tuple[str, ...]:  # noqa: N802
        """The readings that any mode's law needs."""
        return tuple(dict.fromkeys(name for mode in self.modes for name in mode.law.reads))

    @property
    def Gains(self) -> Any:  # noqa: N802
        """The class of the gains: those of all modes, one after the other, each followed by its switches' numbers."""
        return _gains_of(self)

    def fields(self) -> list[Field]:
        """The gains in order, under the keys that they have in the law's table."""
        listed: list[Field] = []
        for place, mode in enumerate(self.modes, 1):
            listed += [replace(item, name=f"mode[{place}].{item.name}") for item in _mode_fields(mode)]
        return listed

    def parts(self, gains: Any) -> Iterator[tuple[Mode, Any, list[tuple[Switch, Any]]]]:
        """Each mode with the gains of its law, and its switches with their numbers."""
        left = iter(gains)
        for mode in self.modes:
            law_gains = mode.law.gains(*(next(left) for _ in mode.law.fields()))
            yield mode, law_gains, [(s, [next(left) for _ in _numbers(s)]) for s in mode.switches]

    def remember(self, gains: Any, craft: Any, period: float) -> Memory:
        """The memory at the start, in the first mode."""
        now, fresh = (tuple(mode.law.remember(its, craft, period) for mode, its, _ in self.parts(gains)) for _ in range(2))
        slots = max(len(mode.switches) for mode in self.modes)
        return Memory(0.0, -1.0, (0.0,) * slots, now, fresh)

    def decide(self, measurement: Measurement, gains: Any, memory: Memory) -> Memory:
        """The memory with the mode that commands at this control instant."""
        age = memory.age + 1.0
        now = _Quantities(measurement)
        instants, following = [n + 1.0 for n in memory.instants], memory.mode
        due: list[tuple[Truth, int]] = []
        for place, (_, _, switches) in enumerate(self.parts(gains)):
            here = _is(memory.mode, place)
            for slot, (switch, (after, dwell, *levels)) in enumerate(switches):
                holds = now.later(age, after)
                for test, level in zip(switch.tests, levels, strict=True):
                    holds = both(holds, now.holds(test, level))
                instants[slot] = where(both(here, opposite(holds)), 0.0, instants[slot])
                due.append((both(here, now.later(instants[slot] - 1.0, dwell)), switch.to))
        for truth, to in due:
            following = where(truth, float(to), following)
        switched = less(0.5, absolute(following - memory.mode))
        memories = tuple(
            _renewed(both(switched, _is(following, place)), kept, fresh)
            for place, (kept, fresh) in enumerate(zip(memory.memories, memory.fresh, strict=True))
        )
        instants = tuple(where(switched, 0.0, n) for n in instants)
        return Memory(following, where(switched, 0.0, age), instants, memories, memory.fresh)

    def command(self, measurement: Measurement, gains: Any, craft: Any, memory: Memory) -> tuple[Any, Memory]:
        """The command of the present mode."""
        command, memories = ZERO, list[Any]()
        for place, (mode, its, _) in enumerate(self.parts(gains)):

            def act(_: Any, kept: Any, law: Law = mode.law, its: Any = its) -> Any:
                return law.command(measurement, its, craft, kept)

            command, kept = when(_is(memory.mode, place), act, command, memory.memories[place])
            memories.append(kept)
        return command, memory._replace(memories=tuple(memories))

    def torque(self, measurement: Measurement, gains: Any, craft: Any, memory: Memory) -> tuple[Any, Memory]:
        """The torque (N m, body) of the mode that begins or continues."""
        return self.command(measurement, gains, craft, self.decide(measurement, gains, memory))

    def inactive(self, effector: str, memory: Memory) -> Truth | None:
        """Whether an effector of this name is inactive in the present mode; None for one that is active in all."""
        resting: Truth | None = None
        for place, mode in enumerate(self.modes):
            if not mode.has(effector):
                here = _is(memory.mode, place)
                resting = here if resting is None else either(resting, here)
        return resting

    def record(self, memory: Memory, period: Scalar) -> Sample:
        """The recorded quantities."""
        return Sample(memory.mode + 1.0, maximum(memory.age, 0.0) * period)

    def check(self, gains: Any, craft: Any) -> None:
        """ValueError where a mode's gains make a loop that cannot be stable."""
        for mode, its, _ in self.parts(gains):
            mode.law.check(its, craft)

    def examples(self) -> list[Any]:
        """Return none: a scenario has the gains."""
        return []


def make_law(modes: tuple[Mode, ...]) -> Law:
    """The law of these modes."""
    module: Any = Modes(modes)
    return Law(NAME, module)


def mode_laws(law: Law, gains: Any) -> list[tuple[str, Law, Any]]:
    """Name, law and gains of each mode of a law; none for a law without modes."""
    if not isinstance(law.module, Modes):
        return []
    return [(mode.name, mode.law, its) for mode, its, _ in law.module.parts(gains)]


class _Quantities:
    """Quantities in the conditions are computed once, when first needed."""

    def __init__(self, measurement: Measurement) -> None:
        self.measurement = measurement
        self._known: dict[str, Scalar] = {}

    def later(self, periods: Scalar, time: Scalar) -> Truth:
        """Whether this many control periods reach a time (s), to the nearest control instant."""
        period = self.measurement.period
        return less_equal(time - 0.5 * period, periods * period)

    def holds(self, test: str, level: Scalar) -> Truth:
        """Whether a test holds."""
        name, _, side = test.rpartition("_")
        level = _sine_of_half(level) if name == "angle" else level
        return less(self._value(name), level) if side == "below" else less(level, self._value(name))

    def _value(self, name: str) -> Scalar:
        if name not in self._known:
            angle = name == "angle"
            measured = getattr(self.measurement, "attitude" if angle else name)
            self._known[name] = half_angle_sine(measured) if angle else norm(measured)
        return self._known[name]


def _sine_of_half(angle: Scalar) -> Scalar:
    """The sine of half an angle of up to pi, by its series; 1e-16 off at most."""
    x = 0.25 * angle * angle
    total = 1.0
    for n in range(20, 0, -2):
        total = 1.0 - total * x / float(n * (n + 1))
    return 0.5 * angle * total


def _is(mode: Scalar, place: int) -> Truth:
    return less(absolute(mode - float(place)), 0.5)


def _renewed(begins: Truth, kept: Any, fresh: Any) -> Any:
    """Return a law's memory, or its initial one as its mode begins."""
    for present, first in zip(buffers(kept), buffers(fresh), strict=True):

        def copy(present: Buffer = present, first: Buffer = first) -> None:
            def put(k: Any) -> None:
                present[k] = first[k]

            repeat(present.size, put)

        when(begins, copy)
    return chosen(begins, fresh, kept)


def _numbers(switch: Switch) -> list[Field]:
    """The numbers of a switch under its keys."""
    waits = [Field("after", AFTER, False, 0.0), Field("dwell", DWELL, False, 0.0)]
    return [*waits, *(Field(test, level_of(test), True) for test in switch.tests)]


def _mode_fields(mode: Mode) -> list[Field]:
    """The gains of a mode's law, and its switches' numbers."""
    switched = [
        Field(f"{s.key}.{item.name}", item.gain, item.required, item.default) for s in mode.switches for item in _numbers(s)
    ]
    return [*mode.law.fields(), *switched]


@cache
def _gains_of(modes: Modes) -> Any:
    named = [
        (f"{item.name}_of_{place}".replace(".", "_"), Annotated[Any, item.gain])
        for place, mode in enumerate(modes.modes, 1)
        for item in _mode_fields(mode)
    ]
    return NamedTuple("Gains", named)  # pyright: ignore
