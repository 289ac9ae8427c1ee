"""Looks for bounds of the body's rate and of the law's torque that motions keep although {V <= level} holds other states."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.shapes import on_border, shares
from starhold.certification.evidence.terms import valued
from starhold.certification.matrices import floats
from starhold.kernel.held import Held
from starhold.kernel.loops import MOMENTA
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly, minus
from starhold.kernel.regions import RATE, STATE, TURN, Tube, felt
from starhold.kernel.theorems.kinetic import (
    ASKED,
    ASKED_PACE,
    KINETIC,
    PACE,
    QUARTIC,
    alone,
    changing,
    kinds_of,
    mean_rate,
    twice_energy,
)  # fmt: skip

Array = NDArray[np.float64]

PACES = np.geomspace(3e-3, 1.0, 60)
"""The paces that are tried, in units of one period."""
WIDER, ROUNDS = 1.03, 8
"""The ratio of bounds that are tried, and how many are."""
ROOM, TURNS, STATES, NEARBY = 1.005, 50, 6000, 2
"""How much more of a limit the law may ask for than it does at first, how many turns and how many states of a set are
examined, and at how many lower paces a share has to do."""


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
    """Return the numbers of a bound of what the law asks for because of state and momentum that seems to hold; none where it
    asks for no more than its limits anyway, and None where there is no bound. rows: what takes the torque to shares of its
    limits."""
    command, each, sizes = alone(motion), np.linalg.norm(rows, axis=1), tube.region.sizes
    beside = minus(motion.loop.u, command)
    besides = [felt(beside, letter, sizes) * motion.size(letter) for letter in "era"]
    most = 1.0 - float(motion.misread(tube.region)[0] + sum(besides, Fraction(0))) * float(each.max())
    states = on_the_border(motion, level)
    torque = shares_of(motion, rows, command, states)
    if largest_of(*torque) < most:
        return {}
    rates, more, pushed = changing(motion, tube, command, kinds_of(command))
    speeds, paces = shares_of(motion, rows, rates, states), PACES / float(motion.h)
    rest = float((np.abs(rows) @ floats([more])[0] + each * float(pushed)).max())
    needed = [largest_of(*(p + rate / pace for p, rate in zip(torque, speeds, strict=True))) + rest / pace for pace in paces]
    # Just below the best pace much more is needed, and everywhere a sum of squares needs more than these states do.
    share, pace = min((max(needed[max(k - NEARBY, 0) : k + 1]), float(pace)) for k, pace in enumerate(paces))
    share = max(share, at_first(motion, rows, angle, rate) * ROOM)
    # What the rest of the torque leaves, but for some room that it needs too.
    return {ASKED: (share + 2.0 * most) / 3.0, ASKED_PACE: pace} if share < most else None


def shares_of(motion: Held, rows: Array, parts: Sequence[Poly], states: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return the shares of limits that torques are in some states without momentum, and what the largest one adds about each
    axis."""
    none, size = np.zeros(len(states["q0"])), float(motion.size("h"))
    momenta = [dict.fromkeys(MOMENTA, none) | dict.fromkeys(one, none + size) for one in ("", *zip(MOMENTA))]
    first, *others = (rows @ np.array([valued(p, {**states, **one}) + none for p in parts]) for one in momenta)
    return first, np.array(others) - first


def largest_of(alone: Array, turned: Array) -> float:
    """Return the most of what `shares_of` returns, with momentum in any direction."""
    return float((np.abs(alone) + np.linalg.norm(turned, axis=0)).max())


def on_the_border(motion: Held, level: float) -> dict[str, Array]:
    """Return states of {V <= level}, as far as w.Jw is within its bound, that turn as fast there along some direction."""
    r = np.random.default_rng(1)
    along, axes = (v / np.linalg.norm(v, axis=0) for v in r.normal(size=(2, 3, STATES)))
    half, slow = r.uniform(0.0, np.pi / (1 + motion.even), STATES), None
    if motion.kinetic is not None:
        slow = floats(motion.loop.given) / float(motion.kinetic)
    states, inside = on_border(floats(motion.form(motion.s / 2)), motion.even, level, along, axes, half, slow)
    return {name: x[inside] for name, x in states.items()}


def at_first(motion: Held, rows: Array, angle: float, rate: float) -> float:
    """Return the largest share of a limit that the law asks for because of momentum and a state turned by up to an angle
    (rad) at up to a rate (rad/s)."""
    turned, names = np.linspace(0.0, min(angle, np.pi), TURNS), ("q0", *STATE[TURN], *STATE[RATE])
    command, most = alone(motion), 0.0
    for row, along in zip(rows, rows @ floats(motion.near.torque), strict=True):
        q, w = (x / (float(np.linalg.norm(x)) or 1.0) for x in (along[TURN], along[RATE]))
        states = [np.cos(turned / 2.0), *np.outer(q, np.sin(turned / 2.0)), *np.outer(rate * w, np.ones(TURNS))]
        most = max(most, largest_of(*shares_of(motion, row[None], command, dict(zip(names, states, strict=True)))))
    return most


def energy_of(motion: Held) -> Array:
    """Return the matrix of w.Jw in (w, q)."""
    energy = np.zeros((6, 6))
    energy[RATE, RATE] = floats(motion.loop.given)
    return energy


def form_of(p: Poly, q0: Fraction) -> Array:
    """Return the matrix of a form in (w, q) that a polynomial is at some q0."""
    at, zero = p.at({"q0": q0}), dict.fromkeys(STATE, 0)
    return floats([[at.slope(i).slope(k).at(zero).number / 2 for k in STATE] for i in STATE])
