"""Compares the programs and numbers of a proof with those of a loop that flies."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from math import inf, isfinite
from typing import Any

from starhold.algebra.polynomial import exact
from starhold.certification.evidence.appendages import APPENDED
from starhold.certification.evidence.attitude import ANY_ANGLE, CONVERGES, SAMPLED, SLIDING, STRICTLY, Loop
from starhold.certification.evidence.detumbling import DETUMBLES, bounds_of
from starhold.certification.evidence.finding import NotFoundError
from starhold.certification.evidence.plans import told_of
from starhold.certification.evidence.recorded import sign_words
from starhold.certification.evidence.refuted import REFUTING
from starhold.certification.evidence.starts import POINTS
from starhold.certification.evidence.station import Station
from starhold.certification.hand_over import Ends
from starhold.certification.matrices import above, fraction
from starhold.certification.measured import driven_errors
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import (
    GROWING,
    Pushes,
    change_of_modelled,
    gaussian_vectors,
    late_torque,
    samples_of,
)
from starhold.kernel.follower import KNOWN, LATE
from starhold.kernel.held import CHANGE
from starhold.kernel.loops import HANDED, HYSTERESIS, OUTSIDE, SHORTEST, TOLD_TORQUE, WHEELS
from starhold.kernel.numbers import RefusedError, rational
from starhold.kernel.plans import PLANNED
from starhold.kernel.theorems.noise import BESIDE, DEVIATION, VECTORS
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import DEVIATIONS, Late
from starhold.parts.effectors.wheel_motion import at_top_speed
from starhold.parts.effectors.wheels import BAND, gives_allocated_torque

BOUNDED = (POINTS, APPENDED)
"""The theorems about loops with pushes that are bounded."""
ALMOST = Fraction(1, 10**9)
"""The relative margin for the field along an orbit, which is computed in floats."""


def differences(claim: Mapping[str, Any], loop: ClosedLoop, ends: Ends | None = None) -> list[str]:
    """Return how a claim, which the kernel has checked, differs from this loop, or covers less than another mode hands over,
    up to its ends; empty where it does not."""
    recorded = Loop(make_subject(loop))
    apart = [*_programs(claim, recorded.roles, recorded.subject)]
    if claim["theorem"] == DETUMBLES:
        return [*apart, *_of_detumbling(claim, recorded)]
    apart += [*_numbers(claim, recorded), *_planned(claim, recorded)]
    return [*apart, *_words(claim, recorded), *_handed_over(claim, ends)]


def station_differences(claim: Mapping[str, Any], loop: ClosedLoop) -> list[str]:
    """Return the same for a claim about keeping a craft near a libration point."""
    expected, limit = Station(loop).claim(claim["theorem"]), loop.saturation_limit()
    kinds = {"limit.axis": "axis", "limit.norm": "norm", "limit": "axis"}
    numbers = {kinds[name]: rational(x) for name, x in claim["numbers"].items() if name in kinds}
    other = any(kind != loop.limit or not isfinite(limit) or x != Fraction(limit) for kind, x in numbers.items())
    return [*_programs(claim, expected["programs"], expected["subject"]), *["the limit differs"] * other]


def _of_detumbling(claim: Mapping[str, Any], recorded: Loop) -> Iterator[str]:
    try:
        # Torques that grow with the rate do so up to the largest one of the claim.
        words, numbers = bounds_of(recorded.known, above(rational(claim["numbers"]["rate.0"])))
    except NotFoundError as reason:
        yield str(reason)
        return
    if claim["taken"] != words:
        yield "only one of the two has wheels"
    # All other numbers are about the body's inertia, which the kernel compares.
    sides = {"dipole.limit": -1, "field.least": -1, "limit": -1} | dict.fromkeys(
        ("field.change", "outside", "outside.across", "stored"), 1
    )
    for name, side in sides.items():
        if name in numbers and name not in claim["numbers"]:
            yield f"{name} is not stated"
        elif name in numbers and side * rational(claim["numbers"][name]) < side * Fraction(numbers[name]) * (
            1 - side * ALMOST
        ):
            yield f"{name} is exceeded" if side > 0 else f"{name} is lower"


def _programs(claim: Mapping[str, Any], programs: Mapping[str, str], subject: Mapping[str, str]) -> Iterator[str]:
    # A theorem refuses a claim that lacks a program which it is about.
    for role, digest in programs.items():
        if claim["programs"].get(role, digest) != digest:
            yield f"the program of the {role} differs"
    if "motion" in claim["programs"] and "motion" not in programs:
        yield "there are no appendages"
    for name, x in claim["subject"].items():
        if name not in subject or rational(subject[name]) != rational(x):
            yield f"{name} is another number"


def _numbers(claim: Mapping[str, Any], recorded: Loop) -> Iterator[str]:
    loop, known, wheels = recorded.loop, recorded.known, recorded.loop.wheels
    numbers = {name: rational(x) for name, x in claim["numbers"].items()}
    # A larger limit than the loop's refutes more; an external torque is the requested one.
    side = -1 if claim["theorem"] in REFUTING else 1
    exactly = {"period": loop.period, "hysteresis": loop.hysteresis_width}
    least: dict[str, Any] = {f"outside.{k}": m for k, m in enumerate(known.modelled)}
    least |= {"target.rate": known.target_rate, "target.acceleration": known.target_acceleration}
    if "share" in numbers and (driven := driven_errors(loop)) is not None:
        exactly |= {"samples": samples_of(loop), "every": driven.recursion.every, BESIDE: DEVIATIONS}
        exactly[VECTORS] = gaussian_vectors(loop)
        numbers |= {} if VECTORS in numbers or BESIDE not in numbers else {VECTORS: Fraction(1)}
    if claim["theorem"] in BOUNDED:
        known = replace(known, tolerance=above(numbers["tolerance"]) if "tolerance" in numbers else None)
        envelope = known.envelope(BESIDE in numbers)._replace(momentum=above(numbers.get("momentum", Fraction(0))))
        # Where a claim does not include what grows as the body moves, the parts are left out by name.
        known = replace(known, lags=not numbers.keys().isdisjoint(GROWING))
        pushed = known.against(envelope).numbers
        if "share" in numbers and (driven := driven_errors(loop)) is not None:
            pushed[DEVIATION] = driven.torque
        if not numbers.keys().isdisjoint(CHANGE):
            # Without both, a torque may reverse at once.
            numbers = dict.fromkeys(CHANGE, Fraction(0)) | numbers
            pushed |= dict(zip(CHANGE, change_of_modelled(loop, envelope), strict=True))
        yield from _late(numbers, late_torque(loop))
        yield from (f"{name} has no bound" for name, x in pushed.items() if not isfinite(x))
        least |= {name: exact(x) for name, x in pushed.items() if isfinite(x)}
        if "outside" in least and OUTSIDE not in claim["taken"]:
            least["outside"] += known.modelled_norm
        # What is not stated is zero.
        numbers = dict.fromkeys((*Pushes(0.0).numbers, DEVIATION), Fraction(0)) | numbers
    wheeled = any(name.startswith(("motors", "stored")) for name in numbers)
    limit = float(loop.saturation_limit() if wheeled else loop.craft.torque_limit)
    most = {"limit": limit, "limit.norm": limit}
    if wheels is not None:
        most |= {f"motors.{k}": x for k, x in enumerate(at_top_speed(wheels).torque_limit)}
        most |= {f"stored.{k}": x * (1.0 - BAND) for k, x in enumerate(wheels.momentum_limit)}
    for name, x in numbers.items():
        if name in exactly and x != Fraction(exactly[name]):
            yield f"the {name} differs"
        if name in least and side > 0 and x < fraction(least[name]):
            yield f"{name} is exceeded"
        if name in most and isfinite(most[name]) and side * x > side * Fraction(most[name]):
            yield f"{name} is lower"
    # A norm within the limit is within it about each axis, and not the other way round.
    name, kind = ("limit", "norm") if side > 0 else ("limit.norm", "axis")
    if name in numbers and loop.limit == kind:
        yield "the limit is one of another kind"
    if wheeled:
        if loop.limit != "none" and isfinite(most["limit"]) and numbers.keys().isdisjoint(("limit", "limit.norm")):
            yield "the limit is not stated"
        yield from (
            f"{name} is not stated"
            for name, x in most.items()
            if "." in name and name[0] in "ms" and isfinite(x) and name not in numbers
        )


def _late(numbers: Mapping[Any, Fraction], late: Late | None) -> Iterator[str]:
    stated = {name.removeprefix(LATE): x for name, x in numbers.items() if name.startswith(LATE)}
    if not stated:
        return
    if late is None:
        yield "its torque is not late"
        return
    for k, name in enumerate(KNOWN):
        x, least = getattr(late, name), stated.get(f"{name}.least")
        off = least is not None and (late.moment is None or least > fraction(late.least[k]))
        if off or (name in stated and stated[name] < fraction(x)):
            yield "its torque is late otherwise"
    if isfinite(late.most) and ("most" not in stated or stated["most"] > fraction(late.most)):
        yield "its torque is late otherwise where it is further off"


def _planned(claim: Mapping[str, Any], recorded: Loop) -> Iterator[str]:
    plan = recorded.plan
    if plan is None or claim["theorem"] != POINTS:
        if PLANNED in claim["taken"]:
            yield "its law does not plan"
        return
    if PLANNED not in claim["taken"]:
        yield "the law plans its moves"
    yield from (
        f"{name} is not stated" for name in recorded.subject if name.startswith("plan.") and name not in claim["subject"]
    )
    try:
        numbers, _ = told_of(recorded, plan)
    except RefusedError as reason:
        yield str(reason)
        return
    for name in ("plan.gap", "plan.stiffness"):
        if rational(claim["numbers"].get(name, "0")) < fraction(numbers[name]):
            yield f"{name} is exceeded"


def _handed_over(claim: Mapping[str, Any], ends: Ends | None) -> Iterator[str]:
    if HANDED not in claim["taken"]:
        return
    if ends is None:
        yield "no mode hands over to it"
        return
    rate, angle = ends
    # The sign of the quaternion matters except for these.
    either = SHORTEST in claim["taken"] or "both" in claim["theorem"]
    least = {"rate": inf if rate is None else rate, "angle": angle if angle is not None and either else ANY_ANGLE}
    for name, most in least.items():
        claimed = claim["numbers"].get(f"start.{name}")
        if claimed is not None and rational(claimed) < most:
            yield f"the previous mode may end with a larger {name}"


def _words(claim: Mapping[str, Any], loop: Loop) -> Iterator[str]:
    taken, theorem = set(claim["taken"]), claim["theorem"]
    if theorem in REFUTING:
        return
    signed = theorem in (SLIDING, STRICTLY, POINTS, APPENDED) or (theorem.startswith(CONVERGES) and "both" not in theorem)
    if taken & {SHORTEST, HYSTERESIS} != set(sign_words(loop.loop) if signed else []):
        yield "the sign of the quaternion is chosen in another way"
    if theorem != SAMPLED and (WHEELS in taken) != (loop.loop.wheels is not None):
        yield "only one of the two has wheels"
    if theorem in BOUNDED and OUTSIDE not in taken and any(loop.known.modelled) and loop.is_told(TOLD_TORQUE):
        yield "its law is given a torque from outside"
    if WHEELS in taken and loop.loop.wheels is not None and not gives_allocated_torque(loop.loop.wheels):
        yield "its wheels do not give the torque that is allocated to them"
