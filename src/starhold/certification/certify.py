"""All claims about one closed loop."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite, isinf
from typing import Any

import numpy as np

from starhold.algebra.operations import UnreadableError
from starhold.algebra.polynomial import Polynomial, constants, reciprocal
from starhold.algebra.vector import dot
from starhold.certification.assumptions import FRICTIONLESS, LINEAR, UNLIMITED, VALID_ESTIMATE, WHEELS
from starhold.certification.certificate import EXACT, NOT_SOUGHT, Certificate, Claim, Obligation
from starhold.certification.evidence.attitude import CONVERGES, NEARBY, SAMPLED, SLIDING, STRICTLY
from starhold.certification.evidence.detumbling import is_about
from starhold.certification.evidence.isotropic import ISOTROPIC
from starhold.certification.evidence.starts import POINTS
from starhold.certification.matrices import above
from starhold.certification.proofs import HELD_AND_PUSHED, appended, detumbled, pointed, proved_claims
from starhold.certification.subject import Subject, described, direction, exact_craft, make_subject
from starhold.certification.unmodelled import named
from starhold.errors import InputError
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import CLOCK, IS_VALID
from starhold.parts.effectors.wheels import gives_allocated_torque
from starhold.trace.straight_line import labelled


@dataclass(frozen=True)
class Wanted:
    """The claims to be made; by default the most that can be proved.

    rate: convergence from every attitude and rates up to this (rad/s; inf for any); turn: torque within its limit on every
    turn from rest up to this (rad); inertia_tolerance: the box; disturbance: norm of an unmodelled torque (N m); momentum:
    norm of the total angular momentum in claims about wheels (N m s), if absent that of the start; stored: what wheels store
    when a mode ends because of it (N m s); pointing: the pointing bound of the loop as it flies, which takes seconds, and is
    always claimed with a disturbance; begun: the rate (rad/s) at which its motions begin, if that is not the start's; alone:
    only that claim and the one with appendages; like: only that claim, with the start set and limits of another loop's."""

    rate: float | None = None
    slew_angle: float | None = None
    inertia_tolerance: float | None = None
    disturbance: float = 0.0
    momentum: float | None = None
    stored: float = inf
    pointing: bool = False
    begun: float | None = None
    alone: bool = False
    like: Claim | None = None


BEST = Wanted()
TIMED = "the law reads the time, of which no claim speaks"
REMEMBERS = "the law keeps a memory from call to call"
LOST = "the allocation relies on a lost wheel"
ASKEW = "the allocation takes wheels to be mounted otherwise than they are"
APART = "inertia, gains and period are too far apart in size"
ASSUMPTIONS = ("rigid-body", "inertia-as-given", "exact-measurement", "ideal-actuators")
"""Assumptions of all claims without a proof."""
INSTEAD = {
    "sliding": ("continuous-torque", UNLIMITED, "bounded-outside-torque"),
    "torque-limit": ("continuous-torque", "known-outside-torque"),
    "wheels": ("continuous-torque", FRICTIONLESS, "bounded-momentum", "known-outside-torque"),
    "inertia": ("continuous-torque", UNLIMITED, "no-outside-torque", "target-at-rest"),
    "detumbling": ("held-field", "rods-alike", "bounded-outside-torque"),
    "sampling": (LINEAR, UNLIMITED, "no-outside-torque"),
}
"""Further assumptions of claims, by kind."""
EVERYWHERE = {"rate_everywhere": None, "everything": True}


def certify(loop: ClosedLoop, name: str = "", wanted: Wanted = BEST) -> Certificate:
    """Certify a closed loop as it starts, whatever happens later. A law that keeps a memory or declares neither V nor a
    surface nor a single root gets a certificate without claims, which is undecided; so does a surface with wheels, and a
    loop that relies on a lost wheel. For a law that polynomials cannot follow the only claim is undecided, and names the
    operation and its line; likewise where numbers are too far apart in size for floating-point guesses."""
    subject = make_subject(loop, wanted.disturbance, wanted.momentum, wanted.stored)
    try:
        # What overflows in a guess is caught where the guess is verified.
        with np.errstate(all="ignore"):
            claims, unflown = _claims(subject, wanted)
    except UnreadableError as reason:
        # Nothing is known of such a law, whatever else was requested.
        unflown = str(reason)
        claims = [undecided("convergence", EVERYWHERE, subject, unflown)]
    except (OverflowError, ZeroDivisionError, np.linalg.LinAlgError) as reason:
        unflown = f"{APART}: {reason}"
        claims = [undecided("convergence", EVERYWHERE, subject, unflown)]
    kinds = [claim.kind for claim in claims]
    flown = any(claim.kind == "pointing" and claim.outcome == "proved" for claim in claims)
    key = "no_larger_start" if flown else "no_pointing"
    about = described(subject, kinds) | ({key: unflown} if flown or "pointing" not in kinds else {})
    return Certificate(name or loop.law.name, about, named(claims, loop, above(subject.total_momentum)))


def _claims(subject: Subject, wanted: Wanted) -> tuple[list[Claim], str]:
    """Return the claims, and why none of them is about the loop as it flies, if none is."""
    loop, claims = subject.loop, list[Claim]()
    if CLOCK in loop.law.reads:
        return [undecided("convergence", EVERYWHERE, subject, TIMED)], TIMED
    wheels = loop.wheels
    unsound = "" if wheels is None or gives_allocated_torque(wheels) else ASKEW if wheels.known_axes else LOST
    if loop.remembers:
        return _remembering(subject, wanted, unsound)
    unflown = unsound
    if not unflown and wanted.alone:
        claim, reason = pointed(subject, wanted.like, wanted.begun, wanted.inertia_tolerance)
        claims.append(claim or undecided("pointing", {"torque": wanted.disturbance}, subject, reason))
        claims += appended(subject) if wanted.like is None else []
    elif not unflown:
        pointing = wanted.pointing or wanted.disturbance > 0.0
        bounds = wanted.slew_angle, wanted.rate, wanted.inertia_tolerance
        proved, failed = proved_claims(subject, *bounds, pointing, wanted.begun)
        if loop.law.lyapunov is not None:
            claims.extend(_by_lyapunov(subject, wanted, proved, failed))
        else:
            if loop.law.hook("single_root") is not None:
                claims.append(proved.get("region") or undecided("region", {}, subject, failed[ISOTROPIC]))
            if loop.law.hook("surface") is not None and loop.wheels is None:
                torque = {"torque": [above(m + subject.disturbance) for m in subject.modelled]}
                claims.append(proved.get("sliding") or undecided("sliding", torque, subject, failed[SLIDING]))
            claims.extend(_unshown(subject, wanted, proved, "the law declares no V to show it with"))
        claims.extend(between_samples(subject, proved, failed))
        unflown = failed.get(POINTS, "no proof was found") if pointing else NOT_SOUGHT
        if "pointing" in proved:
            unflown = failed.get(POINTS, "")
        elif pointing and loop.wheels is not None:
            whose = "that of the start; certify.momentum states another" if wanted.momentum is None else "as stated"
            unflown += f", with a total momentum of up to {above(subject.total_momentum):.4g} N m s ({whose})"
        if "pointing" in proved or wanted.disturbance:
            claims.append(proved.get("pointing") or undecided("pointing", {"torque": wanted.disturbance}, subject, unflown))
        claims += [proved["appendages"]] if "appendages" in proved else []
    return claims, unflown


def _remembering(subject: Subject, wanted: Wanted, unsound: str) -> tuple[list[Claim], str]:
    """Return the claims about a loop whose law keeps a memory, and why none of them is about the loop as it flies."""
    loop, claims = subject.loop, list[Claim]()
    if loop.law.lyapunov is not None:
        claims.append(undecided("convergence", EVERYWHERE, subject, REMEMBERS))
    if is_about(loop):
        claim, reason = detumbled(subject)
        return [*claims, claim or undecided("detumbling", {}, subject, reason)], REMEMBERS
    plans = loop.law.hook("plan") is not None
    if unsound or not (wanted.pointing or wanted.alone or wanted.disturbance > 0.0):
        memory = loop.law.remember(loop.gains, loop.known, loop.period)
        return claims, unsound or (NOT_SOUGHT if plans or any(labelled("memory", memory)) else REMEMBERS)
    try:
        claim, reason = pointed(subject, wanted.like, wanted.begun, wanted.inertia_tolerance)
    except (UnreadableError, InputError):
        claim, reason = None, ""
    if claim is not None:
        return [*claims, claim], ""
    return claims, (reason if plans else f"{REMEMBERS}: {reason}") if reason else REMEMBERS


def between_samples(subject: Subject, proved: Mapping[str, Claim], failed: Mapping[str, str]) -> list[Claim]:
    """Return the claim about torque held between samples, proved or not."""
    if "sampling" not in proved:
        read(subject.loop)
    numbers = {"period": subject.loop.period, "longest": None, "every_shorter": False}
    return [proved.get("sampling") or undecided("sampling", numbers, subject, failed.get(SAMPLED, "no proof was found"))]


def _by_lyapunov(subject: Subject, wanted: Wanted, proved: Mapping[str, Claim], failed: Mapping[str, str]) -> list[Claim]:
    main, rate = proved.get("convergence"), wanted.rate
    reason = next((failed[name] for name in (STRICTLY, CONVERGES) if name in failed), "no proof was found")
    if main is not None and main.outcome == "proved" and rate is not None and not main.numbers["everything"]:
        reached = main.numbers["rate_everywhere"]
        if reached is None or reached < rate:
            shown = "on a set that does not contain every attitude" if reached is None else f"up to {reached:g} rad/s"
            main, reason = None, f"it is proved {shown} only"
    if main is None:
        read(subject.loop)
        everything = rate is None or isinf(rate)
        numbers = {"rate_everywhere": None if everything else rate, "everything": everything}
        main = undecided("convergence", numbers, subject, reason)
    limits = next((text for name, text in failed.items() if name.endswith("limits")), reason)
    others = [proved[kind] for kind in ("wheels", "torque-limit", "inertia") if kind in proved]
    return [main, *others, *_unshown(subject, wanted, proved, limits, failed.get(NEARBY, reason))]


def _unshown(
    subject: Subject, wanted: Wanted, proved: Mapping[str, Claim], reason: str, uncertain: str | None = None
) -> list[Claim]:
    """Yield requested claims that are not proved."""
    rate, turn, tolerance, loop = wanted.rate, wanted.slew_angle, wanted.inertia_tolerance, subject.loop
    requested: list[tuple[str, dict[str, Any], str]] = []
    if rate is not None and loop.law.lyapunov is None:
        numbers = {"rate_everywhere": None if isinf(rate) else rate, "everything": isinf(rate)}
        requested.append(("convergence", numbers, reason))
    limit, wheels = loop.craft.torque_limit, loop.wheels
    if wheels is not None:
        if turn is not None or (wanted.momentum is not None and loop.law.lyapunov is not None):
            requested.append(("wheels", {} if turn is None else {"slew_angle": turn}, reason))
    elif turn is not None and loop.limit != "none" and isfinite(limit):
        requested.append(("torque-limit", {"slew_angle": turn, "kind": loop.limit, "limit": limit}, reason))
    if tolerance is not None:
        requested.append(("inertia", {"tolerance": tolerance}, uncertain or reason))
    return [undecided(kind, numbers, subject, why) for kind, numbers, why in requested if kind not in proved]


def undecided(kind: str, numbers: dict[str, Any], subject: Subject, reason: str) -> Claim:
    """Return a claim that is undecided, with the reason."""
    besides = INSTEAD.get(kind, ("continuous-torque", UNLIMITED, "known-outside-torque"))
    assumptions = [*ASSUMPTIONS, *besides] + ["no-wheels"] * (kind == "sampling" and subject.loop.wheels is not None)
    if subject.loop.wheels is not None:
        assumptions = [WHEELS if name == UNLIMITED else name for name in assumptions]
    if kind == "pointing":
        assumptions = [*HELD_AND_PUSHED]
    if kind == "inertia":
        assumptions[1] = "inertia-near"
    if IS_VALID in subject.loop.law.reads:
        assumptions.append(VALID_ESTIMATE)
    return Claim(kind, numbers, {}, tuple(assumptions), (Obligation("form", EXACT, "undecided", {"reason": reason}),))


def read(loop: ClosedLoop) -> None:
    """Read the law with polynomials in place of numbers. UnreadableError, with the operation and its line, where they cannot
    follow it."""
    memory, craft = loop.law.remember(loop.gains, loop.known, loop.period), loop.known
    w, v, r, a, e, p, h, b = map(direction, "wvraephb")
    period: Any = Polynomial.constant(loop.period)
    measurement = Measurement(direction("q", 0, 4), w, v, r, a, e, p, period, h, b)
    q: Any = direction("q")
    with reciprocal(1 + dot(q, q), "z"):
        loop.law.command(
            measurement, constants(loop.gains), exact_craft(craft.inertia, craft.torque_limit, craft.gravity), memory
        )
