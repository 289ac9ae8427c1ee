"""The publication on reaction wheels: its optimum against SciPy's search, and its verdicts."""

import numpy as np
import pytest
from scipy.optimize import differential_evolution

from starhold.publications.desk import Desk
from starhold.publications.papers.C import measures


def slowest(gains, ratios):
    """The degree of stability from polynomial roots."""
    return -max(np.roots([i, gains[1], 2.0 * gains[0]]).real.max() for i in ratios)


def test_example_is_what_an_optimiser_finds():
    ratios, alpha, omega, budget = measures.EXAMPLE

    def asked(gains):
        over = 2.0 * gains[0] * alpha + gains[1] * omega - budget
        return -slowest(gains, ratios) + 100.0 * max(over, 0.0)

    found = differential_evolution(asked, [(0.0, 2.0), (0.0, 6.5)], seed=3, tol=1e-10, popsize=25)
    assert -found.fun == pytest.approx(0.8220, abs=2e-4)
    assert found.x == pytest.approx([1.0136, 3.2881], abs=5e-3)


def test_dotted_lines_are_of_equal_degree():
    panel = measures.regions(Desk("C")).panels[0]
    ratios = measures.EXAMPLE[0]
    lines = [curve for curve in panel.curves if curve.style == "dotted"]
    assert len(lines) == 3
    for line in lines:
        eta = float(line.label.split("=")[1])
        # The end of the first leg lies beyond the picture; from the corner on all is of this degree.
        assert all(slowest(gains, ratios) == pytest.approx(eta, rel=2e-3) for gains in zip(line.x, line.y, strict=True))
