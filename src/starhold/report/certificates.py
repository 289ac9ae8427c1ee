"""The certificates of a scenario's laws, each tried by flights."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from starhold.analysis.trial import Trial, fly_claims
from starhold.certification.certificate import Certificate
from starhold.certification.certify import Wanted, certify
from starhold.laws.double_cover import COVERS
from starhold.laws.interface import with_attitude
from starhold.loop.kernels import make_step
from starhold.scenario.building import build

if TYPE_CHECKING:
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario


class Tried(NamedTuple):
    """A certificate, the flights that tried it (None: it claims nothing that can be flown), and for each kind of claim
    about a set whether the scenario's start lies in it."""

    certificate: Certificate
    trial: Trial | None
    start_inside: dict[str, bool]


def certify_law(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> Certificate:
    """The certificate of one law of the scenario, with the claims that its [certify] table asks for."""
    table = scenario.table.certify
    wanted = Wanted(table.rate, table.turn, table.inertia_tolerance, table.disturbance)
    return certify(loop, entry.name, wanted)


def certify_scenario(scenario: Scenario, law: str | None = None) -> list[Tried]:
    """Certificates of all laws of a scenario, or of one. Raises `BrokenClaimError` where a flight contradicts one."""
    entries = scenario.laws if law is None else (scenario.pick(law),)
    # All of them before the first proof, so that what is wrong with the last is said at once.
    loops = [build(scenario, entry) for entry in entries]
    found: list[Tried] = []
    for entry, loop in zip(entries, loops, strict=True):
        certificate = certify_law(scenario, entry, loop)
        found.append(Tried(certificate, fly_claims(loop, certificate), start_inside(loop, certificate)))
    return found


def start_inside(loop: ClosedLoop, certificate: Certificate) -> dict[str, bool]:
    """Whether the scenario's start lies in the sets of the proved claims that are about a level of V."""
    function = loop.law.lyapunov
    if function is None or loop.law.card.compiled_only:
        return {}
    seen = make_step(loop.parts()).look(loop.carry(), 0, 0, loop.craft, loop.setup())
    shown, _ = COVERS[loop.cover](seen.attitude, loop.carry().h, loop.hysteresis_width)
    value = function(with_attitude(seen, shown), loop.gains, loop.craft)
    found: dict[str, bool] = {}
    for claim in certificate.claims:
        if claim.outcome == "proved" and "start" in claim.numbers:
            level = claim.numbers["start"]
            found[claim.kind] = level is None or value <= level
    return found
