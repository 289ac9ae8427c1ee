"""Whole states: moved, kept in columns and blocks of arrays, flattened; compiled code does what plain Python does."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.structure import LANES, flatten, load, move, pack, store, unflatten, unpack
from tests.algebra.readers import agree, bits, leaves, numbers, same


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
LANE_COUNTS = (1, 127, 128, 129, 1000)

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


@settings(max_examples=15)
@given(states, states, numbers)
def test_every_reader_moves_alike(state, rate, step):
    agree(move, state, step, rate)
    agree(move, state, step, without(rate, 5))


def test_move_symbols_and_numbers():
    x, h, r = sympy.symbols("x h r")
    assert move((x, (x, 2 * x)), h, (r, None)) == (x + h * r, (x, 2 * x))
    assert same(move, 1.0, 0.5, 3.0) == 2.5
    assert same(move, 1.0, 0.5, None) == 1.0
    assert same(move, Empty(), 0.5, Empty()) == Empty()
    assert math.isnan(same(move, (math.nan,), 0.0, (1.0,))[0])


def test_move_refuses_a_rate_of_another_shape():
    with pytest.raises(ValueError, match="zip"):
        move((1.0, 2.0), 0.1, (1.0,))
    with pytest.raises(ValueError, match="zip"):
        move((1.0, 2.0), 0.1, (1.0, 2.0, 3.0))


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


@numba.njit(error_model="numpy")
def compiled_store(x, lane, state):
    store(x, lane, state)


@numba.njit(error_model="numpy")
def compiled_load(x, lane, like):
    return load(x, lane, like)


def numbered(rows: int, lanes: int) -> np.ndarray:
    """An array whose every entry differs."""
    return np.arange(rows * lanes, dtype=float).reshape(rows, lanes) + 0.25


@pytest.mark.parametrize(("put", "get"), [(store, load), (compiled_store, compiled_load)])
@pytest.mark.parametrize("lane", [0, 1, 5])
def test_load_reads_what_store_wrote_in_a_column(put, get, lane):
    x = numbered(SIZE, 6)
    before = x.copy()
    assert flatten(get(x, lane, LIKE)) == before[:, lane].tolist()
    state = unflatten(-np.arange(1.0, SIZE + 1.0), LIKE)
    put(x, lane, state)
    assert get(x, lane, LIKE) == state
    assert type(get(x, lane, LIKE).inner) is Pair
    np.testing.assert_array_equal(np.delete(x, lane, axis=1), np.delete(before, lane, axis=1))


@pytest.mark.parametrize(("put", "get"), [(store, load), (compiled_store, compiled_load)])
@pytest.mark.parametrize("lane", [0, 1, LANES - 1])
def test_load_reads_what_store_wrote_in_a_block(put, get, lane):
    columns = numbered(SIZE, 2 * LANES)
    blocks = pack(columns)
    assert flatten(get(blocks[1], lane, LIKE)) == columns[:, LANES + lane].tolist()
    state = unflatten(-np.arange(1.0, SIZE + 1.0), LIKE)
    put(blocks[1], lane, state)
    assert get(blocks[1], lane, LIKE) == state
    columns[:, LANES + lane] = flatten(state)
    np.testing.assert_array_equal(unpack(blocks, 2 * LANES), columns)


@pytest.mark.parametrize("get", [load, compiled_load])
def test_a_state_stands_for_every_lane(get):
    state = unflatten(np.arange(1.0, SIZE + 1.0), LIKE)
    assert get(state, 0, LIKE) == state
    assert get(state, 77, LIKE) == state


def test_plain_and_compiled_store_write_alike():
    x = numbered(3, 4)
    before = x.copy()
    store(x, 1, (1.0, 2.0, 3.0))
    compiled_store(x, 2, (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(x[:, 1], x[:, 2])
    np.testing.assert_array_equal(x[:, [0, 3]], before[:, [0, 3]])


@pytest.mark.parametrize(("put", "get"), [(store, load), (compiled_store, compiled_load)])
def test_a_state_without_numbers(put, get):
    x = numbered(0, 4)
    put(x, 2, Empty())
    assert get(x, 2, Empty()) == Empty()


@pytest.mark.parametrize("lanes", LANE_COUNTS)
@pytest.mark.parametrize("components", [1, 3, SIZE])
def test_pack_and_unpack(lanes, components):
    states = numbered(components, lanes)
    blocks = pack(states)
    count = math.ceil(lanes / LANES)
    assert blocks.shape == (count, components * LANES)
    assert blocks.flags["C_CONTIGUOUS"]
    back = unpack(blocks, lanes)
    assert back.flags["C_CONTIGUOUS"]
    np.testing.assert_array_equal(back, states)
    for lane in {0, lanes // 2, lanes - 1}:
        block, place = divmod(lane, LANES)
        np.testing.assert_array_equal(blocks[block].reshape(components, LANES)[:, place], states[:, lane])
    # The lanes that fill up the last block repeat the last one, so they never meet a number that no run has.
    rest = blocks[-1].reshape(components, LANES)[:, (lanes - 1) % LANES + 1 :]
    np.testing.assert_array_equal(rest, np.repeat(states[:, -1:], rest.shape[1], axis=1))


def test_pack_copies():
    states = numbered(2, 2 * LANES)
    blocks = pack(states)
    blocks[:] = 0.0
    assert states.min() > 0.0


@numba.njit(error_model="numpy")
def advance(blocks, step, rate, like):
    for b in range(blocks.shape[0]):
        for lane in range(LANES):
            store(blocks[b], lane, move(load(blocks[b], lane, like), step, rate))


@pytest.mark.parametrize("lanes", LANE_COUNTS)
def test_every_lane_of_every_block_moves_as_one_state_does(lanes):
    columns = np.random.default_rng(lanes).normal(size=(SIZE, lanes))
    rate = unflatten(np.random.default_rng(1).normal(size=SIZE), LIKE)._replace(inner=None)
    blocks = pack(columns)
    advance(blocks, 0.1, rate, LIKE)
    alone = np.array([flatten(move(unflatten(column, LIKE), 0.1, rate)) for column in columns.T]).T
    np.testing.assert_array_equal(unpack(blocks, lanes).view(np.uint64), np.ascontiguousarray(alone).view(np.uint64))
