"""Jobs end with the studio, whatever ends that."""

import subprocess
import sys
import time

import psutil
import pytest

STUDIO = """
import time
from pathlib import Path
from starhold.studio.jobs import Jobs
from tests.campaign.flown import small

over = {"law.pd.k_rate": {"distribution": "uniform", "low": 1.5, "high": 2.5}}
text = small(campaign={"runs": 10_000_000, "over": over}).text
job = Jobs().start("campaign", "small", text, "small.toml", Path(), ["pd"])
while not job.state:
    assert not job.ended
    time.sleep(0.05)
print(job.process.pid, job.state, flush=True)
time.sleep(600)
"""


@pytest.mark.slow
def test_a_job_ends_where_its_studio_is_killed():
    studio = subprocess.Popen([sys.executable, "-c", STUDIO], stdout=subprocess.PIPE, text=True)
    try:
        pid, _, state = studio.stdout.readline().partition(" ")
        assert "done" in state
        job = psutil.Process(int(pid))
    finally:
        studio.kill()
        studio.communicate()
    end = time.monotonic() + 10.0
    while job.is_running() and job.status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < end, "the job outlives its studio"
        time.sleep(0.05)
