"""A loop on a test bench: the flown equations give the output of each stage under stimuli by hand or by coil."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quantity import quantities
from starhold.algebra.quaternion import NO_TURN, Quaternion, multiply, normalise, relative, to_reference
from starhold.algebra.rotation import rotation_vector
from starhold.algebra.scalar import sign
from starhold.algebra.structure import flatten
from starhold.algebra.vector import ZERO, Vector, cross, dot, norm, scale, times
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.part import Fitted, Part
from starhold.parts.random import Silent

Array: TypeAlias = NDArray[np.float64]
AXES = "xyz"
TURN = math.radians(10.0)
"""The craft is turned by this angle (rad), and at this rate (rad/s)."""
STATED = ("attitude", "rate")
"""Quantities of the body's state with components in body axes; the attitude as the turn from the target."""


class Block(NamedTuple):
    """A vector that a stage outputs: its name, unit and number of components."""

    name: str
    unit: str
    size: int = 3

    @property
    def labels(self) -> list[str]:
        """The names of its components."""
        return list(AXES) if self.size == 3 and self.name != MOTORS else [str(k + 1) for k in range(self.size)]


MOTORS, TORQUE, ACTUATORS = "motor torque", "torque on the body", "actuators"
"""The names of the torque of each wheel, of the torque on the body, and of its source in a loop without effectors."""
UNITS: dict[str, tuple[Block, Any, Any]] = {
    "dipole": (Block("dipole", "A m^2"), lambda s: s.dipole, lambda s, v: s._replace(dipole=v)),
    "firing": (
        Block("time on", "s"),
        lambda s: times(s.firing, s.left),
        lambda s, v: s._replace(firing=tuple(map(sign, v)), left=tuple(map(abs, v))),
    ),
}
"""For effectors with `switch`, by a field of their state: the block for the outputs of the units, the function that reads
these from a state, and the function that returns a state with other outputs."""


class Stage(NamedTuple):
    """A stage of the loop: the output of a part for the outputs of the stages before it; kind: "reading", "estimate",
    "command", "share" (of each unit of an effector) or "torque" (on the body)."""

    kind: str
    part: str
    blocks: tuple[Block, ...]


ORDER = ("reading", "estimate", "command", "share", "torque")


def blocks_of(stage: Stage) -> Iterator[tuple[Block, int]]:
    """Yield the blocks of a stage, each with the index of its first component."""
    first = 0
    for block in stage.blocks:
        yield block, first
        first += block.size


class Stimulus(NamedTuple):
    """A stimulus: its description, the carry of the loop, the commanded torque (None: the law commands), the stages that
    respond to it, and the quantities of sensors and estimator in the sheet."""

    name: str
    carry: Any
    given: Vector | None
    live: tuple[Stage, ...]
    shown: tuple[str, ...]
    bench: Bench


class _Stand:
    """A stand-in for the module of a part, with some of its equations replaced."""

    def __init__(self, module: Any, **equations: Any) -> None:
        self.__dict__ |= equations | {"_module": module}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


class Bench:
    """A loop at rest on target, without environment, sensor noise or rotor spin."""

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
            self.body = Stage("torque", ACTUATORS, (Block(TORQUE, "N m"),))
            self.stages.append(self.body)
        self._step = make_step(parts._replace(sensors=sensors, estimator=estimator, effectors=effectors))

    def vectors(self, stimulus: Stimulus, said: Mapping[Stage, Array]) -> dict[Stage, Array]:
        """Return the output of each stage (SI), with the outputs of some stages replaced by those in `said`."""
        self._said, self._shown = said, {}
        given = said.get(self.command)
        wanted = stimulus.given if given is None else tuple(given.tolist())
        loop, key = self.loop, (0, 0)
        carry = self._step.update(stimulus.carry, 0, key, loop.gains, loop.known, self.setup, wanted)
        self._step.sample(carry, 0, self.setup)
        self._shown[self.command] = np.array(carry.command)
        if self.body is not None:
            self._shown[self.body] = np.array(carry.state.torque)
        return self._shown

    def _listened(self, fitted: Fitted) -> Part:
        """Return a sensor or estimator that outputs its vectors in body axes and accepts others in their place."""
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

        def heard(value: Any) -> Any:
            parts = [self._turn(value.attitude) if b.name == "attitude" else getattr(value, b.name) for b in blocks]
            vector = self._shown[stage] = np.array(flatten(tuple(parts)))
            if stage not in self._said:
                return value
            vector = self._shown[stage] = self._said[stage]
            new = {b.name: tuple(v.tolist()) for b, v in zip(blocks, vector.reshape(-1, 3), strict=True)}
            return value._replace(**new | ({"attitude": self.turned(new["attitude"])} if "attitude" in new else {}))

        def measure(state: Any, memory: Any, params: Any, dice: Any, step: int) -> Any:
            reading, memory = module.measure(state, memory, params, Silent(), step)
            return heard(reading), memory

        def estimate(*given: Any) -> Any:
            value, memory = module.estimate(*given)
            return heard(value), memory

        equation = {"measure": measure} if sensor else {"estimate": estimate}
        return replace(fitted.part, module=_Stand(module, **equation))  # pyright: ignore[reportArgumentType]

    def _watched(self, fitted: Fitted, params: Any) -> Part:
        """Return an effector that outputs its torque and those of its units, and accepts other values for the units."""
        module: Any = fitted.part.module
        acts = fitted.part.flag("ACTS")
        if not acts and not fitted.part.flag("OUTSIDE"):
            return fitted.part
        state, share, field = fitted.remembered(params), None, ""
        if fitted.part.hook("switch") is not None:
            field = next((name for name in UNITS if hasattr(state, name)), "")
            share = UNITS[field][0] if field else None
        elif (motors := module.command(ZERO, params)) is not ZERO:
            share = Block(MOTORS, "N m", len(motors))
        units = Stage("share", fitted.called, () if share is None else (share,))
        torque = Stage("torque", fitted.called, (Block(TORQUE, "N m"),))
        self.stages += [units, torque] if share is not None else [torque]
        act = module.applied if acts else module.reaction

        def moved(inner: Any, command: Any, vector: Array) -> tuple[Any, Any]:
            values = tuple(vector.tolist())
            return (UNITS[field][2](inner, values), command) if field else (inner, values)

        def heard(inner: Any, command: Any, body: Any, params: Any) -> Any:
            if share is not None:
                self._shown[units] = np.array(UNITS[field][1](inner) if field else command)
                if units in self._said:
                    inner, command = moved(inner, command, self._said[units])
                    self._shown[units] = self._said[units]
            given = act(inner, command, body, params)
            self._shown[torque] = np.array(given)
            # A rotated rod acts on the field in its new direction; the torque of other units rotates with them.
            lies = lambda m: act(*moved(inner, command, m @ inner.dipole), body, params)  # noqa: E731
            self.mounts[torque] = lies if field == "dipole" else lambda m: m @ np.array(given)
            return given

        def record(*given: Any) -> Any:
            heard(*given)
            return module.record(*given)

        equation = {"applied": heard} if acts else {"record": record}
        return replace(fitted.part, module=_Stand(module, **equation))  # pyright: ignore[reportArgumentType]

    def _turn(self, attitude: Quaternion) -> Vector:
        return rotation_vector(relative(self.rest.attitude, attitude))

    def turned(self, turn: Vector) -> Quaternion:
        """Return the attitude after a turn (rad, body axes) of the resting craft."""
        angle = norm(turn)
        half = scale(math.sin(0.5 * angle) / angle if angle else 0.5, turn)
        return multiply(self.rest.attitude, (math.cos(0.5 * angle), *half))

    # --- Stimuli ------------------------------------------------------------------------------------------------------

    def stimuli(self, before: str) -> Iterator[Stimulus]:
        """Yield the stimuli of the loop about each axis; before: the beginning of their names."""
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
        by_field = any("magnetic_field" in f.part.reads for f in loop.used("effector") if f.part.flag("ACTS"))
        magnet = next((stage for stage in fields if stage.blocks[0].name == "magnetic_field"), None)
        for k, axis in enumerate(AXES):
            for words, state in self._fields(magnet if by_field else None, k):
                yield self._made(f"{before}torque +{axis}{words}", state, _along(k, size), (*fields, *acting))
        if rotors is None or not self._apart():
            return
        for k, axis in enumerate(AXES):
            for words, state in self._fields(magnet, k):
                stimulus = self._made(f"{before}momentum +{axis}{words}", state, ZERO, (*fields, *self._apart()))
                yield stimulus._replace(carry=self._spun(stimulus.carry, rotors, k))

    def _apart(self) -> tuple[Stage, ...]:
        """Return the stages of effectors that take no command."""
        names = [fitted.called for fitted in self.loop.used("effector") if not fitted.part.flag("ACTS")]
        return tuple(stage for stage in self.stages if stage.kind in ("share", "torque") and stage.part in names)

    def _fields(self, magnet: Stage | None, k: int) -> Iterator[tuple[str, Any]]:
        """Yield the state of the craft at rest, or with a magnet, with the field along each of the two other axes."""
        if magnet is None:
            yield "", self.rest
            return
        for other in ((k + 1) % 3, (k + 2) % 3):
            if (state := self.facing(magnet, other)) is not None:
                yield f", field +{AXES[other]}", state

    def _made(self, name: str, state: Any, given: Any, live: tuple[Stage, ...], *shown: str) -> Stimulus:
        return Stimulus(name, self.loop.carry(state), given, live, shown, self)

    def _spun(self, carry: Any, rotors: Fitted, k: int) -> Any:
        """Return the carry with a third of the momentum that the wheels can store about an axis, allocated like a torque."""
        module, place = rotors.part.module, self.loop.used("effector").index(rotors)
        params = self.setup.effectors[place]
        most = min(params.momentum_limit)
        momenta = module.command(_along(k, -most / 3.0 if math.isfinite(most) else -1.0), params)
        effectors = list(carry.effectors)
        effectors[place] = module.State(momenta)
        return carry._replace(effectors=tuple(effectors))

    def facing(self, stage: Stage, k: int) -> Any:
        """Return the state of the craft turned so that the first vector of a sensor lies along an axis; None without one."""
        place = [fitted.called for fitted in self.loop.used("sensor")].index(stage.part)
        fitted, params = self.loop.used("sensor")[place], self.setup.sensors[place]

        def shown(attitude: Quaternion) -> Vector:
            state = self.rest._replace(attitude=attitude)
            dice = Silent()
            reading, _ = fitted.part.module.measure(state, fitted.remembered(params, state), params, dice, 0)
            return getattr(reading, stage.blocks[0].name)

        # A sensor may see only one side.
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
    """Return an attitude in which the body components of an inertial unit vector are those of `axis`."""
    across = cross(axis, vector)
    if dot(axis, vector) < -0.9:
        # Half a turn about any perpendicular axis comes first.
        other = normalise((0.0, *cross(axis, (axis[1], axis[2], axis[0]))))
        return multiply(_turning(scale(-1.0, vector), axis), other)
    return normalise((1.0 + dot(axis, vector), *across))
