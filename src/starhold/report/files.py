"""Files that appear under their names only when they are whole."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from starhold.errors import InputError


@contextmanager
def whole(path: Path) -> Generator[Path]:
    """A path to write to, in a hidden folder beside `path`, renamed to it on success and removed on failure. InputError
    where it cannot be written."""
    hidden: Path | None = None
    try:
        hidden = Path(tempfile.mkdtemp(prefix=".writing-", dir=path.parent))
        yield hidden / path.name
        os.replace(hidden / path.name, path)
    except OSError as error:
        raise InputError(str(path), "", "", f"cannot be written: {error.strerror or error}") from None
    finally:
        if hidden is not None:
            shutil.rmtree(hidden, ignore_errors=True)
