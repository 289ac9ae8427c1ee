"""Types of C for the values of equations: structs with the fields of NamedTuples, vectors, quaternions, matrices."""

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


class Member(NamedTuple):
    """A member of a struct has a name and a type; those of an array are called by their places in it."""

    name: str
    type: Type
    text: str = ""
    """Unit and meaning."""


class Type(NamedTuple):
    """A scalar (no members), or a struct. `elements`: a struct of one array, of that name. `named`: one of a NamedTuple,
    which is passed by its address and loses the members that nobody reads."""

    name: str
    members: tuple[Member, ...] = ()
    elements: str = ""
    named: bool = False
    text: str = ""


DOUBLE, BOOL = Type("double"), Type("bool")
VECTOR = Type("vector_t", tuple(Member(axis, DOUBLE) for axis in "xyz"), text="Components along the axes.")
QUATERNION = Type(
    "quaternion_t", tuple(Member(f"q{k}", DOUBLE) for k in range(4)), text="Scalar part first, Hamilton product."
)
MATRIX = Type("matrix_t", tuple(Member(f"row[{k}]", VECTOR) for k in range(3)), "row", text="Rows of a 3x3 matrix.")


class Path(NamedTuple):
    """A leaf of a value: how it is reached from the value, its kind, and the members of named structs on the way."""

    text: str
    kind: str
    through: tuple[tuple[str, str], ...]


class Types:
    """Types by their names, each with one form."""

    def __init__(self) -> None:
        self.known = {kind.name: kind for kind in (QUATERNION, VECTOR, MATRIX)}

    def of(self, value: Any, annotation: str = "") -> Type | None:
        """Return the type of a value; None where nothing of it is left once equations are recorded."""
        if value is None or isinstance(value, (bool, int, Buffer)):
            return None
        if not isinstance(value, tuple):
            return BOOL if kind_of(value) == TRUTH else DOUBLE
        if hasattr(value, "_fields"):
            return self._struct(value)
        kinds = [self.of(part) for part in value]
        members = tuple(Member(f"part{k}", kind) for k, kind in enumerate(kinds) if kind is not None)
        if len(members) < 2:
            return members[0].type if members else None
        first, count = members[0].type, len(value)
        if any(kind != first for kind in kinds):
            return self.keep(Type("several_t", members))
        # Of what is not annotated four numbers are a quaternion.
        turns = not annotation or "Quaternion" in annotation or "Any" in annotation
        plain = {(DOUBLE, 3): VECTOR, (VECTOR, 3): MATRIX, (DOUBLE, 4): QUATERNION if turns else None}.get((first, count))
        name = f"{first.name.removesuffix('_t')}s{count}_t"
        return plain or self.keep(Type(name, tuple(Member(f"e[{k}]", first) for k in range(count)), "e"))

    def _struct(self, value: Any) -> Type | None:
        cls = type(value)
        words = getattr(cls, "__annotations__", {})
        kinds = {name: self.of(part, str(words.get(name, ""))) for name, part in zip(value._fields, value, strict=True)}
        members = tuple(Member(free(name), kind, _meaning(cls, name)) for name, kind in kinds.items() if kind is not None)
        text = sentence(cls.__doc__ or "")
        return self.keep(Type(f"{title(cls)}_t", members, named=True, text=text)) if members else None

    def keep(self, kind: Type) -> Type:
        """Return a type under a name that no other has."""
        base, count = kind.name.removesuffix("_t"), 1
        while self.known.get(kind.name, kind) != kind:
            count += 1
            kind = kind._replace(name=f"{base}_{count}_t")
        return self.known.setdefault(kind.name, kind)


def free(name: str) -> str:
    """Return a name that is no word of the language."""
    name = name.strip("_") or "x"
    return f"{name}_of" if name in RESERVED else name


def title(cls: Any) -> str:
    """A struct is called as its class; parts have classes of the same names, which are called after the part too."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower().strip("_")
    stem = cls.__module__.rpartition(".")[2]
    ambiguous = name in ("params", "memory", "numbers", "reading") or (name == "state" and ".bodies." not in cls.__module__)
    return f"{stem}_{name}" if ambiguous else name


def _meaning(cls: Any, name: str) -> str:
    """Return unit and meaning of a field, where its class says them."""
    try:
        hint = get_type_hints(cls, include_extras=True).get(name)
    except (NameError, TypeError):
        return ""
    for note in getattr(hint, "__metadata__", ()):
        if isinstance(note, (Quantity, Parameter)):
            return ": ".join(x for x in (note.unit if note.unit != "1" else "", note.text) if x)
    return ""


def sentence(doc: str) -> str:
    """Return the first sentence of a docstring, unless Python made it."""
    text = " ".join(doc.split())
    return "" if re.match(r"\w+\(.*\)$", text) else re.split(r"(?<=\.) (?=[A-Z])", text, maxsplit=1)[0]


def paths(kind: Type | None, base: str, link: str = ".") -> Iterator[Path]:
    """Yield the leaves of a value of this type in order, of which `base` is the name."""
    if kind is not None and not kind.members:
        yield Path(base, TRUTH if kind == BOOL else NUMBER, ())
    for member in kind.members if kind is not None else ():
        for path in paths(member.type, f"{base}{link}{member.name}"):
            yield path._replace(through=((kind.name, member.name), *path.through)) if kind and kind.named else path


def comment(text: str, width: int = 104) -> list[str]:
    """Return a text as the lines of a comment; none of nothing."""
    lines: list[str] = []
    for line in text.replace("*/", "* /").replace("/*", "/ *").splitlines():
        indent = " " * (len(line) - len(line.lstrip()))
        lines += textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or [""]
    if len(lines) < 2:
        return [f"/* {line} */" for line in lines]
    return [f"/* {lines[0]}", *(f"   {line}".rstrip() for line in lines[1:-1]), f"   {lines[-1]} */"]
