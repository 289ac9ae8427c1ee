"""A law as C99: one header, one source."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from starhold.algebra.operations import NUMBER
from starhold.algebra.structure import leaves, mapped
from starhold.algebra.structured import Buffer
from starhold.errors import InputError
from starhold.export.law import FlightLaw, flight_law
from starhold.export.liveness import Needs
from starhold.export.printing import Readable
from starhold.export.recording import Recording, Signature
from starhold.export.types import RESTRICTED, Member, Type, paths
from starhold.loop.closed_loop import ClosedLoop
from starhold.trace import bounds
from starhold.trace.c99 import C99
from starhold.trace.program import Function, Program, prune, renamed
from starhold.trace.recording import RESERVED


def check_name(name: str) -> str:
    """Return a name that functions and files in C may begin with. InputError for any other."""
    free = name not in RESTRICTED and name not in RESERVED and name not in C99.taken and not name.startswith("_")
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
    parts: dict[str, dict[int, str]]
    """Names of the parts of its arrays, by their first places."""
    state: Any
    """The state with buffers in memories of the program."""

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
        kind = self.signature.params[place].type
        return tuple(self.printed.members(kind))

    @property
    def buffers(self) -> dict[str, int]:
        """Return the arrays of the state and their sizes."""
        return {m.name: m.size or 0 for m in self.program.memories}


def make_code(loop: ClosedLoop, name: str) -> Code:
    """Return the flight code of a loop's law. InputError for what has no form in C."""
    flight = flight_law(loop)
    check_name(name)
    recording = Recording()
    with recording.recording():
        state = mapped(flight.start, lambda leaf: _held(recording, leaf))
        given = [
            recording.parameter("parameters", flight.parameters, "."),
            recording.parameter("state", state, "->"),
            recording.parameter("input", flight.inputs, "->"),
        ]
        command, after = flight.equation(recording.rebinder)(*(handles for handles, _ in given))
    params = tuple(param for _, param in given)
    result = [Member("command", recording.types.of(command, "command") or params[0].type)]
    if params[1].leaves:
        result.append(Member("state", params[1].type))
    kind = Type("step_t", tuple(result))
    numbers = [leaf for leaf in leaves((command, after)) if not isinstance(leaf, (Buffer, int))]
    body, changed = prune(tuple(recording.block), [getattr(x, "ref", x) for x in numbers])
    outs = tuple((renamed(getattr(x, "ref", x), changed), NUMBER) for x in numbers)
    hints = {
        tuple(renamed(x, changed) for x in key) if isinstance(key, tuple) else renamed(key, changed): hint
        for key, hint in recording.hints.items()
    }
    shape = Signature(params, kind, tuple(paths(kind, "", ".")), hints, "")
    flat = tuple((path.text, path.kind) for param in params for path in param.leaves)
    main = Function("step", "", flat, body, outs, shape)
    program = Program((*recording.recorded, main), tuple(recording.memories))
    needs = Needs(program)
    return Code(flight, name, needs.program(program), needs, recording.parts, state)


def _held(recording: Recording, leaf: Any) -> Any:
    if not isinstance(leaf, Buffer):
        return leaf
    return Buffer(recording.memory("numbers", writable=True, size=leaf.size), 0, leaf.size)
