"""Whole states: moved and flattened; compiled code does what plain Python does."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.structure import buffers, flatten, move, unflatten
from starhold.algebra.structured import Buffer
from starhold.loop.kernels import numbers_of, state_of
from tests.algebra.readers import bits, leaves, numbers, same


class Empty(NamedTuple):
    pass


class Pair(NamedTuple):
    left: tuple[float, float, float]
    right: float


class Body(NamedTuple):
    attitude: tuple[float, float, float, float]
    inner: Pair
    nothing: Empty
    bare: tuple[()]
    twins: tuple[Pair, Pair]
    last: float


SIZE = 4 + 4 + 8 + 1
LIKE = unflatten([0.0] * SIZE, Body((0.0,) * 4, Pair((0.0,) * 3, 0.0), Empty(), (), (Pair((0.0,) * 3, 0.0),) * 2, 0.0))

states = st.lists(numbers, min_size=SIZE, max_size=SIZE).map(lambda x: unflatten(x, LIKE))
any_states = st.lists(st.floats(), min_size=SIZE, max_size=SIZE).map(lambda x: unflatten(x, LIKE))


def without(rate: Body, which: int) -> Any:
    """The rate with parts left out: a number, a tuple, a nested structure, several, all of it."""
    return (
        rate,
        rate._replace(last=None),
        rate._replace(attitude=None),
        rate._replace(inner=None),
        rate._replace(inner=Pair(None, rate.inner.right)),
        rate._replace(twins=(None, Pair(rate.twins[1].left, None)), attitude=None),
        tuple(rate),
        None,
    )[which]


KINDS = range(8)


def moved_by_hand(state: Any, step: float, rate: Any) -> list[float]:
    """The numbers of the moved state, from the numbers of both, a missing rate spread over what it stands for."""

    def spread(part: Any, r: Any) -> list[Any]:
        if r is None:
            return [None] * len(flatten(part))
        return [x for p, q in zip(part, r, strict=True) for x in spread(p, q)] if isinstance(part, tuple) else [r]

    pairs = zip(flatten(state), spread(state, rate), strict=True)
    return [x if r is None else x + step * r for x, r in pairs]


@pytest.mark.parametrize("which", KINDS)
def test_move(which):
    @settings(max_examples=15)
    @given(any_states, any_states, st.floats())
    def check(state, rate, step):
        end = same(move, state, step, without(rate, which))
        assert type(end) is Body
        assert type(end.inner) is Pair
        assert type(end.twins[0]) is Pair
        assert list(map(bits, flatten(end))) == list(map(bits, moved_by_hand(state, step, without(rate, which))))

    check()


def test_move_refuses_a_rate_of_another_shape():
    for rate in ((1.0,), (1.0, 2.0, 3.0)):
        with pytest.raises(ValueError, match="zip"):
            move((1.0, 2.0), 0.1, rate)


@given(st.lists(st.floats(), min_size=SIZE, max_size=SIZE))
def test_flatten_undoes_unflatten(x):
    state = unflatten(np.array(x), LIKE)
    assert list(map(bits, flatten(state))) == list(map(bits, x))
    assert list(map(bits, leaves(state))) == list(map(bits, x))
    assert type(state) is Body
    assert type(state.inner) is Pair
    assert type(state.nothing) is Empty
    assert state.bare == ()
    assert all(type(number) is float for number in flatten(state))


def test_buffers_change_in_place():
    class Memory(NamedTuple):
        count: float
        plan: Buffer

    memory = Memory(1.0, Buffer([2.0, 3.0]))
    assert flatten(memory) == [1.0]
    assert buffers(memory) == [memory.plan]
    other = unflatten([5.0], memory)
    assert other == Memory(5.0, memory.plan)
    assert numbers_of(memory) == [1.0, 2.0, 3.0]
    copied = state_of(np.array([7.0, 8.0, 9.0]), memory)
    assert copied.count == 7.0
    assert [copied.plan[0], copied.plan[1]] == [8.0, 9.0]
    copied.plan[0] = 0.0
    assert memory.plan[0] == 2.0
