"""A law made of laws: each mode has one, and conditions on the measurement say when another mode begins.

At a control instant the conditions of the present mode are evaluated, and the law of the mode that they give commands: so
the state in which a mode begins fulfils the condition of the switch. A mode's law begins with its initial memory each time.
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
"""A condition may ask for these, beside time: a norm that the law is told below or above a level."""
ENDS = ("rate_below", "body_rate_below", "angle_below")
"""The tests that bound where a mode ends."""
AFTER = Gain("s", at_least=0.0, text="once the mode has flown so long")
DWELL = Gain("s", at_least=0.0, text="and all of it has held so long, without a break")


def level_of(test: str) -> Gain:
    """The declaration of a test's level."""
    name, _, side = test.rpartition("_")
    most = 3.141592653589793 if name == "angle" else None
    return Gain(UNITS[name], above=0.0, at_most=most, text=f"where {TEXTS[name]} is {side} this")


class Switch(NamedTuple):
    """Another mode begins, counted from 0, where all tests hold for a while; `key`: "until" or "back"."""

    key: str
    to: int
    tests: tuple[str, ...]


class Mode(NamedTuple):
    """A mode has a name, a law, switches to others, the later before the earlier where both are due, and the names of the
    effectors that work in it (None: all)."""

    name: str
    law: Law
    switches: tuple[Switch, ...]
    effectors: tuple[str, ...] | None = None

    def has(self, effector: str) -> bool:
        """Whether an effector of this name, of those that may rest, works in the mode."""
        return self.effectors is None or effector in self.effectors


class Memory(NamedTuple):
    """The law keeps the mode, counted from 0, for how many control periods it has flown, for how many control instants each
    of its switches has held, the memories of the laws, and those that they begin with."""

    mode: float
    age: float
    held: tuple[float, ...]
    own: tuple[Any, ...]
    fresh: tuple[Any, ...]


class Sample(NamedTuple):
    """The mode is recorded."""

    mode: Annotated[float, Quantity("1", "mode that commands, counted from 1")]
    time_in_mode: Annotated[float, Quantity("s", "since that mode began")]


@dataclass(frozen=True)
class Modes:
    """The module of a law of modes: all that a law file holds. Equal for laws of the same modes, whatever their gains."""

    modes: tuple[Mode, ...]

    @property
    def CARD(self) -> Card:  # noqa: N802
        """The law's card; the modes' laws are even only together."""
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
        """The readings that any of them needs."""
        return tuple(dict.fromkeys(name for mode in self.modes for name in mode.law.reads))

    @property
    def Gains(self) -> Any:  # noqa: N802
        """The class of the gains: those of all modes, one after the other, each followed by its switches' numbers."""
        return _gains_of(self)

    def fields(self) -> list[Field]:
        """The gains in order, under the keys that they have in the law's table."""
        found: list[Field] = []
        for place, mode in enumerate(self.modes, 1):
            found += [replace(item, name=f"mode[{place}].{item.name}") for item in _own(mode)]
        return found

    def parts(self, gains: Any) -> Iterator[tuple[Mode, Any, list[tuple[Switch, Any]]]]:
        """Each mode with the gains of its law, and its switches with their numbers."""
        left = iter(gains)
        for mode in self.modes:
            own = mode.law.gains(*(next(left) for _ in mode.law.fields()))
            yield mode, own, [(s, [next(left) for _ in _numbers(s)]) for s in mode.switches]

    def remember(self, gains: Any, craft: Any, period: float) -> Memory:
        """The memory at the start: the first mode."""
        own, fresh = (tuple(mode.law.remember(its, craft, period) for mode, its, _ in self.parts(gains)) for _ in range(2))
        slots = max(len(mode.switches) for mode in self.modes)
        return Memory(0.0, -1.0, (0.0,) * slots, own, fresh)

    def decide(self, told: Measurement, gains: Any, memory: Memory) -> Memory:
        """The memory with the mode that commands at this control instant."""
        age = memory.age + 1.0
        now = _Told(told)
        held, following = [n + 1.0 for n in memory.held], memory.mode
        due: list[tuple[Truth, int]] = []
        for place, (_, _, switches) in enumerate(self.parts(gains)):
            here = _is(memory.mode, place)
            for slot, (switch, (after, dwell, *levels)) in enumerate(switches):
                holds = now.later(age, after)
                for test, level in zip(switch.tests, levels, strict=True):
                    holds = both(holds, now.holds(test, level))
                held[slot] = where(both(here, opposite(holds)), 0.0, held[slot])
                due.append((both(here, now.later(held[slot] - 1.0, dwell)), switch.to))
        for truth, to in due:
            following = where(truth, float(to), following)
        switched = less(0.5, absolute(following - memory.mode))
        own = tuple(
            _renewed(both(switched, _is(following, place)), kept, fresh)
            for place, (kept, fresh) in enumerate(zip(memory.own, memory.fresh, strict=True))
        )
        held = tuple(where(switched, 0.0, n) for n in held)
        return Memory(following, where(switched, 0.0, age), held, own, memory.fresh)

    def command(self, told: Measurement, gains: Any, craft: Any, memory: Memory) -> tuple[Any, Memory]:
        """The command of the mode that has been decided on."""
        found, own = ZERO, list[Any]()
        for place, (mode, its, _) in enumerate(self.parts(gains)):

            def act(_: Any, kept: Any, law: Law = mode.law, its: Any = its) -> Any:
                return law.command(told, its, craft, kept)

            found, kept = when(_is(memory.mode, place), act, found, memory.own[place])
            own.append(kept)
        return found, memory._replace(own=tuple(own))

    def torque(self, told: Measurement, gains: Any, craft: Any, memory: Memory) -> tuple[Any, Memory]:
        """The torque (N m, body) of the mode that is due."""
        return self.command(told, gains, craft, self.decide(told, gains, memory))

    def inactive(self, effector: str, memory: Memory) -> Truth | None:
        """Whether an effector of this name is inactive in the present mode; None for one that is active in all."""
        found: Truth | None = None
        for place, mode in enumerate(self.modes):
            if not mode.has(effector):
                here = _is(memory.mode, place)
                found = here if found is None else either(found, here)
        return found

    def record(self, memory: Memory, period: Scalar) -> Sample:
        """The recorded quantities."""
        return Sample(memory.mode + 1.0, maximum(memory.age, 0.0) * period)

    def check(self, gains: Any, craft: Any) -> None:
        """ValueError where a mode's gains make a loop that cannot be stable."""
        for mode, its, _ in self.parts(gains):
            mode.law.check(its, craft)

    def examples(self) -> list[Any]:
        """None: a scenario has the gains."""
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


class _Told:
    """The quantities in the conditions, each computed once when it is needed."""

    def __init__(self, told: Measurement) -> None:
        self.told = told
        self._known: dict[str, Scalar] = {}

    def later(self, periods: Scalar, time: Scalar) -> Truth:
        """Whether so many control periods are a time (s), to the nearest control instant."""
        period = self.told.period
        return less_equal(time - 0.5 * period, periods * period)

    def holds(self, test: str, level: Scalar) -> Truth:
        """Whether a test holds."""
        name, _, side = test.rpartition("_")
        level = _sine_of_half(level) if name == "angle" else level
        return less(self._value(name), level) if side == "below" else less(level, self._value(name))

    def _value(self, name: str) -> Scalar:
        if name not in self._known:
            angle = name == "angle"
            self._known[name] = half_angle_sine(self.told.attitude) if angle else norm(getattr(self.told, name))
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
    """A law's memory, or the one that it begins with."""
    for own, first in zip(buffers(kept), buffers(fresh), strict=True):

        def copy(own: Buffer = own, first: Buffer = first) -> None:
            def put(k: Any) -> None:
                own[k] = first[k]

            repeat(own.size, put)

        when(begins, copy)
    return chosen(begins, fresh, kept)


def _numbers(switch: Switch) -> list[Field]:
    """The numbers of a switch under its keys."""
    found = [Field("after", AFTER, False, 0.0), Field("dwell", DWELL, False, 0.0)]
    return [*found, *(Field(test, level_of(test), True) for test in switch.tests)]


def _own(mode: Mode) -> list[Field]:
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
        for item in _own(mode)
    ]
    return NamedTuple("Gains", named)  # pyright: ignore
