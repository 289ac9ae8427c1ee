"""Commands print here."""

from rich.console import Console

WIDE = 120
console = Console(highlight=False)
if not console.is_terminal:
    # A file or a pipe has no width limit.
    console = Console(width=WIDE, highlight=False)
