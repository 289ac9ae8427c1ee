"""How much a proof costs in sharpness: how far a bounded torque takes a loop, by the claim, by exact sums of the impulse
response, and by the ellipsoid of the star norm; and how long the torque may be held. Run it to prove the claims anew.

Here the laws fly with no part but the body. The claim is about the nonlinear motion, the others are about the linear one,
and nothing of what proves is used to compute them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize

import starhold as sh
from generators.tables import table
from starhold.certification.certify import Wanted, certify
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.craft import tensor
from starhold.scenario.building import build

Array = NDArray[np.float64]
STORED = Path(__file__).with_name("sharpness.json")
"""By scenario and law the torque (N m), the proved angle (rad), and the longest period proved (s)."""
LOOPS = (("three-laws", "lyapunov"), ("geostationary", "pd"), ("geostationary", "matrix-pd"), ("cubesat-nadir", "wheel"))
DEFLECTION = 1e-4
"""The torque is so many times what the law asks of a unit of q about its softest axis."""
STEP = 1e-5
"""The rotation (q) and the rate (rad/s) by which the law is differentiated."""
NODES = 4
"""Points of Gauss in a period."""


class Linear(NamedTuple):
    """A loop near rest, u = -C w - K q, J w' = u + d, q' = w/2, with u held for the period h."""

    J: Array
    C: Array
    K: Array
    h: float

    def step(self, time: float) -> tuple[Array, Array]:
        """Return by what (w, q) and a torque from outside at this time before the next sample act on (w, q) there."""
        inverse, one, h = np.linalg.inv(self.J), np.eye(3), self.h
        A = np.block([[one, np.zeros((3, 3))], [h / 2.0 * one, one]])
        A -= np.vstack([h * inverse, h * h / 4.0 * inverse]) @ np.hstack([self.C, self.K])
        return A, np.vstack([inverse, time / 2.0 * inverse])

    def held(self) -> tuple[Array, Array]:
        """Return the same of a torque that is held for a period."""
        inverse, h = np.linalg.inv(self.J), self.h
        return self.step(0.0)[0], np.vstack([h * inverse, h * h / 4.0 * inverse])


def alone(scenario: str, law: str) -> ClosedLoop:
    """The law with the body and no other part, towards a target at rest, without limits."""
    given = sh.load(scenario)
    loop = replace(build(given, given.pick(law)), events=(), limit="none")
    return loop.without("environment", "sensor", "estimator", "effector", "actuator", "target")


def linear(loop: ClosedLoop) -> Linear:
    """Differentiate the law's command near rest."""
    step, craft = make_step(loop.composition()), loop.craft

    def command(q: Array, w: Array) -> Array:
        state = loop.start._replace(attitude=(float(np.sqrt(1.0 - q @ q)), *q.tolist()), rate=tuple(w.tolist()))
        shown = step.measure(loop.carry()._replace(state=state), 0, 0, craft, loop.setup())
        memory = loop.law.remember(loop.gains, craft, loop.period)
        return np.array(loop.law.command(shown, loop.gains, craft, memory)[0])

    none, slopes = np.zeros(3), list[Array]()
    for pairs in ([(none, STEP * e) for e in np.eye(3)], [(STEP * e, none) for e in np.eye(3)]):
        slopes.append(np.array([(command(-q, -w) - command(q, w)) / (2.0 * STEP) for q, w in pairs]).T)
    return Linear(np.array(tensor(craft.inertia)), *slopes, loop.period)


def summed(loop: Linear, free: bool) -> float:
    """Return how far |q| gets by a torque of norm 1 at most, the largest over directions y of the sum of |B'(A')^k y|: of
    a torque that is held with the command, or that is free to change within a period."""
    A, B = loop.held()
    parts = B[None]
    if free:
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        pairs = zip(nodes, weights, strict=True)
        parts = np.array([loop.step(loop.h * (x + 1.0) / 2.0)[1] * (w * loop.h / 2.0) for x, w in pairs])
    powers = [np.hstack([np.zeros((3, 3)), np.eye(3)])]
    while np.linalg.norm(powers[-1] @ B) > 1e-6 * np.linalg.norm(powers[0] @ B) or len(powers) < 9:
        powers.append(powers[-1] @ A)
    every = np.einsum("kij,njl->knil", np.array(powers), parts).reshape(-1, 3, 3)

    def far(y: Array) -> float:
        return float(np.linalg.norm(np.einsum("kij,i->kj", every, y / np.linalg.norm(y)), axis=1).sum())

    begins = [*np.eye(3), *np.random.default_rng(1).normal(size=(20, 3))]
    best = max(begins, key=far)
    return max(far(best), -float(optimize.minimize(lambda y: -far(y), best, method="Nelder-Mead").fun))


def star(loop: Linear) -> float:
    """Return the star norm from a held torque to q: the smallest ellipsoid X = AXA'/(1 - a) + BB'/a over a (J. Abedor,
    K. Nagpal, K. Poolla, International Journal of Robust and Nonlinear Control 6, 1996)."""
    A, B = loop.held()
    most = 1.0 - float(np.abs(np.linalg.eigvals(A)).max()) ** 2

    def size(a: float) -> float:
        X = linalg.solve_discrete_lyapunov(A / np.sqrt(1.0 - a), B @ B.T / a)
        return float(np.sqrt(np.linalg.eigvalsh(X[3:, 3:])[-1]))

    shares = most * np.linspace(0.005, 0.995, 199)
    place = int(np.argmin([size(a) for a in shares]))
    near = shares[max(place - 1, 0)], shares[min(place + 1, 198)]
    return min(size(shares[place]), float(optimize.minimize_scalar(size, bounds=near, method="bounded").fun))


def border(loop: Linear) -> float:
    """Return the period from which the linear loop is no longer stable, by bisection of its largest eigenvalue."""

    def largest(h: float) -> float:
        return float(np.abs(np.linalg.eigvals(loop._replace(h=h).step(0.0)[0])).max())

    end = loop.h
    while largest(end) < 1.0:
        end *= 1.05
    return float(optimize.brentq(lambda h: largest(h) - 1.0, end / 1.05, end))


def prove(scenario: str, law: str) -> dict[str, Any]:
    """Prove how near to its target the law stays under a small torque, and how long this may be held."""
    loop = alone(scenario, law)
    torque = DEFLECTION * float(np.linalg.svd(linear(loop).K, compute_uv=False)[-1])
    claim = certify(loop, "", Wanted(disturbance=torque, alone=True)).claim("pointing")
    sampled = certify(loop).claim("sampling")
    if claim is None or sampled is None or claim.outcome != "proved" != sampled.outcome:
        raise ValueError(f"{scenario}, {law}: not proved")
    proof: Any = claim.proof
    found_by = {"by_response": "response" in proof.claim["evidence"]}
    return {"torque": torque, "angle": claim.numbers["angle"], "longest": sampled.numbers["longest"], **found_by}


def entries() -> list[tuple[str, Linear, dict[str, Any]]]:
    """The loops with what is stored of them."""
    given: dict[str, Any] = json.loads(STORED.read_text(encoding="utf-8"))
    return [(" ".join(pair), linear(alone(*pair)), given[" ".join(pair)]) for pair in LOOPS]


def sharpness_table() -> str:
    """How far each loop gets by each method, as shares of the exact sum."""
    rows: list[list[str]] = []
    for name, loop, stored in entries():
        exact, border_of = summed(loop, False), border(loop)
        shares = (summed(loop, True), stored["angle"] / 2.0 / stored["torque"], star(loop))
        scenario, law = name.split()
        shown = [f"{exact:.4g}", *(f"{x / exact:.3f}" for x in shares)]
        held = [f"{border_of:.4g}", f"{1.0 - stored['longest'] / border_of:.0e}"]
        rows.append([f"`{scenario}`", f"`{law}`", *shown, "response" if stored["by_response"] else "ellipsoid", *held])
    heads = ["scenario", "law", "exact, 1/(N m)", "free in a period", "proved", "star norm", "proved by"]
    return table([*heads, "longest period, s", "proved but for"], rows)


if __name__ == "__main__":
    STORED.write_text(json.dumps({" ".join(pair): prove(*pair) for pair in LOOPS}, indent=1) + "\n", encoding="utf-8")
