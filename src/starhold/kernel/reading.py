"""Strict reading of a certificate: duplicate keys, unread entries and oversized values are refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Generic, TypeVar

from .numbers import RefusedError, demand, rational, read_dict, read_list, read_table
from .programs import Program

FORMAT = "starhold certificate 3"
ASIDE = {"certificates", "note", "scenario", "versions"}
"""What a certificate may hold beside proofs, and the kernel does not read."""
BYTES, CLAIMS, NUMBERS = 8_000_000, 100, 2_000
IS_VALID = "measurement.is_valid"
"""This input tells a program whether the estimate that it is given is valid, as it is in every loop here."""
_T = TypeVar("_T")


class Told(Generic[_T]):
    """A table of a claim, which records the entries that were read."""

    def __init__(self, name: str, content: Mapping[str, _T]) -> None:
        self.name, self.content, self.unread = name, dict(content), set(content)

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def __getitem__(self, key: str) -> _T:
        demand(key in self.content, f"{self.name} lack {key}")
        self.unread.discard(key)
        return self.content[key]

    def get(self, key: str) -> _T | None:
        """Return an entry that may be absent."""
        self.unread.discard(key)
        return self.content.get(key)

    def close(self) -> None:
        """Refuse entries that were not read."""
        demand(not self.unread, f"nothing depends on {', '.join(sorted(self.unread))} of the {self.name}")


class Numbers(Told[Fraction]):
    """The numbers of a claim: bounds, which are nonnegative, and coordinates, which are read as such."""

    def __getitem__(self, key: str) -> Fraction:
        bound = self.coordinate(key)
        demand(bound >= 0, "a bound is negative")
        return bound

    def get(self, key: str) -> Fraction | None:
        """Return a bound that may be absent."""
        return self[key] if key in self.content else None

    def coordinate(self, key: str) -> Fraction:
        """Return a number of either sign."""
        return super().__getitem__(key)


@dataclass(frozen=True)
class Claim:
    """A theorem, words that describe the loop, programs by roles, exact numbers of the programs and the body (subject), the
    claimed numbers, and evidence by obligations."""

    theorem: str
    taken: Told[bool]
    programs: Told[Program]
    subject: Told[Fraction]
    numbers: Numbers
    evidence: Told[Any]

    def close(self) -> None:
        """Refuse entries that were not read."""
        for table in (self.taken, self.programs, self.subject, self.numbers, self.evidence):
            table.close()


def read_certificate(text: str) -> list[Claim]:
    """Read the claims of a certificate."""
    demand(len(text) <= BYTES, "the certificate is too large")
    try:
        content = json.loads(text, object_pairs_hook=_once, parse_float=_stray, parse_constant=_stray, parse_int=_place)
    except json.JSONDecodeError as fault:
        raise RefusedError(f"the certificate is no JSON: {fault.msg} in line {fault.lineno}") from None
    except RecursionError:
        raise RefusedError("the certificate is nested too deeply") from None
    proof = {key: part for key, part in read_dict(content, 3 + len(ASIDE)).items() if key not in ASIDE}
    kind, programs, claims = read_table(proof, "format", "programs", "claims")
    demand(kind == FORMAT, f"the format is not {FORMAT!r}")
    tables = Told("programs", _table(programs, Program.read))
    for name in tables.content:
        demand(tables.content[name].digest == name, "a program is another one than its digest says")
    demand(1 <= len(read_list(claims)) <= CLAIMS, "there are no claims, or too many")
    read = [read_claim(claim, tables) for claim in claims]
    tables.close()
    return read


def read_claim(given: Any, programs: Told[Program]) -> Claim:
    """Read a claim, which refers to its programs by their digests."""
    keys = ("theorem", "taken", "programs", "subject", "numbers", "evidence")
    theorem, taken, roles, subject, numbers, evidence = read_table(given, *keys)
    demand(isinstance(theorem, str), "a theorem has no name")
    demand(all(isinstance(word, str) for word in read_list(taken)) and len(set(taken)) == len(taken), "a word stands twice")
    return Claim(
        theorem,
        Told("words", dict.fromkeys(taken, True)),
        Told("programs", _table(roles, lambda name: programs[name if isinstance(name, str) else ""])),
        Told("subject", _table(subject, rational)),
        Numbers("numbers", _table(numbers, rational)),
        Told("evidence", _table(evidence, lambda part: part)),
    )


def _table(given: Any, read: Callable[[Any], _T]) -> dict[str, _T]:
    return {name: read(part) for name, part in read_dict(given, NUMBERS).items()}


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    demand(len(table) == len(pairs), "a key stands twice")
    return table


def _stray(text: str) -> Any:
    # A number that is not written as a text becomes a value that no reader takes.
    return object()


def _place(text: str) -> Any:
    return int(text) if len(text) <= 9 else object()
