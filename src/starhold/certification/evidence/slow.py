"""Looks for bounds of the body's rate and of the law's torque that motions keep although {V <= level} holds other states."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.evidence.chains import Chain
from starhold.certification.evidence.shapes import on_border, shares
from starhold.certification.evidence.squares import CLEAR, definiteness
from starhold.certification.evidence.terms import valued
from starhold.certification.matrices import floats
from starhold.kernel.held import Held
from starhold.kernel.loops import MOMENTA
from starhold.kernel.numbers import RefusedError
from starhold.kernel.polynomials import Poly, minus
from starhold.kernel.regions import RATE, STATE, TURN, felt, stretch
from starhold.kernel.theorems.kinetic import (
    ASKED,
    ASKED_PACE,
    KINETIC,
    PACE,
    QUARTIC,
    changing,
    commanded,
    kinds_of,
    mean_rate,
    slowing,
    speeding_up,
    twice_energy,
)  # fmt: skip

Array = NDArray[np.float64]

PACES = np.geomspace(3e-3, 1.0, 60)
"""The paces that are tried, in units of one period."""
WIDER, ROUNDS = 1.012, 8
"""The ratio of bounds that are tried at first, and how many are."""
ROOM, FREE, TURNS, STATES, NEARBY, COARSE = 1.005, 0.8, 50, 6000, 1, 6
"""How much more of a limit the law may ask for than it does at first, up to which share of its limits nothing needs to bound
what it asks for, how many turns and how many states of a set are examined, at how many lower paces a share has to do, and
one in how many paces is examined at first."""


def slowed(whole: Chain, angle: float, rate: float, limits: dict[str, Any]) -> dict[str, float]:
    """Return the claim's numbers of bounds that seem to hold in {V <= level} for motions from a start: of the rate, and of
    the torque if that exceeds its limits nonetheless; none where one is not found. Where V rises anyway, that of the rate
    does."""
    motion, level = whole.motion, whole.level
    try:
        slow = bound_of_rate(motion, level, rate)
        limits = {name: x for name, x in limits.items() if name != "limit.norm"}
        rows = shares(motion, limits)
        if slow and len(rows) and motion.plan is None and motion.loop.added is None and not whole.rises():
            torque = bound_of_torque(motion, level, angle, rate, rows, limits)
            return {} if torque is None else slow | torque
    except RefusedError:
        # The set is too large.
        return {}
    return slow


def bound_of_rate(motion: Held, level: float, rate: float) -> dict[str, float]:
    """Return the numbers of a bound of w.Jw that seems to hold, as small as possible; none where there is none."""
    motion.kinetic, motion.commands = None, {}
    G, paces, region = twice_energy(motion), PACES / float(motion.h), motion.region(Fraction(level))
    states = on_the_border(motion, level)
    changed = mean_rate(motion, G, QUARTIC)[0]
    # Slower states are inside: both are of second degree in the rate.
    parts = [of_rate(p, states) for p in (G, changed)]
    needed = np.array([most_within(*(g + rate / pace for g, rate in zip(*parts, strict=True))) for pace in paces])
    begun, whole = float(stretch(motion.loop.given)) * rate**2, float(parts[0][2].max())
    bound, scales = WIDER * max(float(needed.min()), begun), {name: float(region.sizes[name]) for name in STATE}
    before, wider = (0.0, 0.0), WIDER
    for _ in range(ROUNDS):
        if bound >= whole:
            break
        motion.kinetic = Fraction(bound)
        tube = motion.tube(motion.region(Fraction(level)))
        faster = speeding_up(motion, tube)
        after = needed + float(faster[1]) / paces
        least, pace = max(float(after.min()), begun), float(paces[int(np.argmin(after))])
        if least < bound:
            clear = definiteness(slowing(motion, faster, motion.kinetic, Fraction(pace), Fraction(level)), scales)
            if clear is not None and clear >= CLEAR:
                return {KINETIC: bound, PACE: pace}
            bound, wider = bound * wider, wider * wider
            continue
        # Where the bound would be the least of itself, along a line.
        grows = (least - before[1]) / (bound - before[0]) if any(before) else 0.0
        before, bound = (bound, least), WIDER * ((least - grows * bound) / (1.0 - grows) if grows < 1.0 else least)
    motion.kinetic = None
    return {}


def bound_of_torque(
    motion: Held, level: float, angle: float, rate: float, rows: Array, limits: Mapping[str, float]
) -> dict[str, float] | None:
    """Return the numbers of a bound of what the law asks for because of state and momentum that seems to hold, with the
    limits of which it is a share; none where it asks for less than its limits anyway, clearly so or without a bound, and
    None where it does not. rows: what takes the torque to shares of its limits."""
    # The region of a tube says how much errors grow in it.
    region = motion.tube(motion.region(Fraction(level))).region
    command, each, sizes = motion.alone, np.linalg.norm(rows, axis=1), region.sizes
    beside = minus(motion.loop.u, command)
    besides = [felt(beside, letter, sizes) * motion.size(letter) for letter in "era"]
    most = 1.0 - float(motion.misread(region)[0] + sum(besides, Fraction(0))) * float(each.max())
    states = on_the_border(motion, level)
    torque = shares_of(motion, rows, command, states)
    if (largest := largest_of(*torque)) < FREE * most:
        return {}
    # On a set where it keeps to its limits its torque changes less than on the whole one.
    motion.commands = commanded(motion, {ASKED: Fraction(1)} | {name: Fraction(x) for name, x in limits.items()})
    tube = motion.tube(motion.region(Fraction(level)))
    rates, more, pushed = changing(motion, tube, command, kinds_of(command))
    speeds, paces = shares_of(motion, rows, rates, states), PACES / float(motion.h)
    rest = float((np.abs(rows) @ floats([more])[0] + each * float(pushed)).max())

    @cache
    def needed(place: int) -> float:
        pace = paces[place]
        return largest_of(*(p + rate / pace for p, rate in zip(torque, speeds, strict=True))) + rest / pace

    best = min(range(0, len(paces), COARSE), key=needed)
    # Just below the best pace much more is needed, and everywhere a sum of squares needs more than these states do.
    share, place = min(
        (max(map(needed, range(max(k - NEARBY, 0), k + 1))), k)
        for k in range(max(best - COARSE, 0), min(best + COARSE + NEARBY + 1, len(paces)))
    )
    pace = float(paces[place])
    share = max(share, at_first(motion, rows, angle, rate) * ROOM)
    # What the rest of the torque leaves, but for some room that it needs too.
    bound = {ASKED: (share + 2.0 * most) / 3.0, ASKED_PACE: pace, **limits}
    return bound if share < most else {} if largest < most else None


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
    """Return states of {V <= level}, as far as w.Jw is within its bound, that turn as fast there along some direction, many
    of them more or less back to the target, where most is asked for."""
    r = np.random.default_rng(1)
    along, axes = (v / np.linalg.norm(v, axis=0) for v in r.normal(size=(2, 3, STATES)))
    along[:, ::2] = (r.uniform(size=STATES) * along - axes)[:, ::2]
    along /= np.linalg.norm(along, axis=0)
    half, slow = r.uniform(0.0, np.pi / (1 + motion.even), STATES), None
    if motion.kinetic is not None:
        slow = floats(motion.loop.given) / float(motion.kinetic)
    states, inside = on_border(floats(motion.form(motion.s / 2)), motion.even, level, along, axes, half, slow)
    return {name: x[inside] for name, x in states.items()}


def at_first(motion: Held, rows: Array, angle: float, rate: float) -> float:
    """Return the largest share of a limit that the law asks for because of momentum and a state turned by up to an angle
    (rad) at up to a rate (rad/s)."""
    turned, names = np.linspace(0.0, min(angle, np.pi), TURNS), ("q0", *STATE[TURN], *STATE[RATE])
    command, most = motion.alone, 0.0
    for row, along in zip(rows, rows @ floats(motion.near.torque), strict=True):
        q, w = (x / (float(np.linalg.norm(x)) or 1.0) for x in (along[TURN], along[RATE]))
        states = [np.cos(turned / 2.0), *np.outer(q, np.sin(turned / 2.0)), *np.outer(rate * w, np.ones(TURNS))]
        most = max(most, largest_of(*shares_of(motion, row[None], command, dict(zip(names, states, strict=True)))))
    return most


def of_rate(p: Poly, states: Mapping[str, Array]) -> list[Array]:
    """Return the parts of a function of degree zero, one and two in the rate."""
    still, half, whole = (
        valued(p, {name: x * share if name[0] == "w" else x for name, x in states.items()}) for share in (0.0, 0.5, 1.0)
    )
    return [still, 4.0 * half - 3.0 * still - whole, 2.0 * (still + whole) - 4.0 * half]


def most_within(still: Array, linear: Array, square: Array) -> float:
    """Return the largest still + linear x + square x^2 for x from 0 to 1."""
    x = np.where(square < 0.0, np.clip(linear / np.maximum(-2.0 * square, 1e-300), 0.0, 1.0), 1.0)
    return float(np.maximum(still, still + linear * x + square * x * x).max())
