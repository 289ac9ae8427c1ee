"""Targets and effectors of the modes of a law: each mode may have its own target, and its law can fly alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.scalar import both, less
from starhold.algebra.structure import chosen
from starhold.algebra.structured import when
from starhold.algebra.vector import ZERO
from starhold.laws.modes import is_mode, mode_laws
from starhold.loop.closed_loop import ClosedLoop, can_be_inactive
from starhold.loop.slews import RESTING, Followed, Slew, Slewing, reached, slewing
from starhold.parts.contract import Card
from starhold.parts.part import Fitted, Part
from starhold.parts.roles import Goal


@dataclass(frozen=True)
class ModeTargets:
    """Replaces a target's module by the target of the present mode; `goal` takes the mode, counted from 0."""

    parts: tuple[Part, ...]
    ROLE = "target"
    BY_MODE = True

    @property
    def CARD(self) -> Card:  # noqa: N802
        """The card of the targets of all modes."""
        names = ", ".join(part.name for part in self.parts)
        return Card("Targets of modes", names, ("definition",), ())

    def needs(self, params: tuple[Any, ...]) -> tuple[str, ...]:
        """Return the parts that any of the targets needs."""
        return tuple(dict.fromkeys(need for target in self._fitted(params) for need in target.needs))

    def about(self, params: tuple[Any, ...]) -> str:
        """Return the only body that they may orbit, if one of them names it."""
        return next((target.about for target in self._fitted(params) if target.about), "")

    def _fitted(self, params: tuple[Any, ...]) -> list[Fitted]:
        return [Fitted(part, numbers) for part, numbers in zip(self.parts, params, strict=True)]

    @property
    def STILL(self) -> bool:  # noqa: N802
        """Whether none of them turns during a flight."""
        return all(part.flag("STILL") for part in self.parts)

    @property
    def FOLLOWS(self) -> bool:  # noqa: N802
        """Whether one of them continues from its previous attitude."""
        return any(part.flag("FOLLOWS") for part in self.parts)

    def prepare(self, params: tuple[Any, ...], period: float) -> tuple[Any, ...]:
        """Return their parameters in the form that equations take."""
        return tuple(target.prepared(period) for target in self._fitted(params))

    def check(self, params: tuple[Any, ...], craft: Any) -> None:
        """Raise ValueError if one of them does not fit a craft."""
        for part, numbers in zip(self.parts, params, strict=True):
            examine = part.hook("check")
            if examine is not None:
                examine(numbers, craft)

    @property
    def SLEWS(self) -> bool:  # noqa: N802
        """Whether one of them is reached by a slew as its mode begins."""
        return any(isinstance(part.module, Slewing) for part in self.parts)

    def first(self, params: tuple[Any, ...], attitude: Any) -> Any:
        """Return their initial memory: the attitude from which they continue, with the path of a slew if there is one."""
        if not self.SLEWS:
            return attitude
        slews = [numbers.slew for part, numbers in zip(self.parts, params, strict=True) if isinstance(part.module, Slewing)]
        return Followed(attitude, 0.0, NO_TURN, (RESTING,) * (2 if any(slew.cone for slew in slews) else 1))

    def begun(
        self, params: tuple[Any, ...], state: Any, attitude: Any, step: Any, craft: Any, before: Followed, memory: Any
    ) -> Followed:
        """Return their memory at the start of a control step of the present mode, at an attitude."""
        first = less(memory.age, 0.5)
        for place, (part, numbers) in enumerate(zip(self.parts, params, strict=True)):
            module: Any = part.module
            if isinstance(module, Slewing):

                def begin(before: Followed, module: Any = module, numbers: Any = numbers) -> tuple[Followed]:
                    return (module.begun(numbers, state, attitude, step, craft, before),)

                (before,) = when(both(first, is_mode(memory.mode, place)), begin, before)
        return before

    def goal(self, params: tuple[Any, ...], state: Any, step: Any, before: Any, mode: Any) -> Goal:
        """Return the goal of the present mode."""
        attitude = before.attitude if self.SLEWS else before
        goals = [
            part.module.goal(numbers, state, step, before if isinstance(part.module, Slewing) else attitude)
            for part, numbers in zip(self.parts, params, strict=True)
        ]
        present = goals[0]
        for place, goal in enumerate(goals[1:], 1):
            present = chosen(is_mode(mode, place), goal, present)
        return present


def join_targets(targets: Sequence[Fitted], slews: Sequence[Slew | None]) -> Fitted:
    """Return the target of a loop whose modes have these targets, one each, some of them reached by slews."""
    targets = [slewing(target, slew) for target, slew in zip(targets, slews, strict=True)]
    module: Any = ModeTargets(tuple(target.part for target in targets))
    # A target from a file is checked, like all parts from files.
    file = next((target.part.file for target in targets if target.part.file is not None), None)
    return Fitted(Part("targets-of-modes", module, file), tuple(target.params for target in targets))


@dataclass(frozen=True)
class Inactive:
    """Replaces the module of an effector that is inactive in a mode: its command is zero."""

    module: Any

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        value = getattr(self.module, name)
        if name == "command":
            return lambda applied, params: value(ZERO, params)
        if name == "switch":
            return lambda state, wanted, *more: value(state, ZERO, *more)
        return value


def loop_of_mode(loop: ClosedLoop, place: int) -> ClosedLoop:
    """Return the loop of the law of one mode, counted from 0, as if it flew alone with its target and the effectors active
    in it."""
    _, law, gains = mode_laws(loop.law, loop.gains)[place]
    alone, target = replace(loop, law=law, gains=gains, events=()), loop.target
    if target.part.flag("BY_MODE"):
        module: Any = target.part.module
        mode_target = reached(Fitted(module.parts[place], target.params[place]))
        alone = replace(alone, parts=tuple(mode_target if fitted is target else fitted for fitted in alone.parts))
    mode = loop.law.module.modes[place]
    active: list[Fitted] = []
    for fitted in alone.parts:
        if not can_be_inactive(fitted.part) or mode.has(fitted.part.name):
            active.append(fitted)
        elif not fitted.part.flag("OUTSIDE"):
            module = Inactive(fitted.part.module)
            active.append(replace(fitted, part=Part(f"inactive-{fitted.part.name}", module, fitted.part.file)))
    return replace(alone, parts=tuple(active))
