"""A loop with wheels on which nothing but what a test states acts, and its flights over a period."""

from functools import cache
from types import SimpleNamespace

import numpy as np

from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import read
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Account
from starhold.kernel.polynomials import Poly
from starhold.kernel.regions import RATE, TURN
from tests.kernel.flights import Around, Surroundings
from tests.kernel.oracle import Oracle, run
from tests.making import built

LANES, PARTS = 60, 8
NONE = [Poly({})] * 3
SMALL = dict.fromkeys(("target.rate", "target.acceleration", *(f"outside.{k}" for k in range(3))), 1e-13)


@cache
def pushed(law):
    """A loop with wheels."""
    loop = Loop(make_subject(built("cubesat-nadir", law)))
    return loop, Pushed(loop, Pushes(0.0))


def quiet(law, **more):
    """That loop, on which almost nothing acts but what is told here, and another reading of it."""
    Account.left = 10**12
    loop, own = pushed(law)
    n = {"period": loop.loop.period, "momentum": 0.01} | SMALL | {"outside": 1e-14, "error": 1e-14}
    claim = own.claim(own.leans[0][1], n | {name.replace("_", "."): x for name, x in more.items()})
    return Held(AttitudeLoop(read(claim, loop.by_digest))), Oracle({"programs": loop.by_digest}, claim)


class Flight:
    """Lanes over a period: states (w, q) and momenta at samples, errors of the attitude and the rate that the law is told,
    a torque from outside, and one that is an error of the command."""

    def __init__(self, held, oracle, rng=None, *, momentum, rate=0.0):
        self.held, self.oracle, self.h, self.J = held, oracle, float(held.h), oracle.J
        self.bounds = Surroundings([0.0] * 3, rate, 0.0, momentum, 0.0, 0.0)
        self.rng = rng or np.random.default_rng(1)

    def around(self, H):
        own = Around(self.bounds, self.J, np.linalg.inv(self.J), self.rng, H.shape[1])
        own.kept = H.copy()
        return own

    def asked(self, *given):
        return run(self.oracle.programs["law"], self.oracle.inputs(*given)[0])

    def states(self, x, H, angles=0.0, rates=0.0, outside=0.0, error=0.0):
        """Yield times, attitudes, rates and momenta from the sample to the next, and the surroundings."""
        zero, around = np.zeros_like(H), self.around(H)
        around.bounds = around.bounds._replace(noise=SimpleNamespace(told=lambda: (zero + angles, zero + rates)))
        q, w = np.concatenate([[np.sqrt(1.0 - (x[TURN] ** 2).sum(0))], x[TURN]]), x[RATE]
        command = around.command(self.asked, q, w, 0.0, zero) + error
        yield 0.0, q, w, around.kept, around
        for k in range(PARTS):
            q, w = around.after(q, w, k * self.h / PARTS, command, zero + outside, self.h / PARTS)
            yield (k + 1) * self.h / PARTS, q, w, around.kept, around

    def after(self, *given, **more):
        """The state (w, q) and the momentum at the next sample."""
        *_, (_, q, w, H, _) = self.states(*given, **more)
        return np.concatenate([w, q[1:]]), H

    def linear(self, H, size=1e-6):
        """The derivatives of the state at the next sample: with respect to that at this one, and to errors."""
        d = size * np.hstack([np.eye(12), -np.eye(12)])
        y, _ = self.after(d[:6], np.tile(H[:, None], 24), d[6:9], d[9:])
        return np.split((y[:, :12] - y[:, 12:]) / (2.0 * size), [6], axis=1)

    def spun(self, H, share=1e-3):
        """What a momentum adds to these, to the first order."""
        return ((a - b) / (2.0 * share) for a, b in zip(self.linear(share * H), self.linear(-share * H), strict=True))
