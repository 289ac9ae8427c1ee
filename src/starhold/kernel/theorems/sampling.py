"""The theorem that the torque may be held between samples. Proof: docs/kernel.md, section 5."""

from __future__ import annotations

from collections.abc import Callable, Generator
from fractions import Fraction

from ..held import over_period
from ..loops import AttitudeLoop
from ..numbers import Rows, beside, demand, plus, times
from ..polynomials import Poly, poly
from ..programs import Guards, Piecewise
from ..reading import Claim
from ..rules import Contracts, Definite, Exceeds, Obligation, Vanishes
from ..sentences import Statement, above, below


def near_rest(cases: Piecewise, rest: dict[str, int]) -> Poly:
    """Return the one case that holds around rest on target, where none of its conditions is on its border."""

    def holds(guards: Guards) -> bool:
        values = ((Poly(dict(p)).at(rest).number, truth) for p, truth in guards)
        return all(value != 0 and (value > 0) == truth for value, truth in values)

    found = [case.value for case in cases if holds(case.guards)]
    demand(len(found) == 1, "the law switches at rest on target")
    return found[0]


def linear_loop(
    claim: Claim,
) -> Generator[tuple[str, Obligation], None, tuple[AttitudeLoop, tuple[Rows, Rows], Callable[[Fraction], Rows]]]:
    """Return the loop near rest on target, with u = -Cw - Kq: it, C and K, and the matrix of a step of a period."""
    loop = AttitudeLoop(claim, quotients=True)
    demand(not claim.taken.content, "the loop is taken with nothing")
    yield from loop.sound()
    rest: dict[str, int] = loop.on_target | loop.still
    u = [loop.expanded(near_rest(cases, rest), rest) for cases in loop.law]
    loop.autonomous(u)
    for k, p in enumerate(u):
        yield f"rest on target {k}", Vanishes(p.at(rest))
    C, K = ([[-p.slope(f"{letter}{k}").at(rest).number for k in (1, 2, 3)] for p in u] for letter in "wq")
    push = [[poly(x).number for x in row] for row in loop.J_inverse]
    held = times(push, beside(C, K))
    return loop, (C, K), lambda h: over_period(held, h)


def sampled(claim: Claim) -> Generator[tuple[str, Obligation], None, Statement]:
    """Near rest on target the loop with the torque held for the period is stable, with all eigenvalues no larger than the
    radius, and with `longest` it is for every period up to that.

    With u = -Cw - Kq a step is w+ = w + h J^-1 u, q+ = q + h w/2 + h^2 J^-1 u/4. With z = (1 + x)/(1 - x) its eigenvalues z
    solve ((J - h C/2) x^2 + (C - h K/4) x + K/2) v = 0 up to a factor of x: where the three matrices are symmetric and
    positive definite, Re x < 0 and so |z| < 1. The first two are linear
    in h, and so definite for every h up to the longest if they are for this, for at 0 they then are as well."""
    loop, (C, K), step = yield from linear_loop(claim)
    J: Rows = [[poly(x).number for x in row] for row in loop.J]
    h, radius = claim.numbers["period"], claim.numbers["radius"]
    longest, other = claim.numbers.get("longest"), claim.numbers.get("other")
    yield "step", Contracts(step(h), radius)
    yield "radius", Exceeds(Fraction(1), radius)
    said = (
        f"near rest, with the torque held for {below(h)} s, the loop is stable, with all eigenvalues within {above(radius)}"
    )
    if longest is not None:
        demand(longest >= h, "the longest period is shorter than the period")
        yield "stiffness", Definite(K)
        yield "inertia outweighs damping", Definite(plus(J, C, -longest / 2))
        yield "damping outweighs stiffness", Definite(plus(C, K, -longest / 4))
        said += f", and it is stable for every period up to {below(longest)} s"
    if other is not None:
        yield "another step", Contracts(step(other))
        said += f", and it is stable for a period of {below(other)} s"
    assumptions = ("rigid-body", "inertia-as-given", "exact-measurement", "ideal-actuators")
    return Statement(said, (*assumptions, "no-outside-torque", "target-at-rest", "no-wheels", "linear-motion"), "sampling")
