"""Terms of what is late in a period: each is needed, for without it some period exceeds the bound, or more is paid than
there is to pay with."""

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import null_space

from starhold.certification.evidence.claims import floats
from starhold.kernel.follower import FIRST, REST, Change, Costs, Follower, Late
from starhold.kernel.regions import RATE
from tests.kernel.flights import along, moved, turned_on
from tests.kernel.lagging import AXES, BALL, Lagging
from tests.kernel.periods import LANES, Flight, quiet

SHARP, SMALL = [1.0, 1e-4, 1e-4], 1e-6
ALONE = {
    # The slope of what the law asks for is that far from the target, where this turns on.
    "turned": ((BALL, 5e-4, 5e-4, 1e-2, 0.05, 3.3e6), None, 2e-8),
    # What makes up for w x Jw changes with the rates, and these do in proportion to the state.
    "spun": ((AXES, 5e-3, 5e-3, SMALL, 1e-3), 1.0, 0.2),
    # The body turns about another axis than its rate's, and about that the law is stiff.
    "aside": ((BALL, 5e-3, 5e-3, SHARP, 1e-3), 0.1, 0.1),
}
"""Loops of which one term of the bound is nearly all, the stiffness of V, and a level."""


@pytest.mark.parametrize("near", [False, True])
@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("term", ALONE)
def test_how_far_what_is_asked_for_changes_is_in_one_term_of_the_bound(term, alike, near):
    numbers, held, level = ALONE[term]
    assert 0.15 < Lagging(*numbers, held=held, alike=alike).changed(level, 1e-12, near) <= 1.0


@pytest.mark.slow
def test_what_momentum_makes_of_rates_changes_what_is_asked_for():
    """Of states that change nothing linearly without momentum."""
    told = dict.fromkeys((f"late_torque_{name}" for name in ("kept", "mean", "weight", "begun", "rest")), 0.1)
    held, oracle = quiet("lyapunov", **told)
    region, size = held.region((held.s + held.G[3][3]) / 2**36), oracle.numbers["momentum"]
    change = held.change_in(held.tube(replace(region, sizes=region.sizes | {FIRST: Fraction(0), REST: Fraction(0)})))
    x = null_space(floats(held.demanded)) @ np.random.default_rng(6).normal(size=(3, LANES))
    x /= np.sqrt((x * np.linalg.solve(floats(region.X), x)).sum(axis=0))
    H = size * along(np.cross(x[RATE], [1.0, 2.0, 3.0], axis=0))
    later, _ = Flight(held, oracle, momentum=size).after(x, H)
    changed = np.linalg.norm(floats(held.near.torque) @ (later - x), axis=0)
    share = changed / (np.linalg.norm(floats(change.M) @ x, axis=0) + float(change.rest))
    assert 0.2 < share.max() <= 1.0


ERRORS = {"error": 2e-4, "error.attitude": 1e-2, "error.rate": 2e-3}


@pytest.mark.parametrize("name", ERRORS)
@pytest.mark.parametrize("alike", [True, False])
def test_errors_that_turn_over_change_what_is_asked_for_by_twice_as_much(name, alike):
    loop = Lagging(BALL, 0.1, 0.1, 0.02, 0.2, alike=alike, errors={name: ERRORS[name]})
    tube, axis = loop.tube(1e-14, 0.0), np.eye(3)[:, :1]
    error, turn, rate = (ERRORS[one] * (one == name) for one in ERRORS)

    def asked(q, w, sign):
        return loop.asked(turned_on(q, sign * turn * axis), w + sign * rate * axis) - sign * error * axis

    q, w, inverse = np.eye(4)[:, :1], 0.0 * axis, np.linalg.inv(loop.J)
    begun = asked(q, w, 1.0)
    late = np.linalg.norm(asked(*moved(loop.J, inverse, q, w, begun, loop.h), -1.0) - begun)
    near, errors = float(sum(loop.held.lateness(tube))), 2.0 * float(loop.held.mistaken(tube)) * alike
    for most in (float(loop.held.change_in(tube).rest), (1.0 - loop.kept) * (near - errors) + errors):
        assert 0.9 * most < late <= most


TIMES = (np.arange(4000) + 0.5) / 4000
FALLING = [
    lambda c: 1.0 * (c > TIMES),
    lambda c: np.full(TIMES.shape, c),
    lambda c: (1.0 - TIMES) ** (1.0 / c - 1.0),
    lambda c: np.where(c / 2.0 > TIMES, 1.0, c / (2.0 - c)),
]
"""Shares of a torque that are left in a period, with a mean of c."""


@pytest.mark.parametrize("c", [0.005, 0.05, 0.4, 0.8])
def test_torques_that_stand_for_one_that_is_late_do_no_less_and_hardly_more(c):
    late, begin, end, moved = Late(*map(Fraction, (0, c, 1, 0, 0))), 0.0, 0.0, 0.0
    for left in (shape(c) for shape in FALLING):
        rates, moment = np.cumsum(left) / len(TIMES), 2.0 * np.mean((1.0 - TIMES) * left)
        begin, end = max(begin, moment), max(end, 2.0 * np.mean(TIMES * left))
        moved = max(moved, *(np.mean(x * rates) / np.mean(x * TIMES) for x in (1.0, TIMES, 1.0 - TIMES)))
        # Beside an even growth to what is left in the end there is one that stands for the rest.
        beside = [np.mean(x * (rates - c * TIMES)) / np.mean(x * TIMES) for x in (TIMES, 1.0 - TIMES)]
        assert max(beside) <= 2.0 * moment - 2.0 * c + 1e-3
    for most, share in zip((*late.ends, late.moved), (begin, end, moved), strict=True):
        assert 0.6 * float(most) < share <= float(most) + 1e-3


def test_what_is_forgotten_pays_for_all_that_is_late_and_no_part_of_it_twice():
    """What is late adds to V for one of these sizes all that is paid, to the last."""
    h, kept, weight = Fraction(1, 2), Fraction(3, 4), Fraction(7)
    late, more, far = Late(kept, Fraction(1, 8), weight, Fraction(0), Fraction(0)), Fraction(9, 8), Fraction(3)
    mean, moved, forgotten = late.mean, late.moved, 1 - kept
    falls, both = weight * forgotten / h, Fraction(2)
    # Of |e| = 1: a quarter of the fall is for what moves with the state, an eighth to spare, and the rest for the rest.
    F, M, alone = falls / (2 * mean * more), forgotten, (1 - Fraction(3, 8)) * falls - 3 * mean * mean * both
    costs = Costs(alone / mean, alone / moved, both, far, lambda wide: [[F * wide / (far * moved / mean)]], more)
    form, paid, spare = Follower.paid(SimpleNamespace(h=h), late, Change([[M]], Fraction(0), kept), [[Fraction(0)]], costs)

    def margin(e, x):
        """What is paid less what is added for |e| and a state."""
        added = mean * more * e * F * x + (mean * costs.mean + moved * costs.moved) * e + 3 * mean * mean * both * e * e
        grown = weight * ((kept * e + M * x) ** 2 - e * e) + spare * weight * e * e
        return paid - form[0][0] * x * x - added - grown / h

    assert margin(1, 1) == 0
    assert all(margin(Fraction(k, 8), Fraction(n, 8)) >= 0 for k in range(40) for n in range(40))
