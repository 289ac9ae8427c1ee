"""Operations of equations: each has a meaning for floats and one for every other reader of an equation.

An operation is written once, as a function of floats under `@operation(...)`, which gives its meaning for SymPy, for exact
polynomials, and in the languages in which a trace is printed. The type of a number selects the meaning.
"""

from __future__ import annotations

import linecache
import sys
from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeAlias, TypeVar, cast

from starhold.errors import InputError

NUMBER, TRUTH, WORD, INDEX, UNIFORM, STATIC = "number", "truth", "word", "index", "uniform", "static"
"""Kinds of values: numbers (IEEE doubles), truths, 64-bit unsigned words, and two kinds that all lanes share: indices
(counts and counters of loops) and truths about indices. A static argument is a Python number known while recording."""

PRINTED = ("llvm", "c", "javascript")
"""Languages in which traces are printed; an operation has a text for each, with {0}, {1}, ... for the operands."""
EXACT = ("symbolic", "polynomial")
"""Readers used in proofs; operations on words and indices have no meaning for them."""

_PLAIN = frozenset((float, int, bool))
_LIBRARIES = {"sympy": "symbolic", "flint": "polynomial"}
"""Reader of the numbers of each library; those of flint are coefficients."""


class Operation(NamedTuple):
    """Name, kinds of the arguments and of the result, and a meaning for each reader (a function, or a text to print)."""

    name: str
    takes: tuple[str, ...]
    gives: str
    plain: Callable[..., Any]
    meanings: dict[str, Any]

    def missing(self) -> list[str]:
        """Return the readers for which this operation lacks a meaning."""
        about = {*self.takes, self.gives}
        readers = PRINTED if about & {WORD, INDEX, UNIFORM} else (*PRINTED, *EXACT)
        return [reader for reader in readers if reader not in self.meanings]


_OWN = tuple(str(Path(__file__).parents[1] / folder) for folder in ("trace", "algebra"))
OPERATIONS: dict[str, Operation] = {}
"""All operations by name."""

_Function = TypeVar("_Function", bound=Callable[..., Any])


def operation(takes: str, gives: str, **meanings: Any) -> Callable[[_Function], _Function]:
    """Make a function of floats an operation of the same name. takes: kinds of its arguments, separated by blanks."""

    def register(function: _Function) -> _Function:
        entry = OPERATIONS[function.__name__] = Operation(function.__name__, tuple(takes.split()), gives, function, meanings)

        @wraps(function)
        def read(*values: Any) -> Any:
            return function(*values) if _PLAIN.issuperset(map(type, values)) else _read(entry, values)

        return cast(_Function, read)

    return register


_Form: TypeAlias = Callable[[Any], Any] | Callable[[Any, Any], Any]


def whole(symbolic: _Form, *slopes: _Form) -> Callable[[_Function], _Function]:
    """Make an equation one function for the readers used in proofs. symbolic: its form in SymPy; slopes: its derivatives
    with respect to each argument, functions of floats. Floats and traces read the equation itself."""

    def register(equation: _Function) -> _Function:
        name = equation.__name__

        def refuse(*_: Any) -> Any:
            raise library("starhold.algebra.polynomial").unreadable(f"a call of {name}: a polynomial has no {name}")

        meanings = {"symbolic": symbolic, "polynomial": refuse, "slopes": slopes}
        entry = Operation(name, (NUMBER,) * len(slopes), NUMBER, equation, meanings)

        @wraps(equation)
        def read(*values: Any) -> Any:
            walks = {_reader(value) for value in values} <= {None, "record"}
            return equation(*values) if walks else _read(entry, values)

        return cast(_Function, read)

    return register


def _read(entry: Operation, values: tuple[Any, ...]) -> Any:
    """Apply the operation as the interpreter of these values defines it, such as a recorder or dual numbers."""
    readers = [_reader(value) for value in values]
    for value, reader in zip(values, readers, strict=True):
        if reader == "record":
            return value.recorder.apply(entry, values)
        if reader == "itself":
            return value.read(entry, values)
    reader = next((reader for reader in readers if reader is not None), None)
    if reader is None:
        return entry.plain(*values)
    if reader not in entry.meanings:
        raise TypeError(f"{entry.name} means nothing to the reader {reader}")
    return entry.meanings[reader](*values)


def _reader(value: Any) -> str | None:
    """Return the reader of a number; None for plain ones. Raise InputError for an absent quantity."""
    if value is ABSENT:
        refuse_absent()
    return _reader_of(cast(Any, type(value)))


@cache
def _reader_of(cls: Any) -> str | None:
    if issubclass(cls, (float, int)) or cls.__name__ == "bool_":
        return None
    declared: str | None = getattr(cls, "reader", None)
    root = cls.__module__.partition(".")[0]
    if declared is None and root not in _LIBRARIES:
        raise TypeError(f"no reader for numbers of type {cls.__name__}")
    return declared if declared is not None else _LIBRARIES[root]


class Absent(tuple[()]):
    """A quantity that no part provides: using it raises an error."""

    __slots__ = ()

    def _refuse(self, *_: Any) -> NoReturn:
        refuse_absent()

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _refuse  # pyright: ignore
    __neg__ = __pos__ = __pow__ = __rpow__ = __abs__ = __float__ = __lt__ = __le__ = __gt__ = __ge__ = _refuse  # pyright: ignore


ABSENT = Absent()


def refuse_absent() -> NoReturn:
    """Raise an InputError that names the line where an equation uses a quantity that no part provides."""
    place, text = written_at()
    allowed = (
        'quantities that the loop has; a law gets time and is_valid where its file says READS = ("time",), ("is_valid",)'
    )
    raise InputError(place, "", f"a quantity that nothing gives, in `{text}`", allowed)


def written_at() -> tuple[str, str]:
    """Return the place of the line that runs now, and its text. For a law the place is its name and the line of its file,
    even inside a library that it calls."""
    frame: Any = sys._getframe(1)  # pyright: ignore[reportPrivateUsage]
    frames: list[Any] = []
    while frame is not None:
        if not frame.f_code.co_filename.startswith(_OWN):
            frames.append(frame)
        frame = frame.f_back
    frame = next((frame for frame in frames if "CARD" in frame.f_globals), frames[0])
    file, line = Path(frame.f_code.co_filename), frame.f_lineno
    law = f"law {file.stem.replace('_', '-')}: " if "CARD" in frame.f_globals else ""
    return f"{law}{file.name}, line {line}", linecache.getline(str(file), line).strip()


def library(name: str) -> Any:
    """Return a reader's module, loaded when its first number appears. It is imported by name, because its types are too
    loose for a strict checker."""
    return import_module(name)


class UnreadableError(TypeError):
    """A reader used in proofs cannot follow an equation; the message names the operation and the line."""


def unreadable(what: str) -> UnreadableError:
    """Return the error that names an operation and its place in the file."""
    place, text = written_at()
    return UnreadableError(f"{place}: {what}, in `{text}`")
