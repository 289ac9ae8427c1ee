"""The sentences that sum up a campaign, each with the assumption that it rests on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from starhold.campaign.verdicts import percent
from starhold.certification.wording import listed
from starhold.report.campaign_units import INDEPENDENT, Wording, count_text, counted, few_percent

if TYPE_CHECKING:
    from starhold.campaign.results import CampaignResult, LawResult
    from starhold.campaign.verdicts import Verdict

SAMPLINGS = {
    "random": "independent random draws",
    "sobol": "Sobol' points",
    "latin-hypercube": "a Latin hypercube",
    "morris": "a Morris design",
    "saltelli": "a Saltelli design",
}


def outcome_of(law: LawResult) -> str:
    """Tell the outcome of all verdicts of a law together; empty where nothing is required."""
    outcomes = {verdict.outcome for verdict in law.verdicts}
    return next((outcome for outcome in ("missed", "not decided", "met") if outcome in outcomes), "")


def headline(law: LawResult, sampling: str, words: Wording) -> str:
    """Tell in one or two sentences whether a law keeps its requirements, and what that rests on; without its name."""
    outcome = outcome_of(law)
    chosen = [verdict for verdict in law.verdicts if verdict.outcome == outcome]
    if outcome == "met":
        return _met(chosen, words)
    if outcome == "missed":
        return _missed(chosen, len(law.verdicts), words)
    if outcome == "not decided":
        return _open(chosen, len(law.verdicts), sampling, words)
    lost = "no run was" if not law.lost else f"{count_text(law.lost)} of {counted(law.runs, 'run')} were"
    return f"nothing is required of it, so nothing is judged; {lost} lost."


def flown_text(result: CampaignResult) -> str:
    """Tell how many runs were flown of how many laws, and by what draws."""
    laws = "one law" if len(result.laws) == 1 else f"each of {len(result.laws)} laws, all of which fly the same draws"
    return f"{counted(result.runs, 'run')} of {laws}; the dispersions are sampled by {sampled(result.sampling)}."


def sampled(sampling: str) -> str:
    """Tell a kind of sampling in words."""
    return SAMPLINGS.get(sampling, sampling)


def _provided(verdicts: list[Verdict]) -> str:
    stopped = ", and it holds whenever the campaign was stopped" if any(v.until_decided for v in verdicts) else ""
    return f"provided that flights are independent draws from the stated dispersions{stopped}."


def _met(verdicts: list[Verdict], words: Wording) -> str:
    what = f"meets {_all(len(verdicts))}"
    shares = listed([f"at least {percent(verdict.share)} {_keep(verdict, words)}" for verdict in verdicts])
    return f"{what}: of all flights {shares}, shown with {_confidences(verdicts)}, {_provided(verdicts)}"


def _missed(verdicts: list[Verdict], total: int, words: Wording) -> str:
    # A verdict of "missed" has bounds.
    shortfalls = listed([_shortfall(verdict, words) for verdict in verdicts])
    return f"misses {_some(len(verdicts), total)}: {shortfalls}. Shown with {_confidences(verdicts)}, {_provided(verdicts)}"


def _shortfall(verdict: Verdict, words: Wording) -> str:
    lower, part = verdict.lower or 0.0, verdict.worst_part
    may = f"(at most {few_percent(1.0 - verdict.share)} may)"
    if part is not None and not lower > 1.0 - verdict.share:
        return f"more than {few_percent(part.lower or 0.0)} of flights with {part.name} {_miss(verdict, words)} {may}"
    return f"more than {few_percent(lower)} of all flights {_miss(verdict, words)} {may}"


def _open(verdicts: list[Verdict], total: int, sampling: str, words: Wording) -> str:
    if sampling != INDEPENDENT or not all(verdict.independent for verdict in verdicts):
        seen = listed([f"{percent(verdict.observed)} {_keep(verdict, words)}" for verdict in verdicts])
        return f"is not judged, for runs by {sampled(sampling)} are not independent of each other; of those flown {seen}."
    questions: list[str] = []
    for verdict in verdicts:
        part, one = verdict.worst_part, verdict.failures == 1
        lacking = ("is lost" if one else "are lost") if words.is_loss(verdict.name) else ("misses it" if one else "miss it")
        seen = f"{count_text(verdict.failures)} of {counted(verdict.runs, 'run')} {lacking}"
        if part is not None and part.outcome != "met":
            seen += f", {count_text(part.failures)} of the {count_text(part.runs)} with {part.name}"
        if verdict.more:
            seen += f"; about {counted(verdict.more, 'further run')} without a failure would show it"
        questions.append(f"whether {percent(verdict.share)} of all flights {_keep(verdict, words)} ({seen})")
    return (
        f"leaves {_some(len(verdicts), total)} open: {listed(questions)}. This is to be shown with "
        f"{_confidences(verdicts)}, {_provided(verdicts)}"
    )


def _keep(verdict: Verdict, words: Wording) -> str:
    return "are not lost" if words.is_loss(verdict.name) else f"keep {verdict.name}"


def _miss(verdict: Verdict, words: Wording) -> str:
    return "are lost" if words.is_loss(verdict.name) else f"miss {verdict.name}"


def _all(count: int) -> str:
    return "what is required" if count == 1 else f"all {count} requirements"


def _some(count: int, total: int) -> str:
    return "what is required" if total == 1 else f"{count} of {total} requirements"


def _confidences(verdicts: list[Verdict]) -> str:
    levels = list(dict.fromkeys(percent(verdict.confidence) for verdict in verdicts))
    return f"{listed(levels)} confidence{' each' if len(verdicts) > 1 and len(levels) == 1 else ''}"
