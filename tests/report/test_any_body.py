"""A body that starhold has no study and no report of: it is flown, measured, drawn and told all the same."""

from dataclasses import dataclass, fields
from pathlib import Path

import pytest

from starhold.report.body import report_of
from starhold.report.page import render
from starhold.report.results import write_results
from starhold.scenario.reading import Scenario
from starhold.studies import compare
from starhold.studies.body import study_of
from tests.report import flown
from tests.report.reader import Reader


@dataclass(frozen=True, repr=False)
class Balloon(Scenario):
    """A scenario of a body that nothing here knows."""

    @property
    def body(self) -> str:
        return "hot-air-balloon"


@pytest.fixture(scope="module")
def balloon() -> Balloon:
    known = flown.scenario()
    return Balloon(**{field.name: getattr(known, field.name) for field in fields(known)})


def test_each_body_is_found_by_its_name() -> None:
    studies = {
        name: study_of(name) for name in ("rigid-body", "libration-point", "hot-air-balloon", "any-body", "my.balloon")
    }
    reports = {name: report_of(name) for name in studies}
    for found in (studies, reports):
        assert found["hot-air-balloon"] is found["my.balloon"] is found["any-body"]
        assert len(set(map(id, found.values()))) == 3


@pytest.mark.slow
def test_every_recorded_quantity_is_drawn_and_told(balloon: Balloon, tmp_path: Path) -> None:
    flights = compare.compare(balloon)
    reader = Reader(render(balloon, flights))
    names = [name.replace("_", "-") for name in flights[0].recording.columns]
    assert [plot["name"] for plot in reader.data()["plots"]] == names
    assert {"effort", "peak command", "final rate"} <= set(reader.words)
    assert sum(tag == "script" for tag, _ in reader.tags) == 4
    assert sorted(path.stem for path in flown.draw(flights, tmp_path, balloon)) == sorted(names)
    page = write_results(balloon, flights, tmp_path)
    assert page.exists()
    assert "no theorem is about the body hot-air-balloon" in page.read_text()
    assert (tmp_path / "certificate.json").exists()


def test_half_the_step_is_tried_on_all_that_it_records(balloon: Balloon) -> None:
    entry = balloon.laws[0]
    loop = compare.build(balloon, entry)
    flight = compare.fly_law(balloon, entry, loop)
    errors = compare.check_step(balloon, loop, flight).metrics["step_error"]
    assert set(errors) == set(flight.recording.columns)
    assert 0.0 < errors["attitude"] < 1e-6
