"""The set-up of processes that work for a studio."""

import os

from starhold.campaign.workers import follow_parent


def begin() -> None:
    """Silence the output of files that are run, and let this process end with the studio, however that ends."""
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    follow_parent()
