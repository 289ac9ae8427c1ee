"""Evidence for sums of squares that are mirror images of others: limits in two directions often differ in signs alone."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from starhold.certification.evidence.squares import text
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Monomial, Poly, read_poly
from starhold.kernel.rules import Squares

Terms: TypeAlias = tuple[frozenset[tuple[Monomial, int]], int]

MIRRORS = "qwera", "qwerah"
"""The letters of what changes its sign: attitude, rate, told torque, and the target's rate and acceleration; and momentum,
in which what wheels store is odd."""
MOST = 64
_SHOWN: dict[tuple[Terms, frozenset[Terms]], tuple[Squares, Any]] = {}
"""The latest sums for which there is evidence, by what they are about."""


def shown_once(o: Squares, find: Callable[[], Any]) -> Any:
    """Return the mirror image of evidence that was found for another sum, or else what `find` returns, and keep that."""
    known = [*o.strict, *o.known]
    for odd in MIRRORS:
        about = terms_of(mirrored(o.p, odd)), frozenset(terms_of(mirrored(g, odd)) for g in known)
        if (other := _SHOWN.get(about)) is not None:
            try:
                evidence = reflected(*other, known, o.z, odd)
                o.check(evidence)
            except (RefusedError, LookupError):
                # Of another form after all.
                continue
            return evidence
    evidence = find()
    if evidence is not None:
        if len(_SHOWN) >= MOST:
            del _SHOWN[next(iter(_SHOWN))]
        _SHOWN[terms_of(o.p), frozenset(map(terms_of, known))] = o, evidence
    return evidence


def reflected(other: Squares, evidence: Any, known: Sequence[Poly], z: Sequence[Poly], odd: str) -> dict[str, Any]:
    """Return a sum's evidence as that of its mirror image, about what is known there and with the terms there."""
    places = {terms_of(mirrored(g, odd)): k for k, g in enumerate([*other.strict, *other.known])}
    turns = [terms_of(mirrored(x, odd)) != terms_of(x) for x in z]
    gram = [
        [x if turns[i] == turns[k] or x == "0" else x[1:] if x[0] == "-" else f"-{x}" for k, x in enumerate(row)]
        for i, row in enumerate(evidence["gram"])
    ]
    return {
        "multipliers": [evidence["multipliers"][places[terms_of(g)]] for g in known],
        "cofactors": [text(mirrored(read_poly(c), odd)) for c in evidence["cofactors"]],
        "gram": gram,
    }


def mirrored(p: Poly, odd: str) -> Poly:
    """Return a polynomial in which all variables with these letters but q0 have the opposite sign."""

    def sign(m: Monomial) -> int:
        return -1 if sum(name[0] in odd and name != "q0" for name in m) % 2 else 1

    return Poly({m: sign(m) * c for m, c in p.upper.items()}, p.lower)


def terms_of(p: Poly) -> Terms:
    """Return what tells polynomials apart."""
    return frozenset(p.upper.items()), p.lower
