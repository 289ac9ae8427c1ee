"""Files that appear under their names only when they are whole."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: Path) -> Generator[Path]:
    """A path to write to, in a hidden folder beside `path`, renamed to it on success and removed on failure."""
    hidden = Path(tempfile.mkdtemp(prefix=".writing-", dir=path.parent))
    try:
        yield hidden / path.name
        os.replace(hidden / path.name, path)
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
