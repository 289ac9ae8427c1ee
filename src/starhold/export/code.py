"""A law as C99: one header, one source."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from starhold.algebra.structure import mapped
from starhold.algebra.structured import Buffer
from starhold.errors import InputError
from starhold.export.law import FlightLaw, flight_law
from starhold.export.printing import Readable
from starhold.export.recording import Reads, Recording
from starhold.export.types import Member, Type, Types
from starhold.loop.closed_loop import ClosedLoop
from starhold.trace import bounds
from starhold.trace.c99 import C99
from starhold.trace.program import Program
from starhold.trace.recording import RESERVED


def check_name(name: str) -> str:
    """Return a name that functions and files in C may begin with. InputError for any other."""
    free = name not in RESERVED and name not in C99.taken and not name.startswith("_")
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) or not free or len(name) > 40:
        raise InputError(
            "export c", "name", name, "a C identifier of at most 40 letters, digits and _, no word of the language"
        )
    return name


@dataclass(frozen=True)
class Code:
    """A law in C: its recorded program, and the texts. name: the beginning of its functions' names; given: the types of the
    parameters, the state and the input (None for none), by their names."""

    flight: FlightLaw
    name: str
    program: Program
    types: Types
    given: dict[str, Type | None]
    command: Type
    parts: dict[str, dict[int, str]]
    """Names of the parts of its arrays, by their first places."""

    @cached_property
    def work(self) -> bounds.Work:
        """Return the largest number of operations of a step."""
        return bounds.check(self.program, {}, {}).work

    @cached_property
    def printed(self) -> Readable:
        """Return the functions as text; types that the header has are called without the name of the law in the source."""
        return Readable(self.program, self.parts)

    @property
    def time_unit(self) -> str:
        """The unit of the period."""
        return getattr(self.flight.loop.body.module, "TIME_UNIT", "s")

    @property
    def inputs(self) -> tuple[Member, ...]:
        """Return the inputs that are read."""
        kind = self.given["input"]
        return () if kind is None else kind.members

    @property
    def buffers(self) -> dict[str, int]:
        """Return the arrays of the state and their sizes."""
        return {m.name: m.size or 0 for m in self.program.memories}


def make_code(loop: ClosedLoop, name: str) -> Code:
    """Return the flight code of a loop's law. InputError for what has no form in C."""
    flight = flight_law(loop)
    check_name(name)
    values = {"parameters": flight.parameters, "state": flight.start, "input": flight.inputs}
    reads = Reads()
    recording = Recording(reads.read(_recorded(flight, reads, values)))
    command, after = _recorded(flight, recording, values)
    given = {word: recording.types.of(value) for word, value in values.items()}
    program = recording.step(values, {"command": command, "state": after})
    kind = recording.types.of(command)
    assert kind is not None
    return Code(flight, name, program, recording.types, given, kind, recording.parts)


def _recorded(flight: FlightLaw, recorder: Reads | Recording, values: dict[str, Any]) -> Any:
    """Record the step; return what it gives."""

    def in_memory(leaf: Any) -> Any:
        if not isinstance(leaf, Buffer):
            return leaf
        return Buffer(recorder.memory("numbers", writable=True, size=leaf.size), 0, leaf.size)

    with recorder.recording():
        # The buffers of parameters are tables.
        given = [recorder.given(word, mapped(x, in_memory) if word == "state" else x) for word, x in values.items()]
        return flight.equation(recorder.copies)(*given)
