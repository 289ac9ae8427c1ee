"""The parts of V, of its derivative and of the cross term that proofs rest on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

from flint import fmpq

from starhold.algebra.polynomial import Monomial, Polynomial
from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import apply, dot
from starhold.checker.exact import (
    ZERO,
    CheckError,
    Rows,
    demand,
    dual,
    identity,
    radius_of,
    replaced,
    root_above,
    times,
)
from starhold.checker.loop import ATTITUDE, RATE, TURN, ExactLoop, W, by_kind, letters, without
from starhold.checker.subject import mixed, named, quadratic, variables


@dataclass(frozen=True)
class CommonFrame:
    """V = w.Pw/2 + (a function of the attitude), V' = -w.Dw + (at most kappa |w|3) + w.Wm + ...; felt: the share of the
    modelled torque that acts as m does; tops: P is nowhere larger than the largest of these, for any inertia the loop may
    have."""

    P: Rows
    tops: list[Rows]
    D: Rows
    kappa: Any
    W: Rows
    felt: Any


@dataclass(frozen=True)
class OddFrame(CommonFrame):
    """V = ... + s (1 - q0), V' = ... + w.Eq."""

    s: Any
    E: Rows


@dataclass(frozen=True)
class EvenFrame(CommonFrame):
    """V = ... + q.Nq, the same at q and -q; nothing more in V'."""

    N: Rows


@dataclass(frozen=True)
class Crossed:
    """C = q.Jw, C' = -q.Aq - q.Bw + (at most sigma |w|2) + q.m; felt as of V."""

    A: Rows
    B: Rows
    sigma: Any
    felt: Any


def is_even(loop: ExactLoop) -> bool:
    """Whether V is to be read as one that is even in q."""
    return any(letters(m) == "qq" for m in loop.lyapunov.value.terms)


def odd_frame(loop: ExactLoop) -> OddFrame:
    """The parts of a V that is not the same at -q; a CheckError where it has others."""
    V = loop.lyapunov.value
    kinds = by_kind(V)
    demand(set(kinds) <= {"", "o", "ww"}, "V has terms it must not have")
    s = V.terms.get((), ZERO)
    demand(
        not (kinds.get("", ZERO) + kinds.get("o", ZERO) - s * (1 - Polynomial.variable("q0"))).terms,
        "V is not s (1 - q0)",
    )
    frame, terms = _common(loop, kinds, "qw")
    return OddFrame(**vars(frame), s=s, E=mixed(terms, RATE, TURN))


def even_frame(loop: ExactLoop) -> EvenFrame:
    """The parts of a V that is even in q; a CheckError where it has others."""
    kinds = by_kind(loop.lyapunov.value)
    demand(set(kinds) <= {"qq", "ww"}, "V has terms it must not have")
    N = quadratic(kinds["qq"].terms, TURN)
    q = variables(TURN)
    rest: Any = kinds["qq"] - dot(q, apply(tuple(map(tuple, N)), q))  # pyright: ignore
    demand(not rest.terms, "V is not q.Nq")
    return EvenFrame(**vars(_common(loop, kinds)[0]), N=N)


def _common(loop: ExactLoop, kinds: Mapping[str, Polynomial], *mixing: str) -> tuple[CommonFrame, dict[Monomial, Any]]:
    """The parts that any V has, from its terms by kind, and the terms of V' around the equilibrium; `mixing`: kinds that
    may be among them."""
    P, tops = _kinetic(loop, kinds.get("ww", Polynomial({})))
    slope = loop.slope(loop.resting()[1]).only(lambda m: not set(letters(m)) & set("ra"))
    found = by_kind(slope)
    strange = set(found) - {"ww", "www", "mw", "ew", *mixing}
    demand(not strange, f"V' has the terms {', '.join(sorted(strange))}")
    terms = loop.plain(slope)
    kappa = ZERO
    for monomial, c in terms.items():
        if letters(monomial) == "www":
            share = fmpq(1, 27)
            for name in set(monomial):
                share *= monomial.count(name) ** monomial.count(name)
            kappa += abs(c) * root_above(share)
    D = times(-1, quadratic(terms, RATE))
    return CommonFrame(P, tops, D, kappa, mixed(terms, RATE, named("m")), _felt(found, "w")), terms


def _kinetic(loop: ExactLoop, own: Polynomial) -> tuple[Rows, list[Rows]]:
    """P, and what it is nowhere larger than the largest of."""
    if not loop.shifted:
        P = times(2, quadratic(own.terms, RATE))
        return P, [P]
    g = own.terms.get(("d11", "w1", "w1"), ZERO) * 2
    kinetic: Any = dot(W, apply(loop.plant[0].inertia, W))
    rest: Any = own - kinetic * (g / 2)
    demand(not rest.terms, "P is not a multiple of the inertia")
    # x.Jx is largest in a box where each entry deviates with the sign of x_i x_j.
    signs = [(1, a, b) for a in (1, -1) for b in (1, -1)]
    reaches = loop.reaches or identity(3, ZERO)
    tops = [
        [[g * (c + e[i] * e[j] * reaches[i][j]) for j, c in enumerate(row)] for i, row in enumerate(loop.inertia)]
        for e in signs
    ]
    return times(g, loop.inertia), tops


def crossed(loop: ExactLoop) -> Crossed:
    """The parts of C = q.Jw, and of C' around the equilibrium; a CheckError where they have others."""
    measurement = loop.moving
    C: Any = dot(vector_part(measurement.attitude), apply(dual(loop.plant[0].inertia), measurement.rate))
    slope = replaced(C.slope, loop.resting()[1])
    demand(not any(set(letters(m)) & set("ra") for m in slope.terms), "C' depends on the target's motion")
    kinds = by_kind(slope)
    strange = set(kinds) - {"qq", "qw", "qww", "oww", "mq", "eq"}
    demand(not strange, f"C' has the terms {', '.join(sorted(strange))}")
    terms = loop.plain(slope.only(lambda m: len(letters(m)) == 2))
    demand(mixed(terms, TURN, named("m")) == identity(3), "torque from outside acts on C in another way")
    felt = _felt(kinds, "q")
    forms = loop.over(slope.only(lambda m: len(letters(m)) == 3))
    total = ZERO
    for name in ATTITUDE:
        # |(q0, q)| = 1, so that the sum of q_k w.F_k w is at most the root of the sum of squares.
        total += _largest(loop, {without(m, name): share for m, share in forms.items() if name in m}) ** 2
    return Crossed(times(-1, quadratic(terms, TURN)), times(-1, mixed(terms, TURN, RATE)), root_above(total), felt)


def _largest(loop: ExactLoop, form: Mapping[Monomial, Polynomial]) -> Any:
    """The largest eigenvalue in modulus of a quadratic form over the box, which is at a corner: it is convex."""
    names = sorted({name for share in form.values() for name in share.variables()})
    if names and loop.reaches is None:
        raise CheckError("a form depends on the inertia, which may be any")
    reaches = [] if loop.reaches is None else [loop.reaches[int(n[1]) - 1][int(n[2]) - 1] for n in names]
    largest = ZERO
    for corner in product(*[(-reach, reach) for reach in reaches]):
        shift = dict(zip(names, corner, strict=True))
        largest = max(largest, radius_of(quadratic({m: share.at(shift) for m, share in form.items()}, RATE)))
    return largest


def _felt(kinds: Mapping[str, Polynomial], state: str) -> Any:
    """The share of the modelled torque that acts as the unknown one does, the rest being cancelled; a CheckError where it
    acts in another way."""
    known, unknown = kinds.get(f"e{state}"), kinds.get(f"m{state}", Polynomial({}))
    if known is None:
        return ZERO
    as_unknown = replaced(known, dict(zip(named("e"), variables(named("m")), strict=True)))
    first = next(iter(as_unknown.terms))
    demand(first in unknown.terms, "the modelled torque acts where no other does")
    share = as_unknown.terms[first] / unknown.terms[first]
    demand(not (as_unknown - share * unknown).terms, "the modelled torque is cancelled about some axes only")
    return abs(share)
