"""From where a claim about the loop that flies is sought: the rate of the loop's start, its stiffness, and sound sets."""

from fractions import Fraction
from itertools import takewhile
from typing import Any

import numpy as np

from starhold.certification.assumptions import as_it_starts
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import NotFoundError, evidence, read
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.near import near_target
from starhold.kernel.numbers import RefusedError
from starhold.kernel.theorems.pointing import points
from starhold.loop.closed_loop import ClosedLoop

POINTS = "points"


def start_rate(loop: ClosedLoop) -> float:
    """Return the rate (rad/s), relative to its target, at which a loop starts."""
    return float(np.linalg.norm(as_it_starts(loop).rate))


def begins(loop: Loop, claim: dict[str, Any], scales: dict[str, float]) -> bool:
    """Return whether the set of a claim without levels is sound, and the torque keeps its limits on it."""
    try:
        shown = points(read(claim | {"numbers": claim["numbers"] | {"highest": "0"}}, loop.by_digest))
        wanted = dict(takewhile(lambda one: one[0] != "V between samples", shown))
        for name in wanted:
            evidence(name, wanted, scales)
    except (NotFoundError, RefusedError) as reason:
        loop.failed[POINTS] = str(reason)
        return False
    return True


def feedback(loop: AttitudeLoop) -> float:
    """Return the stiffness of the law near rest, a third of its trace."""
    return -float(sum(row[3 + k] for k, row in enumerate(near_target(loop, Fraction(0)).torque))) / 3.0
