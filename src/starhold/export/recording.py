"""Records equations with their calls as functions, their tuples as C structs, and the names of values in the source."""

import ast
import linecache
import re
import sys
from collections.abc import Callable, Sequence
from functools import cache, update_wrapper
from itertools import islice
from math import nan
from types import CellType, FunctionType, ModuleType
from typing import Any, NamedTuple

from starhold.algebra import operations, structure, structured, words
from starhold.algebra.operations import NUMBER, TRUTH, Operation
from starhold.algebra.structure import leaves, mapped, rebuild
from starhold.algebra.structured import Buffer
from starhold.export.types import Type, Types, free, sentence, wrapped
from starhold.trace.handles import HANDLES, Handle, kind_of
from starhold.trace.program import Call, Function, Op, Program, Value, live_names, prune, renamed, writes
from starhold.trace.recording import Cells, Recorder

COPIED = "__copied__"
"""The mark of a copied module."""
_WRITTEN_OUT = frozenset(module.__name__ for module in (operations, structure, structured, words))
_RECORDED_ONCE = structured.function(lambda: None).__code__


class Copies:
    """Copies of modules in which every equation is replaced by a function that passes the call, with a copy of the
    equation, to `call(copy, values)`. The modules themselves are not changed."""

    def __init__(self, call: Callable[[Callable[..., Any], tuple[Any, ...]], Any]) -> None:
        self._call = call
        self._modules: dict[int, ModuleType] = {}
        self._copies: dict[Any, Callable[..., Any]] = {}
        self._callers: dict[Any, Callable[..., Any]] = {}

    def seen(self, value: Any) -> Any:
        """Return the substitute for a value in a copy: for an equation a function that forwards the call, for a table or a
        module of equations one of such functions."""
        if isinstance(value, FunctionType):
            return self._caller(value)
        if isinstance(value, dict) and value and all(isinstance(x, FunctionType) for x in value.values()):
            return {key: self.seen(x) for key, x in value.items()}
        return self._module(vars(value)) if isinstance(value, ModuleType) and _has_equations(vars(value)) else value

    def copy(self, equation: Any) -> Callable[..., Any]:
        """Return the copy of an equation."""
        if equation not in self._copies:
            cells = tuple(CellType(self.seen(cell.cell_contents)) for cell in equation.__closure__ or ())
            names = vars(self._module(equation.__globals__))
            copy = FunctionType(equation.__code__, names, equation.__name__, equation.__defaults__, cells)
            copy.__kwdefaults__ = equation.__kwdefaults__
            self._copies[equation] = update_wrapper(copy, equation)
        return self._copies[equation]

    def _module(self, names: dict[str, Any]) -> ModuleType:
        if id(names) not in self._modules:
            module = self._modules[id(names)] = ModuleType(names["__name__"])
            vars(module).update(names, **{COPIED: True})
            vars(module).update({name: self.seen(x) for name, x in names.items() if not name.startswith("__")})
        return self._modules[id(names)]

    def _caller(self, equation: Any) -> Callable[..., Any]:
        if equation not in self._callers:
            inner = equation.__wrapped__ if equation.__code__ is _RECORDED_ONCE else equation

            def call(*values: Any, **named: Any) -> Any:
                copy = self.copy(inner)
                return copy(*values, **named) if named else self._call(copy, values)

            # `where` itself handles truths that are known while recording.
            self._callers[equation] = call if _has_equations(inner.__globals__) and inner.__name__ != "where" else equation
        return self._callers[equation]


def _has_equations(names: dict[str, Any]) -> bool:
    """Return whether a module contains equations: one of this package, or a file with a part."""
    name = str(names.get("__name__", ""))
    return "CARD" in names or (name.startswith("starhold.") and name not in _WRITTEN_OUT)


MAKE, MEMBER = "make", "member"
"""Operations only of this trace: making a struct of its members, and reading a member of a struct."""


class Signature(NamedTuple):
    """`addresses`: parameters that are passed by address; `names`: the names of values in the source; `module`: the module
    of the equation; `places`: the destinations of the step's results."""

    addresses: frozenset[str]
    names: dict[str, str]
    module: str = ""
    places: tuple[str, ...] = ()


class Reads(Recorder):
    """A recorder that finds which fields of tuples passed between equations are read."""

    def __init__(self) -> None:
        super().__init__()
        self.copies = Copies(self._called)
        self._marks: dict[str, tuple[Any, ...]] = {}

    def given(self, _: str, like: Any) -> Any:
        """Return handles in the shape of a value."""
        return self._marked(like)

    def read(self, out: Any) -> set[Any]:
        """Return the fields on which the results of a program depend, as pairs of class and name."""
        live = {leaf.ref for leaf in leaves(self._marked(out)) if isinstance(leaf, Handle)}
        block, read, before = tuple(self._open[0]), set[Any](), -1
        # All structs of a class must have the same members.
        shared = {ref: fields for ref, fields in self._marks.items() if fields and type(fields[-1][0]) is type}
        while before != (before := len(read)):
            live = live_names(block, live)
            read |= {field for ref in live if ref in self._marks for field in self._marks[ref]}
            live |= {ref for ref, fields in shared.items() if read.issuperset(fields)}
        return read

    def _called(self, equation: Callable[..., Any], values: tuple[Any, ...]) -> Any:
        if not _is_recordable(values):
            return equation(*values)
        return self._marked(equation(*self._marked(values)), equation.__code__)

    def _marked(self, value: Any, owner: Any = None, through: tuple[Any, ...] = ()) -> Any:
        """Return a value with new numbers, which show whether its fields are read."""
        if isinstance(value, tuple):
            fields: Any = getattr(value, "_fields", range(len(value)))  # pyright: ignore
            owner = type(value) if hasattr(value, "_fields") else owner
            more = [(*through, (owner, name)) if owner else through for name in fields]
            return rebuild(value, [self._marked(part, None, tags) for part, tags in zip(value, more, strict=True)])  # pyright: ignore
        if not _counts(value):
            return value
        ref = self._names.new("t")
        given = value.ref if isinstance(value, Handle) else value
        self._open[-1].append(Op(ref, _operation(MEMBER, ("",), "", ""), (given,)))
        self._marks[ref] = through
        return HANDLES[kind_of(value)](self, ref)


class Recording(Recorder):
    """A recorder of equations and their calls. read: the fields of classes that are read."""

    def __init__(self, read: set[Any]) -> None:
        super().__init__()
        self.types = Types(read)
        self.copies = Copies(self._called)
        self.parts: dict[str, dict[int, str]] = {}
        """Names in the source of the parts of memories, by their first indices."""
        self._called_so: dict[str, str] = {}
        """Names in the source of the values of the function being recorded."""

    def given(self, name: str, like: Any) -> Any:
        """Return handles in the shape of a value, which are the leaves of a C variable."""
        return self._shaped(like, self.types.of(like), name)

    def step(self, params: dict[str, Any], results: dict[str, Any]) -> Program:
        """Return the program whose main function, recorded at the outermost level, takes these values and writes to the
        members of others."""
        outs: dict[str, tuple[Value, str]] = {}
        for name, value in results.items():
            for m, part in self.types.members(self.types.of(value), value):
                outs[f"{name}->{m.name}"] = self._whole(part, m.type), m.type.kind
        body, _ = prune(tuple(self._open[0]), [out for out, _ in outs.values()])
        given = tuple((name, kind.kind) for name, value in params.items() if (kind := self.types.of(value)) is not None)
        names = {ref: {"state": "body_state", "command": "wanted"}.get(name, name) for ref, name in self._called_so.items()}
        shape = Signature(frozenset({name for name, _ in given} - {"parameters"}), names, "", tuple(outs))
        main = Function("step", "", given, body, tuple(outs.values()), shape)
        return Program((*(entry[0] for entry in self._functions.values() if entry), main), tuple(self.memories))

    # Calls.

    def _called(self, equation: Any, values: tuple[Any, ...]) -> Any:
        here = _here()
        key = (equation, self._form(values)) if _is_recordable(values) else None
        if key is not None and key not in self._functions:
            self._functions[key] = self._record(equation, values)
        if key is None or self._functions[key] is None:
            out = equation(*values)
            self._note_parts(out)
            return out
        function, kept, (out, result, kinds) = self._functions[key]
        args: list[Value] = []
        for place, (word, _) in zip(kept, function.params, strict=True):
            args.append(self._whole(values[place], kinds[place]))
            name = here.given[place] if place < len(here.given) else ""
            if kinds[place].members and (name or word in function.shape.addresses):
                self._called_so.setdefault(args[-1], name or word)
        ref = self._names.new("r")
        if here.name:
            self._called_so[ref] = here.name
        self._open[-1].append(Call(((ref, result.kind),) if result is not None else (), function, tuple(args)))
        return self._shaped(out, result, ref)

    def _record(self, equation: Any, values: tuple[Any, ...]) -> Any:
        """Record a function, unless it only passes arguments on or its result has no C type."""
        outer, self._called_so, entry = self._called_so, {}, None
        nothing: Any = None, None, ()
        code = equation.__code__
        # A value that a function takes besides its arguments keeps its name throughout the function.
        words = [code.co_varnames[min(k, code.co_argcount + code.co_kwonlyargcount)] for k in range(len(values))]
        says = [str(equation.__annotations__.get(word, "")) for word in words]
        kinds: list[Any] = list(map(self.types.of, values, says))
        with self._alone():
            names = [self._names.new(word) for word in words]

            def body() -> Any:
                out = equation(*map(self._shaped, values, kinds, names))
                if not all(map(_is_part, leaves(out))):
                    return None
                result = self._result(equation, out)
                return out, result, () if result is None else (self._whole(out, result),)

            block, gives = self._block(body)
            out, result, outs = gives or nothing
            block, new = prune(block, outs)
        outs = tuple((renamed(x, new), result.kind) for x in outs)
        acts = writes(block) or (outs and any(not isinstance(s, Op) or s.operation.name != MAKE for s in block))
        if gives and acts:
            live = live_names(block, [x for x, _ in outs])
            kept = [k for k, name in enumerate(names) if name in live]
            shape = Signature(
                frozenset(names[k] for k in kept if kinds[k].named), self._called_so, equation.__globals__["__name__"]
            )
            doc = "\n".join(wrapped(sentence(equation.__doc__ or "")))
            params = tuple((names[k], kinds[k].kind) for k in kept)
            function = Function(self._titles.new(_title(equation)), doc, params, block, outs, shape)
            entry = function, kept, (out, result, kinds)
        self._called_so = outer
        return entry

    def _result(self, equation: Any, out: Any) -> Type | None:
        """Return the type of a function's result; for several values a struct whose members have their names."""
        says = str(equation.__annotations__.get("return", ""))
        several = list(out) if isinstance(out, tuple) and not hasattr(out, "_fields") else []  # pyright: ignore
        kinds = [self.types.of(part) for part in several]
        if sum(kind is not None for kind in kinds) < 2 or (len(kinds) > 2 and all(kind == kinds[0] for kind in kinds)):
            return self.types.of(out, says)
        inner = re.fullmatch(r"tuple\[(.*)\]", says)
        words = [] if inner is None else [re.sub(r"\W.*", "", word.strip()).lower() for word in inner[1].split(",")]
        parts: dict[str, tuple[str, Type | None, int]] = {}
        for place, (part, kind) in enumerate(zip(several, kinds, strict=True)):
            word = words[place] if place < len(words) else f"part{place}"
            name = word if kind is None else self._called_so.get(str(self._whole(part, kind)), word)
            name = name if name not in parts else f"{name}{place}"
            parts[name] = name, kind if (equation.__code__, place) in self.types.read else None, place
        name = equation.__name__.strip("_")
        return self.types.several(f"{name}_result_t", list(parts.values()), f"What {name} gives.")

    # Structs.

    def _whole(self, value: Any, kind: Type) -> Value:
        """Return the variable of a value: the existing one, or one made of its members."""
        if not kind.members:
            value = self.types.within(value)
            return value.ref if isinstance(value, Handle) else float(value)
        parts = tuple(self._whole(part, m.type) for m, part in self.types.members(kind, value))
        operation = _operation(MAKE, tuple(m.type.kind for m in kind.members), kind.kind, kind)
        return self._once(_made_of(kind, parts), lambda ref: Op(ref, operation, parts), NUMBER).ref

    def _shaped(self, like: Any, kind: Type | None, ref: str) -> Any:
        """Return the shape of a value with the numbers of a variable; numbers that are never read are omitted."""
        if kind is None:
            return mapped(like, lambda leaf: HANDLES[kind_of(leaf)](self, _UNREAD[kind_of(leaf)]) if _counts(leaf) else leaf)
        if not isinstance(like, tuple):
            return HANDLES[kind.kind](self, ref)
        if self.types.within(like) is not like:
            return rebuild(like, [self._shaped(part, kind if self.types.of(part) else None, ref) for part in like])  # pyright: ignore
        members = {m.place: (m.type, f"{ref}.{m.name}") for m in kind.members}
        for m in kind.members:
            self._open[-1].append(Op(f"{ref}.{m.name}", _operation(MEMBER, (kind.kind,), m.type.kind, m.name), (ref,)))
        self._seen[-1][_made_of(kind, [name for _, name in members.values()])] = HANDLES[NUMBER](self, ref)
        return rebuild(like, [self._shaped(part, *members.get(k, (None, ""))) for k, part in enumerate(like)])  # pyright: ignore

    # Names.

    def apply(self, operation: Operation, values: tuple[Any, ...]) -> Any:
        """Record an operation."""
        out = super().apply(operation, values)
        if isinstance(out, Handle) and (name := _here().name):
            self._called_so.setdefault(out.ref, name)
        return out

    def _note_parts(self, value: Any) -> None:
        """Record the names of the parts of a memory; the memory as a whole already has a name."""
        for name in getattr(value, "_fields", ()):
            part = getattr(value, name)
            if isinstance(part, Buffer) and isinstance(part.cells, Cells) and part.size != part.cells.memory.size:
                self.parts.setdefault(part.cells.memory.name, {}).setdefault(part.base, free(name))


class _Here(NamedTuple):
    """Names in the source for the value of an expression and for the arguments of a call; empty if there are none."""

    name: str = ""
    given: tuple[str, ...] = ()


_THROUGH = ("starhold.trace.", "starhold.export.", "starhold.algebra.operations", "starhold.algebra.scalar")


def _here() -> _Here:
    """Return the names at the expression of the equation that runs now."""
    frame: Any = sys._getframe(1)  # pyright: ignore[reportPrivateUsage]
    while frame is not None and COPIED not in frame.f_globals and frame.f_globals["__name__"].startswith(_THROUGH):
        frame = frame.f_back
    if frame is None or COPIED not in frame.f_globals:
        return _Here()
    where = next(islice(frame.f_code.co_positions(), frame.f_lasti // 2, None))
    return _names_in(frame.f_code.co_filename).get(where, _Here())


@cache
def _names_in(file: str) -> dict[Any, _Here]:
    """Return the names at each expression of a file, by its begin and end."""
    names_at: dict[Any, _Here] = {}
    for node in ast.walk(ast.parse("".join(linecache.getlines(file)))):
        if isinstance(node, ast.Call):
            given = tuple(free(arg.id) if isinstance(arg, ast.Name) else "" for arg in node.args)
            names_at[_span(node)] = names_at.get(_span(node), _Here())._replace(given=given)
        elif isinstance(node, ast.Assign):
            targets, values = [x.elts if isinstance(x, ast.Tuple) else [x] for x in (node.targets[0], node.value)]
            for target, value in zip(targets, values, strict=False) if len(targets) == len(values) else ():
                if isinstance(target, ast.Name):
                    names_at[_span(value)] = names_at.get(_span(value), _Here())._replace(name=free(target.id))
    return names_at


def _span(node: ast.expr) -> tuple[int, int | None, int, int | None]:
    return node.lineno, node.end_lineno, node.col_offset, node.end_col_offset


_OF_ROLES = frozenset(("torque", "control", "acceleration", "goal", "estimate", "momentum", "inertia", "command"))


def _title(equation: Any) -> str:
    """Return the name of a function, with its part's name if several parts have a function of that name."""
    name, module = free(equation.__name__), equation.__globals__
    return f"{module['__name__'].rpartition('.')[2]}_{name}" if name in _OF_ROLES and "CARD" in module else name


_UNREAD: Any = {NUMBER: nan, TRUTH: False}
"""The placeholder of a value that is never read."""


def _operation(name: str, takes: tuple[str, ...], gives: str, about: Any) -> Operation:
    """Return an operation that no equation uses; `about` replaces its plain meaning."""
    return Operation(name, takes, gives, about, {"c": "".join(f"{{{k}}}" for k in range(len(takes)))})


def _made_of(kind: Type, parts: Sequence[Value]) -> Any:
    return (MAKE, kind.name, *((type(part), repr(part)) for part in parts))


def _counts(leaf: Any) -> bool:
    """Return whether a leaf is a number or a truth of the program, not one known while recording."""
    return isinstance(leaf, (Handle, float)) and not isinstance(leaf, bool)


def _is_recordable(values: tuple[Any, ...]) -> bool:
    """Return whether a call can become a function of C."""
    parts = list(leaves(values))
    return all(map(_is_part, parts)) and any(isinstance(leaf, (Handle, Buffer)) for leaf in parts)


def _is_part(leaf: Any) -> bool:
    """Return whether a leaf may be a member of a struct, is known while recording, or lies in a buffer."""
    if isinstance(leaf, Buffer):
        return type(leaf.base) is type(leaf.size) is int
    return leaf.kind in (NUMBER, TRUTH) if isinstance(leaf, Handle) else isinstance(leaf, (bool, int, float))
