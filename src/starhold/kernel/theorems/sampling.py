"""The theorem that the torque may be held between samples. Proof: docs/kernel.md, section 5."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from ..loops import RATES, TURNS, AttitudeLoop, around, over_period, slopes
from ..numbers import Rows, beside, demand, inverse, plus, times
from ..reading import Claim
from ..rules import Contracts, Definite, Exceeds, Part, Proof, vanish
from ..sentences import Statement, above, below


def linear_loop(claim: Claim) -> Part[tuple[AttitudeLoop, tuple[Rows, Rows], Callable[[Fraction], Rows]]]:
    """Return the loop near rest on target, with u = -Cw - Kq: the loop, C and K, and the matrix of one period."""
    loop = AttitudeLoop(claim, quotients=True)
    demand(not claim.taken.content, "the loop is taken with nothing")
    yield from loop.sound()
    rest: dict[str, int] = loop.on_target | loop.still
    u = [loop.expanded(around(cases, rest).value, rest) for cases in loop.law]
    loop.autonomous(u)
    yield from vanish("rest on target", [p.at(rest) for p in u])
    C, K = (slopes([-p for p in u], names, rest) for names in (RATES, TURNS))
    feedback = times(inverse(loop.given), beside(C, K))
    return loop, (C, K), lambda h: over_period(feedback, h)


def sampled(claim: Claim) -> Proof:
    """Near rest on target the loop with the torque held for the period is stable, with all eigenvalues within the radius;
    with `longest` it is stable for every period up to that, with `other` for that period too."""
    loop, (C, K), step = yield from linear_loop(claim)
    numbers, J = claim.numbers, loop.given
    h, radius, longest, other = numbers["period"], numbers["radius"], numbers.get("longest"), numbers.get("other")
    yield "step", Contracts(step(h), radius)
    yield "radius", Exceeds(Fraction(1), radius)
    said = f"near rest, with the torque held for {below(h)} s, the loop is stable, "
    said += f"with all eigenvalues within {above(radius)}"
    if longest is not None:
        demand(longest >= h, "the longest period is shorter than the period")
        yield "inertia outweighs damping", Definite(plus(J, C, -longest / 2))
        yield "damping outweighs stiffness", Definite(plus(C, K, -longest / 4))
        said += f", and it is stable for every period up to {below(longest)} s"
    if other is not None:
        yield "another step", Contracts(step(other))
        said += f", and it is stable for a period of {below(other)} s"
    return Statement(said, (*loop.assumed, "linear-motion"), "sampling")
