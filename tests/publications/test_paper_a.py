"""The publication on linear-quadratic stabilisation: its measures against SciPy and algebra, and its verdicts."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from starhold.laws import lqr
from starhold.parts.craft import make_craft
from starhold.publications.papers.A import measures
from starhold.synthesis.riccati import linear_model
from tests.tiers import fewer


@pytest.mark.parametrize("form", ["I", "II", "III"])
def test_solution_of_the_riccati_equation_is_scipys(form):
    for inertia, spec in measures._specs(form)[: fewer(20)]:
        q, r, p = lqr.riccati_problem(make_craft(inertia), spec)
        # SciPy is given units in which the numbers are of one size.
        size, time = float(np.trace(inertia)) / 3.0, float(np.sqrt(p[5, 5] / p[2, 2]))
        a, b = linear_model(inertia / size)
        units = np.diag([1.0] * 3 + [time] * 3)
        weight = np.linalg.inv(units) @ q @ np.linalg.inv(units)
        scale = float(np.abs(weight).max())
        found = solve_continuous_are(units @ a @ np.linalg.inv(units) * 1.0, units @ b, weight / scale, r * size**2 / scale)
        ours = np.linalg.inv(units) @ p @ np.linalg.inv(units) / scale
        bound = np.sqrt(np.outer(np.diag(ours), np.diag(ours)))
        assert (np.abs(found - ours) / bound).max() < 1e-6
