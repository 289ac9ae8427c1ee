"""The checker's own reading of a file. What is larger than the limits below is refused."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

from starhold.checker.shapes import CheckError
from starhold.errors import InputError

BYTES, DEEPEST, DIGITS = 2**26, 32, 1_000
"""The largest file; how deep its objects and lists may be in one another; digits of a number."""


def read_file(path: Path | str) -> tuple[Any, list[str]]:
    """The content of a JSON file, and faults that its reading goes over; InputError where there is none that can be read."""
    faults: list[str] = []

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len({key for key, _ in pairs}) < len(pairs):
            faults.append("a key occurs twice in one object")
        return dict(pairs)

    def not_a_number(text: str) -> None:
        faults.append(f"{text} is not a number")

    def whole(text: str) -> int:
        if len(text) > DIGITS:
            raise InputError(str(path), "", "", f"holds a number of more than {DIGITS} digits")
        return int(text)

    try:
        with open(path, "rb") as file:
            raw = file.read(BYTES + 1)
        if len(raw) > BYTES:
            raise InputError(str(path), "", "", f"is larger than {BYTES // 2**20} MiB")
        text = raw.decode("utf-8")
        return json.loads(text, object_pairs_hook=once, parse_constant=not_a_number, parse_int=whole), faults
    except OSError as error:
        raise InputError(str(path), "", "", f"cannot be read: {error.strerror}") from None
    except RecursionError:
        raise InputError(str(path), "", "", f"is nested more than {DEEPEST} deep") from None
    except ValueError as error:
        raise InputError(str(path), "", "", f"is not JSON: {error}") from None


def shallow(content: Any) -> None:
    """A CheckError where objects and lists are in one another deeper than they may."""
    inner: list[Any] = [content]
    for _ in range(DEEPEST):
        inner = [x for part in inner for x in _within(part)]
        if not inner:
            return
    raise CheckError(f"the file is nested more than {DEEPEST} deep")


def _within(part: Any) -> Iterable[Any]:
    if isinstance(part, dict):
        return cast(dict[Any, Any], part).values()
    return cast(list[Any], part) if isinstance(part, list) else ()
