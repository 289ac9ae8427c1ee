"""Flies random states of a certified set against the claim: a test of the certifier, and no part of any proof."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.polynomial import exact
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import ZERO
from starhold.analysis.departure import shown_at, value_of
from starhold.certification.certificate import Certificate, Claim
from starhold.certification.frame import take_apart
from starhold.certification.matrices import floats, number
from starhold.certification.mixed import Shape
from starhold.certification.motion import Motion
from starhold.certification.potential import Potential, Spring
from starhold.certification.sampling import stable_period
from starhold.certification.sliding import take_surface
from starhold.certification.subject import make_subject
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import ROWS
from starhold.parts.craft import tensor
from starhold.parts.effectors.wheels import Wheels
from starhold.simulation.lanes import Batch, simulate_many

FLIGHTS = 10_000
LEGS = (1, 250, 250, 500)
"""Each flight is looked at after legs of so many control steps; the first shows the torque at the start."""
SLACK = 1e-6
"""Relative rise of V between looks that the held torque and the integration may cause."""
TURN = 0.05
"""Radians that a body, or its momentum in body axes, turns in a step at most."""

Array = NDArray[np.float64]


class BrokenClaimError(Exception):
    """A flight contradicts what was proved, which is a fault of starhold."""


@dataclass(frozen=True)
class Trial:
    """A trial tells the flights flown from {V <= level}; the largest V at a look as a share of that at the look before, and
    the largest torque, of a motor where the claim is about wheels, as a share of the limit (None: no limit is claimed)."""

    flights: int
    level: float
    highest_share: float
    torque_share: float | None


def fly_claims(loop: ClosedLoop, certificate: Certificate, flights: int = FLIGHTS, seed: int = 1) -> Trial | None:
    """Fly the largest set in which the torque is claimed to stay within its limit, else that of convergence, or towards a
    sliding surface. None where none of these is proved, or floats cannot fly the loop. Raises BrokenClaimError."""
    sliding = certificate.claim("sliding")
    if sliding is not None and sliding.outcome == "proved":
        return _fly_to_surface(loop, certificate, sliding, flights, seed)
    attracting = certificate.claim("region")
    if attracting is not None and attracting.outcome == "proved":
        return _fly_region(loop, certificate, attracting, flights, seed)
    claims = [certificate.claim(kind) for kind in ("wheels", "torque-limit", "convergence")]
    claim = next((c for c in claims if c is not None and c.outcome == "proved"), None)
    if claim is None or _beyond_floats(loop, certificate):
        return None
    free = _undisturbed(loop, certificate, bounded=claim.kind == "wheels")
    # The claim's own V, which need not be the law's.
    stiffness = claim.witness["stiffness"]
    frame = take_apart(Motion(make_subject(free), None if stiffness is None else exact(stiffness)))
    level = claim.numbers["start"]
    # Where every rate is allowed, up to what a body spun as fast as three half turns' worth of V has.
    level = min(4.0 * number(frame.potential.top), math.inf if level is None else level)
    random = np.random.default_rng(seed)
    states = draw(flights, floats(frame.P), frame.potential, level, random)
    free, states = _paced(free, certificate, states, random)
    value, floor = _value(free, claim), 1e-15 * number(frame.potential.top)
    highest, torque = 0.0, 0.0
    for batch, share in _falling(free, certificate, claim, states, value, floor):
        highest = max(highest, share)
        if claim.kind != "convergence":
            torque = max(torque, _need(batch.states, loop, claim))
    share = None if claim.kind == "convergence" else torque
    if share is not None and share > 1.0 + 1e-12:
        raise BrokenClaimError(f"{certificate.name}: a flight from the certified set needs {share:.3g} of a limit")
    return Trial(flights, level, highest, share)


def _fly_region(loop: ClosedLoop, certificate: Certificate, claim: Claim, flights: int, seed: int) -> Trial:
    free, shape, level = _undisturbed(loop, certificate), Shape(**claim.witness), claim.numbers["level"]
    states = shape.draw(level, flights, np.random.default_rng(seed))
    free, states = _paced(free, certificate, states, np.random.default_rng(seed + 1))
    value = _value(free, claim)
    shares = [share for _, share in _falling(free, certificate, claim, states, value, 1e-15 * shape.p)]
    return Trial(flights, level, max(shares), None)


def _falling(
    free: ClosedLoop,
    certificate: Certificate,
    claim: Claim,
    states: Array,
    value: Callable[[Array], Array],
    floor: float,
) -> Generator[tuple[Batch, float]]:
    """Return the flights leg by leg, with the largest V as a share of that a leg before; BrokenClaimError where one rises by
    more than a little of it and `floor`."""
    before = value(states)
    for steps in LEGS:
        batch = simulate_many(free, states, steps)
        if (batch.lost_at >= 0.0).any():
            raise BrokenClaimError(_where(certificate, claim, states, int(np.argmax(batch.lost_at >= 0.0)), "is lost"))
        states, after = batch.states, value(batch.states)
        shares = after / np.maximum(before, 1e-300)
        rising = after > before * (1.0 + SLACK) + floor
        if rising.any():
            lane = int(np.argmax(shares * rising))
            raise BrokenClaimError(
                _where(certificate, claim, states, lane, f"has V = {after[lane]:g} after {before[lane]:g}")
            )
        before = after
        yield batch, float(shares.max())


def _fly_to_surface(loop: ClosedLoop, certificate: Certificate, claim: Claim, flights: int, seed: int) -> Trial:
    """Fly from random states with s.Js/2 <= level, long enough to reach the surface without torque from outside."""
    J = tensor(loop.craft.inertia)
    least, greatest = (float(x) for x in np.linalg.eigvalsh(J)[[0, -1]])
    free = replace(_undisturbed(loop, certificate), sign_policy="as_published")
    found = take_surface(Motion(make_subject(free)))
    reach, layer = np.array([number(g) for g in found.reach]), number(found.layer)
    free = replace(free, period=_sliding_period(free.period, floats(found.K), reach, least, greatest))
    # |s| falls by at least reach/J a second.
    level = 0.5 * least * (0.5 * sum(LEGS) * free.period * float(reach.min()) / greatest) ** 2
    level = min(level, math.inf if claim.numbers["start"] is None else claim.numbers["start"])
    states = draw(flights, J, Spring(1), 2.0 + level, np.random.default_rng(seed))
    if not claim.numbers["everything"]:
        states[ROWS.attitude] *= np.where(states[0] < 0.0, -1.0, 1.0)

    def s_of(states: Array) -> Array:
        return np.array(loop.law.module.surface(_shown(free, states), loop.gains))

    # Drawn as rates, s is taken as what was drawn: w = s - Kq.
    wanted = np.sqrt(level / (2.0 + level)) * states[ROWS.rate]
    states[ROWS.rate] = 0.0
    states[ROWS.rate] = wanted - s_of(states)
    s, highest, before = wanted, 0.0, np.einsum("ik,ij,jk->k", wanted, J, wanted) / 2.0
    # Held torque lets s.Js/2 rise where reach.|s| is at most half a period times reach.J^-1 reach, and by a step from there.
    size = float(np.linalg.norm(reach))
    step = free.period * size / least * (1.0 + 0.5 * size / float(reach.min()))
    chatter = math.sqrt(greatest / least) * (math.sqrt(3.0) * layer + step)
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


def _sliding_period(longest: float, K: Array, reach: Array, least: float, greatest: float) -> float:
    """Return a period in which the body turns little at the rates of flights to a surface, and in which the torque that
    holds it there changes by a little of the switching torque."""
    slope, most = float(np.linalg.norm(K, 2)), float(reach.max())
    period = min(longest, TURN / max(slope, 5.0 * math.sqrt(most / least)))
    while True:
        rate = slope + 0.5 * sum(LEGS) * period * most / least
        if greatest * period * rate * (rate + slope) ** 2 <= 0.1 * float(reach.min()):
            return period
        period *= 0.5


def draw(count: int, P: Array, potential: Potential, level: float, random: np.random.Generator) -> Array:
    """Return states (16, count) of {V <= level}, half of them on its surface."""
    share = random.uniform(size=count) ** 0.5
    axes = random.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    t = share * np.minimum(level, potential.tops(axes))
    q0 = potential.cosine(t, axes)
    left = np.maximum(level - t, 0.0) * np.where(np.arange(count) % 2 == 0, 1.0 - 1e-9, random.uniform(size=count))
    turned = np.linalg.inv(np.linalg.cholesky(P)).T
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rates = np.sqrt(2.0 * left)[:, None] * (directions @ turned.T)
    states = np.zeros((ROWS.torque.stop, count))
    states[0], states[1:4] = q0, (potential.length(t, axes)[:, None] * axes).T
    states[ROWS.attitude] /= np.linalg.norm(states[ROWS.attitude], axis=0)
    states[ROWS.rate] = rates.T
    return states


def _beyond_floats(loop: ClosedLoop, certificate: Certificate) -> bool:
    """Tell whether the loop is linear around rest, but floats find no period of control that it is stable with."""
    sampled = certificate.claim("sampling")
    unknown = sampled is not None and sampled.numbers["longest"] is None
    return unknown and stable_period(Motion(make_subject(loop))) is None


def _undisturbed(loop: ClosedLoop, certificate: Certificate, bounded: bool = False) -> ClosedLoop:
    """Return the loop as the claims assume it, with a torque that is renewed so often that it counts as continuous; bounded:
    its wheels, if any, keep their limits."""
    sampled = certificate.claim("sampling")
    longest = None if sampled is None else sampled.numbers["longest"]
    if longest is None:
        # The loop's own period may be one that the linear loop is unstable with.
        longest = stable_period(Motion(make_subject(loop)))
    period = loop.period if longest is None else min(loop.period, longest / 400.0)
    wheels = loop.find("wheels")
    return replace(
        loop,
        start=loop.start._replace(position=ZERO, velocity=ZERO, torque=ZERO),
        parts=() if wheels is None else (replace(wheels, params=_frictionless(wheels.params, bounded)),),
        events=(),
        period=period,
        substeps=1,
        limit="none",
        sign_policy="shortest" if loop.sign_policy == "hysteresis" else loop.sign_policy,
    )


def _paced(
    loop: ClosedLoop, certificate: Certificate, states: Array, random: np.random.Generator
) -> tuple[ClosedLoop, Array]:
    """Return the loop with a period in which no flight turns far, and the states with the momenta of their rotors."""
    fastest = float(np.linalg.norm(states[ROWS.rate], axis=0).max())
    if loop.wheels is not None:
        states = np.vstack([states, _rotors(loop, certificate, states, random)])
        # The body's momentum is in both.
        least = float(np.linalg.eigvalsh(tensor(loop.craft.inertia))[0])
        fastest += certificate.subject["wheels"]["total_momentum"] / least
    return replace(loop, period=min(loop.period, TURN / max(fastest, 1e-300))), states


def _frictionless(wheels: Wheels, bounded: bool) -> Wheels:
    """The wheels come back without friction and, unless bounded, without limits; lost ones stay lost."""
    none = (0.0,) * len(wheels.axes)
    free = wheels._replace(viscous=none, coulomb=none)
    limits = tuple(math.inf if limit > 0.0 else 0.0 for limit in wheels.torque_limit)
    return free if bounded else free._replace(torque_limit=limits, momentum_limit=(math.inf,) * len(limits))


def _rotors(loop: ClosedLoop, certificate: Certificate, states: Array, random: np.random.Generator) -> Array:
    """Return rotor momenta (wheels, count) for a total momentum of any direction up to the one that is certified."""
    told = certificate.subject["wheels"]
    axes, shares, begun = (np.array(told[name]) for name in ("axes", "least", "momentum"))
    total = random.normal(size=(3, states.shape[1]))
    total *= told["total_momentum"] * random.uniform(size=states.shape[1]) ** (1.0 / 3.0) / np.linalg.norm(total, axis=0)
    kept = begun + shares @ (begun @ axes)
    return kept[:, None] - shares @ (total - tensor(loop.craft.inertia) @ states[ROWS.rate])


def _value(loop: ClosedLoop, claim: Claim) -> Callable[[Array], Array]:
    """Return the claim's V of the states in the columns of an array."""
    return lambda states: value_of(claim, loop, _shown(loop, states))


def _shown(loop: ClosedLoop, states: Array) -> Measurement:
    """Return the measurements that the law is shown at the states in the columns of an array."""
    return shown_at(loop, unflatten(list(states[: ROWS.torque.stop]), loop.start))


def _need(states: Array, loop: ClosedLoop, claim: Claim) -> float:
    """Return the largest torque, or of wheels torque and momentum, as a share of what is claimed."""
    torque = states[ROWS.torque]
    if claim.kind == "wheels":
        wheels = cast(Wheels, loop.wheels)
        needs = (
            (np.array(wheels.least) @ torque, claim.numbers["motors"]),
            (states[ROWS.torque.stop :], claim.numbers["wheel_momentum"]),
        )
        # What a lost wheel is claimed to need is zero, and it needs that.
        return max(float((np.abs(found).max(axis=1) / np.maximum(limits, 1e-300)).max()) for found, limits in needs)
    size = np.linalg.norm(torque, axis=0) if loop.limit == "norm" else np.abs(torque)
    return float(size.max()) / loop.craft.torque_limit


def _where(certificate: Certificate, claim: Claim, states: Array, lane: int, what: str) -> str:
    shown = ", ".join(f"{x:.9g}" for x in states[: ROWS.rate.stop, lane])
    return f"{certificate.name}, {claim.kind}: the flight at (q, w) = ({shown}) {what}"
