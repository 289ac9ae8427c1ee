"""Report of station keeping: the page opens offline and is the same every time, the pictures show every law."""

from pathlib import Path

import numpy as np
import pytest

from starhold.analysis.libration_point import METRICS
from starhold.report.page import render
from starhold.report.path_plots import collect, phase_portrait
from tests.report.flown import draw, pixels, shows_laws, told
from tests.report.flown import stations as flights
from tests.report.reader import Reader
from tests.tiers import leading


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(render(told("l2-deficit"), flights("l2-deficit")))


def test_every_law_every_metric_and_every_picture_is_there(reader: Reader) -> None:
    for flight in flights("l2-deficit"):
        assert flight.name in reader.words
        for metric in METRICS.measures:
            if metric in flight.metrics:
                assert METRICS.shown(metric, flight.metrics[metric]) in reader.words, metric
    data = reader.data()
    assert [plot["name"] for plot in data["plots"]] == ["deviation", "deviation-further", "control", "projections"]
    ids = {attrs.get("id") for _, attrs in reader.tags}
    assert {plot["name"] for plot in data["plots"]} <= ids
    assert [(p["xlabel"], p["ylabel"]) for p in data["plots"][-1]["planes"]] == [
        ("x", "y"),
        ("y", "z"),
        ("u_y", "u_z"),
        ("u_x", "u_z"),
    ]
    assert len(data["scene"]["paths"]) == len(flights("l2-deficit"))
    assert "(at 288" in reader.text
    assert "0.505" in reader.text
    assert len(reader.scripts[0]) < 900_000


@pytest.mark.parametrize("name", leading(["l2-circle", "l2-deficit", "l2-equilibrium"]))
def test_every_figure_is_drawn_with_every_law(tmp_path: Path, name: str) -> None:
    paths = draw(flights(name), tmp_path, told(name))
    names = {"deviation.png", "control.png", "projections.png", "space.png"} | (
        {"phase.png"} if name == "l2-equilibrium" else set()
    )
    assert {path.name for path in paths} == names
    for path in paths:
        picture = pixels(path)
        assert picture.shape[1] == 880
        assert shows_laws(picture, len(flights(name))), path.name


@pytest.mark.slow
def test_one_law_and_a_lost_one_alone_are_drawn(tmp_path: Path) -> None:
    for number in (0, 3):
        assert draw(flights("l2-deficit")[number : number + 1], tmp_path, told("l2-deficit"))
        render(told("l2-deficit"), flights("l2-deficit")[number : number + 1])


def test_the_phase_portrait_is_as_the_publication_draws_it() -> None:
    scenario = told("l2-equilibrium")
    plot = phase_portrait(flights("l2-equilibrium"), scenario.laws, scenario)
    assert plot is not None
    (plane,) = plot.planes
    saddle = scenario.laws[0].options.limit / (1.0 + 2.0 * scenario.craft.stiffness)
    points = next(guide for guide in plane.guides if guide.kind == "points")
    assert np.sort(points.x).tolist() == pytest.approx([-saddle, saddle])
    # Scaled by the saddle's distance and the natural rate it is x'' = x + sat(-2x - 2x'): the separatrices are x + x' = +-1,
    # and the linear zone |x + x'| < 1/2 is half of the region of attraction.
    for guide in plane.guides:
        if guide.kind == "dashed":
            inside = np.abs(guide.x) < 2.0 * saddle
            edge = np.abs(guide.x + guide.y)[inside]
            assert np.ptp(edge) < 1e-4 * saddle
    first = next(guide for guide in plane.guides if guide.kind == "dashed")
    zone = next(guide for guide in plane.guides if guide.kind == "dark")
    assert abs(zone.x[0] + zone.y[0]) == pytest.approx(0.5 * abs(first.x + first.y)[len(first.x) // 2], rel=1e-4)
    assert phase_portrait(flights("l2-circle"), told("l2-circle").laws, told("l2-circle")) is None


def test_curves_over_time_are_in_si() -> None:
    scenario = told("l2-circle")
    plots = collect(flights("l2-circle"), 2000, scenario)
    deviation, control = plots.over_time
    assert plots.times[-1] == pytest.approx(365.25, abs=1.0)
    assert deviation.clock == "days"
    assert deviation.panels[0].curves[0][0] == pytest.approx(-0.25 * 12742, rel=1e-3)
    assert control.panels[3].levels == pytest.approx([scenario.laws[0].options.limit * 0.505092], rel=1e-4)
