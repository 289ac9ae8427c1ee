"""The process that draws: it starts before there is anything to draw, and its end is told."""

import os
import subprocess
import sys
from functools import partial
from types import SimpleNamespace

import pytest

from starhold.processes import can_fork
from starhold.report import body
from starhold.report.painter import Painter


@pytest.fixture
def early():
    """The process starts at once: it can be copied, which threads of earlier tests forbid, and has a second processor."""
    if not can_fork() or len(os.sched_getaffinity(0)) < 2:
        pytest.skip("the process starts where there is something to draw")


@pytest.fixture
def pictures(monkeypatch):
    """What is to be drawn, in place of figures of flights."""
    made = {}
    monkeypatch.setattr(body, "report_of", lambda kind: SimpleNamespace(picture=lambda *flights: made))
    return made


def test_it_has_loaded_its_library_before_there_is_anything_to_draw(early, pictures, tmp_path):
    pictures["none"] = partial(exec, "import sys; assert 'matplotlib.backends.backend_agg' in sys.modules; 1 / 0")
    with Painter() as painter:
        assert painter._process.is_alive()
        painter.draw(SimpleNamespace(body=""), [], tmp_path)
        with pytest.raises(RuntimeError, match="ZeroDivisionError"):
            painter.finish()


def test_it_loads_without_writing_documentation_that_nobody_reads():
    code = "from starhold.report import painter; painter._load(); from matplotlib.axes import Axes; print(Axes.set.__doc__)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "None\n"


def test_one_that_has_died_is_told_and_not_waited_for(early, pictures, tmp_path):
    # More than a pipe holds.
    pictures["none"] = partial(exec, "#" * 1_000_000)
    with Painter() as painter:
        painter._process.kill()
        painter._process.join()
        painter.draw(SimpleNamespace(body=""), [], tmp_path)
        with pytest.raises(RuntimeError, match="could not be drawn"):
            painter.finish()


def test_nothing_starts_where_nothing_is_wanted(pictures, tmp_path):
    pictures["angle"] = None
    (tmp_path / "angle.png").write_text("of another flight")
    with Painter(False) as painter:
        painter.draw(SimpleNamespace(body=""), [], tmp_path)
        painter.finish()
        assert painter._process is None
    assert list(tmp_path.iterdir()) == []


def test_one_with_nothing_to_draw_ends_with_its_context():
    with Painter() as painter:
        pass
    assert painter._process is None or not painter._process.is_alive()
