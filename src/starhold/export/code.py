"""A law as C99: a header and a source."""

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from starhold.algebra.operations import INDEX, NUMBER, TRUTH, UNIFORM, WORD
from starhold.algebra.structure import mapped
from starhold.algebra.structured import Buffer
from starhold.errors import InputError
from starhold.export.law import FlightLaw, flight_law
from starhold.export.recording import MAKE, MEMBER, Reads, Recording
from starhold.export.types import Member, Type, Types, tied
from starhold.loop.closed_loop import ClosedLoop
from starhold.trace import bounds
from starhold.trace.c99 import C99
from starhold.trace.program import Call, Function, Load, Op, Program, Store, statements
from starhold.trace.recording import RESERVED
from starhold.trace.source import LONG, TIE, Expression, names

SHORT = 130
"""Most characters of a call that is written inline, except in `return`."""


_ANY = 1 << 20


class _Kinds(dict[str, str]):
    """The C names of the kinds of a trace; structs have their own."""

    def __missing__(self, kind: str) -> str:
        return kind


class Readable(C99):
    """Printer of the functions of a law. `main` becomes the body of the step, whose results go to the members of `state`
    and `command`. parts: names of the parts of memories, by their first indices."""

    types = _Kinds({NUMBER: "double", TRUTH: "bool", INDEX: "int32_t", WORD: "uint64_t", UNIFORM: "bool"})

    def __init__(self, program: Program, parts: dict[str, dict[int, str]]) -> None:
        self.parts = parts
        self.chunks: dict[str, list[str]] = {}
        super().__init__(program)

    # Functions.

    def _prepare(self, function: Function) -> None:
        super()._prepare(function)
        self._outs, self._rows = function.outs, set[str]()
        memories = (memory.name for memory in self.memories[function.name])
        self._taken = {*names(function), *memories, *self.titles.values(), "state", "input", "command", "parameters"}
        self._folded = {name: Expression(f"*{name}", "unary") for name in function.shape.addresses}
        for s in statements(function.body):
            # A value that is read member by member, or has an address, is a variable.
            if isinstance(s, Op) and s.operation.name == MEMBER:
                self._once.discard(s.args[0])
            elif isinstance(s, Call):
                pairs = zip(s.args, s.function.params, strict=True)
                self._once -= {value for value, (name, _) in pairs if name in s.function.shape.addresses}
        called = {ref: name for ref, name in function.shape.names.items() if ref in self._read}
        # A value whose name is later given to another one is mostly read once, by that one.
        last = {name: ref for ref, name in called.items()}
        self._names = {ref: name for ref, name in called.items() if last[name] == ref or ref not in self._once}
        made = [s for s in statements(function.body) if isinstance(s, Op) and s.operation.name == MAKE]
        fields = [(ref, m.name) for s in made for ref, m in zip(s.args, _about(s).members, strict=True) if _about(s).named]
        self._spare = dict(fields)
        """Names for variables that the source does not name."""

    def _head(self, function: Function) -> str:
        memories = (f"{'' if m.writable else f'const{TIE}'}double{TIE}*{m.name}" for m in self.memories[function.name])
        by_address = function.shape.addresses
        params = ((name, self.types[kind]) for name, kind in function.params)
        given = (f"const{TIE}{kind}{TIE}*{name}" if name in by_address else f"{kind}{TIE}{name}" for name, kind in params)
        gives = self.types[function.outs[0][1]] if function.outs else "void"
        return f"static {gives} {self.titles[function.name]}({', '.join([*memories, *given]) or 'void'})"

    def _define(self, function: Function) -> None:
        first = len(self.lines)
        if self.is_main(function):
            self._main(function)
        else:
            super()._define(function)
        self.chunks[function.name] = self.lines[first:]

    def _main(self, function: Function) -> None:
        """Print the body of the step; all members of the state are computed before the first is changed."""
        self.depth += 1
        self._block(function.body)
        lines: list[str] = []
        for place, (value, kind) in zip(function.shape.places, function.outs, strict=True):
            text = self.text(value, kind)
            if place.startswith("state") and text != place and not text.isidentifier():
                name = self._fresh(place.removeprefix("state->"))
                self.put(f"const {self.types[kind]} {name} = {text.removeprefix(f'({kind})')};")
                text = name
            lines += [f"{place} = {text};"] if text != place else []
        for line in lines:
            self.put(line)
        self.depth -= 1

    # Values.

    def _block(self, block: tuple[Any, ...]) -> None:
        # A struct may be assembled where its numbers are read, unless there is a write in between.
        fresh: set[str] = set()
        for s in block:
            if isinstance(s, Load):
                fresh.add(s.ref)
            elif isinstance(s, Op):
                self._rows |= fresh.intersection(s.args) if s.operation.name == MAKE else set()
            else:
                fresh.clear()
        super()._block(block)

    def _fresh(self, hint: str) -> str:
        """Return a name that is unused in this function."""
        name, count = hint, 1
        while name in self._taken:
            count += 1
            name = f"{hint}_{count}"
        self._taken.add(name)
        return name

    def _let(self, kind: str, name: str, text: str) -> None:
        title = self._names.get(name) or self._spare.get(name, name)
        if title != name:
            self._folded[name] = Expression(self._fresh(title))
        super()._let(kind, self.text(name, kind), text.removeprefix(f"({kind})"))

    def _keep(self, ref: str, kind: str, expression: Expression, moves: bool = True, most: int = LONG) -> None:
        text = expression.text
        if kind == INDEX or re.fullmatch(r"-[\w.>-]*\w", text):
            # Written where it is read, any number of times.
            self._folded[ref] = expression
        elif (moves or ref in self._rows) and ref in self._once and ref not in self._names and len(text) <= most:
            self._folded[ref] = expression
        else:
            self._let(kind, ref, text)

    def _op(self, s: Op) -> None:
        about = _about(s)
        if s.operation.name == MEMBER:
            text = self.text(s.args[0], s.operation.takes[0])
            base = f"{text[1:]}->" if text.startswith("*") else f"{text}."
            self._folded[s.ref] = Expression(base + about)
        elif s.operation.name == MAKE:
            texts = [self.text(*pair) for pair in zip(s.args, s.operation.takes, strict=True)]
            literal = Expression(f"({about.name}){about.braced(texts)}")
            self._spare.setdefault(s.ref, about.name.removesuffix("_t"))
            if any(isinstance(x, str) for x in s.args):
                self._keep(s.ref, about.kind, literal, self._rows.isdisjoint(s.args), _ANY)
            else:
                self._folded[s.ref] = literal
        elif s.operation.name == "index_plus":
            self._folded[s.ref] = Expression(" + ".join(self.text(x, INDEX) for x in s.args), "+")
        else:
            super()._op(s)

    def _call(self, s: Call) -> None:
        function = self.functions[s.function.name]
        given = [memory.name for memory in self.memories[function.name]]
        for value, (name, kind) in zip(s.args, s.function.params, strict=True):
            text = self.text(value, kind)
            if name in function.shape.addresses:
                text = text[1:] if text.startswith("*") else f"&{text}"
            given.append(tied(text))
        text = f"{self.titles[function.name]}({', '.join(given)})"
        if s.refs and s.refs[0][0] in self._read:
            self._spare.setdefault(s.refs[0][0], f"{self.titles[function.name]}_result")
            most = _ANY if s.refs == self._outs else SHORT
            self._keep(*s.refs[0], Expression(text), not self.memories[function.name], most)
        else:
            self.put(f"{text};")

    def _place(self, s: Load | Store) -> str:
        """Return the text of a place in memory, relative to the beginning of its part if it lies in one."""
        first, _, rest = self.text(s.index, INDEX).partition(" + ")
        parts = self.parts.get(s.memory, {})
        if first.isdigit() and (start := max((place for place in parts if place <= int(first)), default=None)) is not None:
            more = [str(int(first) - start)] if int(first) > start else []
            first = " + ".join([f"{parts[start].upper()}_AT", *more])
        text = " + ".join([first, *([rest] if rest else [])])
        return f"{s.memory}[{text}]".replace(" ", TIE)


def _about(s: Op) -> Any:
    """Return the type that an operation makes, or the name of the member that it reads."""
    return s.operation.plain


def check_name(name: str) -> str:
    """Return a prefix of functions and files in C. Raise InputError if it is not valid."""
    free = name not in RESERVED and name not in C99.taken and not name.startswith("_")
    if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) or not free or len(name) > 40:
        raise InputError(
            "export c", "name", name, "a C identifier of at most 40 letters, digits and _, no word of the language"
        )
    return name


@dataclass(frozen=True)
class Code:
    """A law in C: its recorded program, and the texts. name: the prefix of its functions' names; given: the types of the
    parameters, the state and the input (None for none), by their names."""

    flight: FlightLaw
    name: str
    program: Program
    types: Types
    given: dict[str, Type | None]
    command: Type
    parts: dict[str, dict[int, str]]
    """Names of the parts of its arrays, by their first indices."""

    @cached_property
    def work(self) -> bounds.Work:
        """Return bounds on the number of operations of a step."""
        return bounds.check(self.program, {}, {}).work

    @cached_property
    def printed(self) -> Readable:
        """Return the functions as text; in the source, types of the header have names without that of the law."""
        return Readable(self.program, self.parts)

    @property
    def time_unit(self) -> str:
        """The unit of the period."""
        return getattr(self.flight.loop.body.module, "TIME_UNIT", "s")

    @property
    def inputs(self) -> tuple[Member, ...]:
        """Return the inputs that the law reads."""
        kind = self.given["input"]
        return () if kind is None else kind.members

    @property
    def buffers(self) -> dict[str, int]:
        """Return the arrays of the state and their sizes."""
        return {m.name: m.size or 0 for m in self.program.memories}


def make_code(loop: ClosedLoop, name: str) -> Code:
    """Return the flight code of a loop's law. Raise InputError for parts that have no form in C."""
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
    """Record the law's control step with these values and return what it computes: the command and the state after it."""

    def in_memory(leaf: Any) -> Any:
        if not isinstance(leaf, Buffer):
            return leaf
        return Buffer(recorder.memory("numbers", writable=True, size=leaf.size), 0, leaf.size)

    with recorder.recording():
        # The buffers of parameters are tables.
        given = [recorder.given(word, mapped(x, in_memory) if word == "state" else x) for word, x in values.items()]
        return flight.equation(recorder.copies)(*given)
