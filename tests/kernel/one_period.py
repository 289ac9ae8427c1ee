"""Loops whose pushes are stated, and what a period does to states of a set."""

import copy
import math
from fractions import Fraction

import numpy as np

from starhold.certification.evidence.finding import read
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Account
from tests.kernel.certificates import POINTING, flying
from tests.kernel.flights import Fleet, feedback, moved


def fleet_of(name, outside, error):
    """Lanes of a loop under other pushes."""
    (J, k_rate, k_attitude, h), _ = POINTING[name]
    J = np.diag(J) if np.ndim(J) == 1 else np.array(J)
    slow = math.sqrt(k_attitude / 2 / np.linalg.eigvalsh(J).max())
    return Fleet(J, feedback(J, k_rate, k_attitude), h, outside, error, slow)


def held_loop(name, **more):
    """A loop with a held torque, whose pushes may be others than claimed."""
    claim, Account.left = copy.deepcopy(flying(name).claims[0]), 10**12
    claim["numbers"] |= {key: str(Fraction(x)) for key, x in more.items()}
    return Held(AttitudeLoop(read(claim, flying(name).by_digest)))


def states_of(oracle, level, count):
    """States inside of {V <= level}, most of them at its border."""
    oracle.numbers["level"] = level
    pairs = [oracle.border(0.0, level * oracle.rng.uniform()) for _ in range(count)]
    return [np.array(part).T for part in zip(*pairs, strict=True)]


def after_a_period(fleet, q, w, unit, per_rate=0.0):
    """The state after a period in which the error points one way, and the outside torque, which grows with the rate, turns
    over at a time of its own."""
    command, turned = fleet.law(q, w) + fleet.error * unit, fleet.rng.uniform()
    for share, sign in ((turned, 1), (1 - turned, -1)):
        for _ in range(4):
            torque = command + sign * (fleet.outside + per_rate * np.linalg.norm(w, axis=0)) * unit
            q, w = moved(fleet.J, fleet.inverse, q, w, torque, share * fleet.h / 4)
    return q, w
