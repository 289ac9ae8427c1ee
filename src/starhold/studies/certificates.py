"""Certificates of a scenario's laws, each tried by flights."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from starhold.errors import InputError
from starhold.scenario.building import build
from starhold.studies.body import study_of

if TYPE_CHECKING:
    from starhold.analysis.trial import Trial
    from starhold.certification.certificate import Certificate
    from starhold.scenario.reading import Scenario


class Tried(NamedTuple):
    """A certificate, the flights that tried it (None: it claims nothing that can be flown), and for each kind of claim
    about a set whether the scenario's start lies in it."""

    certificate: Certificate
    trial: Trial | None
    start_inside: dict[str, bool]


def certify_scenario(scenario: Scenario, law: str | None = None) -> list[Tried]:
    """Certificates of all laws of a scenario, or of one. Raises `BrokenClaimError` where a flight contradicts one."""
    study, entries = study_of(scenario.body), scenario.laws if law is None else (scenario.pick(law),)
    if scenario.supposed is not None:
        raise InputError(
            scenario.where, "nominal", "laws that take the craft for another one", "no [nominal], to be certified"
        )
    # All of them before the first proof, so that what is wrong with the last is said at once.
    loops = [build(scenario, entry) for entry in entries]
    issued = [one for entry, loop in zip(entries, loops, strict=True) for one in study.certify(scenario, entry, loop)]
    return [Tried(one.certificate, study.fly_claims(one), study.start_inside(one)) for one in issued]
