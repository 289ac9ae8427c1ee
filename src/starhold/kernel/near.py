"""The linear motion of a loop near its target, with its torque held between samples, and what wheels' momentum adds."""

from __future__ import annotations

from fractions import Fraction
from functools import reduce
from itertools import product
from typing import NamedTuple

from .loops import AXES, NONE, RATES, AttitudeLoop, over_period, slopes
from .numbers import Rows, beside, demand, inverse, plus, scalar, times
from .polynomials import apply, dot, var
from .regions import STATE, with_momentum

CHANGE = "told.change", "told.change.per.rate"
"""How fast the external torque that the law knows changes, per second, and how much more for each rad that the body
turns."""
ZERO = Fraction(0)
HALF_ROOT = Fraction(7072, 10000)
"""At least the root of 1/2."""
AROUND = [
    *([c * HALF_ROOT for c in signs] for signs in product((-1, 1), repeat=3)),
    *([2 * c * (i == k) * HALF_ROOT for i in AXES] for k in AXES for c in (-1, 1)),
]
"""The corners of a rhombic dodecahedron, which holds the unit ball: |x| + |y| <= sqrt 2 for each two axes."""


class Near(NamedTuple):
    """A loop linearised near its target: the law's torque and the acceleration as matrices on (w, q); A, B and C =
    `commanded` with x+ = Ax + Bu + Cv at samples of x = (w, q), or of (w, q, torque) with a torque that lags, where u is
    held in addition to the law's torque and v is added to the command; `grown`: the effect of a torque that grows to uh; the
    acceleration in the mean of a period as matrices on x and on v; J^-1."""

    torque: Rows
    rates: Rows
    A: Rows
    B: Rows
    commanded: Rows
    grown: Rows
    mean: Rows
    eased: Rows
    inverse: Rows

    def spun(self, law: Rows, body: Rows) -> Rows:
        """Return what torques of the law and on the body, which are these matrices times the rates, add to A."""
        both = plus(times(self.commanded, law), times(self.B, body))
        return plus([row + [ZERO] * (len(self.A) - 3) for row in both], times(self.grown, times(body, self.mean)))

    def lagging(self, h: Fraction, kept: Fraction, mean: Fraction, moment: Fraction) -> Near:
        """Return the loop with a torque that lags, which is one more vector of the state. For each unit of its error at
        first, `kept` is left at the end of a period, `mean` in its mean, and `moment` in the mean weighted by the remaining
        time."""
        N, T, none = self.inverse, self.torque, [[ZERO] * 3 for _ in AXES]
        off = [[c * x for x in row] for c in (h * mean, h * h / 2 * moment) for row in N]
        commanded, acts = plus(self.B, off, -1), 1 - mean
        late = beside([[(1 - kept) * x for x in row] for row in T], scalar(kept))
        return self._replace(
            A=beside(plus(self.A, times(off, T), -1), off) + late,
            B=self.B + none,
            commanded=commanded + scalar(1 - kept),
            grown=self.grown + none,
            mean=beside([[acts * x for x in row] for row in self.rates], [[mean * x for x in row] for row in N]),
            eased=[[acts * x for x in row] for row in N],
        )


def near_target(loop: AttitudeLoop, h: Fraction) -> Near:
    """Return the linear loop with its torque held for h, without anything external."""
    at = loop.on_target | loop.still | {f"{letter}{k + 1}": 0 for letter in "erah" for k in AXES}
    torque, N = slopes(loop.u, STATE, at), inverse(loop.given)
    rates = times(N, torque)
    A = over_period([[-x for x in row] for row in rates], h)
    B, grown = ([[c * x for x in row] for c in both for row in N] for both in ((h, h * h / 4), (h * h / 2, h**3 / 12)))
    return Near(torque, rates, A, B, B, grown, rates, N, N)


def spinning(loop: AttitudeLoop, at: list[Fraction]) -> tuple[Rows, Rows]:
    """Return what wheels' momentum adds per unit of rate, as matrices: to the law's torque, and to the torque on the
    body."""
    names = {f"h{k + 1}": x for k, x in enumerate(at)}
    law, body = (slopes([with_momentum(p) for p in parts], RATES, names) for parts in (loop.u, loop.balance(NONE)))
    return law, body


def form_of(loop: AttitudeLoop) -> tuple[Fraction, Rows]:
    """Return s and G of V = s (1 - q0) + x.Gx, x = (w, q1, q2, q3); refuse another V."""
    V, x, at = loop.lyapunov, [var(name) for name in STATE], dict.fromkeys(STATE, 0)
    s = -V.terms.get(("q0",), Fraction(0))
    G = [[V.slope(i).slope(k).at(at).number / 2 for k in STATE] for i in STATE]
    demand(not (V - s * (1 - loop.q[0]) - dot(x, apply(G, x))).terms, "V is not s (1 - q0) and a form")
    return s, G


def between(near: Near, loop: AttitudeLoop, size: Fraction) -> list[Rows]:
    """Return matrices between which A lies for each momentum of the wheels up to a size."""
    ways = [near.spun(*spinning(loop, way)) for way in scalar(size)]
    return [reduce(lambda A, one: plus(A, *one), zip(ways, corner, strict=True), near.A) for corner in AROUND]
