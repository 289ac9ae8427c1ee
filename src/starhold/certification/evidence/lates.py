"""Finds the weights of what comes late in a loop, beside V, and how late it is in the beginning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from math import isfinite
from typing import Any

import numpy as np

from starhold.certification.evidence.squares import rounded
from starhold.certification.evidence.terms import valued
from starhold.certification.matrices import floats
from starhold.kernel.follower import Late
from starhold.kernel.held import Held
from starhold.kernel.numbers import RefusedError
from starhold.kernel.regions import RATE, STATE, TURN
from starhold.parts import contract

DIGITS, STARTS, BEYOND = 7, 500, 1.02
"""The digits of numbers; how many starts are tried, and the margin for others."""
MARGINS = (1.05, 1.05, 1.05, 1.1)
"""By how much each bound of a part is larger than what follows from the one before."""
LEAST = 1.0 - 4e-6
"""How exactly it is known at least how late something is."""
WEIGHT = 0.9
"""The weight with which what is late costs V the least, where it does so by the product of two forms."""


def numbers_of(lates: Mapping[str, contract.Late]) -> dict[str, float]:
    """Return the numbers of a claim about what is late, before its weights are known."""
    by_kind = dict[str, dict[str, float]]()
    for kind, late in lates.items():
        by_kind[kind] = {"kept": late.kept, "mean": late.mean, "most": late.most, "weight": 1.0, "begun": 0.0, "rest": 0.0}
        if late.alike:
            by_kind[kind] |= {"kept.least": late.kept * LEAST, "mean.least": late.mean * LEAST}
    return {f"late.{kind}.{name}": x for kind, numbers in by_kind.items() for name, x in numbers.items() if isfinite(x)}


def of_lates(motion: Held) -> dict[str, Fraction]:
    """Return the numbers of a claim that are chosen for a motion."""
    chosen = {late.kind: {"weight": late.weight, "begun": late.begun, "rest": late.rest} for late in motion.lates}
    return {f"late.{kind}.{name}": x for kind, numbers in chosen.items() for name, x in numbers.items()}


def weighed(motion: Held, scales: Mapping[str, float]) -> list[Late]:
    """Return what is late with the weights with which it costs V about the least near the target, where rates and turns are
    of these sizes."""
    scale: Any = np.array([scales[name] for name in STATE])
    work = float(np.linalg.norm(floats(motion.felt) * scale, 2))
    weights = list[Fraction]()
    for one in motion.changes_in(motion.tube(motion.region((motion.s + motion.G[3][3]) / 2**20))):
        moved = float(np.linalg.norm(floats(one.M) * scale, 2))
        weights.append(rounded(WEIGHT * float(motion.h * one.share * one.late.mean) * work / moved, DIGITS))
    return [replace(late, weight=weight) for late, weight in zip(motion.lates, weights, strict=True)]


def begun_late(motion: Held, turn: float, rate: float) -> list[Late]:
    """Return what is late with how late it is at the start, from up to a turn (the sine of half the angle) and a rate
    (rad/s): a torque that begins with none is off by what the law asks for."""
    r, names = np.random.default_rng(1), ["q0", *STATE[TURN], *STATE[RATE]]
    along, axes = (v / np.linalg.norm(v, axis=0) for v in r.normal(size=(2, 3, STARTS)))
    x = dict(zip(names, (np.full(STARTS, np.sqrt(max(1.0 - turn**2, 0.0))), *(turn * axes), *(rate * along)), strict=True))
    around = {name: float(most) * r.choice((-1.0, 1.0), STARTS) for name, most in motion.others.items()}
    torques = [valued(p, x | around) for p in motion.loop.u] if motion.lates else [0.0]
    begun = rounded(float(np.linalg.norm(torques, axis=0).max()) * BEYOND, DIGITS)
    return [replace(late, begun=begun) if late.kind == "torque" else late for late in motion.lates]


def resting(motion: Held, level: float) -> list[Late]:
    """Return what is late with what its part that no weight pays for is at most in {V <= level}; where that is not bounded,
    with none."""
    unrested = motion.lates = [replace(late, rest=Fraction(0)) for late in motion.lates]
    try:
        for more in MARGINS if unrested else ():
            tube = motion.tube(motion.region(Fraction(level)))
            rests = [rounded(float(one.settled(tube, False)) * more, DIGITS) for one in motion.changes_in(tube)]
            motion.lates = [replace(late, rest=rest) for late, rest in zip(motion.lates, rests, strict=True)]
    except RefusedError:
        return unrested
    return motion.lates
