"""Work that a copy of the process does."""

import os

import pytest

from starhold.processes import aside, has_others


@pytest.fixture
def several(monkeypatch):
    """Several processors, whatever this machine has."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1})


def test_a_copy_works_while_the_context_runs(several, tmp_path):
    if not has_others():
        pytest.skip("this process cannot be copied")
    with aside(lambda: _note(tmp_path)):
        pass
    assert int((tmp_path / "who").read_text()) != os.getpid()


def test_the_work_is_done_at_once_without_another_processor(monkeypatch, tmp_path):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0})
    with aside(lambda: _note(tmp_path)):
        assert int((tmp_path / "who").read_text()) == os.getpid()


def test_what_prevents_the_work_is_raised_here(several, tmp_path):
    begun = []
    with pytest.raises(FileNotFoundError), aside(lambda: _note(tmp_path / "absent")):
        begun.append(True)
    assert begun


def test_the_work_is_done_though_the_context_fails(several, tmp_path):
    with pytest.raises(ZeroDivisionError), aside(lambda: _note(tmp_path)):
        1 / 0  # noqa: B018
    assert (tmp_path / "who").exists()


def _note(folder):
    (folder / "who").write_text(str(os.getpid()))
