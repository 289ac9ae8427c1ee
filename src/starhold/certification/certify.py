"""All claims about one closed loop."""

from __future__ import annotations

from dataclasses import dataclass

from starhold.certification.certificate import Certificate, Claim
from starhold.certification.convergence import converge
from starhold.certification.disturbance import disturbance
from starhold.certification.inertia import inertia_box
from starhold.certification.limits import torque_limit
from starhold.certification.motion import Motion
from starhold.certification.sampling import sampling
from starhold.certification.saturation import saturation
from starhold.certification.sliding import surface_claim
from starhold.certification.subject import Subject, described, make_subject
from starhold.loop.closed_loop import ClosedLoop
from starhold.models.wheels import gives_what_is_asked


@dataclass(frozen=True)
class Wanted:
    """What is claimed; by default the most that can be proved.

    rate: convergence from every attitude and rates up to this (rad/s; inf for any); turn: torque within its limit on every
    turn from rest up to this (rad); inertia_tolerance: the box; disturbance: norm of a torque nobody models (N m);
    momentum: norm of the total angular momentum in claims about wheels (N m s), if absent that of the start.
    """

    rate: float | None = None
    turn: float | None = None
    inertia_tolerance: float | None = None
    disturbance: float = 0.0
    momentum: float | None = None


BEST = Wanted()


def certify(loop: ClosedLoop, name: str = "", wanted: Wanted = BEST) -> Certificate:
    """The certificate of a closed loop as it starts, whatever happens to it later. A law that is compiled-only or declares
    neither V nor a surface gets one without claims, which is undecided; so does a surface with wheels, and a loop that
    counts on a lost wheel."""
    subject = make_subject(loop, wanted.disturbance, wanted.momentum)
    claims: list[Claim] = []
    sound = loop.wheels is None or gives_what_is_asked(loop.wheels)
    if sound and not loop.law.card.compiled_only:
        if loop.law.lyapunov is not None:
            claims.extend(_by_lyapunov(subject, wanted))
        elif loop.wheels is None:
            reaching = surface_claim(subject)
            claims.extend([] if reaching is None else [reaching])
        sampled = sampling(Motion(subject))
        claims.extend([] if sampled is None else [sampled])
    return Certificate(name or loop.law.name, described(subject), tuple(claims))


def _by_lyapunov(subject: Subject, wanted: Wanted) -> list[Claim]:
    rate = "best" if wanted.rate is None else None if wanted.rate == float("inf") else wanted.rate
    main, found, own = converge(subject, rate)
    if found is None:
        return [main]
    # The law's own V, where it serves, gives the larger sets.
    basin = own or found
    limit = torque_limit(basin, wanted.turn) if subject.loop.wheels is None else saturation(basin, wanted.turn)
    more = (
        (limit, wanted.turn),
        (disturbance(basin), wanted.disturbance),
        (inertia_box(basin, wanted.inertia_tolerance), wanted.inertia_tolerance),
    )
    # What nobody asked for is claimed only where it is proved.
    return [main, *(c for c, asked in more if c is not None and (asked or c.outcome == "proved"))]
