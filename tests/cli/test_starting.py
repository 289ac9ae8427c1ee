"""What commands load and record before they print: counted, for counts tell the same on every machine."""

import json
import subprocess
import sys

import pytest

from tests.cli.short import SHORT

COUNTED = """
import json, sys
from starhold.cli import main, show
from starhold.report import painter
from starhold.trace.recording import Recorder

found, counts = {}, {"recorded": 0, "finished": 0}
begin, told, finish = Recorder.__init__, show.print_outcome, painter.Painter.finish


def note(what):
    found[what] = {"modules": sorted(sys.modules), **counts}


def begun(*given):
    counts["recorded"] += 1
    begin(*given)


def printed(flights):
    told(flights)
    note("table")


def finished(one):
    counts["finished"] += 1
    return finish(one)


Recorder.__init__, show.print_outcome, painter.Painter.finish = begun, printed, finished
sys.argv = ["starhold", *sys.argv[1:]]
code = main.run_command()
note("end")
print(json.dumps({"code": code, **found}), file=sys.stderr)
"""
LARGE = {"matplotlib", "plotly", "scipy", "sympy", "pandas", "xarray", "pint", "dask", "pyarrow", "duckdb", "control"}
"""Libraries that take long to load, none of which the table needs."""


def counted(folder, *words):
    """What a command had loaded and recorded when it printed its table and at its end."""
    done = subprocess.run([sys.executable, "-c", COUNTED, *words], cwd=folder, capture_output=True, text=True)
    found = json.loads(done.stderr.splitlines()[-1])
    assert found["code"] == 0
    return found


def packages(modules):
    return {name.partition(".")[0] for name in modules}


def test_the_table_waits_for_nothing_that_it_does_not_need(tmp_path):
    (tmp_path / "short.toml").write_text(SHORT)
    found = counted(tmp_path, "run", "short.toml", "--law", "lyapunov", "-o", "out")
    table, end = found["table"], found["end"]
    assert not LARGE & packages(table["modules"])
    assert not {"starhold.report.page", "starhold.studies.reflight"} & {*table["modules"]}
    assert len(table["modules"]) < 900
    # The flight, its notes, the law for its digest, and its calls that are timed; what flies on the page comes after.
    assert table["recorded"] == 4 < end["recorded"]
    # The figures may still be drawn.
    assert (table["finished"], end["finished"]) == (0, 1)


@pytest.mark.parametrize("option", ["--version", "--help"])
def test_what_tells_of_the_program_loads_next_to_nothing(option, tmp_path):
    code = f"import sys; sys.argv[1:] = [{option!r}]\nfrom starhold.cli.main import run_command\nrun_command()\n"
    tell = "import json; print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code + tell], cwd=tmp_path, capture_output=True, text=True)
    modules = json.loads(done.stderr)
    assert done.stdout.startswith("starhold " if option == "--version" else "Usage: ")
    assert not packages(modules) & {*LARGE, "numpy", "pydantic", "rich", "multiprocessing", "llvmlite", "flint", "h5py"}
    # And one light file for each study.
    studies = [name for name in modules if name.startswith("starhold.report.commands.")]
    assert len([name for name in modules if name.startswith("starhold") and name not in studies]) < 19
