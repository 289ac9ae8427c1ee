"""Theorems of keeping a station near a libration point. Proofs: docs/kernel.md, section 7.

All are about the loop of `points`. Assumed of every one: two bodies on circles, a known state, control without lag."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from ..loops import read, wired
from ..numbers import RefusedError, Rows, demand
from ..points import STATE, PointLoop, Side
from ..polynomials import Poly, dot, multiple, poly, var, variables
from ..reading import Claim
from ..rules import Contracts, Exceeds, Obligation, Shown, Solves, Squares, Vanishes
from ..sentences import Statement, above, below, enumerated

Proof = Generator[tuple[str, Obligation], None, Statement]


@dataclass(frozen=True)
class Circle:
    """The circle y^2 + z^2 = square, y' = -rate z, z' = rate y, and V = weights.(f1^2, f2^2, f3^2) of the errors
    f1 = y^2 + z^2 - square, f2 = y' + rate z, f3 = z' - rate y. `size` and `inverse` name |(f2, f3)| where that is asked."""

    errors: list[Poly]
    square: Fraction
    rate: Fraction
    weights: list[Fraction]
    size: str
    inverse: str

    @property
    def running(self) -> dict[str, Poly]:
        """Return the velocities with f2 = f3 = 0."""
        return {"v2": -self.rate * var("x3"), "v3": self.rate * var("x2")}

    def met(self, p: Poly) -> Poly:
        """Return p with the size n written as s n^2, which it is where n > 0."""
        wrong = self.errors[1:]
        return p.at({self.size: var(self.inverse) * dot(wrong, wrong)})


def ends_on_circle(claim: Claim) -> Proof:
    """Every motion from {V <= level} ends on the circle, with x = 0.

    V is a positive sum of squares of the errors, so that {V <= level} is compact in y, z, y', z'; x moves on its own and
    returns. On the one side of the law that holds (f2, f3) = 0 V' <= -c (f2^2 + f3^2); on each other one V' <= -c and the
    law is bounded, for there |(f2, f3)| is above a positive number. Both hold of limits and convex combinations too, and so
    of every Filippov solution. By the invariance principle (LaSalle 1960; of discontinuous laws Shevitz and Paden 1994)
    motions end where f2 = f3 = 0 for all time. That leaves f1 y = f1 z = 0: the circle, or y = z = 0, where V is above the
    level. The set holds circles between two radii, as V is convex in the square of the radius, and errors of the velocity.
    In the full problem the motion is clear of the bodies, which lie at y = z = 0."""
    loop = PointLoop(claim)
    circle = yield from declared(loop)
    numbers = claim.numbers
    level, c, heavy = numbers["level"], circle.square, circle.weights[0]
    inner, outer, velocity = numbers["inner"], numbers["outer"], numbers["velocity"]
    yield "the level is positive", Exceeds(level)
    yield "centre outside", Exceeds(heavy * c * c, level)
    yield from falls(loop, circle)
    yield from clear_of_bodies(loop, circle, level)
    demand(0 <= inner <= outer and velocity >= 0, "the radii are in another order, or an error is negative")
    yield "inner circles", Exceeds(level, heavy * (inner * inner - c) ** 2)
    yield "outer circles", Exceeds(level, heavy * (outer * outer - c) ** 2)
    yield "errors of the velocity", Exceeds(level, max(circle.weights[1:]) * velocity * velocity)
    limited = yield from within_limit(loop, circle, level)
    text = f"from {{V <= {below(level)}}}, which holds circles of radius {above(inner)} to {below(outer)} at the same rate "
    text += f"and, on the circle, velocities off by {below(velocity)}, the motion ends on the circle{limited}"
    return Statement(text, (*assumed(loop), "in-the-plane" if limited else "unlimited-control"))


def declared(loop: PointLoop) -> Generator[tuple[str, Obligation], None, Circle]:
    """The law's errors are those of a circle that is run through, and V is a positive sum of their squares."""
    errors, (V,) = loop.single("errors", 3), loop.single("lyapunov", 1)
    square, rate = -errors[0].at({"x2": 0, "x3": 0}).number, errors[1].slope("x3").number
    (_, y, z), (_, v, w) = loop.x, loop.v
    for k, p in enumerate((y * y + z * z - square, v + rate * z, w - rate * y)):
        yield f"the errors are those of a circle {k + 1}", Vanishes(errors[k] - p)
    weights = [V.terms.get(m, Fraction(0)) for m in (("x2",) * 4, ("v2",) * 2, ("v3",) * 2)]
    yield "V is a sum of squares", Vanishes(V - dot(weights, [p * p for p in errors]))
    yield "V is positive", Exceeds(min(weights))
    yield "the circle is run through", Exceeds(min(square, rate * rate))
    loop.sides  # noqa: B018 (asks for roots)
    return Circle(errors, square, rate, weights, *loop.relay(errors[1:]))


def falls(loop: PointLoop, circle: Circle) -> Shown:
    """V decreases on every side of the law, as `ends_on_circle` says, and x returns."""
    V, wrong = dot(circle.weights, [p * p for p in circle.errors]), circle.errors[1:]
    near = [side for side in loop.sides if circle.inverse not in asked(loop, side)]
    demand(len(near) == 1, "not one side of the law holds the circle")
    along_x = loop.acceleration(near[0])[0]
    a, b = along_x.slope("x1").number, along_x.slope("v1").number
    for k, side in enumerate(loop.sides):
        motion, away = loop.acceleration(side), side is not near[0]
        demand(asked(loop, side) <= {*STATE, circle.inverse}, "the motion depends on more than the state")
        yield f"x is on its own {k}", Vanishes(motion[0] - a * loop.x[0] - b * loop.v[0])
        if away:
            demand(far(circle, side) > 0, "the law may have no bound on a side")
        slope = -circle.met(loop.along(V, motion)) if away else -loop.along(V, motion)
        z, known = ([poly(1)], [circle.met(p) for p in side.known]) if away else (wrong, [])
        yield f"V decreases {k}", Squares(slope, z, len(z), known)
    stays = [loop.along(p, loop.acceleration(near[0])).at(circle.running) for p in wrong]
    yield "only the circle", Solves(stays, [circle.errors[0] * p for p in loop.x[1:]])
    yield "x returns", Contracts([[Fraction(0), Fraction(1)], [a, b]], flow=True)


def asked(loop: PointLoop, side: Side) -> set[str]:
    """Return the variables of the acceleration."""
    return {name for p in loop.acceleration(side) for name in p.names}


def far(circle: Circle, side: Side) -> Fraction:
    """Return a number that |(f2, f3)| is above on a side; negative where none is told."""
    found = (multiple(var(circle.size), p) for p in side.known)
    return max((offset for factor, offset in found if factor > 0), default=Fraction(-1))


def clear_of_bodies(loop: PointLoop, circle: Circle, level: Fraction) -> Shown:
    """Where V <= level every root and quotient has a value: y^2 + z^2 is above clear^2, and there radicands are positive."""
    roots = {name: p for p, name in loop.ring.roots.items() if name != circle.size}
    if roots or loop.ring.divisors:
        square = loop.claim.numbers["clear"] ** 2
        yield "off the line of the bodies", Exceeds(min(square, circle.square - square))
        yield "off it on the whole set", Exceeds(circle.weights[0] * (circle.square - square) ** 2, level)
        apart = dot(loop.x[1:], loop.x[1:]) - square
        for k, p in enumerate(roots.values()):
            yield f"a root has a value {k}", Squares(Poly(dict(p)), [poly(1), loop.x[0]], 1, [apart])
    for b in loop.ring.divisors:
        demand(b.names <= roots.keys() and min(b.terms.values()) > 0, "a divisor may be zero")


def within_limit(loop: PointLoop, circle: Circle, level: Fraction) -> Generator[tuple[str, Obligation], None, str]:
    """On {V <= level} with x = x' = 0, which is not left, the norm of the control is at most `limit.norm`, each axis of it
    `limit.axis`. With errors f for variables V is a sum of their squares; where |(f2, f3)| = 1/s, s (f2, f3) is a unit."""
    numbers = loop.claim.numbers
    norm, axis = numbers.get("limit.norm"), numbers.get("limit.axis")
    f, d, (_, y, z) = variables("f"), variables("d"), loop.x
    put = {"x1": 0, "v1": 0, "v2": f[1] - circle.rate * z, "v3": f[2] + circle.rate * y}
    wrong, inverse = dot(f[1:], f[1:]), var(circle.inverse)
    for k, side in enumerate(loop.sides if norm is not None or axis is not None else ()):
        away = circle.inverse in asked(loop, side)
        u = [on_circles((circle.met(p) if away else p).at(put), f[0] + circle.square - y * y) for p in side.u]
        unit = [inverse * p for p in f[1:]] if away else []
        known = [circle.met(p).at(put) for p in side.known] if away else [w * w - wrong for w in widths(circle, side)]
        known.append(level - dot(circle.weights, [p * p for p in f]))
        relations = [f[0] - y * y - z * z + circle.square, *([dot(unit, unit) - 1] if away else [])]
        terms = [poly(1), y, z, *f, *unit]
        if norm is not None:
            wide = [*terms, *d, *(p * q for p in d for q in (y, z, f[0]))]
            yield f"norm of the control {k}", Squares(norm - dot(d, u), wide, 0, known, [*relations, dot(d, d) - 1])
        if axis is not None:
            for i, p in enumerate(u):
                for sign in (1, -1):
                    yield f"control {sign * (i + 1):+d} {k}", Squares(axis - sign * p, terms, 0, known, relations)
    said = [f"{above(most)} {how}" for most, how in ((norm, "in norm"), (axis, "on every axis")) if most is not None]
    return f" with no more control than {enumerated(said)}" if said else ""


def on_circles(p: Poly, square: Poly) -> Poly:
    """Return p with z^2 = f1 + the circle's square - y^2 put in wherever z is squared."""
    found = Poly({})
    for m, c in p.terms.items():
        term = Poly({tuple(sorted([*(n for n in m if n != "x3"), *["x3"] * (m.count("x3") % 2)])): c})
        for _ in range(m.count("x3") // 2):
            term = term * square
        found = found + term
    return found


def widths(circle: Circle, side: Side) -> list[Fraction]:
    """Return the numbers that |(f2, f3)| is at most on a side."""
    found = (multiple(p, var(circle.size)) for p in side.known if circle.size in p.names)
    return [offset / -factor for factor, offset in found if factor < 0 <= offset]


def comes_to_rest(claim: Claim) -> Proof:
    """Every motion comes to rest where the law says: there the acceleration is zero, it is linear, and all of its
    eigenvalues have negative real parts."""
    loop = PointLoop(claim)
    motion, at = only_side(loop), resting(loop)
    for k, p in enumerate(motion):
        yield f"rest is one {k + 1}", Vanishes(p.at(at))
    flow: Rows = [[Fraction(k == i + 3) for k in range(6)] for i in range(3)]
    yield "returns", Contracts([*flow, *([p.slope(name).number for name in STATE] for p in motion)], flow=True)
    return Statement("from everywhere the motion comes to rest", (*assumed(loop), "unlimited-control", *bodies(loop)))


def only_side(loop: PointLoop) -> list[Poly]:
    """Return the acceleration under a law that does not switch, in which roots and quotients cancel."""
    demand(len(loop.sides) == 1, "the law switches")
    demand(asked(loop, loop.sides[0]) <= {*STATE}, "the motion depends on more than the state")
    return loop.acceleration(loop.sides[0])


def resting(loop: PointLoop) -> Mapping[str, Fraction]:
    """Return the state of rest that the law is for."""
    return dict(zip(STATE, [*(p.number for p in loop.single("rest", 3)), *[Fraction(0)] * 3], strict=True))


def returns_with_limited_control(claim: Claim) -> Proof:
    """With y and z held at rest and each axis of the control within the limit U, motions with |S| <= width and |x| <= reach,
    S = x + x'/s, s = sqrt(p), stay there and come to x = 0; from |S| >= boundary none does.

    x'' = p x - clip(kx + cx'), so s S' = p S - clip(c s S + e x) with e = k - s c, and x' = s (S - x). Let
    0 < M = max(|S|/width, |x|/reach) <= 1. Where M is the first, c s S + e x has the sign of S and at least M times the size
    c s width - |e| reach, more than M p width, and so has what the limit leaves of it, as that is above p width: |S| falls.
    Where M is the second, |x| falls as reach > width. So M does, in proportion. Beyond, s S' >= p S - U > 0."""
    loop, numbers = PointLoop(claim), claim.numbers
    limit, width, reach, boundary = (numbers[name] for name in ("limit", "width", "reach", "boundary"))
    low, high, x, v = numbers["root.low"], numbers["root.high"], loop.x[0], loop.v[0]
    only_side(loop)
    held = {name: value for name, value in resting(loop).items() if name not in ("x1", "v1")}
    pull, asks = loop.field[0].at(held), loop.sides[0].u[0].at(held)
    p, k, c = pull.slope("x1").number, -asks.slope("x1").number, -asks.slope("v1").number
    yield "the field along X", Vanishes(pull - p * x)
    yield "the law along X", Vanishes(asks + k * x + c * v)
    for name, u in zip("YZ", loop.sides[0].u[1:], strict=True):
        yield f"{name} can be held", Exceeds(limit, abs(u.at({**held, "x1": 0, "v1": 0}).number))
    yield from clipped(loop, limit)
    off = max(abs(k - low * c), abs(k - high * c))
    yield "the point repels", Exceeds(min(p, low, c, width))
    yield "its root", Exceeds(min(p - low * low, high * high - p))
    yield "the limit turns motions round", Exceeds(limit, p * width)
    yield "the law turns motions round", Exceeds(c * low * width - off * reach, p * width)
    yield "x follows", Exceeds(reach, width)
    yield "nothing returns from beyond", Exceeds(boundary * p, limit)
    text = f"with the control along X within {below(limit)} x returns from |x + x'/s| up to {below(width)} and |x| up to "
    text += f"{below(reach)}; from |x + x'/s| = {above(boundary)} on nothing returns"
    return Statement(text, (*assumed(loop), "held-aside"))


def clipped(loop: PointLoop, limit: Fraction) -> Shown:
    """The limit lets act along X, of all between -limit and limit, what is nearest to what is asked, t: that has
    (t - acts)(w - acts) <= 0 for w = -limit and limit."""
    t = variables("t")
    for k, case in enumerate(read(loop.claim, "limited", 3, loop.ring, wired("command", t), {"limit": poly(limit)})[0]):
        known, acts, asks = Side(case.guards, []).known, case.value, t[0]
        for name, p in (
            ("at least", acts + limit),
            ("at most", limit - acts),
            ("near from below", (acts - asks) * (limit - acts)),
            ("near from above", (asks - acts) * (limit + acts)),
        ):
            yield f"limited {name} {k}", Squares(p, [poly(1)], 0, known)


def needs_more_control(claim: Claim) -> Proof:
    """The law asks for more than its limit at a place of the circle itself."""
    loop, numbers = PointLoop(claim), claim.numbers
    circle = yield from declared(loop)
    y, z, control = numbers.coordinate("y"), numbers.coordinate("z"), numbers["control"]
    norm, axis = numbers.get("limit.norm"), numbers.get("limit.axis")
    demand((norm is None) != (axis is None), "there is not one limit")
    at = {"x1": 0, "x2": y, "x3": z, "v1": 0, "v2": -circle.rate * z, "v3": circle.rate * y, circle.size: 0}
    for k, p in enumerate(circle.errors):
        yield f"on the circle {k + 1}", Vanishes(p.at(at))
    here = [s for s in loop.sides if all((Poly(dict(p)).at(at).number > 0) == holds for p, holds in s.guards)]
    demand(len(here) == 1, "the law has no side there")
    squares = [p.at(at).number ** 2 for p in here[0].u]
    yield "control", Exceeds(max(squares) if norm is None else sum(squares, Fraction(0)), control * control)
    yield "more than the limit", Exceeds(control, norm if norm is not None else axis or 0)
    return Statement(
        f"the circle itself asks for a control of {below(control)}, more than the limit", (*assumed(loop), "in-the-plane")
    )


def does_not_return(claim: Claim) -> Proof:
    """An axis moves on its own, as x'' = ax + bx' + c with a >= 0 or b >= 0: an eigenvalue is not on the left, and some
    motions along it, as near as one likes to one that is wanted, stay away."""
    loop = PointLoop(claim)
    motions = [loop.acceleration(side) for side in loop.sides]
    for i, (x, v) in enumerate(zip(loop.x, loop.v, strict=True)):
        slopes = [motion[i].slope(name) for motion in motions for name in (f"x{i + 1}", f"v{i + 1}")]
        if any(p.names for p in slopes) or max(slopes[0].number, slopes[1].number) < 0:
            continue
        a, b = slopes[0].number, slopes[1].number
        c = motions[0][i].terms.get((), Fraction(0))
        for k, motion in enumerate(motions):
            yield f"an axis on its own {k}", Vanishes(motion[i] - a * x - b * v - c)
        return Statement(
            f"along {'XYZ'[i]} some motions do not return", (*assumed(loop), "unlimited-control", *bodies(loop))
        )
    raise RefusedError("every axis returns")


def holds_another_circle(claim: Claim) -> Proof:
    """A relay without a layer, which takes k (f2, f3)/|(f2, f3)| off, holds another circle: where f2 = f3 = 0 its Filippov
    set has all of the size k and less, and to stay there takes g |f1| r."""
    loop, numbers = PointLoop(claim), claim.numbers
    circle = yield from declared(loop)
    radius, needs, of = numbers["radius"], numbers["needs"], numbers["of"]
    demand(len(loop.ring.roots) == 1 and not loop.ring.divisors, "there are more roots than that of a relay")
    away = [side for side in loop.sides if circle.inverse in asked(loop, side)]
    demand(len(away) == 1, "the law is no relay")
    reaching = [multiple(p, var(circle.size)) for p in away[0].known]
    demand(all(factor > 0 and offset >= 0 for factor, offset in reaching), "the relay has a layer")
    motion, s, f1 = loop.acceleration(away[0]), var(circle.inverse), circle.errors[0]
    yield "the plane is not left", Vanishes(motion[0].at({"x1": 0, "v1": 0}))
    for k, (p, x) in enumerate(zip(circle.errors[1:], loop.x[1:], strict=True)):
        slope = loop.along(p, motion)
        drift = slope.at({circle.inverse: 0}).at({**circle.running, "x1": 0, "v1": 0})
        size, pull = -multiple(slope.slope(circle.inverse), p)[0], multiple(drift, f1 * x)[0]
        yield f"the relay {k}", Vanishes(slope - slope.at({circle.inverse: 0}) + size * s * p)
        yield f"the drift {k}", Vanishes(drift - pull * f1 * x)
        demand(size >= of >= needs >= abs(pull * (radius * radius - circle.square)) * radius, "the relay does not hold it")
    yield "another circle", Exceeds(min((radius * radius - circle.square) ** 2, radius))
    return Statement(f"the relay holds the circle of radius {below(radius)} too", (*assumed(loop), "unlimited-control"))


def assumed(loop: PointLoop) -> Sequence[str]:
    """Return what every claim about such a loop assumes."""
    return "linear-field" if loop.linear else "whole-field", "circling-bodies", "exact-place", "continuous-control"


def bodies(loop: PointLoop) -> Sequence[str]:
    """Return what is assumed where the equations have no value everywhere."""
    return ["off-the-bodies"] if loop.ring.roots or loop.ring.divisors else []
