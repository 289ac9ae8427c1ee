"""Claims about a craft near a libration point for the kernel: its programs as they fly, numbers, and evidence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import inf, isqrt, nextafter, sqrt
from typing import Any

from starhold.algebra.operations import UnreadableError
from starhold.certification.evidence.attitude import highest
from starhold.certification.evidence.finding import (
    NotFoundError,
    by_digests,
    complete,
    concluded,
    obligations,
    read,
    unproved,
)
from starhold.kernel.numbers import RefusedError
from starhold.kernel.points import PointLoop
from starhold.kernel.polynomials import multiple
from starhold.kernel.programs import digest
from starhold.kernel.rules import Exceeds, Squares
from starhold.kernel.theorems.station import Circle, weighed
from starhold.laws.point_programs import point_programs, point_subject
from starhold.loop.closed_loop import ClosedLoop

CIRCLE, MORE, HELD = "ends on the circle", "needs more control on the circle", "holds another circle"
REST, ASTRAY, LIMITED = "comes to rest", "does not return", "returns with limited control"
ROLES = {
    CIRCLE: ("field", "law", "errors", "lyapunov"),
    MORE: ("field", "law", "errors"),
    HELD: ("field", "law", "errors"),
    REST: ("field", "law", "rest"),
    ASTRAY: ("field", "law", "errors"),
    LIMITED: ("field", "law", "rest", "limited"),
}
ALMOST = Fraction(1) - Fraction(1, 2**20)
"""The claimed share of the level of V at the equilibrium in the middle."""
GIVEN_AWAY = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Shares of a largest level that are given away, for at the largest the matrices are singular."""
SHARE, FAR = Fraction(0.999), Fraction(1000)
"""The part that is claimed of the bound beyond which nothing returns, and |x| up to which it is, as a multiple of it."""
BEYOND = Fraction(1, 10**15)
"""By this share the boundary that is claimed is beyond that bound."""
ROUNDING = Fraction(1, 10**12)
"""The share by which a control may exceed its limit and still count as meeting it."""


def full_problem(loop: ClosedLoop) -> bool:
    """Return whether the nonlinear field is flown."""
    return not loop.has("linear-gravity")


@dataclass
class Station:
    """A closed loop's programs and numbers, and the claims for which evidence was found."""

    loop: ClosedLoop
    claims: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

    @cached_property
    def programs(self) -> dict[str, dict[str, Any]]:
        """The programs by role."""
        loop = self.loop
        return point_programs(loop.law, loop.gains, loop.known, full_problem(loop), loop.limit)

    @cached_property
    def by_digest(self) -> dict[str, dict[str, Any]]:
        """The programs by digest."""
        return by_digests(self.programs.values())

    def claim(self, theorem: str, **numbers: Fraction | float) -> dict[str, Any]:
        """Return a claim without evidence."""
        roles = {role: digest(self.programs[role]) for role in ROLES[theorem] if role in self.programs}
        subject = point_subject(self.loop.gains, self.loop.craft, self.loop.known)
        return unproved(theorem, roles, subject, {name.replace("_", "."): x for name, x in numbers.items()})

    def show(self, claim: dict[str, Any], scales: Mapping[str, float] | None = None) -> None:
        """Add a claim with evidence; NotFoundError where there is none."""
        self.claims.append(complete(claim, self.by_digest, scales or {}))

    @cached_property
    def circle(self) -> tuple[PointLoop, Circle]:
        """The loop as the kernel has it, and the circle of its law. RefusedError where it declares none."""
        loop = PointLoop(read(self.claim(CIRCLE), self.by_digest))
        return loop, concluded(weighed(loop))

    def contents(self, level: float) -> dict[str, float]:
        """Return the numbers of a level: radii of circles in the set, errors of the velocity, distance from the bodies."""
        loop, circle = self.circle
        spread = Fraction(level) / circle.weights[0]
        low, inside = Fraction(root(spread, 0.0)), circle.square - Fraction(root(spread, inf))
        numbers = {
            "level": level,
            "inner": root(circle.square - low, inf) if inside > 0 else 0.0,
            "outer": root(circle.square + low, 0.0),
            "velocity": root(Fraction(level) / max(circle.weights[1:]), 0.0),
        }
        bodies = loop.ring.divisors or len(loop.ring.roots) > (circle.size != "")
        return numbers | ({"clear": root(inside / 2, 0.0)} if bodies and inside > 0 else {})

    def show_circle(self) -> None:
        """Find the claim that motions converge to the circle, from the largest level."""
        _, circle = self.circle
        level = nextafter(float(circle.weights[0] * circle.square**2 * ALMOST), 0.0)
        if level <= 0.0:
            raise NotFoundError("no float is between V and zero")
        self.show(self.claim(CIRCLE, **self.contents(level)))

    def show_held(self) -> None:
        """Find another circle that a relay without a layer holds: at half the possible distance, near the circle."""
        loop, circle = self.circle
        away = next((s for s in loop.sides if circle.inverse in {name for p in s.value for name in p.names}), None)
        if away is None:
            raise NotFoundError("the law is no relay")
        f1, f2, _ = circle.errors
        slope = loop.slopes_along(f2, loop.acceleration(away))
        drift = slope.at({circle.inverse: 0}).at({**circle.running, "x1": 0, "v1": 0})
        k, pull = -multiple(slope.slope(circle.inverse), f2)[0], abs(multiple(drift, f1 * loop.x[1])[0])
        radius = sqrt(circle.square)
        radius += min(0.1 * radius, float(k) / (4.0 * float(pull) * radius * radius))
        needs = float(pull * abs(Fraction(radius) ** 2 - circle.square) * Fraction(radius))
        self.show(self.claim(HELD, radius=radius, needs=nextafter(needs, inf), of=float(k)))

    def show_limit(self, kind: str, limit: float) -> None:
        """Find the largest level on which the control stays within its limit, or show that the circle demands more."""
        _, circle = self.circle
        name = f"limit.{kind}"
        peak, place = self.peak(kind)
        if peak > (Fraction(limit) * (1 + ROUNDING)) ** 2:
            control = root(peak, 0.0)
            return self.show(self.claim(MORE, **{name: limit, "control": control}, **place))
        wanted, _ = obligations(
            self.claim(CIRCLE, level=1.0, inner=1.0, outer=1.0, velocity=1.0, **{name: limit}), self.by_digest
        )
        limits = [o for name, o in wanted.items() if isinstance(o, Squares) and name.startswith(("norm", "control "))]
        cap = float(circle.weights[0] * circle.square**2 * ALMOST)
        level = cap
        for _ in range(2):
            levels = [highest(o, self.scales(level)) for o in limits]
            level = max(min(cap, *(x or 0.0 for x in levels)), 0.0)
            if level == 0.0:
                break
        for less in GIVEN_AWAY:
            if level > 0.0:
                try:
                    contained = self.contents(level * (1.0 - less))
                    return self.show(self.claim(CIRCLE, **contained, **{name: limit}), self.scales(level))
                except NotFoundError:
                    continue
        raise NotFoundError("no level is small enough")

    def peak(self, kind: str) -> tuple[Fraction, dict[str, Fraction]]:
        """Return the largest square of the control on the circle, and where: where it crosses Y or Z."""
        loop, circle = self.circle
        radius = Fraction(isqrt(circle.square.numerator), isqrt(circle.square.denominator))
        peaks: list[tuple[Fraction, dict[str, Fraction]]] = []
        for y, z in ((radius, Fraction(0)), (Fraction(0), radius)):
            at = {"x1": 0, "x2": y, "x3": z, "v1": 0, "v2": -circle.rate * z, "v3": circle.rate * y, circle.size: 0}
            side = next(s for s in loop.sides if circle.inverse not in {name for p in s.value for name in p.names})
            squares = [p.at(at).number ** 2 for p in side.value]
            peaks.append((max(squares) if kind == "axis" else sum(squares, Fraction(0)), {"y": y, "z": z}))
        return max(peaks, key=lambda one: one[0])

    def scales(self, level: float) -> dict[str, float]:
        """Return about how large variables become on {V <= level}."""
        _, circle = self.circle
        radius, (off, *errors) = sqrt(circle.square), (sqrt(level / float(w)) for w in circle.weights)
        sizes = {"x2": radius, "x3": radius, "f1": off, "f2": errors[0], "f3": errors[1]}
        return sizes | ({circle.inverse: 1.0 / max(errors)} if circle.inverse else {})

    def show_rest(self) -> None:
        """Show that every motion comes to rest."""
        self.show(self.claim(REST))

    def show_astray(self) -> None:
        """Show that some motions do not return along an axis."""
        self.show(self.claim(ASTRAY))

    def show_limited_axis(self, limit: float) -> None:
        """Find from where motions along X return with limited control, and from where not."""
        wanted, _ = obligations(
            self.claim(LIMITED, limit=limit, width=1.0, reach=1.0, boundary=1.0, root_low=1.0, root_high=1.0), self.by_digest
        )
        pull = wanted["the limit turns motions round"]
        assert isinstance(pull, Exceeds)
        p = Fraction(pull.small)
        if p <= 0:
            raise NotFoundError("the point does not repel along X")
        bound = Fraction(limit) / p
        steep = sqrt(p)
        self.show(
            self.claim(
                LIMITED,
                limit=limit,
                width=nextafter(float(bound * SHARE), 0.0),
                reach=float(bound * FAR),
                boundary=float(bound * (1 + BEYOND)),
                root_low=nextafter(steep, 0.0),
                root_high=nextafter(steep, inf),
            )
        )


def root(x: Fraction, towards: float) -> float:
    """Return a float near the square root of a number: below it, or above, as 0 or infinity say, and not it itself."""
    shift = max(0, 200 - x.numerator.bit_length() + x.denominator.bit_length()) // 2
    near = float(Fraction(isqrt((x.numerator << 2 * shift) // x.denominator), 1 << shift))
    while Fraction(near) ** 2 >= x if towards == 0.0 else Fraction(near) ** 2 <= x:
        near = nextafter(near, towards)
    return near


UNSHOWN = (NotFoundError, RefusedError, UnreadableError)
"""What is raised where no evidence is found."""
