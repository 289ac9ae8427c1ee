"""The studio: who may ask, what it answers, and its page in a browser."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from starhold.scenario.reading import builtin_text
from starhold.studio import editing
from tests.browser import Browser
from tests.report import flown

pytest.importorskip("uvicorn")
pytest.importorskip("starlette")


class Served(NamedTuple):
    """A studio that is served, and the file that it edits."""

    port: int
    token: str
    path: Path

    def ask(self, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, Any]:
        """The status and the body of an answer; with the token unless other headers say otherwise."""
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        own = {"Cookie": f"starhold-studio={self.token}", "Content-Type": "application/json"} | headers
        link.request(method, path, None if body is None else json.dumps(body), own)
        answer = link.getresponse()
        text = answer.read().decode()
        link.close()
        return answer.status, json.loads(text) if "json" in (answer.getheader("content-type") or "") else text

    def ended(self, number: int) -> Any:
        """A job once it has ended."""
        for _ in range(600):
            job = next(job for job in self.ask("GET", "/jobs")[1] if job["number"] == number)
            if job["ended"]:
                return job
            time.sleep(0.1)
        raise AssertionError("the job does not end")


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    path = tmp_path_factory.mktemp("studio") / "mine.toml"
    path.write_text(flown.text(), encoding="utf-8")
    command = [sys.executable, "-m", "starhold", "studio", str(path), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    assert process.stdout is not None
    found = re.fullmatch(r"Studio: http://127\.0\.0\.1:(\d+)/\?token=(\S+)", process.stdout.readline().strip())
    assert found is not None
    yield Served(int(found[1]), found[2], path)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=30) == 130
    process.stdout.close()


def test_only_who_has_the_token_is_answered(served: Served) -> None:
    assert served.ask("GET", "/begin")[0] == 200
    assert served.ask("GET", "/begin", Cookie="")[0] == 403
    assert served.ask("GET", "/begin", Cookie="starhold-studio=guess")[0] == 403
    assert served.ask("GET", "/?token=guess", Cookie="")[0] == 403
    # As a page of elsewhere would ask whose name was made to mean this machine.
    assert served.ask("GET", "/begin", Host="example.org")[0] == 403
    # As a form of another page would ask.
    assert served.ask("POST", "/save", {"text": ""}, **{"Content-Type": "text/plain"})[0] == 415
    status, _ = served.ask("GET", f"/?token={served.token}", Cookie="")
    assert status == 303


def test_it_listens_on_this_machine_alone(served: Served) -> None:
    own = {found[4][0] for found in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    if not own:
        pytest.skip("this machine has no other address")
    for address in own:
        with socket.socket() as link:
            link.settimeout(2.0)
            assert link.connect_ex((str(address), served.port)) != 0


def test_a_campaign_of_a_broken_scenario_is_refused(served: Served) -> None:
    broken = flown.text().replace("k_rate = 0.09", "k_rat = 0.09")
    before = served.ask("GET", "/jobs")[1]
    status, found = served.ask("POST", "/jobs", {"kind": "campaign", "text": broken})
    line = broken.splitlines().index(next(text for text in broken.splitlines() if text.startswith("k_rat =")))
    assert status == 422
    assert found["error"] == "mine.toml: law[1].k_rat: found an unknown key; did you mean k_rate?"
    assert found["line"] == line + 1
    assert served.ask("GET", "/jobs")[1] == before
    for body in ({"kind": "dance", "text": flown.text()}, {"kind": "campaign"}, ["campaign"], "campaign"):
        assert served.ask("POST", "/jobs", body)[0] == 422


def test_a_scenario_that_a_job_cannot_be_asked_of(served: Served) -> None:
    status, job = served.ask("POST", "/jobs", {"kind": "failures", "text": flown.text()})
    assert status == 201
    ended = served.ended(job["number"])
    assert ended["error"] == "mine.toml: wheels: found no wheels; allowed: a scenario with [wheels] or [[wheel]] tables"
    text = flown.text().split("[campaign]")[0] + "[[law]]" + flown.text().split("[[law]]", 1)[1]
    _, job = served.ask("POST", "/jobs", {"kind": "campaign", "text": text})
    assert "no [campaign] table" in served.ended(job["number"])["error"]


def test_results_are_served_and_nothing_else(served: Served) -> None:
    text = flown.text().replace("duration = 20.0", "duration = 2.0")
    _, job = served.ask("POST", "/jobs", {"kind": "compare", "text": text})
    ended = served.ended(job["number"])
    assert ended["shown"] == "report.html"
    status, page = served.ask("GET", f"/results/{job['number']}/report.html")
    assert status == 200
    assert page.startswith("<!DOCTYPE html>")
    for name in ("..%2f..%2fetc%2fpasswd", "nothing.html", "%2e%2e", "..%5csummary.json"):
        assert served.ask("GET", f"/results/{job['number']}/{name}")[0] == 404
    assert served.ask("GET", "/results/999/report.html")[0] == 404


def test_a_job_can_be_stopped(served: Served) -> None:
    text = flown.text().replace("duration = 20.0", "duration = 1000.0").replace("runs = 500", "runs = 500000")
    _, job = served.ask("POST", "/jobs", {"kind": "campaign", "text": text})
    assert served.ask("POST", f"/jobs/{job['number']}/stop", {})[0] == 200
    assert served.ended(job["number"])["error"] == "stopped"


@pytest.mark.parametrize("size", [(1400, 900), (390, 844)])
def test_the_page_edits_and_shows(served: Served, size: tuple[int, int]) -> None:
    browser = Browser()
    try:
        browser.open(f"http://127.0.0.1:{served.port}/?token={served.token}", *size)
        browser.wait('editor && document.getElementById("verdict").textContent.includes("lyapunov")')
        # The token is not left in the address.
        assert "token" not in browser.ask("location.href")
        browser.ask('editor.setValue(editor.getValue().replace("k_rate = 0.09", "k_rat = 0.09"))')
        browser.wait(
            'document.querySelector(".wrong-line") && document.getElementById("verdict").textContent.includes("k_rate?")'
        )
        before = browser.ask("boxes.size")
        browser.ask('begin("campaign")')
        assert browser.ask("boxes.size") == before
        offered = browser.ask(
            """(() => { const line = editor.getValue().split("\\n").findIndex((text) => text.startsWith("k_rat ="));
                editor.setCursor(line, 4); return completion(editor).list.map((one) => one.text); })()"""
        )
        assert offered == ["k_rate = "]
        text = flown.text().replace("duration = 20.0", "duration = 2.0")
        browser.ask(f'editor.setValue({json.dumps(text)}); begin("compare")')
        browser.wait('[...document.querySelectorAll("iframe")].some((frame) => frame.contentWindow.fileText)')
        taken = '[...document.querySelectorAll("button")].find((one) => one.textContent === "To the editor")'
        browser.wait(f"Boolean({taken})")
        browser.ask(f"{taken}.click()")
        assert "k_attitude = 0.009" in browser.ask("editor.getValue()")
        assert browser.complaints == []
    finally:
        browser.close()


def test_saving_writes_the_file_whole(served: Served) -> None:
    text = flown.text() + "# saved\n"
    assert served.ask("POST", "/save", {"text": text})[1] == {"saved": str(served.path)}
    assert served.path.read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("old", "new", "at"),
    [
        ('torque_limit = "0.01 N m"', "torque_limit = -1", "torque_limit"),
        ("switching_gain = 0.005", "switching_gain = 0", "switching_gain"),
        ('limit = "axis"', "limit = axis", "limit = axis"),
        ("[orbit]", "[orbti]", "[orbti]"),
        ("inertia = [2.0, 3.0, 4.0]", "", "[spacecraft]"),
    ],
)
def test_errors_stand_at_the_key(old: str, new: str, at: str) -> None:
    text = builtin_text("three-laws").replace(old, new)
    found = editing.check(text, "file", Path())
    assert text.splitlines()[found["line"] - 1].startswith(at), found


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nothing.toml"], "No such file"),
        (["--port", "70000"], "0 to 65535"),
        (["three-laws", "--port", "1"], "another port"),
    ],
)
def test_bad_input_is_one_line(given: list[str], said: str) -> None:
    if "1" in given and hasattr(os, "geteuid") and os.geteuid() == 0:
        pytest.skip("an administrator may listen anywhere")
    command = [sys.executable, "-m", "starhold", "studio", *given, "--no-browser"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
