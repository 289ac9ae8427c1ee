"""The first screen of a page, seen in a browser: verdicts, key numbers, error angle and body are inside it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from starhold.files import write_text
from starhold.report.page import render
from starhold.scenario.reading import Scenario, load, parse
from starhold.studies import compare as studies
from tests.browser import Browser
from tests.report import flown
from tests.tiers import leading

DESKTOP, PHONE = (1400, 900), (390, 844)
REQUIRED = [
    {"id": "ADCS-1", "text": "Settles", "method": "flight", "metric": "settling_time", "at_most": "2 h"},
    {"id": "ADCS-2", "text": "Points", "method": "flight", "metric": "final_attitude_error", "at_most": "1e-6 deg"},
    {"id": "ADCS-3", "text": "Points, proved", "method": "proof", "metric": "final_attitude_error", "at_most": "1 deg"},
]
SEEN = ("table.verdicts", "table.ranking", "#angle", ".view canvas")
BOXES = "(name) => [...document.querySelectorAll(name)].map((x) => x.getBoundingClientRect().toJSON())"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = Browser()
    yield found
    found.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The pages of a law with modes, of two laws with sliders, and of five laws with requirements of their own."""
    folder = tmp_path_factory.mktemp("pages")
    given = {"mission": load("cubesat-mission"), "laws": parse(flown.text(), "short")}
    required = {name: scenario.with_({"requirement": REQUIRED}) for name, scenario in given.items()}
    whole = required | {"five": load("geostationary")}
    return {name: written(scenario, folder / f"{name}.html") for name, scenario in whole.items()}


def written(scenario: Scenario, path: Path) -> Path:
    entries = scenario.laws
    write_text(
        path, render(scenario, [studies.fly_law(scenario, entry, studies.build(scenario, entry)) for entry in entries])
    )
    return path


def boxes(browser: Browser, name: str) -> list[dict[str, Any]]:
    return browser.ask(f"({BOXES})({name!r})")


@pytest.mark.parametrize(("name", "verdicts"), leading([("mission", 3), ("laws", 6), ("five", 20)]))
@pytest.mark.parametrize("size", leading([(DESKTOP,), (PHONE,)]))
def test_the_first_screen_answers(
    browser: Browser, pages: dict[str, Path], name: str, verdicts: int, size: tuple[int, int]
) -> None:
    browser.complaints.clear()
    browser.open(pages[name], *size)
    browser.wait("charts.size > 0 && document.querySelector('#angle canvas') !== null")
    tops: list[float] = []
    for part in SEEN:
        found = boxes(browser, part)
        assert found, part
        for box in found:
            assert box["height"] > 40.0, part
            assert box["width"] > 60.0, part
            assert 0.0 <= box["top"] <= box["bottom"] <= size[1], part
        tops.append(min(box["top"] for box in found))
    assert tops[:3] == sorted(tops[:3])
    # Side by side where there is room, below one another where there is none.
    plot, view = boxes(browser, "#angle")[0], boxes(browser, ".view canvas")[0]
    assert (view["left"] >= plot["right"]) == (size is DESKTOP)
    assert (view["top"] >= plot["bottom"]) == (size is PHONE)
    assert browser.ask("document.documentElement.scrollWidth") <= size[0]
    assert browser.ask('[...document.querySelectorAll("table.verdicts .outcome")].length') == verdicts
    assert browser.complaints == []


def test_folds_draw_when_they_are_opened_and_share_the_time(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["mission"], *DESKTOP)
    assert [band[2] for band in browser.ask("report.bands")] == ["detumble", "sun", "nadir", "unload", "nadir"]
    shown = "document.querySelector('#wheel-momentum canvas').checkVisibility({contentVisibilityAuto: true})"
    assert not browser.ask(shown)
    assert not browser.ask("charts.get('wheel-momentum').seen")
    browser.ask('document.getElementById("actuators").open = true')
    assert browser.wait(shown)
    room = "document.getElementById('wheel-momentum').clientWidth"
    assert browser.wait(f"charts.get('wheel-momentum').panels[0].width === {room} && {room}") > 800
    # Times are told in hours, torques in the unit that suits them, and no tick is a power in full.
    chart = "charts.get('wheel-momentum')"
    assert browser.ask(f"unitOf({chart}.plot.panels[0], {chart}.panels[0])") == {"factor": 1e-3, "label": "wheel 1, mN m s"}
    assert browser.ask(f"clockOf({chart}.plot)") == [3600, "h"]
    # One time for all: the views follow the pointer, the plots the views.
    browser.ask('document.dispatchEvent(new CustomEvent("looked-at", { detail: 7200 }))')
    assert browser.ask("moment") == pytest.approx(7200.0, abs=1.0)
    assert browser.ask('document.getElementById("clock").textContent') == "7200 s"


def test_a_distant_limit_is_told_and_does_not_flatten_the_curves(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["laws"], *DESKTOP)
    near, far = (
        browser.ask(
            f"span({{order: [0], levels: [{-level}, {level}], log: false}}, {{lost: new Set(), plot: {{}}}},"
            " {series: [{}], data: [[0, 1], [-1, 1]]})"
        )
        for level in (1.5, 10.0)
    )
    assert near[1] >= 1.5
    assert far[1] < 1.5
