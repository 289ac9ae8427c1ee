"""Slews at the start of modes: a mode's target is reached on a path of `parts.targets.eigenaxis` from the present
attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from starhold.algebra.quaternion import NO_TURN, Quaternion, relative, to_body
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import Vector
from starhold.algebra.words import number_of
from starhold.parts import sun
from starhold.parts.part import Fitted, Part
from starhold.parts.roles import Goal
from starhold.parts.targets.eigenaxis import Cone, Leg, onto, turned, turns_of, within

RESTING = Leg((1.0, 0.0, 0.0), 0.0, 0.0, 0.0)


class Slew(NamedTuple):
    """The largest rate (rad/s), acceleration (rad/s2) and torque about each body axis (N m) of a slew, its keep-out cone,
    and the Sun at the start (each () for none)."""

    rate: Scalar
    acceleration: Scalar
    torque_limit: Scalar
    cone: Cone | tuple[()] = ()
    sun: sun.Numbers | tuple[()] = ()


class Followed(NamedTuple):
    """The target's attitude at the previous step, the control step at which the present mode began, the attitude then,
    relative to the mode's target, and the turns of the path."""

    attitude: Quaternion
    begin: Scalar
    start: Quaternion
    legs: tuple[Leg, ...]


class Reached(NamedTuple):
    """The numbers of a target reached by a slew, and the control period (s)."""

    target: Any
    slew: Slew
    period: Scalar


@dataclass(frozen=True)
class Slewing:
    """Replaces the module of a target reached by a slew."""

    part: Part
    ROLE = "target"
    FOLLOWS = True
    STILL = False

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "part":
            raise AttributeError(name)
        return getattr(self.part.module, name)

    def needs(self, params: tuple[Any, Slew]) -> tuple[str, ...]:
        """Return the parts that the target itself needs."""
        return Fitted(self.part, params[0]).needs

    def about(self, params: tuple[Any, Slew]) -> str:
        """Return the only body that the target itself may orbit."""
        return Fitted(self.part, params[0]).about

    def prepare(self, params: tuple[Any, Slew], period: float) -> Reached:
        """Return the numbers of the target and of the slew in the form that equations take."""
        return Reached(Fitted(self.part, params[0]).prepared(period), params[1], period)

    def check(self, params: Reached, craft: Any) -> None:
        """Raise ValueError if the target itself does not fit a craft."""
        examine = self.part.hook("check")
        if examine is not None:
            examine(params.target, craft)

    def goal(self, params: Reached, state: Any, step: Any, before: Followed) -> Goal:
        """Return the goal at this control step on the path to the target."""
        reached = self.part.module.goal(params.target, state, step, before.attitude)
        path = turned(before.start, before.legs, (number_of(step) - before.begin) * params.period)
        return onto(reached, path, before.attitude)

    def begun(self, params: Reached, state: Any, attitude: Quaternion, step: Any, craft: Any, before: Followed) -> Followed:
        """Return the memory with the path that begins at this control step from an attitude."""
        goal, slew = self.part.module.goal(params.target, state, step, before.attitude), params.slew
        start, seen = relative(goal.attitude, attitude), _sun(goal, step, params)
        turns, _ = turns_of(start, NO_TURN, slew.cone, seen)
        legs = tuple(within(turn, slew.rate, slew.acceleration, slew.torque_limit, craft.inertia) for turn in turns)
        legs += (RESTING,) * (len(before.legs) - len(legs))
        return Followed(before.attitude, number_of(step), start, legs)


def _sun(goal: Goal, step: Any, params: Reached) -> Vector:
    """Return the direction of the Sun in the target's axes, if a cone needs it."""
    if not params.slew.cone:
        return (0.0, 0.0, 0.0)
    seen = sun.sun(number_of(step) * params.period, params.slew.sun)  # pyright: ignore[reportArgumentType]
    return to_body(goal.attitude, seen.direction)


def slewing(target: Fitted, slew: Slew | None) -> Fitted:
    """Return the target reached by a slew, or the target itself if `slew` is None."""
    if slew is None:
        return target
    module: Any = Slewing(target.part)
    return Fitted(Part(f"slew-onto-{target.part.name}", module, target.part.file), (target.params, slew))


def reached(target: Fitted) -> Fitted:
    """Return the target itself, without its slew."""
    module: Any = target.part.module
    return Fitted(module.part, target.params[0]) if isinstance(module, Slewing) else target
