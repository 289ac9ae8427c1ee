"""The claim that a law takes over every motion that another one hands to it: where that one ends, by the condition of the
switch, lies in the set from which this one brings the body to rest on target."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import numpy as np
from flint import arb

from starhold.algebra.polynomial import UnreadableError, exact
from starhold.certification.certificate import BALLS, Certificate, Claim
from starhold.certification.convergence import Basin, Obligations, assumed, converge, reached
from starhold.certification.limits import needed
from starhold.certification.matrices import greatest, number
from starhold.certification.openness import READ, named
from starhold.certification.sampling import sampling
from starhold.certification.subject import above, below, described, described_target, make_subject, upper
from starhold.laws.modes import ENDS
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.effectors.wheels import gives_allocated_torque

ROUNDING = 2.0**-45
"""Share by which a rate or an angle that a law computes is off at most, for angles up to `WIDEST`."""
WIDEST = 3.0
"""Angles (rad) up to which sines tell them apart."""


def hand_over(loop: ClosedLoop, before: ClosedLoop, name: str, levels: Mapping[str, float]) -> Certificate | None:
    """The certificate of the loop of the law that takes over from the loop before. levels: the tests of the switch, in
    rad/s and rad. None where no V shows from where the motions of this loop end on target, or where that is not everywhere
    and nothing bounds the rate."""
    if loop.remembers or loop.law.lyapunov is None or not (loop.wheels is None or gives_allocated_torque(loop.wheels)):
        return None
    subject = make_subject(loop)
    target, last = described_target(loop), described_target(before)
    rate, angle = _ends(levels, last, target)
    try:
        with np.errstate(all="ignore"):
            basins = [basin for basin in converge(subject)[1:] if basin is not None]
    except (UnreadableError, OverflowError, ZeroDivisionError, np.linalg.LinAlgError):
        return None
    if not basins:
        return None
    rate = None if rate is None else above(exact(rate * (1.0 + ROUNDING)))
    told = angle is not None and angle <= WIDEST and (basins[0].frame.potential.even or loop.sign_policy == "shortest")
    angle = above(exact(angle * (1.0 + ROUNDING))) if told and angle is not None else None
    if rate is None and all(basin.start is not None for basin in basins):
        return None
    share, basin = max(((_share(basin, rate, angle), basin) for basin in basins), key=lambda found: found[0] is not None)
    sampled = sampling(basin.motion)
    claims = needed([_claim(basin, rate, angle, share)], basin.motion) + ([] if sampled is None else [sampled])
    switch = {"levels": {test: levels[test] for test in ENDS if test in levels}, "before": last, "after": target}
    return Certificate(name, {**described(subject), "switch": switch}, named(claims, loop))


def _ends(levels: Mapping[str, float], before: Any, after: Any) -> tuple[float | None, float | None]:
    """Rate and angle, relative to the target of the next mode, up to which the tests of a switch hold; None for no bound."""
    # Of other targets the description does not hold all.
    same = before == after and after["target"] in READ["target"]
    still = after["target"] == "inertial"
    rates = [levels.get("rate_below")] if same or (still and before["target"] == "inertial") else []
    rates += [levels.get("body_rate_below")] if still else []
    bounds = [rate for rate in rates if rate is not None]
    return min(bounds, default=None), levels.get("angle_below") if same else None


def _claim(basin: Basin, rate: float | None, angle: float | None, share: float | None) -> Claim:
    before, witness = reached(basin, basin.stay)
    found, start = Obligations(before), basin.start
    reason = {"reason": "it reaches beyond the region of convergence"}
    found.add(INSIDE, BALLS, True if share is not None else None, {} if share is not None else reason)
    numbers = {
        "level": None if basin.stay is None else number(basin.stay),
        "start": None if start is None else number(start),
        "everything": start is None,
        "rate": rate,
        "angle": angle,
    }
    witness["attitude_level"] = None if start is None else share
    return Claim("hand-over", numbers, witness, assumed(basin.motion.subject), tuple(found))


INSIDE = "holds what is handed over"


def _share(basin: Basin, rate: float | None, angle: float | None) -> float | None:
    """A part of the level that the attitude may take up, the rest being enough for the rate; None where there is none."""
    start, potential = basin.start, basin.frame.potential
    if start is None:
        return 0.0
    if rate is None:
        return None
    left = below(start - greatest(basin.frame.P) * exact(rate) ** 2 / 2)
    return left if left > 0.0 and exact(left) >= _highest(basin, angle, potential) else None


def _highest(basin: Basin, angle: float | None, potential: Any) -> Any:
    """A bound of the attitude's part of V up to an angle."""
    shorter = basin.motion.subject.loop.sign_policy == "shortest"
    if angle is None or angle >= pi:
        return potential.top / 2 if shorter and not potential.even else potential.top
    sine = (arb(angle) / (2 if potential.even else 4)).sin()
    return potential.top * upper(sine * sine)
