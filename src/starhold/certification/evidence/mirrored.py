"""Evidence for sums of squares that are images of others: limits in two directions, or of two motors, often differ in signs
alone."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any, TypeAlias

from starhold.certification.evidence.squares import text
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Monomial, Poly, read_poly
from starhold.kernel.rules import Squares

Terms: TypeAlias = tuple[frozenset[tuple[Monomial, int]], int]
About: TypeAlias = tuple[Terms, frozenset[Terms]]
Image: TypeAlias = tuple[str, str]
"""The letters of the variables, and the axes, that change their signs; those of both keep them, as q0 does."""

IMAGES = tuple(product(("", "qwera", "qwerah"), ("", "12", "23", "13")))[1:]
"""Mirrors change the signs of attitude, rate, told torque, and the target's rate and acceleration, and of momentum where
what wheels store is odd; a half turn about an axis changes those about the two others."""
MOST = 64
_SHOWN: dict[About, tuple[Squares, Any]] = {}
"""The latest sums for which there is evidence, by what they are about."""


def shown_once(o: Squares, find: Callable[[], Any]) -> Any:
    """Return the image of evidence that was found for another sum, or else what `find` returns, and keep that."""
    known = [*o.strict, *o.known]
    for image, about in images(o):
        if (other := _SHOWN.get(about)) is not None:
            try:
                evidence = reflected(*other, known, o.z, image)
                o.check(evidence)
            except (RefusedError, LookupError):
                # Of another form after all.
                continue
            return evidence
    evidence = find()
    if evidence is not None:
        if len(_SHOWN) >= MOST:
            del _SHOWN[next(iter(_SHOWN))]
        _SHOWN[about_of(o)] = o, evidence
    return evidence


def different(sums: Sequence[Squares]) -> list[Squares]:
    """Return those of the sums that are no images of others before them."""
    kept = dict[About, Squares]()
    for o in sums:
        if all(about not in kept for _, about in images(o)):
            kept.setdefault(about_of(o), o)
    return [*kept.values()]


def images(o: Squares) -> Iterator[tuple[Image, About]]:
    """Yield ways to take an image of a sum, with what the image is about."""
    for image in IMAGES:
        yield image, about_of(o, image)


def about_of(o: Squares, image: Image = ("", "")) -> About:
    """Return what tells sums, or their images, apart."""
    p, *known = (terms_of(mirrored(g, image)) for g in (o.p, *o.strict, *o.known))
    return p, frozenset(known)


def reflected(other: Squares, evidence: Any, known: Sequence[Poly], z: Sequence[Poly], image: Image) -> dict[str, Any]:
    """Return a sum's evidence as that of its image, about what is known there and with the terms there."""
    places = {terms_of(mirrored(g, image)): k for k, g in enumerate([*other.strict, *other.known])}
    turns = [terms_of(mirrored(x, image)) != terms_of(x) for x in z]
    gram = [
        [x if turns[i] == turns[k] or x == "0" else x[1:] if x[0] == "-" else f"-{x}" for k, x in enumerate(row)]
        for i, row in enumerate(evidence["gram"])
    ]
    return {
        "multipliers": [evidence["multipliers"][places[terms_of(g)]] for g in known],
        "cofactors": [text(mirrored(read_poly(c), image)) for c in evidence["cofactors"]],
        "gram": gram,
    }


def mirrored(p: Poly, image: Image) -> Poly:
    """Return the image of a polynomial."""
    letters, axes = image

    def sign(m: Monomial) -> int:
        return -1 if sum(name != "q0" and (name[0] in letters) != (name[1:] in axes) for name in m) % 2 else 1

    return Poly({m: sign(m) * c for m, c in p.upper.items()}, p.lower)


def terms_of(p: Poly) -> Terms:
    """Return what tells polynomials apart."""
    return frozenset(p.upper.items()), p.lower
