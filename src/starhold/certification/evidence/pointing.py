"""Finds the claim about the loop that flies: V, the levels that motions come down by, and the ellipsoids where they end."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from importlib import import_module
from math import inf, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.attitude import Loop, sign_words
from starhold.certification.evidence.claims import floats
from starhold.certification.evidence.finding import read
from starhold.kernel.held import RATE, TURN, Held, Region
from starhold.kernel.loops import AttitudeLoop, slopes
from starhold.kernel.numbers import Account, RefusedError, Rows, norm
from starhold.kernel.theorems.pointing import image, periods
from starhold.parts.craft import tensor

linalg: Any = import_module("scipy.linalg")
optimize: Any = import_module("scipy.optimize")
Array = NDArray[np.float64]

POINTS = "points"
LEANS = (0.1, 0.15, 0.2, 0.28)
"""How large epsilon of V = w.Jw/2 + 2k (1 - q0) + epsilon q.Jw is tried to be, in sqrt(k / the largest moment)."""
MORE, FLOOR, LARGER, DEEPEST, LEVELS, ELLIPSOIDS = 1.0 + 1e-9, 1.03, 1.01, 8.0, 20, 6
"""What is given away where numbers are rounded; by how much the last level is above its limit, and ellipsoids are larger
than the least, for motions come into them after a finite time; by how much a level may be below the one before; how many
levels and ellipsoids there are at most."""


@dataclass
class Chain:
    """Levels from a set down to where pushes outweigh the damping, and ellipsoids from there on."""

    held: Held
    V: str
    level: float
    levels: list[dict[str, str]] = field(default_factory=list[dict[str, str]])
    ellipsoids: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    samples: int = 0
    aimed: float | None = None

    def aim(self) -> float:
        """Return the level that pushes allow where all motions are nearly linear."""
        if self.aimed is None:
            found = self.lower(Fraction(self.level) / 2**20)
            self.aimed = inf if found is None else float(found[2])
        return self.aimed

    def descend(self) -> float:
        """Find the levels, and return the last."""
        c = Fraction(self.level)
        while len(self.levels) < LEVELS and (found := self.lower(c)) is not None:
            tau, beta, floor = found
            end = Fraction(max(float(floor) * FLOOR, float(c) / DEEPEST))
            if end > c * Fraction(9, 10):
                break
            self.levels.append({"end": str(end), "tau": str(tau), "beta": str(beta)})
            self.samples += periods(self.held.h * beta, floor, c, end)
            c = end
        return float(c)

    def lower(self, c: Fraction) -> tuple[Fraction, Fraction, Fraction] | None:
        """Return tau and beta for the lowest level that is shown to be reached from another, and that level."""
        held = self.held
        try:
            exact, above, rest = held.fall(held.region(c))
        except RefusedError:
            return None
        Q, H, felt, push = floats(exact), floats(above), floats(held.felt), float(held.push)
        if float(np.linalg.eigvalsh(Q)[0]) <= 0.0:
            return None
        R = felt.T @ felt
        largest = 1.0 / float(linalg.eigh(R, Q, eigvals_only=True)[-1])

        def floor(share: float) -> tuple[float, float, float]:
            tau = largest * share
            beta = float(linalg.eigh(Q - tau * R, H, eigvals_only=True)[0]) * (1.0 - 1e-6)
            beta = min(beta, (1.0 - 1e-6) / float(held.h))
            return ((push * push / (4.0 * tau) + float(rest)) / beta if beta > 0.0 else inf), tau, beta

        _, tau, beta = min(floor(share) for share in np.linspace(0.02, 0.98, 33))
        if beta <= 0.0:
            return None
        t, b = Fraction(tau), Fraction(beta)
        return t, b, (held.push * held.push / (4 * t) + rest) / b

    def tighten(self, region: Region) -> tuple[float, float]:
        """Find the ellipsoids, and return the angle (rad) and the rate (rad/s) where motions end."""
        angle, fastest = self.ends(region)
        for _ in range(ELLIPSOIDS):
            A, pushes = self.held.linear(region)
            found = smallest(floats(A), [floats(B) * float(b) for B, b in pushes])
            if found is None:
                break
            shape, shares = found
            X, a = [[Fraction(x) for x in row] for row in shape.tolist()], [Fraction(x) for x in shares]
            rate = highest_ratio(image(X, a, A, pushes), X)
            reach = highest_ratio(region.X, X)
            inner = region.within(X)
            end = self.ends(inner)
            if rate >= 1.0 or end[0] > angle * 0.998:
                break
            self.ellipsoids.append(
                {
                    "shape": [[str(x) for x in row] for row in X],
                    "shares": [str(x) for x in a],
                    "rate": str(Fraction(rate)),
                    "reach": str(Fraction(reach)),
                }
            )
            room = 1 - sum(a)
            fall = 1 - Fraction(rate) * room
            self.samples += periods(fall, Fraction(rate) * (1 - room) / fall, Fraction(reach), Fraction(1))
            region, (angle, fastest) = inner, end
        return angle, fastest

    def ends(self, region: Region) -> tuple[float, float]:
        """Return the angle (rad) and the rate (rad/s) that motions of a region do not exceed, between samples either."""
        X, drift = floats(region.X), float(norm(self.held.tube(region).drift))
        fastest = (sqrt(float(np.linalg.eigvalsh(X[RATE, RATE])[-1])) + drift / 2.0) * MORE
        sine = (sqrt(float(np.linalg.eigvalsh(X[TURN, TURN])[-1])) + float(self.held.h) / 4.0 * fastest) * MORE
        half = sine
        for _ in range(60):
            half = sine + half**3 / 6.0
        return 2.0 * half * MORE if half < 1.0 else inf, fastest


def find_pointing(
    loop: Loop, outside: float, error: float, angle: float, rate: float = 0.0, limit: dict[str, float] | None = None
) -> bool:
    """Find the claim of how near to its target the loop with a held torque comes, and add it. outside: the largest torque
    from outside (N m); error: of the command (N m); the set holds turns of up to `angle` (rad) at up to `rate` (rad/s);
    limit: what the law is to ask for at most, `limit` about each axis or `limit.norm`, without its errors."""
    if loop.loop.remembers:
        loop.failed[POINTS] = "the law has a memory"
        return False
    told: dict[str, Any] = {"period": loop.loop.period, "outside": outside, "error": error} | (limit or {})
    told |= {"start.angle": angle, "start.rate": rate} if rate > 0.0 else {"angle": angle}
    words, moments = sign_words(loop.loop), np.linalg.eigvalsh(tensor(loop.loop.craft.inertia))
    J, stiffness, begun = float(moments[-1]), feedback(loop, words), list[Chain]()
    for lean in LEANS:
        epsilon = float(f"{lean * sqrt(stiffness / J):.4g}")
        V = loop.crossed(stiffness, epsilon)
        level = 4.0 * stiffness * sin(angle / 4.0) ** 2 + J * rate * (rate / 2.0 + epsilon * sin(min(angle, pi) / 2.0))
        told["level"] = level * (1.0 + 1e-6)
        Account.left = 10**12
        try:
            held = Held(AttitudeLoop(read(loop.claim(POINTS, words, V, **told), loop.by_digest)))
        except RefusedError as reason:
            loop.failed[POINTS] = str(reason)
            return False
        begun.append(Chain(held, V, told["level"]))
    # The best in the small is tried first, and taken if it comes down from the whole set.
    for chain in sorted(begun, key=Chain.aim):
        if chain.descend() < 4.0 * chain.aim():
            break
    else:
        chain = min(begun, key=lambda one: float(Fraction(one.levels[-1]["end"])) if one.levels else inf)
    if not chain.levels:
        loop.failed[POINTS] = "V does not fall on the set from which motions start"
        return False
    held, start = chain.held, Fraction(chain.level)
    angle, fastest = chain.tighten(held.region(Fraction(chain.levels[-1]["end"])))
    told["level"] = chain.level
    told["highest"] = float(start + held.h / 2 * held.swing(held.region(start))) * MORE
    told |= {"end.angle": angle, "end.rate": fastest, "settling": float(held.h * chain.samples) * MORE}
    claim = loop.claim(POINTS, words, chain.V, **told)
    claim["evidence"] = {"levels": chain.levels, "ellipsoids": chain.ellipsoids}
    scales = {f"q{k}": 1.0 for k in (1, 2, 3)} | {f"w{k}": sqrt(stiffness / J) for k in (1, 2, 3)}
    return loop.try_to_show(claim, scales)


def feedback(loop: Loop, words: list[str]) -> float:
    """Return the stiffness of the law near rest, a third of its trace."""
    own = AttitudeLoop(read(loop.claim(POINTS, words, None), loop.by_digest))
    return -float(sum(row[k] for k, row in enumerate(slopes(own.u, "q", own.on_target | own.still)))) / 3.0


def smallest(A: Array, pushes: list[Array]) -> tuple[Array, list[float]] | None:
    """Return the matrix of the ellipsoid that pushes of size 1 do not leave and that turns least, and its shares."""
    radius = float(np.abs(np.linalg.eigvals(A)).max())
    if radius >= 1.0:
        return None

    def shape(x: Array) -> tuple[float, Array, Array]:
        shares = np.exp(x) / (1.0 + np.exp(x).sum()) * (1.0 - radius**2)
        fed = sum((B @ B.T / a for B, a in zip(pushes, shares, strict=True)), np.zeros_like(A))
        fed += 1e-14 * np.diag(np.diag(fed))
        X = linalg.solve_discrete_lyapunov(A / sqrt(1.0 - shares.sum()), fed)
        return float(np.linalg.eigvalsh(X[TURN, TURN])[-1]), X, shares

    weight = np.log([np.linalg.norm(B, 2) / np.linalg.norm(pushes[0], 2) + 1e-12 for B in pushes])

    def turn(x: Array) -> float:
        return float(np.log(shape(x)[0]))

    found = optimize.minimize(turn, weight, method="Nelder-Mead", options={"maxfev": 400})
    _, X, shares = shape(found.x)
    return (X + X.T) / 2.0 * LARGER, [float(a) for a in shares]


def highest_ratio(a: Rows, b: Rows) -> float:
    """Return a number that the eigenvalues of b^-1 a stay below."""
    return float(linalg.eigh(floats(a), floats(b), eigvals_only=True)[-1]) * MORE
