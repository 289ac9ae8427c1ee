"""ReqIF, the exchange format of requirements tools (OMG, Requirements Interchange Format 1.2), by the package `reqif`."""

from __future__ import annotations

import re
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from html import escape, unescape
from importlib import resources
from typing import Any

from starhold.errors import InputError, optional
from starhold.scenario.checking import show
from starhold.scenario.requirement import key_of

_TAGS = re.compile(r"<[^>]*>")
_HOUSE = uuid.UUID("6f0c2b0e-95a7-4a2f-9a44-0f4f3b5b7a11")
"""The name space of new identifiers; equal requirements get equal identifiers."""
ENUMERATION, XHTML = "ENUMERATION", "XHTML"


def _module(name: str, where: str) -> Any:
    return optional(f"reqif.{name}", f"{where}: ReqIF", "requirements")


def _parsed(data: bytes, where: str) -> Any:
    """Return the ReqIF bundle (of package `reqif`) in a file. InputError where the file is not ReqIF."""
    parser = _module("parser", where)
    try:
        bundle = parser.ReqIFParser.parse_from_string(data.decode("utf-8-sig"))
        content = bundle.core_content.req_if_content
        _ = [*content.spec_objects], [*content.spec_types]
        return bundle
    except Exception as error:
        # The package raises exceptions of any kind.
        why = " ".join(str(error).split())[:80] or type(error).__name__
        raise InputError(where, "", f"not readable as ReqIF: {why}", "a ReqIF file with SPEC-OBJECTS") from None


def read(data: bytes, where: str) -> list[dict[str, str]]:
    """Return the objects of a file in order, each as texts by the long names of its attributes. Without an id attribute,
    "id" is the object's identifier; without a parent attribute, "parent" is the object above it in the hierarchy."""
    return [row for _, row in _rows(_parsed(data, where).core_content.req_if_content)]


def _rows(content: Any) -> list[tuple[Any, dict[str, str]]]:
    """Return the objects, each with its row as `read` returns it."""
    names = {one.identifier: one.long_name or one.identifier for one in _definitions(content)}
    words = {
        value.identifier: value.long_name or value.identifier
        for kind in content.data_types or ()
        for value in getattr(kind, "values", None) or ()
    }
    rows: list[tuple[Any, dict[str, str]]] = []
    for one in content.spec_objects:
        row = {names.get(a.definition_ref, a.definition_ref): _text(a, words) for a in one.attributes}
        row = {name: text for name, text in row.items() if text.strip()}
        rows.append((one, row if "id" in map(key_of, row) else {"id": one.identifier, **row}))
    ids = {one.identifier: next(text for name, text in row.items() if key_of(name) == "id") for one, row in rows}
    above = {place.spec_object: parent for parent, place in _places(content) if parent is not None}
    for one, row in rows:
        if above.get(one.identifier) in ids and "parent" not in map(key_of, row):
            row["parent"] = ids[above[one.identifier]]
    return rows


def _definitions(content: Any) -> Iterator[Any]:
    for kind in content.spec_types or ():
        yield from getattr(kind, "attribute_definitions", None) or ()


def _text(attribute: Any, words: Mapping[str, str]) -> str:
    """Return the value of an attribute as text: the words of an enumeration, formatted text without its markup."""
    kind, value = attribute.attribute_type.name, attribute.value
    if kind == ENUMERATION:
        return ", ".join(words.get(one, one) for one in value)
    return " ".join(unescape(_TAGS.sub(" ", value or "")).split()) if kind == XHTML else value or ""


def _places(content: Any) -> Iterator[tuple[str | None, Any]]:
    """Yield the nodes of the hierarchies of all specifications, each with the object above it."""

    def walk(places: Any, above: str | None) -> Iterator[tuple[str | None, Any]]:
        for place in places or ():
            yield above, place
            yield from walk(place.children, place.spec_object)

    for specification in content.specifications or ():
        yield from walk(specification.children, None)


def written(rows: Sequence[Mapping[str, str]], title: str, original: bytes | None, where: str) -> str:
    """Return rows as the text of a ReqIF file. With an original, only values that differ are replaced and missing objects
    added. InputError where the original is not ReqIF, or where formatted text or a choice would have to change."""
    bundle = _parsed(_empty(title) if original is None else original, where)
    content = bundle.core_content.req_if_content
    there = {dict(keyed(row))["id"]: (one, row) for one, row in _rows(content)}
    for row in rows:
        one, old = there.get(row["id"]) or (_added(content, title, row["id"], where), {})
        for column, text in row.items():
            if dict(keyed(old)).get(column) != text:
                _put(content, one, column, text, where)
    return _module("unparser", where).ReqIFUnparser.unparse(bundle)


def keyed(row: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the keys and texts of a row, with columns renamed to keys of requirements where they match one."""
    return ((key_of(name) or name, text) for name, text in row.items())


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _name(*parts: str) -> str:
    # XML identifiers begin with a letter or an underscore.
    return f"_{uuid.uuid5(_HOUSE, ' '.join(parts))}"


def _put(content: Any, one: Any, column: str, text: str, where: str) -> None:
    """Set the text of an object's attribute; its type gets the attribute if it lacks it."""
    kind = next(kind for kind in content.spec_types if kind.identifier == one.spec_object_type)
    named = (d for d in kind.attribute_definitions or () if column in (d.long_name, key_of(d.long_name or "")))
    definition = next(named, None) or _defined(content, kind, column, where)
    if definition.attribute_type.name in (ENUMERATION, XHTML):
        raise InputError(
            where, f"{one.identifier}.{column}", show(text), "the value of the original, because it is not plain text"
        )
    if definition.identifier in one.attribute_map:
        one.attribute_map[definition.identifier].value = text
        return
    attribute = _module("models.reqif_spec_object", where).SpecObjectAttribute(
        definition.attribute_type, definition.identifier, text
    )
    one.attributes.append(attribute)
    one.attribute_map[definition.identifier] = attribute


def _defined(content: Any, kind: Any, column: str, where: str) -> Any:
    """Add a plain-text attribute to a type and return it."""
    string = next((one for one in content.data_types if type(one).__name__.endswith("String")), None)
    if string is None:
        types = _module("models.reqif_data_type", where)
        string = types.ReqIFDataTypeDefinitionString(
            _name("string"), last_change=_now(), long_name="text", max_length="32000"
        )
        content.data_types.append(string)
    strings = _module("models.reqif_types", where).SpecObjectAttributeType.STRING
    definition = _module("models.reqif_spec_object_type", where).SpecAttributeDefinition(
        strings, _name(kind.identifier, column), string.identifier, last_change=_now(), long_name=column
    )
    kind.attribute_definitions = [*(kind.attribute_definitions or ()), definition]
    kind.attribute_map = {**(kind.attribute_map or {}), definition.identifier: definition}
    return definition


def _added(content: Any, title: str, called: str, where: str) -> Any:
    """Add an object of the first object type to the end of the first specification and return it."""
    kind = next(one for one in content.spec_types if type(one).__name__ == "ReqIFSpecObjectType")
    make: Callable[..., Any] = _module("models.reqif_spec_object", where).ReqIFSpecObject
    one = make(_name(title, called), [], kind.identifier, last_change=_now())
    content.spec_objects.append(one)
    for specification in (content.specifications or ())[:1]:
        place = _module("models.reqif_spec_hierarchy", where).ReqIFSpecHierarchy(
            identifier=_name(title, called, "place"), spec_object=one.identifier, level=1, last_change=_now(), children=[]
        )
        specification.children = [*(specification.children or ()), place]
    return one


def _empty(title: str) -> bytes:
    """Return a bundle with one object type and one specification, without objects."""
    names = {what: _name(title, what) for what in ("header", "string", "kind", "document", "whole")}
    text = (resources.files("starhold.scenario") / "empty.reqif").read_text(encoding="utf-8")
    return text.format(title=escape(title), now=_now(), **names).encode()
