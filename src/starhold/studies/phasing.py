"""Sheets for the test of signs and axes before launch: the equations that fly tell what each stage of a loop shows under
stimuli by hand or by coil."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quantity import quantities
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise, relative, to_body, to_reference
from starhold.algebra.rotation import rotation_vector
from starhold.algebra.structure import flatten
from starhold.algebra.vector import ZERO, Vector, cross, dot, norm, scale
from starhold.laws.modes import mode_laws
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.loop.modes import loop_of_mode
from starhold.parts.part import Fitted, Part
from starhold.parts.random import Silent
from starhold.scenario.building import build
from starhold.scenario.reading import LawEntry, Scenario

Array: TypeAlias = NDArray[np.float64]
AXES = "xyz"
TURN = math.radians(10.0)
"""The craft is turned by this angle (rad), and at this rate (rad/s)."""
SMALL = 0.25
"""A number below this share of the largest of its vector counts as 0."""
NOTHING = 1e-9
"""A vector below this share of the largest one of its kind is not shown."""
STATED = ("attitude", "rate")
"""Quantities of the body's state that have body axes; the attitude as the turn since the craft stood on target."""


class Block(NamedTuple):
    """A vector that a stage shows: its name, its unit and how many numbers it has."""

    name: str
    unit: str
    size: int = 3

    @property
    def labels(self) -> Sequence[str]:
        """The names of its numbers."""
        return AXES if self.size == 3 and self.name != MOTORS else [str(k + 1) for k in range(self.size)]


MOTORS, ACTUATORS = "motor torque", "actuators"
"""Of wheels what each motor gives; of a loop without effectors what acts on the body."""
UNITS = {"dipole": Block("dipole", "A m^2"), "firing": Block("time on", "s")}
"""A unit of an effector with `switch` does this, by the field of the effector's state that tells it."""


class Stage(NamedTuple):
    """A part shows here what it makes of the stages before; kind: "reading", "estimate", "command", "share" (of each unit
    of an effector) or "torque" (on the body)."""

    kind: str
    part: str
    blocks: tuple[Block, ...]


class Stimulus(NamedTuple):
    """The craft is given this: words, the carry in which the loop stands, the torque that is asked for (None: the law
    commands), the stages that answer to it, and the quantities of sensors and estimator that the sheet shows."""

    name: str
    carry: Any
    given: Vector | None
    live: tuple[Stage, ...]
    shown: tuple[str, ...]
    bench: Bench


class Cell(NamedTuple):
    """A number of a sheet, in `unit`: the expected sign and value, and where it stands: the numbers of the stimulus and of
    the stage, and the place in the stage's vector, which is SI."""

    stimulus: str
    stage: str
    axis: str
    sign: str
    value: float
    unit: str
    at: tuple[int, int]
    place: int
    block: tuple[int, int]
    """Where the numbers of its vector begin and end."""


class _Stand:
    """This stands in for the module of a part, some of whose equations are others."""

    def __init__(self, module: Any, **equations: Any) -> None:
        self.__dict__ |= equations | {"_module": module}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


class Bench:
    """A loop without environment stands on target at rest, with sensors that have no noise and rotors that do not turn."""

    def __init__(self, loop: ClosedLoop, law: str) -> None:
        still = tuple(replace(f, start=None) if f.part.role == "effector" else f for f in loop.parts)
        self.loop = loop = replace(loop, parts=still, events=()).without("environment", "actuator")
        self.rest = loop.start._replace(attitude=loop.first_attitude(), rate=ZERO, torque=ZERO)
        self.setup = loop.setup()
        self._said: Mapping[Stage, Array] = {}
        self._shown: dict[Stage, Array] = {}
        self.mounts: dict[Stage, Any] = {}
        self.stages: list[Stage] = []
        parts = loop.composition()
        sensors = tuple(self._listened(f) for f in loop.used("sensor"))
        estimator = next((self._listened(f) for f in loop.used("estimator")), None)
        self.command = Stage("command", law, (Block("command", "N m"),))
        self.stages.append(self.command)
        pairs = zip(loop.used("effector"), self.setup.effectors, strict=True)
        effectors = tuple(self._watched(f, params) for f, params in pairs)
        self.body = None
        if not any(f.part.flag("ACTS") for f in loop.used("effector")):
            self.body = Stage("torque", ACTUATORS, (Block("torque on the body", "N m"),))
            self.stages.append(self.body)
        self._step = make_step(parts._replace(sensors=sensors, estimator=estimator, effectors=effectors))

    def vectors(self, stimulus: Stimulus, said: Mapping[Stage, Array]) -> dict[Stage, Array]:
        """What each stage shows (SI) where some of those before it show what is said."""
        self._said, self._shown = said, {}
        given = said.get(self.command)
        asked = stimulus.given if given is None else tuple(given.tolist())
        loop, key = self.loop, (0, 0)
        carry = self._step.update(stimulus.carry, 0, key, loop.gains, loop.known, self.setup, asked)
        self._step.sample(carry, 0, self.setup)
        self._shown[self.command] = np.array(carry.command)
        if self.body is not None:
            self._shown[self.body] = np.array(carry.state.torque)
        return self._shown

    def _listened(self, fitted: Fitted) -> Part:
        """A sensor or estimator that tells its vectors in body axes, and takes what is said for them."""
        module, sensor = fitted.part.module, fitted.part.role == "sensor"
        kind = module.Reading if sensor else module.Estimate
        others = [n for n in kind._fields if sensor and n not in self.rest._fields]
        units = {n: quantities(kind)[n] for n in others}
        blocks = [Block(n, "rad" if n == "attitude" else "rad/s") for n in STATED if n in kind._fields]
        blocks += [Block(n, q.unit) for n, q in units.items() if q.dimension == "axis"]
        stage = Stage("reading" if sensor else "estimate", fitted.called, tuple(blocks))
        if not blocks:
            return fitted.part
        self.stages.append(stage)

        def told(value: Any) -> Any:
            parts = [self._turn(value.attitude) if b.name == "attitude" else getattr(value, b.name) for b in blocks]
            vector = self._shown[stage] = np.array(flatten(tuple(parts)))
            if stage not in self._said:
                return value
            vector = self._shown[stage] = self._said[stage]
            new = {b.name: tuple(v.tolist()) for b, v in zip(blocks, vector.reshape(-1, 3), strict=True)}
            return value._replace(**new | ({"attitude": self.turned(new["attitude"])} if "attitude" in new else {}))

        def measure(state: Any, memory: Any, params: Any, dice: Any, step: int) -> Any:
            reading, memory = module.measure(state, memory, params, Silent(), step)
            return told(reading), memory

        def estimate(*given: Any) -> Any:
            value, memory = module.estimate(*given)
            return told(value), memory

        equation = {"measure": measure} if sensor else {"estimate": estimate}
        return replace(fitted.part, module=_Stand(module, **equation))  # pyright: ignore[reportArgumentType]

    def _watched(self, fitted: Fitted, params: Any) -> Part:
        """An effector that tells what each of its units does and its torque, and takes what is said for the first."""
        module: Any = fitted.part.module
        acts = fitted.part.flag("ACTS")
        if not acts and not fitted.part.flag("OUTSIDE"):
            return fitted.part
        state, share, field = fitted.remembered(params), None, ""
        if fitted.part.hook("switch") is not None:
            field = next((name for name in UNITS if hasattr(state, name)), "")
            share = UNITS.get(field)
        elif (motors := module.command(ZERO, params)) is not ZERO:
            share = Block(MOTORS, "N m", len(motors))
        units = Stage("share", fitted.called, () if share is None else (share,))
        torque = Stage("torque", fitted.called, (Block("torque on the body", "N m"),))
        self.stages += [units, torque] if share is not None else [torque]
        act = module.applied if acts else module.reaction

        def units_of(inner: Any, command: Any) -> Any:
            if not field:
                return command
            return inner.dipole if field == "dipole" else tuple(a * b for a, b in zip(inner.firing, inner.left, strict=True))

        def moved(inner: Any, command: Any, vector: Array) -> tuple[Any, Any]:
            if not field:
                return inner, tuple(vector.tolist())
            firing = {"firing": tuple(np.sign(vector).tolist()), "left": tuple(np.abs(vector).tolist())}
            return inner._replace(**{"dipole": tuple(vector.tolist())} if field == "dipole" else firing), command

        def told(inner: Any, command: Any, body: Any, params: Any) -> Any:
            if share is not None:
                self._shown[units] = np.array(units_of(inner, command))
                if units in self._said:
                    inner, command = moved(inner, command, self._said[units])
                    self._shown[units] = self._said[units]
            given = act(inner, command, body, params)
            self._shown[torque] = np.array(given)
            # A rod that is turned acts in the field as it lies; other units take their torque with them.
            lies = lambda m: act(*moved(inner, command, m @ inner.dipole), body, params)  # noqa: E731
            self.mounts[torque] = lies if field == "dipole" else lambda m: m @ np.array(given)
            return given

        def record(*given: Any) -> Any:
            told(*given)
            return module.record(*given)

        equation = {"applied": told} if acts else {"record": record}
        return replace(fitted.part, module=_Stand(module, **equation))  # pyright: ignore[reportArgumentType]

    def _turn(self, attitude: Quaternion) -> Vector:
        return rotation_vector(relative(self.rest.attitude, attitude))

    def turned(self, turn: Vector) -> Quaternion:
        """The attitude after a turn (rad, body axes) of the craft as it rests."""
        angle = norm(turn)
        half = scale(math.sin(0.5 * angle) / angle if angle else 0.5, turn)
        return multiply(self.rest.attitude, (math.cos(0.5 * angle), *half))

    # --- Stimuli ------------------------------------------------------------------------------------------------------

    def stimuli(self, before: str) -> Iterator[Stimulus]:
        """The stimuli of the loop, about each axis; before: with what their names begin."""
        loop, stages = self.loop, self.stages
        fields = [stage for stage in stages if stage.kind == "reading" and stage.blocks[0].name not in STATED]
        turning = tuple(stage for stage in stages if stage not in self._apart())
        for k, axis in enumerate(AXES):
            rate = self.rest._replace(rate=_along(k, TURN))
            yield self._made(f"{before}turn at +10 deg/s about {axis}", rate, None, turning, "rate")
        for k, axis in enumerate(AXES):
            angle = self.rest._replace(attitude=self.turned(_along(k, TURN)))
            yield self._made(f"{before}turn by +10 deg about {axis}", angle, None, turning, "attitude")
        for stage in fields:
            for k, axis in enumerate(AXES):
                if (state := self.facing(stage, k)) is not None:
                    name = stage.blocks[0].name
                    yield self._made(f"{name.replace('_', ' ')} along +{axis}", state, None, (stage,), name)
        acting = tuple(stage for stage in stages if stage.kind in ("share", "torque") and stage not in self._apart())
        limit = min(self.setup.limit, loop.known.torque_limit)
        size = 0.5 * limit if 0.0 < limit < math.inf else 0.01
        rotors = loop.find("wheels")
        magnet = next((stage for stage in fields if stage.blocks[0].name == "magnetic_field"), None)
        for k, axis in enumerate(AXES):
            for words, state in self._fields(
                magnet if any("magnetic_field" in p.reads for p in self._acting()) else None, k
            ):
                live = (*fields, *acting)
                yield self._made(f"{before}torque +{axis}{words}", state, _along(k, size), live)
        for k, axis in enumerate(AXES):
            for words, state in self._fields(magnet, k) if self._apart() and rotors is not None else ():
                stimulus = self._made(f"{before}momentum +{axis}{words}", state, ZERO, (*fields, *self._apart()))
                yield stimulus._replace(carry=self._spun(stimulus.carry, rotors, k))

    def _acting(self) -> list[Part]:
        return [fitted.part for fitted in self.loop.used("effector") if fitted.part.flag("ACTS")]

    def _apart(self) -> tuple[Stage, ...]:
        """The stages of effectors that take no command."""
        names = [fitted.called for fitted in self.loop.used("effector") if not fitted.part.flag("ACTS")]
        return tuple(stage for stage in self.stages if stage.kind in ("share", "torque") and stage.part in names)

    def _fields(self, magnet: Stage | None, k: int) -> Iterator[tuple[str, Any]]:
        """The craft as it rests; or with the magnetic field along each of the two other axes."""
        if magnet is None:
            yield "", self.rest
            return
        for other in ((k + 1) % 3, (k + 2) % 3):
            if (state := self.facing(magnet, other)) is not None:
                yield f", field +{AXES[other]}", state

    def _made(self, name: str, state: Any, given: Any, live: tuple[Stage, ...], *shown: str) -> Stimulus:
        return Stimulus(name, self.loop.carry(state), given, live, shown, self)

    def _spun(self, carry: Any, rotors: Fitted, k: int) -> Any:
        """The carry with a third of the momentum that the wheels hold about an axis, shared as they share a torque."""
        module, place = rotors.part.module, self.loop.used("effector").index(rotors)
        params = self.setup.effectors[place]
        most = min(params.momentum_limit)
        momenta = module.command(_along(k, -most / 3.0 if math.isfinite(most) else -1.0), params)
        effectors = list(carry.effectors)
        effectors[place] = module.State(momenta)
        return carry._replace(effectors=tuple(effectors))

    def facing(self, stage: Stage, k: int) -> Any:
        """The craft turned so that the first vector of a sensor lies along an axis; None where it shows none."""
        place = [fitted.called for fitted in self.loop.used("sensor")].index(stage.part)
        fitted, params = self.loop.used("sensor")[place], self.setup.sensors[place]

        def shown(attitude: Quaternion) -> Vector:
            state = self.rest._replace(attitude=attitude)
            dice = Silent()
            reading, _ = fitted.part.module.measure(state, fitted.remembered(params, state), params, dice, 0)
            return getattr(reading, stage.blocks[0].name)

        # A sensor may see one side alone.
        sides = (NO_TURN, (0.0, 1.0, 0.0, 0.0), *((1.0, *_along(j, s)) for j in range(3) for s in (1.0, -1.0)))
        for side in map(normalise, sides):
            vector = to_reference(side, shown(side))
            if (size := norm(vector)) > 0.0:
                attitude = _turning(scale(1.0 / size, vector), _along(k, 1.0))
                return self.rest._replace(attitude=attitude) if norm(shown(attitude)) > 0.0 else None
        return None


def _along(k: int, size: float) -> Any:
    return tuple(size if place == k else 0.0 for place in range(3))


def _turning(vector: Vector, axis: Vector) -> Quaternion:
    """An attitude in which the body components of an inertial unit vector are those of `axis`."""
    across = cross(axis, vector)
    if dot(axis, vector) < -0.9:
        # Half a turn about whatever is perpendicular comes first.
        other = normalise((0.0, *cross(axis, (axis[1], axis[2], axis[0]))))
        return multiply(_turning(scale(-1.0, vector), axis), other)
    return normalise((1.0 + dot(axis, vector), *across))


@dataclass(frozen=True)
class Sheet:
    """A sheet of a law: its cells, the stages in the order of the loop, the stimuli, and sentences about what is not
    tested."""

    cells: list[Cell]
    stages: list[Stage]
    stimuli: list[Stimulus]
    notes: list[str]


def sheet_of(loop: ClosedLoop, law: str) -> Sheet:
    """The sheet of a loop; of a law made of modes for each mode, without what an earlier one shows."""
    modes = mode_laws(loop.law, loop.gains)
    loops = [(f"{mode}: ", loop_of_mode(loop, place), mode) for place, (mode, _, _) in enumerate(modes)]
    benches = [(before, Bench(alone, name)) for before, alone, name in loops or [("", loop, law)]]
    stages = sorted(dict.fromkeys(s for _, b in benches for s in b.stages), key=lambda s: ORDER.index(s.kind))
    every: dict[str, Stimulus] = {}
    for before, bench in benches:
        for stimulus in bench.stimuli(before):
            every.setdefault(stimulus.name, stimulus)
    stimuli = list(every.values())
    seen: set[Any] = set()
    cells: list[Cell] = []
    expected = [stimulus.bench.vectors(stimulus, {}) for stimulus in stimuli]
    most: dict[tuple[str, str], float] = {}
    for vectors in expected:
        for stage, vector in vectors.items():
            for block, first in blocks_of(stage):
                size = float(np.abs(vector[first : first + block.size]).max())
                most[stage.part, block.name] = max(size, most.get((stage.part, block.name), 0.0))
    for place, (stimulus, vectors) in enumerate(zip(stimuli, expected, strict=True)):
        for number, stage in enumerate(stages):
            if stage not in stimulus.live:
                continue
            for block, first in blocks_of(stage):
                shown = block.name in stimulus.shown or stage.kind not in ("reading", "estimate")
                vector = vectors[stage][first : first + block.size]
                size = float(np.abs(vector).max())
                base = (stimulus.name.rpartition(": ")[2], stage, block, tuple(np.round(vector, 12)))
                if not shown or size <= NOTHING * most[stage.part, block.name] or base in seen:
                    continue
                seen.add(base)
                unit, factor = (
                    (block.unit.replace("rad", "deg"), math.degrees(1.0)) if "rad" in block.unit else (block.unit, 1.0)
                )
                for k, value in enumerate(np.where(np.abs(vector) < NOTHING * size, 0.0, vector)):
                    sign = "0" if abs(value) < SMALL * size else "+" if value > 0.0 else "-"
                    name = f"{stage.part}: {block.name.replace('_', ' ')}"
                    tail = (place, number), first + k, (first, first + block.size)
                    cells.append(
                        Cell(stimulus.name, name, block.labels[k], sign, float(f"{factor * value:.6g}"), unit, *tail)
                    )
    return Sheet(cells, stages, stimuli, _notes(loop, cells, [bench.command.part for _, bench in benches]))


def _notes(loop: ClosedLoop, cells: Sequence[Cell], laws: Sequence[str]) -> list[str]:
    """Sentences about what the sheet does not test."""
    shown = {cell.stage.partition(":")[0] for cell in cells}
    parts = [f.called for role in ("sensor", "estimator", "effector") for f in loop.used(role)]
    notes = [f"{name}: no stimulus of this sheet moves it in body axes." for name in parts if name not in shown]
    notes += [f"{f.called}: it passes the command on in time; the sheet leaves it out." for f in loop.used("actuator")]
    silent = [name for name in laws if name not in shown]
    notes += [f"{name}: this law asks for nothing at its first instant; the sheet begins with a torque." for name in silent]
    if not loop.used("sensor"):
        notes.insert(0, "The loop has no sensors: the law is given the state as it is.")
    return notes


ORDER = ("reading", "estimate", "command", "share", "torque")


def blocks_of(stage: Stage) -> Iterator[tuple[Block, int]]:
    """The blocks of a stage, each with the place at which it begins."""
    first = 0
    for block in stage.blocks:
        yield block, first
        first += block.size
