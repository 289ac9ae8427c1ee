"""A command is declared in one file, whichever its kind: all that offers commands has it from there."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from starhold.report import commands
from starhold.studio.worker import KINDS
from tests.cli.short import SHORT

FILE = '''"""The gains of a law."""

from starhold.report.commands import Column, Command, Option, Result, Table


def study(scenario, entry, notice=lambda *given: None):
    notice(1, 1, "read")
    return entry.gains._asdict()


def present(scenario, entry, found):
    from matplotlib.figure import Figure

    rows = [[name, value, scenario.table.simulation.duration] for name, value in found.items()]
    table = Table([Column("gain"), Column("value", "SI", ".1f"), Column("duration", "s", ".3g")], rows)
    return Result("Gains", [table, f"Gains of {entry.name}."], table, Figure, {entry.name: found})


COMMAND = Command(
    "Tell the gains.", "told", study, present, options={"for_so_long": Option("simulation.duration", "how long")}
)
'''
WRITTEN = '''"""A command that only says something."""


def say(word: str, twice: bool = False) -> None:
    """Say a word."""
    print(" ".join([word] * (1 + twice)))


COMMANDS = {"say": say}
'''
WORDS = {
    "said": ["say", "so", "--twice"],
    "all": ["--help"],
    "help": ["tell-gains", "--help"],
    "done": ["tell-gains", "short.toml", "--law", "lyapunov", "--for-so-long", "0.1 min"],
    "again": ["tell-gains", "short.toml", "--law", "lyapunov"],
}
EXTENDED = """
import json, sys
from starhold.cli import commands as written
from starhold.report import commands
commands.__path__.append("more")
written.__path__.append("written")
import starhold as sh
from starhold.report.results import MARKS
from starhold.studio.worker import KINDS
from tests.running import starhold
told = {name: starhold(*words, cwd=".") for name, words in json.loads(sys.argv[1]).items()}
found = {name: (done.returncode, done.stdout + done.stderr) for name, done in told.items()}
print(json.dumps(found | {"rate": sh.tell_gains("short.toml", "lyapunov")["k_rate"], "kinds": list(KINDS), "marks": MARKS}))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("one-file")
    (folder / "more").mkdir()
    (folder / "more" / "tell_gains.py").write_text(FILE, encoding="utf-8")
    (folder / "written").mkdir()
    (folder / "written" / "saying.py").write_text(WRITTEN, encoding="utf-8")
    (folder / "short.toml").write_text(SHORT, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def told(folder):
    """What a process that finds the file says: commands, Python and the studio."""
    paths = {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])}
    words = [sys.executable, "-c", EXTENDED, json.dumps(WORDS)]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, env=os.environ | paths)
    return json.loads(done.stdout)


def test_the_command_line_has_a_command_from_one_file(folder, told):
    assert "tell-gains" in told["all"][1]
    assert "Tell the gains" in told["all"][1]
    assert "--for-so-long" in told["help"][1]
    code, text = told["done"]
    assert code == 0, text
    assert "Gains of lyapunov." in text
    into = folder / "results" / "three-laws-told"
    assert sorted(path.name for path in into.iterdir()) == ["summary.json", "tell-gains.csv", "tell-gains.png"]
    head, *rows = (into / "tell-gains.csv").read_text(encoding="utf-8").splitlines()
    assert head == "gain,value (SI),duration (s)"
    assert all(row.endswith(",6.0") for row in rows)
    # Its files are results, which nothing replaces unasked.
    code, text = told["again"]
    assert code == 2
    assert "results already there" in text
    assert {"tell-gains.csv", "tell-gains.png"} <= set(told["marks"])


def test_a_command_that_is_a_function_is_one_file_too(told):
    assert told["all"][1].index("schema") < told["all"][1].index("Say a word")
    assert told["said"] == [0, "so so\n"]


def test_python_and_the_studio_have_it_too(told):
    assert told["rate"] > 0.0
    assert "tell-gains" in told["kinds"]


def test_every_file_of_the_folder_is_a_command_of_everything():
    folder = Path(commands.__file__).parent
    names = {path.stem.replace("_", "-") for path in folder.glob("[a-z]*.py")}
    assert set(commands.names()) == names >= {"budget", "design", "failures", "invariant", "modal-roots", "sail"}
    # The studio has those that are about a scenario alone.
    assert names & set(KINDS) == names - {"identify", "invariant", "sail", "replay"}
