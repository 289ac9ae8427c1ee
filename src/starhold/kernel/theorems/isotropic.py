"""A theorem about loops that know no axis: V and V' do not change where attitude and rate are turned together.

So they depend on three numbers alone, 1 - q0, |w| and the part of q along w. The law may divide by the state, as long as
what it divides by is positive. Proof: docs/kernel.md, section 3.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

from ..loops import AttitudeLoop
from ..numbers import demand
from ..polynomials import Poly, cross, poly, total, var
from ..reading import Claim
from ..rules import Obligation, Squares, Sum, Vanishes
from ..sentences import Statement, below
from .attitude import concluded


def converges_without_axes(claim: Claim) -> Generator[tuple[str, Obligation], None, Statement]:
    """Every motion from {V <= level} stays there and comes to rest on target: V is least on target, and on the set
    V' <= -c (|w|^2 + |q|^2) (Lyapunov). Both are shown where w = (v, 0, 0) and q = (t, n, 0), to which every state can be
    turned, with n^2 = |q|^2 - t^2 and |q|^2 = u (2 - u), u = 1 - q0."""
    loop = AttitudeLoop(claim, quotients=True)
    yield from loop.sound()
    V, level = loop.lyapunov, claim.numbers["level"]
    # A product with positive divisors has the sign of V'.
    slope = without_quotients(loop, loop.slopes_along(V, loop.acceleration))
    loop.autonomous([slope, *loop.divisors.values()])
    for name, divisor in loop.divisors.items():
        yield f"divisor {name}", Squares(divisor, [poly(1), *loop.q, *loop.w], 1, modulo=[loop.sphere])
    for name, p in (("V", V), ("V'", slope)):
        for axis, change in enumerate(turned(loop, p)):
            yield f"{name} turned about axis {axis}", Vanishes(change)
    u, v, t = map(var, "uvt")
    height, fall, q2 = reduced(V), -reduced(slope), u * (2 - u)
    yield "V is least on target", Sum(height, [q2 - t * t], (), [v * v, u * u, q2])
    yield "V falls", Sum(fall, [level - height, q2 - t * t], (), [v * v, q2])
    statement = yield from concluded(loop, [f"every motion from {{V <= {below(level)}}} stays there and"], strictly=True)
    return replace(statement, label="region")


def without_quotients(loop: AttitudeLoop, p: Poly) -> Poly:
    """Return p times its divisors, each as often as p has its inverse."""
    for z, divisor in loop.divisors.items():
        most, found = max((m.count(z) for m in p.terms), default=0), Poly({})
        for times in range(most + 1):
            part = {tuple(x for x in m if x != z): c for m, c in p.terms.items() if m.count(z) == times}
            found = found * divisor + Poly(part)
        p = found
    return p


def turned(loop: AttitudeLoop, p: Poly) -> list[Poly]:
    """Return the derivatives of p where q and w are turned together about each axis."""
    axes = [[poly(i == k) for i in range(3)] for k in range(3)]
    vectors = [("q", loop.q[1:]), ("w", loop.w)]
    return [
        total(p.slope(f"{x}{i}") * rate for x, own in vectors for i, rate in enumerate(cross(axis, own), 1)) for axis in axes
    ]


def reduced(p: Poly) -> Poly:
    """Return p at w = (v, 0, 0), q = (t, n, 0) and q0 = 1 - u, even in n, of which the square is u (2 - u) - t^2."""
    u, v, t = map(var, "uvt")
    at = p.at({"q0": 1 - u, "q1": t, "q3": 0, "w1": v, "w2": 0, "w3": 0})
    demand(all(m.count("q2") % 2 == 0 for m in at.terms), "a function of a direction has one side")
    found, square, power = Poly({}), u * (2 - u) - t * t, poly(1)
    for times in range(0, 1 + max((m.count("q2") for m in at.terms), default=0), 2):
        part = {tuple(x for x in m if x != "q2"): c for m, c in at.terms.items() if m.count("q2") == times}
        found, power = found + Poly(part) * power, power * square
    return found
