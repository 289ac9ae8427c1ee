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
from starhold.export.needs import Needs
from starhold.export.printing import Readable
from starhold.export.recording import Recording, Signature
from starhold.export.types import Member, Type
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
    """A law in C: what was recorded of it, and the texts. name: what its functions begin with."""

    flight: FlightLaw
    name: str
    program: Program
    needs: Needs
    types: dict[str, Type]
    """All types of its values by name, those of members first."""
    parts: dict[str, dict[int, str]]
    """Names of the parts of its arrays, by their first places."""

    @cached_property
    def work(self) -> bounds.Work:
        """Return what a step does at the most."""
        return bounds.check(self.program, {}, {}).work

    @cached_property
    def printed(self) -> Readable:
        """Return the functions as text; types that the header has are called without the name of the law in the source."""
        return Readable(self.program, self.needs, self.parts)

    @property
    def time_unit(self) -> str:
        """The unit of the period."""
        return getattr(self.flight.loop.body.module, "TIME_UNIT", "s")

    @property
    def signature(self) -> Signature:
        """Return what the step takes and gives."""
        return self.program.main.shape

    def members(self, place: int) -> tuple[Member, ...]:
        """Return the members that are read of the parameters (0), the state (1) or the input (2)."""
        return tuple(self.printed.members(self.signature.params[place].type))

    @property
    def buffers(self) -> dict[str, int]:
        """Return the arrays of the state and their sizes."""
        return {m.name: m.size or 0 for m in self.program.memories}


def make_code(loop: ClosedLoop, name: str) -> Code:
    """Return the flight code of a loop's law. InputError for what has no form in C."""
    flight, recording = flight_law(loop), Recording()
    check_name(name)

    def in_memory(leaf: Any) -> Any:
        if not isinstance(leaf, Buffer):
            return leaf
        return Buffer(recording.memory("numbers", writable=True, size=leaf.size), 0, leaf.size)

    with recording.recording():
        given = [
            recording.parameter("parameters", flight.parameters, link="."),
            recording.parameter("state", mapped(flight.start, in_memory)),
            recording.parameter("input", flight.inputs),
        ]
        command, after = flight.equation(recording.copies)(*(handles for handles, _ in given))
    program = recording.step([param for _, param in given], command, after)
    needs = Needs(program)
    return Code(flight, name, needs.program(program), needs, recording.types.known, recording.parts)
