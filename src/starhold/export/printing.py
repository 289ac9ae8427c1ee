"""Prints recorded equations as C99 that is read: a function for each equation, structs, the names that Python has."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice, takewhile
from typing import Any, ClassVar

from starhold.algebra.operations import INDEX, NUMBER, TRUTH, UNIFORM, WORD
from starhold.export.needs import Needs
from starhold.export.recording import Parameter
from starhold.export.types import BOOL, Member, Type, Types, comment, paths, sentence
from starhold.trace.bounds import Form, constant
from starhold.trace.c99 import C99
from starhold.trace.program import Call, Function, Load, Op, Program, Store, Value, statements
from starhold.trace.source import TIE, Expression, names

SHORT = 130
"""Characters of a call that is written where its value is used, other than in `return`."""
_ROWS = [kind for count in (6, 3) if (kind := Types().of((0.0,) * count)) is not None]
"""Numbers that an equation reads from a memory at once."""
_MANY = 2
"""Values that one name has; of more, as a loop makes them, none is what the name says but one that is not known here."""
_IN_STEP = {"state": "body_state", "command": "wanted"}
"""Names that the step gives its own values where its parameters have the same ones."""


class Readable(C99):
    """The printer of the functions of one law. What it prints of `main` is the body of the step, whose values go to the
    members of `state` and `command`. parts: names of the parts of memories, by their first places."""

    types: ClassVar = {NUMBER: "double", TRUTH: "bool", INDEX: "int32_t", WORD: "uint64_t", UNIFORM: "bool"}

    def __init__(self, program: Program, needs: Needs, parts: dict[str, dict[int, str]]) -> None:
        self.needs, self.parts = needs, parts
        self.chunks: dict[str, list[str]] = {}
        super().__init__(program)

    # What a function takes and gives.

    def members(self, kind: Type) -> list[Member]:
        """Return the members of a struct that are read."""
        return [m for m in kind.members if not kind.named or (kind.name, m.name) in self.needs.members]

    def split(self, kind: Type, values: Sequence[Value]) -> Iterator[tuple[Member, list[Value]]]:
        """Yield the members of a struct that are read, each with its leaves among these of the struct."""
        source, members = iter(values), self.members(kind)
        for member in kind.members:
            part = list(islice(source, sum(1 for _ in paths(member.type, ""))))
            if member in members:
                yield member, part

    def _result(self, function: Function) -> Type | None:
        """Return the type of what a function gives; None where nobody reads any of it."""
        kind: Type | None = function.shape.result
        return None if kind is None or (kind.named and not self.members(kind)) else kind

    def _given(self, s: Call) -> Iterator[tuple[Parameter, list[Value]]]:
        """Yield the parameters that a function reads, and what a call gives for them."""
        values = iter(s.args)
        for param in s.function.shape.params:
            part = list(islice(values, len(param.leaves)))
            if self.needs.takes(s.function, param):
                yield param, part

    def _head(self, function: Function) -> str:
        memories = self.memories[function.name]
        given = [f"{'' if memory.writable else f'const{TIE}'}double{TIE}*{memory.name}" for memory in memories]
        for param in (param for param in function.shape.params if self.needs.takes(function, param)):
            kind = param.type.name
            given.append(f"const{TIE}{kind}{TIE}*{param.name}" if param.type.named else f"{kind}{TIE}{param.name}")
        result = self._result(function)
        gives = "void" if result is None else result.name
        return f"static {gives} {self.titles[function.name]}({', '.join(given) or 'void'})"

    # Functions.

    def _prepare(self, function: Function) -> None:
        self._function, shape, names_read = function, function.shape, self.needs.live[function.name]
        self._variables: dict[str, Type] = {}
        """Types of variables and of members of such, by how they are reached."""
        self._texts_of: dict[str, str] = {}
        """Texts that stand for values with other names in the program."""
        self._structs: dict[Any, str] = {}
        """Variables that were made of numbers, by their types and these."""
        self._symbols: list[str] = []
        self._forms: dict[str, Form] = {}
        """Indices as sums of products of symbols: counters, and other indices."""
        self._addresses = {param.name for param in shape.params if param.link == "->"}
        for param in shape.params:
            self._register(param.type, param.name, param.link)
        for s in statements(function.body):
            if isinstance(s, Call) and s.refs and (result := self._result(s.function)) is not None:
                self._register(result, _variable(s))
        super()._prepare(function)
        # A variable that is read member by member is not read once.
        self._once -= {value.partition(".")[0] for value in self._read if "." in value}
        self._bases = {value.partition(".")[0] for value in self._read}
        self._hints: dict[Any, str] = {}
        self._renewed: set[Any] = set()
        """Values whose names Python gives to others later: mostly they are read once, by those."""
        hints: dict[Any, str] = shape.hints
        last, counts = {name: key for key, name in hints.items()}, Counter(hints.values())
        for full, name in hints.items():
            key = (full[0], *(x for x in full[1:] if isinstance(x, str) and x in names_read))
            if len(key) > 1:
                self._hints[key] = _IN_STEP.get(name, name) if self.is_main(function) else name
                if counts[name] > _MANY or last[name] != full:
                    self._renewed.add(key)
        used = {re.split(r"\.|->", name)[0] for name in names(function)}
        memories = (memory.name for memory in self.memories[function.name])
        self._taken = {*used, *memories, *self.titles.values(), *_IN_STEP, "parameters", "input"}

    def _register(self, kind: Type, base: str, link: str = ".") -> None:
        self._variables[base] = kind
        for member in kind.members:
            self._register(member.type, f"{base}{link}{member.name}")

    def _operands(self, s: Any) -> Iterator[tuple[Value, int]]:
        if isinstance(s, Call):
            yield from ((value, 1) for param, part in self._given(s) for value in self._pieces(param.type, part))
        else:
            yield from super()._operands(s)

    def _results(self, function: Function) -> Iterator[tuple[Value, int]]:
        if (result := self._result(function)) is not None:
            yield from ((value, 1) for value in self._pieces(result, [out for out, _ in function.outs]))

    def _define(self, function: Function) -> None:
        first, outs, result = len(self.lines), [out for out, _ in function.outs], self._result(function)
        if not self.is_main(function):
            self.lines += ["", *comment(sentence(function.doc))]
            self.put(self._head(function))
            self.put("{")
        self.depth += 1
        self._statements(function.body)
        if self.is_main(function):
            self._finish(function.shape.result, outs)
        elif result is not None:
            self.put(f"return {self.whole(result, outs, hint=None)};")
        self.depth -= 1
        if not self.is_main(function):
            self.put("}")
        self.chunks[function.name] = self.lines[first:]

    def _finish(self, result: Type, outs: list[Value]) -> None:
        """Write the command and the state, each member computed before the first is changed."""
        lines: list[str] = []
        for variable, values in self.split(result, outs):
            for member, part in self.split(variable.type, values):
                place, text = f"{variable.name}->{member.name}", self.whole(member.type, part)
                if variable.name == "state" and text != place and not text.isidentifier():
                    name = self._fresh(member.name)
                    self.put(f"const {member.type.name} {name} = {text};")
                    text = name
                lines += [f"{place} = {text};"] if text != place else []
        for line in lines:
            self.put(line)

    # Values.

    def _fresh(self, hint: str) -> str:
        """Return a name that nothing has in this function."""
        name, count = hint, 1
        while name in self._taken:
            count += 1
            name = f"{hint}_{count}"
        self._taken.add(name)
        return name

    def use(self, value: Value, kind: str) -> Expression:
        """A value is written as the text or the name that stands for it."""
        if value in self._forms:
            form = self._forms[value]
            return Expression(form.text(self._symbols), "+" if len(form.terms) > 1 else "*")
        if not isinstance(value, str) or value in self._folded:
            return super().use(value, kind)
        base, dot, rest = value.partition(".")
        return Expression(self._texts_of.get(base, base) + dot + rest)

    def _base(self, kind: Type, values: Sequence[Value]) -> str | None:
        """Return the variable, or the member of one, that has these leaves; None where there is none."""
        bases: set[str | None] = set()
        for value, path in zip(values, paths(kind, ""), strict=True):
            if self.needs.reads(path):
                ends = (path.text, f"->{path.text[1:]}") if isinstance(value, str) else ()
                bases.add(next((value.removesuffix(end) for end in ends if value.endswith(end)), None))
        base = bases.pop() if len(bases) == 1 else None
        return base if base is not None and self._variables.get(base) == kind else None

    def _pieces(self, kind: Type, values: Sequence[Value]) -> Iterator[Value]:
        """Yield the variables that a value is made of."""
        base = self._base(kind, values) if kind.members else values[0]
        if base is not None:
            yield base
        else:
            yield from (value for member, part in self.split(kind, values) for value in self._pieces(member.type, part))

    def _key(self, kind: Type, values: Sequence[Value]) -> Any:
        """Return by what the hints know a value."""
        pairs = zip(values, paths(kind, ""), strict=True)
        tag = re.sub(r"(_\d+)?_t$", "", kind.name) if kind.named else ""
        return (tag, *(x for x, path in pairs if self.needs.reads(path) and isinstance(x, str)))

    def whole(self, kind: Type, values: Sequence[Value], hint: str | None = "") -> str:
        """Return the text of a value of a type, of which these are the leaves. hint: what to call it where Python does not
        (empty: then it gets no variable; None: it gets none at all)."""
        if not kind.members:
            return self.text(values[0], TRUTH if kind == BOOL else NUMBER)
        base = self._base(kind, values)
        if base is not None:
            return ("*" if base in self._addresses else "") + self.text(base, NUMBER)
        numbers = (kind.name, *map(repr, values))
        if numbers not in self._structs:
            text = self.initialiser(kind, values)
            name = None if hint is None else self._hints.get(self._key(kind, values), hint)
            if not name:
                return f"({kind.name}){text}"
            self._structs[numbers] = self._fresh(name)
            self.put(f"const {kind.name} {self._structs[numbers]} = {text};")
        return self._structs[numbers]

    def _argument(self, param: Parameter, values: list[Value]) -> str:
        """Return a value, or the address of one that is passed by pointer."""
        if not param.type.named:
            return self.whole(param.type, values)
        text = self.whole(param.type, values, hint=param.name)
        return text.removeprefix("*") if text.startswith("*") else f"&{text}"

    def initialiser(self, kind: Type, values: Sequence[Value]) -> str:
        """Return what a variable of a type, of which these are the leaves, is set to where it is declared."""
        if not kind.members:
            return self.whole(kind, values)
        texts: list[str] = []
        for member, part in self.split(kind, values):
            text = self.whole(member.type, part)
            text = text.removeprefix(f"({member.type.name})") if text.endswith("}") else text
            texts.append(_tied(f".{member.name} = {text}" if kind.named else text))
        return _in_braces(kind, texts)

    # Statements.

    def _block(self, block: tuple[Any, ...]) -> None:
        outer = dict(self._structs)
        self._statements(block)
        self._structs = outer

    def _statements(self, block: tuple[Any, ...]) -> None:
        block, place = tuple(s for s in block if not self._is_index(s)), 0
        while place < len(block):
            refs = tuple(s.ref for s in takewhile(lambda s: isinstance(s, Load), block[place:]))
            sizes = ((row, len(row.members)) for row in _ROWS)
            row, count = next(((row, n) for row, n in sizes if len(refs) >= n and ("", *refs[:n]) in self._hints), (None, 1))
            if row is None:
                super()._block(block[place : place + 1])
            else:
                name = self._fresh(self._hints["", *refs[:count]])
                self.put(f"const {row.name} {name} = {_in_braces(row, map(self._place, block[place : place + count]))};")
                self._structs[row.name, *map(repr, refs[:count])] = name
                self._texts_of.update({ref: f"{name}.{m.name}" for ref, m in zip(refs, row.members, strict=False)})
            place += count

    def _keep(self, ref: str, kind: str, expression: Expression, moves: bool = True) -> None:
        key = ("", ref)
        if re.fullmatch(r"-[\w.>-]*\w", expression.text) and len(expression.text) < SHORT // 3:
            # Written where it is read, however often.
            self._folded[ref] = expression
        elif key not in self._hints or (key in self._renewed and ref in self._once):
            super()._keep(ref, kind, expression, moves)
        else:
            self._texts_of[ref] = self._fresh(self._hints[key])
            self._let(kind, self._texts_of[ref], expression.text)

    def _call(self, s: Call) -> None:
        function = self.functions[s.function.name]
        memories, result = [memory.name for memory in self.memories[function.name]], self._result(function)
        given = [*memories, *(self._argument(param, part) for param, part in self._given(s))]
        text = f"{self.titles[function.name]}({', '.join(map(_tied, given))})"
        if result is None or _variable(s) not in self._bases:
            self.put(f"{text};" if result is None else f"(void){text};")
            return
        base, key = _variable(s), self._key(result, [ref for ref, _ in s.refs])
        hint = self._hints.get(key)
        nameless = hint is None or hint in self._taken or key in self._renewed
        short = len(text) <= SHORT or [*self._results(self._function)] == [(base, 1)]
        if nameless and short and base in self._once and not (memories or result.named):
            self._folded[base] = Expression(text)
            return
        self._texts_of[base] = self._fresh(hint or f"{self.titles[function.name]}_result")
        self.put(f"const {result.name} {self._texts_of[base]} = {text};")

    # Places in memory.

    def _is_index(self, s: Any) -> bool:
        """Tell whether a statement gives an index, which is written where it is used, and note what that is made of."""
        if not isinstance(s, Op) or s.operation.gives != INDEX:
            return False
        a, b = (self._form(value) for value in s.args)
        if s.operation.name == "index_minus":
            self._forms[s.ref] = self._symbol(f"({a.text(self._symbols)} - {self.text(s.args[1], INDEX)})")
        else:
            self._forms[s.ref] = a * b if s.operation.name == "index_product" else a + b
        return True

    def _form(self, value: Value) -> Form:
        if not isinstance(value, str):
            return constant(int(value))
        if value not in self._forms:
            self._forms[value] = self._symbol(value)
        return self._forms[value]

    def _symbol(self, text: str) -> Form:
        self._symbols.append(text)
        return Form({(len(self._symbols) - 1,): 1})

    def _place(self, s: Load | Store) -> str:
        """Return the text of a place: from where a part of the memory begins, if it lies in one."""
        form, parts = self._form(s.index), self.parts.get(s.memory, {})
        start = max((first for first in parts if first <= form.value), default=0)
        rest = (form - constant(start)).text(self._symbols)
        base = [f"{parts[start].upper()}_AT"] if start in parts else []
        text = " + ".join([*base, *([rest] if rest != "0" or not base else [])])
        return f"{s.memory}[{text}]".replace(" ", TIE)


def _variable(s: Call) -> str:
    """Return the variable that a call gives, of which its refs are members."""
    name: str = s.refs[0][0]
    return name.partition(".")[0]


def _in_braces(kind: Type, parts: Iterable[str]) -> str:
    inner = ", ".join(parts)
    return f"{{{{{inner}}}}}" if kind.elements else f"{{{inner}}}"


def _tied(text: str) -> str:
    """Return a text that stays on one line where it is short."""
    return text.replace(" ", TIE) if len(text) < SHORT // 2 else text
