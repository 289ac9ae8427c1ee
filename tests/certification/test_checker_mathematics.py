"""The mathematics that the checker decides with, against floats."""

import numpy as np
import pytest
from flint import fmpq
from hypothesis import assume, given
from hypothesis import strategies as some

from starhold.checker import exact as checking
from starhold.checker.subject import variables
from starhold.checker.torque import SHAPES, keeps_below

ROOTS = some.lists(some.complex_numbers(max_magnitude=3.0, allow_nan=False), min_size=1, max_size=3)


def polynomial(roots):
    """Real coefficients, lowest first, of roots taken with their conjugates, exact."""
    found = np.poly([z for root in roots for z in (root, root.conjugate())]).real
    return [checking.rational(float(c)) for c in found[::-1]]


@given(ROOTS)
def test_rouths_array_knows_where_the_roots_are(roots):
    assume(all(abs(z.real) > 1e-3 and abs(abs(z) - 1.0) > 1e-3 for z in roots))
    assume(min((abs(a - b) for i, a in enumerate(roots) for b in roots[:i]), default=1.0) > 1e-2)
    assume(all(abs(z.imag) > 1e-2 for z in roots))
    found = polynomial(roots)
    assert checking.hurwitz(found) == all(z.real < 0.0 for z in roots)
    assert checking.within_circle(found, fmpq(1)) == all(abs(z) < 1.0 for z in roots)
    assert checking.saddle(found) == any(z.real > 0.0 for z in roots)
    for z in roots:
        near = checking.rational(z.real + 1e-7), checking.rational(z.imag)
        assert checking.has_root_near(found, *near, fmpq(1, 100))
    assert not checking.has_root_near(found, fmpq(100), fmpq(0), fmpq(1))


def test_roots_on_the_border_are_not_inside():
    one = fmpq(1)
    assert not checking.hurwitz([one, fmpq(0), one])
    assert not checking.saddle([one, fmpq(0), one])
    assert not checking.saddle([fmpq(0), one, -one])
    # (x2 + 1)(x - 1): a root on the right, and two on the imaginary axis.
    assert not checking.saddle([-one, one, -one, one])
    # x2 - 1, whose halves share a root that is not on the axis.
    assert checking.saddle([-one, fmpq(0), one])
    for border in (1, -1):
        assert not checking.within_circle([fmpq(-border), one], one)
    assert not checking.within_circle([one, fmpq(0), one], one)


@given(some.lists(some.integers(-9, 9), min_size=9, max_size=9), some.integers(-5, 5))
def test_minors_tell_definite_matrices(entries, shift):
    a = np.reshape(np.array(entries, dtype=float), (3, 3))
    a = a @ a.T + shift * np.eye(3)
    rows = [[checking.rational(x) for x in row] for row in a.tolist()]
    least, most = np.linalg.eigvalsh(a)[[0, -1]]
    if abs(least) > 1e-9:
        assert checking.definite(rows) == checking.definite(rows, strictly=False) == (least > 0.0)
    bound = checking.greatest(rows)
    assert most <= checking.floating(bound) + 1e-12 <= most + 1e-11 * max(1.0, abs(most))


def test_a_singular_matrix_is_not_negative():
    rows = [[fmpq(0), fmpq(0)], [fmpq(0), fmpq(1)]]
    assert not checking.definite(rows)
    assert checking.definite(rows, strictly=False)
    assert not checking.definite([[fmpq(0), fmpq(0)], [fmpq(0), fmpq(-1)]], strictly=False)


@given(some.lists(some.floats(0.0, 2.0), min_size=12, max_size=12), some.floats(0.1, 3.0), some.floats(0.1, 3.0))
def test_tangents_bound_the_torque_closely(numbers, level, s):
    loads = [[0.0, numbers[0], numbers[1], 0.0, 0.0, 0.0], [*numbers[2:8]], [*numbers[6:12]]]
    t = np.linspace(0.0, min(level, 2.0 * s), 20_001)
    squares = t / s * (2.0 - t / s), 2.0 * np.maximum(level - t, 0.0)
    shapes = np.array([np.sqrt(np.maximum(squares[0], 0.0)) ** p * np.sqrt(squares[1]) ** r for p, r in SHAPES])
    sums = np.array(loads) @ shapes
    most = float((sums[0] + np.hypot(sums[1], sums[2])).max())
    assume(most > 1e-3)
    common, *others = [[checking.rational(x) for x in load] for load in loads]
    bounds = checking.rational(level), checking.rational(s)
    assert keeps_below([([others], common)], checking.rational(most * (1.0 + 1e-5)), *bounds)
    assert not keeps_below([([others], common)], checking.rational(most * (1.0 - 1e-9)), *bounds)


@given(some.integers(-9, 9), some.integers(-9, 9), some.tuples(some.integers(-9, 9), some.integers(-9, 9)))
def test_what_falls_on_an_interval(linear, square, ends):
    low, high = (fmpq(end) for end in sorted(ends))
    for interval in ((low, high), (None, high), (low, None), (None, None)):
        first = -20.0 if interval[0] is None else float(int(low))
        last = 20.0 if interval[1] is None else float(int(high))
        y = np.linspace(first, last, 4001)
        expected = bool((linear * y + square * y * y)[y != 0.0].max(initial=-1.0) < 0.0)
        held = checking.falls(fmpq(linear), fmpq(square), interval)
        assert expected if held else True
        # Beyond the grid nothing changes unless the interval has no end.
        if None not in interval:
            assert held == expected or abs(linear) < 1e-9 or not expected


def test_duals_differentiate():
    x, y, dx, dy = variables(("x", "y", "dx", "dy"))
    a, b = checking.Dual(x, dx), checking.Dual(y, dy)
    found = (3.0 - a) * b * b / 2.0 + 1.0 - a
    assert not (found.value - ((3.0 - x) * y * y / 2.0 + 1.0 - x)).terms
    assert not (found.slope - ((3.0 - x) * y * dy - dx * y * y / 2.0 - dx)).terms
    with pytest.raises(checking.CheckError):
        a / b
