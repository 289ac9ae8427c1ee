"""Atomic writes: a file appears under its name only when it is complete; and locks: one process writes into a folder."""

import atexit
import errno
import os
import re
import shutil
import tempfile
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from starhold.errors import InputError

UNFINISHED = ".writing-"
"""Prefix of the hidden folders in which files are being written."""
LARGEST = 2**28
"""Size of the largest file that is read (bytes)."""
_claimed: dict[tuple[int, int], int] = {}
"""Open handles of the folders that this process has claimed, by device and inode."""


def claim(folder: Path) -> None:
    """Make this process the only one that writes results into a folder, until it ends.

    Raises BlockingIOError where another one does. The system drops the claim with the process, however that ends."""
    try:
        import fcntl
    except ImportError:
        return
    handle = os.open(folder, os.O_RDONLY)
    status = os.fstat(handle)
    place = (status.st_dev, status.st_ino)
    try:
        if place not in _claimed:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _claimed[place] = handle
    except BlockingIOError:
        raise
    except OSError:
        # A file system without locks.
        pass
    finally:
        if _claimed.get(place) != handle:
            os.close(handle)


def clear_unfinished(folder: Path) -> None:
    """Remove the half-written files that killed processes left in a folder and its subfolders."""
    for left in (*folder.glob(f"{UNFINISHED}*"), *folder.glob(f"*/{UNFINISHED}*")):
        shutil.rmtree(left, ignore_errors=True)


def read_bytes(path: Path) -> bytes:
    """Read a whole file. OSError where it cannot be read or is larger than LARGEST; a device could be read without end."""
    with path.open("rb") as file:
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise OSError(errno.EFBIG, f"larger than {LARGEST // 2**20} MiB", str(path))
    return content


def read_text(path: Path) -> str:
    """Return the text of a file, in UTF-8. Errors as of `read_bytes`; UnicodeDecodeError where it holds other bytes."""
    return read_bytes(path).decode("utf-8")


@contextmanager
def atomic_write(path: Path) -> Generator[Path]:
    """Yield a path to write to, in a hidden folder beside `path`, renamed to it on success and removed on failure.
    InputError where it cannot be written."""
    hidden: Path | None = None
    try:
        hidden = Path(tempfile.mkdtemp(prefix=UNFINISHED, dir=path.parent))
        yield hidden / path.name
        os.replace(hidden / path.name, path)
    except OSError as error:
        raise InputError(str(path), "", "", f"cannot be written: {error.strerror or error}") from None
    finally:
        if hidden is not None:
            shutil.rmtree(hidden, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8 by `atomic_write`, with the same line ends on every system."""
    with atomic_write(path) as hidden:
        hidden.write_text(text, encoding="utf-8", newline="\n")


def filled(package: str, template: str, values: Mapping[str, Any]) -> str:
    """Return the text of a template of a package with values in place of each @KEY@."""
    text = (resources.files(package) / "templates" / f"{template}.txt").read_text(encoding="utf-8")
    return re.sub(r"@(\w+)@", lambda match: str(values.get(match[1], match[0])), text)


def passing_folder() -> str:
    """Make a temporary folder for a campaign, which is deleted when this process ends, and return its path."""
    folder = tempfile.mkdtemp(prefix="starhold-campaign-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
