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


class Member(NamedTuple):
    """A member of a struct has a name and a type; those of an array are called by their places in it."""

    name: str
    type: Type
    text: str = ""
    """Unit and meaning."""


class Type(NamedTuple):
    """A scalar (no members), or a struct. `elements`: a struct of one array, of that name. `named`: one of a NamedTuple,
    which is passed by pointer and loses the members that nobody reads."""

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

SIX = Type("six_t", tuple(Member(f"e[{k}]", DOUBLE) for k in range(6)), "e", text="Six numbers.")
_NAMES = {"sixs6_t": "six_rows_t", "vectors6_t": "six_vectors_t"}


class Path(NamedTuple):
    """A leaf of a value: how it is reached from the value, its kind, and the members of named structs on the way."""

    text: str
    kind: str
    through: tuple[tuple[str, str], ...]


class Types:
    """Types by their names, each with one form."""

    def __init__(self) -> None:
        self.known: dict[str, Type] = {}

    def of(self, value: Any, hint: str = "", annotation: str = "") -> Type | None:
        """Return the type of a value; None where nothing of it is left once equations are recorded."""
        if value is None or isinstance(value, (bool, int, Buffer)):
            return None
        if not isinstance(value, tuple):
            return BOOL if kind_of(value) == TRUTH else DOUBLE
        if hasattr(value, "_fields"):
            return self._struct(value)
        found = [self.of(part, f"{hint}{k}") for k, part in enumerate(value)]
        kept = [one for one in found if one is not None]
        if not kept:
            return None
        first, count = kept[0], len(value)
        if len(kept) == 1:
            return first
        if len(kept) == count and all(one == first for one in kept):
            if first == DOUBLE and count == 3:
                return VECTOR
            if first == DOUBLE and count == 4 and _may_turn(annotation):
                return QUATERNION
            if first == VECTOR and count == 3:
                return MATRIX
            if first == DOUBLE and count == 6:
                return SIX
            name = f"{first.name.removesuffix('_t')}s{count}_t"
            return self.keep(Type(_NAMES.get(name, name), tuple(Member(f"e[{k}]", first) for k in range(count)), "e"))
        members = tuple(Member(f"part{k}", one) for k, one in enumerate(found) if one is not None)
        return self.keep(Type(f"{hint or 'several'}_t", members))

    def _struct(self, value: Any) -> Type | None:
        cls = type(value)
        words = getattr(cls, "__annotations__", {})
        members: list[Member] = []
        for name, part in zip(value._fields, value, strict=True):
            found = self.of(part, name, str(words.get(name, "")))
            if found is not None:
                members.append(Member(free(name), found, _told(cls, name)))
        if not members:
            return None
        return self.keep(Type(f"{title(cls)}_t", tuple(members), named=True, text=sentence(cls.__doc__ or "")))

    def keep(self, found: Type) -> Type:
        """Return a type under a name that no other has."""
        base, count = found.name.removesuffix("_t"), 1
        while self.known.get(found.name, found) != found:
            count += 1
            found = found._replace(name=f"{base}_{count}_t")
        return self.known.setdefault(found.name, found)


_KEYWORDS = """
    auto bool break case char const continue default do double else enum extern false float for goto if inline int long
    register restrict return short signed sizeof sqrt static struct switch true typedef union unsigned void volatile while
"""
RESTRICTED = frozenset(_KEYWORDS.split())
"""Words that nothing may be called."""


def free(name: str) -> str:
    name = name.strip("_") or "x"
    return f"{name}_of" if name in RESTRICTED else name


def _may_turn(annotation: str) -> bool:
    """Tell whether four numbers so annotated are a quaternion."""
    return not annotation or "Quaternion" in annotation or "Any" in annotation


def title(cls: Any) -> str:
    """A struct is called as its class; parts have classes of the same names, which are called after the part too."""
    own = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower().strip("_")
    stem = cls.__module__.rpartition(".")[2]
    ambiguous = own in ("params", "memory", "numbers", "reading") or (own == "state" and ".bodies." not in cls.__module__)
    return f"{stem}_{own}" if ambiguous else own


def _told(cls: Any, name: str) -> str:
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
    if re.match(r"\w+\(.*\)$", text):
        return ""
    return re.split(r"(?<=\.) (?=[A-Z])", text, maxsplit=1)[0]


def paths(kind: Type | None, base: str, link: str = ".") -> Iterator[Path]:
    """Yield the leaves of a value of this type in order, of which `base` is the name."""
    if kind is None:
        return
    if not kind.members:
        yield Path(base, TRUTH if kind == BOOL else NUMBER, ())
        return
    for member in kind.members:
        for path in paths(member.type, f"{base}{link}{member.name}"):
            yield path._replace(through=((kind.name, member.name), *path.through)) if kind.named else path


def comment(text: str, width: int = 104) -> list[str]:
    """Return a text as the lines of a comment; none of nothing."""
    lines: list[str] = []
    for line in text.replace("*/", "* /").replace("/*", "/ *").splitlines():
        indent = " " * (len(line) - len(line.lstrip()))
        lines += textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or [""]
    if len(lines) < 2:
        return [f"/* {line} */" for line in lines]
    return [f"/* {lines[0]}", *(f"   {line}".rstrip() for line in lines[1:-1]), f"   {lines[-1]} */"]
