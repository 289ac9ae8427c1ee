"""The console on which commands print and show their progress."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

WIDE = 120
console = Console(highlight=False, emoji=False)
if not console.is_terminal:
    # A file or a pipe has no width limit.
    console = Console(width=WIDE, highlight=False, emoji=False)


def bars_with(*columns: ProgressColumn | str) -> Progress:
    """Return progress bars with a description, a bar, the amount done, and these further columns."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress

    return Progress("{task.description}", BarColumn(), MofNCompleteColumn(), *columns, console=console)
