"""The readings that a scenario predicts for other values of some of its numbers, with their exact partial derivatives.

The loop flies without noise, as recorded and compiled equations, from an initial state that is free too; slopes are computed
by differentiating the same program. The equations from numbers of the file to numbers of the loop are part of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import multiply, normalise
from starhold.algebra.structure import flatten, places, put
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import Kernel, Numbers, make_step, numbers_of
from starhold.loop.programs import predicting
from starhold.parts.random import Silent
from starhold.scenario.building import build
from starhold.scenario.key_reading import components, is_symmetric
from starhold.scenario.reading import LawEntry, Scenario
from starhold.scenario.values import Place, locate
from starhold.trace.machine import aligned
from starhold.trace.program import Program
from starhold.trace.tangent import MARK, tangent

Array: TypeAlias = NDArray[np.float64]
Nodes: TypeAlias = Callable[[int, Array], Array]
START = tuple(f"{name}_{axis}" for name in ("initial turn", "initial rate") for axis in "xyz")
"""Components of the initial state, always estimated: a rotation vector (rad, body axes) that corrects the attitude, and the
rate (rad/s)."""
WIDTH = 16
"""The number of slopes computed at once."""
NUDGE = 1e-6
"""The share of the largest moment of inertia that replaces free products of inertia of 0, to get a loop with their
structure."""


class Reading(NamedTuple):
    """A sensor's vector reading: its name in recordings, its first column and size in a row of predictions, and the names
    and columns of the flags that tell whether it is new or valid."""

    name: str
    first: int
    size: int
    gates: tuple[tuple[str, int], ...]

    @property
    def rows(self) -> slice:
        """The columns of its components."""
        return slice(self.first, self.first + self.size)


@dataclass(frozen=True)
class Free:
    """The free numbers of a scenario: the places of their keys, the name of each number, and its value in the file."""

    places: tuple[Place, ...]
    names: tuple[str, ...]
    values: Array

    @classmethod
    def of(cls, scenario: Scenario, keys: Sequence[str]) -> Free:
        """Return the free numbers of these keys. InputError for a key that cannot be fitted."""
        located: list[Place] = []
        names, values = list[str](), list[float]()
        for key in keys:
            try:
                place = locate(scenario, key)
            except InputError as error:
                raise _refused(scenario, key, error.given, error.allowed) from None
            if place.wordy or place.whole:
                raise _refused(scenario, key, "not a real number", "keys of real numbers, because only those have slopes")
            if place.key.startswith("initial."):
                raise _refused(
                    scenario, key, "the start", "other keys, because attitude and rate at the start are always fitted"
                )
            if place.value is None or not np.isfinite(place.value).all():
                raise _refused(scenario, key, "no finite value", "a key with an initial value in the file")
            if any(place.path[: len(other.path)] == other.path[: len(place.path)] for other in located):
                raise _refused(scenario, key, "a number given twice", "each number once")
            index = components(place.shape, is_symmetric(place))
            located.append(place)
            names += [place.key + "".join(f"[{n + 1}]" for n in item) for item in index]
            values += [float(np.asarray(place.value)[item]) for item in index]
        return cls(tuple(located), tuple(names), np.array(values))

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each number."""
        counts = [len(components(place.shape, is_symmetric(place))) for place in self.places]
        return tuple(p.gain.unit if p.gain else "1" for p, n in zip(self.places, counts, strict=True) for _ in range(n))

    @cached_property
    def sizes(self) -> Array:
        """The typical size of each number: the largest magnitude in its key; for a key that is 0 the bound nearest to 0, or
        1 if dimensionless; else 0, which means unknown."""
        every: list[float] = []
        for place in self.places:
            ends = [abs(end) for end in (place.bounds.at_least, place.bounds.at_most) if end]
            size = float(np.abs(place.value).max()) or min(
                ends, default=1.0 if place.gain and place.gain.unit == "1" else 0.0
            )
            every += [size] * len(components(place.shape, is_symmetric(place)))
        return np.array(every)

    def shaped(self, numbers: Sequence[Any]) -> list[Any]:
        """Return the numbers grouped by key, in the shape of each key."""
        given, shaped = iter(numbers), list[Any]()
        for place in self.places:
            index = components(place.shape, is_symmetric(place))
            known = dict(zip(index, given, strict=False)) if index != [()] else {(): next(given)}
            shaped.append(_filled(place.shape, (), known))
        return shaped


def _filled(shape: Sequence[int], index: tuple[int, ...], known: dict[tuple[int, ...], Any]) -> Any:
    if not shape:
        return known[index] if index in known else known[index[::-1]]
    return tuple(_filled(shape[1:], (*index, k), known) for k in range(shape[0]))


def _refused(scenario: Scenario, key: str, given: str, allowed: str) -> InputError:
    return InputError(scenario.where, f'--free "{key}"', given, allowed)


class Prediction(NamedTuple):
    """Readings (instants, numbers) and their slopes (instants, numbers, free + 1); the last slope is along the closing of
    the gaps between segments. starts: the initial states of the segments after the first, (nodes, 7), and their slopes."""

    values: Array
    slopes: Array
    starts: Array
    of_starts: Array


class Predictor:
    """Predicts the readings of a loop as a function of its initial state and of free numbers of its file."""

    def __init__(self, scenario: Scenario, entry: LawEntry, free: Free, outside: bool) -> None:
        """outside: whether commands are given; else the scenario's law flies with its estimator."""
        self.scenario, self.free, self.outside = scenario, free, outside
        loop = build(_nudged(scenario, free), entry)
        loop = loop.without("estimator") if outside else loop
        if loop.events:
            raise InputError(scenario.where, "fault", "changes during the flight", "a scenario without faults, for a fit")
        self.loop, self.count = loop, len(START) + len(free.names)
        parts = loop.composition()
        self._like = loop.carry()
        try:
            step = make_step(parts, silent=True)
            *programs, arguments = predicting(step, parts.sensors, self._made, self.count + 4, loop.substeps, outside)
        except (InputError, TypeError, ValueError) as error:
            allowed = "keys that enter the loop's numbers by an equation"
            given = error.given if isinstance(error, InputError) else str(error)
            raise _refused(scenario, ", ".join(place.key for place in free.places), given, allowed) from None
        varied = ("carry", "free", "record")
        self.programs: tuple[Program, Program] = (programs[0], programs[1])
        """The programs that make the carry and that fly, without slopes."""
        self._begin, self._fly = (Kernel(tangent(program, varied), WIDTH) for program in self.programs)
        self.constant = {"shared": arguments.shared, "tables": arguments.tables, "own": arguments.shared}
        self.readings, self.row = _readings(loop)
        state = places(self._like).state
        self._moving = [*state.attitude, *state.rate]

    def _made(self, numbers: Sequence[Any]) -> tuple[Any, Numbers]:
        """Return, by an equation, the carry and the numbers of the kernel."""
        hooks, loop, true, params = self.scenario.hooks, self.loop, dict[str, Any](), dict[str, Any]()
        dials = hooks.dials(self.scenario)
        for place, value in zip(self.free.places, self.free.shaped(numbers[len(START) : self.count]), strict=True):
            if place.path[0] == "part":
                fitted = self.scenario.parts[int(place.path[1])]
                params[fitted.called] = put(params.get(fitted.called, fitted.params), place.path[2:], value)
                continue
            key = ".".join(map(str, place.path[:2]))
            if key not in dials:
                raise ValueError(f"no equation gives the effect of {place.key}")
            true[key] = put(true.get(key, dials[key]), place.path[2:], value)
        moved = hooks.flown(self.scenario, loop, true, {})
        parts = tuple(replace(one, params=params[one.name]) if one.name in params else one for one in moved.parts)
        loop = replace(loop, parts=parts)
        setup = loop.setup()._replace(limit=moved.limit)
        state = moved.made_with._replace(attitude=_turned(numbers), rate=tuple(numbers[3:6]))
        return loop.carry(state, setup=setup), Numbers(loop.gains, moved.nominal, moved.craft, setup)

    def begun(self, attitude: Any, rate: Any) -> Array:
        """Return the parameters x (free + 4,) of a flight from this attitude and rate with the file's numbers: turn, rate,
        the free numbers, and the attitude to which the turn applies, which has no slopes."""
        return np.array([0.0, 0.0, 0.0, *rate, *self.free.values, *attitude])

    def moved(self, x: Array, step: Array) -> Array:
        """Return the parameters x (free + 4,) after a step (free,), with the turn moved into the attitude."""
        x = x + np.pad(step, (0, 4))
        return np.concatenate([np.zeros(3), x[3 : self.count], _turned(x.tolist())])

    def __call__(
        self, x: Array, steps: int, commands: Array, cuts: Sequence[int] = (), nodes: Nodes | None = None
    ) -> Prediction:
        """Return the prediction for `steps` control steps and one more, which gives the last readings.

        x: (free + 4,), see `begun`; commands: (steps + 1, 3) N m; cuts: the steps at which a new segment begins, with the
        attitude and rate (7,) that `nodes` returns for its number and the final state of the previous segment."""
        count, size, given = steps + 1, self.row, np.ascontiguousarray(commands)
        memories = [self._started(x, count * size, block) for block in range(-(-(self.count + 1) // WIDTH))]
        flights = [self._fly.on(self.constant | memory | {"given": given}) for memory in memories]
        starts, of_starts = np.empty((len(cuts), 7)), np.empty((len(cuts), 7, len(memories) * WIDTH))
        for number, (first, last) in enumerate(zip([0, *cuts], [*cuts, count], strict=True)):
            for fly in flights:
                fly(first, last - first)
            if last == count or nodes is None:
                continue
            end = memories[0]["carry"][self._moving, 0]
            starts[number] = nodes(number, end)
            last_block = memories[self.count // WIDTH]
            last_block["carry" + MARK][self._moving, self.count % WIDTH] += end - starts[number]
            for block, memory in enumerate(memories):
                memory["carry"][self._moving] = starts[number][:, None]
                of_starts[number, :, block * WIDTH : (block + 1) * WIDTH] = memory["carry" + MARK][self._moving]
        shown = slice(0, self.count + 1)
        values = memories[0]["record"][:, 0].reshape(count, size)
        slopes = np.concatenate([memory["record" + MARK].reshape(count, size, WIDTH) for memory in memories], axis=2)
        return Prediction(values, slopes[:, :, shown], starts, of_starts[:, :, shown])

    def _started(self, x: Array, size: int, block: int) -> dict[str, Array]:
        """Return the initial memories for a block of slopes; size: that of the record."""
        numbers = np.array(numbers_of(self._like))
        sizes = {"carry": len(numbers), "free": len(x), "record": size}
        memory = {name + mark: aligned(rows, WIDTH) for name, rows in sizes.items() for mark in ("", MARK)}
        memory["carry"][:] = numbers[:, None]
        memory["free"][:] = x[:, None]
        memory["free" + MARK][: self.count] = np.eye(self.count, WIDTH, -block * WIDTH)
        self._begin(memory)
        return memory


def _turned(numbers: Sequence[Any]) -> Any:
    """Return the initial attitude: the last four numbers, turned by the first three."""
    return normalise(multiply(tuple(numbers[-4:]), (1.0, *(0.5 * angle for angle in numbers[:3]))))


def _nudged(scenario: Scenario, free: Free) -> Scenario:
    """Return a scenario whose loop has the structure needed for free products of inertia."""
    changes = dict[str, Any]()
    for place in free.places:
        if len(place.shape) == 2 and place.path[0] != "part":
            full = np.array(place.value)
            size = NUDGE * np.abs(full).max()
            changes[place.key] = np.where(full == 0.0, size, full).tolist()
    return scenario.with_(changes) if changes else scenario


def _readings(loop: ClosedLoop) -> tuple[tuple[Reading, ...], int]:
    """Return the vector readings of the sensors, and the number of columns of all readings."""
    readings: list[Reading] = []
    setup, row = loop.setup(), 0
    carry = loop.carry()
    for fitted, memory, params in zip(loop.used("sensor"), carry.memories.sensors, setup.sensors, strict=True):
        reading = fitted.part.module.measure(carry.state, memory, params, Silent(), 0)[0]
        where = dict[str, tuple[int, int]]()
        for name, value in reading._asdict().items():
            where[name] = row, len(flatten((value,)))
            row += where[name][1]
        for name, (first, size) in where.items():
            gates = tuple((f"{fitted.prefix}{n}", place) for n, (place, _) in where.items() if n.startswith(f"{name}_is_"))
            if not any(name.startswith(f"{other}_is_") for other in where):
                readings.append(Reading(f"{fitted.prefix}{name}", first, size, gates))
    return tuple(readings), row
