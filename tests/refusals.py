"""A user's error is told in one line, in Python and by a command."""

from contextlib import contextmanager

import pytest

from starhold.errors import InputError


@contextmanager
def refused(*words, start="", match=None):
    """What runs within is a user's error, told in one line that begins so, has all these words, and has a match."""
    with pytest.raises(InputError, match=match) as caught:
        yield caught
    line = str(caught.value)
    assert line.startswith(start), line
    assert "\n" not in line, line
    assert [word for word in words if word not in line] == [], line


def complains(done, *words):
    """A command ended as on a user's error: with code 2, and one line that has all these words."""
    assert done.returncode == 2, done.stderr or done.stdout
    assert done.stderr.startswith("starhold: ")
    assert done.stderr.count("\n") == 1, done.stderr
    assert "Traceback" not in (done.stdout or "")
    assert [word for word in words if word not in done.stderr] == [], done.stderr


def rows(text):
    """The rows of a table: its cells stand between bars, ↵ in them begins a new line of a file."""
    return [[cell.strip().replace("↵", "\n") for cell in row.split("|")] for row in text.strip().splitlines()]


def replaced(text, *changes):
    """The text of a file with things changed that are there: pairs of what stands there and what then does, or one such."""
    for old, new in [changes] if isinstance(changes[0], str) else changes:
        assert old in text, old
        text = text.replace(old, new)
    return text
