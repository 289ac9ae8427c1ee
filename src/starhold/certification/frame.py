"""V and its derivative taken apart: V = w.Pw/2 + (potential of the attitude), V' = -w.Dw + K(w) + w.Eq + (torques from
outside).

K is cubic. Where E vanishes V itself falls; else V + epsilon q.Jw does, if the damping outweighs what epsilon brings in. Of
a V that is even in q, E must vanish.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from flint import fmpq

from starhold.algebra.polynomial import Polynomial, pieces
from starhold.certification.matrices import (
    Rows,
    block,
    greatest,
    identity,
    matrix_of,
    plus,
    root_above,
    root_below,
    symmetric_part,
    times,
    transpose,
)
from starhold.certification.motion import ATTITUDE, AXES, RATE, Motion, ShapeError, Truths, at_rest
from starhold.certification.potential import Potential, potential_of
from starhold.certification.subject import below

OUTSIDE = ("e", "m")


@dataclass(frozen=True)
class Frame:
    """The parts of V and V' around the equilibrium; `reach`: the rate up to which they hold (rad/s), None for any; `whole`:
    whether V' is made of one piece."""

    P: Rows
    potential: Potential
    D: Rows
    K: Polynomial
    E: Rows
    W: Rows
    reach: Any | None
    whole: bool

    @property
    def s(self) -> Any:
        """The potential at a half turn (J)."""
        return self.potential.s

    @property
    def exact(self) -> bool:
        """Whether V' has no term that mixes rate and attitude."""
        return not any(x != 0 for row in self.E for x in row)

    @property
    def cubic(self) -> Any:
        """A rational above the largest |K| over |w| = 1."""
        return cubic_bound(self.K)


@dataclass(frozen=True)
class Cross:
    """The derivative of C = q.Jw: -q.Aq - q.Bw + sum of q_k w.F_k w + q.(torques from outside), k = 0..3, of which the
    sum is at most sigma w2."""

    J: Rows
    A: Rows
    B: Rows
    sigma: Any
    forms: tuple[Rows, ...]


def take_apart(motion: Motion) -> Frame:
    """The frame of a law's own V; ShapeError where V or V' has other terms."""
    try:
        function = motion.lyapunov
    except ZeroDivisionError:
        raise ShapeError("the law's V does not exist for these gains, of which a matrix is singular") from None
    if function is None:
        raise ShapeError("the law declares no Lyapunov function")
    potential = potential_of(function)
    if potential is None:
        raise ShapeError(f"V is {function}, in the attitude neither s (1 - q0) nor a form of q")
    falling = motion.along(function)
    truths, slope = at_rest(falling)
    damping, cubic, mixed, work = parts_of_slope(slope)
    felt_share(slope)
    P = times(2, matrix_of(function, RATE, RATE))
    found = Frame(P, potential, times(-1, damping), cubic, mixed, work, _reach(truths), len(pieces(falling)) == 1)
    if potential.even and not (found.exact and found.whole):
        raise ShapeError("V is even in q, but V' mixes rate and attitude, or the law switches")
    return found


def parts_of_slope(slope: Polynomial) -> tuple[Rows, Polynomial, Rows, Rows]:
    """The quadratic form, the cubic form, the coefficients of w_i q_j and of w_i m_j of a V'."""
    kinds: dict[str, list[tuple[str, ...]]] = {"quadratic": [], "cubic": [], "mixed": [], "outside": []}
    for monomial in slope.terms:
        rates = [name for name in monomial if name in RATE]
        others = [name for name in monomial if name not in RATE]
        if not others and len(rates) in (2, 3):
            kinds["quadratic" if len(rates) == 2 else "cubic"].append(monomial)
        elif len(rates) == 1 and len(others) == 1 and others[0] in AXES:
            kinds["mixed"].append(monomial)
        elif len(rates) == 1 and len(others) == 1 and others[0][0] in OUTSIDE:
            kinds["outside"].append(monomial)
        else:
            stored = any(name[0] == "h" for name in others)
            why = "what the wheels store does work on V, which the law does not cancel: " if stored else ""
            raise ShapeError(f"{why}V' has the term {' '.join(monomial) or 'constant'}")
    chosen = {kind: slope.only(set(monomials).__contains__) for kind, monomials in kinds.items()}
    quadratic = matrix_of(chosen["quadratic"], RATE, RATE)
    mixed, outside = matrix_of(chosen["mixed"], RATE, AXES), matrix_of(chosen["outside"], RATE, ("m1", "m2", "m3"))
    return quadratic, chosen["cubic"], mixed, outside


def felt_share(slope: Polynomial) -> Any:
    """The share of the modelled torque that works on V as any other torque does, and is not cancelled by the law; ShapeError
    where it works otherwise."""
    known, unknown = (
        Polynomial(
            {tuple(n.replace("e", "m") for n in m): c for m, c in slope.terms.items() if any(n[0] == kind for n in m)}
        )
        for kind in OUTSIDE
    )
    share = next((known.terms.get(m, fmpq(0)) / c for m, c in unknown.terms.items()), fmpq(0))
    if (known - share * unknown).terms:
        raise ShapeError(f"the law cancels the modelled torque about some axes: V' has the terms {known}")
    return share


def _reach(truths: Truths) -> Any | None:
    """The rate up to which no condition of a piece changes; ShapeError where one depends on more than the rate."""
    reach: Any | None = None
    for condition, _ in truths:
        terms = condition.positive.terms
        if any(len(m) > 1 or (m and m[0] not in RATE) for m in terms):
            raise ShapeError(f"the law switches on {condition.positive}")
        slope = root_above(sum((c * c for m, c in terms.items() if m), fmpq(0)))
        distance = abs(terms.get((), fmpq(0))) / slope
        reach = distance if reach is None else min(reach, distance)
    return reach


def cubic_bound(cubic: Polynomial) -> Any:
    """A rational above the largest |cubic form| over the unit sphere: the sum over its monomials of the most each can be."""
    total: Any = fmpq(0)
    for monomial, c in cubic.terms.items():
        powers = [monomial.count(name) for name in set(monomial)]
        square = fmpq(1, 27)
        for power in powers:
            square *= power**power
        total += abs(c) * root_above(square)
    return total


def take_cross(motion: Motion) -> Cross:
    """The cross term's derivative; ShapeError where it has other terms."""
    return cross_parts(motion.cross_term, at_rest(motion.along(motion.cross_term))[1])


def cross_parts(function: Polynomial, slope: Polynomial) -> Cross:
    """The parts of C and C'."""

    def kind(m: tuple[str, ...]) -> str:
        letters = "".join(name[0] for name in m)
        rates = letters.count("w")
        if letters == "qq" and "q0" not in m:
            return "A"
        if letters == "qw" and "q0" not in m:
            return "B"
        if rates == 2 and letters.count("q") == 1 and len(m) == 3:
            return "F"
        return "outside" if len(m) == 2 and set(letters) in ({"q", "e"}, {"q", "m"}) else "other"

    others = slope.only(lambda m: kind(m) == "other")
    if others.terms:
        raise ShapeError(f"the derivative of q.Jw has the terms {others}")
    A = times(-1, matrix_of(slope.only(lambda m: kind(m) == "A"), AXES, AXES))
    B = times(-1, matrix_of(slope.only(lambda m: kind(m) == "B"), AXES, RATE))
    forms: list[Rows] = []
    for name in ATTITUDE:
        own = {tuple(x for x in m if x != name): c for m, c in slope.terms.items() if kind(m) == "F" and name in m}
        forms.append(matrix_of(Polynomial(own), RATE, RATE))
    found = Cross(matrix_of(function, AXES, RATE), A, B, fmpq(0), tuple(forms))
    # |(q0, q)| = 1, so by the Cauchy-Schwarz inequality.
    return replace(found, sigma=root_above(sum((size * size for size in quadratic_sizes(found)), fmpq(0))))


def quadratic_sizes(cross: Cross) -> list[Any]:
    """Bounds of |w.F_k w| over |w| = 1."""
    return [max(greatest(form), greatest(times(-1, form)), fmpq(0)) for form in cross.forms]


def decrease(frame: Frame, cross: Cross, epsilon: Any, rate: Any | None) -> Rows:
    """Q with (V + epsilon C)' <= -(w, q).Q(w, q) while |w| <= rate."""
    taken = epsilon * cross.sigma + (fmpq(0) if rate is None else frame.cubic * rate)
    damping = plus(symmetric_part(frame.D), identity(3, taken), -1)
    mixed = times(fmpq(1, 2), plus(times(epsilon, transpose(cross.B)), frame.E, -1))
    return block(damping, mixed, symmetric_part(times(epsilon, cross.A)))


def margin(frame: Frame, cross: Cross, epsilon: Any, rho: Any) -> Rows:
    """A matrix whose definiteness says (1 - rho) V <= V + epsilon C <= (1 + rho) V."""
    return block(times(rho, frame.P), times(epsilon, transpose(cross.J)), identity(3, rho * frame.s))


def contents(start: Any | None, P: Rows, potential: Potential) -> dict[str, Any]:
    """The contents of {V <= start}: the largest turn from rest (rad), the largest rate on target, and the largest rate at
    every attitude (rad/s; None: not every attitude is in it); all from below. For start None everything."""
    if start is None:
        turn = math.pi if potential.even else 2.0 * math.pi
        return {"slew_angle": turn, "rate": None, "rate_everywhere": None, "everything": True}
    inertia = greatest(P)
    everywhere = None
    if start >= potential.top:
        everywhere = below(root_below(2 * (start - potential.top) / inertia))
    rate = below(root_below(2 * start / inertia))
    return {"slew_angle": potential.turn(start), "rate": rate, "rate_everywhere": everywhere, "everything": False}
