"""Records equations with the calls among them kept as functions, and with the names that Python has for values."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, NamedTuple

from starhold.algebra.operations import NUMBER, TRUTH
from starhold.algebra.structure import leaves, mapped
from starhold.algebra.structured import Buffer
from starhold.export.rebinding import Rebinder
from starhold.export.types import BOOL, MATRIX, QUATERNION, VECTOR, Member, Path, Type, Types, free, paths, title
from starhold.trace.handles import HANDLES, Handle, kind_of
from starhold.trace.program import Call, Function, prune, renamed, writes
from starhold.trace.recording import Cells, Recorder

_PLAIN = (VECTOR, QUATERNION, MATRIX)
_SIZES = (3, 4, 6)


class Parameter(NamedTuple):
    """A parameter of a function has a name, a type, and leaves in order."""

    name: str
    type: Type
    leaves: tuple[Path, ...]

    @property
    def by_pointer(self) -> bool:
        """Whether the function is given its address."""
        return self.type.named


class Signature(NamedTuple):
    """A function takes and gives values of these types (None: nothing); `hints`: what Python calls its values, by the name
    of one or the names of its leaves; `module`: where the equation stands."""

    params: tuple[Parameter, ...]
    result: Type | None
    leaves: tuple[Path, ...]
    hints: dict[Any, str]
    module: str


class Recording(Recorder):
    """A recorder of equations that call each other."""

    def __init__(self) -> None:
        super().__init__()
        self.types = Types()
        self.hints: dict[Any, str] = {}
        self.rebinder = Rebinder(self._hook)
        self._inline: set[Any] = set()
        self._depths: dict[Any, int] = {}
        self.parts: dict[str, dict[int, str]] = {}
        """Names of the parts of memories, by their first places."""

    @contextmanager
    def recording(self) -> Generator[None]:
        """Let equations record here, and watch what they call their values."""
        before = sys.gettrace()
        with super().recording():
            sys.settrace(self._watch)
            try:
                yield
            finally:
                sys.settrace(before)

    @property
    def block(self) -> list[Any]:
        """The notes that were taken outside of functions."""
        return self._open[0]

    @property
    def recorded(self) -> list[Function]:
        """The functions that were recorded."""
        return [function for function, _, _ in self._functions.values()]

    def parameter(self, name: str, like: Any, link: str) -> tuple[Any, Parameter]:
        """Return handles in the form of a value, which are the leaves of a variable of C, and what it is."""
        found = self.types.of(like)
        if found is None:
            return like, Parameter(name, BOOL, ())
        places = tuple(paths(found, name, link))
        return self._shaped(like, places), Parameter(name, found, places)

    # Calls.

    def _hook(self, equation: Callable[..., Any], values: tuple[Any, ...], must: bool) -> Any:
        if all(_is_plain(value) for value in values) and any(isinstance(leaf, (Handle, Buffer)) for leaf in leaves(values)):
            key = (equation, self._form(values))
            if key not in self._inline and (key in self._functions or self._shape(equation, values, key)):
                return self._answer(key, values)
        return super().call(equation, values) if must else equation(*values)

    def call(self, equation: Callable[..., Any], values: tuple[Any, ...]) -> Any:
        """Record a call of an equation that asks for it."""
        return self._hook(equation, values, True)

    def _answer(self, key: Any, values: tuple[Any, ...]) -> Any:
        """Record a call of a function, and return what it gives."""
        function, _, out = self._functions[key]
        name = self._names.new("r")
        signature: Signature = function.shape
        refs = tuple((name + path.text, path.kind) for path in signature.leaves)
        args = tuple(_number(leaf) for value in values for leaf in leaves(value) if _counts(leaf))
        self._open[-1].append(Call(refs, function, args))
        return self._shaped(out, tuple(path._replace(text=name + path.text) for path in signature.leaves))

    def _shape(self, equation: Callable[..., Any], values: tuple[Any, ...], key: Any) -> bool:
        """Record a function, unless what it gives has no type of C, or it gives and changes nothing."""
        outer = self._open, self._seen, self._names, self.hints, self._depths
        self._open, self._seen, self.hints, self._depths = [], [], {}, {}
        self._names = type(self._names)(memory.name for memory in self.memories)
        params: list[Parameter] = []
        given: list[Any] = []
        for word, value in zip(inspect.signature(equation).parameters, values, strict=False):
            found = self.types.of(value)
            name = self._names.new(free(word))
            link = "->" if found is not None and found.named else "."
            places = tuple(paths(found, name, link))
            given.append(self._shaped(value, places))
            if found is not None:
                params.append(Parameter(name, found, places))
        body, out = self._block(equation, *given)
        names = self._titles
        try:
            result = self._result(equation, out)
            numbers = [leaf for leaf in leaves(out) if _counts(leaf)]
            kinds = [kind_of(leaf) for leaf in numbers]
        except (TypeError, ValueError):
            kinds, result, numbers = ["?"], None, []
        hints = self.hints
        self._open, self._seen, self._names, self.hints, self._depths = outer
        if any(kind not in (NUMBER, TRUTH) for kind in kinds) or not (numbers or writes(body)) or not _is_static(out):
            self._inline.add(key)
            return False
        body, changed = prune(body, [_number(leaf) for leaf in numbers])
        outs = tuple((renamed(_number(leaf), changed), kind) for leaf, kind in zip(numbers, kinds, strict=True))
        hints = {_renamed(key, changed): name for key, name in hints.items()}
        flat = tuple((path.text, path.kind) for param in params for path in param.leaves)
        module = equation.__globals__["__name__"]  # pyright: ignore[reportFunctionMemberAccess]
        shape = Signature(tuple(params), result, tuple(paths(result, "", ".")), hints, module)
        doc = inspect.cleandoc(equation.__doc__ or "")
        self._functions[key] = Function(names.new(_title(equation)), doc, flat, body, outs, shape), [], out
        return True

    def _result(self, equation: Any, out: Any) -> Type | None:
        """Return the type of what a function gives; of several values a struct whose members are called as they are."""
        if not isinstance(out, tuple) or hasattr(out, "_fields"):
            return self.types.of(out)
        several: Any = out
        found = [self.types.of(part) for part in several]
        whole = self.types.of(several)
        if whole in _PLAIN or sum(one is not None for one in found) < 2 or (len(found) > 2 and _is_group(several)):
            return whole
        words = _words(equation)
        members: list[Member] = []
        for place, (part, one) in enumerate(zip(several, found, strict=True)):
            if one is not None:
                hint = self.hints.get(_key(part)) or (words[place] if place < len(words) else f"part{place}")
                taken = {member.name for member in members}
                members.append(Member(hint if hint not in taken else f"{hint}{place}", one))
        own = equation.__name__.strip("_")
        return self.types.keep(Type(f"{own}_result_t", tuple(members), named=True, text=f"What {own} gives."))

    def _shaped(self, like: Any, places: tuple[Path, ...]) -> Any:
        """Return handles, called as the leaves of a variable, in the form of a value."""
        source = iter(places)

        def make(leaf: Any) -> Any:
            if not _counts(leaf):
                return leaf
            path = next(source)
            return HANDLES[path.kind](self, path.text)

        return mapped(like, make)

    # Names.

    def _watch(self, frame: Any, event: str, arg: Any) -> Any:
        if "__copied__" not in frame.f_globals or frame.f_code.co_name.startswith("<"):
            return None
        seen: dict[str, int] = {}
        own, depth = self.hints, 0
        while (frame := frame.f_back) is not None:
            depth += 1

        def note(frame: Any, event: str, arg: Any) -> Any:
            if event in ("line", "return") and self.hints is own:
                for name, value in frame.f_locals.items():
                    if seen.get(name) != id(value):
                        seen[name] = id(value)
                        self._note_parts(value)
                        key = _key(value)
                        # What the outermost function calls it.
                        if key is not None and depth < self._depths.get(key, 1 << 30):
                            self.hints[key], self._depths[key] = free(name), depth
            return note

        return note

    def _note_parts(self, value: Any) -> None:
        """Remember what parts of a memory are called; the whole of it has a name of its own."""
        if not isinstance(value, tuple):
            return
        for name, part in zip(getattr(value, "_fields", ()), value, strict=False):  # pyright: ignore
            if isinstance(part, Buffer) and type(part.base) is int and isinstance(part.cells, Cells):
                memory = part.cells.memory
                if part.size != memory.size:
                    self.parts.setdefault(memory.name, {}).setdefault(part.base, free(name))


_OF_ROLES = frozenset(("torque", "control", "acceleration", "goal", "estimate", "momentum", "inertia", "command"))


def _title(equation: Any) -> str:
    """Return what a function is called: what many parts have is called after the part too."""
    own, name = equation.__globals__, free(equation.__name__)
    stem = own["__name__"].rpartition(".")[2]
    return f"{stem}_{name}" if name in _OF_ROLES and "CARD" in own else name


def _key(value: Any) -> Any:
    """Return the name of a handle, or those of the leaves of a tuple; None for what needs no name."""
    if isinstance(value, Handle):
        return value.ref if value.kind in (NUMBER, TRUTH) else None
    if not isinstance(value, tuple) or not _is_plain(value):
        return None
    numbers = [leaf for leaf in leaves(value) if _counts(leaf)]
    if not any(isinstance(leaf, Handle) for leaf in numbers):
        return None
    kind = (f"@{title(type(value))}",) if hasattr(value, "_fields") else ()
    return (*kind, *(_number(leaf) for leaf in numbers))


def _renamed(key: Any, names: dict[str, Any]) -> Any:
    return tuple(renamed(x, names) for x in key) if isinstance(key, tuple) else renamed(key, names)


def _counts(leaf: Any) -> bool:
    """Tell whether a leaf is a number or a truth of the program: not one that is known while recording."""
    return isinstance(leaf, (Handle, float)) and not isinstance(leaf, bool)


def _number(leaf: Any) -> Any:
    return leaf.ref if isinstance(leaf, Handle) else leaf


def _is_plain(value: Any) -> bool:
    """Tell whether a value has a type of C: vectors, quaternions, matrices and NamedTuples of such."""
    if isinstance(value, tuple):
        parts: Any = value
        if hasattr(parts, "_fields"):
            return all(_is_part(part) for part in parts)
        return _is_group(parts)
    return _is_part(value)


def _is_part(value: Any) -> bool:
    """Tell whether a value may be a member of a struct."""
    if isinstance(value, tuple):
        return all(_is_part(part) for part in value)  # pyright: ignore
    if isinstance(value, Buffer):
        return type(value.base) is type(value.size) is int
    if isinstance(value, Handle):
        return value.kind in (NUMBER, TRUTH)
    return value is None or isinstance(value, (bool, int, float))


def _is_group(parts: Any) -> bool:
    """Tell whether these are a vector or a quaternion, six numbers, or rows of a matrix of such."""
    if all(isinstance(part, tuple) and not hasattr(part, "_fields") for part in parts):
        return len(parts) in _SIZES and all(len(part) == len(parts[0]) and _is_group(part) for part in parts)
    return len(parts) in _SIZES and all(isinstance(part, (Handle, float)) and _is_part(part) for part in parts)


def _is_static(value: Any) -> bool:
    return all(_is_part(leaf) for leaf in leaves(value))


def _words(equation: Any) -> list[str]:
    """Return the names of the types that an equation says it gives."""
    found = re.fullmatch(r"tuple\[(.*)\]", str(getattr(equation, "__annotations__", {}).get("return", "")))
    return [] if found is None else [re.sub(r"\W.*", "", word.strip()).lower() for word in found[1].split(",")]
