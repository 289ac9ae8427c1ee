"""The studio: who may ask, what it answers, and its page in a browser."""

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
from starhold.studio.checker import Checker
from starhold.studio.server import MOST_TEXT, cookie_name
from tests.browser import Browser
from tests.refusals import complains
from tests.report import flown
from tests.running import starhold

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
        own = {"Cookie": f"{cookie_name(self.port)}={self.token}", "Content-Type": "application/json"} | headers
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
    assert served.ask("GET", "/begin", Cookie=f"{cookie_name(served.port)}=guess")[0] == 403
    # Another studio on this machine, whose cookie the browser sends along.
    assert served.ask("GET", "/begin", Cookie=f"{cookie_name(1)}={served.token}")[0] == 403
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_scenario_that_a_job_cannot_be_asked_of(served: Served) -> None:
    status, job = served.ask("POST", "/jobs", {"kind": "failures", "text": flown.text()})
    assert status == 201
    ended = served.ended(job["number"])
    assert ended["error"] == "mine.toml: wheels: found no wheels; allowed: a scenario with [wheels] or [[wheel]] tables"
    text = flown.text().split("[campaign]")[0] + "[[law]]" + flown.text().split("[[law]]", 1)[1]
    _, job = served.ask("POST", "/jobs", {"kind": "campaign", "text": text})
    assert "no [campaign] table" in served.ended(job["number"])["error"]


@pytest.mark.slow
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


@pytest.mark.parametrize("size", [(1400, 900), pytest.param((390, 844), marks=pytest.mark.slow)])
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
        assert browser.ask("document.getElementById('verdict').className") == "bad"
        browser.ask('begin("campaign")')
        assert browser.ask("boxes.size") == before
        offered = browser.ask(
            """(() => { const line = editor.getValue().split("\\n").findIndex((text) => text.startsWith("k_rat ="));
                editor.setCursor(line, 4); return completion(editor).list.map((one) => one.text); })()"""
        )
        assert offered == ["k_rate = "]
        text = flown.text().replace("duration = 20.0", "duration = 2.0")
        browser.ask(f'editor.setValue({json.dumps(text)}); begin("compare")')
        browser.wait('Boolean(document.querySelector(".result.front iframe")?.contentWindow.fileText)')
        taken = '[...document.querySelectorAll(".result.front button")].find((one) => one.textContent === "To the editor")'
        browser.wait(f"Boolean({taken})")
        browser.ask(f"{taken}.click()")
        # What is in the editor is not saved, and is asked about.
        press(browser, "drop")
        browser.wait('editor.getValue().includes("k_attitude = 0.009")')
        width = browser.ask('document.querySelector(".result.front iframe").clientWidth')
        assert width > 0.55 * size[0]
        browser.ask('document.getElementById("wide").click()')
        assert browser.ask('document.querySelector(".result.front iframe").clientWidth') > 0.85 * size[0]
        assert browser.complaints == []
    finally:
        browser.close()


def press(browser: Browser, value: str, name: str | None = None) -> None:
    """Answer the question that the page asks, with a name where it asks for one."""
    browser.wait('document.getElementById("asking").open')
    if name is not None:
        browser.ask(f"document.querySelector('#asking input').value = {json.dumps(name)}")
    browser.ask(f"""document.querySelector('#asking button[value="{value}"]').click()""")


@pytest.mark.slow
def test_save_loses_nothing_that_was_typed(served: Served) -> None:
    text = flown.text()
    served.path.write_text(text, encoding="utf-8")
    browser = Browser()

    def typed(more: str) -> str:
        browser.ask(f"editor.replaceRange({json.dumps(more)}, {{line: editor.lineCount(), ch: 0}})")
        return browser.ask("editor.getValue()")

    def opened(name: str) -> None:
        browser.ask(
            f"""(() => {{ const box = document.getElementById("scenarios"); box.value = "{name}";
                box.dispatchEvent(new Event("change")); }})()"""
        )

    try:
        browser.open(f"http://127.0.0.1:{served.port}/?token={served.token}")
        browser.wait("editor && known && doc.version")
        mine = typed("# typed\n")
        # A built-in scenario does not take the place of what was typed unless that is said.
        opened("landing")
        press(browser, "")
        assert browser.ask("editor.getValue()") == mine
        opened("landing")
        press(browser, "save")
        browser.wait('doc.name === "landing.toml"')
        assert served.path.read_text(encoding="utf-8") == mine
        # Nor does saving it write the user's file, which it is not, under whatever name.
        looked = typed("# of the landing\n")
        browser.ask('document.getElementById("save").click()')
        press(browser, "save", served.path.name)
        press(browser, "")
        press(browser, "save", "landing-2.toml")
        browser.wait("!edited()")
        assert served.path.read_text(encoding="utf-8") == mine
        assert served.path.with_name("landing-2.toml").read_text(encoding="utf-8") == looked
        # What another program wrote meanwhile is not lost unless that is said.
        opened(served.path.name)
        browser.wait(f"doc.name === {json.dumps(served.path.name)}")
        mine = typed("# again\n")
        served.path.write_text("# by another program\n", encoding="utf-8")
        browser.ask('document.getElementById("save").click()')
        press(browser, "")
        assert served.path.read_text(encoding="utf-8") == "# by another program\n"
        assert browser.ask("editor.getValue()") == mine
        assert browser.ask("edited()")
        browser.ask('document.getElementById("save").click()')
        press(browser, "over")
        browser.wait("!edited()")
        assert served.path.read_text(encoding="utf-8") == mine
        assert browser.complaints in ([], browser.complaints[:3])
    finally:
        browser.close()


def test_saving_writes_the_file_whole_and_none_that_changed(served: Served) -> None:
    text = flown.text() + "# saved\n"
    served.path.write_text(flown.text(), encoding="utf-8")
    version = served.ask("GET", "/file")[1]["version"]
    status, found = served.ask("POST", "/save", {"text": text, "name": served.path.name, "version": version})
    assert (status, found["saved"]) == (200, str(served.path))
    assert served.path.read_text(encoding="utf-8") == text
    # A page that did not see this text.
    status, found = served.ask("POST", "/save", {"text": "# late\n", "name": served.path.name, "version": version})
    assert (status, found["changed"], found["exists"]) == (409, True, False)
    assert "has changed since it was read" in found["error"]
    status, found = served.ask("POST", "/save", {"text": "# new\n", "name": served.path.name, "version": ""})
    assert (status, found["exists"]) == (409, True)
    own = {"name": "a.toml", "version": ""}
    for body in ({}, [], "text", {"text": text}, {"text": 3} | own, {"text": "\ud800"} | own):
        assert served.ask("POST", "/save", body)[0] == 422, body
    for name in ("../a.toml", "", ".toml", "a.py", "a\0.toml", "b/a.toml", "x" * 300 + ".toml"):
        assert served.ask("POST", "/save", {"text": text, "name": name, "version": ""})[0] == 409, name
    assert served.ask("POST", "/save", {"text": " \n", "name": served.path.name, "version": version})[0] == 409
    assert served.path.read_text(encoding="utf-8") == text
    assert not list(served.path.parent.glob(".writing-*"))


def test_no_request_ends_in_an_error_of_the_server(served: Served) -> None:
    def raw(text: bytes) -> int:
        with socket.create_connection(("127.0.0.1", served.port), timeout=30) as link:
            link.sendall(text)
            return int(link.recv(100).split()[1])

    head = f"Cookie: {cookie_name(served.port)}={served.token}\r\nContent-Type: application/json\r\n".encode()
    host = b"Host: 127.0.0.1\r\n"
    for name in (b"%00", b"a%00b", b"%0a", b"x" * 5000, b"%ff"):
        assert raw(b"GET /results/1/" + name + b" HTTP/1.1\r\n" + host + head + b"\r\n") == 404
    assert raw(b"GET /begin HTTP/1.1\r\nHost: [::1\r\n" + head + b"\r\n") < 500
    for length in (b"-1", b"many"):
        assert raw(b"POST /check HTTP/1.1\r\n" + host + head + b"Content-Length: " + length + b"\r\n\r\n") == 400
    for path in (b"/check", b"/jobs", b"/run", b"/jobs/1/again", b"/jobs/9999999999999999999999/stop"):
        for body in (b"\xff", b'{"text": "\\ud800", "kind": "compare"}', b"[" * 100000, b'{"files": [1]}'):
            length = f"Content-Length: {len(body)}\r\n\r\n".encode()
            assert raw(b"POST " + path + b" HTTP/1.1\r\n" + host + head + length + body) in (200, 404, 422)
    # As long as it likes, in pieces whose sum nobody told.
    piece = b"100000\r\n" + b"x" * 0x100000 + b"\r\n"
    begun = b"POST /check HTTP/1.1\r\n" + host + head + b"Transfer-Encoding: chunked\r\n\r\n"
    assert raw(begun + piece * (MOST_TEXT // 0x100000 + 1)) == 413


LAW = """
import time
print("a line that is no answer")
{}
from starhold.laws.pd import CARD, Gains, examples, torque
"""


def test_a_law_of_a_file_is_asked_about_once(served: Served) -> None:
    served.path.with_name("own.py").write_text(LAW.format(""), encoding="utf-8")
    text = flown.text().split("[[law]]")[0] + '[[law]]\nfile = "own.py"\nk_rate = 0.1\nk_attitude = 0.01\n'
    assert served.ask("POST", "/check", {"text": text})[1] == {"asks": ["own.py"]}
    assert served.ask("POST", "/jobs", {"kind": "design", "text": text}) == (422, {"asks": ["own.py"]})
    assert served.ask("POST", "/run", {"files": ["own.py"]})[0] == 200
    assert served.ask("POST", "/check", {"text": text})[1]["laws"] == ["own"]


@pytest.mark.slow
def test_a_check_that_does_not_end_or_ends_its_process_is_told(tmp_path: Path) -> None:
    head = flown.text().split("[[law]]")[0]
    for name, line in {"endless": "while True: time.sleep(0.1)", "ended": "import os; os._exit(3)"}.items():
        (tmp_path / f"{name}.py").write_text(LAW.format(line), encoding="utf-8")
    checker = Checker(longest=30.0)
    try:
        assert checker.check(flown.text(), "mine.toml", tmp_path)["name"] == "three-laws"
        checker = Checker(longest=3.0) if checker.close() is None else checker
        said = checker.check(f'{head}[[law]]\nfile = "endless.py"\n', "mine.toml", tmp_path)
        assert said == {"error": "mine.toml: the check did not end within 3 s; a file that the scenario names may hang"}
        checker.close()
        checker = Checker()
        assert (
            "ended without an answer" in checker.check(f'{head}[[law]]\nfile = "ended.py"\n', "mine.toml", tmp_path)["error"]
        )
        # And the next one is answered.
        assert checker.check("name = 3", "mine.toml", tmp_path)["error"].startswith("mine.toml: ")
    finally:
        checker.close()


@pytest.mark.slow
def test_what_else_is_asked_has_its_table(served: Served) -> None:
    def shown(kind: str, name: str) -> str:
        status, job = served.ask("POST", "/jobs", {"kind": kind, "text": builtin_text(name)})
        assert status == 201
        ended = served.ended(job["number"])
        return served.ask("GET", f"/results/{job['number']}/{ended['shown']}")[1]

    page = shown("failures", "wheels-orbital")
    assert "authority<small>N m</small></th>" in page
    assert "data:image/png" in page
    assert "failures.csv" in page
    assert "root sum square" in shown("budget", "cubesat-nadir")
    page = shown("design", "wheels-orbital")
    assert "scaled stiffness K_a: 0.926" in page
    assert "weights of 1 - a_ii: one, or one per axis" in page
    assert "lyapunov-c.zip" in shown("export", "three-laws")
    text = flown.text().replace("runs = 500", "runs = 8")
    _, job = served.ask("POST", "/jobs", {"kind": "campaign", "text": text})
    assert "shown" in served.ended(job["number"])
    status, again = served.ask("POST", f"/jobs/{job['number']}/again", {"law": "lyapunov", "run": "3"})
    assert status == 201
    assert served.ended(again["number"])["shown"] == "report.html"
    assert served.ask("POST", f"/jobs/{job['number']}/again", {"law": "lyapunov", "run": "x"})[0] == 422


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nothing.toml"], "No such file"),
        (["--port", "70000"], "0 to 65535"),
        (["three-laws", "--port", "1"], "another port"),
    ],
)
def test_bad_input_is_one_line(given: list[str], said: str, tmp_path: Path) -> None:
    if "1" in given and hasattr(os, "geteuid") and os.geteuid() == 0:
        pytest.skip("an administrator may listen anywhere")
    complains(starhold("studio", *given, "--no-browser", cwd=tmp_path), said)
