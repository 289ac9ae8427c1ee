"""One lane in short vectors: what is recorded for several rows at once, and that it gives the bits of plain Python."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.scalar import less, sqrt, where
from starhold.algebra.several import each, folded
from starhold.algebra.structured import Buffer, repeat, when
from starhold.algebra.vector import multiply
from starhold.algebra.words import bits_of, rotate_left, with_bits, word_and
from starhold.trace.machine import load
from starhold.trace.program import Call, Op, Program, statements
from starhold.trace.recording import Recorder
from starhold.trace.rows import ROWS, LanesRecorder, RowRecorder, unrolled

SIZE = 20
NUMBERS = st.lists(st.floats(-1e9, 1e9), min_size=SIZE, max_size=SIZE)


def recorded(equation: Any, recorder: Recorder | None = None) -> Program:
    """The program of an equation of numbers in memory, which are read before and within a loop of two turns."""
    recorder = recorder or RowRecorder()
    with recorder.recording():
        given, out = recorder.memory("given"), recorder.memory("out", writable=True)
        early = tuple(given[k] for k in range(SIZE))

        def turn(k: Any, *late: Any) -> Any:
            return equation(early, late)

        for place, number in enumerate(repeat(2, turn, *early)):
            out[place] = number
    return recorder.program("rows")


def calls(program: Program) -> list[Call]:
    return [s for s in statements(program.main.body) if isinstance(s, Call)]


def same_bits(equation: Any, program: Program) -> None:
    kernel = load(program, 1)

    @settings(max_examples=25)
    @given(NUMBERS)
    def check(numbers: list[float]) -> None:
        early, out = np.array(numbers), np.zeros(SIZE)
        kernel(early.ctypes.data, out.ctypes.data)
        plain = repeat(2, lambda _, *late: equation(tuple(numbers), late), *numbers)
        assert np.array_equal(out.view(np.uint64), np.array(plain).view(np.uint64))

    check()


def both_give_the_bits(equation: Any, program: Program) -> None:
    """In short vectors, and with each row on its own."""
    for made in (program, unrolled(program)):
        same_bits(equation, made)
    assert not calls(unrolled(program))


def _blend(a: Any, b: Any, c: Any) -> Any:
    turned = with_bits(rotate_left(word_and(bits_of(a), (1 << 52) - 1), 3))
    return where(less(a, b), sqrt(a * a + c * c) / 3.0, b - c) + 0.0 * turned


def blended(count: int) -> Any:
    """`count` rows of numbers that change and that do not, and of one that all share; and a shift of the results."""

    def equation(early: Any, late: Any) -> Any:
        made = each(_blend, (late[:count], early[:count]), late[-1])
        again = each(_blend, ((*made[1:], late[0]), made), early[-1])
        first = each(_blend, (made[: count // 2 + 1], (1.5,) * (count // 2 + 1)), late[1])
        return (*again, *late[count : SIZE - len(first)], *first) if count + len(first) <= SIZE else (*again, *late[count:])

    return equation


@pytest.mark.parametrize("count", [2, 3, 4, 5, 8, 9, 16])
def test_rows_give_the_bits_of_plain_python(count):
    program = recorded(blended(count))
    full, rest = divmod(count, ROWS)
    expected = [ROWS] * full + [rest] * (rest > 1)
    assert [call.rows for call in calls(program)][: len(expected)] == expected
    both_give_the_bits(blended(count), program)


def test_products_of_matrices_give_the_bits_of_plain_python():
    def equation(early, late):
        a, b = (tuple(x[k : k + 3] for k in (0, 3, 6)) for x in (early, late))
        rows = multiply(a, multiply(b, a))
        return (*(1e-9 * number for row in rows for number in row), *late[9:])

    program = recorded(equation)
    assert [call.rows for call in calls(program)] == [3, 3]
    both_give_the_bits(equation, program)


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_rows_side_by_side_give_the_bits_of_plain_python(count):
    """Rows that read what rows before them made, and compute the same as these, are among them."""
    program = recorded(blended(count), LanesRecorder())
    assert not calls(program)
    same_bits(blended(count), program)


def _powers(a: Any) -> Any:
    for _ in range(6):
        a = a * a
    return a


def test_rows_side_by_side_wait_for_no_other_row():
    """Rows within rows go side by side too; those that branch stay one after the other."""

    def inner(a: Any, b: Any) -> Any:
        return each(_powers, ((a, b),))

    def equation(_: Any, late: Any) -> Any:
        made = each(inner, (late[:3], late[3:6]))
        branched = each(lambda a: when(less(a, 0.0), lambda a: (a * 3.0,), a)[0], (late[6:8],))
        return (*(x for pair in made for x in pair), *branched, *late[8:])

    def rounds(recorder: Recorder) -> list[Op]:
        every = statements(recorded(equation, recorder).main.body)
        return [s for s in every if isinstance(s, Op) and s.operation.name == "product" and s.args[0] == s.args[1]]

    one_by_one, together = rounds(Recorder()), rounds(LanesRecorder())
    assert sorted(map(repr, one_by_one)) == sorted(map(repr, together))
    waits = [sum(b.args[0] == a.ref for a, b in pairwise(ops)) for ops in (one_by_one, together)]
    assert waits == [6 * 5, 0]
    same_bits(equation, recorded(equation, LanesRecorder()))


def _first(a: Any, b: Any) -> Any:
    return a * b, 2.0 * b


def _next(pair: Any, a: Any, b: Any) -> Any:
    return pair[0] + a * b, pair[1] - b


def test_sums_of_rows_of_falling_length_give_the_bits_of_plain_python():
    def equation(early, late):
        rows = [[(early[m + j], late[m]) for j in range(5 - m)] for m in range(4)]
        return (*(1e-9 * x for pair in folded(_first, _next, rows) for x in pair), *late[8:])

    program = recorded(equation)
    assert [call.rows for call in calls(program)] == [4, 4, 3, 2]
    both_give_the_bits(equation, program)


def _sum_of(row: Any) -> Any:
    total = row[0]
    for number in row[1:]:
        total = total + number
    return total


def test_rows_that_are_not_alike_are_recorded_one_by_one():
    def equation(early, late):
        shapes = each(_sum_of, ((late[:3], late[3:5]),))
        constants = each(lambda a, n: a * n, ((late[5], late[6]), (1, 2)))
        outside = each(lambda a: a * late[9] - early[3], (late[7:9],))
        return (*shapes, *constants, *outside, *late[6:])

    program = recorded(equation)
    assert not calls(program)
    both_give_the_bits(equation, program)


def test_rows_within_rows_are_recorded_once_and_equal_calls_too():
    def inner(a, b):
        return a * b + 1.0

    def outer(a, b):
        return sum(each(inner, ((a, b, a), (b, b, a))), 0.0)

    def equation(early, late):
        twice = [each(outer, (late[:4], early[:4])) for _ in range(2)]
        return (*twice[0], *twice[1], *late[8:])

    program = recorded(equation)
    assert [call.rows for call in calls(program)] == [4]
    both_give_the_bits(equation, program)


def test_what_reads_memory_or_loops_is_recorded_one_by_one():
    def looped(a, b):
        return repeat(3, lambda k, x: (x * b,), a)[0]

    cells = Buffer([1.0, 2.0])
    program = recorded(lambda early, late: (*each(looped, (late[:4], early[:4])), *late[4:]))
    assert not calls(program)
    assert each(lambda k: cells[k], ((0, 1),)) == (1.0, 2.0)
