"""Loops with a lag and a law that is not linear in the attitude, flown over a period beside the bounds of it."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np

from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.claims import floats
from starhold.certification.evidence.finding import read
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.evidence.terms import valued
from starhold.certification.proofs import pointed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.kernel.follower import FIRST, REST
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Account
from starhold.kernel.polynomials import apply, cross, dot
from starhold.kernel.regions import TURN
from starhold.parts.catalogue import fit
from tests.kernel.flights import along, rates, stepped
from tests.making import built

PARTS, LANES = 60, 600
BALL, AXES = np.diag([2.0, 2.0, 2.0]), np.diag([1.0, 3.0, 3.5])


@cache
def plain():
    """A loop without actuators."""
    loop = Loop(make_subject(built("three-laws", "lyapunov")))
    return loop, Pushed(loop, Pushes(0.0))


@cache
def flying(part, *numbers):
    """A loop with an actuator, and its pointing claim."""
    loop = built("three-laws", "lyapunov").with_parts(fit("actuator", part, *numbers))
    # In steps that follow it almost exactly.
    loop = replace(loop, substeps=40)
    claim, why = pointed(make_subject(loop))
    return loop, claim, why


class Lagging:
    """A loop with a lag (s), and a law -K q - c (q1^3, q2^3, q3^3) - C w + w x Jw: K and C are a number, or one for each
    axis. `held`: the stiffness of a V, in place of K, that has no cross term; `errors`:
    numbers of the claim."""

    def __init__(self, J, h, lag, stiff, damped, cubic=0.0, *, held=None, alike=True, errors=(), **late):
        Account.left = 10**13
        self.J, self.h, self.lag, self.kept = J, h, lag, np.exp(-h / lag)
        told = {"kept": self.kept * (1 + 1e-9), "mean": lag / h * (1 - self.kept) * (1 + 1e-9)}
        told |= {"weight": 1.0, "begun": 0.0, "rest": 0.0}
        if alike:
            told["moment"] = lag / h * (1 - told["mean"]) * (1 + 2e-9)
            told |= {f"{name}.least": told[name] * (1 - 4e-9) for name in ("kept", "mean", "moment")}
        n = {"period": h, "outside": 1e-14, "error": 1e-14} | {f"outside.{k}": 1e-14 for k in range(3)} | dict(errors)
        base, own = plain()
        claim = own.claim(own.leans[0][1], n | {f"late.torque.{name}": x for name, x in (told | late).items()})
        inertia = {f"body.inertia.{i}.{k}": str(Fraction(float(J[i, k]))) for i in range(3) for k in range(i, 3)}
        loop = AttitudeLoop(read(claim | {"subject": claim["subject"] | inertia}, base.by_digest))
        (K, C), c = ([Fraction(x) for x in np.broadcast_to(part, 3)] for part in (stiff, damped)), Fraction(cubic)
        q, w, spun = loop.q[1:], loop.w, cross(loop.w, apply(loop.given, loop.w))
        self.u = [-(k * x + c * x * x * x) - d * y + s for k, d, x, y, s in zip(K, C, q, w, spun, strict=True)]
        k, Jw = Fraction(held or K[0]), apply(loop.given, w)
        lean = Fraction(0 if held else 0.3 * stiff / damped)
        V = 2 * k * (1 - loop.q[0]) + Fraction(1, 2) * dot(w, Jw) + lean * dot(q, Jw) + lean * C[0] / 2 * dot(q, q)
        loop.__dict__ |= {"u": self.u, "lyapunov": V}
        self.held = Held(loop)

    def asked(self, q, w):
        x = {f"{name}{k + 1}": part[k] for name, part in (("q", q[1:]), ("w", w)) for k in range(3)} | {"q0": q[0]}
        return np.array([valued(p, x) + 0.0 * q[0] for p in self.u])

    def after(self, x, e):
        """The state (w, q) at the next sample, and how far the torque is off then."""
        inverse, q, w = np.linalg.inv(self.J), np.concatenate([[np.sqrt(1 - (x[TURN] ** 2).sum(0))], x[TURN]]), x[:3]
        begun = self.asked(q, w)

        def slope(q, w, t):
            return *rates(self.J, inverse, q, w, begun + e * np.exp(-t / self.lag)), np.ones_like(t)

        t = np.zeros((1, x.shape[1]))
        for _ in range(PARTS):
            q, w, t = stepped(slope, (q, w, t), self.h / PARTS)
        return np.concatenate([w, q[1:]]), self.kept * e - (self.asked(q, w) - begun)

    def tube(self, level, off):
        """The tube of a level where the torque is off by so much, in what the linear motion has of it and in what not."""
        region = self.held.region(Fraction(level))
        return self.held.tube(replace(region, sizes=region.sizes | {FIRST: Fraction(off), REST: Fraction(off)}))

    def lanes(self, tube, off):
        """States in a region and torques that are off by so much each: some along an axis, so that all is alike."""
        rng = np.random.default_rng(5)
        X = floats(tube.region.X)
        x = np.linalg.cholesky(X) @ along(rng.normal(size=(6, LANES)))
        f, g = (off * along(rng.normal(size=(3, LANES))) for _ in range(2))
        half, axis = LANES // 2, np.eye(3)[:, rng.integers(3, size=LANES // 2)]
        x[:3, :half], x[TURN, :half] = 0.0, axis * rng.uniform(-1, 1, half) * float(tube.region.sizes["q1"])
        f[:, :half], g[:, :half] = (off * axis * rng.choice([-1, 1], half) for _ in range(2))
        held = (x * np.linalg.solve(X, x)).sum(0) <= 1 + 1e-9
        return x[:, held], f[:, held], g[:, held]

    def changed(self, level, off, near):
        """The largest share that is used of how far a torque is off after a period, in sets of V or near the target."""
        tube, kept = self.tube(level, off), self.kept
        x, f, g = self.lanes(tube, off)
        _, late = self.after(x, f + g)
        if near:
            rest = (1 - kept) * float(sum(self.held.lateness(tube)))
        else:
            change = self.held.change_in(tube)
            kept, rest = float(change.kept), np.linalg.norm(floats(change.M) @ x, axis=0) + float(change.rest)
        return float((np.linalg.norm(late, axis=0) / (kept * np.linalg.norm(f + g, axis=0) + rest)).max())

    def moved(self, level, off):
        """The largest share that is used of how far a state is from the linear motion after a period, in many directions."""
        tube, ways = self.tube(level, off), [np.eye(6), np.random.default_rng(2).normal(size=(200, 6))]
        ways += [np.hstack([np.eye(3), c / self.h * np.eye(3)]) for c in (-30, -8, -6, -4, -2, -1, 1, 2, 4, 8)]
        x, f, g = self.lanes(tube, off)
        state = np.vstack([x, floats(self.held.near.torque) @ x + f])[: len(self.held.near.A)]
        left, ways = self.after(x, f + g)[0] - floats(self.held.near.A)[:6] @ state, np.concatenate(ways)
        most = sum(np.linalg.norm(ways @ floats(B)[:6], axis=1) * float(b) for B, b in self.held.linear(tube))
        return float((np.abs(ways @ left) / most[:, None]).max())
