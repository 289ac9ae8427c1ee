"""The map of the degree of stability shows what it should, alike each time, whatever bounds the gains."""

from pathlib import Path

import numpy as np
import pytest

from starhold.report.figures import save
from starhold.report.stability_map import LINE, draw_map, stability_map
from starhold.synthesis.stability_degree import boundary, optimum
from tests.report.flown import pixels
from tests.tiers import leading

GIVEN = [
    ((1.0, 1.5, 2.0), 0.5, 0.3, 2.0),
    ((1.0, 0.75, 0.5), 0.5, 0.3, 2.0),
    ((1.0, 1.0, 1.0), 0.5, 0.0, 2.0),
    ((1.0, 1.5, 1.0), 0.0, 0.3, 2.0),
    ((1.0, 1.1, 0.2), 0.5, 1e5, 2.0),
]


@pytest.mark.slow
@pytest.mark.parametrize("given", leading([(given,) for given in GIVEN]))
def test_map_line_and_optimum_are_drawn(tmp_path: Path, given: tuple[tuple[float, ...], float, float, float]) -> None:
    path = save(draw_map(*given), tmp_path / "map.png")
    assert list(tmp_path.iterdir()) == [path]
    picture = pixels(path)
    assert picture.shape == (682, 880, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500
    wanted = np.array([int(LINE[i : i + 2], 16) for i in (1, 3, 5)])
    budget = np.abs(picture - wanted).max(axis=2) < 12
    assert budget.sum() > 700
    # The optimum: half of the axes' width and 1 / 1.6 of their height, as a star wider than the line.
    row, column = round(682 * (0.13 + 0.70 * (1.0 - 1.0 / 1.6))), round(880 * (0.085 + 0.745 / 2.0))
    assert budget[row - 6 : row + 7, column - 5 : column + 6].sum() > 60


@pytest.mark.slow
def test_equal_arguments_give_equal_files(tmp_path: Path) -> None:
    first, second, other = (
        save(draw_map(*given), tmp_path / f"{number}.png").read_bytes()
        for number, given in enumerate([GIVEN[0], *GIVEN[:2]])
    )
    assert first == second
    assert first != other


@pytest.mark.parametrize("given", GIVEN)
def test_the_map_peaks_within_the_budget_at_the_optimum(given: tuple[tuple[float, ...], float, float, float]) -> None:
    what = stability_map(*given)
    assert what.best == optimum(*given)
    allowed = np.where(what.ask <= 1.0, what.eta, -np.inf)
    assert allowed.max() <= what.best.eta * (1.0 + 1e-12)
    assert allowed.max() > 0.98 * what.best.eta
    # Below the border the damping alone decides, and above it does not.
    below = what.K_a >= boundary(given[0]) * what.K_w[:, None] ** 2
    flat = np.broadcast_to(what.K_w[:, None] / (2.0 * max(given[0])), below.shape)
    np.testing.assert_allclose(what.eta[below], flat[below], rtol=1e-6)
    assert (what.eta[~below] < flat[~below]).all()


def test_bad_input_draws_nothing() -> None:
    with pytest.raises(ValueError, match="bounds no gain"):
        draw_map((1.0, 1.5, 2.0), 0.0, 0.0, 2.0)
