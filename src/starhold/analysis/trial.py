"""Flies random states of a certified set against the claim: a test of the certifier, and no part of any proof."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.vector import ZERO
from starhold.certification.certificate import Certificate, Claim
from starhold.certification.frame import take_apart
from starhold.certification.matrices import floats, number
from starhold.certification.motion import Motion
from starhold.certification.sliding import take_surface
from starhold.certification.subject import make_subject
from starhold.laws.interface import Seen
from starhold.loop.closed_loop import ClosedLoop
from starhold.models.actuator import IDEAL
from starhold.models.craft import tensor
from starhold.models.sensor import SILENT
from starhold.simulation.lanes import simulate_many

FLIGHTS = 10_000
LEGS = (1, 250, 250, 500)
"""Each flight is looked at after legs of so many control steps; the first shows the torque at the start."""
SLACK = 1e-6
"""Relative rise of V between looks that the held torque and the integration may cause."""

Array = NDArray[np.float64]


class BrokenClaimError(Exception):
    """A flight contradicts what was proved: a fault of starhold."""


@dataclass(frozen=True)
class Trial:
    """flights flown from {V <= level}; the largest V at a look as a share of that at the look before, and the largest
    torque as a share of the limit (None: no limit is claimed)."""

    flights: int
    level: float
    highest_share: float
    torque_share: float | None


def fly_claims(loop: ClosedLoop, certificate: Certificate, flights: int = FLIGHTS, seed: int = 1) -> Trial | None:
    """Fly the largest set in which the torque is claimed to stay within its limit, else that of convergence, or towards a
    sliding surface. None where none of these is proved. Raises BrokenClaimError."""
    sliding = certificate.claim("sliding")
    if sliding is not None and sliding.outcome == "proved":
        return _fly_to_surface(loop, certificate, sliding, flights, seed)
    claims = [c for c in (certificate.claim("torque-limit"), certificate.claim("convergence")) if c is not None]
    claim = next((c for c in claims if c.outcome == "proved"), None)
    if claim is None:
        return None
    free = _undisturbed(loop, certificate)
    frame = take_apart(Motion(make_subject(free)))
    P, s = floats(frame.P), number(frame.s)
    level = claim.numbers["start"]
    # Where every rate is allowed, up to what a body spun as fast as three half turns' worth of V has.
    level = min(8.0 * s, math.inf if level is None else level)
    states = draw(flights, P, s, level, np.random.default_rng(seed))
    value = _value(free, claim.witness["epsilon"])
    highest, before, torque = 0.0, value(states), 0.0
    for steps in LEGS:
        batch = simulate_many(free, states, steps)
        if (batch.lost_at >= 0.0).any():
            raise BrokenClaimError(_where(certificate, claim, states, int(np.argmax(batch.lost_at >= 0.0)), "is lost"))
        states, after = batch.states, value(batch.states)
        rising = after > before * (1.0 + SLACK) + 1e-15 * s
        if rising.any():
            lane = int(np.argmax(after / np.maximum(before, 1e-300) * rising))
            raise BrokenClaimError(
                _where(certificate, claim, states, lane, f"has V = {after[lane]:g} after {before[lane]:g}")
            )
        highest, before = max(highest, float((after / np.maximum(before, 1e-300)).max())), after
        torque = max(torque, _size(batch.states[13:16], loop.limit))
    share = torque / loop.craft.torque_limit if claim.kind == "torque-limit" else None
    if share is not None and share > 1.0 + 1e-12:
        raise BrokenClaimError(f"{certificate.name}: a flight from the certified set needs {share:.3g} of the torque limit")
    return Trial(flights, level, highest, share)


def _fly_to_surface(loop: ClosedLoop, certificate: Certificate, claim: Claim, flights: int, seed: int) -> Trial:
    """From random states with s.Js/2 <= level, long enough to reach the surface without torque from outside."""
    J = tensor(loop.craft.inertia)
    least, greatest = (float(x) for x in np.linalg.eigvalsh(J)[[0, -1]])
    free = replace(_undisturbed(loop, certificate), cover="as_published")
    found = take_surface(Motion(make_subject(free)))
    reach, layer = np.array([number(g) for g in found.reach]), number(found.layer)
    # |s| falls by at least reach/J a second; held torque makes it cross by one step's worth.
    level = 0.5 * least * (0.5 * sum(LEGS) * free.period * float(reach.min()) / greatest) ** 2
    level = min(level, math.inf if claim.numbers["start"] is None else claim.numbers["start"])
    states = draw(flights, J, 1.0, 2.0 + level, np.random.default_rng(seed))
    if not claim.numbers["everything"]:
        states[:4] *= np.where(states[0] < 0.0, -1.0, 1.0)
    surface = loop.law.module.surface

    def s_of(states: Array) -> Array:
        w: Any = tuple(states[4:7])
        return np.array(surface(Seen(tuple(states[:4]), w, w, ZERO, ZERO, ZERO, ZERO, free.period), loop.gains))  # type: ignore

    # Drawn as rates, s is taken as what was drawn: w = s - Kq.
    wanted = np.sqrt(level / (2.0 + level)) * states[4:7]
    states[4:7] = 0.0
    states[4:7] = wanted - s_of(states)
    s, highest, before = wanted, 0.0, np.einsum("ik,ij,jk->k", wanted, J, wanted) / 2.0
    chatter = math.sqrt(3.0) * (2.0 * float(reach.max()) * free.period / least + layer)
    for steps in LEGS:
        batch = simulate_many(free, states, steps)
        states, s = batch.states, s_of(batch.states)
        after = np.einsum("ik,ij,jk->k", s, J, s) / 2.0
        rising = (after > before * (1.0 + SLACK)) & (np.linalg.norm(s, axis=0) > chatter)
        if (batch.lost_at >= 0.0).any() or rising.any():
            raise BrokenClaimError(_where(certificate, claim, states, int(np.argmax(rising)), "leaves the surface"))
        highest, before = max(highest, float((after / np.maximum(before, 0.5 * least * chatter**2)).max())), after
    if (np.linalg.norm(s, axis=0) > chatter).any():
        raise BrokenClaimError(_where(certificate, claim, states, int(np.argmax(before)), "has not reached the surface"))
    return Trial(flights, level, highest, None)


def draw(count: int, P: Array, s: float, level: float, random: np.random.Generator) -> Array:
    """States (16, count) of {V <= level}, half of them on its surface."""
    reach = min(level, 2.0 * s)
    t = reach * random.uniform(size=count) ** 0.5
    q0 = 1.0 - t / s
    axes = random.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    left = np.maximum(level - t, 0.0) * np.where(np.arange(count) % 2 == 0, 1.0 - 1e-9, random.uniform(size=count))
    turned = np.linalg.inv(np.linalg.cholesky(P)).T
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rates = np.sqrt(2.0 * left)[:, None] * (directions @ turned.T)
    states = np.zeros((16, count))
    states[0], states[1:4] = q0, (np.sqrt(np.maximum(1.0 - q0 * q0, 0.0))[:, None] * axes).T
    states[:4] /= np.linalg.norm(states[:4], axis=0)
    states[4:7] = rates.T
    return states


def _undisturbed(loop: ClosedLoop, certificate: Certificate) -> ClosedLoop:
    """The loop as the claims assume it, with a torque that is renewed so often that it counts as continuous."""
    sampled = certificate.claim("sampling")
    longest = None if sampled is None else sampled.numbers["longest"]
    period = loop.period if longest is None else min(loop.period, longest / 400.0)
    return replace(
        loop,
        start=loop.start._replace(position=ZERO, velocity=ZERO, torque=ZERO),
        period=period,
        substeps=1,
        orbit=False,
        gravity_gradient=False,
        target=NO_TURN,
        noise=SILENT,
        limit="none",
        dynamics=IDEAL,
        cover="shortest" if loop.cover == "hysteresis" else loop.cover,
    )


def _value(loop: ClosedLoop, epsilon: float) -> Callable[[Array], Array]:
    """V + epsilon q.Jw of the states in the columns of an array, of the quaternion that is fed back."""
    function = loop.law.lyapunov
    if function is None:
        raise TypeError(f"{loop.law.name} has no V")

    def value(states: Array) -> Array:
        shown = states[:4] * (np.where(states[0] < 0.0, -1.0, 1.0) if loop.cover == "shortest" else 1.0)
        w: Any = tuple(states[4:7])
        seen = Seen(tuple(shown), w, w, ZERO, ZERO, ZERO, ZERO, loop.period)  # type: ignore[arg-type]
        cross = np.einsum("ik,ij,jk->k", shown[1:], tensor(loop.craft.inertia), states[4:7])
        return np.asarray(function(seen, loop.gains, loop.craft)) + epsilon * cross

    return value


def _size(torque: Array, kind: str) -> float:
    return float(np.linalg.norm(torque, axis=0).max() if kind == "norm" else np.abs(torque).max())


def _where(certificate: Certificate, claim: Claim, states: Array, lane: int, what: str) -> str:
    shown = ", ".join(f"{x:.9g}" for x in states[:7, lane])
    return f"{certificate.name}, {claim.kind}: the flight at (q, w) = ({shown}) {what}"
