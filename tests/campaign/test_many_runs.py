"""Very many runs: what memory they take."""

import os
import subprocess
import sys

import pytest

MILLION = """
import re, sys
from pathlib import Path
import starhold as sh
from tests.campaign.flown import SMALL
tables = SMALL | {"simulation": SMALL["simulation"] | {"duration": 4.0}, "law": SMALL["law"][:1]}
over = {"initial.rate": {"distribution": "shell", "high": "4 deg/s"}, "law.pd.k_rate": {"distribution": "uniform",
        "low": 1.5, "high": 2.5}}
asked = [{"metric": "effort", "at_most": 1.0, "share": 0.5}, {"metric": "lost"}]
found = sh.campaign(sh.scenario(tables), sys.argv[1], runs=int(sys.argv[2]), threads=int(sys.argv[3]), over=over,
                    requirement=asked, search=False)
peak = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1]
print(found.laws[0].runs, peak)
"""


def many(folder, runs, threads):
    root = os.path.dirname(os.path.dirname(os.path.dirname(__file__)))
    command = [sys.executable, "-c", MILLION, str(folder), str(runs), str(threads)]
    told = subprocess.run(command, cwd=root, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
    assert int(told[0]) == runs
    return int(told[1]) / 2**20


@pytest.mark.slow
def test_a_million_runs_stay_below_a_gibibyte(tmp_path):
    peak = many(tmp_path / "million", 1_000_000, 2)
    assert peak < 1.0
