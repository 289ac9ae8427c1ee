"""The search for the fastest root within limits, and the fit through roots."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.analysis.roots import PUBLISHED, TwoPieceFit, fit, search, unmet
from starhold.analysis.transient import Limits
from tests.analysis.turns import problem

ROOTS = np.linspace(-2.6, -0.02, 160)
WIDE = Limits(0.7, 1.2)


@pytest.mark.parametrize("angle", [0.05, 0.9, 1.7, math.pi])
@pytest.mark.parametrize("limits", [WIDE, Limits(0.5, math.inf), Limits(math.inf, 0.4)])
def test_cutting_transients_short_loses_no_root(angle, limits):
    made = problem()
    flown = made.fly(angle, ROOTS)
    eased = Limits(1.1 * limits.rate, 1.2 * limits.acceleration)
    (found,) = search(made, [angle], ROOTS[::-1], limits, eased)
    for best, kind in ((found.hard, limits), (found.eased, eased)):
        times = np.where(flown.within(kind), flown.time, np.nan)
        lane = int(np.nanargmin(times))
        assert (best.root, best.transient) == (ROOTS[lane], flown[lane])
        assert best.time == times[lane]
    assert found.eased.time <= found.hard.time


def test_threads_change_nothing_and_every_angle_is_told():
    made, heard = problem(), []
    angles = [0.5, 1.0, 1.5]
    one = search(made, angles, ROOTS[::4], WIDE, WIDE, lambda done, total: heard.append((done, total)), threads=1)
    assert one == search(made, angles, ROOTS[::4], WIDE, WIDE, threads=3)
    assert heard == [(1, 3), (2, 3), (3, 3)]
    assert [item.hard for item in one] == [item.eased for item in one]


def test_what_no_root_achieves_is_told():
    made = problem()
    slow, gentle = Limits(0.2, math.inf), Limits(math.inf, 1e-3)
    assert search(made, [1.0], ROOTS, slow, slow)[0].hard is None
    rate, sharp = unmet(made, 1.0, ROOTS, slow), unmet(made, 1.0, ROOTS, gentle)
    assert (rate.what, sharp.what) == ("rate", "acceleration")
    # The start alone is too fast.
    assert rate.least == pytest.approx(math.hypot(*made.rate))
    flown = made.fly(1.0, [sharp.root])[0]
    assert max(flown.peak_acceleration) == sharp.least > gentle.acceleration
    assert unmet(replace(made, steps=20), 1.0, ROOTS, WIDE).what == "end"
    # The slow one swings past the target and gathers speed, the fast one brakes too hard.
    pair = replace(made, angle_end=3.0, rate_end=3.0)
    assert unmet(pair, 1.0, [-0.54, -0.02], Limits(0.5, 0.222)).what == "both"


@settings(max_examples=6, deadline=None)
@given(
    st.tuples(st.floats(-2.0, -0.5), st.floats(-4.0, -0.5), st.floats(-1.5, -0.2)),
    st.tuples(st.floats(-3.0, -0.5), st.floats(-2.0, -0.2), st.floats(-1.0, -0.1)),
    st.integers(4, 30),
    st.floats(0.0, 2e-3),
)
def test_a_fit_gives_back_what_it_goes_through(below, above, cut, noise):
    angles = np.radians(np.arange(10.0, 181.0, 5.0))
    true = TwoPieceFit(below, above, 0.5 * float(angles[cut - 1] + angles[cut]))
    roots = true.at(angles) * (1.0 + noise * np.sin(7.0 * np.arange(len(angles))))
    found = fit(angles, roots)
    # No worse than the truth itself, whose errors are the noise.
    assert np.sum(found.errors(angles, roots) ** 2) <= np.sum(true.errors(angles, roots) ** 2) + 1e-9
    assert np.abs(found.errors(angles, true.at(angles))).max() < 3e-4 + 4.0 * noise


def test_the_published_fit_is_as_published():
    assert TwoPieceFit((-1.018, -2.071, -0.849), (-2.177, -0.726, -0.155), math.radians(85.0)) == PUBLISHED
    at = np.radians([10.0, 85.0, 85.001, 163.74])
    assert PUBLISHED.at(at) == pytest.approx([-1.558, -0.896, -0.897, -0.428], abs=1e-3)
