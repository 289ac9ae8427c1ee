"""The claim that a law takes over every motion that another one hands to it: the states at the switch, by its condition, lie
in the region from which this law brings the body to rest on target."""

from collections.abc import Mapping
from typing import TypeAlias

from starhold.certification.certificate import Certificate
from starhold.certification.certify import between_samples, undecided
from starhold.certification.proofs import taken_over
from starhold.certification.subject import described, described_target, make_subject
from starhold.certification.unmodelled import READ, named
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.effectors.wheels import gives_allocated_torque

Ends: TypeAlias = tuple[float | None, float | None]
"""Rate (rad/s) and angle (rad) up to which a switch hands over; None for no bound."""
ROUNDING = 2.0**-45
"""The largest relative error of a rate or an angle that a law computes, for angles up to `WIDEST`."""
WIDEST = 3.0
"""The largest angle (rad) that its sine determines."""


def hand_over(loop: ClosedLoop, before: ClosedLoop, name: str, levels: Mapping[str, float]) -> Certificate | None:
    """Return the certificate of the loop that takes over from the previous loop. levels: the tests of the switch, in rad/s
    and rad. None where no V gives a region of attraction of this loop, or where that is bounded and nothing bounds the rate.
    """
    if loop.remembers or loop.law.lyapunov is None or not (loop.wheels is None or gives_allocated_torque(loop.wheels)):
        return None
    subject, (rate, angle) = make_subject(loop), ends(levels, before, loop)
    found = taken_over(subject, rate, angle)
    if found is None:
        return None
    proved, failed = found
    beyond = undecided("hand-over", {"rate": rate, "angle": angle}, subject, "it reaches beyond the region of convergence")
    claims = [proved.get("hand-over", beyond), *between_samples(subject, proved, failed)]
    return Certificate(name, described(subject), named(claims, loop))


def ends(levels: Mapping[str, float], before: ClosedLoop, after: ClosedLoop) -> Ends:
    """Return the rate and angle, relative to the target of the next mode, up to which the tests of a switch hold, allowing
    for rounding; None for no bound."""
    last, target = described_target(before), described_target(after)
    # For other targets the description is incomplete.
    same = last == target and target["target"] in READ["target"]
    still = target["target"] == "inertial"
    rates = [levels.get("rate_below")] if same or (still and last["target"] == "inertial") else []
    rates += [levels.get("body_rate_below")] if still else []
    rate = min((rate for rate in rates if rate is not None), default=None)
    angle = levels.get("angle_below") if same else None
    return (
        None if rate is None else rate * (1.0 + ROUNDING),
        None if angle is None or angle > WIDEST else angle * (1.0 + ROUNDING),
    )
