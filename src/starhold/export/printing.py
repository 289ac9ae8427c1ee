"""Prints recorded equations as C99 that is read: a function for each equation, structs, the names that Python has."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from starhold.algebra.operations import INDEX, NUMBER, TRUTH, WORD
from starhold.export.liveness import Needs
from starhold.export.memory import Place, Places, Run, runs
from starhold.export.recording import Parameter, Signature
from starhold.export.types import Type, comment, paths, sentence
from starhold.export.wording import SHORT, groups, kind_of_type, names_of, strings, tied
from starhold.trace.c99 import C99
from starhold.trace.program import Call, Function, Load, Program, Store, Value, reads, statements, writes
from starhold.trace.source import TIE, Expression, fitted

TYPES = {NUMBER: "double", TRUTH: "bool", INDEX: "int32_t", WORD: "uint64_t"}


class Whole(NamedTuple):
    """A variable, or a member of one, with a struct as its value; `pointer`: whether its address is what is had."""

    text: str
    pointer: bool = False


class Readable(C99):
    """The printer of the functions of one law. What it prints of `main` is the body of the step, whose values go to the
    members of `state` and `command`."""

    def __init__(self, program: Program, needs: Needs, parts: dict[str, dict[int, str]]) -> None:
        self.needs, self.parts = needs, parts
        self.rows: dict[str, Type] = {}
        self.used: dict[str, Type] = {}
        self.chunks: dict[str, list[str]] = {}
        self.heads: dict[str, str] = {}
        super().__init__(program)

    # What a function takes and gives.

    def constant(self, value: float) -> str:
        """Return a number as a constant of C."""
        return self._constant(value, NUMBER)

    def called(self, kind: Type) -> str:
        """Return the name of a type, noting that it is used."""
        for member in kind.members:
            self.called(member.type)
        if kind.members:
            self.used.setdefault(kind.name, kind)
        return kind.name

    def params(self, function: Function) -> list[Parameter]:
        """Return the parameters that the body reads."""
        shape: Signature = function.shape
        return [param for param in shape.params if (function.name, param.name) in self.needs.params]

    def result(self, function: Function) -> Type | None:
        """Return the type of what it gives; None where nobody reads any of it."""
        shape: Signature = function.shape
        found = shape.result
        return None if found is None or (found.named and not self.members(found)) else found

    def members(self, kind: Type) -> list[Any]:
        """Return the members of a struct that are read."""
        return [m for m in kind.members if not kind.named or (kind.name, m.name) in self.needs.members]

    def _head(self, function: Function) -> str:
        if function.shape is None or self.is_main(function):
            return super()._head(function)
        given = [f"double{TIE}*{memory.name}" if memory.writable else f"const{TIE}double{TIE}*{memory.name}"
                 for memory in self.memories[function.name]]  # fmt: skip
        for param in self.params(function):
            kind = self.called(param.type)
            given.append(f"const{TIE}{kind}{TIE}*{param.name}" if param.by_pointer else f"{kind}{TIE}{param.name}")
        result = self.result(function)
        gives = "void" if result is None else self.called(result)
        return f"static {gives} {self.titles[function.name]}({', '.join(given) or 'void'})"

    # Functions.

    def _prepare(self, function: Function) -> None:
        super()._prepare(function)
        shape: Signature | None = function.shape
        self.scopes: list[dict[Any, Whole]] = [{}]
        self.hints = {} if shape is None else dict(shape.hints)
        live = self.needs.live[function.name]
        # Of structs, members that nobody reads are gone.
        if self.is_main(function):
            # What the step is given has these names.
            self.hints = {
                key: {"state": "body_state", "command": "wanted"}.get(hint, hint) for key, hint in self.hints.items()
            }
        last = {hint: key for key, hint in self.hints.items()}
        # Names that Python gives anew, for the last value alone: those before are mostly read once, by the next.
        self.rebound = {key for key, hint in self.hints.items() if last[hint] != key}
        self.named = {
            strings(x for x in key if x in live or str(x).startswith("@")): hint
            for key, hint in self.hints.items()
            if isinstance(key, tuple)
        }
        self.own: dict[str, str] = {}
        self.taken_here = {*names_of(function), *self.titles.values()} - {x for x, _ in function.params}
        self.taken_here |= {param.name for param in shape.params} if shape is not None else {x for x, _ in function.params}
        self.taken_here |= {"parameters", "state", "input", "command"} if self.is_main(function) else set()
        self.taken_here |= {memory.name for memory in self.memories[function.name]}
        self.places = Places()
        self.calls, self.current, self.whole_calls = self._reading(function), function, dict[str, Any]()
        if shape is not None:
            for param in shape.params:
                pointer = bool(param.leaves) and param.leaves[0].text.startswith(f"{param.name}->")
                self._register(param.type, param.name, "->" if pointer else ".", pointer)

    def _reading(self, function: Function) -> dict[str, int]:
        """Count, for what each call gives, how often a member of it is read alone (many times) or the whole is (once)."""
        bases = {s.refs[0][0].split(".")[0] for s in statements(function.body) if isinstance(s, Call) and s.refs}
        found = dict.fromkeys(bases, 0)
        for value in [*reads(function.body), *(out for out, _ in function.outs)]:
            if isinstance(value, str) and value.split(".")[0] in found:
                found[value.split(".")[0]] += 1
        return found

    def _define(self, function: Function) -> None:
        first = len(self.lines)
        if function.shape is None:
            super()._define(function)
        elif not self.is_main(function):
            self.lines.append("")
            self.lines += comment(sentence(function.doc))
            self.put(self._head(function))
            self.put("{")
            self.depth += 1
            self._statements(function.body)
            result = self.result(function)
            if result is not None:
                self.put(f"return {self.whole(result, [out for out, _ in function.outs], hint='')};")
            self.close()
        else:
            self.depth += 1
            self._statements(function.body)
            self._finish(function)
            self.depth -= 1
        self.chunks[function.name] = self.lines[first:]

    def _finish(self, function: Function) -> None:
        """Write the command and the state, each member computed before the first is changed."""
        shape: Signature = function.shape
        result, outs = shape.result, [out for out, _ in function.outs]
        assert result is not None
        for variable in result.members:
            count = len(list(paths(variable.type, "")))
            own, outs = outs[:count], outs[count:]
            members = variable.type.members if variable.type.named else ()
            lines: list[str] = []
            for member in members or (variable,):
                size = len(list(paths(member.type, "")))
                place = f"{variable.name}->{member.name}" if members else f"*{variable.name}"
                text = self.whole(member.type, own[:size], hint=member.name)
                own = own[size:]
                if text == place:
                    continue
                if variable.name == "state" and not text.isidentifier():
                    name = self.fresh(member.name)
                    self.put(f"const {self.called(member.type)} {name} = {text};")
                    text = name
                lines.append(f"{place} = {text};")
            for line in lines:
                self.put(line)

    # Values.

    def fresh(self, hint: str) -> str:
        """Return a name that nothing has in this function."""
        name, count = hint, 1
        while name in self.taken_here:
            count += 1
            name = f"{hint}_{count}"
        self.taken_here.add(name)
        return name

    def use(self, value: Value, kind: str) -> Expression:
        """A value is written as the text or the name that stands for it."""
        if isinstance(value, str):
            if value in self._folded:
                return self._folded[value]
            base, dot, rest = value.partition(".")
            return Expression(self.own.get(base, base) + dot + rest)
        if kind == TRUTH:
            return Expression("true" if value else "false")
        return super().use(value, kind)

    def _register(self, kind: Type, base: str, link: str, pointer: bool = False, refs: str | None = None) -> None:
        """Remember that leaves of these names are those of a variable, and of its members. refs: what they are called."""
        if not kind.members:
            return
        own = base if refs is None else refs
        key = tuple(path.text for path in paths(kind, own, link) if self.needs.reads(path))
        if key:
            self.scopes[-1].setdefault((kind.name, key), Whole(base, pointer))
        for member in kind.members:
            self._register(member.type, f"{base}{link}{member.name}", ".", False, f"{own}{link}{member.name}")

    def _found(self, kind: Type, key: Any) -> Whole | None:
        own = (kind.name, key)
        return next((scope[own] for scope in reversed(self.scopes) if own in scope), None)

    def _hint(self, kind: Type, key: Any) -> str | None:
        """Return what Python calls a value."""
        if not kind.members:
            return self.hints.get(key[0])
        if kind.named:
            return self.named.get((f"@{re.sub(r'(_[0-9]+)?_t$', '', kind.name)}", *strings(key)))
        return self.hints.get(key)

    def whole(self, kind: Type, values: list[Value], hint: str | None = None, address: bool = False) -> str:
        """Return the text of a value of a type, of which these are the leaves. hint: what to call it where a variable is
        needed; address: whether its address is wanted."""
        if not kind.members:
            return self.text(values[0], TRUTH if kind.name == "bool" else NUMBER)
        leaves = list(paths(kind, ""))
        key = tuple(value for value, path in zip(values, leaves, strict=True) if self.needs.reads(path))
        found = self._found(kind, key)
        if found is not None:
            if address:
                return found.text if found.pointer else f"&{found.text}"
            return f"*{found.text}" if found.pointer else found.text
        base = values[0].split(".")[0] if isinstance(values[0], str) else ""
        folded = self._folded.get(base + "*")
        if folded is not None and (kind.name, key) == self.whole_calls.get(base):
            return folded.text
        text = self._made(kind, values)
        known = self._hint(kind, key)
        if address or (known and hint is None):
            name = self.fresh(known or hint or kind.name.removesuffix("_t"))
            self.put(f"const {self.called(kind)} {name} = {text};")
            self.scopes[-1][kind.name, key] = Whole(name)
            return f"&{name}" if address else name
        return f"({self.called(kind)}){text}"

    def _made(self, kind: Type, values: list[Value]) -> str:
        """Return the initialiser of a struct."""
        parts: list[str] = []
        rest = list(values)
        live = self.members(kind)
        for member in kind.members:
            count = len(list(paths(member.type, "")))
            own, rest = rest[:count], rest[count:]
            if member not in live:
                continue
            text = self.whole(member.type, own) if member.type.members else self.text(own[0], kind_of_type(member.type))
            plain = text.removeprefix(f"({self.called(member.type)})") if text.startswith("(") and "){" in text else text
            parts.append(tied(f".{member.name} = {plain}" if kind.named else plain))
        inner = ", ".join(parts)
        return f"{{{{{inner}}}}}" if kind.elements else f"{{{inner}}}"

    # Statements.

    @contextmanager
    def _scope(self) -> Iterator[None]:
        self.scopes.append({})
        yield
        self.scopes.pop()

    def _block(self, block: tuple[Any, ...]) -> None:
        with self._scope():
            self._statements(block)

    def _statements(self, block: tuple[Any, ...]) -> None:
        for s in runs(block, self.places):
            if isinstance(s, Run):
                self._run(s)
            elif isinstance(s, (Load, Store)) and self.places.knows(s.index):
                text = self._at(s.memory, self.places.of(s.index))
                if isinstance(s, Load):
                    self._keep(s.ref, NUMBER, Expression(text), moves=False)
                else:
                    self.put(f"{text} = {self.text(s.value, NUMBER)};")
            else:
                super()._block((s,))

    def _at(self, memory: str, place: Place) -> str:
        names = {first: f"{name.upper()}_AT" for first, name in self.parts.get(memory, {}).items()}
        place = place._replace(terms=tuple(self._term(term) for term in place.terms))
        return f"{memory}[{place.text(names)}]"

    def _term(self, term: str) -> str:
        return " * ".join(fitted(self.use(factor, INDEX), "*", 1) for factor in term.split(" * "))

    def _run(self, run: Run) -> None:
        """Read or write some numbers at once, or one by one where they are not a value of their own."""
        kind, memory = run.kind, run.own[0].memory
        assert kind is not None
        text = self._at(memory, run.first)
        stem = kind.name.removesuffix("_t")
        if isinstance(run.own[0], Load):
            refs = tuple(s.ref for s in run.own)
            name = self.fresh(self.hints.get(refs) or "row")
            self.rows[kind.name] = kind
            self.put(f"const {self.called(kind)} {name} = {stem}_at(&{text});")
            for ref, member in zip(refs, kind.members, strict=True):
                self.own[ref] = f"{name}.{member.name}"
            self.scopes[-1][kind.name, refs] = Whole(name)
            return
        values = tuple(s.value for s in run.own)
        if self._found(kind, values) is not None or self.hints.get(values):
            self.rows[kind.name] = kind
            self.put(f"put_{stem}(&{text}, {self.whole(kind, list(values))});")
            return
        for k, s in enumerate(run.own):
            place = run.first._replace(first=run.first.first + k)
            self.put(f"{self._at(memory, place)} = {self.text(s.value, NUMBER)};")

    def _keep(self, ref: str, kind: str, expression: Expression, moves: bool = True) -> None:
        hint = self.hints.get(ref)
        if re.fullmatch(r"-[\w.>-]*\w", expression.text) and len(expression.text) < SHORT // 3:
            # Written where it is read, however often.
            self._folded[ref] = expression
        elif hint is None or kind == INDEX or "." in ref or (ref in self.rebound and ref in self._once):
            super()._keep(ref, kind, expression, moves)
        else:
            name = self.own[ref] = self.fresh(hint)
            self._let(kind, name, expression.text)

    def _let(self, kind: str, name: str, text: str) -> None:
        self.put(f"const {TYPES[kind]} {name} = {text};")

    def _variable(self, kind: str, name: str, value: Value) -> None:
        self.put(f"{TYPES[kind]} {name} = {self.text(value, kind)};")

    def _counted(self, counter: str, most: str) -> str:
        return f"for (int32_t {counter} = 0; {counter} < {most}; {counter}++)"

    def _call(self, s: Call) -> None:
        function = self.functions[s.function.name]
        if function.shape is None:
            super()._call(s)
            return
        given = [memory.name for memory in self.memories[function.name]]
        args, shape = list(s.args), function.shape
        needed = self.params(function)
        for param in shape.params:
            own, args = args[: len(param.leaves)], args[len(param.leaves) :]
            if param in needed:
                given.append(self.whole(param.type, own, hint=None if param.by_pointer else "", address=param.by_pointer))
        text = f"{self.titles[function.name]}({', '.join(map(tied, given))})"
        result = self.result(function)
        if result is None or not any(ref in self._read for ref, _ in s.refs):
            self.put(f"{text};" if result is None else f"(void){text};")
            return
        base = s.refs[0][0].split(".")[0]
        leaves = list(paths(result, base))
        refs = tuple(path.text for path in leaves if self.needs.reads(path))
        hint = self._hint(result, refs)
        pure = not any(isinstance(x, Load) for x in statements(function.body)) and not self._touches(function)
        self.whole_calls[base] = (result.name, refs)
        rebound = refs in self.rebound or (len(refs) == 1 and refs[0] in self.rebound)
        # A struct that has a name is read member by member, or by its address.
        if (
            pure
            and not result.named
            and (rebound or hint in {None, *self.taken_here})
            and self._once_whole(base, refs, result)
            and len(text) <= SHORT
        ):
            self._folded[base if not result.members else base + "*"] = Expression(text)
            return
        if result.name.endswith("_result_t"):
            hint = result.name.removesuffix("_t")
        name = self.own[base] = self.fresh(hint or self.titles[function.name])
        self.put(f"const {self.called(result)} {name} = {text};")
        if result.members:
            self._register(result, name, ".", False, base)

    def _touches(self, function: Function) -> bool:
        return bool(self.memories[function.name]) or writes(function.body)

    def _once_whole(self, base: str, refs: tuple[str, ...], kind: Type) -> bool:
        """Tell whether what a call gives is read once, as a whole."""
        if len(refs) == 1:
            return self.calls.get(base) == 1
        return self.calls.get(base) == len(refs) and self._as_whole(refs, kind)

    def _as_whole(self, refs: tuple[str, ...], kind: Type) -> bool:
        """Tell whether these names are read where a value of their type stands: in a call, or as what the function gives."""
        function = self.current
        calls = [s for s in statements(function.body) if isinstance(s, Call) and s.function.shape is not None]
        rows = [(s.args, [param.type for param in s.function.shape.params]) for s in calls]
        if function.shape.result is not None:
            rows.append((tuple(out for out, _ in function.outs), [function.shape.result]))
        for values, kinds in rows:
            first = 0
            for one in kinds:
                for place, inner in groups(one, first):
                    if inner.name == kind.name and tuple(values[place : place + len(refs)]) == refs:
                        return True
                first += len(list(paths(one, "")))
        return False
