"""Whether this process can be copied to work on several processors."""

import sys
from threading import active_count


def can_fork() -> bool:
    """Return whether this process can be copied: a copy of one with several threads may wait for locks that are never
    released."""
    return sys.platform.startswith("linux") and active_count() == 1
