"""The page opens offline, holds every number, and takes nothing from files for markup."""

import re
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from starhold.analysis.rigid_body import MEASURES, METRICS
from starhold.files import write_text
from starhold.parts.craft import check_inertia
from starhold.report.attitude_plots import closest_limit
from starhold.report.bodies.rigid_body import _box
from starhold.report.page import render
from starhold.report.settings import settings
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.building import build
from starhold.scenario.reading import load, parse
from starhold.simulation.lane import Recording, fly, label
from starhold.studies.compare import compare
from tests.report import flown
from tests.report.reader import Reader


@pytest.fixture(scope="module")
def page() -> str:
    return render(flown.scenario(), flown.flights())


@pytest.fixture(scope="module")
def reader(page: str) -> Reader:
    return Reader(page)


@pytest.fixture(scope="module")
def station() -> str:
    return render(flown.told("l2-deficit"), flown.stations("l2-deficit"))


def test_nothing_is_loaded(page: str, reader: Reader, station: str) -> None:
    reader.loads_nothing()
    Reader(station).loads_nothing()
    for text, plotly in ((page, 0), (station, 1)):
        assert text.count("leeoniya/uPlot") == 1
        assert text.count("* plotly.js v") == plotly


def test_the_licence_of_what_draws_goes_with_the_page(page: str) -> None:
    licence = (resources.files("starhold.report") / "assets" / "uplot.LICENSE").read_text(encoding="utf-8")
    assert licence.strip() in page


def test_every_law_and_every_metric_is_there(reader: Reader) -> None:
    flights = flown.flights()
    best = METRICS.winners({flight.name: flight.metrics for flight in flights})
    for flight in flights:
        assert flight.name in reader.words
        for metric in MEASURES:
            if metric in flight.metrics:
                assert METRICS.shown(metric, flight.metrics[metric]) in reader.words, metric
    for metric in flights[0].metrics:
        if metric in MEASURES:
            assert ("th", {"scope": "col", "class": "number", "title": MEASURES[metric].meaning}) in reader.tags
    marked = sum(tag == "td" and attrs.get("class") == "number best" for tag, attrs in reader.tags)
    assert marked == sum(map(len, best.values())) > 0
    assert flown.text().split("[spacecraft]")[1] in reader.text


def test_what_comes_closest_to_a_limit_is_told(reader: Reader) -> None:
    for flight in flown.flights():
        share = np.abs(flight.recording["torque"]).max() / 0.01
        assert f"torque {100.0 * share:.3g} %" in reader.words
    flight, scenario = flown.flights()[0], load("wheels-orbital")
    arrays = flight.recording.arrays | {"wheel_momentum": np.full((3, 4), -0.45), "wheel_torque": np.zeros((3, 4))}
    wheeled = replace(flight, recording=Recording(arrays, flight.recording.attrs | {"torque_limit": 1.0}))
    wheels = wheels_of(scenario)
    assert wheels is not None
    assert closest_limit(wheeled, scenario) == (pytest.approx(0.45 / min(wheels.momentum_limit)), "wheels' momentum")
    free = flight.recording.attrs | {"torque_limit": np.inf, "limit": "none"}
    assert closest_limit(replace(flight, recording=Recording(flight.recording.arrays, free)), flown.scenario()) == (0.0, "")


def test_the_data_is_json_and_small(reader: Reader) -> None:
    data = reader.data()
    assert [law["name"] for law in data["laws"]] == [flight.name for flight in flown.flights()]
    assert [plot["name"] for plot in data["plots"]] == [
        "angle",
        "speed",
        "roll-pitch-yaw",
        "quaternion",
        "rate",
        "torque",
        "accuracy",
    ]
    ids = {attrs.get("id") for _, attrs in reader.tags}
    assert {plot["name"] for plot in data["plots"]} <= ids
    for plot in data["plots"][:-1]:
        for panel in plot["panels"]:
            assert sorted(panel["order"]) == list(range(len(data["laws"])))
            assert all(len(curve) == len(data["times"]) for curve in panel["curves"])
    assert max(len(str(number)) for number in data["times"]) <= 12
    assert len(reader.scripts[0]) < 200_000


def test_the_views_show_the_recorded_attitudes(reader: Reader) -> None:
    scene = reader.data()["scene"]
    run = flown.flights()[0].run
    assert scene["times"][0] == 0.0
    assert scene["times"][-1] == pytest.approx(float(run["time"][-1]))
    shown_attitudes = np.array(scene["attitudes"][0])
    recorded = run["attitude_error"].sel(time=np.array(scene["times"]), method="nearest").values
    np.testing.assert_allclose(shown_attitudes, recorded, atol=2e-4)
    assert sum(tag == "canvas" for tag, _ in reader.tags) == len(flown.flights())


def test_the_earth_is_where_the_orbit_has_it(reader: Reader) -> None:
    scene = reader.data()["scene"]
    run = flown.flights()[0].run
    position = run["position"].sel(time=np.array(scene["times"]), method="nearest").values
    # The target's axes are inertial, and not turned, here.
    toward = -position / np.linalg.norm(position, axis=1, keepdims=True)
    np.testing.assert_allclose(np.array(scene["earth"]), toward, atol=2e-4)
    assert (scene["down"], scene["centre"]) == (False, "Earth")
    assert "The arrow leads to the Earth." in reader.text


def test_the_orbital_frame_has_the_earth_below() -> None:
    text = flown.text().replace('mode = "inertial"\nattitude = [1, 0, 0, 0]', 'mode = "orbital"')
    scenario = parse(
        text.replace("velocity = [0, 7550, 0]", "velocity = [0, 7550, 0]\ngravitational_parameter = 4.9e14"), "here"
    )
    (entry, _) = scenario.laws
    loop = build(scenario, entry)
    flight = replace(flown.flights()[0], recording=label(loop, *fly(loop, 100), 1))
    found = Reader(render(scenario, [flight]))
    scene = found.data()["scene"]
    np.testing.assert_allclose(np.array(scene["earth"]), np.tile([0.0, 0.0, 1.0], (len(scene["earth"]), 1)), atol=1e-4)
    assert (scene["down"], scene["centre"]) == (True, "planet")
    assert "which is down in the picture. The arrow leads to the planet." in found.text
    plain = parse(
        flown.text().split("[orbit]")[0]
        + "[initial]"
        + flown.text().split("[initial]")[1].replace("gravity_gradient = true", ""),
        "here",
    )
    still = Reader(render(plain, flown.flights()))
    assert still.data()["scene"]["earth"] is None
    assert "The arrow leads" not in still.text


def test_a_long_run_has_a_switch_to_its_transient(reader: Reader) -> None:
    assert "transient" not in reader.data()
    assert not any(attrs.get("id") == "transient-only" for _, attrs in reader.tags)
    first = flown.flights()[0]
    arrays = {name: np.repeat(values[-1:], 4001, axis=0) for name, values in first.recording.arrays.items()}
    arrays["time"] = 0.1 * np.arange(4001)
    half = 0.5 * np.exp(-0.1 * arrays["time"])
    arrays["attitude_error"] = np.column_stack([np.cos(half), np.sin(half), 0.0 * half, 0.0 * half])
    arrays["rate_error"] = np.column_stack([half, 0.0 * half, 0.0 * half])
    long = Reader(render(flown.scenario(), [replace(first, recording=Recording(arrays, first.recording.attrs))]))
    data = long.data()
    buttons = {str(attrs.get("id")) for tag, attrs in long.tags if tag == "button"}
    assert {name for name in buttons if not name.startswith("dials")} == {"play", "whole", "transient-only"}
    assert set(data["transient"]["plots"]) == {plot["name"] for plot in data["plots"]} - {"accuracy"}
    end = data["transient"]["times"][-1]
    assert end == pytest.approx(1.2 * 10.0 * np.log(50.0), abs=0.3)
    assert f"first {float(f'{end:.3g}'):g} s" in long.text
    for plot in data["transient"]["plots"].values():
        assert all(len(curve) == len(data["transient"]["times"]) for panel in plot["panels"] for curve in panel["curves"])
    # About half of the animation shows the transient; frames that would be equal are left out.
    times = np.array(data["scene"]["times"])
    assert 0.4 < (times <= end).mean() < 0.6


@pytest.mark.slow
def test_names_from_files_are_no_markup() -> None:
    name = flown.HOSTILE.replace("'", "")
    first, second = flown.flights()
    made = render(flown.scenario(name, name), [flown.renamed(first, name), second])
    found = Reader(made)
    assert sum(tag == "script" for tag, _ in found.tags) == 6
    assert not any(tag == "b" for tag, _ in found.tags)
    assert found.words.count(name) >= 3
    assert found.data()["laws"][0]["name"] == name
    assert "<5> mN m" in found.text
    # Data are the first two, of which nothing ends a script.
    assert "alert(" not in "".join(found.scripts[2:])
    other = Reader(render(flown.called(flown.told("l2-circle"), name), flown.stations("l2-circle")))
    assert sum(tag == "script" for tag, _ in other.tags) == 5
    assert "alert(" not in "".join(other.scripts[1:])
    assert name in other.words


def test_equal_flights_give_equal_bytes(tmp_path: Path, page: str, station: str) -> None:
    path, scenario = tmp_path / "report.html", flown.told("l2-deficit")
    write_text(path, render(flown.scenario(), flown.flights()))
    assert path.read_bytes() == page.encode()
    write_text(path, render(scenario, compare(scenario)))
    assert path.read_bytes() == station.encode()


def test_a_lost_run_is_told_and_the_others_are_shown() -> None:
    found = Reader(render(flown.scenario(), [*flown.flights(), flown.lost("wild <one>")]))
    assert "wild <one> (at 6.7 s)" in found.text
    assert "diverged" in found.words
    assert any(attrs.get("class") == "alarm" for _, attrs in found.tags)
    assert sum(tag == "tr" and attrs.get("class") == "lost" for tag, attrs in found.tags) == 1
    data = found.data()
    assert len(data["scene"]["attitudes"][2]) < len(data["scene"]["attitudes"][0])
    assert "wild <one>" in found.words


def test_one_law_and_a_run_at_rest() -> None:
    found = Reader(render(flown.scenario(), [flown.still()]))
    assert not any("best" in str(attrs.get("class")) for _, attrs in found.tags)
    assert found.data()["plots"][0]["panels"][0]["log"] is False


def test_a_name_with_dashes_inside_the_scripts_is_harmless() -> None:
    first = flown.renamed(flown.flights()[0], "<!--<script>")
    made = render(flown.scenario(), [first])
    assert "<!--" not in re.split(r'id="data">', made)[1].split("</script>")[0]
    assert Reader(made).data()["laws"][0]["name"] == "<!--<script>"


@pytest.mark.parametrize("inertia", [(2.0, 3.0, 4.0), ((9000, 120, -60), (120, 2500, 90), (-60, 90, 9800)), (1.0, 1.0, 1.0)])
def test_the_outline_has_the_inertia_of_a_uniform_box(inertia: Any) -> None:
    size, axes = _box(inertia)
    a2, b2, c2 = size**2
    made = axes @ np.diag([b2 + c2, a2 + c2, a2 + b2]) @ axes.T
    wanted = check_inertia(inertia)
    np.testing.assert_allclose(made / np.trace(made), wanted / np.trace(wanted), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert size.max() == pytest.approx(0.95)


def test_settings_tell_what_flies() -> None:
    plain = settings(load("cubesat-slew"))
    # In the units in which the file has them.
    turned = settings(load("cubesat-slew").with_({"initial.rate": ["2 deg/s", "0 deg/s", "-1 deg/s"]}))
    assert "<td>rate</td><td>2 deg/s, 0 deg/s, -1 deg/s</td>" in turned
    assert "<h3>target</h3>" in plain
    assert "requirement" not in plain
    own = load("cubesat-slew").with_({"target": None, "part": [{"type": "sun"}]})
    shown = settings(own)
    assert "<h3>target</h3>" not in shown
    assert "<h3>target sun</h3>" in shown
