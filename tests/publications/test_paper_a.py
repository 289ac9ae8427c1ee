"""The publication on linear-quadratic stabilisation: its measures against SciPy and algebra, and its verdicts."""

import numpy as np
import pytest
import sympy
from scipy.linalg import solve_continuous_are

from starhold.laws import lqr
from starhold.parts.craft import make_craft
from starhold.publications.desk import Desk
from starhold.publications.papers.A import measures
from starhold.publications.reproduction import reproduce
from starhold.synthesis.riccati import linear_model


@pytest.mark.parametrize("form", ["I", "II", "III"])
def test_solution_of_the_riccati_equation_is_scipys(form):
    for inertia, spec in measures._specs(form)[:20]:
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


def test_gyroscopic_term_is_kappa_times_the_rates():
    """The identity behind (2.22) and (2.23), by symbols."""
    w, moments, y = (sympy.symbols(f"{name}1:4") for name in "wJy")
    rate, momentum = sympy.Matrix(w), sympy.Matrix([j * x for j, x in zip(moments, w, strict=True)])
    power = (sympy.diag(*(1 / x for x in y)) * rate).dot(rate.cross(momentum))
    j1, j2, j3 = moments
    kappa = (j3 - j2) / y[0] + (j1 - j3) / y[1] + (j2 - j1) / y[2]
    assert sympy.expand(power - kappa * w[0] * w[1] * w[2]) == 0
    solved = (j3 - j1) * y[0] * y[2] / ((j3 - j2) * y[2] + (j2 - j1) * y[0])
    assert sympy.simplify(kappa.subs(y[1], solved)) == 0


def test_gravity_torque_is_the_largest_over_all_directions():
    directions = np.random.default_rng(1).normal(size=(200_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    moments = np.array([0.0, 1e4, 1e4])
    torque = 3.0 * measures.ORBIT**2 * np.linalg.norm(np.cross(directions, moments * directions), axis=1)
    assert measures.gravity_torque(Desk("A")).value[1] == pytest.approx(torque.max(), rel=1e-3)


@pytest.mark.slow
def test_verdicts_are_those_recorded():
    made = reproduce("A")
    assert made.changed == []
    assert set(made.files) == {"stabilisation", "skew-axes", "disturbed"}
