"""All claims about one closed loop."""

from __future__ import annotations

from dataclasses import dataclass

from starhold.certification.certificate import Certificate, Claim
from starhold.certification.convergence import converge, convergence
from starhold.certification.disturbance import disturbance
from starhold.certification.inertia import inertia_box
from starhold.certification.limits import torque_limit
from starhold.certification.motion import Motion
from starhold.certification.sampling import sampling
from starhold.certification.sliding import surface_claim
from starhold.certification.subject import described, make_subject
from starhold.loop.closed_loop import ClosedLoop


@dataclass(frozen=True)
class Wanted:
    """What is claimed; by default the most that can be proved.

    rate: convergence from every attitude and rates up to this (rad/s; inf for any); turn: torque within its limit on every
    turn from rest up to this (rad); inertia_tolerance: the box; disturbance: norm of a torque nobody models (N m).
    """

    rate: float | None = None
    turn: float | None = None
    inertia_tolerance: float | None = None
    disturbance: float = 0.0


BEST = Wanted()


def certify(loop: ClosedLoop, name: str = "", wanted: Wanted = BEST) -> Certificate:
    """The certificate of a closed loop. A law that is compiled-only or declares neither V nor a surface, and a loop with
    wheels, get one without claims, which is undecided."""
    subject = make_subject(loop, wanted.disturbance)
    claims: list[Claim] = []
    # The momentum that wheels store acts on the body too, which these proofs do not know of.
    if not loop.law.card.compiled_only and loop.wheels is None:
        motion = Motion(subject)
        if loop.law.lyapunov is not None:
            rate = "best" if wanted.rate is None else None if wanted.rate == float("inf") else wanted.rate
            main, found = converge(subject, rate)
            claims.append(main)
            # The law's own V, where it serves, gives the larger sets.
            basin = convergence(motion)[1] or found
            if found is not None and basin is not None:
                more = (
                    (torque_limit(basin, wanted.turn), wanted.turn),
                    (disturbance(basin), wanted.disturbance),
                    (inertia_box(subject, wanted.inertia_tolerance), wanted.inertia_tolerance),
                )
                # What nobody asked for is claimed only where it is proved.
                claims.extend(c for c, asked in more if c is not None and (asked or c.outcome == "proved"))
        else:
            reaching = surface_claim(subject)
            claims.extend([] if reaching is None else [reaching])
        sampled = sampling(motion)
        claims.extend([] if sampled is None else [sampled])
    return Certificate(name or loop.law.name, described(subject), tuple(claims))
