"""A set that motions under the law `modal` do not leave and in which they come to rest on target.

In units of the root, with alpha = -a, y = |w|2/alpha2, s = w.q/alpha, u = 1 - q0, l2 = |q|2 = u (2 - u), s2 <= y l2:

    V/alpha2 = y/2 + p u + c2 u2 + G s,    G = g + m u,

and (1 + l2) V'/alpha3 is a polynomial in u, y and s as well, told by `fall`. Both vanish at the target, around which no box
is small enough to see a sign. So V' is looked at over l2 where |w| is small beside alpha l, and over y where it is large:
there the target is no longer a point but a side of the box, and the quotients have a sign on it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flint import arb, fmpq

from starhold.algebra.polynomial import Monomial, Polynomial, constants
from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import add, apply, cross, dot, scale, subtract
from starhold.checker.bernstein import negative_where, positive_on
from starhold.checker.exact import (
    ONE,
    ZERO,
    Dual,
    Obligation,
    demand,
    down,
    dual,
    inverse,
    rational,
    root_above,
    up,
)
from starhold.checker.loop import ATTITUDE, QUOTIENT, ExactLoop, W
from starhold.checker.region import BALLS, EXACT, LASALLE, SIGN, Numbers
from starhold.checker.subject import LoopSubject, named, variables

RATIOS = (8, 16, 32)
"""Up to which multiple of alpha l a rate |w| is taken for small; the first that suffices."""


class Shares(NamedTuple):
    """y, s2, s and l2 over something that V' is divided by."""

    y: Any
    square: Any
    s: Any
    l2: Any


class ModalRegion:
    """{V <= level}, of a loop where phi_0 = phi_1 = a E, a < 0 and b < 0."""

    def __init__(self, subject: LoopSubject, numbers: Numbers, witness: Numbers) -> None:
        demand(subject.law.name == "modal", "such a claim is for the law modal")
        self.subject, self.loop, self.numbers = subject, ExactLoop(subject, quotient=True), numbers
        gains = subject.gains
        # A matrix with anything beside its diagonal is made of rows.
        roots: list[Any] = [p.value if isinstance(p, Polynomial) else None for p in (*gains.phi_0, *gains.phi_1)]
        same = roots[0] is not None and all(root == roots[0] for root in roots)
        demand(same, "phi_0 and phi_1 are not one number on every axis")
        self.a: Any = roots[0]
        self.b: Any = gains.b.value
        demand(self.a < 0, "phi_0 and phi_1 are not negative")
        demand(self.b < 0, "b is not negative")
        self.alpha, self.beta = -self.a, self.a * self.b
        self.level = rational(numbers["level"])
        demand(self.level > 0, "the level is not positive")
        self.c = self.level / self.alpha**2
        self.p, self.c2, self.g, self.m = (rational(witness[name]) for name in ("p", "c2", "g", "m"))
        # V' = alpha3 y f1 then, and the rest is LaSalle's.
        self.plain = self.g == 0 and self.m == 0

    def proofs(self) -> list[Obligation]:
        """The obligations of such a claim."""
        found: list[Obligation] = [("form", EXACT, self.form), ("descent", BALLS, self.descent)]
        if self.plain:
            found.append(("only equilibrium", LASALLE, self.only_equilibrium))
        if self.subject.sign_policy == "hysteresis":
            found.append(("jumps lower V", SIGN, self.jumps))
        else:
            found.append(("single equilibrium in the set", SIGN, self.single))
        return [*found, ("numbers", "", self.contents)]

    # --- V and V' -----------------------------------------------------------------------------------------------------

    def potential(self, u: Any) -> Any:
        """V/alpha2 at rest."""
        return self.p * u + self.c2 * u * u

    def height(self, u: Any, y: Any, s: Any) -> Any:
        """V/alpha2."""
        return y / 2 + self.potential(u) + (self.g + self.m * u) * s

    def fall(self, u: Any, y: Any, s: Any, over: Shares) -> Any:
        """(1 + l2) V'/alpha3 over what `over` is told over."""
        q0, whole, G = 1 - u, 1 + u * (2 - u), self.g + self.m * u
        K = 2 * (1 - 2 * self.beta) * u + (1 - 8 * self.beta) / 2 * s - self.beta * q0 * y
        mixed = self.p / 2 - 2 + self.c2 * u + G * (K - 2)
        bent = over.y * (G * q0 / 2 - 2) + over.square * (self.m / 2) + over.s * mixed - 2 * G * over.l2
        return K * (over.y + over.square) + whole * bent

    def form(self) -> str:
        """The rate's derivative is the one of an equation without the inertia, and V' along it is what is said above."""
        loop = self.loop
        demand(len(loop.pieces) == 1, "the law has several pieces")
        q: Any = vector_part(loop.measurement.attitude)
        q0, z = variables((ATTITUDE[0], QUOTIENT))
        # D^-1 w with D v = v + q x v; D^-1 q is q.
        straight: Any = scale(z, add(subtract(W, cross(q, W)), scale(dot(q, W), q)))
        k = (q0 - 1) * (2 * self.a * (1 - 2 * self.beta)) + dot(q, W) * ((1 - 8 * self.beta) / 2) + q0 * dot(W, W) * self.b
        own: Any = add(scale(2 * self.a, subtract(W, scale(self.a, q))), scale(k, straight))
        J_inverse: Any = constants(tuple(map(tuple, inverse(self.subject.inertia))))
        wanted: Any = add(own, apply(J_inverse, variables(named("m"))))
        for found, part in zip(loop.accelerations(loop.pieces[0][1]), wanted, strict=True):
            demand(not _on_unit_quaternions(found - part).terms, "the motion is not that of such a loop")
        attitude = loop.moving.attitude
        rate: Any = tuple(Dual(w, swing) for w, swing in zip(W, own, strict=True))
        scaled, vector = scale(dual(1 / self.alpha), rate), vector_part(attitude)  # pyright: ignore
        u: Any = 1 - dual(attitude[0])
        V: Any = self.height(u, dot(scaled, scaled), dot(scaled, vector))
        u, y, s = u.value, dot(W, W) * (1 / self.alpha**2), dot(q, W) * (1 / self.alpha)
        said = self.fall(u, y, s, Shares(y, s * s, s, u * (2 - u)))
        demand(not _on_unit_quaternions(V.slope - said * z * self.alpha).terms, "V' is not what it is taken for")
        return "the same polynomials on unit quaternions, and so is V'"

    # --- what is shown ------------------------------------------------------------------------------------------------

    def descent(self) -> str:
        """V' is negative on the level set, but at rest."""
        if self.plain:
            demand(self.p == 4 and self.c2 == 0, "where g = m = 0, p = 4 and c2 = 0 are wanted")
        demand(any(self._falls(fmpq(ratio)) for ratio in RATIOS), "V' may not be negative on the level set")
        return "by Bernstein's coefficients, in boxes of which the target is a side"

    def _falls(self, ratio: Any) -> bool:
        return self._beyond(ratio) and self._slow(ratio) and self._fast(ratio)

    def _beyond(self, ratio: Any) -> bool:
        """Whether |w| > ratio alpha l is outside the level set where u >= 1; and with that u = 2.

        From |G| on V/alpha2 >= r2 l2/2 - |G| r l2 + potential grows with r = |w|/(alpha l).
        """
        u = Polynomial.variable("u")
        strength = max(abs(self.g + self.m), abs(self.g + 2 * self.m))
        rest = self.potential(u) - self.c
        kinetic = [u * (2 - u) * (ratio * ratio / 2 - side * ratio * (self.g + self.m * u)) for side in (1, -1)]
        return ratio >= strength and all(positive_on(part + rest, "u", ONE, 2 * ONE) for part in kinetic)

    def _slow(self, ratio: Any) -> bool:
        """Whether V' < 0 where |w| = r alpha l, r <= ratio; x is the cosine of the angle between w and q."""
        u, r, x = variables(("u", "r", "x"))
        l2 = u * (2 - u)
        y, s = r * r * l2, r * x * l2
        # Plain, V' has y as a factor, and is negative but where this is zero.
        over = Shares(ONE, l2 * x * x, ZERO, ZERO) if self.plain else Shares(r * r, s * x * r, r * x, ONE)
        box = {"u": (ZERO, 2 * ONE), "r": (ZERO, ratio), "x": (-ONE, ONE)}
        return negative_where(self.fall(u, y, s, over), self.c - self.height(u, y, s), box)

    def _fast(self, ratio: Any) -> bool:
        """Whether V' < 0 where |w| >= ratio alpha l and u <= 1.

        u = 2 v2 with v = n |w|/alpha makes l = 2 v sqrt(1 - v2), where the root is at least sqrt(1/2), so that n is at most
        sqrt(1/2)/ratio. The root is taken into x = sqrt(1 - v2) times the cosine, for which -1 to 1 is more than enough.
        """
        y, n, x = variables(("y", "n", "x"))
        v2 = n * n * y
        u, s = 2 * v2, 2 * n * x * y
        l2_share = 4 * n * n * (1 - v2)
        over = Shares(ONE, 4 * v2 * x * x, ZERO, ZERO) if self.plain else Shares(ONE, 4 * v2 * x * x, 2 * n * x, l2_share)
        # y/2 - |G| sqrt(y) + potential <= c, with l <= 1.
        strength = max(abs(self.g), abs(self.g + self.m))
        room = 2 * (self.c - min(ZERO, self.p, self.p + self.c2)) + strength**2
        box = {"y": (ZERO, (strength + root_above(room)) ** 2), "n": (ZERO, fmpq(5, 7) / ratio), "x": (-ONE, ONE)}
        return negative_where(self.fall(u, y, s, over), self.c - self.height(u, y, s), box)

    def only_equilibrium(self) -> str:
        """At w = 0 the rate's derivative is -2 a2 q, as `form` shows: zero at q = 0 only, of which q0 = -1 is outside."""
        self.form()
        demand(self.c < 8, "the other equilibrium is in the level set")
        return "at rest the torque is a multiple of q, and the level is below that of the other equilibrium"

    def single(self) -> str:
        """The other equilibrium and, for the shorter way, half turns, where the feedback switches, are outside the set."""
        demand(self.c < self.potential(2 * ONE), "the level set reaches the other equilibrium")
        if self.subject.sign_policy == "shortest":
            demand(self.plain and self.c < 4, "the level set reaches half turns, or V says nothing of them")
        return "the level is below that of the other equilibrium and of a switch"

    def jumps(self) -> str:
        """A jump turns q0 <= -width into its opposite, and leaves the rate."""
        demand(self.plain, "a product of rate and attitude may grow at a jump")
        demand(0 < self.subject.width < 1, "the width of the hysteresis is not between 0 and 1")
        return "a jump lowers V by 8 a2 times the width at least"

    def contents(self) -> str:
        """Every state at rest turned up to the turn, and every rate up to the rate on target, is in {V <= level}."""
        turn, rate = rational(self.numbers["slew_angle"]), rational(self.numbers["rate"])
        demand(0 <= turn <= down(2 * arb.pi()), "the turn is not between 0 and a full one")
        most = up(2 * (arb(turn) / 4).sin() ** 2)
        ends = [most]
        if self.c2 < 0 and -self.p / (2 * self.c2) < most:
            ends.append(-self.p / (2 * self.c2))
        demand(all(self.potential(u) <= self.c for u in ends), "the turn is not in it")
        demand(rate >= 0 and rate**2 <= 2 * self.level, "the rate is not in it")
        return "turn and rate are in {V <= level}"


def _on_unit_quaternions(polynomial: Polynomial) -> Polynomial:
    """The polynomial, times a power of 1 + |q|2, where z (1 + |q|2) = 1 and q02 = 1 - |q|2: without terms if it is zero
    there."""
    q: Any = variables(named("q"))
    square: Any = dot(q, q)
    depth = max((m.count(QUOTIENT) for m in polynomial.terms), default=0)
    found = Polynomial({})
    for power in range(depth + 1):
        part = polynomial.only(lambda m, k=power: m.count(QUOTIENT) == k)
        rest = Polynomial({tuple(name for name in m if name != QUOTIENT): c for m, c in part.terms.items()})
        found = found + _power(1 + square, depth - power) * rest
    halved: dict[int, dict[Monomial, Any]] = {}
    for m, c in found.terms.items():
        count = m.count(ATTITUDE[0])
        left = [name for name in m if name != ATTITUDE[0]] + [ATTITUDE[0]] * (count % 2)
        halved.setdefault(count // 2, {})[tuple(sorted(left))] = c
    return sum((_power(1 - square, k) * Polynomial(terms) for k, terms in halved.items()), Polynomial({}))


def _power(polynomial: Polynomial, count: int) -> Polynomial:
    found = Polynomial.constant(1)
    for _ in range(count):
        found = found * polynomial
    return found
