"""Each mode of a law may have a target of its own in the loop, and its law can be flown by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from starhold.algebra.scalar import absolute, less
from starhold.algebra.structure import chosen
from starhold.algebra.vector import ZERO
from starhold.laws.modes import mode_laws
from starhold.loop.closed_loop import ClosedLoop, can_be_inactive
from starhold.parts.contract import Card
from starhold.parts.part import Fitted, Part
from starhold.parts.roles import Goal


@dataclass(frozen=True)
class ModeTargets:
    """Takes the place of a target's module, for the present mode's target; `goal` takes the mode, counted from 0."""

    parts: tuple[Part, ...]
    ROLE = "target"
    BY_MODE = True

    @property
    def CARD(self) -> Card:  # noqa: N802
        """The targets of all modes."""
        names = ", ".join(part.name for part in self.parts)
        return Card("Targets of modes", names, ("definition",), ())

    @property
    def NEEDS(self) -> tuple[str, ...]:  # noqa: N802
        """Parts that any of the targets needs."""
        return tuple(dict.fromkeys(need for part in self.parts for need in part.needs))

    @property
    def ABOUT(self) -> str:  # noqa: N802
        """The one body that their orbit may be about, where one of them says so."""
        return next((part.about for part in self.parts if part.about), "")

    @property
    def STILL(self) -> bool:  # noqa: N802
        """Whether none of them turns."""
        return all(part.flag("STILL") for part in self.parts)

    @property
    def FOLLOWS(self) -> bool:  # noqa: N802
        """Whether one of them is continued from the attitude before."""
        return any(part.flag("FOLLOWS") for part in self.parts)

    def prepare(self, params: tuple[Any, ...], period: float) -> tuple[Any, ...]:
        """Their parameters as equations take them."""
        return tuple(Fitted(part, numbers).prepared(period) for part, numbers in zip(self.parts, params, strict=True))

    def check(self, params: tuple[Any, ...], craft: Any) -> None:
        """ValueError where one of them does not fit a craft."""
        for part, numbers in zip(self.parts, params, strict=True):
            examine = part.hook("check")
            if examine is not None:
                examine(numbers, craft)

    def goal(self, params: tuple[Any, ...], state: Any, step: Any, before: Any, mode: Any) -> Goal:
        """The goal of the present mode."""
        goals = [part.module.goal(numbers, state, step, before) for part, numbers in zip(self.parts, params, strict=True)]
        present = goals[0]
        for place, goal in enumerate(goals[1:], 1):
            present = chosen(less(absolute(mode - float(place)), 0.5), goal, present)
        return present


def join_targets(targets: Sequence[Fitted]) -> Fitted:
    """The target of a loop whose modes have these, one each."""
    module: Any = ModeTargets(tuple(target.part for target in targets))
    # A target from a file is checked like all parts from files.
    file = next((target.part.file for target in targets if target.part.file is not None), None)
    return Fitted(Part("targets-of-modes", module, file), tuple(target.params for target in targets))


@dataclass(frozen=True)
class Inactive:
    """Takes the place of the module of an effector that is inactive in a mode: its command is zero."""

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
    """The loop of the law of one mode, counted from 0, as if it flew alone towards its target with the effectors that are
    active in it."""
    _, law, gains = mode_laws(loop.law, loop.gains)[place]
    alone, target = replace(loop, law=law, gains=gains, events=()), loop.target
    if target.part.flag("BY_MODE"):
        module: Any = target.part.module
        mode_target = Fitted(module.parts[place], target.params[place])
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
