"""The indices of pointing errors against closed forms and independent formulas."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from starhold.analysis import pointing
from starhold.analysis.pointing import about_axes, figures, indices, level, root_sum_square


@pytest.mark.parametrize(("length", "apart"), [(1, 1), (2, 5), (16, 3), (25, 25)])
def test_indices_are_those_of_rolling_means(length, apart):
    errors = np.random.default_rng(length).normal(size=(3, 50, 3))
    found = indices(errors, length, apart)
    for run in range(3):
        means = pd.DataFrame(errors[run]).rolling(length).mean().to_numpy()[length - 1 :]
        assert found["MPE"][run] == pytest.approx(means, abs=1e-13)
        assert found["PDE"][run] == pytest.approx(means[apart:] - means[:-apart], abs=1e-13)
        relative = [errors[run, at : at + length] - mean for at, mean in enumerate(means)]
        assert found["RPE"][run] == pytest.approx(np.concatenate(relative), abs=1e-13)


@pytest.mark.parametrize("most", [40_000, 90_000, 10**9])
def test_of_too_many_windows_the_largest_error_is_short_by_the_stated_share_at_most(monkeypatch, most):
    errors = np.cumsum(np.random.default_rng(2).standard_t(2, size=(4, 500, 3)), axis=1)
    exact = np.linalg.norm(indices(errors, 60, 1)["RPE"], axis=-1).max()
    monkeypatch.setattr(pointing, "MOST", most)
    taken = indices(errors, 60, 1)["RPE"]
    apart = pointing.spacing(4, 500, 60)
    assert taken.size <= 3 * max(most + 4 * 60, 4 * 442 * 60 // 15)
    assert (1.0 - pointing.shortfall(apart, 60)) * exact <= np.linalg.norm(taken, axis=-1).max() <= exact
    # The last instants are in a window too.
    last = errors[:, -60:]
    assert taken[:, -60:] == pytest.approx(last - last.mean(axis=1, keepdims=True), abs=1e-9)


@pytest.mark.parametrize(("length", "apart"), [(0, 1), (5, 0), (30, 21), (51, 1)])
def test_windows_that_do_not_fit_are_refused(length, apart):
    with pytest.raises(ValueError, match="among 50"):
        indices(np.zeros((1, 50, 3)), length, apart)


def test_levels_are_the_quantiles_of_what_they_are_told_to_be_of():
    values = np.array([[-9.0, *range(9)], [*range(10, 19), -30.0]])
    sizes = np.abs(values)
    assert level(values, 0.5, "mixed") == np.sort(sizes.ravel())[9]
    assert level(values, 0.9, "temporal") == np.sort(sizes[1])[8]
    assert level(values, 0.5, "ensemble") == 9.0
    for interpretation in ("mixed", "temporal", "ensemble"):
        assert level(values, 1.0, interpretation) == 30.0


def test_levels_of_gaussian_errors_are_those_of_their_distributions():
    vectors = np.random.default_rng(11).normal(size=(400, 2000, 3))
    found = {axis: level(values, 0.9973, "mixed") for axis, values in about_axes(vectors, (0.0, 3.0, 4.0)).items()}
    assert found["x"] == pytest.approx(stats.norm.isf(0.5 * 0.0027), rel=0.01)
    assert found["angle"] == pytest.approx(stats.maxwell.isf(0.0027), rel=0.01)
    assert found["line of sight"] == pytest.approx(stats.rayleigh.isf(0.0027), rel=0.01)


def test_line_of_sight_is_tilted_by_turns_across_it_alone():
    turns = np.array([[[0.0, 3e-4, 4e-4], [2e-4, 0.0, 0.0], [0.0, 4e-4, -3e-4]]])
    assert about_axes(turns, (0.0, 0.3, 0.4))["line of sight"] == pytest.approx(np.array([[0.0, 2e-4, 5e-4]]), abs=1e-19)
    assert "line of sight" not in about_axes(turns)


def test_root_sum_square_of_independent_errors_is_the_deviation_of_their_sum():
    rng = np.random.default_rng(3)
    parts = [rng.normal(scale=scale, size=(50, 4000)) for scale in (1.0, 2.0, 0.5)]
    combined = root_sum_square([figures(part, 0.9973, "mixed") for part in parts])
    total = figures(sum(parts), 0.9973, "mixed")
    assert combined.deviation == pytest.approx(total.deviation, rel=0.01)
    assert combined.level == pytest.approx(total.level, rel=0.02)
    assert combined.mean is None
