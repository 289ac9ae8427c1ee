"""The claim that a set of attitudes and rates is a region of attraction, for the closed loop that a single root makes.

With phi_0 = phi_1 = a E, alpha = -a and D v = v + q x v, the modal law's motion is w' = 2a w - 2a^2 D^-1 q + k D^-1 w with
k = 2a (1 - 2ab)(q0 - 1) + (1 - 8ab)/2 q.w + b q0 |w|^2, whatever the inertia. Of

    V = |w|^2/2 + alpha^2 (p u + c2 u^2) + alpha (g + m u) q.w,    u = 1 - q0,

V/alpha^2 and V'/alpha^3 depend on three variables alone: u, W = |w|/alpha and the cosine x of the angle between q and w.
With l = |q|, G = g + m u, beta = ab and K = k/alpha = 2 (1 - 2 beta) u + (1 - 8 beta)/2 W l x - beta q0 W^2

    V'/alpha^3 = W^2 f1 + W l x f2 + l^2 f3,    f1 = -2 + K (1 + l^2 x^2)/(1 + l^2) + G q0/2 + m l^2 x^2/2,
    f2 = -2 + (p + 2 c2 u)/2 + G (K - 2),    f3 = -2 G,

for D^-1 v = (v - q x v + q (q.v))/(1 + l^2). On a bounded set {V <= level} on which V' is negative but at the equilibrium on
target, no motion leaves, V has no other critical point, so that it is positive, and all motions end on target.
p = 4 with c2 = g = m = 0 leaves W^2 f1 alone.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from flint import arb
from numpy.typing import NDArray

from starhold.algebra.intervals import Intervals
from starhold.algebra.polynomial import Polynomial, exact, pieces
from starhold.algebra.vector import add, apply, cross, dot, scale, subtract
from starhold.certification.boxes import Sides, holds_on
from starhold.certification.certificate import BALLS, EXACT, EXACT_SIGN, LASALLE, Claim
from starhold.certification.convergence import Obligations, assumed
from starhold.certification.matrices import number, root_float
from starhold.certification.mixed import SHAPES, Shape
from starhold.certification.motion import Motion
from starhold.certification.subject import Subject, above, below, direction, enclosed

MOST = 300_000
"""Boxes that one proof may take: a fraction of a second."""
LESS = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)
"""How far below the level that points of a grid suggest a proof is tried."""


ENERGY = Shape(4.0, 0.0, 0.0, 0.0)
"""The one without a mixed term: it falls wherever the body turns, and a switch of the quaternion never raises it."""
TRIED = 3
"""Shapes that are tried where points of a grid miss states at which V rises."""


def region(subject: Subject) -> Claim | None:
    """The claim with the largest set that is found; None for a law that does not tell a single root."""
    if not hasattr(subject.law.module, "single_root"):
        return None
    found, told, witness = Obligations(), dict[str, Any](), dict[str, Any]()

    def finish() -> Claim:
        return Claim("region", told, witness, assumed(subject), tuple(found))

    root = subject.law.module.single_root(subject.loop.gains)
    if root is None or not max(root) < 0.0:
        found.add("form", EXACT, None, {"reason": "only for phi_0 = phi_1 = a E with a < 0, and b < 0"})
        return finish()
    if not _same_motion(Motion(subject), *(exact(x) for x in root)):
        found.add("form", EXACT, None, {"reason": "the accelerations are not those of the closed form"})
        return finish()
    found.add("form", EXACT, True)
    a, beta = exact(root[0]), exact(root[0]) * exact(root[1])
    best = _largest(a, beta, subject.loop.sign_policy)
    if best is None:
        found.add("descent", BALLS, None, {"reason": "no level is small enough"})
        return finish()
    shape, level = best
    witness |= shape._asdict()
    told |= {"level": level, "slew_angle": _turn(shape, exact(level) / (a * a)), "rate": root_float(2 * exact(level))}
    found.add("descent", BALLS, True)
    if shape == ENERGY:
        found.add("only equilibrium", LASALLE, True)
    if subject.loop.sign_policy == "hysteresis":
        narrow = 0.0 < subject.loop.hysteresis_width < 1.0
        found.add(
            "jumps lower V", EXACT_SIGN, narrow or None, {} if narrow else {"reason": "the width is not between 0 and 1"}
        )
    else:
        found.add("single equilibrium in the set", EXACT_SIGN, True)
    return finish()


def holds(shape: Shape, beta: Any, bound: Any) -> bool:
    """Whether V' < 0 is shown on all of {V <= bound alpha^2} but where rest is all there is to show it of. beta, bound:
    rationals."""
    mixed = max(abs(shape.g), abs(shape.g + 2.0 * shape.m))
    fastest = (mixed + math.sqrt(mixed * mixed + 2.0 * number(bound))) * (1.0 + 1e-12)
    ceiling, around = above(bound), enclosed(beta)

    def shown(sides: Sides) -> NDArray[np.bool_]:
        v, slope, form = _scaled(shape, around, sides)
        falls = form[0].high < 0.0
        if shape != ENERGY:
            # A quadratic form in W and l is negative where its matrix is, also where both vanish.
            gap = 4.0 * (form[0] * form[2]) - sides[1].square() * form[1].square()
            falls = (falls & (form[2].high < 0.0) & (gap.low > 0.0)) | (slope.high < 0.0)
        return (v.low > ceiling) | falls

    return holds_on(((0.0, 2.0), (-1.0, 1.0), (0.0, fastest)), shown, MOST, first=8)


def _scaled(shape: Shape, beta: Intervals, sides: Sides) -> tuple[Intervals, Intervals, tuple[Intervals, ...]]:
    """V/alpha^2, V'/alpha^3 and f1, f2, f3 on boxes of u, x and W."""
    u, x, w = sides
    q0, l2, w2 = 1.0 - u, (u * (2.0 - u)).clipped(0.0, 1.0), w.square()
    y = l2.sqrt() * x
    y2, along, g = y.square(), w * y, shape.g + shape.m * u
    v = 0.5 * w2 + (shape.p + shape.c2 * u) * u + g * along
    k = 2.0 * (1.0 - 2.0 * beta) * u + 0.5 * (1.0 - 8.0 * beta) * along - beta * q0 * w2
    f1 = k * ((1.0 + y2) / (1.0 + l2)).clipped(0.5, 1.0) - 2.0 + 0.5 * g * q0 + 0.5 * shape.m * y2
    f2 = (0.5 * shape.p - 2.0) + shape.c2 * u + g * (k - 2.0)
    f3 = -2.0 * g
    return v, w2 * f1 + along * f2 + l2 * f3, (f1, f2, f3)


@lru_cache(maxsize=256)
def _largest(a: Any, beta: Any, cover: str) -> tuple[Shape, float] | None:
    """The shape with the largest set, and the largest level (1/s2) that is shown of it."""
    shapes = SHAPES if cover == "as_published" else (ENERGY,)
    # At q0 = 0, where the feedback of the shorter way switches, V is at least half of that on the other quaternion.
    ceiling = 0.5 if cover == "shortest" else 1.0
    guesses = [(shape, min(_guess(shape, beta), ceiling * shape.other_equilibrium)) for shape in shapes]
    for shape, guess in sorted(guesses, key=lambda found: -found[0].volume(found[1]))[:TRIED]:
        for less in LESS:
            level = below(exact(guess * (1.0 - less)) * a * a)
            if level > 0.0 and holds(shape, beta, exact(level) / (a * a)):
                return shape, level
    return None


def _guess(shape: Shape, beta: Any, count: int = 60) -> float:
    """The least V/alpha^2 at which points of a grid have V' >= 0, at most that of the other quaternion's equilibrium."""
    least = shape.other_equilibrium
    mixed = max(abs(shape.g), abs(shape.g + 2.0 * shape.m))
    grids = (2.0, count), (2.0, count // 2), (mixed + math.sqrt(mixed * mixed + 2.0 * least), count)
    sides = np.meshgrid(*(np.linspace(0.0, size, n + 1)[1:] for size, n in grids))
    points = tuple(Intervals(side.ravel()) for side in (sides[0], sides[1] - 1.0, sides[2]))
    v, slope, form = _scaled(shape, enclosed(beta), points)
    rising = (form[0] if shape == ENERGY else slope).high >= 0.0
    return min(least, float(v.low[rising].min(initial=np.inf)))


def _turn(shape: Shape, bound: Any) -> float:
    """A turn (rad) up to which all states at rest are in {V <= bound alpha^2}, bound below the other equilibrium's."""
    p, c2 = exact(shape.p), exact(shape.c2)
    size = number(bound)
    u = 2.0 * size / (shape.p + math.sqrt(shape.p**2 + 4.0 * shape.c2 * size))
    turn = 2.0 * math.acos(1.0 - min(u, 2.0))
    while True:
        most = 1 - (arb(turn) / 2).cos()
        if p * most + c2 * most * most <= arb(bound):
            return turn
        turn *= 1.0 - 1e-12


def _same_motion(motion: Motion, a: Any, b: Any) -> bool:
    """Whether the loop's own accelerations are those of the closed form and J^-1 times a torque nobody models."""
    q, w, q0 = direction("q"), direction("w"), Polynomial.variable("q0")
    z: Any = Polynomial.variable("z")

    def straight(v: Any) -> Any:
        return scale(z, add(subtract(v, cross(q, v)), scale(dot(q, v), q)))

    k = 2 * a * (1 - 2 * a * b) * (q0 - 1) + (1 - 8 * a * b) / 2 * dot(q, w) + b * q0 * dot(w, w)
    wanted = add(subtract(scale(2 * a, w), scale(2 * a * a, straight(q))), scale(k, straight(w)))
    wanted = add(wanted, apply(motion.plant.inverse_inertia, direction("m")))
    return all(
        _vanishes(piece.value - expected)
        for component, expected in zip(motion.acceleration, wanted, strict=True)
        for piece in pieces(component)
    )


def _vanishes(value: Polynomial) -> bool:
    """Whether a polynomial is zero on unit quaternions where z (1 + |q|^2) = 1."""
    q0, q1, q2 = (Polynomial.variable(f"q{i}") for i in range(3))
    others = 1 - q0 * q0 - q1 * q1 - q2 * q2
    divisor: Any = 2 - q0 * q0
    most = max((m.count("z") for m in value.terms), default=0)
    total: Any = Polynomial.constant(0)
    for monomial, c in value.terms.items():
        third = monomial.count("q3")
        term: Any = Polynomial({(*(x for x in monomial if x not in ("z", "q3")), *("q3",) * (third % 2)): c})
        for factor, times in ((divisor, most - monomial.count("z")), (others, third // 2)):
            for _ in range(times):
                term = term * factor
        total = total + term
    return not total.terms
