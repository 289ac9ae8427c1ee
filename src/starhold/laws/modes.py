"""A supervisor switches between laws: each mode has a law, and conditions on the measurement begin another mode.

At a control instant the conditions of the present mode are evaluated, and the law of the resulting mode commands, so the
state in which a mode begins satisfies the condition of its switch. A mode's law begins with its initial memory each time.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, reduce
from typing import Annotated, Any, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.scalar import Scalar, Truth, absolute, both, either, less, maximum, opposite, where
from starhold.algebra.structure import buffers, chosen
from starhold.algebra.structured import Buffer, repeat, when
from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import Law
from starhold.laws.conditions import (
    NEVER,
    SETTINGS,
    Facts,
    Sight,
    Watch,
    advanced,
    level_of,
    needs_sky,
    quantity_of,
    settings_of,
    sky_at,
    station_at,
    watches,
)
from starhold.laws.interface import Card, Field, Gain, Measurement
from starhold.laws.monitors import Guard, Monitor, watched
from starhold.parts.epoch import EPOCH

NAME = "modes"
"""The name of this type of law in a scenario."""
AFTER = Gain("s", at_least=0.0, text="least time in the mode")
DWELL = Gain("s", at_least=0.0, text="time for which the whole condition must have held without a break")
WHEELS_LOST = Gain("1", at_least=1.0, text="how many wheels must be diagnosed as lost for the mode to begin")


class Switch(NamedTuple):
    """A switch begins another mode (`to`, counted from 0) once all tests have held for a time; `key`: "until" or "back"."""

    key: str
    to: int
    tests: tuple[str, ...]

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of its levels, and of the further numbers of its tests."""
        return (*self.tests, *settings_of(self.tests))


class Mode(NamedTuple):
    """A mode: its name, its law, its switches to other modes, of which the last one due takes effect, and the names of the
    effectors active in it (None: all)."""

    name: str
    law: Law
    switches: tuple[Switch, ...]
    effectors: tuple[str, ...] | None = None

    def has(self, effector: str) -> bool:
        """Return whether an effector of this name is active in the mode."""
        return self.effectors is None or effector in self.effectors


class Memory(NamedTuple):
    """The memory of the supervisor: the mode, counted from 0, its age in control periods, the number of control instants
    for which each of its switches has held, and the present and initial memories of the laws."""

    mode: float
    age: float
    instants: tuple[float, ...]
    memories: tuple[Any, ...]
    fresh: tuple[Any, ...]
    watch: Any = ()
    """A `Watch`, if a condition or a monitor needs more than the law's measurement."""
    losses: Any = ()
    """`Losses`, if a mode begins on a loss."""


class Losses(NamedTuple):
    """The memory of losses: memories of the monitors, the number of wheels that may still be lost, the number of losses
    noticed, and the tripped monitor, counted from 1 (0: none)."""

    guards: tuple[Guard, ...]
    left: float
    trips: float
    tripped: float


class Sample(NamedTuple):
    """The recorded quantities of a law of modes."""

    mode: Annotated[float, Quantity("1", "mode that commands, counted from 1")]
    time_in_mode: Annotated[float, Quantity("s", "since that mode began")]


class LossSample(NamedTuple):
    """The recorded quantities of a law of modes, with the losses that flight software noticed."""

    mode: Annotated[float, Quantity("1", "mode that commands, counted from 1")]
    time_in_mode: Annotated[float, Quantity("s", "since that mode began")]
    trips: Annotated[float, Quantity("1", "losses noticed since the start")]
    tripped: Annotated[float, Quantity("1", "monitor that is tripped, counted from 1; 0 for none")]


@dataclass(frozen=True)
class Modes:
    """The module of a law of modes, with all that a law file contains; equal for the same modes with any gains."""

    modes: tuple[Mode, ...]
    on_loss: int | None = None
    """The mode, counted from 0, that begins when wheels are lost or a monitor trips."""
    monitors: tuple[Monitor, ...] = ()
    ephemeris: int = 0
    """The model of the Sun's motion in conditions, as for parts."""

    @property
    def CARD(self) -> Card:  # noqa: N802
        """The law's card; its quaternion sign is even only if that of every mode is."""
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
        """The readings that a mode's law, a condition or a monitor needs."""
        needed = [name for mode in self.modes for name in mode.law.reads]
        return tuple(dict.fromkeys((*needed, *self.SEVERAL)))

    @property
    def SEVERAL(self) -> tuple[str, ...]:  # noqa: N802
        """The readings among them that several sensors may give, because only conditions and monitors need them."""
        needed = {name for mode in self.modes for name in mode.law.reads}
        looked = [tested.reads for test in self.tests if (tested := quantity_of(test)) and tested.reads]
        looked += [one.watches for one in self.monitors if one.sensor is not None]
        return tuple(dict.fromkeys(name for name in looked if name not in needed))

    @property
    def ESTIMATES(self) -> tuple[str, ...]:  # noqa: N802
        """The names of the estimates that conditions and monitors need."""
        looked = [tested.estimates for test in self.tests if (tested := quantity_of(test)) and tested.estimates]
        looked += [one.watches for one in self.monitors if one.sensor is None or one.kind == "residual"]
        return tuple(dict.fromkeys(looked))

    @property
    def tests(self) -> tuple[str, ...]:
        """The tests of all conditions."""
        return tuple(test for mode in self.modes for switch in mode.switches for test in switch.tests)

    @property
    def WATCHES(self) -> bool:  # noqa: N802
        """Whether a condition or a monitor needs more than the law's measurement."""
        return self.on_loss is not None or watches(self.tests)

    @property
    def ABOUT(self) -> str:  # noqa: N802
        """The name of the body that the craft must orbit for the conditions to have a meaning."""
        return "Earth" if needs_sky(self.tests) else ""

    @property
    def Gains(self) -> Any:  # noqa: N802
        """The class of the gains: those of all modes in order, each followed by the numbers of its switches."""
        return _gains_of(self)

    def fields(self) -> list[Field]:
        """The fields of the gains in order, under their keys in the law's table."""
        listed: list[Field] = []
        for place, mode in enumerate(self.modes, 1):
            listed += [replace(item, name=f"mode[{place}].{item.name}") for item in _mode_fields(mode)]
        return listed + [replace(item, name=name.format(".")) for name, item in self.shared_fields()]

    def shared_fields(self) -> list[tuple[str, Field]]:
        """The numbers that belong to no single mode, each with its name, in which {} stands for the separator."""
        shared = [("epoch", Field("epoch", EPOCH, True))] if needs_sky(self.tests) else []
        if self.on_loss is not None:
            shared.append(("wheels_lost", Field("wheels_lost", WHEELS_LOST, False, 1.0)))
        for place, monitor in enumerate(self.monitors, 1):
            shared += [(f"monitor[{place}]{{}}{item.name}", item) for item in monitor.fields()]
        return shared

    def parts(self, gains: Any) -> Iterator[tuple[Mode, Any, list[tuple[Switch, Any]]]]:
        """Return each mode with the gains of its law, and its switches with their numbers."""
        left = iter(gains)
        for mode in self.modes:
            law_gains = mode.law.gains(*(next(left) for _ in mode.law.fields()))
            yield mode, law_gains, [(s, [next(left) for _ in _numbers(s)]) for s in mode.switches]

    def remember(self, gains: Any, craft: Any, period: float) -> Memory:
        """Return the initial memory, in the first mode."""
        now, fresh = (tuple(mode.law.remember(its, craft, period) for mode, its, _ in self.parts(gains)) for _ in range(2))
        slots = max(len(mode.switches) for mode in self.modes)
        watch = losses = ()
        if self.WATCHES:
            switches = [one for _, _, of_mode in self.parts(gains) for one in of_mode]
            given = [dict(zip(switch.keys, levels, strict=True)) for switch, (_, _, *levels) in switches]
            stations = tuple(station_at(numbers) for numbers in given if "latitude" in numbers)
            watch = Watch(-1.0, sky_at(gains.epoch, self.ephemeris) if needs_sky(self.tests) else (), stations, NEVER)
        if self.on_loss is not None:
            losses = Losses(tuple(monitor.at_start for monitor in self.monitors), gains.wheels_lost, 0.0, 0.0)
        return Memory(0.0, -1.0, (0.0,) * slots, now, fresh, watch, losses)

    def decide(self, measurement: Measurement, gains: Any, memory: Memory, sight: Sight | None = None) -> Memory:
        """Return the memory with the mode that commands at this control instant. sight: what flight software sees, for laws
        with `WATCHES`."""
        age = memory.age + 1.0
        watch = advanced(memory.watch, sight) if sight is not None else memory.watch
        now = Facts(measurement, watch, sight)
        instants, following = [n + 1.0 for n in memory.instants], memory.mode
        due: list[tuple[Truth, int]] = []
        stations = iter(watch.stations if watch else ())
        for place, (_, _, switches) in enumerate(self.parts(gains)):
            here = is_mode(memory.mode, place)
            for slot, (switch, (after, dwell, *levels)) in enumerate(switches):
                holds = now.later(age, after)
                numbers = dict(zip(switch.keys, levels, strict=True))
                if "latitude" in numbers:
                    numbers["station"] = next(stations)
                for test in switch.tests:
                    holds = both(holds, now.holds(test, numbers[test], numbers))
                instants[slot] = where(both(here, opposite(holds)), 0.0, instants[slot])
                due.append((both(here, now.later(instants[slot] - 1.0, dwell)), switch.to))
        for truth, to in due:
            following = where(truth, float(to), following)
        losses = memory.losses
        if self.on_loss is not None:
            lost, losses = self._noticed(gains, losses, now, memory.mode)
            following = where(lost, float(self.on_loss), following)
        switched = less(0.5, absolute(following - memory.mode))
        memories = tuple(
            _renewed(both(switched, is_mode(following, place)), kept, fresh)
            for place, (kept, fresh) in enumerate(zip(memory.memories, memory.fresh, strict=True))
        )
        instants = tuple(where(switched, 0.0, n) for n in instants)
        return Memory(following, where(switched, 0.0, age), instants, memories, memory.fresh, watch, losses)

    def _noticed(self, gains: Any, losses: Losses, now: Facts, mode: Scalar) -> tuple[Truth, Losses]:
        """Return whether the loss mode begins, and the new memory of losses: it begins while a monitor is tripped, and when
        the last wheel that may be lost is lost. A monitor restarts with its modes."""
        guards, tripped = list[Guard](), 0.0
        numbers = iter(gains[len(gains) - 2 * len(self.monitors) :])
        for place, (monitor, guard) in enumerate(zip(self.monitors, losses.guards, strict=True), 1):
            truth, guard = watched(monitor, guard, now, next(numbers), next(numbers))
            if monitor.modes:
                looks = reduce(either, (is_mode(mode, one) for one in monitor.modes))
                truth, guard = both(looks, truth), chosen(looks, guard, monitor.at_start)
            # The first tripped monitor is recorded.
            tripped = where(both(truth, less(tripped, 0.5)), float(place), tripped)
            guards.append(guard)
        wheels = both(less(gains.wheels_lost, 0.5), less(gains.wheels_lost, losses.left - 0.5))
        now_tripped = less(0.5, tripped)
        noticed = either(wheels, both(now_tripped, less(losses.tripped, 0.5)))
        trips = where(noticed, losses.trips + 1.0, losses.trips)
        return either(wheels, now_tripped), Losses(tuple(guards), gains.wheels_lost, trips, tripped)

    def command(self, measurement: Measurement, gains: Any, craft: Any, memory: Memory) -> tuple[Any, Memory]:
        """Return the command of the present mode, and the new memory."""
        command, memories = ZERO, list[Any]()
        for place, (mode, its, _) in enumerate(self.parts(gains)):

            def act(_: Any, kept: Any, law: Law = mode.law, its: Any = its) -> Any:
                return law.command(measurement, its, craft, kept)

            command, kept = when(is_mode(memory.mode, place), act, command, memory.memories[place])
            memories.append(kept)
        return command, memory._replace(memories=tuple(memories))

    def torque(self, measurement: Measurement, gains: Any, craft: Any, memory: Memory) -> tuple[Any, Memory]:
        """Return the torque (N m, body axes) of the mode that begins or continues, and the new memory."""
        return self.command(measurement, gains, craft, self.decide(measurement, gains, memory))

    def inactive(self, effector: str, memory: Memory) -> Truth | None:
        """Return whether an effector of this name is inactive in the present mode; None for one that is active in all."""
        resting: Truth | None = None
        for place, mode in enumerate(self.modes):
            if not mode.has(effector):
                here = is_mode(memory.mode, place)
                resting = here if resting is None else either(resting, here)
        return resting

    def record(self, memory: Memory, period: Scalar) -> Sample | LossSample:
        """Return the recorded quantities."""
        mode = Sample(memory.mode + 1.0, maximum(memory.age, 0.0) * period)
        return mode if self.on_loss is None else LossSample(*mode, memory.losses.trips, memory.losses.tripped)

    def check(self, gains: Any, craft: Any) -> None:
        """Raise ValueError for gains of a mode whose loop cannot be stable."""
        for mode, its, _ in self.parts(gains):
            mode.law.check(its, craft)

    def examples(self) -> list[Any]:
        """Return no examples: a scenario has the gains."""
        return []


def make_law(modes: Modes) -> Law:
    """Return the law of these modes."""
    module: Any = modes
    return Law(NAME, module)


def names_of_modes(law: Law) -> list[str]:
    """Return the names of a law's modes; none for a law without modes."""
    return [mode.name for mode in law.module.modes] if isinstance(law.module, Modes) else []


def mode_laws(law: Law, gains: Any) -> list[tuple[str, Law, Any]]:
    """Return name, law and gains of each mode of a law; none for a law without modes."""
    if not isinstance(law.module, Modes):
        return []
    return [(mode.name, mode.law, its) for mode, its, _ in law.module.parts(gains)]


def is_mode(mode: Scalar, place: int) -> Truth:
    """Return whether the mode of a memory is the one in this place."""
    return less(absolute(mode - float(place)), 0.5)


def _renewed(begins: Truth, kept: Any, fresh: Any) -> Any:
    """Return a law's memory, or its initial one when its mode begins."""
    for present, first in zip(buffers(kept), buffers(fresh), strict=True):

        def copy(present: Buffer = present, first: Buffer = first) -> None:
            def put(k: Any) -> None:
                present[k] = first[k]

            repeat(present.size, put)

        when(begins, copy)
    return chosen(begins, fresh, kept)


def _numbers(switch: Switch) -> list[Field]:
    """Return the fields of a switch under its keys."""
    waits = [Field("after", AFTER, False, 0.0), Field("dwell", DWELL, False, 0.0)]
    settings = [SETTINGS[key] for key in settings_of(switch.tests)]
    return [*waits, *(Field(test, level_of(test), True) for test in switch.tests), *settings]


def _mode_fields(mode: Mode) -> list[Field]:
    """Return the fields of the gains of a mode's law, and of its switches."""
    switched = [
        Field(f"{s.key}.{item.name}", item.gain, item.required, item.default) for s in mode.switches for item in _numbers(s)
    ]
    return [*mode.law.fields(), *switched]


@cache
def _gains_of(modes: Modes) -> Any:
    places = enumerate(modes.modes, 1)
    pairs = [(f"{one.name}_of_{k}".replace(".", "_"), one.gain) for k, mode in places for one in _mode_fields(mode)]
    pairs += [(re.sub(r"\W", "", name.format("_")), one.gain) for name, one in modes.shared_fields()]
    named = [(name, Annotated[Any, gain]) for name, gain in pairs]
    return NamedTuple("Gains", named)  # pyright: ignore
