"""The command `review`, a review pack with all evidence about a law of a scenario, as a printable page and as Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from starhold.report.commands import Block, Command, Result, later

if TYPE_CHECKING:
    from starhold.campaign.verify import Review
    from starhold.scenario.reading import LawEntry, Scenario


def present(scenario: Scenario, entry: LawEntry, review: Review) -> Result:
    """Return the result: the verdicts as in `verify`, the open points, and the document."""
    from starhold.report.commands import verify
    from starhold.report.review import OPEN, sections_of

    judged = verify.present(scenario, entry, review.verdicts)
    blocks: list[Block] = [*(judged.blocks[:2] if review.verdicts else []), ""]
    sections, points = sections_of(review)
    blocks.append(f"{OPEN}: {len(points)}." if points else "No point is open.")
    blocks += [f"{number}. {text}" for number, (_, text) in enumerate(points, 1)]
    # Without requirements there is no outcome.
    outcome = judged.outcome if review.verdicts else "undecided"
    return Result(f"{scenario.name}, {entry.name}: review", blocks, document=sections, outcome=outcome)


COMMAND = Command(
    "Collect the evidence about a law and the open points for a review: review.html, which prints well, and review.md.",
    "review",
    later("campaign.verify.examine"),
    present,
    doing="by {}",
    unstable=True,
    body="",
    kinds=("html", "md"),
)
