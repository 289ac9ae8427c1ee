"""Parts of a loop in any role as objects: a part file under its name, and a part with its parameters in a loop."""

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
    """A part file as an object; its name is that of the file, with hyphens."""

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
        """The name of the scenario's table for this part; "" for a part given by a [[part]] table."""
        return getattr(self.module, "TABLE", "")

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of other parts of the loop, or readings, that it needs; with parameters see `Fitted.needs`."""
        return getattr(self.module, "NEEDS", ())

    @property
    def about(self) -> str:
        """The name in `parts.orbit.BODIES` of the only body that it may orbit; "" for any; with parameters see
        `Fitted.about`."""
        return getattr(self.module, "ABOUT", "")

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of readings that a law or an effector with `switch` needs."""
        return getattr(self.module, "READS", ())

    def is_known(self, name: str) -> bool:
        """Return whether laws, or the flight software that distributes their command, use this parameter."""
        return self.flag("MODELLED") or name in getattr(self.module, "KNOWN", ())

    @property
    def params(self) -> Any:
        """The class of its parameters, a NamedTuple."""
        return self.module.Params

    def fields(self) -> list[Field]:
        """Its parameters in order."""
        return fields(self.params)

    def examples(self) -> list[Any]:
        """Return parameters for tests and docs."""
        return self.module.examples()

    def hook(self, name: str) -> Callable[..., Any] | None:
        """Return an optional equation of its role; None if it is not defined."""
        return getattr(self.module, name, None)

    def flag(self, name: str) -> bool:
        """Return whether it declares this flag, see `parts.roles`."""
        return bool(getattr(self.module, name, False))


@dataclass(frozen=True)
class Fitted:
    """A part in a loop: its parameters, its name in recordings and errors, and the initial state of an effector (None: the
    part's default). An estimator may watch, unused by the law; and another one, named `started_by`, may give it its first
    attitude."""

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
    def prefix(self) -> str:
        """The beginning of the names of its recorded quantities, where those would not be unique without it."""
        return f"{self.called.replace('-', '_')}_"

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of other parts of the loop, or readings, that it needs with these parameters."""
        tell = self.part.hook("needs")
        return self.part.needs if tell is None else tell(self.params)

    @property
    def about(self) -> str:
        """The name of the only body that it may orbit with these parameters; "" for any."""
        tell = self.part.hook("about")
        return self.part.about if tell is None else tell(self.params)

    def prepared(self, period: float) -> Any:
        """Return its parameters in the form that its equations take, for a control period (s)."""
        make = self.part.hook("prepare")
        return self.params if make is None else make(self.params, period)

    def remembered(self, *about: Any) -> Any:
        """Return its initial memory, or an effector's state, from its parameters and the arguments that its role adds."""
        if self.start is not None:
            return self.start
        make = self.part.hook("remember")
        return NoMemory() if make is None else make(*about)

    @property
    def fastest(self) -> float:
        """Return the fastest rate (1/s) at which it settles by itself, which the integration must resolve; 0 for none."""
        tell = self.part.hook("fastest")
        return 0.0 if tell is None else tell(self.params)


def same_numbers(one: Any, other: Any) -> bool:
    """Return whether two nested states have the same numbers."""
    pairs = [*leaves(one)], [*leaves(other)]
    return len(pairs[0]) == len(pairs[1]) and all(map(np.array_equal, *pairs))
