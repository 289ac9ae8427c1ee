"""The closed forms against SciPy's Riccati solver, over thousands of random spacecraft and weights."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from starhold.laws import lqr
from starhold.parts.craft import make_craft, tensor
from starhold.scenario.reading import builtin_text, parse
from starhold.synthesis.riccati import linear_model, riccati_residual, solve_riccati
from starhold.synthesis.weights import BALANCES
from tests.refusals import refused

RANDOM = np.random.default_rng(1960)


def random_inertia(full):
    """A body of six point masses, from grams to tonnes; principal axes unless `full`."""
    points = RANDOM.normal(size=(6, 3)) * 10.0 ** RANDOM.uniform(-1, 2)
    inertia = np.trace(points.T @ points) * np.eye(3) - points.T @ points
    return inertia if full else np.diag(RANDOM.permutation(np.linalg.eigvalsh(inertia)))


def numerical_feedback(inertia, q, r):
    a, b = linear_model(inertia)
    return np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))


def close(gains, feedback):
    """Both gain matrices within 1e-9 of the numerical ones, relative to the largest entry of each."""
    for found, expected in ((tensor(gains.k_rate), feedback[:, :3]), (tensor(gains.k_attitude), feedback[:, 3:])):
        if np.abs(found - expected).max() > 1e-9 * np.abs(expected).max():
            return False
    return True


def test_form_i_is_the_regulator_of_its_weights():
    for _ in range(1000):
        inertia = random_inertia(full=True)
        a, b = 10.0 ** RANDOM.uniform(-4, 0, size=2)
        gains = lqr.design(make_craft(inertia), lqr.FormI(a, b))
        # Any R > 0 gives the same gains; this one is full.
        root = RANDOM.normal(size=(3, 3))
        r = root @ root.T + np.eye(3)
        z = np.linalg.inv(inertia) @ np.linalg.inv(r) @ np.linalg.inv(inertia)
        scale = 1.0 / np.linalg.norm(np.linalg.inv(z))
        q = np.kron(np.diag([a, b**2]), np.linalg.inv(z)) * scale
        q = 0.5 * (q + q.T)
        p11, p12, p22 = (np.sqrt(a + b), b, 2 * b * np.sqrt(a + b))
        p = np.kron(np.array([[p11, p12], [p12, p22]]), np.linalg.inv(z)) * scale
        assert riccati_residual(p, inertia, q, r * scale) < 1e-9
        assert close(gains, np.linalg.solve(r * scale, np.linalg.solve(inertia, p[:3])))


@pytest.mark.parametrize("form", ["II", "III"])
def test_diagonal_forms_equal_the_numerical_solution(form):
    for _ in range(1000):
        inertia = random_inertia(full=form == "III")
        weights = 10.0 ** RANDOM.uniform(-2, 2, size=6)
        costs = 10.0 ** RANDOM.uniform(-2, 2, size=3)
        gains = lqr.design(make_craft(inertia), lqr.FORMS[form](tuple(weights), tuple(costs)))
        axes = np.linalg.eigh(inertia)[1] if form == "III" else np.eye(3)
        both = np.kron(np.eye(2), axes)
        feedback = numerical_feedback(inertia, both @ np.diag(weights) @ both.T, axes @ np.diag(costs) @ axes.T)
        assert close(gains, feedback)


def test_numeric_form_takes_any_weights_and_agrees_with_form_ii():
    craft = make_craft([2.0, 3.0, 4.0])
    weights, costs = (0.3, 0.2, 0.1, 0.5, 0.4, 0.6), (50.0, 40.0, 60.0)
    two = lqr.design(craft, lqr.FormII(weights, costs))
    other = lqr.design(craft, lqr.Numeric(np.diag(weights), np.diag(costs)))
    assert close(two, np.hstack([tensor(other.k_rate), tensor(other.k_attitude)]))
    for _ in range(100):
        inertia = random_inertia(full=True)
        root, cost = RANDOM.normal(size=(6, 6)), RANDOM.normal(size=(3, 3))
        q, r = root @ root.T + 0.1 * np.eye(6), cost @ cost.T + 0.1 * np.eye(3)
        p, feedback = solve_riccati(inertia, q, r)
        assert close(lqr.Gains(feedback[:, :3], feedback[:, 3:]), numerical_feedback(inertia, q, r))
        assert riccati_residual(p, inertia, q, r) < 1e-12
        assert np.linalg.eigvalsh(p).min() > 0.0


def test_equal_stiffness_is_globally_stable_and_the_law_says_so():
    """With y equal on all axes the gyroscopic torque does no work on V, whatever the inertia."""
    craft = make_craft([2.0, 3.0, 4.0])
    gains = lqr.design(craft, lqr.FormII((0.1, 0.2, 0.3, 0.4, 0.4, 0.4), (50.0, 50.0, 50.0)))
    weight = np.linalg.inv(tensor(gains.k_attitude))
    for rate in RANDOM.normal(size=(20, 3)):
        assert abs(rate @ weight @ np.cross(rate, tensor(craft.inertia) @ rate)) < 1e-12


def test_the_gain_that_balances_the_middle_axis():
    """y2 = (J3 - J1) y1 y3 / ((J3 - J2) y3 + (J2 - J1) y1) makes the gyroscopic torque do no work on V."""
    j, y1, y3 = np.array([2.0, 3.0, 4.0]), 0.1, 0.3
    y2 = (j[2] - j[0]) * y1 * y3 / ((j[2] - j[1]) * y3 + (j[1] - j[0]) * y1)
    weights = (0.1, 0.1, 0.1, y1**2, y2**2, y3**2)
    gains = lqr.design(make_craft(j), lqr.FormII(weights, (1.0, 1.0, 1.0)))
    for rate in RANDOM.normal(size=(20, 3)):
        assert abs(rate @ np.diag(1 / np.array(gains.k_attitude)) @ np.cross(rate, j * rate)) < 1e-12


@pytest.mark.parametrize(
    "spec",
    [
        lqr.FormI(0.1, 0.02),
        lqr.FormII((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (50.0, 40.0, 30.0)),
        lqr.FormIII((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (50.0, 40.0, 30.0)),
        lqr.Numeric(np.eye(6), np.eye(3)),
    ],
    ids=lambda spec: type(spec).__name__,
)
def test_explanation_judges_the_design(spec):
    craft = make_craft([2.0, 3.0, 4.0])
    told = dict(lqr.explain(craft, spec))
    assert told["Riccati residual, relative"] < 1e-12
    assert told.get("P against SciPy, relative", 0.0) < 1e-9
    assert told["degree of stability (1/s)"] > 0.0
    if not isinstance(spec, lqr.Numeric):
        q, r, closed = lqr.riccati_problem(craft, spec)
        gains = lqr.design(craft, spec)
        assert np.array_equal(closed, told["P"])
        assert riccati_residual(closed, tensor(craft.inertia), q, r) < 1e-12
        assert close(gains, np.linalg.solve(r, np.linalg.solve(tensor(craft.inertia), closed[:3])))


def test_gyroscopic_residual_is_the_largest_power():
    for _ in range(20):
        inertia = random_inertia(full=False)
        stiffness = np.diag(RANDOM.uniform(0.1, 1.0, size=3))
        rates = RANDOM.normal(size=(200_000, 3))
        rates /= np.linalg.norm(rates, axis=1, keepdims=True)
        power = np.einsum("ki,ij,kj->k", rates, np.linalg.inv(stiffness), np.cross(rates, rates @ inertia))
        assert lqr.gyroscopic_residual(inertia, stiffness) == pytest.approx(np.abs(power).max(), rel=1e-3)


@pytest.mark.parametrize("order", [(2.0, 3.0, 4.0), (4.0, 2.0, 3.0), (3.0, 4.0, 2.0), (3.0, 2.0, 4.0)])
def test_balance_moves_the_named_weight_or_all_of_them_least(order):
    moments, craft = np.array(order), make_craft(order)
    middle = order.index(3.0)
    for _ in range(15):
        q, r = 10.0 ** RANDOM.uniform(-2, 2, size=6), 10.0 ** RANDOM.uniform(-2, 2, size=3)
        for name in ("least", f"q{middle + 4}", f"r{middle + 1}"):
            spec = lqr.FormII(tuple(q), tuple(r), BALANCES.index(name))
            q2, r2 = lqr.balanced(moments, spec)
            gains = lqr.design(craft, spec)
            size = np.abs(1.0 / np.array(gains.k_attitude)).max()
            assert lqr.gyroscopic_residual(np.diag(moments), np.diag(gains.k_attitude)) < 1e-14 * size
            moved = np.log(np.r_[q2 / q, r2 / r])
            if name == "least":
                least = np.abs(moved @ moved)
                assert np.abs(moved[:3]).max() == 0.0
            else:
                assert np.count_nonzero(moved) == 1
                assert least <= moved @ moved * (1 + 1e-9)


def test_least_balance_cannot_be_improved():
    """No small step along the surface of balanced weights is shorter."""
    moments = np.array([2.0, 3.0, 4.0])
    y = np.array([0.3, 0.05, 0.1])
    spec = lqr.FormII((1.0, 1.0, 1.0, *(y**2)), (1.0, 1.0, 1.0), 1)
    q, r = lqr.balanced(moments, spec)
    shift = np.log(np.sqrt(q[3:] / r) / y)
    share = np.array([1.0, -2.0, 1.0]) / y * np.exp(-shift)
    # At the least change it is parallel to the condition's gradient.
    assert np.linalg.norm(np.cross(shift, share)) < 1e-6 * np.linalg.norm(shift) * np.linalg.norm(share)


def test_balance_that_cannot_be_is_refused():
    spec = lqr.FormII((1.0, 1.0, 1.0, 1e-4, 1.0, 1.0), (1.0, 1.0, 1.0), BALANCES.index("q6"))
    with pytest.raises(ValueError, match="q5 or r2 can"):
        lqr.design(make_craft([2.0, 3.0, 4.0]), spec)
    equal = lqr.FormII((1.0,) * 6, (1.0, 2.0, 3.0), BALANCES.index("least"))
    assert lqr.design(make_craft([2.0, 2.0, 2.0]), equal) == lqr.design(
        make_craft([2.0, 2.0, 2.0]), equal._replace(balance=0)
    )


LAW = builtin_text("three-laws").split("[[law]]")[0] + '[[law]]\ntype = "lqr"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('form = "II"\nq = [1, 1, 1, 1, 1]\nr = 1', "6 numbers"),
        ('form = "II"\nq = 1\nr = [1, 1]', "3 numbers"),
        ('form = "II"\nq = [1, 1, 1, 1, 1, -1]\nr = 1', "above 0"),
        ('form = "II"\nq = 1\nr = 0', "above 0"),
        ('form = "I"\na = 1\nb = 0', "above 0"),
        ('form = "optimal"\nq = 1\nr = 1', "one of I, II, III, numeric"),
        ('form = "numeric"\nq = [1, 1, 1, 1, 1, -1]\nr = 1', "q must be positive definite"),
        ('form = "numeric"\nq = 1\nr = [[1, 1, 0], [0, 1, 0], [0, 0, 1]]', "r must be symmetric"),
        ('form = "numeric"\nq = 1\nr = [[1, 1], [1, 1]]', "3x3 matrix"),
    ],
)
def test_bad_weights_are_one_line(text, said):
    with refused(said):
        parse(LAW + text, "my.toml")


def test_form_ii_refuses_a_full_inertia():
    craft = make_craft([[2.0, 0.1, 0.0], [0.1, 3.0, 0.0], [0.0, 0.0, 4.0]])
    with pytest.raises(ValueError, match="form 'III'"):
        lqr.design(craft, lqr.FormII((1.0,) * 6, (1.0,) * 3))
