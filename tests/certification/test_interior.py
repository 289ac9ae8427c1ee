"""The interior point for large matrices against Clarabel, on sums of squares that both can solve."""

from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
import pytest
from scipy import sparse

from starhold.certification.evidence import squares
from starhold.certification.evidence.interior import most_definite
from starhold.certification.evidence.sparse import Entries, entries_of
from starhold.certification.evidence.sums import Guess
from starhold.kernel.polynomials import Poly, var
from starhold.kernel.rules import Sum

NAMES = ("x", "y", "z")


def some(rng, low, high):
    """A polynomial with all monomials of these degrees."""
    monomials = [m for d in range(low, high + 1) for m in combinations_with_replacement(NAMES, d)]
    return Poly({m: Fraction(int(rng.integers(-9, 10)), 8) for m in monomials})


def programs(rng, feasible):
    """What `squares.optimum` is given to show that p is not negative in a ball."""
    ball = Poly({(): Fraction(1)}) - sum((var(n) * var(n) for n in NAMES), Poly({}))
    q, s = some(rng, 1, 2), some(rng, 0, 1)
    p = q * q + ball * s * s + Poly({(n, n): Fraction(1 if feasible else -8) for n in NAMES})
    strict = [Poly({("x", "x"): Fraction(1, 4)})]
    given = []
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("starhold.certification.evidence.sums.optimum", lambda *args: given.append(args))
        Guess(Sum(p, [ball], [], strict), {}, 4, [], None).floats()
    return given[0]


@pytest.mark.parametrize("seed", range(6))
def test_the_margin_is_that_of_clarabel(seed):
    A, b, signed, blocks, twice = programs(np.random.default_rng(seed), True)
    by_clarabel, here = squares.optimum(A, b, signed, blocks, twice), most_definite(A, b, signed, blocks)
    margin = here[-1]
    assert 0.75 * by_clarabel[-1] < margin < by_clarabel[-1] * (1.0 + 1e-6)
    assert np.abs(A.dense() @ here - b).max() < 0.01 * margin
    assert here[0] > 0.99 * margin
    first = A.shape[1] - 1 - sum(map(len, blocks))
    for pairs in blocks:
        gram = np.zeros((1 + max(k for _, k in pairs),) * 2)
        for (i, k), v in zip(pairs, here[first : first + len(pairs)], strict=True):
            gram[i, k] = gram[k, i] = v
        assert np.linalg.eigvalsh(gram)[0] > 0.99 * margin
        first += len(pairs)


def test_matrices_are_in_memory_as_those_of_scipy():
    A = programs(np.random.default_rng(2), True)[0]
    below = Entries([2, 0], [1, 3], [-5.0, 7.0], (3, A.shape[1]))
    for ours in (A, below, A.above(below), entries_of(A.dense())):
        theirs = sparse.csc_matrix(ours.dense())
        made = ours.compressed()
        assert (made.data.tobytes(), made.shape) == (theirs.data.tobytes(), theirs.shape)
        assert [*made.indices] == [*theirs.indices]
        assert [*made.indptr] == [*theirs.indptr]
        assert (ours.scipy() != theirs).nnz == 0
    assert (A.above(below).dense() == np.vstack([A.dense(), below.dense()])).all()


def test_what_is_no_sum_has_no_margin():
    A, b, signed, blocks, twice = programs(np.random.default_rng(0), False)
    found = squares.optimum(A, b, signed, blocks, twice)
    assert found is None or found[-1] < 0.0
    assert most_definite(A, b, signed, blocks) is None


def test_large_matrices_are_given_to_it(monkeypatch):
    A, b, signed, blocks, twice = programs(np.random.default_rng(1), True)
    monkeypatch.setattr(squares, "interior_point", None)
    monkeypatch.setattr(squares, "LARGE", max(map(len, blocks)) - 1)
    assert squares.optimum(A, b, signed, blocks, twice)[-1] > 0.0
