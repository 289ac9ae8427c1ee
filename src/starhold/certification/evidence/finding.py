"""Finds the evidence for a theorem's obligations about a claim."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any, TypeAlias, TypeVar

import numpy as np

from starhold.certification.evidence.cones import once
from starhold.certification.evidence.mirrored import shown_once
from starhold.certification.evidence.reduced import Reduced
from starhold.certification.evidence.squares import plainly, rounded, squares, text
from starhold.certification.evidence.terms import solved
from starhold.certification.matrices import floats, lyapunov, unlimited
from starhold.kernel import rules
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly, poly
from starhold.kernel.programs import Program, digest
from starhold.kernel.reading import FORMAT, Claim, Told, read_claim
from starhold.kernel.rules import Part
from starhold.kernel.theorems import THEOREMS

T = TypeVar("T")
Theorem: TypeAlias = Callable[[Claim], rules.Proof]
UNSOLVED = "Lyapunov's equation has no solution in double precision"


class NotFoundError(Exception):
    """No evidence was found for an obligation; the text names it and says why."""


def read(claim: Mapping[str, Any], programs: Mapping[str, Any]) -> Claim:
    """Return a claim in the kernel's form, with the evidence that theorems themselves need, and no limit on work."""
    unlimited()
    return read_claim(claim, Told("programs", {name: Program.read(programs[name]) for name in claim["programs"].values()}))


def obligations(
    claim: Mapping[str, Any], programs: Mapping[str, Any], theorem: Theorem | None = None
) -> tuple[dict[str, rules.Obligation], Claim]:
    """Return the obligations of a claim, and the claim, which knows which of its entries were read. theorem: what yields the
    same obligations sooner."""
    known = read(claim, programs)
    return dict((theorem or THEOREMS[known.theorem])(known)), known


def complete(
    claim: dict[str, Any], programs: Mapping[str, Any], scales: Mapping[str, float], theorem: Theorem | None = None
) -> dict[str, Any]:
    """Return a claim with evidence, without the numbers and programs that it does not need. NotFoundError where an
    obligation does not hold, or no evidence for it was found. theorem: as in `obligations`."""

    def search() -> dict[str, Any] | NotFoundError:
        try:
            return _completed(claim, programs, scales, theorem)
        except NotFoundError as reason:
            return reason

    # A claim names its programs by digests of all that stands in them.
    completed = once(json.dumps(["complete", claim, dict(scales)]), search)
    if isinstance(completed, NotFoundError):
        raise NotFoundError(str(completed))
    return completed


def _completed(
    claim: dict[str, Any], programs: Mapping[str, Any], scales: Mapping[str, float], theorem: Theorem | None
) -> dict[str, Any]:
    try:
        wanted, known = obligations(claim, programs, theorem)
        completed = {name: evidence(name, wanted, scales) for name in wanted}
    except RefusedError as reason:
        raise NotFoundError(str(reason)) from None
    subject, programs = (
        {name: x for name, x in claim[part].items() if name not in table.unread}
        for part, table in (("subject", known.subject), ("programs", known.programs))
    )
    evidences = claim["evidence"] | {name: x for name, x in completed.items() if x is not None}
    return claim | {"subject": subject, "programs": programs, "evidence": evidences}


def evidence(name: str, wanted: Mapping[str, rules.Obligation], scales: Mapping[str, float]) -> Any:
    """Return the evidence of an obligation, or None if it needs none."""
    shown: Any = None
    o = wanted[name]
    if isinstance(o, rules.Squares):
        shown = shown_once(o, lambda: plainly(o) or squares(o, scales))
        if shown is None:
            raise NotFoundError(f"{name}: no sum of squares was found")
        # It was checked when it was found.
        return shown
    if isinstance(o, rules.Sum):
        shown = Reduced(o, scales).evidence()
    elif isinstance(o, rules.Vanishes) and o.modulo:
        shown = list(map(text, euler(name, wanted) if name.startswith("Euler") else combined(name, o)))
    elif isinstance(o, rules.Contracts):
        shown = contracts(o)
    elif isinstance(o, rules.Persists):
        shown = persists(o)
    try:
        o.check(shown)
    except RefusedError as reason:
        raise NotFoundError(f"{name}: {reason}") from None
    return shown


def combined(name: str, o: rules.Vanishes) -> list[Poly]:
    """Return numbers for the cofactors, with which the relations combine to a polynomial."""
    cofactors = solved(o.p, list(o.modulo))
    if cofactors is None:
        raise NotFoundError("the torque at rest vanishes elsewhere too" if name.startswith("only") else name)
    return list(map(poly, cofactors))


def euler(name: str, wanted: Mapping[str, rules.Obligation]) -> list[Poly]:
    """Return the cofactors of J J^-1 = 1 in Euler's equation: of the relations of its row the right sides J w'."""
    zero = {f"i{i}{k}": 0 for i in range(3) for k in range(3)}
    sides = [-o.p.at(zero) for k in range(3) if isinstance(o := wanted[f"{name[:-1]}{k}"], rules.Vanishes)]
    return [side if row == int(name[-1]) else Poly({}) for row in range(3) for side in sides]


def contracts(o: rules.Contracts) -> list[list[str]]:
    """Return Lyapunov's matrix of a motion."""
    A = floats(o.A)
    size = np.eye(len(A))
    return _rounded(_lyapunov(A.T, -size, True) if o.flow else _lyapunov((A / float(o.rate)).T, size))


def _lyapunov(A: Any, Q: Any, flow: bool = False) -> Any:
    """Return what `lyapunov` does. NotFoundError without a solution."""
    try:
        return lyapunov(A, Q, flow)
    except np.linalg.LinAlgError:
        raise NotFoundError(UNSOLVED) from None


def _rounded(P: Any) -> list[list[str]]:
    """Return the symmetric part of a matrix, scaled, in exact numbers."""
    largest = np.abs(P).max()
    if not 0.0 < largest < np.inf:
        raise NotFoundError(UNSOLVED)
    return [[str(rounded(float(x), 15)) for x in row] for row in (P + P.T) / (2.0 * largest)]


def persists(o: rules.Persists) -> list[list[str]]:
    """Return the matrix of a form that grows along x+ = Ax, from A'PA - P = 1, or A'PA - c^2 P = 1 with c near 1."""
    A = floats(o.A)
    for c in (1.0, 1.0 + 1e-6, 1.0 + 1e-4, 1.0 + 1e-2):
        try:
            rows = _rounded(_lyapunov(A.T / c, -np.eye(len(A))))
            o.check(rows)
        except (NotFoundError, RefusedError):
            continue
        return rows
    raise NotFoundError("no form was found that grows")


def by_digests(programs: Iterable[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return programs by the names that claims use for them."""
    return {digest(program): program for program in programs}


def unproved(
    theorem: str,
    programs: Mapping[str, str],
    subject: Mapping[str, str],
    numbers: Mapping[str, Any],
    taken: Sequence[str] = (),
) -> dict[str, Any]:
    """Return a claim without evidence. programs: their digests by roles."""
    exact = {name: str(Fraction(x)) for name, x in numbers.items()}
    parts = {"programs": dict(programs), "subject": dict(subject), "numbers": exact, "evidence": dict[str, Any]()}
    return {"theorem": theorem, "taken": list(taken), **parts}


def certificate(programs: list[dict[str, Any]], claims: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the content of a certificate with these claims and those of the programs that they are about."""
    used = {name for claim in claims for name in claim["programs"].values()}
    kept = {n: p for n, p in by_digests(programs).items() if n in used}
    return {"format": FORMAT, "programs": kept, "claims": claims}


def concluded(part: Part[T]) -> T:
    """Return the conclusion, with the obligations taken as met."""
    while True:
        try:
            next(part)
        except StopIteration as end:
            return end.value
