"""Finds the weight of a late torque's error beside V, and how late the torque is at the start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from math import ceil, floor, isfinite
from typing import Any

import numpy as np

from starhold.certification.evidence.squares import rounded
from starhold.certification.evidence.terms import valued
from starhold.certification.matrices import floats
from starhold.kernel.follower import KNOWN, LATE, Late
from starhold.kernel.held import Held
from starhold.kernel.numbers import RefusedError
from starhold.kernel.regions import RATE, STATE, TURN
from starhold.parts import contract

DIGITS, STARTS, BEYOND = 7, 500, 1.02
"""The digits of numbers; how many starts are tried, and the margin for others."""
MARGINS = (1.05, 1.05, 1.05, 1.1)
"""The factors by which the bound of each part exceeds what follows from the one before."""
LEAST, FINE = 1.0 - 3e-6, 1 << 30
"""The margin of numbers that other machines may round otherwise, and the denominator of shares."""
WEIGHT, SLIGHTEST = 0.9, Fraction(1 << 60)
"""The weight at which a late torque costs V the least, where its cost is the product of two forms; and one at which it is
negligible on a level."""


def numbers_of(late: contract.Late | None) -> dict[str, Any]:
    """Return the numbers of a claim about a late torque, before its weight is known."""
    if late is None:
        return {}
    numbers = {"kept": late.kept, "mean": late.mean, "most": late.most, "weight": 1.0, "begun": 0.0, "rest": 0.0}
    claimed: dict[str, Any] = {LATE + name: x for name, x in numbers.items() if isfinite(x)}
    for name, (most, least) in zip(KNOWN, alike(late), strict=True) if late.moment is not None else ():
        claimed |= {LATE + name: most, f"{LATE}{name}.least": least}
    return claimed


def alike(late: contract.Late) -> list[tuple[Fraction, Fraction]]:
    """Return upper and lower bounds, in short numbers, of the lag of a torque that approaches the command alike in all
    components: at the end of a period, in the mean, and in the mean weighted by the remaining time."""
    shares = [(float(getattr(late, name)), least) for name, least in zip(KNOWN, late.least, strict=True)]
    return [(Fraction(ceil(x * FINE), FINE), Fraction(floor(y * LEAST * FINE), FINE)) for x, y in shares]


def of_late(late: Late | None) -> dict[str, Fraction]:
    """Return the numbers of a claim that are chosen for a motion."""
    return {LATE + name: getattr(late, name) for name in ("weight", "begun", "rest") if late is not None}


def weighed(motion: Held, scales: Mapping[str, float]) -> Late | None:
    """Return how late the torque is, with the weight at which it costs V about the least near the target, where rates and
    turns are of these sizes."""
    scale: Any = np.array([scales[name] for name in STATE])
    if motion.late is None:
        return None
    # A late torque is negligible there.
    motion.late = replace(motion.late, weight=SLIGHTEST)
    change = motion.change_in(motion.tube(motion.region((motion.s + motion.G[3][3]) / 2**20)))
    assert change is not None
    work, moved = (float(np.linalg.norm(floats(rows) * scale, 2)) for rows in (motion.felt, change.M))
    return replace(motion.late, weight=rounded(WEIGHT * float(motion.h * motion.late.mean) * work / moved, DIGITS))


def begun_late(motion: Held, turn: float, rate: float) -> Late | None:
    """Return how late the torque is at the start, from up to a turn (the sine of half the angle) and a rate (rad/s): if it
    begins with none, its error is the command."""
    if motion.late is None:
        return None
    r, names = np.random.default_rng(1), ["q0", *STATE[TURN], *STATE[RATE]]
    along, axes = (v / np.linalg.norm(v, axis=0) for v in r.normal(size=(2, 3, STARTS)))
    x = dict(zip(names, (np.full(STARTS, np.sqrt(max(1.0 - turn**2, 0.0))), *(turn * axes), *(rate * along)), strict=True))
    around = {name: float(most) * r.choice((-1.0, 1.0), STARTS) for name, most in motion.others.items()}
    torques = [valued(p, x | around) for p in motion.loop.u]
    return replace(motion.late, begun=rounded(float(np.linalg.norm(torques, axis=0).max()) * BEYOND, DIGITS))


def resting(motion: Held, level: float) -> Late | None:
    """Return how late the torque is, with a bound over {V <= level} of the part of its error that no weight pays for;
    without that part where it is not bounded."""
    if motion.late is None:
        return None
    late = unrested = motion.late = replace(motion.late, rest=Fraction(0))
    try:
        for more in MARGINS:
            tube = motion.tube(motion.region(Fraction(level)))
            if change := motion.change_in(tube):
                late = motion.late = replace(late, rest=rounded(float(change.settled) * more, DIGITS))
    except RefusedError:
        return unrested
    return late
