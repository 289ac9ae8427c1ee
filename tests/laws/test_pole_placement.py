"""Pole placement by levels: the eigenvalues reached, other methods, what is exact in rationals, and what is refused."""

import math
from itertools import pairwise

import numpy as np
import pytest
from flint import arb_mat, fmpq, fmpq_mat, fmpq_poly
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.signal import place_poles

from starhold.synthesis.pole_placement import UncontrollableError, displacement, is_stable, levels, place, reached
from tests.tiers import fewer


def plant(random, n, m):
    return random.normal(size=(n, n)) / math.sqrt(n), random.normal(size=(n, m))


def spread(random, n, pairs, slow=0.5, fast=4.0):
    """Poles with sizes in geometric progression, jittered, of which some make complex pairs."""
    poles = random.permutation(-np.geomspace(slow, fast, n) * random.uniform(0.95, 1.05, n)).astype(complex)
    for i in range(0, 2 * pairs, 2):
        poles[i] *= 1.0 + 1j * random.uniform(0.3, 2.0)
        poles[i + 1] = poles[i].conjugate()
    return poles


def chains(random, lengths):
    """A controllable pair with these controllability indices: chains of integrators, fed back and seen from elsewhere."""
    n, m = sum(lengths), len(lengths)
    a, b = np.zeros((n, n)), np.zeros((n, m))
    for i, end in enumerate(np.cumsum(lengths)):
        b[end - 1, i] = 1.0
        a[end - lengths[i] : end, end - lengths[i] : end] = np.eye(lengths[i], k=1)
    turn = np.linalg.qr(random.normal(size=(n, n)))[0]
    a = turn @ (a + b @ random.normal(size=(m, n))) @ turn.T
    return a, turn @ b @ random.normal(size=(m, m))


def distance(found, wanted):
    """The largest distance of matched poles, relative to those wanted or absolute below 1."""
    away = np.abs(found[:, None] - wanted) / np.maximum(1.0, np.abs(wanted))
    return away[linear_sum_assignment(away)].max()


def exact(array):
    return fmpq_mat([[fmpq(*float(x).as_integer_ratio()) for x in row] for row in array])


def increments(a, b):
    """Ranks by which [B, AB, ...] grows, in rationals."""
    block, matrix, ranks, columns = exact(b), exact(a), [0], []
    for _ in range(len(a)):
        columns.extend(block.transpose().tolist())
        ranks.append(fmpq_mat(columns).rank())
        block = matrix * block
    return [after - before for before, after in pairwise(ranks) if after > before]


def by_the_book(a, b, spectra):
    """The recursion as it is written, for levels that all have full column rank: R = E, pseudo-inverses, no scaling."""
    inverse, phi = np.linalg.pinv(b), spectra[0]
    if len(spectra) == 1:
        return inverse @ a - phi @ inverse
    p = np.linalg.svd(b)[0][:, b.shape[1] :].T
    g = inverse + by_the_book(p @ a @ np.linalg.pinv(p), p @ a @ b, spectra[1:]) @ p
    return g @ a - phi @ g


def test_random_plants() -> None:
    """Up to twenty states, as many as six for each input."""
    random = np.random.default_rng(1)
    for number in range(fewer(150, 3)):
        m = int(random.integers(1, 7))
        n = 20 if number % 15 == 0 and m > 3 else int(random.integers(1, min(6 * m, 20) + 1))
        a, b = plant(random, n, m)
        poles = spread(random, n, int(random.integers(n // 2 + 1)))
        placed = place(a, b, poles, allowed=1e-8)
        assert distance(reached(a, b, placed.K), poles) < 1e-8
        assert placed.K.shape == (m, n)
        assert sum(levels(a, b)) == n


@pytest.mark.parametrize(("n", "m", "times"), [(7, 3, 7), (6, 2, 4), (9, 4, 5), (12, 3, 12), (4, 1, 4)])
def test_repeated_poles(n: int, m: int, times: int) -> None:
    """More often than there are inputs, which SciPy refuses. Exact characteristic polynomials show how well."""
    a, b = plant(np.random.default_rng(n), n, m)
    poles = [-1.0] * times + list(np.linspace(-3.0, -1.5, n - times))
    with pytest.raises(ValueError, match="repeated more than rank"):
        place_poles(a, b, poles)
    placed = place(a, b, poles)
    assert placed.error < 1e-10
    found = (exact(a) - exact(b) * exact(placed.K)).charpoly()
    wanted = math.prod((fmpq_poly([fmpq(*(-pole).as_integer_ratio()), 1]) for pole in poles), start=fmpq_poly([1]))
    assert max(abs(float(arb_mat([[x / y - 1]])[0, 0].mid())) for x, y in zip(found, wanted, strict=True)) < 1e-10
    for other in ([-1.0 + 1.0j, -1.0 - 1.0j] * (n // 2) + [-2.0] * (n % 2), np.zeros(n)):
        assert place(a, b, other).error < 1e-10
    # Eigenvalues themselves are spread by a root of the rounding.
    assert distance(reached(a, b, placed.K), np.array(poles)) < 10.0 * 1e-12 ** (1.0 / times)


def test_displacement_is_that_of_the_poles() -> None:
    a = np.diag([-1.0, -2.0, -4.0])
    assert displacement(a, np.eye(3), np.zeros((3, 3)), [-4.0, -1.0, -2.0]) == 0.0
    moved = np.diag([1e-9, 0.0, 4e-7])
    assert displacement(a, np.eye(3), moved, [-1.0, -2.0, -4.0]) == pytest.approx(1e-7, rel=1e-5)
    # Two equal poles that part by d each way: their sum is kept, their product changes by d^2.
    parted = np.diag([1e-5, -1e-5, 0.0])
    assert displacement(np.diag([-2.0, -2.0, -1.0]), np.eye(3), parted, [-2.0, -2.0, -1.0]) == pytest.approx(
        2.5e-11, rel=1e-4
    )
    assert displacement(np.diag([1e-3, -1.0]), np.eye(2), np.zeros((2, 2)), [0.0, -1.0]) == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.parametrize(
    ("lengths", "expected"),
    [((4, 2, 1), [3, 2, 1, 1]), ((3, 3), [2, 2, 2]), ((5, 1), [2, 1, 1, 1, 1]), ((1, 1, 1), [3]), ((2, 2, 1, 1), [4, 2])],
)
def test_levels_that_lose_inputs(lengths: tuple[int, ...], expected: list[int]) -> None:
    random = np.random.default_rng(len(lengths))
    a, b = chains(random, lengths)
    n = len(a)
    # One input too many, and one that does nothing.
    wide = np.hstack([b, b @ random.normal(size=(len(lengths), 1)), np.zeros((n, 1))])
    for matrix in (b, wide):
        assert levels(a, matrix) == expected
        for pairs in range(n // 2 + 1):
            poles = spread(random, n, pairs)
            placed = place(a, matrix, poles)
            assert distance(reached(a, matrix, placed.K), poles) < 1e-8
            odd = sum(size % 2 for size in expected)
            assert any(map(np.iscomplexobj, placed.spectra)) == (n - 2 * pairs < odd)
            assert [r.shape for r in placed.directions] == list(pairwise([matrix.shape[1], *expected]))


@pytest.mark.parametrize(("n", "m"), [(3, 3), (6, 3), (9, 3), (8, 2), (4, 1)])
def test_spectra_as_in_the_formulas(n: int, m: int) -> None:
    """Full matrices, Jordan blocks and multiples of E, in the coordinates of the inputs."""
    random = np.random.default_rng(n)
    a, b = plant(random, n, m)
    sizes = levels(a, b)
    full = [random.normal(size=(m, m)) for _ in sizes]
    jordan = [-np.eye(m) + np.eye(m, k=1) for _ in sizes]
    for spectra in (full, jordan, [-1.5 * np.eye(m)] * len(sizes)):
        placed = place(a, b, spectra=spectra)
        expected = by_the_book(a, b, spectra)
        np.testing.assert_allclose(placed.K, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
        assert placed.error < 1e-9
    poles = spread(random, n, 1 if m > 1 else 0)
    placed = place(a, b, poles)
    again = place(a, b, spectra=placed.spectra)
    np.testing.assert_allclose(again.K, placed.K, rtol=0, atol=1e-9 * np.abs(placed.K).max())


def test_annihilators_and_units_do_not_matter() -> None:
    random = np.random.default_rng(5)
    for _ in range(10):
        a, b = plant(random, 9, 3)
        poles = spread(random, 9, 3)
        expected = place(a, b, poles).K

        def other(_: int, given: np.ndarray) -> np.ndarray:
            rest = len(given) - 3
            turn = np.linalg.qr(random.normal(size=(rest, rest)))[0] * random.uniform(0.3, 3.0, rest)
            return 100.0 * turn @ np.linalg.svd(given)[0][:, 3:].T

        usual = place(a, b, spectra=place(a, b, poles).spectra, annihilators=other)
        np.testing.assert_allclose(usual.K, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
        units = 10.0 ** random.uniform(-4.0, 4.0, 9)
        there = place(a * units[:, None] / units, b * units[:, None], spectra=usual.spectra)
        np.testing.assert_allclose(there.K * units, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
        assert there.error < 1e-8
    inputs = np.array([1e-8, 1.0, 1e8])
    assert place(a, b * inputs, poles).error < 1e-8
    assert place(1e200 * a, b, 1e200 * poles).error < 1e-8
    assert place(1e-200 * a, b, 1e-200 * poles).error < 1e-8


def test_directions_of_choice() -> None:
    random = np.random.default_rng(6)
    a, b = chains(random, (3, 2, 1))
    poles = spread(random, 6, 3)
    usual = place(a, b, poles)
    turned = place(a, b, poles, directions=lambda k, given: random.normal(size=(given.shape[1], (3, 2, 1)[k])))
    assert any(map(np.iscomplexobj, turned.spectra))
    assert max(usual.error, turned.error) < 1e-9
    assert np.abs(usual.K - turned.K).max() > 1e-3


@settings(max_examples=fewer(150))
@given(st.data(), st.integers(1, 6), st.integers(1, 3))
def test_controllable_as_in_rationals(data: st.DataObject, n: int, m: int) -> None:
    """Whole numbers: levels are the growth of [B, AB, ...], and any spectrum is reached; else the fixed modes are named."""
    entry = st.sampled_from([0, 0, 0, 1, -1, 2])
    a = np.array(data.draw(st.lists(entry, min_size=n * n, max_size=n * n)), dtype=float).reshape(n, n)
    b = np.array(data.draw(st.lists(entry, min_size=n * m, max_size=n * m)), dtype=float).reshape(n, m)
    poles = spread(np.random.default_rng(n), n, data.draw(st.integers(0, n // 2)))
    expected = increments(a, b)
    if sum(expected) < n:
        with pytest.raises(UncontrollableError) as caught:
            place(a, b, poles)
        assert len(caught.value.modes) == n - sum(expected)
        assert "\n" not in str(caught.value)
    else:
        assert levels(a, b) == expected
        placed = place(a, b, poles)
        assume(min(placed.strength) > 1e-3)
        assert placed.error < 1e-8


def test_uncontrollable_modes_are_named() -> None:
    random = np.random.default_rng(7)
    for _ in range(fewer(100)):
        n, m = int(random.integers(2, 11)), int(random.integers(1, 4))
        fixed = int(random.integers(1, n))
        a, b = plant(random, n, m)
        a[n - fixed :, : n - fixed] = b[n - fixed :] = 0.0
        modes = np.linalg.eigvals(a[n - fixed :, n - fixed :])
        turn = np.eye(n) + 0.5 * random.normal(size=(n, n)) / math.sqrt(n)
        a, b = turn @ a @ np.linalg.inv(turn), turn @ b
        with pytest.raises(UncontrollableError) as caught:
            levels(a, b)
        assert distance(caught.value.modes, modes) < 1e-6
        for mode, left in zip(caught.value.modes, caught.value.left, strict=True):
            assert np.linalg.norm(left) == pytest.approx(1.0)
            assert np.abs(left @ a - mode * left).max() < 1e-6
            assert np.abs(left @ b).max() < 1e-6


def test_what_would_be_off_is_refused() -> None:
    a, b = plant(np.random.default_rng(9), 20, 1)
    poles = -np.linspace(0.5, 2.0, 20)
    refused = (
        r"off by \S+ of their size, 1.0e-06 is allowed; the weakest level, \d+ of 0 to 19, has a relative strength of \d"
    )
    with pytest.raises(ValueError, match=refused):
        place(a, b, poles)
    placed = place(a, b, poles, allowed=math.inf)
    assert placed.error > 1e-6
    assert distance(reached(a, b, placed.K), poles) > 1e-6


A, B = plant(np.random.default_rng(10), 4, 2)
POLES = [-1.0, -2.0, -3.0, -4.0]
WRONG = {
    "either poles or spectra": {"poles": None},
    "poles must be 4 numbers, one for each state": {"poles": [-1.0]},
    "1j lacks its conjugate": {"poles": [-1.0 + 1.0j, -1.0 + 1.0j, -1.0 - 1.0j, -2.0]},
    "poles must be finite numbers": {"poles": [-1.0, math.nan, -1.0, -2.0]},
    "A must be of finite real numbers": {"A": A * math.nan},
    "B must be of finite real numbers": {"B": B * 1j},
    "A must be square": {"A": A[:3]},
    "B must have 4 rows": {"B": B[:3]},
    "and at least one column": {"B": B[:, :0]},
    r"square matrices of sizes \[2, 2\], not of shapes \[\(4, 4\)\]": {"poles": None, "spectra": [np.eye(4)]},
    "spectra must be of finite": {"poles": None, "spectra": [np.eye(2), np.full((2, 2), math.inf)]},
    r"annihilators of level 0 must have shape \(2, 4\)": {"annihilators": [np.eye(3)]},
    "annihilators of level 0 do not annihilate": {"annihilators": lambda k, given: np.eye(4)[:2]},
    "annihilators of level 0 lack full row rank": {"annihilators": [np.ones((2, 4))]},
    "annihilators has 3 entries, the pair has 2": {"annihilators": [None] * 3},
    r"directions of level 1 must have shape \(2, 2\)": {"directions": [None, np.eye(3)]},
    "directions of level 0 must be of finite": {"directions": [np.eye(2) * math.nan]},
    "directions of level 1 leave out": {"directions": [None, np.ones((2, 2))]},
    "not controllable": {"B": np.zeros((4, 1))},
    "leave the range": {"A": A * 1e200, "B": B * 1e-200},
}


@pytest.mark.parametrize("reason", WRONG)
def test_wrong_inputs(reason: str) -> None:
    entries = {"A": A, "B": B, "poles": POLES, **WRONG[reason]}
    with pytest.raises(ValueError, match=reason) as caught:
        place(**entries)
    assert "\n" not in str(caught.value)


def test_is_stable() -> None:
    assert is_stable([-1.0, -1.0 + 2.0j])
    assert not is_stable([-1.0, 0.0])
    assert not is_stable([math.nan])
    assert is_stable(reached(A, B, place(A, B, POLES).K))
    with pytest.raises(ValueError, match=r"K must be finite and of shape \(2, 4\)"):
        reached(A, B, np.eye(4))
