"""Parts of a loop as objects, whatever their role: a part file under its name, and a part with the numbers it has in a
loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from starhold.algebra.structure import leaves
from starhold.parts.contract import Card, Field, NoMemory, fields


@dataclass(frozen=True)
class Part:
    """A part file as an object; its name is the file's, with hyphens."""

    name: str
    module: ModuleType
    file: Path | None = None
    """The file from which it was read; None for an installed part."""

    @property
    def role(self) -> str:
        """Its role, see `parts.roles`."""
        return self.module.ROLE

    @property
    def card(self) -> Card:
        """Title, sources and assumptions."""
        return self.module.CARD

    @property
    def body(self) -> str:
        """The name of the body that it fits; "" for one that fits any."""
        return getattr(self.module, "BODY", "rigid-body")

    @property
    def table(self) -> str:
        """The table of a scenario that gives it; "" for one that is given by a [[part]] table."""
        return getattr(self.module, "TABLE", "")

    @property
    def needs(self) -> tuple[str, ...]:
        """Other parts of the loop, or readings, that it cannot do without, by name; `Fitted.needs` for its numbers."""
        return getattr(self.module, "NEEDS", ())

    @property
    def about(self) -> str:
        """The one body, by its name among `parts.orbit.BODIES`, that its orbit may be about; "" for any, `Fitted.about` for
        its numbers."""
        return getattr(self.module, "ABOUT", "")

    @property
    def reads(self) -> tuple[str, ...]:
        """Readings, by name, that a law or an effector with `switch` cannot do without."""
        return getattr(self.module, "READS", ())

    def is_known(self, name: str) -> bool:
        """Whether laws, or flight software that shares their command out, compute with this parameter."""
        return self.flag("MODELLED") or name in getattr(self.module, "KNOWN", ())

    @property
    def params(self) -> Any:
        """The class of its parameters, a NamedTuple."""
        return self.module.Params

    def fields(self) -> list[Field]:
        """Its parameters in order."""
        return fields(self.params)

    def examples(self) -> list[Any]:
        """Parameters that tests and docs run."""
        return self.module.examples()

    def hook(self, name: str) -> Callable[..., Any] | None:
        """An equation that parts of its role may define or leave out."""
        return getattr(self.module, name, None)

    def flag(self, name: str) -> bool:
        """Whether it declares this flag, see `parts.roles`."""
        return bool(getattr(self.module, name, False))


@dataclass(frozen=True)
class Fitted:
    """A part in a loop: its parameters, the name that recordings and errors call it by, and the state that it starts
    with (of effectors; None: the part's default). An estimator may watch: the law does not use it; and another one, of
    the name `started_by`, may give it its first attitude."""

    part: Part
    params: Any = ()
    name: str = ""
    start: Any = None
    watches: bool = False
    started_by: str = ""

    @property
    def role(self) -> str:
        """Its role in the loop: that of the part, but "watcher" for an estimator that watches."""
        return "watcher" if self.watches else self.part.role

    @property
    def called(self) -> str:
        """Its name in the loop, by default the part's."""
        return self.name or self.part.name

    @property
    def needs(self) -> tuple[str, ...]:
        """Other parts of the loop, or readings, that it cannot do without with its parameters, by name."""
        tell = self.part.hook("needs")
        return self.part.needs if tell is None else tell(self.params)

    @property
    def about(self) -> str:
        """The one body that its orbit may be about with its parameters; "" for any."""
        tell = self.part.hook("about")
        return self.part.about if tell is None else tell(self.params)

    def prepared(self, period: float) -> Any:
        """Its parameters as equations take them, for a control period (s)."""
        make = self.part.hook("prepare")
        return self.params if make is None else make(self.params, period)

    def remembered(self, *about: Any) -> Any:
        """Its memory, or an effector's state, at the start, made of its parameters and the arguments that its role adds."""
        if self.start is not None:
            return self.start
        make = self.part.hook("remember")
        return NoMemory() if make is None else make(*about)

    @property
    def fastest(self) -> float:
        """The fastest rate (1/s) at which it settles by itself, which the integration must resolve; 0 for none."""
        tell = self.part.hook("fastest")
        return 0.0 if tell is None else tell(self.params)


def same_numbers(one: Any, other: Any) -> bool:
    """Whether two nested states hold the same numbers."""
    pairs = [*leaves(one)], [*leaves(other)]
    return len(pairs[0]) == len(pairs[1]) and all(map(np.array_equal, *pairs))
