"""The published landing phase under modal control, and the search behind its root."""

import csv
import math

import numpy as np
import pytest

from starhold.analysis.transient import Limits
from starhold.report.commands.modal_roots import present
from starhold.report.figures import save
from starhold.report.tables import write_table
from starhold.scenario.reading import builtin_text, load, parse
from starhold.studies.compare import compare
from starhold.studies.modal_roots import law_lines, pick_modal, problem_of, study

LIMITS = Limits(math.radians(30.0), math.radians(50.0))
CHECKED = {10: -1.564, 45: -1.054, 85: -0.896, 90: -0.858, 135: -0.548, 180: -0.376}
"""Best roots at some angles (deg), of another program in continuous time."""


@pytest.fixture(scope="module")
def flights():
    return {flight.name: flight.metrics for flight in compare(load("landing"))}


@pytest.fixture(scope="module")
def found():
    scenario = load("landing-limits")
    return study(scenario, pick_modal(scenario, None))


@pytest.mark.parametrize("name", ["fit", "rounded"])
def test_the_published_turn(flights, name):
    seen = flights[name]
    assert seen["transient_time"] == pytest.approx(22.8, abs=0.13)
    assert math.degrees(seen["peak_rate"]) == pytest.approx(28.3, abs=0.06)
    assert np.degrees(seen["peak_accelerations"]) == pytest.approx([2.1, 16.4, 16.1], abs=0.08)
    assert seen["limits_kept"]


def test_the_search_for_this_very_start_beats_the_fit(flights):
    assert flights["searched"]["transient_time"] < flights["fit"]["transient_time"] - 1.2
    assert flights["searched"]["limits_kept"]
    scenario = load("landing")
    (item,) = study(scenario, pick_modal(scenario, None)).results
    assert item.hard.root == scenario.pick("searched").gains.phi_0[0]
    assert item.hard.transient.peak_rate == pytest.approx(flights["searched"]["peak_rate"], rel=1e-9)
    assert item.hard.time == pytest.approx(flights["searched"]["transient_time"], rel=1e-9)


def test_the_fit_gives_the_published_root_at_the_angle_of_the_start():
    entry = load("landing").pick("fit")
    assert math.degrees(entry.spec.angle) == pytest.approx(163.74, abs=0.005)
    assert entry.gains.phi_0[0] == pytest.approx(-0.428, abs=5e-4)


def test_hard_limits_give_the_published_fit_at_every_angle(found):
    assert np.degrees(found.angles) == pytest.approx(np.arange(10.0, 181.0, 5.0))
    off = np.abs(found.published.errors(found.angles, found.roots))
    assert off.max() < 0.015
    by_angle = dict(zip(np.rint(np.degrees(found.angles)).astype(int).tolist(), found.roots.tolist(), strict=True))
    for angle, root in CHECKED.items():
        assert by_angle[angle] == pytest.approx(root, rel=3e-3)


def test_the_acceleration_decides_below_85_degrees_and_the_rate_above(found):
    for item in found.results:
        seen = item.hard.transient
        assert seen.keeps(LIMITS)
        tight = max(seen.peak_acceleration) / LIMITS.acceleration, seen.peak_rate / LIMITS.rate
        assert tight[0 if item.angle < math.radians(86.0) else 1] > 0.997


def test_the_next_faster_root_breaks_a_limit(found):
    scenario = load("landing-limits")
    problem = problem_of(scenario, scenario.laws[0])
    for item in found.results[::5]:
        faster, same = (problem.fly(item.angle, [item.hard.root + less])[0] for less in (-0.001, 0.0))
        assert same == item.hard.transient
        assert not faster.keeps(LIMITS)


def test_the_own_fit_is_no_worse_than_the_published_one(found):
    own, published = (np.abs(pieces.errors(found.angles, found.roots)) for pieces in (found.fitted, found.published))
    assert np.sqrt(np.mean(own**2)) < 0.8 * np.sqrt(np.mean(published**2))
    assert own.max() < published.max()


def test_tolerances_buy_five_to_twelve_per_cent(found):
    gains = [1.0 - item.eased.time / item.hard.time for item in found.results]
    assert 0.05 < min(gains) < max(gains) < 0.12


def test_what_is_printed_is_read_back(found, tmp_path):
    text = builtin_text("landing-limits")
    scenario = parse(text[: text.index("[[law]]")] + "\n".join(law_lines(found.fitted, found.b)), "pasted")
    assert scenario.laws[0].gains.phi_0[0] == pytest.approx(float(found.fitted.at(math.radians(90.0))), rel=1e-4)
    result = present(scenario, scenario.laws[0], found)
    write_table(result.numbers, tmp_path / "roots.csv")
    with (tmp_path / "roots.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["root"]) for row in rows] == found.roots.tolist()
    assert {"peak_acceleration_z", "eased_root", "eased_time", "fit_root", "published_root"} <= set(rows[0])
    one, other = (save(result.figure(), tmp_path / f"{name}.png").read_bytes() for name in "ab")
    assert one == other


def test_the_published_fit_is_shown_beside_the_published_problem_alone():
    text = builtin_text("landing-limits").replace('step = "5 deg"', 'step = "85 deg"').replace("step = 0.001", "step = 0.05")
    for old, new in (
        ('"30 deg/s" ', '"29 deg/s" '),
        ("[1, 1, 1]", "[1, 1, 2]"),
        ('form = "fit"', 'form = "fit"\nb = -0.02'),
    ):
        assert old in text
        scenario = parse(text.replace(old, new), "other")
        assert study(scenario, scenario.laws[0]).published is None
    scenario = parse(text, "same")
    found = study(scenario, scenario.laws[0])
    assert found.published is not None
    assert found.fitted is None
