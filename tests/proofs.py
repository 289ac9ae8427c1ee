"""Proofs are found once for all tests of a run, by whichever worker needs them first; others that need them wait for it."""

import fcntl
import hashlib
import importlib
import io
import os
import pickle
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

from starhold.kernel import numbers
from starhold.parts.part import Part

FOUND = {
    "starhold.certification.certify": ("proved_claims", "pointed", "appended", "detumbled"),
    "starhold.certification.hand_over": ("taken_over",),
    "starhold.certification.invariant.problem": ("show",),
}
"""Functions that find proofs, by the module that calls them."""


class Content(pickle.Pickler):
    """Writes what equal subjects have in common: a part is its file."""

    fast = True

    def reducer_override(self, value):
        """A part as its name and what its file holds."""
        if isinstance(value, Part):
            return str, (value.name + hashlib.sha256(Path(value.module.__file__).read_bytes()).hexdigest(),)
        return NotImplemented


class Kept(pickle.Pickler):
    """Writes what was found: a module of the package is its name."""

    def reducer_override(self, value):
        """A module as what imports it."""
        if isinstance(value, ModuleType) and value.__name__.startswith("starhold."):
            return importlib.import_module, (value.__name__,)
        return NotImplemented


def written(pickler, *values) -> bytes:
    """What a pickler makes of values."""
    file = io.BytesIO()
    pickler(file).dump(values)
    return file.getvalue()


def content(*values) -> bytes:
    """Bytes that are equal for equal values, of any process."""
    return written(Content, *values)


@contextmanager
def afresh():
    """Find proofs again that were found before: for tests of the search."""
    with patch.object(Searching, "again", True):
        yield


class Searching:
    """Whether proofs that were found before are found again."""

    again = False


def once(find, folder: Path):
    """What a function gave when it was called with equal values first, in this process or one beside it."""

    @wraps(find)
    def found(*values, **named):
        if Searching.again:
            return find(*values, **named)
        try:
            # How much work the kernel may do decides, too.
            key = content(find.__name__, numbers.WORK, values, sorted(named.items()))
        except (pickle.PicklingError, TypeError, AttributeError):
            return find(*values, **named)
        path = folder / hashlib.sha256(key).hexdigest()
        with path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if path.exists():
                return pickle.loads(path.read_bytes())[0]
            result = find(*values, **named)
            try:
                own = path.with_suffix(f".{os.getpid()}")
                own.write_bytes(written(Kept, result))
                own.replace(path)
            except (pickle.PicklingError, TypeError, AttributeError):
                return result
        return pickle.loads(path.read_bytes())[0]

    return found


FOLDER: list[Path] = []
"""Where the run keeps them, once it has begun."""


def shared(find):
    """A function of the tests that finds proofs, once for all workers of a run."""

    @wraps(find)
    def found(*values, **named):
        return (once(find, FOLDER[-1]) if FOLDER else find)(*values, **named)

    return found


def share(folder: Path) -> None:
    """Keep what is proved of a subject in a folder from now on."""
    folder.mkdir(exist_ok=True)
    FOLDER.append(folder)
    for module, names in FOUND.items():
        calling = importlib.import_module(module)
        for name in names:
            setattr(calling, name, once(getattr(calling, name), folder))
