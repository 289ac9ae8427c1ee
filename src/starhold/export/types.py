"""C types for the values of equations: structs with the fields of NamedTuples, vectors, quaternions, matrices."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from typing import Any, NamedTuple, get_type_hints

from starhold.algebra.operations import NUMBER, TRUTH
from starhold.algebra.quantity import Quantity
from starhold.algebra.structured import Buffer
from starhold.parts.contract import Parameter
from starhold.trace.handles import kind_of
from starhold.trace.recording import RESERVED
from starhold.trace.source import TIE


class Member(NamedTuple):
    """A member of a struct: its name (in an array, its index), its type, and its index in the Python tuple."""

    name: str
    type: Type
    place: int
    text: str = ""
    """Unit and meaning."""


class Type(NamedTuple):
    """A scalar (no members), or a struct; `kind`: its kind in a trace. `elements`: the name of the array in a struct of one
    array. `named`: the struct of a NamedTuple, which is passed by address."""

    name: str
    kind: str
    members: tuple[Member, ...] = ()
    elements: str = ""
    named: bool = False
    text: str = ""

    def braced(self, parts: list[str]) -> str:
        """Return the C initialiser that gives the members of a variable these values."""
        pairs = zip(self.members, parts, strict=True)
        # A literal needs its type only where it stands alone.
        texts = [text.removeprefix(f"({member.type.name})") for member, text in pairs]
        if self.named:
            texts = [f".{member.name} = {text}" for member, text in zip(self.members, texts, strict=True)]
        inner = ", ".join(map(tied, texts))
        return f"{{{{{inner}}}}}" if self.elements else f"{{{inner}}}"

    def leaves(self, base: str = "") -> Iterator[str]:
        """Yield the C expressions of the numbers of a variable."""
        if not self.members:
            yield base
        for member in self.members:
            yield from member.type.leaves(f"{base}.{member.name}")


DOUBLE, BOOL = Type("double", NUMBER), Type("bool", TRUTH)


def _struct(name: str, parts: list[tuple[str, Type]], elements: str = "", text: str = "") -> Type:
    return Type(name, name, tuple(Member(*part, k) for k, part in enumerate(parts)), elements, text=text)


WIDTH = 104
"""Comments are wrapped to lines of this length."""
VECTOR = _struct("vector_t", [(axis, DOUBLE) for axis in "xyz"], text="Components along the axes.")
QUATERNION = _struct("quaternion_t", [(f"q{k}", DOUBLE) for k in range(4)], text="Scalar part first, Hamilton product.")
MATRIX = _struct("matrix_t", [(f"row[{k}]", VECTOR) for k in range(3)], "row", "Rows of a 3x3 matrix.")
_PLAIN = {(DOUBLE, 3): VECTOR, (DOUBLE, 4): QUATERNION, (VECTOR, 3): MATRIX}


class Types:
    """Types by unique name. read: the fields of classes that are read: structs have no others."""

    def __init__(self, read: set[Any]) -> None:
        self.known = {kind.name: kind for kind in (QUATERNION, VECTOR, MATRIX)}
        self.read = read

    def of(self, value: Any, annotation: str = "") -> Type | None:
        """Return the type of a value; None if it has no numbers after recording."""
        if value is None or isinstance(value, (bool, int, Buffer)):
            return None
        if not isinstance(value, tuple):
            return BOOL if kind_of(value) == TRUTH else DOUBLE
        if hasattr(value, "_fields"):
            return self._of_fields(value)
        kinds = [kind for part in value if (kind := self.of(part)) is not None]  # pyright: ignore
        if len(kinds) < 2:
            return kinds[0] if kinds else None
        first, count = kinds[0], len(value)  # pyright: ignore
        if len(kinds) < count or any(kind != first for kind in kinds):
            return self.several("several_t", [(f"part{k}", self.of(part), k) for k, part in enumerate(value)])  # pyright: ignore
        # Without an annotation, four numbers are a quaternion.
        if (first, count) in _PLAIN and (count != 4 or not annotation or re.search("Quaternion|Any", annotation)):
            return _PLAIN[first, count]
        name = f"{first.name.removesuffix('_t')}s{count}_t"
        return self._keep(_struct(name, [(f"e[{k}]", first) for k in range(count)], "e"))

    def _of_fields(self, value: Any) -> Type | None:
        cls = type(value)
        words = getattr(cls, "__annotations__", {})
        members: list[Member] = []
        for place, (name, part) in enumerate(zip(value._fields, value, strict=True)):
            kind = self.of(part, str(words.get(name, ""))) if (cls, name) in self.read else None
            if kind is not None:
                members.append(Member(free(name), kind, place, _meaning(cls, name)))
        name = f"{title(cls)}_t"
        return self._keep(Type(name, name, tuple(members), "", True, sentence(cls.__doc__ or ""))) if members else None

    def several(self, name: str, parts: list[tuple[str, Type | None, int]], text: str = "") -> Type | None:
        """Return a struct of several values."""
        members = tuple(Member(word, kind, place) for word, kind, place in parts if kind is not None)
        return self._keep(Type(name, name, members, "", bool(text), text)) if members else None

    def _keep(self, kind: Type) -> Type:
        """Return a type under a unique name."""
        base, count = kind.name.removesuffix("_t"), 1
        while self.known.get(kind.name, kind) != kind:
            count += 1
            kind = kind._replace(name=f"{base}_{count}_t", kind=f"{base}_{count}_t")
        return self.known.setdefault(kind.name, kind)

    def members(self, kind: Type | None, value: Any) -> Iterator[tuple[Member, Any]]:
        """Yield the members of a struct and their values from a tuple, which may be nested in tuples of one value."""
        for member in kind.members if kind is not None else ():
            yield member, self.within(value)[member.place]

    def within(self, value: Any) -> Any:
        """Return the value inside nested tuples of one value."""
        while isinstance(value, tuple) and not hasattr(value, "_fields"):
            typed = [part for part in value if self.of(part) is not None]  # pyright: ignore
            if len(typed) != 1:
                break
            value = typed[0]
        return value


def free(name: str) -> str:
    """Return a name that is no reserved word of the language."""
    name = name.strip("_") or "x"
    return f"{name}_of" if name in RESERVED else name


def title(cls: Any) -> str:
    """Return the name of a struct, that of its class; classes of parts with equal names get the part's name too."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower().strip("_")
    ambiguous = name in ("params", "memory", "numbers", "reading") or (name == "state" and ".bodies." not in cls.__module__)
    return f"{cls.__module__.rpartition('.')[2]}_{name}" if ambiguous else name


def _meaning(cls: Any, name: str) -> str:
    """Return unit and meaning of a field, if its class states them."""
    try:
        hint = get_type_hints(cls, include_extras=True).get(name)
    except (NameError, TypeError):
        return ""
    for note in getattr(hint, "__metadata__", ()):
        if isinstance(note, (Quantity, Parameter)):
            return ": ".join(x for x in (note.unit if note.unit != "1" else "", note.text) if x)
    return ""


def tied(text: str) -> str:
    """Return a text that stays on one line if it is short."""
    return text.replace(" ", TIE) if len(text) < 65 else text


def sentence(doc: str) -> str:
    """Return the first sentence of a docstring, unless Python generated it."""
    text = " ".join(doc.split())
    return "" if re.match(r"\w+\(.*\)$", text) else re.split(r"(?<=\.) (?=[A-Z])", text, maxsplit=1)[0]


def wrapped(text: str) -> list[str]:
    """Return a text in lines."""
    lines: list[str] = []
    for line in text.replace("*/", "* /").replace("/*", "/ *").splitlines():
        indent = " " * (len(line) - len(line.lstrip()))
        lines += textwrap.wrap(line, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or [""]
    return lines


def comment(text: str) -> list[str]:
    """Return a text as the lines of a comment; none for an empty text."""
    lines = wrapped(text)
    if len(lines) < 2:
        return [f"/* {line} */" for line in lines]
    return [f"/* {lines[0]}", *(f"   {line}".rstrip() for line in lines[1:-1]), f"   {lines[-1]} */"]
