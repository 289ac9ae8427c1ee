"""The tutorials are true: their files are written, their commands and code run, and what is quoted is printed."""

import contextlib
import io
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import typer

from starhold.cli.main import app
from tests.export.flown import build_in, need
from tests.running import starhold
from tests.tiers import WHOLE, leading

ROOT = Path(__file__).parents[1]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
FENCE = re.compile(
    r"(?P<slow><!-- slow -->\n)?(?P<unrun><!-- not run: [^>]+ -->\n)?"
    r"^```(?P<language>\w*)(?: title=\"(?P<file>[^\"]+)\")?\n(?P<text>.*?)^```$",
    flags=re.DOTALL | re.MULTILINE,
)


def blocks(page):
    return [match.groupdict() for match in FENCE.finditer(page.read_text(encoding="utf-8"))]


def plain(text):
    """A text with one space between its words, and none of the characters that bars of progress are drawn with."""
    return " ".join(re.sub("[┃]", "│", text).split())


def run(line, folder):
    command, _, code = line.partition(" # exit code ")
    start, *words = shlex.split(command)
    if start.endswith("cc"):
        build_in(folder, start, *words)
        return ""
    assert start == "starhold", line
    done = starhold(*words, cwd=folder)
    assert done.returncode == int(code or 0), (line, done.stderr)
    return done.stdout + done.stderr


@pytest.mark.parametrize("page", leading(TUTORIALS), ids=lambda page: page.stem)
def test_tutorial_runs(page, tmp_path, monkeypatch):
    """All of it in `make test-all`, else all but the commands that draw pictures once more."""
    need(*re.findall(r"[^\s,]+", "".join(re.findall("<!-- needs: (.*) -->", page.read_text(encoding="utf-8")))))
    go_through(page, tmp_path, monkeypatch, lambda block: block["unrun"] or (block["slow"] and not WHOLE))


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_commands_of_a_tutorial_are_commands(page, tmp_path, monkeypatch):
    go_through(page, tmp_path, monkeypatch, lambda block: True)
    kinds = {block["language"] for block in blocks(page) if not block["unrun"] and not block["file"]}
    assert kinds & {"sh", "python"}
    assert page.read_text(encoding="utf-8").count("```") == 2 * len(blocks(page))


def go_through(page, tmp_path, monkeypatch, left_out):
    monkeypatch.chdir(tmp_path)
    names, said = {}, ""
    known = typer.main.get_command(app).commands
    for block in blocks(page):
        language, text = block["language"], block["text"]
        if block["file"]:
            Path(block["file"]).write_text(text, encoding="utf-8")
        elif left_out(block):
            for line in re.findall("^starhold (.*?)(?: # .*)?$", text, flags=re.MULTILINE):
                name, *words = shlex.split(line)
                known[name].make_context(name, words)
        elif language == "toml":
            tomllib.loads(text)
        elif language == "sh":
            said = "\n".join(run(line, tmp_path) for line in text.splitlines())
        elif language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(text, page.name, "exec"), names)
            said = out.getvalue()
        else:
            assert language == "text", language
            at = 0
            for line in text.splitlines():
                found = re.compile(re.escape(plain(line)).replace("…", ".*?")).search(plain(said), at)
                assert found, (line, said)
                at = found.end()
