"""The least versions that pyproject.toml allows work: what is required directly at its minimum, the rest as it comes."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = ("campaign", "interop", "serial", "studio", "zmq")
COMMANDS = [
    ("run", "three-laws", "--law", "lyapunov", "-o", "out"),
    ("run", "--help"),
    ("design", "wheels-orbital", "--map", "map.png"),
    ("invariant", "van-der-pol", "-o", "set"),
    ("campaign", "wheels-orbital", "--runs", "20", "-o", "many"),
    ("query", "many", "SELECT count(*) FROM runs"),
]
UNITS = """
import starhold as sh
sh.margins(sh.load("three-laws").with_({"simulation.duration": "0.1 h"}), "lyapunov")
sh.linearise("three-laws", "lyapunov")
import starhold.studio.server
import serial, zmq.asyncio, zmq.utils.monitor
"""


def minimum():
    """The direct requirements of the project and of its extras as pins of their least versions."""
    given = [*PROJECT["dependencies"], *(name for extra in EXTRAS for name in PROJECT["optional-dependencies"][extra])]
    return [re.sub(">=", "==", name) for name in given]


def test_every_requirement_has_a_least_version():
    given = [*PROJECT["dependencies"], *(one for extra in PROJECT["optional-dependencies"].values() for one in extra)]
    bare = [
        name for name in given if not name.startswith("starhold") and not re.fullmatch(r"[\w.-]+(\[\w+\])?>=[\d.]+", name)
    ]
    assert not bare


@pytest.mark.slow
def test_the_least_versions_work(tmp_path):
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    subprocess.run([python, "-m", "pip", "install", "--quiet", *minimum()], check=True)
    here = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    for words in COMMANDS:
        done = subprocess.run([python, "-m", "starhold", *words], cwd=tmp_path, env=here, capture_output=True, text=True)
        # 4: a requirement of the campaign is missed or undecided.
        assert done.returncode in ((0, 4) if "campaign" in words else (0,)), (words, done.stderr[-2000:])
    done = subprocess.run([python, "-c", UNITS], cwd=tmp_path, env=here, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
