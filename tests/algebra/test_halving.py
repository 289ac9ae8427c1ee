"""Roots by halving."""

import math

from hypothesis import given
from hypothesis import strategies as st

from starhold.algebra.halving import rising


@given(st.floats(1e-300, 1e3))
def test_to_the_last_digit(root):
    found = rising(lambda x: x - root, 0.0, 2e3)
    assert found == root
    assert math.isclose(rising(lambda x: x**3 - 2.0, 0.0, 2.0), 2.0 ** (1.0 / 3.0), rel_tol=3e-16)


def test_the_end_where_there_is_none():
    assert rising(lambda x: 1.0, 0.0, 1.0) == 5e-324
    assert rising(lambda x: -1.0, 0.0, 1.0) == 1.0
