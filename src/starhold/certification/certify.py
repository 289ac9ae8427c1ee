"""All claims about one closed loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite, isinf
from typing import Any

import numpy as np

from starhold.algebra.polynomial import UnreadableError
from starhold.certification.certificate import EXACT, Certificate, Claim, Obligation
from starhold.certification.convergence import assumed, converge
from starhold.certification.evidence.attitude import SAMPLED, SLIDING
from starhold.certification.evidence.isotropic import ISOTROPIC
from starhold.certification.evidence.pointing import POINTS
from starhold.certification.inertia import inertia_box, told
from starhold.certification.limits import needed, torque_limit
from starhold.certification.motion import Motion
from starhold.certification.openness import named
from starhold.certification.proofs import HELD_AND_PUSHED, proved_claims
from starhold.certification.sampling import APART, sampling
from starhold.certification.saturation import FREE, saturation
from starhold.certification.subject import Subject, above, described, make_subject
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.effectors.wheels import gives_allocated_torque


@dataclass(frozen=True)
class Wanted:
    """The claims to be made; by default the most that can be proved.

    rate: convergence from every attitude and rates up to this (rad/s; inf for any); turn: torque within its limit on every
    turn from rest up to this (rad); inertia_tolerance: the box; disturbance: norm of a torque nobody models (N m);
    momentum: norm of the total angular momentum in claims about wheels (N m s), if absent that of the start.
    """

    rate: float | None = None
    slew_angle: float | None = None
    inertia_tolerance: float | None = None
    disturbance: float = 0.0
    momentum: float | None = None


BEST = Wanted()


def certify(loop: ClosedLoop, name: str = "", wanted: Wanted = BEST) -> Certificate:
    """The certificate of a closed loop as it starts, whatever happens to it later. A law that keeps a memory or declares
    neither V nor a surface nor a single root gets one without claims, which is undecided; so does a surface with wheels, and
    a loop that counts on a lost wheel. Of a law that polynomials cannot follow the one claim is undecided, and names the
    operation and its line; so it is where numbers are too far apart in size for floats to guess with."""
    subject = make_subject(loop, wanted.disturbance, wanted.momentum)
    everywhere = {"rate_everywhere": None, "everything": True}
    try:
        # What overflows in a guess is caught where the guess is verified.
        with np.errstate(all="ignore"):
            claims = _claims(subject, wanted)
    except UnreadableError as reason:
        # Nothing is known of such a law, whatever else was asked for.
        claims = [_undecided("convergence", everywhere, subject, str(reason))]
    except (OverflowError, ZeroDivisionError, np.linalg.LinAlgError) as reason:
        claims = [_undecided("convergence", everywhere, subject, f"{APART}: {reason}")]
    about = described(subject, [claim.kind for claim in claims])
    return Certificate(name or loop.law.name, about, named(claims, loop))


def _claims(subject: Subject, wanted: Wanted) -> list[Claim]:
    loop, claims = subject.loop, list[Claim]()
    sound = loop.wheels is None or gives_allocated_torque(loop.wheels)
    if loop.remembers and loop.law.lyapunov is not None:
        everywhere = {"rate_everywhere": None, "everything": True}
        claims.append(_undecided("convergence", everywhere, subject, "the law keeps a memory from call to call"))
    if sound and not loop.remembers:
        proved, failed = proved_claims(subject, wanted.slew_angle, wanted.rate)
        if loop.law.lyapunov is not None:
            claims.extend(_by_lyapunov(subject, wanted, proved))
        else:
            if loop.law.hook("single_root") is not None:
                claims.append(proved.get("region") or _undecided("region", {}, subject, failed[ISOTROPIC]))
            if loop.law.hook("surface") is not None and loop.wheels is None:
                torque = {"torque": [above(m + subject.disturbance) for m in subject.modelled]}
                claims.append(proved.get("sliding") or _undecided("sliding", torque, subject, failed[SLIDING]))
            claims.extend(_unshown(subject, wanted))
        sampled = proved.get("sampling") or sampling(Motion(subject))
        if sampled is not None and sampled.proof is None and sampled.outcome != "undecided":
            numbers = {"period": loop.period, "longest": None, "every_shorter": False}
            reason = Obligation("form", EXACT, "undecided", {"reason": failed[SAMPLED]})
            sampled = replace(sampled, numbers=numbers, obligations=(reason,))
        claims.extend([] if sampled is None else [sampled])
        pointing = proved.get("pointing")
        if pointing is None and wanted.disturbance:
            pointing = _undecided("pointing", {"torque": wanted.disturbance}, subject, failed[POINTS])
        claims.extend([] if pointing is None else [pointing])
        claims = needed(claims, Motion(subject)) if loop.law.lyapunov is not None else claims
    return claims


def _by_lyapunov(subject: Subject, wanted: Wanted, proved: Mapping[str, Claim]) -> list[Claim]:
    rate = "best" if wanted.rate is None else None if wanted.rate == float("inf") else wanted.rate
    main, basin = proved.get("convergence"), None
    wheeled = subject.loop.wheels is not None
    limit, box = proved.get("wheels" if wheeled else "torque-limit"), proved.get("inertia")
    if main is not None and main.outcome == "proved" and rate != "best" and not main.numbers["everything"]:
        main = None
    if main is None or main.outcome != "proved" or limit is None or box is None:
        derived, found, own = converge(subject, rate)
        # What refutes one V refutes no other.
        main = derived if main is None or derived.outcome == "proved" != main.outcome else main
        # The law's own V, where it serves, gives the larger sets.
        basin = own or found
    if basin is not None:
        limit = limit or (saturation if wheeled else torque_limit)(basin, wanted.slew_angle)
        box = box or inertia_box(basin, wanted.inertia_tolerance)
    more = (
        (limit, wanted.slew_angle or (wheeled and wanted.momentum is not None)),
        (box, wanted.inertia_tolerance),
    )
    # What nobody asked for is claimed only where it is proved.
    return [main, *(c for c, asked in more if c is not None and (asked or c.outcome == "proved"))]


def _unshown(subject: Subject, wanted: Wanted) -> list[Claim]:
    """Claims that are asked of a law without a V of its own."""
    rate, turn, tolerance = wanted.rate, wanted.slew_angle, wanted.inertia_tolerance
    asked: list[tuple[str, dict[str, Any]]] = []
    if rate is not None:
        asked.append(("convergence", {"rate_everywhere": None if isinf(rate) else rate, "everything": isinf(rate)}))
    limit = subject.loop.craft.torque_limit
    if turn is not None and subject.loop.wheels is not None:
        asked.append(("wheels", {"slew_angle": turn}))
    elif turn is not None and subject.loop.limit != "none" and isfinite(limit):
        asked.append(("torque-limit", {"slew_angle": turn, "kind": subject.loop.limit, "limit": limit}))
    if tolerance is not None:
        asked.append(("inertia", {"tolerance": tolerance}))
    return [_undecided(kind, numbers, subject, "the law declares no V to show it with") for kind, numbers in asked]


def _undecided(kind: str, numbers: dict[str, Any], subject: Subject, reason: str) -> Claim:
    limits = {"torque-limit": (), "wheels": FREE}
    assumptions = assumed(subject, limits=limits[kind]) if kind in limits else assumed(subject)
    if kind == "pointing":
        assumptions = HELD_AND_PUSHED
    if kind == "sliding":
        assumptions = assumed(subject, outside=("torque from outside bounded on each axis",))
    if kind == "inertia":
        assumptions = told(subject, numbers["tolerance"])
    return Claim(kind, numbers, {}, assumptions, (Obligation("form", EXACT, "undecided", {"reason": reason}),))
