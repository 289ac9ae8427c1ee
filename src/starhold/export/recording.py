"""Records equations with the calls among them kept as functions, and with the names that Python has for values."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from starhold.algebra.operations import NUMBER, TRUTH, Operation
from starhold.algebra.structure import leaves, mapped
from starhold.algebra.structured import Buffer
from starhold.export.copies import COPIED, Copies
from starhold.export.types import BOOL, Member, Path, Type, Types, free, paths, title
from starhold.trace.handles import HANDLES, Handle
from starhold.trace.program import Block, Call, Function, Program, Value, prune, renamed, writes
from starhold.trace.recording import Cells, Recorder


class Parameter(NamedTuple):
    """A parameter of a function has a name, a type, leaves in order, and what joins its name and those of its members."""

    name: str
    type: Type
    leaves: tuple[Path, ...]
    link: str


class Signature(NamedTuple):
    """A function takes and gives values of these types (None: nothing). `hints`: what Python calls its values, by the key of
    each; `module`: where the equation stands."""

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
        self.copies = Copies(self._called)
        self.parts: dict[str, dict[int, str]] = {}
        """Names in the Python source of the parts of memories, by their first places."""
        self._inlined: set[Any] = set()
        self._hints: dict[Any, tuple[int, str]] = {}
        self._locals: dict[tuple[int, str], Any] = {}

    def parameter(self, name: str, like: Any, annotation: str = "", link: str = "") -> tuple[Any, Parameter]:
        """Return handles in the form of a value, which are the leaves of a variable of C, and what that is."""
        kind = self.types.of(like, annotation)
        link = link or ("->" if kind is not None and kind.named else ".")
        places = tuple(paths(kind, name, link))
        return self._shaped(like, places), Parameter(name, kind or BOOL, places, link)

    def step(self, params: list[Parameter], command: Any, state: Any) -> Program:
        """Return the program whose main function, which has been recorded outside of others, gives a command and a state."""
        members = {"command": self.types.of(command), "state": self.types.of(state)}
        result = Type("step_t", tuple(Member(name, kind) for name, kind in members.items() if kind is not None))
        main = self._function("step", "", params, (tuple(self._open[0]), (command, state)), result, "")
        return Program((*(function for function, _, _ in self._functions.values()), main), tuple(self.memories))

    # Calls.

    def call(self, equation: Callable[..., Any], values: tuple[Any, ...]) -> Any:
        """Record a call of an equation that is to be recorded once."""
        return self._called(self.copies.copy(equation), values)

    def _called(self, equation: Callable[..., Any], values: tuple[Any, ...]) -> Any:
        self._look_up_names()
        if not all(map(_is_part, leaves(values))) or not any(isinstance(leaf, (Handle, Buffer)) for leaf in leaves(values)):
            return equation(*values)
        key = (equation, self._form(values))
        if key not in self._functions and key not in self._inlined:
            self._record(equation, values, key)
        if key in self._inlined:
            return equation(*values)
        function, _, out = self._functions[key]
        places = tuple(paths(function.shape.result, self._names.new("r")))
        self._open[-1].append(Call(tuple((path.text, path.kind) for path in places), function, tuple(_numbers(values))))
        return self._shaped(out, places)

    def _record(self, equation: Any, values: tuple[Any, ...], key: Any) -> None:
        """Record a function, unless it only hands on arguments or what it gives has no type of C."""
        outer = self._hints, self._locals
        self._hints, self._locals = {}, {}
        words = {word: str(equation.__annotations__.get(word, "")) for word in inspect.signature(equation).parameters}
        with self._alone():
            given = [self.parameter(self._names.new(w), value, words[w]) for w, value in zip(words, values, strict=False)]
            body, out = self._block(equation, *(handles for handles, _ in given))
        if all(map(_is_part, leaves(out))) and (_numbers(out) or writes(body)):
            params = [param for _, param in given if param.leaves]
            doc, module = inspect.cleandoc(equation.__doc__ or ""), equation.__globals__["__name__"]
            function = self._function("", doc, params, (body, out), self._result(equation, out), module)
        else:
            function = None
        self._hints, self._locals = outer
        if function is None or not (function.body or any(map(_is_picked, function.outs, function.shape.leaves))):
            self._inlined.add(key)
        else:
            self._functions[key] = function._replace(name=self._titles.new(_title(equation))), [], out

    def _function(
        self, name: str, doc: str, params: list[Parameter], recorded: tuple[Block, Any], result: Type | None, module: str
    ) -> Function:
        """Return a function without what nobody reads; recorded: its block, and what it gives."""
        body, names = prune(recorded[0], _numbers(recorded[1]))
        outs = tuple(renamed(x, names) for x in _numbers(recorded[1]))
        hints = {(key[0], *(renamed(x, names) for x in key[1:])): hint for key, (_, hint) in self._hints.items()}
        gives = tuple(paths(result, ""))
        flat = tuple((path.text, path.kind) for param in params for path in param.leaves)
        shape = Signature(tuple(params), result, gives, hints, module)
        return Function(name, doc, flat, body, tuple(zip(outs, (path.kind for path in gives), strict=True)), shape)

    def _result(self, equation: Any, out: Any) -> Type | None:
        """Return the type of what a function gives; of several values a struct whose members are called as they are."""
        says = str(equation.__annotations__.get("return", ""))
        several = out if isinstance(out, tuple) and not hasattr(out, "_fields") else ()
        kinds = [self.types.of(part) for part in several]
        if sum(kind is not None for kind in kinds) < 2 or (len(kinds) > 2 and all(kind == kinds[0] for kind in kinds)):
            return self.types.of(out, says)
        inner = re.fullmatch(r"tuple\[(.*)\]", says)
        words = [] if inner is None else [re.sub(r"\W.*", "", word.strip()).lower() for word in inner[1].split(",")]
        members: dict[str, Type] = {}
        for place, (part, kind) in enumerate(zip(several, kinds, strict=True)):
            if kind is not None:
                word = words[place] if place < len(words) else f"part{place}"
                name = self._hints.get(_key(part), (0, word))[1]
                members[name if name not in members else f"{name}{place}"] = kind
        name = equation.__name__.strip("_")
        text = f"What {name} gives."
        return self.types.keep(Type(f"{name}_result_t", tuple(map(Member, members, members.values())), "", True, text))

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

    def apply(self, operation: Operation, values: tuple[Any, ...]) -> Any:
        """Record an operation."""
        self._look_up_names()
        return super().apply(operation, values)

    def _look_up_names(self) -> None:
        """Note what the equations that run now call their values; where several name one, the outermost does."""
        frame: Any = sys._getframe(2)  # pyright: ignore[reportPrivateUsage]
        frames: list[Any] = []
        while frame is not None and frame.f_code is not Recorder._block.__code__:
            if COPIED in frame.f_globals and not frame.f_code.co_name.startswith("<"):
                frames.append(frame)
            frame = frame.f_back
        for depth, frame in enumerate(reversed(frames)):
            for name, value in frame.f_locals.items():
                # Values are kept, so that the place of one is not taken by another.
                if self._locals.get((id(frame), name)) is not value:
                    self._locals[id(frame), name] = value
                    self._note(free(name), value, depth)

    def _note(self, name: str, value: Any, depth: int) -> None:
        key = _key(value)
        if key is not None and (key not in self._hints or depth < self._hints[key][0]):
            self._hints[key] = depth, name
        for field in getattr(value, "_fields", ()):
            part = getattr(value, field)
            lies = isinstance(part, Buffer) and isinstance(part.cells, Cells) and type(part.base) is int
            # The whole of a memory has a name already.
            if lies and part.size != part.cells.memory.size:
                self.parts.setdefault(part.cells.memory.name, {}).setdefault(part.base, free(field))


_OF_ROLES = frozenset(("torque", "control", "acceleration", "goal", "estimate", "momentum", "inertia", "command"))


def _title(equation: Any) -> str:
    """Return what a function is called: after its part too, where many parts have a function of that name."""
    name, module = free(equation.__name__), equation.__globals__
    return f"{module['__name__'].rpartition('.')[2]}_{name}" if name in _OF_ROLES and "CARD" in module else name


def _key(value: Any) -> Any:
    """Return the title of a value's class, and its numbers; None for what needs no name."""
    if not isinstance(value, (tuple, Handle)) or not all(map(_is_part, leaves(value))):
        return None
    numbers = _numbers(value)
    known = not any(isinstance(number, str) for number in numbers)
    return None if known else (title(type(value)) if hasattr(value, "_fields") else "", *numbers)


def _is_picked(out: tuple[Value, str], path: Path) -> bool:
    """Tell whether a number that a function gives is none of an argument that it hands on whole, nor a constant."""
    name, dot, rest = out[0].partition(".") if isinstance(out[0], str) else ("", "", "")
    return "->" in name or not path.text.endswith(dot + rest)


def _counts(leaf: Any) -> bool:
    """Tell whether a leaf is a number or a truth of the program: not one that is known while recording."""
    return isinstance(leaf, (Handle, float)) and not isinstance(leaf, bool)


def _numbers(value: Any) -> list[Value]:
    return [leaf.ref if isinstance(leaf, Handle) else leaf for leaf in leaves(value) if _counts(leaf)]


def _is_part(leaf: Any) -> bool:
    """Tell whether a leaf may be a member of a struct, is known while recording, or lies in a buffer."""
    if isinstance(leaf, Buffer):
        return type(leaf.base) is type(leaf.size) is int
    return leaf.kind in (NUMBER, TRUTH) if isinstance(leaf, Handle) else isinstance(leaf, (bool, int, float))
