"""A command is declared in one file: all that offers commands has it from there."""

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
COMMANDS = """
import sys
from starhold.report import commands
commands.__path__.append({folder!r})
from starhold.cli.main import run_command
raise SystemExit(run_command())
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "tell_gains.py").write_text(FILE, encoding="utf-8")
    (tmp_path / "short.toml").write_text(SHORT, encoding="utf-8")
    return tmp_path


def run(folder, *words):
    code = COMMANDS.format(folder=str(folder / "more"))
    return subprocess.run([sys.executable, "-c", code, *words], cwd=folder, capture_output=True, text=True)


def test_the_command_line_has_a_command_from_one_file(folder):
    told = run(folder, "--help").stdout
    assert "tell-gains" in told
    assert "Tell the gains." in told
    assert "--for-so-long" in run(folder, "tell-gains", "--help").stdout
    done = run(folder, "tell-gains", "short.toml", "--law", "lyapunov", "--for-so-long", "0.1 min")
    assert done.returncode == 0, done.stderr
    assert "Gains of lyapunov." in done.stdout
    into = folder / "results" / "three-laws-told"
    assert sorted(path.name for path in into.iterdir()) == ["summary.json", "tell-gains.csv", "tell-gains.png"]
    head, *rows = (into / "tell-gains.csv").read_text(encoding="utf-8").splitlines()
    assert head == "gain,value (SI),duration (s)"
    assert all(row.endswith(",6.0") for row in rows)
    # Its files are results, which nothing replaces unasked.
    (into / "summary.json").unlink()
    again = run(folder, "tell-gains", "short.toml", "--law", "lyapunov")
    assert again.returncode == 2
    assert "results already there (tell-gains.csv)" in again.stderr


def test_python_and_the_studio_have_it_too(folder, monkeypatch):
    code = "import starhold as sh; print(sh.tell_gains('short.toml', 'lyapunov')['k_rate'])"
    extended = COMMANDS.format(folder=str(folder / "more")).partition("from starhold.cli")[0]
    asked = "from starhold.studio.worker import KINDS; print('tell-gains' in KINDS)"
    done = subprocess.run(
        [sys.executable, "-c", f"{extended}{code}\n{asked}"], cwd=folder, capture_output=True, text=True, check=True
    )
    rate, offered = done.stdout.split()
    assert float(rate) > 0.0
    assert offered == "True"


def test_every_file_of_the_folder_is_a_command_of_everything():
    folder = Path(commands.__file__).parent
    names = {path.stem.replace("_", "-") for path in folder.glob("[a-z]*.py")}
    assert set(commands.names()) == names >= {"budget", "design", "failures", "invariant", "modal-roots", "sail"}
    # The studio has those that are about a scenario.
    assert names & set(KINDS) == names - {"invariant", "sail"}
