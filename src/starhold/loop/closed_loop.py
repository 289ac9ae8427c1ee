"""A closed loop: a body, a law and the parts around them. Only here are law and plant connected."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.structure import alike, leaves
from starhold.algebra.vector import ZERO, Vector, apply
from starhold.laws.catalogue import Law
from starhold.parts.catalogue import find
from starhold.parts.contract import NoMemory
from starhold.parts.part import Fitted, Part
from starhold.parts.roles import Goal
from starhold.parts.targets.inertial import Params as Inertial

Limit = Literal["axis", "norm", "none"]
SignPolicy = Literal["as_published", "shortest", "hysteresis"]
ON_TARGET = Fitted(find("target", "inertial"), Inertial())
"""The inertial axes as a target."""


class Setup(NamedTuple):
    """The numbers of a loop besides those of craft and law, an argument of kernels. Those of parts are in the order of the
    loop; limit: the saturation limit of the command; divergence_bound: the distance beyond which the motion has diverged."""

    period: float
    substep: float
    limit: float
    width: float
    divergence_bound: float
    target: Any
    environments: tuple[Any, ...]
    effectors: tuple[Any, ...]
    sensors: tuple[Any, ...]
    estimator: Any
    actuators: tuple[Any, ...]
    watchers: tuple[Any, ...] = ()


class Composition(NamedTuple):
    """The parts whose equations make up a loop; one kernel flies all loops of equal composition with numbers of the same
    form. watchers: the estimators that the law does not use; starters: for the law's estimator and each of them the index,
    in this order, of the one that starts it, -1 for none; () if none is started."""

    body: Part
    law: Law
    target: Part | None
    environments: tuple[Part, ...]
    effectors: tuple[Part, ...]
    sensors: tuple[Part, ...]
    estimator: Part | None
    actuators: tuple[Part, ...]
    limit: Limit
    sign_policy: str
    watchers: tuple[Part, ...] = ()
    starters: tuple[int, ...] = ()


class Memories(NamedTuple):
    """The memories of parts from one control step to the next, in the order of the loop; `followed` is the target's
    attitude at the previous step, for a target that continues from it; `readings` are the recorded readings, followed by
    the estimates of watchers."""

    followed: Any
    environments: tuple[Any, ...]
    sensors: tuple[Any, ...]
    readings: tuple[Any, ...]
    estimator: Any
    estimate: Any
    watchers: tuple[Any, ...] = ()


class Carry(NamedTuple):
    """The quantities that a trajectory carries from step to step: the states of the body, of the effectors, and of
    actuators followed by another actuator; the memories of the law and the other parts, the sign h = +-1 of the quaternion
    policy, the command, and the control step at which the motion diverged (-1: none)."""

    state: Any
    effectors: tuple[Any, ...]
    actuators: tuple[Vector, ...]
    memory: Any
    memories: Memories
    h: Any
    command: Vector
    lost_at: float


class Event(NamedTuple):
    """A change at a control step: the parts, gains and craft from then on, and the law's nominal model of the craft."""

    step: int
    parts: tuple[Fitted, ...]
    gains: Any
    craft: Any
    nominal: Any


class Phase(NamedTuple):
    """Control steps first .. last-1 of a run, and their numbers."""

    first: int
    last: int
    gains: Any
    nominal: Any
    craft: Any
    setup: Setup
    before: Any
    """The craft in the previous phase."""

    @property
    def jumps(self) -> bool:
        """Whether the body's rate jumps as the phase begins."""
        pairs = zip(leaves(self.craft), leaves(self.before), strict=True)
        return hasattr(self.craft, "inertia") and not all(np.array_equal(*pair) for pair in pairs)

    def rate_from(self, rate: Vector) -> Vector:
        """Return the body's rate (rad/s) at the start of the phase from that at the end of the previous one: a change of
        inertia conserves the angular momentum."""
        pairs = zip(leaves(self.craft.inertia), leaves(self.before.inertia), strict=True)
        if all(np.array_equal(*pair) for pair in pairs):
            return rate
        return apply(self.craft.inverse_inertia, apply(self.before.inertia, rate))

    def entered(self, carry: Carry) -> Carry:
        """Return the carry with which the phase begins."""
        return carry._replace(state=carry.state._replace(rate=self.rate_from(carry.state.rate))) if self.jumps else carry


@dataclass(frozen=True)
class ClosedLoop:
    """One law on one body in one environment; SI units and radians, or the body's scaled ones.

    craft: the numbers of the body; start: its state; parts: all other parts of the loop. The order of roles does not matter;
    within a role, torques add up and the command passes through actuators in the order given."""

    craft: Any
    law: Law
    gains: Any
    start: Any
    period: float
    substeps: int = 1
    parts: tuple[Fitted, ...] = ()
    limit: Limit = "axis"
    command_limit: float | None = None
    """The saturation limit of the command (N m), per axis or in norm as `limit` says; None: the craft's torque limit, which
    the law knows. If effectors state the torque that they can always give, the law knows that one; beyond it they
    saturate."""
    sign_policy: SignPolicy = "as_published"
    hysteresis_width: float = 0.5
    divergence_bound: float = 1e3
    seed: int = 1
    run: int = 0
    """The number of the run, which together with the seed determines the random numbers."""
    events: tuple[Event, ...] = ()
    """Changes during a run, in order of time."""
    nominal: Any = None
    """The law's nominal model of the craft; None: the true craft."""

    @property
    def known(self) -> Any:
        """The law's nominal model of the craft at the start."""
        return self.craft if self.nominal is None else self.nominal

    @property
    def body(self) -> Part:
        """The body: the one among the parts, else the installed one for which the law is made."""
        bodies = self.used("body")
        return bodies[0].part if bodies else find("body", self.law.body)

    def used(self, role: str) -> tuple[Fitted, ...]:
        """Return the parts of a role; an estimator that the law does not use has the role "watcher"."""
        return tuple(fitted for fitted in self.parts if fitted.role == role)

    @property
    def estimating(self) -> tuple[Fitted, ...]:
        """The law's estimator, if any, and those that watch."""
        return (*self.used("estimator"), *self.used("watcher"))

    def find(self, name: str) -> Fitted | None:
        """Return the first part whose file has this name."""
        return next((fitted for fitted in self.parts if fitted.part.name == name), None)

    def has(self, name: str) -> bool:
        """Return whether the loop has a part of this name."""
        return self.find(name) is not None

    def with_parts(self, *more: Fitted) -> Self:
        """Return the loop with these parts in place of parts of the same name, or after the others."""
        kept, new = list(self.parts), list(more)
        for place, fitted in enumerate(kept):
            same = next((one for one in new if one.part.name == fitted.part.name), None)
            if same is not None:
                kept[place] = same
                new.remove(same)
        return replace(self, parts=(*kept, *new))

    def without(self, *words: str) -> Self:
        """Return the loop without the parts of these roles or names."""
        return replace(self, parts=tuple(f for f in self.parts if f.part.role not in words and f.part.name not in words))

    @property
    def wheels(self) -> Any:
        """The reaction wheels as used in claims, or None."""
        fitted = self.find("wheels")
        return None if fitted is None else fitted.params

    @property
    def rotors(self) -> tuple[float, ...]:
        """The angular momenta of their rotors at the start (N m s)."""
        fitted = self.find("wheels")
        return () if fitted is None else fitted.start.momentum

    @property
    def wheel_axes(self) -> tuple[Vector, ...]:
        """The spin axes of the reaction wheels (body); none without wheels."""
        return () if self.wheels is None else self.wheels.axes

    @property
    def stored(self) -> NDArray[np.float64]:
        """The angular momentum (3,) of the rotors at the start (body, N m s); zero without wheels."""
        return np.array(self.rotors) @ np.reshape(self.wheel_axes, (-1, 3))

    @property
    def target(self) -> Fitted:
        """The target; the inertial axes by default."""
        return next(iter(self.used("target")), ON_TARGET)

    def saturation_limit(self) -> float:
        """Return the saturation limit of the command; infinite without one."""
        return getattr(self.craft, "torque_limit", np.inf) if self.command_limit is None else self.command_limit

    def as_commanded(self) -> Self:
        """Return the loop without the estimators that are neither used by the law nor start its estimator."""
        there = {fitted.called: fitted for fitted in self.estimating}
        needed, now = list[str](), next(iter(self.used("estimator")), None)
        while now is not None:
            needed, now = [*needed, now.called], there.get(now.started_by)
        kept = tuple(f for f in self.parts if not f.watches or f.called in needed)
        return self if kept == self.parts else replace(self, parts=kept)

    def composition(self) -> Composition:
        """The parts whose equations make up this loop."""
        estimator = next(iter(self.used("estimator")), None)
        roles = ("environment", "effector", "sensor", "actuator", "watcher")
        used = {role: tuple(f.part for f in self.used(role)) for role in roles}
        names = [fitted.called for fitted in self.estimating]
        starters = [names.index(fitted.started_by) if fitted.started_by else -1 for fitted in self.estimating]
        return Composition(
            self.body,
            self.law,
            self.target.part if self.aims else None,
            used["environment"],
            used["effector"],
            used["sensor"],
            None if estimator is None else estimator.part,
            used["actuator"],
            self.limit,
            self.sign_policy if self.body.flag("SIGN_POLICIES") else "",
            used["watcher"],
            tuple(starters) if any(place >= 0 for place in starters) else (),
        )

    @property
    def aims(self) -> bool:
        """Whether the body is to follow an attitude."""
        return "attitude" in self.body.module.State._fields

    @property
    def fastest(self) -> Fitted | None:
        """The part with the fastest dynamics, which the integration must resolve."""
        every = (*self.parts, *(fitted for event in self.events for fitted in event.parts))
        return max((fitted for fitted in every if fitted.fastest > 0.0), key=lambda fitted: fitted.fastest, default=None)

    @property
    def remembers(self) -> bool:
        """Whether the law keeps a memory from one call to the next."""
        return any(True for _ in leaves(self.law.remember(self.gains, self.known, self.period)))

    def setup(self) -> Setup:
        """The numbers of this loop."""
        return self._setup

    @cached_property
    def _setup(self) -> Setup:
        # Each flight asks for it several times, and to prepare parts takes as long as a thousand control steps.

        def prepared(role: str) -> tuple[Any, ...]:
            return tuple(fitted.prepared(self.period) for fitted in self.used(role))

        return Setup(
            self.period,
            self.period / self.substeps,
            self.saturation_limit(),
            self.hysteresis_width,
            self.divergence_bound,
            self.target.prepared(self.period) if self.aims else (),
            prepared("environment"),
            prepared("effector"),
            prepared("sensor"),
            next(iter(prepared("estimator")), ()),
            prepared("actuator"),
            prepared("watcher"),
        )

    def after(self, event: Event) -> Self:
        """Return the loop as it is from an event on, without further events."""
        return replace(self, events=(), craft=event.craft, gains=event.gains, parts=event.parts)

    def phases(self, steps: int) -> list[Phase]:
        """Return the phases of a run of `steps` control steps, divided at the events."""
        events = (Event(0, self.parts, self.gains, self.craft, self.known), *self.events)
        # Gains and crafts have the same form in all phases, so that one kernel serves them all.
        gains = alike([event.gains for event in events])
        crafts = alike([event.craft for event in events] + [event.nominal for event in events])
        lasts = [*(min(event.step, steps) for event in self.events), steps]
        phases: list[Phase] = []
        before = crafts[0]
        for event, last, law_gains, craft, nominal in zip(events, lasts, gains, crafts, crafts[len(events) :], strict=False):
            if last > event.step:
                loop = self if event.parts is self.parts else replace(self, parts=event.parts)
                phases.append(Phase(event.step, last, law_gains, nominal, craft, loop.setup(), before))
                before = craft
        return phases

    def carry(self, start: Any = None, gains: Any = None, nominal: Any = None, setup: Setup | None = None) -> Carry:
        """Return the carry at the start of a trajectory, if given with another state of the body, gains, nominal model or
        setup."""
        start, setup = self.start if start is None else start, setup or self.setup()
        memory = self.law.remember(gains or self.gains, nominal or self.known, self.period)
        goal = self._goal(start, setup) if self.aims else None
        h = () if goal is None else self.body.module.side_of(start, goal)
        sensors, estimator = self.used("sensor"), next(iter(self.used("estimator")), None)
        kept = NoMemory() if estimator is None else estimator.remembered(setup.estimator, start)
        watchers = self.used("watcher")
        watching = tuple(f.remembered(numbers, start) for f, numbers in zip(watchers, setup.watchers, strict=True))
        watched = [before_first(f.part, start, memory) for f, memory in zip(watchers, watching, strict=True)]
        memories = Memories(
            self._followed(goal.attitude, setup) if goal is not None and self.target.part.flag("FOLLOWS") else NoMemory(),
            tuple(f.remembered(numbers) for f, numbers in zip(self.used("environment"), setup.environments, strict=True)),
            tuple(f.remembered(numbers, start) for f, numbers in zip(sensors, setup.sensors, strict=True)),
            (*(before_first(f.part, start) for f in sensors if is_recorded(f.part)), *watched),
            kept,
            () if estimator is None else before_first(estimator.part, start, kept),
            watching,
        )
        effectors = tuple(f.remembered(numbers) for f, numbers in zip(self.used("effector"), setup.effectors, strict=True))
        followed = sum(f.part.hook("rates") is not None for f in self.used("actuator"))
        return Carry(start, effectors, (ZERO,) * (followed - 1), memory, memories, h, ZERO, -1.0)

    def first_attitude(self) -> Any:
        """Return the initial attitude of a target that does not depend on the state."""
        return self._goal(self.start, self.setup()).attitude

    def _goal(self, start: Any, setup: Setup) -> Goal:
        """Return the goal at the start."""
        mode = (0.0,) if self.target.part.flag("BY_MODE") else ()
        return self.target.part.module.goal(setup.target, start, 0, self._followed((1.0, 0.0, 0.0, 0.0), setup), *mode)

    def _followed(self, attitude: Quaternion, setup: Setup) -> Any:
        """Return the initial memory of the target, which continues from this attitude."""
        first = self.target.part.hook("first")
        return attitude if first is None else first(setup.target, attitude)


def is_recorded(sensor: Part) -> bool:
    """Return whether a sensor's readings are recorded."""
    return getattr(sensor.module, "RECORDED", True)


def can_be_inactive(effector: Part) -> bool:
    """Return whether a mode can fly without this effector, because it takes the command or its torque is external."""
    return effector.flag("ACTS") or effector.flag("OUTSIDE")


def before_first(part: Part, state: Any, memory: Any = None) -> Any:
    """Return a sensor's reading or an estimator's estimate before the first one: the part's `FIRST`, else the fields of the
    same names in the estimator's initial memory, else in the body's state. Raise ValueError if there are none."""
    kind: Any = part.module.Estimate if part.role == "estimator" else part.module.Reading
    first = getattr(part.module, "FIRST", {})
    for name in kind._fields:
        if not hasattr(state, name) and (not isinstance(first, dict) or name not in first):
            example = f'FIRST = {{"{name}": 0.0}}'
            raise ValueError(f"{name} is no field of the body's state: give it before the first control step, {example}")
    values = (first[name] if name in first else getattr(memory, name, getattr(state, name, None)) for name in kind._fields)
    return kind(*values)
