"""The published landing phase under modal control, and the search behind its root."""

import csv
import math

import numpy as np
import pytest

from starhold.report.commands.modal_roots import present
from starhold.report.figures import save
from starhold.report.tables import write_table
from starhold.scenario.reading import builtin_text, load, parse
from starhold.studies.modal_roots import law_lines, pick_modal, study

CHECKED = {10: -1.564, 45: -1.054, 85: -0.896, 90: -0.858, 135: -0.548, 180: -0.376}
"""Best roots at some angles (deg), of another program in continuous time."""


COARSE = builtin_text("landing-limits").replace('step = "5 deg"', 'step = "20 deg"').replace("step = 0.001", "step = 0.01")


@pytest.mark.slow
def test_hard_limits_give_the_published_fit_at_every_angle():
    scenario = load("landing-limits")
    found = study(scenario, pick_modal(scenario, None))
    assert np.degrees(found.angles) == pytest.approx(np.arange(10.0, 181.0, 5.0))
    fitted, published = (np.abs(pieces.errors(found.angles, found.roots)) for pieces in (found.fitted, found.published))
    assert fitted.max() < published.max() < 0.015
    assert np.sqrt(np.mean(fitted**2)) < 0.8 * np.sqrt(np.mean(published**2))
    by_angle = dict(zip(np.rint(np.degrees(found.angles)).astype(int).tolist(), found.roots.tolist(), strict=True))
    for angle, root in CHECKED.items():
        assert by_angle[angle] == pytest.approx(root, rel=3e-3)
    # Tolerances buy five to twelve per cent.
    gains = [1.0 - item.eased.time / item.hard.time for item in found.results]
    assert 0.05 < min(gains) < max(gains) < 0.12


def test_what_is_printed_is_read_back(tmp_path):
    text = COARSE
    scenario = parse(text, "coarse")
    found = study(scenario, scenario.laws[0])
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
