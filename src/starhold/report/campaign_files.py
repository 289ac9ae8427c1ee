"""The files of a campaign beside its runs: recordings of those worth looking at, and the page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from starhold.campaign.again import fly_again
from starhold.files import atomic_write
from starhold.report.campaign_page import write_page
from starhold.report.results import PAGE, write_run

if TYPE_CHECKING:
    from starhold.campaign.results import CampaignResult
    from starhold.scenario.reading import Scenario

RECORDED = "recorded"
"""The folder of recordings."""


def write_campaign(scenario: Scenario, result: CampaignResult) -> Path:
    """Fly again and record the runs of a campaign that are worth looking at, and write its page; returns the page's path."""
    for law in result.laws:
        for again in law.again:
            flown = fly_again(result.folder, again.run, law.law)
            write_run(flown.flight.recording, result.folder / RECORDED / f"{law.law}-{again.run}.nc")
    page = result.folder / PAGE
    with atomic_write(page) as hidden:
        write_page(hidden, scenario, result)
    return page
