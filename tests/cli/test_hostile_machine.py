"""Commands where the disk is full, the reader of the output has gone, the encoding is poor or the home cannot be written."""

import os
import resource
import subprocess
import sys

import pytest

from tests.cli.short import SHORT
from tests.refusals import complains
from tests.tiers import leading

COMMAND = [sys.executable, "-m", "starhold"]


def run(*words, cwd, **options):
    return subprocess.run([*COMMAND, *words], cwd=cwd, text=True, stderr=subprocess.PIPE, **options)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "short.toml").write_text(SHORT)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("most", leading([150_000, 0, 50_000]))
def test_a_disk_that_is_full_is_told_in_one_line(folder, most):
    """The first holds run.nc and the pictures, but not the page, the second nothing, the third a part of run.nc."""

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    words = ("run", "short.toml", "--no-certify", "-o", "out")
    complains(run(*words, cwd=folder, stdout=subprocess.DEVNULL, preexec_fn=limited), "cannot be written: File too large")
    assert not list((folder / "out").rglob(".writing-*"))
    assert (folder / "out" / "run.nc").exists() == (most == 150_000)


@pytest.mark.slow
def test_results_are_whole_though_nobody_reads_the_output(folder):
    reading, writing = os.pipe()
    os.close(reading)
    done = run("run", "short.toml", "--no-certify", "--pictures", "page", "-o", "out", cwd=folder, stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")
    assert {"run.nc", "summary.json", "report.html"} <= set(os.listdir(folder / "out"))


def test_output_that_cannot_be_written_is_told(folder):
    with open("/dev/full", "w") as full:
        done = run("wheels", cwd=folder, stdout=full)
    assert done.returncode == 2
    assert done.stderr == "starhold: standard output cannot be written: No space left on device\n"


@pytest.mark.slow
def test_poor_encoding_and_home_that_cannot_be_written(folder):
    (folder / "file").touch()  # a folder below a file cannot be made, even by root
    home = str(folder / "file" / "home")
    poor = os.environ | {"PYTHONIOENCODING": "ascii", "HOME": home, "XDG_CACHE_HOME": home, "XDG_CONFIG_HOME": home}
    (folder / "units.toml").write_text(SHORT.replace("duration = 20.0", 'duration = "0.4 min"'))
    done = run("run", "units.toml", "--no-certify", "-o", "out", cwd=folder, stdout=subprocess.PIPE, env=poor)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Report: out/report.html" in done.stdout
