"""The page tells the margins of each law that has a linear form, and draws its loop."""

import itertools
import math
import re
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

import starhold as sh
from starhold.report import linear_loop
from starhold.report.linear_loop import section

LAWS = ("pd", "sliding", "mpc")


def told(scenario, *names):
    return section(sh.load(scenario), [SimpleNamespace(name=name) for name in names])


@pytest.fixture(scope="module")
def page():
    return told("cubesat-slew", *LAWS)


def cells(page):
    """The rows of the table: texts of their cells."""
    body = page[page.index("<tbody>") : page.index("</tbody>")]
    rows = re.findall(r"<tr>(.*?)</tr>", body)
    return [[re.sub(r"<[^>]*>", "", cell) for cell in re.findall(r"<t[hd].*?</t[hd]>", row)] for row in rows]


def test_the_table_tells_the_margins(page):
    rows = cells(page)
    assert [row[0] for row in rows] == ["pd"] * 3 + ["sliding"] * 3
    assert "mpc has no linear form: the law mpc iterates, and has no derivative." in page
    for row, found in zip(rows, [*sh.margins("cubesat-slew", "pd"), *sh.margins("cubesat-slew", "sliding")], strict=False):
        assert row[1] == found.axis
        numbers = [20.0 * math.log10(found.gain), math.degrees(found.phase), found.delay, found.crossover, found.sensitivity]
        assert [float(cell) for cell in row[2:]] == pytest.approx(numbers, rel=2e-3)
    assert "Left out: sensor gaussian." in page


def test_each_loop_is_drawn_in_each_plot(page):
    picture = ElementTree.fromstring(page[page.index("<svg") : page.index("</svg>") + 6])
    curves = picture.findall("polyline")
    assert len(curves) == 2 * 3 * 3
    assert all(math.isfinite(float(x)) for curve in curves for x in re.split("[ ,]", curve.get("points")))
    # The Nichols plot of a loop passes the height of 0 dB where the phase is that at the crossover.
    (margins, *_), crossing = sh.margins("cubesat-slew", "pd"), None
    points = [tuple(map(float, point.split(","))) for point in curves[2].get("points").split()]
    texts = {text.text: text for text in picture.findall("text")}
    left, right = (float(texts[word].get("x")) for word in ("-180", "-90"))
    zero = next(float(text.get("y")) - 4.0 for text in picture.findall("text") if text.text == "0")
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        if y0 < zero <= y1:
            crossing = x0 + (x1 - x0) * (zero - y0) / (y1 - y0)
    assert crossing == pytest.approx(left + (right - left) * math.degrees(margins.phase) / 90.0, abs=1.0)


def test_nothing_is_told_where_no_law_has_a_linear_form():
    assert told("three-laws", "sliding", "mpc") == ""


def test_a_loop_that_is_not_stable_has_no_margins(monkeypatch):
    real = linear_loop.linear_of
    monkeypatch.setattr(linear_loop, "linear_of", lambda scenario, entry: real(scenario, entry, 1.0))
    rows = cells(told("cubesat-slew", "sliding"))
    assert [row[1:3] for row in rows] == [["x", "not stable"], ["y", "not stable"], ["z", "not stable"]]


def test_a_name_is_no_markup():
    text = sh.load("cubesat-slew")
    entry = replace(text.pick("pd"), name="<b>&")
    assert "&lt;b&gt;&amp;" in section(replace(text, laws=(entry,)), [SimpleNamespace(name="<b>&")])
