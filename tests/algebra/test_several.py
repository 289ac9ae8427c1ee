"""Operations on tuples of any length: what they give, and that compiled code gives the same."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.several import each, weighted
from starhold.algebra.vector import add, dot, scale
from starhold.trace.calling import Compiled
from tests.algebra.readers import agree, numbers, same

LENGTHS = (1, 2, 3, 5)


def vectors(count: int):
    return st.tuples(*[st.tuples(numbers, numbers, numbers)] * count)


def row(count: int):
    return st.tuples(*[numbers] * count)


def _affine(a, v, slope, offset):
    return add(scale(slope * a, v), offset)


def affine(a, v, slope, offset):
    return each(_affine, (a, v), slope, offset)


def _products(rows, v):
    return each(dot, (rows,), v)


def nested(matrices, v):
    """A map within a map, over elements of different lengths."""
    return each(_products, (matrices,), v)


@pytest.mark.parametrize("count", LENGTHS)
def test_each_element_and_sums_of_all(count):
    @settings(max_examples=20)
    @given(row(count), vectors(count), numbers, st.tuples(numbers, numbers, numbers))
    def check(a, v, slope, offset):
        assert agree(affine, a, v, slope, offset) == tuple(_affine(x, y, slope, offset) for x, y in zip(a, v, strict=True))
        found = agree(weighted, a, v)
        for axis in range(3):
            terms = [x * y[axis] for x, y in zip(a, v, strict=True)]
            assert found[axis] == pytest.approx(math.fsum(terms), abs=1e-14 * sum(map(abs, terms)) + 1e-300)

    check()


@settings(max_examples=20)
@given(vectors(2), vectors(3), st.tuples(numbers, numbers, numbers))
def test_elements_may_differ_in_length(a, b, v):
    assert nested((), v) == ()
    assert same(nested, (a, b), v) == ((dot(a[0], v), dot(a[1], v)), tuple(dot(x, v) for x in b))


@pytest.mark.parametrize(
    ("function", "arguments"),
    [(affine, ((1.0, 2.0), ((1.0, 2.0, 3.0),), 1.0, (0.0, 0.0, 0.0))), (weighted, ((1.0, 2.0), ((1.0, 2.0, 3.0),)))],
)
def test_tuples_of_different_lengths_are_refused(function, arguments):
    with pytest.raises(ValueError, match="zip"):
        function(*arguments)
    with pytest.raises(ValueError, match="zip"):
        Compiled(function, *arguments)
