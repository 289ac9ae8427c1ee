"""All numbers of a loop, flattened into one row with names, and the test whether an equation gives them. To decide for which
keys of a file an equation is valid, scenarios with other values are built and their numbers compared with those of the
equation, to the last bit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.loop.closed_loop import ClosedLoop, Phase
from starhold.loop.kernels import Numbers, numbers_of
from starhold.simulation.batched import Flying, kernel_key
from starhold.trace.handles import Handle

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Flat:
    """A loop as a row of numbers. form: equal for loops that one kernel flies; names and numbers: those of the initial carry
    and of each phase, then the times at which later phases begin."""

    loop: ClosedLoop
    form: Any
    names: tuple[str, ...]
    numbers: Array

    @classmethod
    def of(cls, loop: ClosedLoop, steps: int, entered: bool = False) -> Flat:
        """Return the numbers of a loop that flies `steps` control steps; `entered`: whether to take the carry after the
        start of the first phase, which may change it."""
        phases = loop.phases(steps)
        carry = phases[0].entered(loop.carry()) if entered else loop.carry()
        numbers = named_numbers(loop, numbers_of(carry), phases)
        return cls(loop, kernel_key(Flying(loop, steps, 1)), tuple(numbers), np.array([*numbers.values()], dtype=float))

    def gives(self, other: Flat | None, numbers: Any) -> bool:
        """Return whether these numbers are, to the last bit, those of the loop `other` (None for an impossible one), and
        this loop's kernel flies it."""
        if other is None or other.form != self.form:
            return False
        given = np.ascontiguousarray(numbers, dtype=float)
        return other.numbers.shape == given.shape and other.numbers.tobytes() == given.tobytes()

    def places(self, name: str) -> list[int]:
        """Return the indices of the number of this name in all phases that have it."""
        return [place for place, full in enumerate(self.names) if full == name or full.endswith(f"].{name}")]


def named_numbers(loop: ClosedLoop, carry: Sequence[Any], phases: Sequence[Phase]) -> dict[str, Any]:
    """Return the numbers of a loop, or arrays (lanes,) in their place, by name: those of its carry, with the contents of its
    buffers last; those of phases, numbered by event; then the times of events, in the body's unit of time."""
    names = [name for name, _ in named(loop.carry(), "")]
    numbers = dict(zip([*names, *(f"buffer[{k}]" for k in range(1, len(carry) - len(names) + 1))], carry, strict=True))
    for number, phase in enumerate(phases):
        prefix = f"event[{number}]." if number else ""
        numbers |= {f"{prefix}{name}": value for name, value in named(Numbers.of(phase), "")}
    return numbers | {f"event[{number}].time": phase.first * loop.period for number, phase in enumerate(phases) if number}


def named(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield the numbers of a structure with their names, in the order of its leaves."""
    if isinstance(value, tuple):
        fields = getattr(value, "_fields", None)
        for place, part in enumerate(value):
            full = f"{name}.{fields[place]}".lstrip(".") if fields else f"{name}[{place + 1}]"
            yield from named(part, full)
    elif isinstance(value, float | np.ndarray | Handle):
        yield name, value


_OF_PART = re.compile(r"(?:(memories|setup)\.)?(sensor|environment|effector|watcher)s\[(\d+)\]")
_OF_ONE = re.compile(r"(memories|setup)\.(estimator|target)\b")


def shown_name(loop: ClosedLoop, name: str) -> str:
    """Return the name of a number in tables, which begins with its part and distinguishes states and memories from
    parameters."""

    def called(where: str | None, fitted: Any) -> str:
        return fitted.called + {"setup": "", "memories": ".memory"}.get(where or "", ".state")

    name = _OF_PART.sub(lambda m: called(m[1], loop.used(m[2])[int(m[3]) - 1]), name)
    return _OF_ONE.sub(lambda m: called(m[1], (*loop.used(m[2]), loop.target)[0]), name)
