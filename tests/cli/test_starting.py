"""What commands load, record and draw before they print and after: counted, for counts tell the same on every machine."""

import json
import os
import subprocess
import sys

import pytest

from tests.cli.short import SHORT
from tests.tiers import leading

COUNTED = """
import json, os, sys
from pathlib import Path
from starhold.cli import main, show
from starhold.trace.recording import Recorder

found, counts = {}, {"recorded": 0, "loops": 0, "processes": 0}
begin, program, told, fork = Recorder.__init__, Recorder.program, show.print_outcome, os.fork


def note(what):
    drawn = sorted(path.name for path in Path("out").glob("*") if path.suffix in (".png", ".html"))
    found[what] = {"modules": sorted(sys.modules), "drawn": drawn, **counts}


def begun(*given):
    counts["recorded"] += 1
    begin(*given)


def made(recorder, name, *given):
    counts["loops"] += name == "fly"
    return program(recorder, name, *given)


def forked():
    counts["processes"] += 1
    return fork()


def printed(flights):
    told(flights)
    note("table")


Recorder.__init__, Recorder.program, show.print_outcome, os.fork = begun, made, printed, forked
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


PICTURES = ("accuracy", "angle", "attitude", "rate", "roll-pitch-yaw", "scalar", "torque")
LATER = {"starhold.report.page", "starhold.report.figures", "starhold.studies.reflight", "h5py"}
"""What pictures, pages and files are made with."""


@pytest.mark.parametrize(
    ("words", "loops", "recorded"),
    leading([(("run", "short.toml", "--law", "lyapunov"), 1, 3), (("compare", "short.toml"), 3, 6)]),
)
def test_the_table_waits_for_nothing_that_it_does_not_need(words, loops, recorded, tmp_path):
    (tmp_path / "short.toml").write_text(SHORT)
    found = counted(tmp_path, *words, "-o", "out")
    table, end = found["table"], found["end"]
    mpc = {"scipy"} if loops > 1 else set()
    assert packages(table["modules"]) & LARGE == mpc
    # Of several laws the first are written while the last waits to fly.
    assert {*table["modules"]} & LATER == ({"h5py"} if loops > 1 else set())
    assert len(table["modules"]) < (895 if loops > 1 else 675)
    # Flights, their notes and what the laws compute first; calls are timed elsewhere, and what the page asks comes after.
    assert (table["recorded"], table["loops"]) == (recorded, loops)
    assert table["drawn"] == []
    # The page flies what was recorded for the flight.
    assert end["loops"] == loops
    assert end["recorded"] <= 30 * loops
    assert end["drawn"] == sorted(["report.html", *(f"{name}.png" for name in PICTURES)])
    # One draws, one times the laws' calls.
    assert end["processes"] == 2
    assert "concurrent.futures" not in table["modules"] or loops > 1
    assert "numpy.ma" not in end["modules"] or loops > 1
    assert not {"matplotlib", "plotly", "sympy", "xarray", "pandas"} & packages(end["modules"])
    assert not {"scipy.optimize", "scipy.sparse", "scipy.special", "scipy.stats"} & {*end["modules"]}
    # Proofs begin after the table, and of SciPy need what multiplies and factors matrices alone.
    assert "flint" not in table["modules"] or loops > 1
    assert ("scipy.linalg" in end["modules"]) is (loops > 1)
    assert len(end["modules"]) < (1045 if loops > 1 else 882)
    # Nor is a law or part loaded that the file does not name, where no other package offers parts.
    assert not {"starhold.laws.pd", "starhold.parts.targets.scan", "starhold.parts.environments.drag"} & {*end["modules"]}
    assert "h5netcdf" not in end["modules"]


STARTED = """
import json, sys
from starhold.cli import main
from starhold.report.painter import Painter


def started(painter):
    print(json.dumps(sorted(sys.modules)))
    raise SystemExit


Painter._start = started
sys.argv = ["starhold", "run", "three-laws"]
main.run_command()
"""


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="it starts early where there is another processor")
def test_the_process_that_draws_begins_to_load_before_the_scenario_is_read(tmp_path):
    done = subprocess.run([sys.executable, "-c", STARTED], cwd=tmp_path, capture_output=True, text=True)
    modules = json.loads(done.stdout)
    assert not packages(modules) & {*LARGE, "numpy", "llvmlite", "rich"}
    assert "starhold.scenario.reading" not in modules


def test_nothing_is_taken_apart_at_the_end(tmp_path):
    # Handlers run and output arrives, but the interpreter does not delete what was loaded.
    code = "import atexit, sys; atexit.register(lambda: print('ended'))\n"
    code += "class Kept:\n    def __del__(self): print('deleted')\n"
    code += "kept = Kept()\n"
    code += "from starhold.cli.main import main; sys.argv = ['starhold', '--help']; main()"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert (done.stdout.splitlines()[-1], done.returncode) == ("ended", 0)
    assert "Usage: " in done.stdout
    assert "deleted" not in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(("asked", "drawn"), leading([("none", []), ("page", ["report.html"])]))
def test_nothing_is_drawn_unasked(asked, drawn, tmp_path):
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "angle.png").write_text("of another flight")
    (tmp_path / "out" / "mine.png").write_text("of the user")
    words = ("run", "short.toml", "--law", "lyapunov", "-o", "out", "--force", "--pictures", asked)
    end = counted(tmp_path, *words)["end"]
    assert end["drawn"] == ["mine.png", *drawn]
    assert ("starhold.report.page" in end["modules"], end["loops"]) == (bool(drawn), 1)
    assert {"run.nc", "summary.json", "certificate.json"} <= {path.name for path in (tmp_path / "out").iterdir()}


def loaded(folder, words=(), **environment):
    """What a command that only tells of the program prints, and the modules that it loads."""
    code = f"import sys; sys.argv = ['starhold', *{words!r}]\nfrom starhold.cli.main import run_command\nrun_command()\n"
    tell = "import json; print(json.dumps([name for name in sys.modules if sys.modules[name]]), file=sys.stderr)"
    given = {"cwd": folder, "env": {**os.environ, **environment}, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, "-c", code + tell], **given)
    return done.stdout, json.loads(done.stderr)


def words_after(folder, typed):
    """What a shell offers in place of the last word, and the modules loaded to find it."""
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    said, modules = loaded(folder, _STARHOLD_COMPLETE="complete_bash", **words)
    return said.split(), modules


def assert_light(modules):
    assert not packages(modules) & {*LARGE, "numpy", "pydantic", "rich", "multiprocessing", "llvmlite", "flint", "h5py"}
    # Beside the light files that declare commands.
    rest = [name for name in modules if not name.startswith(("starhold.report.commands.", "starhold.cli.commands."))]
    assert len([name for name in rest if name.startswith("starhold")]) < 11


@pytest.mark.parametrize("option", ["--version", "--help"])
def test_what_tells_of_the_program_loads_next_to_nothing(option, tmp_path):
    said, modules = loaded(tmp_path, [option])
    assert said.startswith("starhold " if option == "--version" else "Usage: ")
    assert "..." not in said.partition("Commands:")[2]
    assert_light(modules)


COMPLETED = [
    ("starhold ru", {"run"}, set()),
    ("starhold export ", {"c", "oem"}, {"run"}),
    ("starhold run three-laws --", {"--law", "--pictures"}, {"--seed"}),
    ("starhold campaign x --runs 5 --", {"--sampling", "--seed"}, {"--pictures"}),
    ("starhold compare x --force --pictures p", {"page"}, {"none"}),
]


@pytest.mark.parametrize(("typed", "offered", "others"), leading(COMPLETED, 3))
def test_completion_offers_what_fits_and_loads_next_to_nothing(typed, offered, others, tmp_path):
    words, modules = words_after(tmp_path, typed)
    assert offered <= {*words}
    assert not others & {*words}
    assert_light(modules)
