"""Checks certificates: python3 -I -S kernel.pyz certificate.json prints what is proved, or the reason for a refusal in one
line."""

from __future__ import annotations

import sys
from dataclasses import replace
from linecache import getlines
from typing import NamedTuple

from .numbers import Account, RefusedError, demand
from .reading import BYTES, IS_VALID, Claim, read_certificate
from .rules import Obligation
from .sentences import Statement
from .theorems import THEOREMS

UNREAD = "The programs were not compared with those of a scenario; what stands under 'certificates' was not read."


class Proved(NamedTuple):
    """A proved claim, its statement, and the obligations that were checked."""

    claim: Claim
    statement: Statement
    obligations: tuple[tuple[str, Obligation], ...]

    @property
    def shown(self) -> tuple[tuple[str, str], ...]:
        """Return the names of the obligations, each with the name of its rule."""
        return tuple((name, type(obligation).__name__) for name, obligation in self.obligations)


def check(text: str) -> list[Proved]:
    """Return what a certificate proves; RefusedError if any of its claims is not proved."""
    Account.open()
    return [prove(claim) for claim in read_certificate(text)]


def prove(claim: Claim) -> Proved:
    """Check each obligation of a claim's theorem; RefusedError if one is not shown."""
    Account.open()
    demand(claim.theorem in THEOREMS, "there is no such theorem")
    needed, shown = THEOREMS[claim.theorem](claim), list[tuple[str, Obligation]]()
    while True:
        try:
            name, obligation = next(needed)
        except StopIteration as end:
            claim.close()
            return Proved(claim, _if_valid(end.value, claim), tuple(shown))
        try:
            obligation.check(claim.evidence.get(name))
        except RefusedError as fault:
            raise RefusedError(f"{claim.theorem}, {name}: {fault}") from None
        shown.append((name, obligation))


def _if_valid(statement: Statement, claim: Claim) -> Statement:
    """Return a statement with the assumption that estimates are valid, if a program of the claim reads whether they are."""
    reads = any(IS_VALID in program.inputs for program in claim.programs.content.values())
    return replace(statement, assumptions=(*statement.assumptions, "valid-estimate")) if reads else statement


def main(arguments: list[str]) -> int:
    """Print what a certificate proves; return 0, or 1 if it is refused."""
    try:
        demand(len(arguments) == 1, "one certificate is checked at a time")
        with open(arguments[0], "rb") as file:
            lines = [line for proved in check(file.read(BYTES + 1).decode()) for line in written(proved)]
    except (RefusedError, OSError, UnicodeDecodeError, RecursionError, MemoryError) as fault:
        print(f"refused: {' '.join(str(fault).split()) or type(fault).__name__}")
        return 1
    print(UNREAD, *lines, audited(), sep="\n")
    return 0


def written(proved: Proved) -> list[str]:
    """Return the lines about a claim: its statement, and the programs that it is about."""
    programs = proved.claim.programs.content.items()
    return [f"proved: {proved.statement.written()}", *(f"  {role} {program.digest}" for role, program in programs)]


def audited() -> str:
    """Return which files of the kernel have been loaded, all that the check depends on, and how many lines they have."""
    loaded = {name: module for name, module in sorted(sys.modules.items()) if name.startswith(f"{__package__}.")}
    count = sum(len(getlines(module.__file__ or "", vars(module))) for module in loaded.values())
    names = ", ".join(name.removeprefix(f"{__package__}.") for name in loaded)
    return f"Checked by {count} lines of the kernel: {names}."


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
