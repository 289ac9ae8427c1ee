"""The proved pointing bound of a loop, and the share of each error source in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from starhold.certification.certify import certify
from starhold.certification.wording import sentence, strongest
from starhold.laws.modes import mode_laws
from starhold.studies.bodies.rigid_body import wanted_of
from starhold.studies.body import SILENT, Notice
from starhold.studies.budget import Budget, faultless, sources, study, without

if TYPE_CHECKING:
    from starhold.certification.certificate import Claim
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario

FOUND = ("level", "highest", "end.angle", "end.rate", "settling")
"""The numbers of a claim that the search for the others determines."""


@dataclass(frozen=True)
class ProvedPointing:
    """The proved pointing bound of a loop. text: the claim that leaves out the fewest parts, or why there is none; beside:
    another claim, which leaves out more. angle: the bound (rad) at all times after `settling` (s); None where none is
    proved. share: the share of orbits for which it holds, None for all. left_out: parts outside the claim. starts_inside:
    whether the scenario starts in the certified set. shares: the decrease (rad) of the bound without each source; None for a
    source that the claim ignores, or without which no bound is proved."""

    text: str
    angle: float | None = None
    settling: float | None = None
    share: float | None = None
    left_out: tuple[str, ...] = ()
    starts_inside: bool = False
    shares: Mapping[str, float | None] = field(default_factory=dict[str, "float | None"])
    beside: str = ""

    @property
    def sentence(self) -> str:
        """The proved bound, or the reason why there is none, in one sentence."""
        if self.angle is None:
            return f"No pointing bound is proved: {self.text}."
        whole = "" if self.left_out else "; no part is left out"
        outside = "" if self.starts_inside else "; the flight begins outside the region of this claim"
        return f"Proved: {self.text}{whole}{outside}." + f" Also proved: {self.beside}." * bool(self.beside)


def prove_pointing(
    scenario: Scenario,
    loop: ClosedLoop,
    others: Mapping[str, Callable[[], ClosedLoop]] | None = None,
    notice: Callable[[str], None] = lambda name: None,
) -> ProvedPointing:
    """Return the proved pointing bound of a loop of a scenario. others: by source, a function that makes the loop without
    this source; `notice` is called with the next source."""
    from starhold.analysis.departure import start_inside

    if loop.nominal is not None:
        return ProvedPointing("the law's nominal model is not the craft that flies")
    if mode_laws(loop.law, loop.gains):
        return ProvedPointing("claims are about single modes")
    wanted = replace(wanted_of(scenario, True), alone=True)
    certificate = certify(loop, "", wanted)
    proved = strongest([one for one in certificate.claims if one.outcome == "proved"])
    if not proved:
        reasons = [o.evidence["reason"] for one in certificate.claims for o in one.obligations if "reason" in o.evidence]
        return ProvedPointing(next(iter(reasons), "no claim covers such a loop"))
    claim, shares = proved[0], dict.fromkeys(others or (), None)
    n = claim.numbers
    for name, make in (others or {}).items() if claim.kind == "pointing" else ():
        notice(name)
        other = certify(make(), "", replace(wanted, like=claim)).claim("pointing")
        shares[name] = None if other is None else _share(claim, other)
    return ProvedPointing(
        sentence(claim, certificate.subject),
        n["angle"],
        n["settling"],
        n["share"],
        tuple(claim.left_out),
        start_inside(certificate, loop).get(claim.kind, False),
        shares,
        "; ".join(sentence(one, certificate.subject) for one in proved[1:]),
    )


def budget_with_proof(scenario: Scenario, entry: LawEntry, notice: Notice = SILENT) -> Budget:
    """Return the budget of a law with the proved pointing bound and the share of each source; each proof takes seconds.
    `notice` is called with the number done, the total, and the next item."""
    budget, flown = study(scenario, entry, notice), faultless(scenario)
    names = [source.name for source in sources(flown)]
    others = {one.name: partial(without, flown, entry, [one]) for one in sources(flown)}

    def tell(name: str) -> None:
        notice(1 + names.index(name), len(names) + 1, f"the proof without {name}")

    notice(0, len(names) + 1, "the proof")
    proof = prove_pointing(flown, without(flown, entry, []), others, tell)
    notice(len(names) + 1, len(names) + 1, "")
    return replace(budget, proof=proof)


def _share(claim: Claim, other: Claim) -> float | None:
    if other.outcome != "proved" or _told(claim) == _told(other):
        return None
    # The claim against all sources also holds against fewer.
    return max(claim.numbers["angle"] - other.numbers["angle"], 0.0)


def _told(claim: Claim) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the numbers of a loop on which its claim depends."""
    proof: Any = claim.proof
    numbers, programs = proof.claim["numbers"], proof.claim["programs"]
    return {k: x for k, x in numbers.items() if k not in FOUND}, {k: x for k, x in programs.items() if k != "lyapunov"}
