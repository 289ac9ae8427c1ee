"""Flies from random states of a certified set to test the claim: a test of the certifier, not part of any proof."""

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import derivative, vector_part
from starhold.algebra.structure import unflatten
from starhold.algebra.vector import ZERO
from starhold.analysis.departure import beyond, measured_at, shown_at, value_of
from starhold.certification.certificate import Certificate, Claim
from starhold.certification.evidence.claims import settles
from starhold.certification.evidence.recorded import TURNS
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.rigid_body import ROWS, angular_acceleration
from starhold.parts.craft import tensor
from starhold.parts.effectors.wheel_motion import without_friction
from starhold.parts.effectors.wheels import Wheels
from starhold.simulation.lanes import Batch, simulate_many
from starhold.trace.straight_line import evaluated

FLIGHTS = 10_000
LEGS = (1, 250, 250, 500)
"""Control steps of the legs after each of which a flight is checked; the first checks the torque at the start."""
SLACK = 1e-6
"""The relative increase of V between checks allowed for held torque and integration errors."""
TURN = 0.05
"""The largest rotation (rad) of a body, or of its momentum in body axes, in a step."""

SLOWER = 20
"""How often the rate of a state is reduced until it is within the bounds of a claim."""
NEAR, FAR = 1e-7, 10.0
"""Sizes of rotations (q) and rates (rad/s) near rest, where laws are linear, and beyond any boundary layer."""

Array: TypeAlias = NDArray[np.float64]
Height: TypeAlias = Callable[[Array], Array]
"""A function from states, given as columns, to their V."""


class BrokenClaimError(Exception):
    """A flight contradicts a proved claim, which is a fault of starhold."""


@dataclass(frozen=True)
class Trial:
    """A trial: the number of flights from {V <= level}; the largest V at a check as a share of that at the previous one,
    and the largest torque, of a motor if the claim is about wheels, as a share of the limit (None: no limit is claimed)."""

    flights: int
    level: float
    highest_share: float
    torque_share: float | None


def fly_claims(loop: ClosedLoop, certificate: Certificate, flights: int = FLIGHTS, seed: int = 1) -> Trial | None:
    """Fly from the largest set in which a limit is claimed to be kept, else from the first with a claimed ultimate bound,
    or towards a sliding surface, and return the trial. None if none of these is proved, or floats cannot fly the loop.
    Raise BrokenClaimError if a flight contradicts the claim."""
    proved = [(c, c.programs) for c in certificate.claims if c.outcome == "proved"]
    # The effect of appendages on V is not flown here.
    with_sets = [(c, p) for c, p in proved if p.keys() & {"lyapunov", "surface"} and "motion" not in p]
    claim, programs = next((one for one in with_sets if _limited(one[0])), next(iter(with_sets), (None, None)))
    # The contribution of a memory may increase V, like an external torque.
    if claim is None or programs is None or "memory" in claim.numbers:
        return None
    if "surface" in programs:
        return _fly_to_surface(loop, certificate, claim, flights, seed)
    if _beyond_floats(loop, certificate):
        return None
    free, level = _undisturbed(loop, certificate, "motors" in claim.numbers), claim.numbers["start"]
    random = np.random.default_rng(seed)
    height = _height(free, programs)
    top = _highest(height)
    # If every rate is allowed, the level includes spins with three times the V of a half turn.
    level = min(4.0 * top, math.inf if level is None else level)
    # A set about the target alone, with a V that is equal at both quaternions, has q0 > 0.
    one_sided = claim.kind == "pointing" and not height(_at_rest(-np.eye(4)[:, :1])).any()
    most = math.pi if one_sided else 2.0 * math.pi
    states = _within(free, claim, draw(flights, height, level, random, most))
    free, states = _paced(free, certificate, states, random)
    highest, torque = 0.0, 0.0

    def value(states: Any) -> Any:
        return value_of(programs, free, shown_at(free, _states(free, states)))

    for batch, share in falling(free, certificate, claim, states, value, 1e-15 * top):
        highest = max(highest, share)
        if _limited(claim):
            torque = max(torque, _need(batch.states, loop, claim))
    if torque > 1.0 + 1e-12:
        raise BrokenClaimError(f"{certificate.name}: a flight from the certified set needs {torque:.3g} of a limit")
    return Trial(states.shape[1], level, highest, torque if _limited(claim) else None)


def _within(loop: ClosedLoop, claim: Claim, states: Array) -> Array:
    """Return states of {V <= level} within the bounds of a claim's rate and torque, slower ones where they are beyond."""
    if "kinetic" not in claim.numbers:
        return states
    states, far = states.copy(), np.zeros(states.shape[1], dtype=np.bool_)
    for _ in range(SLOWER):
        states[ROWS.rate, far] *= 0.8
        far = np.asarray(beyond(claim, loop, measured_at(loop, _states(loop, states))))
        if not far.any():
            break
    return states[:, ~far]


def _limited(claim: Claim) -> bool:
    """Return whether a claim is about limits."""
    return not claim.numbers.keys().isdisjoint(("motors", "limit"))


def falling(
    free: ClosedLoop, certificate: Certificate, claim: Claim, states: Array, value: Height, floor: float
) -> Generator[tuple[Batch, float]]:
    """Return the flights leg by leg, with the largest V as a share of that one leg before. Raise BrokenClaimError if a
    flight diverges, or its V increases by more than a small share of it plus `floor`."""
    before, rows = value(states), free.body.module.ROWS
    for steps in LEGS:
        batch = simulate_many(free, states, steps)
        if (batch.lost_at >= 0.0).any():
            raise _broken(certificate, claim, states, int(np.argmax(batch.lost_at >= 0.0)), "is lost", rows)
        states, after = batch.states, value(batch.states)
        shares = after / np.maximum(before, max(floor, 1e-300))
        rising = after > before * (1.0 + SLACK) + floor
        if rising.any():
            lane = int(np.argmax(shares * rising))
            raise _broken(certificate, claim, states, lane, f"has V = {after[lane]:g} after {before[lane]:g}", rows)
        before = after
        yield batch, float(shares.max())


def _fly_to_surface(loop: ClosedLoop, certificate: Certificate, claim: Claim, flights: int, seed: int) -> Trial:
    """Fly from random states with s.Js/2 <= level long enough to reach the undisturbed surface; return the trial."""
    J, programs = tensor(loop.craft.inertia), claim.programs
    least, greatest = (float(x) for x in np.linalg.eigvalsh(J)[[0, -1]])
    free = replace(_undisturbed(loop, certificate), sign_policy="as_published")

    def s_of(states: Array) -> Array:
        shown = measured_at(free, _states(free, states))
        return np.array(evaluated(programs["surface"], measurement=shown, gains=loop.gains))

    K = s_of(_at_rest(np.vstack([np.zeros(3), np.eye(3)])))
    reach, layer = _switching(free, K)
    free = replace(free, period=_sliding_period(free.period, K, reach, least, greatest))
    # |s| decreases by at least reach/J per second.
    level = 0.5 * least * (0.5 * sum(LEGS) * free.period * float(reach.min()) / greatest) ** 2
    level = min(level, math.inf if claim.numbers["start"] is None else claim.numbers["start"])
    height = _height(free, programs)
    states = draw(
        flights, height, level, np.random.default_rng(seed), 2.0 * math.pi if claim.numbers["everything"] else math.pi
    )
    s, highest, before = s_of(states), 0.0, height(states)
    # With held torque s.Js/2 may increase where reach.|s| is at most half a period times reach.J^-1 reach, and one step
    # beyond that.
    size = float(np.linalg.norm(reach))
    step = free.period * size / least * (1.0 + 0.5 * size / float(reach.min()))
    chatter = math.sqrt(greatest / least) * (math.sqrt(3.0) * layer + step)
    for steps in LEGS:
        batch = simulate_many(free, states, steps)
        states, s, after = batch.states, s_of(batch.states), height(batch.states)
        rising = (after > before * (1.0 + SLACK)) & (np.linalg.norm(s, axis=0) > chatter)
        if (batch.lost_at >= 0.0).any() or rising.any():
            raise _broken(certificate, claim, states, int(np.argmax(rising)), "leaves the surface")
        highest, before = max(highest, float((after / np.maximum(before, 0.5 * least * chatter**2)).max())), after
    if (np.linalg.norm(s, axis=0) > chatter).any():
        raise _broken(certificate, claim, states, int(np.argmax(before)), "has not reached the surface")
    return Trial(flights, level, highest, None)


def _switching(loop: ClosedLoop, K: Array) -> tuple[Array, float]:
    """Return the switching torque about each axis, -J s' far from the surface, and the thickness of the boundary layer, in
    which it is proportional to s."""
    far, near = (-_momentum_rate(loop, K, [rate] * 3) for rate in (FAR, NEAR))
    return far, float(np.where(near < 0.5 * far, NEAR * far / near, 0.0).max())


def _momentum_rate(loop: ClosedLoop, K: Array, rate: list[float]) -> Array:
    """Return J s' on target at a rate (rad/s)."""
    w: Any = tuple(rate)
    turning = vector_part(derivative((1.0, *ZERO), w))
    turned = angular_acceleration(w, cast(Any, tuple(_torque(loop, ZERO, w))), loop.craft)
    return tensor(loop.craft.inertia) @ (np.array(turned) + K @ np.array(turning))


def _sliding_period(longest: float, K: Array, reach: Array, least: float, greatest: float) -> float:
    """Return a period (s) in which the body rotates little at the rates of flights to a surface, and in which the torque
    that keeps it there changes by a small share of the switching torque."""
    slope, most = float(np.linalg.norm(K, 2)), float(reach.max())
    period = min(longest, TURN / max(slope, 5.0 * math.sqrt(most / least)))
    while True:
        rate = slope + 0.5 * sum(LEGS) * period * most / least
        if greatest * period * rate * (rate + slope) ** 2 <= 0.1 * float(reach.min()):
            return period
        period *= 0.5


def draw(count: int, height: Height, level: float, random: np.random.Generator, most: float = 2.0 * math.pi) -> Array:
    """Return states (16, count) of {V <= level} rotated by at most `most` (rad), half of them on its surface. V is
    quadratic in the rate, with quadratic terms that do not depend on the attitude."""
    P, units = _squares(height)
    axes, directions = random.normal(size=(2, 3, count))
    axes /= np.linalg.norm(axes, axis=0)
    directions /= np.linalg.norm(directions, axis=0)
    turns = random.uniform(0.0, most, size=count)
    while True:
        states = _at_rest(np.vstack([np.cos(0.5 * turns), np.sin(0.5 * turns) * axes]))
        slope = np.array([(height(_spun(states, e)) - height(_spun(states, -e))) / 2.0 for e in units])
        middle: Array = -np.asarray(np.linalg.solve(P, slope / np.diagonal(units)[:, None]), dtype=np.float64)
        lowest = height(_spun(states, middle))
        beyond = lowest > level
        if not beyond.any():
            break
        # V is nearly quadratic in small rotations.
        closer = 0.99 * np.sqrt(level / np.where(beyond, lowest, level)) * random.uniform(size=count) ** 0.25
        turns = np.where(beyond, closer * turns, turns)
    inside = np.where(np.arange(count) % 2 == 0, 1.0 - 1e-9, random.uniform(size=count))
    reached = np.sqrt(2.0 * inside * np.maximum(level - lowest, 0.0))
    return _spun(states, middle + reached * (np.linalg.inv(np.linalg.cholesky(P)).T @ directions))


def _squares(height: Height) -> tuple[Array, Array]:
    """Return P of w.Pw/2 in V, and rates about each axis at which V is about as large as at rest after a half turn."""
    rest, one = _at_rest(np.eye(4)[:, :1]), np.eye(3)
    squares = np.array([2.0 * float(height(_spun(rest, e))[0]) for e in one])
    pairs = [[2.0 * float(height(_spun(rest, e + f))[0]) for e in one] for f in one]
    P = 0.5 * (np.array(pairs) - squares[:, None] - squares[None, :])
    return P, np.diag(np.sqrt(2.0 * _highest(height) / squares))


def _highest(height: Height) -> float:
    """Return the largest V at rest."""
    return float(height(_at_rest(np.array(TURNS, dtype=float).T)).max())


def _at_rest(attitude: Array) -> Array:
    """Return states at rest with quaternions (4, n)."""
    states = np.zeros((ROWS.torque.stop, attitude.shape[1]))
    states[ROWS.attitude] = attitude
    return states


def _spun(states: Array, rate: Array) -> Array:
    """Return states with another rate (3,), or one rate for each (3, n)."""
    spun = states.copy()
    spun[ROWS.rate] = rate if rate.ndim > 1 else rate[:, None]
    return spun


def _height(loop: ClosedLoop, programs: Any) -> Height:
    """Return the function V of states, for either quaternion sign given to the law."""
    return lambda states: value_of(programs, loop, measured_at(loop, _states(loop, states)))


def _states(loop: ClosedLoop, states: Array) -> Any:
    """Return the body's state in which each number is a column (n,)."""
    return unflatten(list(states[: ROWS.torque.stop]), loop.start)


def stable_period(loop: ClosedLoop) -> float | None:
    """Return a period (s) near the longest that is stable in floating point, or the loop's own if it is stable; None for a
    law that is not linear near rest, or without a stable period."""
    slopes = [_slopes(loop, step) for step in (NEAR, 0.5 * NEAR)]
    if not np.allclose(*slopes, rtol=1e-3, atol=1e-9 * float(np.abs(slopes[0]).max())):
        return None
    pull = -np.asarray(np.linalg.solve(tensor(loop.craft.inertia), slopes[0]), dtype=np.float64)
    return next((h for h in (loop.period * 0.5**count for count in range(100)) if settles(pull, h)), None)


def _slopes(loop: ClosedLoop, step: float) -> Array:
    """Return the derivative (3, 6) of the torque by rate and rotation at rest, from differences of size `step`."""
    steps = [tuple(map(float, step * e)) for e in np.eye(3)]
    pairs = [(ZERO, x) for x in steps] + [(x, ZERO) for x in steps]
    negative = [tuple(tuple(-x for x in part) for part in pair) for pair in pairs]
    differences = [_torque(loop, *a) - _torque(loop, *cast(Any, b)) for a, b in zip(pairs, negative, strict=True)]
    return np.array(differences).T / (2.0 * step)


def _torque(loop: ClosedLoop, turn: Any, rate: Any) -> Array:
    """Return the law's torque (N m) after a small rotation (q) and at a rate, without wheels."""
    bare = replace(loop, parts=(), events=())
    shown = measured_at(bare, bare.start._replace(attitude=(1.0, *turn), rate=rate))
    memory = loop.law.remember(loop.gains, loop.known, loop.period)
    return np.array(loop.law.command(shown, loop.gains, loop.known, memory)[0])


def _beyond_floats(loop: ClosedLoop, certificate: Certificate) -> bool:
    """Return whether the loop is linear near rest, but has no stable control period in floating point."""
    sampled = certificate.claim("sampling")
    unknown = sampled is not None and sampled.numbers["longest"] is None
    return unknown and stable_period(loop) is None


def _undisturbed(loop: ClosedLoop, certificate: Certificate, bounded: bool = False) -> ClosedLoop:
    """Return the loop as the claims assume it, with a torque updated so often that it counts as continuous; bounded: wheels
    keep their limits."""
    sampled = certificate.claim("sampling")
    longest = None if sampled is None else sampled.numbers["longest"]
    if longest is None:
        # The linear loop may be unstable with the loop's own period.
        longest = stable_period(loop)
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
    """Return the loop with a period in which no flight rotates far, and the states with the momenta of the rotors."""
    fastest = float(np.linalg.norm(states[ROWS.rate], axis=0).max())
    if loop.wheels is not None:
        states = np.vstack([states, _rotors(loop, certificate, states, random)])
        # Both include the body's momentum.
        least = float(np.linalg.eigvalsh(tensor(loop.craft.inertia))[0])
        fastest += certificate.subject["wheels"]["total_momentum"] / least
    return replace(loop, period=min(loop.period, TURN / max(fastest, 1e-300))), states


def _frictionless(wheels: Wheels, bounded: bool) -> Wheels:
    """Return the wheels balanced and without friction and, unless bounded, without limits; lost ones stay lost."""
    free = without_friction(wheels)
    limits = tuple(math.inf if limit > 0.0 else 0.0 for limit in wheels.torque_limit)
    return free if bounded else free._replace(torque_limit=limits, momentum_limit=(math.inf,) * len(limits), power_limit=())


def _rotors(loop: ClosedLoop, certificate: Certificate, states: Array, random: np.random.Generator) -> Array:
    """Return rotor momenta (wheels, count) for total momenta of any direction up to the certified one."""
    wheels = certificate.subject["wheels"]
    axes, shares, begun = (np.array(wheels[name]) for name in ("axes", "least", "momentum"))
    total = random.normal(size=(3, states.shape[1]))
    total *= wheels["total_momentum"] * random.uniform(size=states.shape[1]) ** (1.0 / 3.0) / np.linalg.norm(total, axis=0)
    kept = begun + shares @ (begun @ axes)
    return kept[:, None] - shares @ (total - tensor(loop.craft.inertia) @ states[ROWS.rate])


def _need(states: Array, loop: ClosedLoop, claim: Claim) -> float:
    """Return the largest torque, or for wheels torque and momentum, as a share of the claimed bound."""
    torque = states[ROWS.torque]
    if loop.wheels is not None:
        needs = (("motors", np.array(loop.wheels.least) @ torque), ("wheel_momentum", states[ROWS.torque.stop :]))
        # A lost wheel is claimed to need zero, and does. Without a limit, nothing is claimed.
        limits = [np.array([np.inf if x is None else x for x in claim.numbers.get(name, [None])]) for name, _ in needs]
        shares = [
            np.abs(sizes).max(axis=1) / np.maximum(most, 1e-300) for (_, sizes), most in zip(needs, limits, strict=True)
        ]
        return float(np.concatenate(shares).max())
    size = np.linalg.norm(torque, axis=0) if loop.limit == "norm" else np.abs(torque)
    return float(size.max()) / loop.craft.torque_limit


def _broken(
    certificate: Certificate, claim: Claim, states: Array, lane: int, what: str, rows: Any = ROWS
) -> BrokenClaimError:
    # The first numbers of a state identify its motion.
    shown = ", ".join(f"{x:.9g}" for x in states[: rows[1].stop, lane])
    return BrokenClaimError(f"{certificate.name}, {claim.kind}: the flight at ({shown}) {what}")
