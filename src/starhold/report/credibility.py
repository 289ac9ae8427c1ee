"""The credibility factors of NASA-STD-7009, each with the evidence that the program has and the evidence that it lacks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from starhold.certification.wording import HEADINGS
from starhold.report.campaign_units import counted
from starhold.report.page_parts import versions

if TYPE_CHECKING:
    from starhold.campaign.verify import Review
    from starhold.certification.certificate import Certificate


def factors_of(review: Review, certificates: Sequence[Certificate]) -> dict[str, tuple[list[str], list[str]]]:
    """Return for each factor the statements that the program can make, and those that it cannot."""
    evidence = review.evidence
    scenario, tables = evidence.scenario, evidence.scenario.table
    parts = [evidence.entry.law, evidence.loop.body, *(fitted.part for fitted in evidence.loop.parts)]
    foreign = [part.name for part in parts if not _released(part.module)]
    sources = dict.fromkeys(source for part in parts for source in part.card.sources)
    claims = [claim for one in certificates for claim in one.claims]
    proved = sum(claim.outcome == "proved" for claim in claims)
    reasons_given = sum(bool(one.rationale) for one in review.verdicts)
    checked = [f"The kernel checked {proved} of {len(claims)} claims as proved."] if claims else []
    models = f"{len(parts) - len(foreign)} of {len(parts)} models are those of this release."
    verification = [f"Computed by {versions()}.", models, *checked]
    open_models = [f"Who verified the models of others: {', '.join(foreign)}."] if foreign else []
    open_models += ["Which tests of the release were run here."]
    open_models += ["The error of the integration step: starhold run --check-step estimates it."]
    uncertainty: list[str] = []
    unknown: list[str] = ["The uncertainty of the numbers that are not drawn."]
    robustness = [f"Flown with {counted(len(tables.fault), 'fault')}."] if getattr(tables, "fault", []) else []
    frail: list[str] = []
    if review.has_campaign:
        result = evidence.campaign
        drawn = ", ".join(result.over) or "only noise"
        uncertainty.append(f"{result.runs} runs, by {result.sampling} sampling, draw {drawn}.")
        causes = result.laws[0].drivers
        if causes is not None:
            robustness.append(f"{causes.failures} of {counted(causes.runs, 'run')} failed; their drivers were sought.")
    else:
        unknown.insert(0, "The spread of results: there is no [campaign].")
        frail.append("What makes requirements fail: there is no [campaign].")
    if review.has_budget and not isinstance(evidence.budget, str):
        uncertainty.append(f"A pointing budget of {counted(len(evidence.budget.rows) - 3, 'source')}.")
    if not isinstance(evidence.linear, str) and evidence.linear.is_stable:
        robustness.append("Margins of gain, phase and delay of the linear loop.")
    elif scenario.body == "rigid-body":
        frail.append("Margins of a linear loop.")
    if any(claim.kind == "inertia" and claim.outcome == "proved" for claim in claims):
        robustness.append(f"Proved with {HEADINGS['inertia']}.")
    pedigree = ["All inputs are in one text, whose digest is given; units are checked as it is read."]
    if review.verdicts:
        pedigree.append(f"{reasons_given} of {len(review.verdicts)} requirements give a rationale.")
    records = [one.id for one in review.verdicts if one.method == "inspection" and one.verdict == "met"]
    pedigree += [f"Records of inspection: {', '.join(records)}."] if records else []
    return {
        "Verification": (verification, open_models),
        "Validation": (
            [f"The models are those of {len(sources)} publications: {'; '.join(sources)}."],
            ["How the models compare with this spacecraft's hardware or telemetry."],
        ),
        "Input pedigree": (pedigree, ["Where the scenario's numbers come from, and who accepts the input data."]),
        "Results uncertainty": (uncertainty, unknown),
        "Results robustness": (robustness, frail),
        "Use history": ([], ["For which missions these models were used before."]),
        "M&S management": (
            ["Release, text and results are fixed by the digests; the same text gives the same bits."],
            ["Who controls changes of the scenario."],
        ),
        "People qualifications": ([], ["Who made and who reviewed this analysis, and their qualifications."]),
    }


def _released(module: Any) -> bool:
    """Return whether a model belongs to starhold; a law made of modes is an object, not a module."""
    return getattr(module, "__name__", type(module).__module__).startswith("starhold.")
