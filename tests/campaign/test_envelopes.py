"""Histograms of windows: quantiles near those of the numbers themselves, the same however runs are cut."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from starhold.campaign.envelopes import BINS, FINE, count, edges, quantile

SIZES = st.lists(st.floats(1e-20, 1e4), min_size=1, max_size=300)


@given(SIZES, st.floats(0.0, 1.0))
def test_quantiles_are_those_of_the_numbers_to_within_a_bin(numbers, share):
    counts, least, most = count(np.array(numbers)[None, None])
    found = float(quantile(counts, share, least, most)[0, 0])
    ranked = np.sort(numbers)
    place = share * (len(ranked) - 1)
    width = 1.0 + 2.0**-FINE
    assert ranked[int(np.floor(place))] / width <= found <= ranked[int(np.ceil(place))] * width
    assert ranked[0] <= found <= ranked[-1]


@given(SIZES, st.integers(0, 300))
def test_parts_add_up(numbers, cut):
    whole = count(np.array(numbers)[None, None])
    parts = [count(np.array(part)[None, None]) for part in (numbers[:cut], numbers[cut:])]
    assert (whole[0] == parts[0][0] + parts[1][0]).all()
    assert whole[1] == np.fmin(parts[0][1], parts[1][1])
    assert whole[2] == np.fmax(parts[0][2], parts[1][2])


def test_every_number_falls_between_the_edges_of_its_bin():
    sides = edges()
    assert len(sides) == BINS + 1
    assert (np.diff(sides) > 0.0).all()
    numbers = np.random.default_rng(1).lognormal(0.0, 15.0, 4000)
    places = np.array([int(np.flatnonzero(count(np.array([[[x]]]))[0][0, 0])[0]) for x in numbers[:200]])
    inside = (numbers[:200] >= sides[0]) & (numbers[:200] < sides[-1])
    assert (sides[places][inside] <= numbers[:200][inside]).all()
    assert (numbers[:200][inside] < sides[places + 1][inside]).all()


@pytest.mark.parametrize("value", [0.0, 1e-300, 1e300, np.inf])
def test_what_is_beyond_the_bins_falls_in_the_end_ones(value):
    counts, least, most = count(np.array([[[value]]]))
    assert counts.sum() == 1
    assert np.flatnonzero(counts[0, 0])[0] == (0 if value < 1.0 else BINS - 1)
    assert quantile(counts, 0.5, least, most)[0, 0] == value
