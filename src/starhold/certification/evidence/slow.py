"""Looks for bounds of the body's rate and of the law's torque that motions keep although {V <= level} holds other states."""

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.shapes import shares
from starhold.certification.evidence.terms import valued
from starhold.certification.matrices import floats
from starhold.kernel.held import Held
from starhold.kernel.loops import slopes
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly, dot, minus
from starhold.kernel.regions import RATE, STATE, TURN, Tube, felt
from starhold.kernel.theorems.kinetic import (
    ASKED,
    ASKED_PACE,
    CUBIC,
    KINETIC,
    PACE,
    QUARTIC,
    changing,
    mean_rate,
    twice_energy,
)  # fmt: skip

Array = NDArray[np.float64]

PACES = np.geomspace(3e-3, 1.0, 60)
"""The paces that are tried, in units of one period."""
WIDER, ROUNDS = 1.03, 8
"""The ratio of bounds that are tried, and how many are."""
ROOM, TURNS, SHARES = 1.005, 50, np.geomspace(0.02, 1.0, 25)
"""How much more of a limit the law may ask for than it does at first, how many turns are examined, and the weights of V
beside w.Jw in ellipsoids that contain both sets."""


def slowed(motion: Held, level: float, angle: float, rate: float, limits: dict[str, Any]) -> dict[str, float]:
    """Return the claim's numbers of bounds that seem to hold in {V <= level} for motions from a start: of the rate, and of
    the torque if that exceeds its limits nonetheless; none where one is not found."""
    try:
        slow = bound_of_rate(motion, level, rate)
        rows = shares(motion, {name: x for name, x in limits.items() if name != "limit.norm"})
        if slow and len(rows) and motion.plan is None and motion.loop.added is None:
            tube = motion.tube(motion.region(Fraction(level)))
            torque = bound_of_torque(motion, tube, level, angle, rate, rows)
            return {} if torque is None else slow | torque
    except RefusedError:
        # The set is too large.
        return {}
    return slow


def bound_of_rate(motion: Held, level: float, rate: float) -> dict[str, float]:
    """Return the numbers of a bound of w.Jw that seems to hold, as small as possible; none where there is none."""
    motion.kinetic = None
    G, region, paces = twice_energy(motion), motion.region(Fraction(level)), PACES / float(motion.h)
    changed = mean_rate(motion, G, QUARTIC)[0]
    ends = [form_of(changed, q0) for q0 in (Fraction(1), max(region.least, Fraction(0)))]
    root, energy = np.linalg.inv(np.linalg.cholesky(floats(motion.under))), energy_of(motion)
    begun = float(np.linalg.norm(energy, 2)) * rate**2

    def most(form: Array) -> float:
        return level * float(np.linalg.eigvalsh(root @ form @ root.T)[-1])

    needed, whole = np.array([max(most(energy + end / pace) for end in ends) for pace in paces]), most(energy)
    bound = max(float(needed.min()), begun)
    for _ in range(ROUNDS):
        bound *= WIDER
        if bound >= whole:
            break
        motion.kinetic = Fraction(bound)
        _, (more,), pushed = changing(motion, motion.tube(motion.region(Fraction(level))), [G], QUARTIC)
        after = needed + float(more + pushed) / paces
        if max(float(after.min()), begun) < bound:
            return {KINETIC: bound, PACE: float(paces[int(np.argmin(after))])}
        bound = max(float(after.min()), begun)
    motion.kinetic = None
    return {}


def bound_of_torque(
    motion: Held, tube: Tube, level: float, angle: float, rate: float, rows: Array
) -> dict[str, float] | None:
    """Return the numbers of a bound of what the law asks for because of the state that seems to hold; none where it asks for
    no more than its limits anyway, and None where there is no bound. rows: what takes the torque to shares of its limits."""
    inner = inside(motion, level)

    def reached(along: Array) -> float:
        return float(np.sqrt(np.einsum("li,nij,lj->ln", along, inner, along).min(axis=1).max()))

    torque, each = floats(motion.near.torque), np.linalg.norm(rows, axis=1)
    besides = felt(minus(motion.loop.u, motion.u), "h", tube.region.sizes) * motion.size("h")
    spare = float(motion.misread(tube.region)[0] + besides) * float(each.max())
    if reached(rows @ torque) < 1.0 - spare:
        return {}
    rates, more, pushed = changing(motion, tube, motion.u, CUBIC)
    at_rest = motion.loop.on_target | dict.fromkeys(STATE[RATE], 0)
    linear, paces = rows @ floats(slopes(rates, STATE, at_rest)), PACES / float(motion.h)
    rest = float((np.abs(rows) @ floats([more])[0] + each * float(pushed)).max())
    needed = [(reached(rows @ torque + linear / pace) + rest / pace, float(pace)) for pace in paces]
    share, pace = min(needed)
    share = max(share, at_first(motion, rows, angle, rate)) * ROOM
    return {ASKED: share, ASKED_PACE: pace} if share < 1.0 else None


def at_first(motion: Held, rows: Array, angle: float, rate: float) -> float:
    """Return the largest share of a limit that the law asks for because of a state turned by up to an angle (rad) at up to a
    rate (rad/s)."""
    turned, names = np.linspace(0.0, min(angle, np.pi), TURNS), ("q0", *STATE[TURN], *STATE[RATE])
    most = 0.0
    for row, along in zip(rows, rows @ floats(motion.near.torque), strict=True):
        q, w = (x / (float(np.linalg.norm(x)) or 1.0) for x in (along[TURN], along[RATE]))
        states = [np.cos(turned / 2.0), *np.outer(q, np.sin(turned / 2.0)), *np.outer(rate * w, np.ones(TURNS))]
        used = valued(dot([Fraction(float(x)) for x in row], motion.u), dict(zip(names, states, strict=True)))
        most = max(most, float(np.abs(used).max()))
    return most


def inside(motion: Held, level: float) -> Array:
    """Return matrices of ellipsoids in (w, q), around rest, that contain {V <= level} as far as w.Jw is within its bound."""
    whole = floats(motion.under) / level
    if motion.kinetic is None:
        return np.asarray(np.linalg.inv(whole)[None], dtype=np.float64)
    slow = energy_of(motion) / float(motion.kinetic)
    forms = [c * whole + (1.0 - c) * slow for c in SHARES]
    return np.asarray(np.linalg.inv(np.array(forms)), dtype=np.float64)


def energy_of(motion: Held) -> Array:
    """Return the matrix of w.Jw in (w, q)."""
    energy = np.zeros((6, 6))
    energy[RATE, RATE] = floats(motion.loop.given)
    return energy


def form_of(p: Poly, q0: Fraction) -> Array:
    """Return the matrix of a form in (w, q) that a polynomial is at some q0."""
    at, zero = p.at({"q0": q0}), dict.fromkeys(STATE, 0)
    return floats([[at.slope(i).slope(k).at(zero).number / 2 for k in STATE] for i in STATE])
