"""A theorem about loops that know no axis: V and V' do not change where attitude and rate are turned together, and so
depend on 1 - q0, |w| and the part of q along w alone. Proof: docs/kernel.md, section 3."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

from ..loops import AttitudeLoop
from ..numbers import demand
from ..polynomials import Poly, cross, horner, poly, total, var
from ..reading import Claim
from ..rules import Obligation, Squares, Sum, vanish
from ..sentences import Statement, below
from .attitude import concluded


def converges_without_axes(claim: Claim) -> Generator[tuple[str, Obligation], None, Statement]:
    """Every motion from {V <= level} stays there and comes to rest on target: V is least on target, and on the set
    V' <= -c (|w|^2 + |q|^2). Both are shown where w = (v, 0, 0) and q = (t, n, 0)."""
    loop = AttitudeLoop(claim, quotients=True)
    yield from loop.sound()
    V, level = loop.lyapunov, claim.numbers["level"]
    slope = without_quotients(loop, loop.slopes_along(V, loop.acceleration))
    loop.autonomous([slope, *loop.divisors.values()])
    for name, divisor in loop.divisors.items():
        yield f"divisor {name}", Squares(divisor, [poly(1), *loop.q, *loop.w], 1, modulo=[loop.sphere])
    for name, p in (("V", V), ("V'", slope)):
        yield from vanish(f"{name} turned about axis", [turned(loop, p, axis) for axis in range(3)])
    u, v, t = map(var, "uvt")
    height, fall, q2 = reduced(V), -reduced(slope), u * (2 - u)
    yield "V is least on target", Sum(height, [q2 - t * t], (), [v * v, u * u, q2])
    yield "V falls", Sum(fall, [level - height, q2 - t * t], (), [v * v, q2])
    statement = yield from concluded(loop, [f"every motion from {{V <= {below(level)}}} stays there and"], strictly=True)
    return replace(statement, label="region")


def without_quotients(loop: AttitudeLoop, p: Poly) -> Poly:
    """Return p times its divisors, each as often as p has its inverse: a product that has the sign of p."""
    for name, divisor in loop.divisors.items():
        p = horner(p.powers(name)[::-1], divisor)
    return p


def turned(loop: AttitudeLoop, p: Poly, axis: int) -> Poly:
    """Return the derivative of p where q and w are turned together about an axis."""
    along = [poly(i == axis) for i in range(3)]
    vectors = [("q", loop.q[1:]), ("w", loop.w)]
    return total(p.slope(f"{x}{i}") * rate for x, own in vectors for i, rate in enumerate(cross(along, own), 1))


def reduced(p: Poly) -> Poly:
    """Return p at w = (v, 0, 0), q = (t, n, 0) and q0 = 1 - u, even in n, of which the square is u (2 - u) - t^2."""
    u, v, t = map(var, "uvt")
    parts = p.at({"q0": 1 - u, "q1": t, "q3": 0, "w1": v, "w2": 0, "w3": 0}).powers("q2")
    demand(not any(part.terms for part in parts[1::2]), "a function of a direction has one side")
    return horner(parts[::2], u * (2 - u) - t * t)
