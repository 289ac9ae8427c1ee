"""Theorems about station keeping near a libration point. Proofs: docs/kernel.md, section 8.

All are about the loop of `points`, and assume two bodies on circles, a known state, and control without lag.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from ..loops import wired
from ..numbers import RefusedError, demand
from ..points import STATE, PointLoop
from ..polynomials import Poly, dot, horner, minus, multiple, poly, var, variables
from ..programs import Case
from ..reading import Claim
from ..rules import Contracts, Exceeds, Part, Proof, Shown, Squares, Vanishes, vanish
from ..sentences import Statement, above, below, enumerated
from .limits import loads, within


@dataclass(frozen=True)
class Circle:
    """The circle y^2 + z^2 = square, y' = -rate z, z' = rate y, and V = weights.(f1^2, f2^2, f3^2) of the errors f1 = y^2 +
    z^2 - square, f2 = y' + rate z, f3 = z' - rate y. `size` and `inverse` name |(f2, f3)| where the law uses it."""

    errors: list[Poly]
    square: Fraction
    rate: Fraction
    size: str
    inverse: str
    weights: Sequence[Fraction] = ()

    @property
    def lyapunov(self) -> Poly:
        """Return V."""
        return dot(self.weights, [p * p for p in self.errors])

    @property
    def running(self) -> dict[str, Poly]:
        """Return the velocities with f2 = f3 = 0."""
        return {"v2": -self.rate * var("x3"), "v3": self.rate * var("x2")}

    def met(self, p: Poly) -> Poly:
        """Return p with the size n written as s n^2, its value where n > 0."""
        wrong = self.errors[1:]
        return p.at({self.size: var(self.inverse) * dot(wrong, wrong)})

    def bounds(self, side: Case) -> list[tuple[Fraction, Fraction]]:
        """Return the bounds that a side gives for the size n: n >= c for each f > 0 and c, n <= c for each f < 0 and c."""
        return [multiple(var(self.size), p) for p in side.known]


def ends_on_circle(claim: Claim) -> Proof:
    """Every motion from {V <= level} converges to the circle, with x = 0. The set contains circles between two radii, and
    errors of the velocity; on it the control is limited."""
    loop, numbers = PointLoop(claim), claim.numbers
    circle = yield from weighed(loop)
    c, heavy = circle.square, circle.weights[0]
    level, inner, outer, velocity = (numbers[name] for name in ("level", "inner", "outer", "velocity"))
    yield "centre outside", Exceeds(heavy * c * c, level)
    yield from decreases(loop, circle)
    yield from clear_of_bodies(loop, circle, level)
    demand(inner <= outer, "the radii are in another order")
    yield "inner circles", Exceeds(level, heavy * (inner * inner - c) ** 2)
    yield "outer circles", Exceeds(level, heavy * (outer * outer - c) ** 2)
    yield "errors of the velocity", Exceeds(level, max(circle.weights[1:]) * velocity * velocity)
    limited = yield from within_limit(loop, circle, level)
    text = f"from {{V <= {below(level)}}}, which holds circles of radius {above(inner)} to {below(outer)} at the same rate "
    text += f"and, on the circle, velocities off by {below(velocity)}, the motion ends on the circle{limited}"
    beside, label = ("in-the-plane", "control-limit") if limited else ("unlimited-control", "circle")
    return Statement(text, (*loop.assumed, beside), label)


def declared(loop: PointLoop) -> Part[Circle]:
    """Show that the law's errors are those of a circle."""
    errors = loop.single("errors", 3)
    square, rate = -errors[0].at({"x2": 0, "x3": 0}).number, errors[1].slope("x3").number
    (_, y, z), (_, v, w) = loop.x, loop.v
    expected = [y * y + z * z - square, v + rate * z, w - rate * y]
    yield from vanish("the errors are those of a circle", minus(errors, expected), first=1)
    loop.sides  # noqa: B018 (asks for roots)
    return Circle(errors, square, rate, *loop.relay(errors[1:]))


def weighed(loop: PointLoop) -> Part[Circle]:
    """Show that the circle is a motion, and that V is a positive sum of the squares of its errors."""
    circle = yield from declared(loop)
    (V,) = loop.single("lyapunov", 1)
    weights = [V.terms.get(m, Fraction(0)) for m in (("x2",) * 4, ("v2",) * 2, ("v3",) * 2)]
    circle = replace(circle, weights=weights)
    yield "V is a sum of squares", Vanishes(V - circle.lyapunov)
    yield "V is positive", Exceeds(min(weights))
    yield "the circle is run through", Exceeds(min(circle.square, circle.rate * circle.rate))
    return circle


def decreases(loop: PointLoop, circle: Circle) -> Shown:
    """V' <= -c (f2^2 + f3^2) in the case of the law that holds on the circle, V' <= -c in all others, in which the law is
    bounded; f2 = f3 = 0 for all time only on the circle, and x returns."""
    wrong = circle.errors[1:]
    near = [side for side in loop.sides if circle.inverse not in loop.depends_on(side)]
    demand(len(near) == 1, "not one side of the law holds the circle")
    along_x = loop.acceleration(near[0])[0]
    a, b = along_x.slope("x1").number, along_x.slope("v1").number
    for k, side in enumerate(loop.sides):
        motion, z, known = loop.acceleration(side), wrong, list[Poly]()
        demand(loop.depends_on(side) <= {*STATE, circle.inverse}, "the motion depends on more than the state")
        yield f"x is on its own {k}", Vanishes(motion[0] - a * loop.x[0] - b * loop.v[0])
        slope = -loop.slopes_along(circle.lyapunov, motion)
        if side is not near[0]:
            apart = any(f > 0 and c > 0 for f, c in circle.bounds(side))
            demand(apart, "the law may have no bound on a side")
            slope, z, known = circle.met(slope), [poly(1)], [circle.met(p) for p in side.known]
        yield f"V does not increase {k}", Squares(slope, z, len(z), known)
    yield "x returns", Contracts([[Fraction(0), Fraction(1)], [a, b]], flow=True)


def clear_of_bodies(loop: PointLoop, circle: Circle, level: Fraction) -> Shown:
    """Where V <= level every root and quotient is defined: y^2 + z^2 exceeds clear^2, and radicands are positive there."""
    roots = {name: p for name, p in loop.radicands.items() if name != circle.size}
    if roots or loop.ring.divisors:
        square = loop.claim.numbers["clear"] ** 2
        yield "off the line of the bodies", Exceeds(circle.square, square)
        yield "off it on the whole set", Exceeds(circle.weights[0] * (circle.square - square) ** 2, level)
        apart = dot(loop.x[1:], loop.x[1:]) - square
        for k, p in enumerate(roots.values()):
            yield f"a root has a value {k}", Squares(p, [poly(1), loop.x[0]], 1, [apart])
    loop.divides_by_distances()


def within_limit(loop: PointLoop, circle: Circle, level: Fraction) -> Part[str]:
    """On {V <= level} with x = x' = 0, which is invariant, the norm of the control is at most `limit.norm`, each axis of it
    `limit.axis`. The errors f are variables; where |(f2, f3)| = 1/s, s (f2, f3) is a unit vector."""
    norm, axis = loop.claim.numbers.get("limit.norm"), loop.claim.numbers.get("limit.axis")
    f, (_, y, z) = variables("f"), loop.x
    put = {"x1": 0, "v1": 0, "v2": f[1] - circle.rate * z, "v3": f[2] + circle.rate * y}
    inside = level - dot(circle.weights, [p * p for p in f])

    def flat(p: Poly) -> Poly:
        # z^2 = f1 + the circle's square - y^2.
        parts, square = p.at(put).powers("x3"), f[0] + circle.square - y * y
        return horner(parts[::2], square) + z * horner(parts[1::2], square)

    for k, side in enumerate(loop.sides if norm is not None or axis is not None else ()):
        relations, unit = [f[0] - y * y - z * z + circle.square], list[Poly]()
        if circle.inverse in loop.depends_on(side):
            unit = [var(circle.inverse) * p for p in f[1:]]
            u, known = [flat(circle.met(p)) for p in side.value], [circle.met(p).at(put) for p in side.known]
            relations.append(dot(unit, unit) - 1)
        else:
            u, wrong = [flat(p) for p in side.value], dot(f[1:], f[1:])
            known = [most * most - wrong for factor, most in circle.bounds(side) if factor < 0 <= most]
        for name, bound, row in loads("control", axis, norm):
            terms = [poly(1), y, z, *f, *unit]
            yield f"{name} {k}", within(bound, dot(row, u), terms, (y, z, f[0]), [*known, inside], relations)
    said = [f"{above(most)} {how}" for most, how in ((norm, "in norm"), (axis, "on every axis")) if most is not None]
    return f" with no more control than {enumerated(said)}" if said else ""


def comes_to_rest(claim: Claim) -> Proof:
    """Every motion converges to the law's rest: the acceleration is zero there, it is linear, and all of its eigenvalues
    have negative real parts."""
    loop = PointLoop(claim)
    motion, at = only_side(loop), resting(loop)
    yield from vanish("rest is one", [p.at(at) for p in motion], first=1)
    flow = [[Fraction(k == i + 3) for k in range(6)] for i in range(3)]
    yield "returns", Contracts([*flow, *([p.slope(name).number for name in STATE] for p in motion)], flow=True)
    text = "from everywhere the motion comes to rest"
    return Statement(text, (*loop.assumed, "unlimited-control", *loop.bodies), "equilibrium")


def only_side(loop: PointLoop) -> list[Poly]:
    """Return the acceleration under a law without switching, in which roots and quotients cancel."""
    demand(len(loop.sides) == 1, "the law switches")
    demand(loop.depends_on(loop.sides[0]) <= {*STATE}, "the motion depends on more than the state")
    return loop.acceleration(loop.sides[0])


def resting(loop: PointLoop) -> Mapping[str, Fraction]:
    """Return the state of rest of the law."""
    return dict.fromkeys(STATE, Fraction(0)) | {f"x{k}": p.number for k, p in enumerate(loop.single("rest", 3), 1)}


def returns_with_limited_control(claim: Claim) -> Proof:
    """With y = z = 0 maintained and each axis of the control within the limit, motions with |S| <= width and |x| <= reach, S
    = x + x'/s, s^2 the slope of the field, stay there and converge to x = 0; from |S| >= boundary none does."""
    loop, numbers = PointLoop(claim), claim.numbers
    limit, width, reach, boundary = (numbers[name] for name in ("limit", "width", "reach", "boundary"))
    low, high, x, v = numbers["root.low"], numbers["root.high"], loop.x[0], loop.v[0]
    only_side(loop)
    resting_state = {name: value for name, value in resting(loop).items() if name not in ("x1", "v1")}
    pull, asks = loop.field[0].at(resting_state), loop.sides[0].value[0].at(resting_state)
    p, k, c = pull.slope("x1").number, -asks.slope("x1").number, -asks.slope("v1").number
    yield "the field along X", Vanishes(pull - p * x)
    yield "the law along X", Vanishes(asks + k * x + c * v)
    for name, u in zip("YZ", loop.sides[0].value[1:], strict=True):
        yield f"{name} can be held", Exceeds(limit, abs(u.at({**resting_state, "x1": 0, "v1": 0}).number))
    yield from clipped(loop, limit)
    demand(not loop.bodies, "the equations have no value at the bodies")
    off = max(abs(k - low * c), abs(k - high * c))
    yield "its root", Exceeds(min(p - low * low, high * high - p))
    yield "the limit turns motions round", Exceeds(limit, p * width)
    yield "the law turns motions round", Exceeds(c * low * width - off * reach, p * width)
    yield "x follows", Exceeds(reach, width)
    yield "nothing returns from beyond", Exceeds(boundary * p, limit)
    text = f"with the control along X within {below(limit)} x returns from |x + x'/s| up to {below(width)} and |x| up to "
    text += f"{below(reach)}; from |x + x'/s| = {above(boundary)} on nothing returns"
    return Statement(text, (*loop.assumed, "held-aside"), "saturated-axis")


def clipped(loop: PointLoop, limit: Fraction) -> Shown:
    """Along X the limit passes the value between -limit and limit nearest to the demand t: it satisfies (t - acts)(w - acts)
    <= 0 for w = -limit and limit."""
    t = variables("t")
    for k, case in enumerate(loop.read("limited", 3, wired("command", t), {"limit": poly(limit)})[0]):
        known, acts, asks = case.known, case.value, t[0]
        shown = {"at least": acts + limit, "at most": limit - acts}
        shown |= {"near from below": (acts - asks) * (limit - acts), "near from above": (asks - acts) * (limit + acts)}
        for name, p in shown.items():
            yield f"limited {name} {k}", Squares(p, [poly(1)], 0, known)


def needs_more_control(claim: Claim) -> Proof:
    """The law demands more than its limit at a point of the circle itself."""
    loop, numbers = PointLoop(claim), claim.numbers
    circle = yield from declared(loop)
    y, z, control = numbers.coordinate("y"), numbers.coordinate("z"), numbers["control"]
    limits = [numbers.get("limit.norm"), numbers.get("limit.axis")]
    demand(limits.count(None) == 1, "there is not one limit")
    at = {"x1": 0, "x2": y, "x3": z, "v1": 0, "v2": -circle.rate * z, "v3": circle.rate * y, circle.size: 0}
    yield from vanish("on the circle", [p.at(at) for p in circle.errors], first=1)
    here = [s for s in loop.sides if all((Poly(dict(p)).at(at).number > 0) == holds for p, holds in s.guards)]
    demand(len(here) == 1, "the law has no side there")
    demand(all(b.at(at).number for b in loop.ring.divisors), "a program divides by zero there")
    squares = [p.at(at).number ** 2 for p in here[0].value]
    yield "control", Exceeds(max(squares) if limits[0] is None else sum(squares, Fraction(0)), control * control)
    yield "more than the limit", Exceeds(control, next(x for x in limits if x is not None))
    text = f"the circle itself asks for a control of {below(control)}, more than the limit"
    return Statement(text, (*loop.assumed, "in-the-plane"), "control-limit", True)


def does_not_return(claim: Claim) -> Proof:
    """An axis moves on its own, as x'' = ax + bx' + c with a >= 0 or b >= 0: some motions along it, arbitrarily near to a
    wanted one, do not return. This applies to a law with the errors of a circle."""
    loop = PointLoop(claim)
    label = "equilibrium" if claim.programs.get("errors") is None else "circle"
    motions = [loop.acceleration(side) for side in loop.sides]
    for i, (x, v) in enumerate(zip(loop.x, loop.v, strict=True)):
        slopes = [motion[i].slope(name) for motion in motions for name in (f"x{i + 1}", f"v{i + 1}")]
        if any(p.names for p in slopes) or max(slopes[0].number, slopes[1].number) < 0:
            continue
        along_axis = slopes[0] * x + slopes[1] * v + motions[0][i].terms.get((), 0)
        yield from vanish("an axis on its own", [motion[i] - along_axis for motion in motions])
        text = f"along {'XYZ'[i]} some motions do not return"
        return Statement(text, (*loop.assumed, "unlimited-control", *loop.bodies), label, True)
    raise RefusedError("every axis returns")


def holds_another_circle(claim: Claim) -> Proof:
    """A relay without a boundary layer, which subtracts k (f2, f3)/|(f2, f3)|, maintains another circle: where f2 = f3 = 0
    its Filippov set contains all vectors up to the size k, and staying there takes g |f1| r."""
    loop, numbers = PointLoop(claim), claim.numbers
    circle = yield from declared(loop)
    radius, needs, of = numbers["radius"], numbers["needs"], numbers["of"]
    demand(len(loop.ring.roots) == 1 and not loop.ring.divisors, "there are more roots than that of a relay")
    away = [side for side in loop.sides if circle.inverse in loop.depends_on(side)]
    demand(len(away) == 1, "the law is no relay")
    demand(all(factor > 0 and least <= 0 for factor, least in circle.bounds(away[0])), "the relay has a layer")
    motion, s, f1 = loop.acceleration(away[0]), var(circle.inverse), circle.errors[0]
    yield "the plane is not left", Vanishes(motion[0].at({"x1": 0, "v1": 0}))
    for k, (p, x) in enumerate(zip(circle.errors[1:], loop.x[1:], strict=True)):
        slope = loop.slopes_along(p, motion)
        drift = slope.at({circle.inverse: 0}).at({**circle.running, "x1": 0, "v1": 0})
        size, pull = -multiple(slope.slope(circle.inverse), p)[0], multiple(drift, f1 * x)[0]
        yield f"the relay {k}", Vanishes(slope - slope.at({circle.inverse: 0}) + size * s * p)
        yield f"the drift {k}", Vanishes(drift - pull * f1 * x)
        demand(size >= of >= needs >= abs(pull * (radius * radius - circle.square)) * radius, "the relay does not hold it")
    yield "another circle", Exceeds(min((radius * radius - circle.square) ** 2, radius))
    text = f"the relay holds the circle of radius {below(radius)} too"
    return Statement(text, (*loop.assumed, "unlimited-control"), "circle", True)
