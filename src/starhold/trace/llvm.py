"""Prints a program as LLVM's intermediate representation, for one lane or for W lanes in explicit vectors.

No operation is reassociated or contracted. Lanes execute loops together: masks let a lane that has finished keep its loop
variables and write nothing.
"""

import struct
from typing import Any, ClassVar

from starhold.algebra.operations import INDEX, NUMBER, STATIC, TRUTH, UNIFORM, WORD
from starhold.trace.program import Branch, Call, Function, Load, Loop, Op, Program, Store, Value, statements

ATTRIBUTES = 'attributes #0 = { nounwind "prefer-vector-width"="512" "min-legal-vector-width"="512" "stackrealign" }'
"""Without the last one, LLVM aligns what it keeps on the stack only where the caller's frame happens to be aligned; a vector
that extends over two cache lines takes twice as long to read."""


def hexadecimal(number: float) -> str:
    """Return a double in hexadecimal, as LLVM writes constants."""
    return "0x" + struct.pack(">d", number).hex().upper()


def check_apart(program: Program) -> None:
    """Raise ValueError for a program whose lanes would write to the same memory."""
    if common := [memory.name for memory in program.memories if memory.writable and not memory.lanes]:
        raise ValueError(f"{', '.join(common)}: all lanes write to the same memory")


class Types:
    """Names of types and constants for a number of lanes."""

    def __init__(self, width: int, lane: str = "0") -> None:
        self.width = width
        lanes = "{}" if width == 1 else f"<{width} x {{}}>"
        self.names = {NUMBER: lanes.format("double"), TRUTH: lanes.format("i1"), WORD: lanes.format("i64")}
        self.names |= {INDEX: "i64", UNIFORM: "i1"}
        self.suffix, self.words = ("f64", "i64") if width == 1 else (f"v{width}f64", f"v{width}i64")
        self.fields = {
            "number": self.names[NUMBER],
            "truth": self.names[TRUTH],
            "word": self.names[WORD],
            "suffix": self.suffix,
            "words": self.words,
            "yes": self.constant(True, TRUTH),
            "zero": self.constant(0, WORD),
            "lanes": lane if width == 1 else "<" + ", ".join(f"i64 {lane}" for lane in range(width)) + ">",
        }

    def constant(self, value: Any, kind: str) -> str:
        """Return a Python number as a constant."""
        if kind == NUMBER:
            single, text = "double", hexadecimal(float(value))
        elif kind == TRUTH:
            single, text = "i1", str(bool(value)).lower()
        else:
            single, text = "i64", str(value if value < 1 << 63 else value - (1 << 64))
        return text if self.width == 1 or kind in (INDEX, UNIFORM) else f"splat ({single} {text})"


def _width(s: Call) -> int:
    """Return the width of the vectors in a call over several rows."""
    return 1 << (s.rows - 1).bit_length()


class Llvm:
    """Printer of LLVM's representation. Memories are pointers: a memory of lanes has W numbers for each index."""

    convention: ClassVar[str] = ""
    """Calling convention of the main function, if it is not that of C."""
    passed: ClassVar[tuple[str, ...]] = ()
    """Names of integers that are the last arguments of every function."""
    lane: ClassVar[str] = "0"
    """The number of the lane where there is only one."""

    def __init__(self, program: Program, width: int) -> None:
        if width > 1:
            check_apart(program)
        self.program, self.types = program, Types(width, self.lane)
        self.lines: list[str] = []
        self.label = ""
        self.count = 0
        self.text = [*self._declarations(), ATTRIBUTES]
        for function in program.functions:
            self._define(function, masked=function is not program.main and width > 1)

    def __str__(self) -> str:
        return "\n".join(self.text) + "\n"

    def _declarations(self) -> list[str]:
        t, declarations = self.types, list[str]()
        calls = (s for function in self.program.functions for s in statements(function.body) if isinstance(s, Call))
        for types in (t, *(Types(width) for width in sorted({_width(s) for s in calls if s.rows > 1}))):
            number, word = types.names[NUMBER], types.names[WORD]
            declarations.append(f"declare {number} @llvm.sqrt.{types.suffix}({number})")
            declarations.append(f"declare {word} @llvm.fshl.{types.words}({word}, {word}, {word})")
        if t.width > 1:
            given = f"{t.names[NUMBER]}, ptr, i32, {t.names[TRUTH]}"
            declarations.append(f"declare void @llvm.masked.store.{t.suffix}.p0({given})")
        return declarations

    # Text of the parts.

    def _put(self, line: str) -> None:
        self.lines.append("  " + line)

    def _new(self) -> str:
        self.count += 1
        return f"%.{self.count}"

    def _let(self, line: str) -> str:
        name = self._new()
        self._put(f"{name} = {line}")
        return name

    def _value(self, value: Value, kind: str) -> str:
        if isinstance(value, str):
            return value if value.startswith("%") or " " in value else f"%{value}"
        return self.types.constant(value, kind)

    def _typed(self, value: Value, kind: str) -> str:
        return f"{self.types.names[kind]} {self._value(value, kind)}"

    def _splat(self, single: str, value: str, kind: str, name: str | None = None) -> str:
        """Return a value that all lanes share as a vector with one element for each lane."""
        name = name or self._new()
        if self.types.width == 1:
            self._put(f"{name} = bitcast {single} {value} to {single}")
            return name
        many = self.types.names[kind]
        first = self._let(f"insertelement {many} poison, {single} {value}, i64 0")
        self._put(f"{name} = shufflevector {many} {first}, {many} poison, <{self.types.width} x i32> zeroinitializer")
        return name

    def _begin_block(self, label: str) -> None:
        self._put(f"\n{label}:")
        self.label = label

    # Functions.

    def _parameters(self, function: Function) -> list[tuple[str, str]]:
        pointers = [("ptr noalias", f"%{memory.name}") for memory in self.program.memories]
        if function is self.program.main:
            return pointers + [("i64", f"%{name}" if kind == INDEX else f"%{name}.given") for name, kind in function.params]
        typed = [(self.types.names[kind], f"%{name}") for name, kind in function.params]
        return pointers + typed + [("i64", name) for name in self.passed]

    def _gives(self, function: Function) -> str:
        return "{ " + ", ".join(self.types.names[kind] for _, kind in function.outs) + " }" if function.outs else "void"

    def _define(self, function: Function, masked: bool) -> None:
        self.lines = []
        self._begin_block(".entry")
        main = function is self.program.main
        if main:
            self._begin(function)
        # Vectors of several rows: the place of each number, the numbers known before the first loop, and vectors of those.
        self.places, self.vectors = dict[Value, tuple[str, int, int]](), dict[Any, str]()
        begin = next((k for k, s in enumerate(function.body) if isinstance(s, Loop)), 0)
        self.early = {s.ref for s in function.body[:begin] if isinstance(s, (Op, Load))}
        self._block(function.body[:begin], "%.mask" if masked else None)
        self.hoisted, place = list[str](), len(self.lines)
        self._block(function.body[begin:], "%.mask" if masked else None)
        self.lines[place:place] = self.hoisted
        gives, out = self._gives(function), ""
        for place, (value, kind) in enumerate(function.outs):
            out = self._let(f"insertvalue {gives} {out or 'poison'}, {self._typed(value, kind)}, {place}")
        parameters = self._parameters(function) + [(self.types.names[TRUTH], "%.mask")] * masked
        listed = ", ".join(f"{kind} {name}" for kind, name in parameters)
        head = f"define {self.convention if main else 'internal '}{gives} @{function.name}({listed}) #0 {{"
        self.text += [head, *self.lines, f"  ret {gives} {out}".rstrip(), "}"]

    def _begin(self, main: Function) -> None:
        """Add the first lines of the function to run."""
        for name, kind in main.params:
            if kind == WORD:
                self._splat("i64", f"%{name}.given", WORD, f"%{name}")

    def _rows(self, s: Call) -> None:
        """Print the operations of a function of numbers on vectors of rows."""
        single, self.types = self.types, Types(_width(s))
        names: dict[Value, str] = {}
        for k, (name, kind) in enumerate(s.function.params):
            names[name] = self._column(s.args[k * s.rows : (k + 1) * s.rows], kind, single)
        for op in s.function.body:
            names[op.ref] = self._new()
            self._op(op._replace(ref=names[op.ref][1:], args=tuple(names.get(x, x) for x in op.args)))
        made = [names[x] for x, _ in dict.fromkeys(s.function.outs) if x in names and (x, _) not in s.function.params]
        for k, (name, kind) in enumerate(s.refs):
            vector, row = made[k // s.rows], k % s.rows
            self._put(f"%{name} = extractelement {self.types.names[kind]} {vector}, i64 {row}")
            self.places[name] = vector, row, self.types.width
        self.types = single

    def _column(self, values: tuple[Value, ...], kind: str, single: Types) -> str:
        """Return the vector of a number, truth or word in several rows."""
        width, many = self.types.width, self.types.names[kind]
        sources = [self.places.get(x, ("", 0, 0)) for x in values]
        if len({(name, size) for name, _, size in sources}) == 1 and (vector := sources[0][0]):
            rows = [row for _, row, _ in sources]
            if sources[0][2] == width and rows == [*range(len(rows))]:
                return vector
            wide = many.replace(f"<{width} ", f"<{sources[0][2]} ")
            mask = ", ".join([f"i32 {row}" for row in rows] + ["i32 poison"] * (width - len(rows)))
            return self._let(f"shufflevector {wide} {vector}, {wide} poison, <{width} x i32> <{mask}>")
        # Vectors that do not change in loops are assembled before them.
        early = all(not isinstance(x, str) or x in self.early for x in values)
        if early and (values, kind) in self.vectors:
            return self.vectors[values, kind]
        lines, self.lines = self.lines, list[str]() if early else self.lines
        one = single.names[kind]
        constants = [single.constant(x, kind) if not isinstance(x, str) else "poison" for x in values]
        constants += ["poison"] * (width - len(values))
        vector = "<" + ", ".join(f"{one} {x}" for x in constants) + ">"
        for row, x in enumerate(values):
            if isinstance(x, str):
                vector = self._let(f"insertelement {many} {vector}, {one} %{x}, i64 {row}")
        if early:
            self.hoisted += self.lines
            self.lines = lines
            self.vectors[values, kind] = vector
        return vector

    def _call(self, s: Call, mask: str | None) -> None:
        if s.rows > 1:
            self._rows(s)
            return
        given = [f"ptr %{memory.name}" for memory in self.program.memories]
        given += [self._typed(value, kind) for value, (_, kind) in zip(s.args, s.function.params, strict=True)]
        given += [f"i64 {name}" for name in self.passed]
        if self.types.width > 1:
            given.append(self._typed(mask or self.types.fields["yes"], TRUTH))
        gives = self._gives(s.function)
        line = f"call {gives} @{s.function.name}({', '.join(given)})"
        if not s.function.outs:
            self._put(line)
            return
        out = self._let(line)
        for place, (name, _) in enumerate(s.refs):
            self._put(f"%{name} = extractvalue {gives} {out}, {place}")

    # Statements.

    def _block(self, block: tuple[Any, ...], mask: str | None) -> None:
        for s in block:
            if isinstance(s, Op):
                self._op(s)
            elif isinstance(s, Load):
                self._load(s)
            elif isinstance(s, Store):
                self._store(s, mask)
            elif isinstance(s, Call):
                self._call(s, mask)
            elif isinstance(s, Branch):
                self._branch(s, mask)
            else:
                self._loop(s, mask)

    def _op(self, s: Op) -> None:
        values: list[str] = []
        kinds = s.operation.takes
        for value, kind in zip(s.args, kinds, strict=True):
            # The count of a rotation is a word here.
            values.append(self._value(value, WORD if kind == STATIC else kind))
        line = s.operation.meanings["llvm"].format(*values, **self.types.fields)
        if INDEX in kinds and s.operation.gives in (NUMBER, WORD):
            single = {NUMBER: "double", WORD: "i64"}[s.operation.gives]
            self._splat(single, self._let(line), s.operation.gives, f"%{s.ref}")
        else:
            self._put(f"%{s.ref} = {line}")

    def _address(self, name: str, index: Value) -> str:
        kind = self.types.names[NUMBER] if self.program.memory(name).lanes else "double"
        return self._let(f"getelementptr {kind}, ptr %{name}, {self._typed(index, INDEX)}")

    def _load(self, s: Load) -> None:
        place = self._address(s.memory, s.index)
        if self.program.memory(s.memory).lanes or self.types.width == 1:
            self._put(f"%{s.ref} = load {self.types.names[NUMBER]}, ptr {place}")
        else:
            self._splat("double", self._let(f"load double, ptr {place}"), NUMBER, f"%{s.ref}")

    def _store(self, s: Store, mask: str | None) -> None:
        value, place = self._typed(s.value, NUMBER), self._address(s.memory, s.index)
        if mask is None:
            self._put(f"store {value}, ptr {place}")
            return
        t = self.types
        where = self._typed(mask, TRUTH)
        self._put(f"call void @llvm.masked.store.{t.suffix}.p0({value}, ptr {place}, i32 {8 * t.width}, {where})")

    def _branch(self, s: Branch, mask: str | None) -> None:
        at = self._new()[2:]
        self._put(f"br i1 {self._value(s.truth, UNIFORM)}, label %then.{at}, label %past.{at}")
        self._begin_block(f"then.{at}")
        self._block(s.body, mask)
        self._put(f"br label %past.{at}")
        self._begin_block(f"past.{at}")

    def _loop(self, s: Loop, mask: str | None) -> None:
        at, truth, yes = self._new()[2:], self.types.names[TRUTH], self.types.fields["yes"]
        # Lanes that have not finished; on one lane the branch tests this.
        narrows = s.done is not None and self.types.width > 1
        on, before = f"%.on{at}", mask or yes
        first = self.label
        self._put(f"br label %head.{at}")
        self._begin_block(f"head.{at}")
        start = len(self.lines)
        self._block(s.head, mask)
        more = self._let(f"icmp slt i64 %{s.counter}, {self._value(s.most, INDEX)}")
        if s.done is not None:
            go = self._let(f"xor {self._typed(s.done, TRUTH)}, {yes}")
            if narrows:
                mask = self._let(f"and {truth} {on}, {go}")
                bits = self._let(f"bitcast {truth} {mask} to i{self.types.width}")
                go = self._let(f"icmp ne i{self.types.width} {bits}, 0")
            more = self._let(f"and i1 {more}, {go}")
        tested = self.label
        self._put(f"br i1 {more}, label %turn.{at}, label %past.{at}")
        self._begin_block(f"turn.{at}")
        self._block(s.body, mask)
        phis = [(s.counter, "i64", "0", self._let(f"add i64 %{s.counter}, 1"))]
        for slot in s.slots:
            kind, after = self.types.names[slot.kind], self._value(slot.after, slot.kind)
            if narrows:
                after = self._let(f"select {truth} {mask}, {kind} {after}, {kind} %{slot.name}")
            phis.append((slot.name, kind, self._value(slot.before, slot.kind), after))
        if narrows:
            phis.append((on[1:], truth, before, mask or before))
        self.lines[start:start] = [
            f"  %{name} = phi {kind} [ {first_value}, %{first} ], [ {next_value}, %{self.label} ]"
            for name, kind, first_value, next_value in phis
        ]
        self._put(f"br label %head.{at}")
        self._begin_block(f"past.{at}")
        for slot in s.slots:
            self._put(f"%{slot.end} = phi {self.types.names[slot.kind]} [ %{slot.name}, %{tested} ]")
