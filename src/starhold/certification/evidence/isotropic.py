"""Finds the claim about an isotropic loop: a V with a cross term, the largest level, and evidence for the kernel."""

from bisect import bisect
from fractions import Fraction
from math import acos, sqrt
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import Scalar
from starhold.algebra.vector import dot
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import obligations
from starhold.certification.evidence.recorded import ASKED, sign_words
from starhold.certification.evidence.reduced import Reduced
from starhold.certification.evidence.squares import rounded
from starhold.certification.evidence.terms import valued
from starhold.kernel.loops import HYSTERESIS, SHORTEST
from starhold.kernel.numbers import RefusedError
from starhold.kernel.rules import Sum


class Shape(NamedTuple):
    """The numbers of V. Where p > 0, p + 2 c2 > 0 and p + 4 c2 > 0 the attitude's part increases with the rotation."""

    p: float
    c2: float
    g: float
    m: float

    @property
    def other_equilibrium(self) -> float:
        """V (1/s2) at rest on the other quaternion of the target."""
        return 2.0 * self.p + 4.0 * self.c2

    def value(self, attitude: Any, rate: Any) -> Any:
        """V (1/s2) of attitude and rate (rad/s), numbers or columns."""
        q, u = vector_part(attitude), 1.0 - attitude[0]
        return dot(rate, rate) * 0.5 + (self.p + self.c2 * u) * u + (self.g + self.m * u) * dot(q, rate)

    def room(self, bound: float, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """{V <= bound} at u is a ball of rates: its radius squared, below zero where it is empty."""
        return 2.0 * (bound - self.p * u - self.c2 * u * u) + (self.g + self.m * u) ** 2 * u * (2.0 - u)

    def volume(self, bound: float) -> float:
        """The volume of {V <= bound} among attitudes and rates, up to a factor."""
        u = np.linspace(0.0, 2.0, 201)
        return float(np.sum(np.maximum(self.room(bound, u), 0.0) ** 1.5 * np.sqrt(u * (2.0 - u))))


SHAPES = (
    Shape(6.62, -0.62, 2.56, 0.59),
    Shape(7.07, -0.58, 2.64, 0.62),
    Shape(9.69, -0.9, 3.09, 0.72),
    Shape(11.16, -0.65, 3.3, 0.75),
    Shape(19.24, -1.97, 3.99, -0.45),
    Shape(23.14, 0.0, 3.48, -0.44),
    Shape(22.28, -0.02, 2.74, -1.22),
    Shape(20.69, -0.03, 2.36, -1.18),
)
LIMITS = (0.01, 0.02, 0.045, 0.07, 0.12, 0.2, 0.4)
"""The shapes are near the largest sets for ab of up to these, and from 1 on, from a search among points of a grid."""
SIGNED = (Shape(4.0, 0.0, 0.02, 0.0), Shape(4.0, 0.0, 0.1, 0.0), Shape(5.0, 0.0, 0.7, -0.7))
"""The shapes for laws that choose the sign of the quaternion: a change of sign lowers V, because the cross term is small."""


def near(beta: float) -> tuple[Shape, ...]:
    """Return the shape for ab and its neighbours."""
    place = bisect(LIMITS, beta)
    return SHAPES[max(place - 1, 0) : place + 2]


ISOTROPIC = "converges without a preferred axis"
LESS = (3e-3, 1e-2, 2e-2, 3e-2, 0.1, 0.2, 0.3)
"""How far below the level that points of a grid suggest a proof is tried."""


class Reach(NamedTuple):
    """A recorded V, the obligation of the kernel about its decrease for the level 1, and about the largest level (1/s2)."""

    shape: Shape
    V: str
    obligation: Sum
    level: float

    def decreases(self, level: float) -> bool:
        """Whether floats have a sum for a level."""
        inside, *others = self.obligation.known
        obligation = Sum(self.obligation.p, [inside - 1 + Fraction(level), *others], (), self.obligation.strict)
        return Reduced(obligation, units(level)).floats() is not None


def find_isotropic(loop: Loop) -> None:
    """Find the claim with the largest set, for a law that declares a single root."""
    flown = loop.loop
    root = flown.law.module.single_root(flown.gains)
    if root is None or not max(root) < 0.0:
        loop.failed[ISOTROPIC] = "only for phi_0 = phi_1 = a E with a < 0, and b < 0"
        return
    a, b = root
    try:
        reaches = [reach(loop, in_seconds(shape, a)) for shape in (SIGNED if sign_words(flown) else near(a * b))]
    except RefusedError as reason:
        loop.failed[ISOTROPIC] = str(reason)
        return
    for one in sorted(reaches, key=lambda one: -one.shape.volume(one.level)):
        for level in (short(one.level * (1.0 - less)) for less in LESS):
            claim = loop.claim(ISOTROPIC, words(loop), one.V, level=level, **contents(loop, one.shape, level))
            if one.decreases(level) and loop.try_to_show(claim, loop.scales(one.V, level) | units(level)):
                return


def units(level: float) -> dict[str, float]:
    """Return the approximate largest values of u, t and v."""
    return {"u": 1.0, "t": 1.0, "v": sqrt(2.0 * level)}


def words(loop: Loop) -> list[str]:
    """Name the assumptions about the loop."""
    return [*loop.words, *sign_words(loop.loop)]


def short(x: float) -> float:
    """Return a number of few binary digits: exact expressions of long numbers become long."""
    return float(rounded(x, 4))


def in_seconds(shape: Shape, a: float) -> Shape:
    """Return about the shape for the root -1/s that corresponds to this one for the root a."""
    return Shape(short(a * a * shape.p), short(a * a * shape.c2), short(-a * shape.g), short(-a * shape.m))


def reach(loop: Loop, shape: Shape) -> Reach:
    """Record V, and find about the largest level (1/s2) below which V decreases, by points of a grid."""

    def height(measurement: Any) -> Scalar:
        return shape.value(measurement.attitude, measurement.rate)

    V, hysteresis = loop.add(height, measurement=ASKED), loop.loop.hysteresis_width
    loop.written_by[V] = {name: float(x) for name, x in shape._asdict().items()}
    signed: dict[str, Any] = {"hysteresis": hysteresis} if HYSTERESIS in words(loop) else {}
    obligation = cast(
        Sum, obligations(loop.claim(ISOTROPIC, words(loop), V, level=1, **signed), loop.by_digest)[0]["V decreases"]
    )
    top = shape.other_equilibrium
    if SHORTEST in words(loop):
        # Where q0 = 0.
        top = shape.p + shape.c2 - (shape.g + shape.m) ** 2 / 2.0
    fastest = max(abs(shape.g), abs(shape.g + 2.0 * shape.m)) + sqrt(2.0 * top + shape.g**2)
    u, x, v = np.meshgrid(np.linspace(0.0, 2.0, 61)[1:], np.linspace(-1.0, 1.0, 31), np.linspace(0.0, fastest, 61)[1:])
    at = {"u": u, "v": v, "t": x * np.sqrt(u * (2.0 - u))}
    heights, slopes = 1.0 - valued(obligation.known[0], at), valued(obligation.p, at)
    return Reach(shape, V, obligation, min(top * (1.0 - 1e-6), float(heights[slopes <= 0.0].min(initial=np.inf))))


def contents(loop: Loop, shape: Shape, level: float) -> dict[str, Any]:
    """Return a turn from rest and a rate on target that are in the set, and the width of the hysteresis."""
    less = 1.0 - 1e-7
    u = 2.0 * level / (shape.p + sqrt(shape.p**2 + 4.0 * shape.c2 * level))
    contained: dict[str, Any] = {"angle": 2.0 * acos(1.0 - min(u, 1.98)) * less, "rate": sqrt(2.0 * level) * less}
    return contained | ({"hysteresis": loop.loop.hysteresis_width} if HYSTERESIS in words(loop) else {})
