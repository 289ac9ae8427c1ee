"""The parts of V, of its derivative and of the cross term that proofs rest on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flint import fmpq

from starhold.algebra.polynomial import Monomial, Polynomial
from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import apply, dot
from starhold.checker.exact import (
    ZERO,
    Rows,
    demand,
    dual,
    identity,
    radius_of,
    replaced,
    root_above,
    times,
)
from starhold.checker.loop import ATTITUDE, RATE, TURN, ExactLoop, by_kind, letters, without
from starhold.checker.subject import mixed, named, quadratic, variables


@dataclass(frozen=True)
class CommonFrame:
    """V = w.Pw/2 + (a function of the attitude), V' = -w.Dw + (at most kappa |w|3) + w.Wm + ...; felt: the share of the
    modelled torque that acts as m does."""

    P: Rows
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
    P = times(2, quadratic(kinds.get("ww", Polynomial({})).terms, RATE))
    slope = loop.slope(loop.resting()[1]).only(lambda m: not set(letters(m)) & set("ra"))
    found = by_kind(slope)
    strange = set(found) - {"ww", "www", "mw", "ew", *mixing}
    demand(not strange, f"V' has the terms {', '.join(sorted(strange))}")
    terms = slope.terms
    kappa = ZERO
    for monomial, c in terms.items():
        if letters(monomial) == "www":
            share = fmpq(1, 27)
            for name in set(monomial):
                share *= monomial.count(name) ** monomial.count(name)
            kappa += abs(c) * root_above(share)
    D = times(-1, quadratic(terms, RATE))
    return CommonFrame(P, D, kappa, mixed(terms, RATE, named("m")), _felt(found, "w")), terms


def crossed(loop: ExactLoop) -> Crossed:
    """The parts of C = q.Jw, and of C' around the equilibrium; a CheckError where they have others."""
    measurement = loop.moving
    C: Any = dot(vector_part(measurement.attitude), apply(dual(loop.craft.inertia), measurement.rate))
    slope = replaced(C.slope, loop.resting()[1])
    demand(not any(set(letters(m)) & set("ra") for m in slope.terms), "C' depends on the target's motion")
    kinds = by_kind(slope)
    strange = set(kinds) - {"qq", "qw", "qww", "oww", "mq", "eq"}
    demand(not strange, f"C' has the terms {', '.join(sorted(strange))}")
    terms = slope.only(lambda m: len(letters(m)) == 2).terms
    demand(mixed(terms, TURN, named("m")) == identity(3), "torque from outside acts on C in another way")
    felt = _felt(kinds, "q")
    forms = slope.only(lambda m: len(letters(m)) == 3).terms
    total = ZERO
    for name in ATTITUDE:
        # |(q0, q)| = 1, so that the sum of q_k w.F_k w is at most the root of the sum of squares.
        total += radius_of(quadratic({without(m, name): c for m, c in forms.items() if name in m}, RATE)) ** 2
    return Crossed(times(-1, quadratic(terms, TURN)), times(-1, mixed(terms, TURN, RATE)), root_above(total), felt)


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
