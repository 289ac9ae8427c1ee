"""The claim that a law takes over every motion that another one hands to it: the states at the switch, by its condition, lie
in the region from which this law brings the body to rest on target."""

from collections.abc import Mapping
from math import inf
from typing import TypeAlias

from starhold.certification.certificate import Certificate, Claim
from starhold.certification.certify import between_samples, undecided
from starhold.certification.matrices import above
from starhold.certification.proofs import taken_over
from starhold.certification.subject import described, make_subject
from starhold.certification.target_motion import motion_of
from starhold.certification.unmodelled import is_read, named
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import AT_REST
from starhold.parts.effectors.wheels import gives_allocated_torque
from starhold.parts.part import same_numbers

Ends: TypeAlias = tuple[float | None, float | None]
"""Rate (rad/s) and angle (rad) up to which a switch hands over; None for no bound."""
ROUNDING = 2.0**-45
"""The largest relative error of a rate or an angle that a law computes, for angles up to `WIDEST`."""
TESTS = {"rate_below": "rate_error", "body_rate_below": "rate_error", "angle_below": "attitude_error"}
"""The tests of a switch that bound a rate or an angle, with the error in a claim of what they look at."""
WIDEST = 3.0
"""The largest angle (rad) that its sine determines."""


def hand_over(loop: ClosedLoop, before: ClosedLoop, name: str, levels: Mapping[str, float]) -> Certificate | None:
    """Return the certificate of the loop that takes over from the previous loop. levels: the tests of the switch, in rad/s
    and rad. None where no V gives a region of attraction of this loop, or where that is bounded and nothing bounds the rate.
    """
    if loop.remembers or loop.law.lyapunov is None or not (loop.wheels is None or gives_allocated_torque(loop.wheels)):
        return None
    subject, (rate, angle) = make_subject(loop), ends(levels, before, loop)
    loop_claims = taken_over(subject, rate, angle)
    if loop_claims is None:
        return None
    proved, failed = loop_claims
    beyond = undecided("hand-over", {"rate": rate, "angle": angle}, subject, "it reaches beyond the region of convergence")
    claims = [proved.get("hand-over", beyond), *between_samples(subject, proved, failed)]
    return Certificate(name, described(subject), named(claims, loop))


def flown_ends(
    levels: Mapping[str, float], before: ClosedLoop, after: ClosedLoop, last: Claim | None, claim: Claim | None
) -> tuple[float, float]:
    """Return the rate and angle, relative to the target of the next mode, up to which a switch hands over as the loop flies;
    inf for no bound. last: the claim of the mode before, if that has settled; claim: that of the next mode, which has the
    errors of what the tests look at."""
    errors = {name: 0.0 if claim is None else claim.numbers[error] for name, error in TESTS.items()}
    errors["rate_below"] += 0.0 if claim is None else misjudged(before, claim)
    tested = {name: x + errors[name] for name, x in levels.items() if name in TESTS}
    settled = {} if last is None else {"rate_below": last.numbers["rate"], "angle_below": last.numbers["angle"]}
    reached = [[inf if x is None else x for x in ends(condition, before, after)] for condition in (tested, settled)]
    rate, angle = map(min, zip(*reached, strict=True))
    return rate, angle


def misjudged(loop: ClosedLoop, claim: Claim) -> float:
    """Return the largest error of the target's rate (rad/s) that a law uses: it receives the target's rotation in body axes,
    with the attitude errors of a claim."""
    off = (motion_of(loop) or AT_REST).off_rate
    return claim.numbers["attitude_error"] * above(make_subject(loop).target_rate) + off


def ends(levels: Mapping[str, float], before: ClosedLoop, after: ClosedLoop) -> Ends:
    """Return the rate and angle, relative to the target of the next mode, up to which the tests of a switch hold, allowing
    for rounding; None for no bound."""
    one, other = before.target, after.target
    same = is_read(before, one) and one.part == other.part and same_numbers(one.params, other.params)
    turns = [above(make_subject(loop).target_rate) if is_read(loop, loop.target) else inf for loop in (before, after)]
    tests = {"rate_below": 0.0 if same else sum(turns), "body_rate_below": turns[1]}
    rate = min((levels[name] + turn for name, turn in tests.items() if name in levels and turn < inf), default=None)
    angle = levels.get("angle_below") if same else None
    return (
        None if rate is None else rate * (1.0 + ROUNDING),
        None if angle is None or angle > WIDEST else angle * (1.0 + ROUNDING),
    )
