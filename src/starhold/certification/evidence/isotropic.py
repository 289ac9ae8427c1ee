"""Finds the claim about a loop that knows no axis: a V with a mixed term, the largest level, and evidence for the kernel."""

from __future__ import annotations

from fractions import Fraction
from math import acos, sqrt
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.scalar import Scalar
from starhold.certification.evidence.attitude import ASKED, Loop, sign_words
from starhold.certification.evidence.finding import obligations
from starhold.certification.evidence.reduced import Reduced
from starhold.certification.mixed import SHAPES, SIGNED, Shape
from starhold.kernel.loops import HYSTERESIS, SHORTEST
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly
from starhold.kernel.rules import Sum

ISOTROPIC = "converges without a preferred axis"
LESS = (1e-3, 3e-3, 1e-2, 2e-2, 3e-2, 0.1, 0.2, 0.3)
"""How far below the level that points of a grid suggest a proof is tried."""
TRIED = 3
"""Shapes that are tried where points of a grid miss states at which V rises."""


class Reach(NamedTuple):
    """A V that was recorded, what the kernel asks of its fall for one level, and about the largest level (1/s2)."""

    shape: Shape
    V: str
    asked: Sum
    level: float

    def at(self, level: Fraction) -> Sum:
        """What the kernel asks for a level; it was asked for the level 1."""
        inside, *others = self.asked.known
        return Sum(self.asked.p, [inside - 1 + level, *others], (), self.asked.strict)


def find_isotropic(loop: Loop) -> None:
    """Find the claim with the largest set, for a law that tells a single root."""
    flown = loop.loop
    root = flown.law.module.single_root(flown.gains)
    if root is None or not max(root) < 0.0:
        loop.failed[ISOTROPIC] = "only for phi_0 = phi_1 = a E with a < 0, and b < 0"
        return
    try:
        found = [reach(loop, shape, root[0]) for shape in (SIGNED if sign_words(flown) else SHAPES)]
    except RefusedError as reason:
        loop.failed[ISOTROPIC] = str(reason)
        return
    found.sort(key=lambda one: -one.shape.volume(one.level / root[0] ** 2))
    for one in found[:TRIED]:
        for less in LESS:
            level = Fraction(one.level * (1.0 - less))
            scales = {"u": 1.0, "t": 1.0, "v": sqrt(2.0 * float(level))}
            if Reduced(one.at(level), scales).floats() is None:
                continue
            claim = loop.claim(
                ISOTROPIC, words(loop), one.V, level=level, **contents(loop, one.shape, root[0], float(level))
            )
            if loop.try_to_show(claim, loop.scales(one.V, float(level)) | scales):
                return


def words(loop: Loop) -> list[str]:
    """Name what the loop is taken with."""
    return [*loop.words, *sign_words(loop.loop)]


def reach(loop: Loop, shape: Shape, a: float) -> Reach:
    """Record V, and find about the largest level below which V falls, by points of a grid."""

    def height(measurement: Any) -> Scalar:
        return shape.value(a, measurement.attitude, measurement.rate)

    V, hysteresis = loop.add(height, measurement=ASKED), loop.loop.hysteresis_width
    signed: dict[str, Any] = {"hysteresis": hysteresis} if HYSTERESIS in words(loop) else {}
    asked = cast(Sum, obligations(loop.claim(ISOTROPIC, words(loop), V, level=1, **signed), loop.by_digest)[0]["V falls"])
    top = shape.other_equilibrium
    if SHORTEST in words(loop):
        # Where q0 = 0.
        top = shape.p + shape.c2 - (shape.g + shape.m) ** 2 / 2.0
    fastest = abs(a) * (max(abs(shape.g), abs(shape.g + 2.0 * shape.m)) + sqrt(2.0 * top + shape.g**2))
    u, x, v = np.meshgrid(np.linspace(0.0, 2.0, 61)[1:], np.linspace(-1.0, 1.0, 31), np.linspace(0.0, fastest, 61)[1:])
    at = {"u": u, "v": v, "t": x * np.sqrt(u * (2.0 - u))}
    heights, falls = 1.0 - values(asked.known[0], at), values(asked.p, at)
    return Reach(shape, V, asked, min(a * a * top * (1.0 - 1e-6), float(heights[falls <= 0.0].min(initial=np.inf))))


def values(p: Poly, at: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a polynomial's values in floats."""
    parts = [float(c) * np.prod([at[name] for name in m], axis=0) for m, c in p.terms.items()]
    return np.sum(np.broadcast_arrays(*parts), axis=0)


def contents(loop: Loop, shape: Shape, a: float, level: float) -> dict[str, Any]:
    """Return a turn from rest and a rate on target that are in the set, and the width of the hysteresis."""
    bound, less = level / (a * a), 1.0 - 1e-7
    u = 2.0 * bound / (shape.p + sqrt(shape.p**2 + 4.0 * shape.c2 * bound))
    told: dict[str, Any] = {"angle": 2.0 * acos(1.0 - min(u, 1.98)) * less, "rate": sqrt(2.0 * level) * less}
    return told | ({"hysteresis": loop.loop.hysteresis_width} if HYSTERESIS in words(loop) else {})
