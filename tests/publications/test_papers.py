"""Every paper's file is whole: measures exist, verdicts that are not plain are explained, files fly."""

import inspect
import json

import numpy as np
import pytest
from pydantic import ValidationError

from starhold.cli.arguments import FAILED_CHECK
from starhold.cli.commands import reproduce as command
from starhold.publications.desk import Desk
from starhold.publications.figure import Curve, Figure, Panel
from starhold.publications.paper import PAPERS, Paper, folder_of, read_paper, scenario_files
from starhold.publications.reproduction import Judged, Reproduction, measure_of, reproduce
from starhold.publications.verdicts import VERDICTS, Finding, judge
from starhold.publications.writing import draw, index_page
from starhold.scenario.reading import parse
from tests.browser import Browser
from tests.running import starhold
from tests.tiers import leading

ERRATA = 11


@pytest.mark.parametrize("letter", PAPERS)
def test_every_item_has_a_measure_that_takes_what_it_is_given(letter):
    paper = read_paper(letter)
    assert paper.letter == letter
    assert paper.rows
    assert paper.figures
    for item in (*paper.rows, *paper.figures):
        inspect.signature(measure_of(letter, item)).bind(Desk(letter), **item.given)
        assert all(one.value == one.value for one in getattr(item, "printed", []))


ONE = {"A": "riccati-I", "B": "gains", "C": "example", "D": "time", "E": "steepest-law"}
FILES = {
    "A": {"stabilisation", "skew-axes", "disturbed"},
    "C": {"three-wheels"},
    "E": {"near-the-edge", "l2-circle", "l2-deficit", "l2-equilibrium"},
}


@pytest.mark.parametrize("letter", PAPERS)
def test_a_row_has_the_verdict_recorded(letter):
    (row,) = (row for row in read_paper(letter).rows if row.name == ONE[letter])
    assert judge(measure_of(letter, row)(Desk(letter), **row.given), row.printed, row.tolerance) == row.verdict


@pytest.mark.slow
@pytest.mark.parametrize("letter", PAPERS)
def test_every_row_has_the_verdict_recorded(letter):
    made = reproduce(letter)
    assert made.changed == []
    assert FILES.get(letter, set(made.files)) == set(made.files)
    curves = [curve for figure in made.figures.values() for panel in figure.panels for curve in panel.curves]
    assert all(np.isfinite(np.asarray(curve.y, dtype=float)).any() for curve in curves)


@pytest.mark.parametrize("letter", PAPERS)
def test_every_scenario_file_is_read_and_asked_for(letter):
    text = (folder_of(letter) / "paper.toml").read_text(encoding="utf-8")
    text += "".join(item.read_text(encoding="utf-8") for item in folder_of(letter).iterdir() if item.name.endswith(".py"))
    for name, scenario in scenario_files(letter).items():
        assert parse(scenario, f"{letter}/{name}.toml").laws
        assert f'"{name}"' in text


def test_every_erratum_is_shown_by_a_row():
    shown = {row.erratum for letter in PAPERS for row in read_paper(letter).rows}
    assert shown - {None} >= set(range(1, ERRATA + 1))


HEAD = {"letter": "A", "title": "t", "source": "s", "about": "a"}
ROW = {"name": "r", "where": "here", "says": "so", "by": "metric", "verdict": "holds"}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"verdict": "differs", "published": "1"}, "needs a `why`"),
        ({"verdict": "agrees"}, "goes with a printed number"),
        ({"published": "1"}, "goes with no printed number"),
        ({"verdict": "perhaps"}, "verdict"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_row_that_cannot_be_is_refused(changes, told):
    Paper.model_validate(HEAD | {"section": [{"title": "t", "row": [ROW]}]})
    with pytest.raises(ValidationError, match=told):
        Paper.model_validate(HEAD | {"section": [{"title": "t", "row": [ROW | changes]}]})
    with pytest.raises(ValidationError, match="twice"):
        Paper.model_validate(HEAD | {"section": [{"title": "t", "row": [ROW, ROW]}]})


def test_a_figure_is_drawn_the_same_each_time():
    line = Curve([0.0, 1.0], [0.0, 2.0], "a line")
    area = Curve([0.0, 1.0, 1.0], [0.0, 0.0, 1.0], style="area")
    figure = Figure([Panel("x", "y", [line, area], equal=True, levels=[1.0], notes=[(0.5, 0.5, "here")])])
    assert draw(figure).startswith(b"\x89PNG")
    assert draw(figure) == draw(figure)


def test_bad_words_on_the_command_line(tmp_path):
    ended = starhold("reproduce", "Z", "-o", "r", cwd=tmp_path, code=2)
    assert ended.stderr.splitlines() == ["starhold: reproduce: publication: found Z; allowed: A, B, C, D, E or all"]
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize("width", leading([1400, 390]))
def test_all_verdicts_of_the_index_can_be_seen(tmp_path, width):
    """Of a publication with a long title and every verdict."""
    text = HEAD | {"title": "A study of the stabilisation of spacecraft " * 3, "source": "printed somewhere, " * 6}
    paper = Paper.model_validate(text | {"section": [{"title": "t", "row": [ROW]}]})
    rows = {word: Judged(paper.rows[0], Finding(False, "so"), word) for word in VERDICTS}
    (tmp_path / "index.html").write_text(index_page([Reproduction(paper, {}, rows, {}, 0.0)]), encoding="utf-8")
    browser = Browser()
    try:
        browser.open(tmp_path / "index.html", width, 900)
        edges = "(name) => [...document.querySelectorAll(name)].map((x) => x.getBoundingClientRect().right)"
        assert max(browser.ask(f'({edges})(".count")')) <= browser.ask(f'({edges})(".wide")')[0] <= width
    finally:
        browser.close()


def test_a_verdict_other_than_recorded_fails_the_command(tmp_path, monkeypatch):
    """Shown with a paper of one row, which says what is false."""
    paper = Paper.model_validate(HEAD | {"section": [{"title": "t", "row": [ROW]}]})
    judged = Judged(paper.rows[0], Finding(False, "not so"), "fails")
    made = Reproduction(paper, {}, {"r": judged}, {}, 0.0)
    monkeypatch.setattr(command, "_make", lambda letters, folder, processes: [made])
    ended = starhold("reproduce", "a", "-o", "r", cwd=tmp_path)
    assert ended.returncode == FAILED_CHECK
    assert "A/r: recorded holds, now fails" in ended.stdout
    assert "r: holds is now fails" in (tmp_path / "r/index.html").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "r/summary.json").read_text(encoding="utf-8"))["changed"] == ["A/r"]
