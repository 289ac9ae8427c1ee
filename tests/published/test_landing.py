"""The published landing phase under modal control, and the search behind its root."""

import numpy as np
import pytest

from starhold.scenario.reading import builtin_text, load, parse
from starhold.studies.modal_roots import pick_modal, study

CHECKED = {10: -1.564, 45: -1.054, 85: -0.896, 90: -0.858, 135: -0.548, 180: -0.376}
"""Best roots at some angles (deg), of another program in continuous time."""


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
