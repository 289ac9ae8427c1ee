"""Theorems that refute: a condition of a claim is shown to fail at one exact state. Proofs: docs/kernel.md, 9.

A state is given by coordinates: t (turn.k), for q = (1 - |t|^2, 2t)/(1 + |t|^2) with |t| <= 1, so that q0 >= 0 for every
choice of the quaternion's sign, and w (rate.k). Unless stated there is no external torque, the target is at rest and no
wheels turn: all claims hold for such a loop too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from ..loops import AXES, AttitudeLoop, around
from ..numbers import cosine_above, demand
from ..polynomials import Poly, apply, dot, poly, var
from ..reading import Claim
from ..rules import Exceeds, Persists, Proof
from ..sentences import Statement, above, below
from .limits import TORQUE
from .sampling import linear_loop
from .sliding import declared, taken_apart

CALM = ("no-outside-torque", "target-at-rest", "no-wheels")
"""What is assumed of all that acts from outside."""
MOTION = ("rigid-body", "inertia-as-given", "exact-measurement", "ideal-actuators", "continuous-torque", "unlimited-torque")


@dataclass(frozen=True)
class State:
    """A turn t, with its quaternion, and a rate."""

    t: list[Fraction]
    w: list[Fraction]

    @classmethod
    def read(cls, claim: Claim, turn: str = "turn", rate: str | None = "rate") -> State:
        """Read a state of a claim; at rest where there is no name for a rate."""
        t, w = ([claim.numbers.coordinate(f"{name}.{k}") if name else Fraction(0) for k in AXES] for name in (turn, rate))
        demand(sum(x * x for x in t) <= 1, "a quaternion is fed back with q0 < 0")
        return cls(t, w)

    @property
    def values(self) -> dict[str, Fraction]:
        """Return the state by the names of its variables."""
        square = sum((x * x for x in self.t), Fraction(0))
        q = [(1 - square) / (1 + square), *(2 * x / (1 + square) for x in self.t)]
        return {f"q{k}": x for k, x in enumerate(q)} | {f"w{k}": x for k, x in enumerate(self.w, 1)}

    def leading(self, p: Poly) -> Fraction:
        """Return the first coefficient of p at the states (st, sw) as s grows from zero, which has the sign of p at all of
        them near the target. To order s^2, q is (1 - 2 |t|^2 s^2, 2ts)."""
        s = var("s")
        way = {f"q{k}": 2 * x * s for k, x in enumerate(self.t, 1)} | {f"w{k}": x * s for k, x in enumerate(self.w, 1)}
        terms = p.at(way | {"q0": 1 - sum(2 * x * x for x in self.t) * s * s}).terms
        first = min(terms, key=len, default=("s",) * 3)
        demand(len(first) <= 2, "near the target terms of a higher order decide")
        return terms[first]


def torque(loop: AttitudeLoop, state: State) -> list[Fraction]:
    """Return the torque demanded by the law at a state."""
    here = {name: p.at(state.values) for name, p in loop.inputs.items()}
    return [p.number for p in loop.single("law", 3, here)]


def slope(loop: AttitudeLoop, u: Sequence[Poly]) -> Poly:
    """Return V' under a torque of the law."""
    return loop.slopes_along(loop.lyapunov, apply(loop.J_inverse, loop.balance(u)))


def rises(claim: Claim) -> Proof:
    """V' > 0 at a state, with |w| <= `fastest` if that is given."""
    loop, state = AttitudeLoop(claim), State.read(claim)
    yield from loop.sound()
    fastest = claim.numbers.get("fastest")
    demand(fastest is None or sum(x * x for x in state.w) <= fastest * fastest, "the state turns faster than is claimed")
    yield "V is non-increasing", Exceeds(slope(loop, list(map(poly, torque(loop, state)))).at(state.values).number)
    return Statement("V rises at a state", (*MOTION, *CALM), "convergence", True)


def rises_near_target(claim: Claim) -> Proof:
    """V' > 0 at states arbitrarily near the target: V is non-increasing on no set {V <= level}."""
    yield from rises(claim)
    loop, state = AttitudeLoop(claim), State.read(claim)
    u = [around(cases, loop.on_target | loop.still).value for cases in loop.law]
    yield "V is non-increasing near the target", Exceeds(state.leading(slope(loop, u)))
    return Statement("V rises at states as near the target as one likes", (*MOTION, *CALM), "convergence", True)


def is_negative(claim: Claim) -> Proof:
    """V < 0 at states arbitrarily near the target, where it is zero."""
    loop, state = AttitudeLoop(claim), State.read(claim)
    yield from loop.sound()
    yield "V is least on target", Exceeds(-loop.lyapunov.at(state.values).number)
    yield "V is least on target near it", Exceeds(-state.leading(loop.lyapunov))
    return Statement("V is negative at states as near the target as one likes", (*MOTION, *CALM), "convergence", True)


def exceeds_limit(claim: Claim) -> Proof:
    """The torque exceeds its limit at a state where V is no larger than at a rest turned by at most `angle`: every set {V <=
    level} that contains those rests contains the state."""
    loop, state, rest = AttitudeLoop(claim), State.read(claim), State.read(claim, "rest", None)
    yield from loop.sound()
    numbers = claim.numbers
    limit, norm, angle = numbers.get("limit"), numbers.get("limit.norm"), numbers["angle"]
    demand((limit is None) != (norm is None), "there is not one limit")
    yield "turned no further", Exceeds(rest.values["q0"], cosine_above(angle / 2))
    low, high = (loop.lyapunov.at(one.values).number for one in (state, rest))
    demand(low <= high, "V is larger at the state than at the rest")
    squares, most = [x * x for x in torque(loop, state)], limit or norm or Fraction(0)
    yield "torque", Exceeds(max(squares) if norm is None else sum(squares, Fraction(0)), most * most)
    text = f"every set of V that holds all rests turned by up to {above(angle)} rad holds a state where the law asks for "
    return Statement(f"{text}more than {below(most)} N m", (*MOTION[:5], *CALM), TORQUE, True)


def does_not_settle(claim: Claim) -> Proof:
    """Near rest, with the torque held for the period, some motions do not converge to rest."""
    (*_, step), h = (yield from linear_loop(claim)), claim.numbers["period"]
    yield "step", Persists(step(h))
    text = f"near rest, with the torque held for {below(h)} s, some motions do not come to rest"
    return Statement(text, (*MOTION[:4], *CALM, "linear-motion"), "sampling", True)


def is_pushed_off(claim: Claim) -> Proof:
    """An external torque of `outside.i` exceeds the law's switching torque about axis i: it drives s_i away from zero, as at
    a state where s_i > 0."""
    loop, state = AttitudeLoop(claim), State.read(claim)
    s, _, moved = yield from declared(loop)
    i = next((i for i in AXES if f"outside.{i}" in claim.numbers), 0)
    push = claim.numbers[f"outside.{i}"]
    yield f"reach {i}", Exceeds(push, taken_apart(loop, i, moved[i], s[i]).reach)
    yield "beside the surface", Exceeds(s[i].at(state.values).number)
    text = f"a torque from outside of {below(push)} N m about axis {i + 1} exceeds what the law switches"
    return Statement(text, (*MOTION, "bounded-outside-torque", *CALM[1:]), "sliding", True)


def leads_away(claim: Claim) -> Proof:
    """On the surface w = -Kq, where q0' = q.Kq/2, q0 decreases at a state, and at all states between it and the target."""
    loop, state = AttitudeLoop(claim), State.read(claim, "turn", None)
    _, K, _ = yield from declared(loop)
    q = [Poly({(): state.values[f"q{k}"]}) for k in (1, 2, 3)]
    yield "q0 grows on the surface", Exceeds(-dot(q, apply(K, q)).number)
    return Statement("on the surface some motions turn away from the target", (*MOTION, *CALM), "sliding", True)
