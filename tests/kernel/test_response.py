"""Sums of impulse responses: samples with one weight are summed at once, and no less than one by one."""

from fractions import Fraction
from itertools import groupby

import numpy as np
import pytest

from starhold.certification.evidence.responses import powers, weighed
from starhold.kernel.numbers import WORK, Account, RefusedError
from starhold.kernel.theorems.response import KINDS, PARTS, PLACES, runs, summed
from tests.kernel.flights import along

COUNT = 300


def exact(rows):
    return [[Fraction(x) for x in row] for row in rows.tolist()]


def drawn(seed):
    """A damped motion of (w, q), what pushes do to it, what of it is bounded, and the evidence about its response."""
    random = np.random.default_rng(seed)
    stiff, damped, h = random.uniform(0.3, 1.0, 3), random.uniform(0.5, 1.5, 3), 0.05
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    K, C = (turn @ np.diag(x) @ turn.T for x in (stiff, damped))
    A = np.block([[np.eye(3) - h * C, -h * K], [h / 2 * np.eye(3), np.eye(3)]])
    outputs = np.vstack([np.eye(6), np.hstack([-C, -K])])
    ways = [np.vstack([h * np.eye(3), y * np.eye(3)]) for y in (h * h / 4, 0.0)]
    ways.append(np.vstack([np.zeros((3, 3)), np.eye(3)]))
    return A, outputs, ways, weighed(powers(outputs, A, COUNT), PARTS, ways, KINDS)


def shown(A, outputs, ways, evidence, **changed):
    given = evidence | changed
    proof = summed(exact(outputs), PARTS, exact(A), list(map(exact, ways)), KINDS, given["weights"], given["gains"], True)
    try:
        while True:
            _, obligation = next(proof)
            obligation.check(None)
    except StopIteration as end:
        return end.value


def test_samples_with_one_weight_are_summed_at_once_and_no_less_than_one_by_one():
    A, outputs, ways, evidence = drawn(1)
    assert len(list(groupby(evidence["weights"][0]))) < 0.6 * COUNT
    Account.open()
    response, at_once = shown(A, outputs, ways, evidence), WORK - Account.left
    # No two on end are alike.
    apart = [[2 * m + k % 2 for k, m in enumerate(one)] for one in evidence["weights"]]
    gains = [[float.hex(float.fromhex(g) * 1.001) for g in one] for one in evidence["gains"]]
    Account.open()
    each, singly = shown(A, outputs, ways, evidence, weights=apart, gains=gains), WORK - Account.left
    assert at_once < 0.9 * singly
    rows = powers(outputs, A, COUNT + 1)
    for found, true in ((response.left, np.abs(rows[-1])), (response.beside, np.abs(rows[:-1]).sum(0))):
        assert np.allclose(np.array(found, float), true, rtol=1e-12, atol=1e-18)
    for one, other in ((response.left, each.left), (response.beside, each.beside)):
        assert np.allclose(np.array(one, float), np.array(other, float), rtol=0.0, atol=1e6 / 2.0**PLACES)


@pytest.mark.parametrize("seed", range(2, 4))
def test_gains_are_those_of_pushes_that_turn_over_as_the_response_does(seed):
    A, outputs, ways, evidence = drawn(seed)
    response, rows = shown(A, outputs, ways, evidence), powers(outputs, A, COUNT)
    ends = along(np.random.default_rng(seed).normal(size=(3, 500)))
    for gains, part in zip(response.gains, PARTS.values(), strict=True):
        pushed = [np.linalg.norm((rows[:, part] @ B).transpose(0, 2, 1) @ ends, axis=1).sum(0) for B in ways]
        worst = [np.sum([pushed[k] for k in kind], axis=0).max() for kind in KINDS]
        assert all(x <= float(gain) for x, gain in zip(worst, gains, strict=True))
        assert gains[0] < 1.5 * worst[0]


@pytest.mark.parametrize(("part", "kind"), [(0, 0), (1, 1), (2, 2), (1, 0)])
def test_smaller_gains_are_refused(part, kind):
    A, outputs, ways, evidence = drawn(1)
    gains = [list(one) for one in evidence["gains"]]
    gains[part][kind] = float.hex(float.fromhex(gains[part][kind]) * (1.0 - 1e-6))
    with pytest.raises(RefusedError):
        shown(A, outputs, ways, evidence, gains=gains)


def test_runs_are_of_one_sample_or_of_as_many_as_are_worth_it():
    assert runs([5] * 7) == [(5, 1)] * 7
    assert runs([5] * 70 + [6] + [7] * 8) == [(5, 64), *[(5, 1)] * 6, (6, 1), (7, 8)]
