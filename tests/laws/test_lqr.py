"""Closed and numeric regulators, also where numbers are hard: moments eight and weights twelve orders of magnitude apart.

Two judges: SciPy's Riccati solver, axis by axis in units in which it keeps its digits; and, for full matrices, policy
improvement in ball arithmetic, which leaves a feedback alone exactly where it is the optimal one.
"""

import itertools
from collections import Counter

import mpmath
import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from scipy.linalg import solve_continuous_are
from scipy.optimize import minimize

from starhold.laws import lqr
from starhold.parts.craft import make_craft, tensor
from starhold.synthesis.riccati import linear_modes
from starhold.synthesis.weights import BALANCES, kappa
from tests.tiers import fewer

CLOSE = 1e-9


def moments_of(random):
    """Principal moments in any order: slender, flat, round about one axis or about all, from nanosatellites to stations."""
    thin = 10.0 ** random.uniform(-8, 0)
    shapes = (
        [thin, 1.0, 1.0 + 0.999 * thin * random.uniform(-1, 1)],
        [thin, 1.0, 1.0 + thin],
        [thin, 1.0, 1.0],
        [1.0, 1.0, random.uniform(0.1, 2.0)],
        [1.0, 1.0, 1.0],
        [1.0, *(1.0 + 10.0 ** random.uniform(-12, -3, size=2))],
    )
    return random.permutation(shapes[random.integers(len(shapes))]) * 10.0 ** random.uniform(-6, 6)


def weights_of(random, size, orders=12):
    """Positive numbers that span as many orders of magnitude as may be."""
    span = random.uniform(0, orders)
    found = random.permutation(np.r_[0.0, span, random.uniform(0, span, size=size - 2)])
    return 10.0 ** (found - span / 2 + random.uniform(-3, 3))


def turn_of(random):
    return np.linalg.qr(random.normal(size=(3, 3)))[0]


def one_axis(moment, rate, attitude, cost):
    """Damping and stiffness of one axis by SciPy, time in units in which the weight of the attitude is one."""
    time = np.sqrt(2.0 * moment) * (cost / attitude) ** 0.25
    weight = np.diag([rate * time**2 / (cost * moment**2), 1.0])
    p = solve_continuous_are(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[1.0], [0.0]]), weight, np.eye(1))
    return p[0, 0] * moment / time, p[0, 1] * 2.0 * moment / time**2


@pytest.fixture
def precise():
    with ctx.workprec(500), mpmath.workdps(60):
        yield


def exact(array):
    return arb_mat(np.asarray(array, dtype=float).tolist())


def blocks(rows):
    """A matrix of matrices (3, 3)."""
    return arb_mat([[m[i, j] for m in row for j in range(3)] for row in rows for i in range(3)])


def improved(a, b, q, r, gain):
    """The feedback (3, 6) that one step of policy improvement gives, from the cost of this one."""
    loop = a - b * gain
    pairs = [(i, j) for i in range(6) for j in range(6)]
    rows = [[(loop[k, i] if m == j else 0) + (loop[m, j] if k == i else 0) for k, m in pairs] for i, j in pairs]
    cost = q + gain.transpose() * r * gain
    p = arb_mat(6, 6, arb_mat(rows).solve(arb_mat(36, 1, [-cost[i, j] for i, j in pairs])).entries())
    # Positive definite, so that the feedback is stable.
    assert all(arb_mat([[p[i, j] for j in range(n)] for i in range(n)]).det() > 0 for n in range(1, 7))
    return (r.inv() * b.transpose() * p).mid()


def floats(matrix):
    return np.array([[float(matrix[i, j].mid()) for j in range(matrix.ncols())] for i in range(matrix.nrows())])


def assert_optimal(inertia, q, r, gains):
    """The gains as they are improve to themselves: a stable start from which improvement converges, and no way off."""
    zero = exact(np.zeros((3, 3)))
    a, b = blocks([[zero, zero], [exact(0.5 * np.eye(3)), zero]]), blocks([[exact(inertia).inv()], [zero]])
    feedback = np.hstack([tensor(gains.k_rate), tensor(gains.k_attitude)])
    better, step = exact(feedback), 1.0
    while step > 0.0:
        before, better = floats(better), improved(a, b, q, r, better)
        step = np.abs(floats(better) - before).max() // (1e-15 * np.abs(feedback).max())
    for part in (slice(3), slice(3, 6)):
        error = np.abs(floats(better)[:, part] - feedback[:, part]).max()
        assert error <= CLOSE * np.abs(feedback[:, part]).max()


def test_form_ii_equals_the_numerical_solution_on_every_axis():
    random = np.random.default_rng(2024)
    for _ in range(fewer(1000)):
        moments, r = moments_of(random), weights_of(random, 3)
        q = np.r_[weights_of(random, 3), weights_of(random, 3)]
        gains = lqr.design(make_craft(moments), lqr.FormII(tuple(q), tuple(r)))
        expected = np.array([one_axis(*axis) for axis in zip(moments, q[:3], q[3:], r, strict=True)])
        assert np.array(gains.k_rate) == pytest.approx(expected[:, 0], rel=CLOSE)
        assert np.array(gains.k_attitude) == pytest.approx(expected[:, 1], rel=CLOSE)


@pytest.mark.usefixtures("precise")
def test_form_iii_is_optimal_for_its_weights_turned_into_the_body():
    random, refused = np.random.default_rng(1), 0
    for _ in range(fewer(600)):
        turn = turn_of(random)
        craft = make_craft(turn * moments_of(random) @ turn.T)
        inertia, r = tensor(craft.inertia), weights_of(random, 3)
        q = np.r_[weights_of(random, 3), weights_of(random, 3)]
        moments = np.linalg.eigvalsh(inertia)
        near = [n for n in (0, 1) if moments[n + 1] - moments[n] <= 1e-10 * moments[2]]
        if near:
            with pytest.raises(ValueError, match="are equal"):
                lqr.design(craft, lqr.FormIII(tuple(q), tuple(r)))
            refused += 1
            for n in near:
                q[n + 1], q[n + 4], r[n + 1] = q[n], q[n + 3], r[n]
        gains = lqr.design(craft, lqr.FormIII(tuple(q), tuple(r)))
        for gain in (tensor(gains.k_rate), tensor(gains.k_attitude)):
            assert np.array_equal(gain, gain.T)
            assert np.linalg.eigvalsh(gain)[0] > 0.0
        # Axes to fifty digits: those of doubles are not good enough to judge slender bodies.
        digits = mpmath.eigsy(mpmath.matrix(inertia.tolist()))[1]
        axes = arb_mat([[arb(mpmath.nstr(digits[i, j], 50)) for j in range(3)] for i in range(3)])
        zero = exact(np.zeros((3, 3)))
        rate, attitude, cost = (axes * exact(np.diag(part)) * axes.transpose() for part in (q[:3], q[3:], r))
        assert_optimal(inertia, blocks([[rate, zero], [zero, attitude]]), cost, gains)
    assert fewer(60) < refused < fewer(400)


@pytest.mark.usefixtures("precise")
def test_form_i_is_optimal_for_any_weight_of_the_torque():
    random = np.random.default_rng(2)
    for _ in range(fewer(400)):
        turn, other = turn_of(random), turn_of(random)
        craft = make_craft(turn * moments_of(random) @ turn.T)
        a, b = 10.0 ** random.uniform(-8, 4, size=2)
        gains = lqr.design(craft, lqr.FormI(a, b))
        for gain in (tensor(gains.k_rate), tensor(gains.k_attitude)):
            assert np.array_equal(gain, gain.T)
        body, zero = exact(tensor(craft.inertia)), exact(np.zeros((3, 3)))
        cost = exact(other) * exact(np.diag(weights_of(random, 3))) * exact(other).transpose()
        spread = body * cost * body
        weight = blocks([[spread * arb(a), zero], [zero, spread * arb(b) * arb(b)]])
        assert_optimal(tensor(craft.inertia), weight, cost, gains)


@pytest.mark.usefixtures("precise")
def test_numeric_form_is_optimal_for_any_weights():
    random = np.random.default_rng(4)
    for coupling in np.repeat([0.0, 0.5, 0.999], fewer(12)):
        turns = [turn_of(random) for _ in range(5)]
        craft = make_craft(turns[0] * moments_of(random) @ turns[0].T)
        rate, attitude, cost = (turn * weights_of(random, 3, 11) @ turn.T for turn in turns[1:4])
        rate, attitude, cost = (0.5 * (m + m.T) for m in (rate, attitude, cost))
        cross = coupling * np.linalg.cholesky(rate) @ turns[4] @ np.linalg.cholesky(attitude).T
        q = np.block([[rate, cross], [cross.T, attitude]])
        gains = lqr.design(craft, lqr.Numeric(q, cost))
        assert_optimal(tensor(craft.inertia), exact(q), exact(cost), gains)
        feedback = np.hstack([tensor(gains.k_rate), tensor(gains.k_attitude)])
        assert linear_modes(tensor(craft.inertia), feedback).real.max() < 0.0


def test_numeric_gains_keep_symmetry_and_zeros_to_the_last_bit():
    """With Q that commutes with the inertia, as in form I, for which these weights are exact numbers."""
    body = np.array([[5.0, 1.0, -1.0], [1.0, 6.0, 2.0], [-1.0, 2.0, 7.0]])
    q = np.kron(np.diag([0.75, 0.0625]), body @ body)
    gains = lqr.design(make_craft(body), lqr.Numeric(q, np.eye(3)))
    assert gains == lqr.design(make_craft(body), lqr.FormI(0.75, 0.25))
    turn = turn_of(np.random.default_rng(6))
    weight = turn * np.array([1.0, 2.0, 3.0]) @ turn.T
    q = np.kron(np.diag([1.0, 0.5]), 0.5 * (weight + weight.T))
    gains = lqr.design(make_craft(turn * np.array([2.0, 3.0, 4.0]) @ turn.T), lqr.Numeric(q, np.eye(3)))
    assert all(np.array_equal(tensor(gain), tensor(gain).T) for gain in (gains.k_rate, gains.k_attitude))
    # K_attitude is diagonal for any inertia where Q's attitude part and R are and the axes' stiffness is the same.
    craft = make_craft([[2.0, 0.3, 0.0], [0.3, 3.0, 0.0], [0.0, 0.0, 4.0]])
    gains = lqr.design(craft, lqr.Numeric(np.diag([1.0, 1.0, 1.0, 0.2, 0.2, 0.3]), np.diag([50.0, 50.0, 50.0])))
    assert gains.k_attitude == pytest.approx(np.sqrt([0.004, 0.004, 0.006]), rel=1e-15)
    assert [tensor(gains.k_rate)[i, 2] for i in range(2)] == [0.0, 0.0]


def test_form_iii_of_principal_axes_is_form_ii_in_another_order():
    craft, order = make_craft([4.0, 2.0, 3.0]), np.array([1, 2, 0])
    q, r = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), np.array([7.0, 8.0, 9.0])
    two = lqr.design(craft, lqr.FormII(tuple(q), tuple(r)))
    three = lqr.design(craft, lqr.FormIII((*q[:3][order], *q[3:][order]), tuple(r[order])))
    assert two == three
    # Equal moments of a diagonal inertia have the body's axes, so any weights are welcome.
    equal = make_craft([3.0, 3.0, 2.0])
    gains = lqr.design(equal, lqr.FormIII(tuple(q), tuple(r)))
    assert gains.k_attitude == pytest.approx(np.sqrt([5 / 8, 6 / 9, 4 / 7]), rel=1e-15)


@pytest.mark.parametrize("form", ["I", "II", "III"])
def test_explanation_of_hard_problems_keeps_its_digits(form):
    random = np.random.default_rng(7)
    for _ in range(fewer(60, 3)):
        moments, turn = moments_of(random), turn_of(random)
        full = form != "II" and np.diff(np.sort(moments)).min() > 1e-9 * moments.max()
        craft = make_craft(turn * moments @ turn.T if full else moments)
        q = np.r_[weights_of(random, 3), weights_of(random, 3)]
        if form == "I":
            spec = lqr.FormI(*10.0 ** random.uniform(-8, 4, size=2))
        else:
            spec = lqr.FORMS[form](tuple(q), tuple(weights_of(random, 3)))
        told = dict(lqr.explain(craft, spec))
        assert told["Riccati residual, relative"] < 1e-12
        assert told["P against SciPy, relative"] < CLOSE
        assert told["eigenvalues of the linear loop (1/s)"].real.max() < 0.0
        assert np.array_equal(told["P"], lqr.riccati_problem(craft, spec)[2])
        assert told["degree of stability (1/s)"] > 0.0


def test_gyroscopic_residual_is_the_largest_power():
    random = np.random.default_rng(1960)
    for _ in range(20):
        inertia, stiffness = np.diag(random.uniform(2.0, 3.9, size=3)), np.diag(random.uniform(0.1, 1.0, size=3))
        rates = random.normal(size=(200_000, 3))
        rates /= np.linalg.norm(rates, axis=1, keepdims=True)
        power = np.einsum("ki,ij,kj->k", rates, np.linalg.inv(stiffness), np.cross(rates, rates @ inertia))
        assert lqr.gyroscopic_residual(inertia, stiffness) == pytest.approx(np.abs(power).max(), rel=1e-3)


@pytest.mark.parametrize("order", [*itertools.permutations((2.0, 3.0, 4.0))])
def test_balance_moves_the_named_weight_or_all_of_them_least(order):
    random, moments, middle = np.random.default_rng(8), np.array(order), order.index(3.0)
    for _ in range(10):
        q, r = 10.0 ** random.uniform(-2, 2, size=6), 10.0 ** random.uniform(-2, 2, size=3)
        for name in ("least", f"q{middle + 4}", f"r{middle + 1}"):
            spec = lqr.FormII(tuple(q), tuple(r), BALANCES.index(name))
            q2, r2 = lqr.balanced(moments, spec)
            gains = lqr.design(make_craft(order), spec)
            size = np.abs(1.0 / np.array(gains.k_attitude)).max()
            assert lqr.gyroscopic_residual(np.diag(moments), np.diag(gains.k_attitude)) < 1e-14 * size
            moved = np.log(np.r_[q2 / q, r2 / r])
            if name == "least":
                least = np.abs(moved @ moved)
                assert np.abs(moved[:3]).max() == 0.0
            else:
                assert np.count_nonzero(moved) == 1
                assert least <= moved @ moved * (1 + 1e-9)


def test_balanced_weights_have_no_kappa_but_rounding():
    random = np.random.default_rng(8)
    refused = Counter()
    for _ in range(fewer(400)):
        moments, r = moments_of(random), weights_of(random, 3, 8)
        q = np.r_[weights_of(random, 3, 8), weights_of(random, 3, 8)]
        for name in BALANCES[1:]:
            spec = lqr.FormII(tuple(q), tuple(r), BALANCES.index(name))
            try:
                q2, r2 = lqr.balanced(moments, spec)
            except ValueError as error:
                refused[str(error)[:8]] += 1
                continue
            y = np.sqrt(q2[3:] / r2)
            size = np.abs((np.roll(moments, -2) - np.roll(moments, -1)) / y).sum()
            assert abs(kappa(moments, y)) <= 2e-15 * size
    assert set(refused) == {"no value", "balanced"}


def test_balance_moves_nothing_that_is_balanced_and_all_that_is_nearly_so():
    moments, even = np.array([2.0, 3.0, 4.0]), (1.0, 1.0, 1.0, 0.3, 0.3, 0.3)
    for how in range(1, len(BALANCES)):
        q, r = lqr.balanced(moments, lqr.FormII(even, (2.0, 2.0, 2.0), how))
        assert (tuple(q), tuple(r)) == (even, (2.0, 2.0, 2.0))
    q, r = lqr.balanced(moments, lqr.FormII((*even[:4], 0.3 * (1.0 + 1e-12), 0.3), (2.0, 2.0, 2.0), BALANCES.index("q5")))
    assert abs(q[4] / 0.3 - 1.0) < 4e-16
    # A weight of an axis whose share is zero cannot help, unless there is nothing to help.
    round_body = np.array([2.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="no value of q6 balances the weights; q4 or r1 can"):
        lqr.balanced(round_body, lqr.FormII((1.0, 1.0, 1.0, 0.3, 0.4, 0.5), (2.0,) * 3, BALANCES.index("q6")))
    q, r = lqr.balanced(round_body, lqr.FormII((1.0, 1.0, 1.0, 0.3, 0.3, 0.5), (2.0,) * 3, BALANCES.index("q6")))
    assert tuple(q) == (1.0, 1.0, 1.0, 0.3, 0.3, 0.5)
    craft, equal = make_craft([2.0, 2.0, 2.0]), lqr.FormII((1.0,) * 6, (1.0, 2.0, 3.0), BALANCES.index("least"))
    assert lqr.design(craft, equal) == lqr.design(craft, equal._replace(balance=0))


def test_least_balance_is_the_least_of_all():
    """Against a search from many starts over all weights that balance."""
    random = np.random.default_rng(9)
    for number in range(fewer(40, 4)):
        moments = random.permutation([2.0, 3.0, random.uniform(3.1, 4.9)])
        q, r = weights_of(random, 6, 6), weights_of(random, 3, 6)
        if number < 3:
            # Two ways are as good as one another, and to go both halfway is not.
            moments, q, r = np.array([2.0, 3.0, 4.0]), np.array([1.0, 1.0, 1.0, 1.0, 10.0 ** -(4 + number), 1.0]), np.ones(3)
        q2, r2 = lqr.balanced(moments, lqr.FormII(tuple(q), tuple(r), 1))
        moved = np.log(np.r_[q2 / q, r2 / r])
        parts = (np.roll(moments, -2) - np.roll(moments, -1)) / np.sqrt(q[3:] / r)
        middle = int(np.argsort(moments)[1])
        logs = np.log(np.abs(np.r_[np.delete(parts, middle), parts[middle]]))

        def length(change, logs=logs):
            return change @ change + (logs[2] - np.logaddexp(*(logs[:2] - change))) ** 2

        starts = [(0.0, 0.0), (-20.0, 0.0), (0.0, -20.0), (5.0, 5.0), (-5.0, -5.0)]
        tight = {"xatol": 1e-9, "fatol": 1e-13}
        best = min(minimize(length, start, method="Nelder-Mead", options=tight).fun for start in starts)
        # A change of log y by s moves its q by s and its r by -s.
        assert moved @ moved <= 2.0 * best * (1.0 + 1e-6)


@pytest.mark.parametrize("form", [lqr.FormII, lqr.FormIII])
def test_gains_of_many_runs_have_the_bits_of_each_alone(form, monkeypatch):
    random = np.random.default_rng(3)
    crafts = [make_craft(np.array([2.0, 3.0, 4.0])[random.permutation(3)] * random.uniform(0.9, 1.1, 3)) for _ in range(40)]
    weights = [(tuple(10.0 ** random.uniform(-5, 5, 6)), tuple(10.0 ** random.uniform(-5, 5, 3))) for _ in crafts]
    # Equal moments, too.
    cases = [(craft, form(*pair)) for craft, pair in zip(crafts, weights, strict=True)]
    cases.append((make_craft((2.0, 2.0, 2.0)), form((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (1.0, 2.0, 3.0))))
    alone = [lqr.design(*case) for case in cases]
    single, made = lqr.design, []
    monkeypatch.setattr(lqr, "design", lambda *case: made.append(case) or single(*case))
    assert np.array([gains[:2] for gains in lqr.design_all(cases)]).tobytes() == np.array([g[:2] for g in alone]).tobytes()
    assert made == []
    # Beside an inertia that turns the axes, or weights that are balanced, each is designed alone.
    mixed = [cases[0], (crafts[1], form(*weights[1], BALANCES.index("least")))]
    if form is lqr.FormIII:
        mixed.append((make_craft([[2.0, 0.1, 0.0], [0.1, 3.0, 0.0], [0.0, 0.0, 4.0]]), form(*weights[2])))
    assert lqr.design_all(mixed) == [single(*case) for case in mixed]
    assert made == mixed


@pytest.mark.parametrize(("q", "r"), [((1, 1, 1, 1, -1, 1), 1.0), ((1, 1, 1, 1e-7, 1, 1e7), 1.0), ((1e200,) * 6, 1e-200)])
def test_what_one_of_many_is_refused_for_is_what_it_is_refused_for_alone(q, r):
    craft = make_craft((2.0, 3.0, 4.0))
    bad = craft, lqr.FormII(tuple(map(float, q)), (r, r, r))
    with pytest.raises(ValueError, match=r".") as alone:
        lqr.design(*bad)
    with pytest.raises(ValueError, match=r".") as among:
        lqr.design_all([(craft, lqr.FormII((1.0,) * 6, (1.0,) * 3)), bad])
    assert str(among.value) == str(alone.value)
