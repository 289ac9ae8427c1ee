"""Bounds of addresses and of work, against what is done where a program runs in plain Python."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.operations import INDEX
from starhold.algebra.scalar import less, sqrt, where
from starhold.algebra.structured import Buffer, at, function, repeat, until, when
from starhold.algebra.words import number_of
from starhold.trace.bounds import OutsideError, Work, check, work
from starhold.trace.program import Memory, Program
from starhold.trace.recording import Recorder
from tests.trace.interpreter import Interpreter
from tests.trace.machines import Subject, column, same
from tests.trace.scripts import CELLS, OUT, TABLE, Script, scripts, subject, values


def program(equation: Callable[..., Any], *names: str) -> Program:
    """The recording of an equation of cells and counts."""
    recorder = Recorder()
    cells = Buffer(recorder.memory("cells", lanes=True, writable=True), 0, 1 << 60)
    with recorder.recording():
        equation(cells, *(recorder.input(name, INDEX) for name in names))
    return recorder.program("run")


def places(equation: Callable[..., Any], **counts: Any) -> tuple[int, int]:
    """The lowest and the highest place of the cells that an equation of counts uses."""
    return work(program(equation, *counts), counts).places["cells"]


def reached(equation: Callable[..., Any], **counts: int) -> set[int]:
    """The places that it uses where it runs."""
    return Interpreter(program(equation, *counts), {"cells": [0.0] * 100}, counts).places["cells"]


# Addresses.


def backwards(cells, n):
    repeat(n, lambda k: cells.put(n - 1 - k, (1.0,)))


def triangle(cells, n):
    repeat(n, lambda i: repeat(i + 1, lambda j: cells.put(i - j, (1.0,))))


def upper(cells, n):
    repeat(n, lambda i: repeat(n - 1 - i, lambda j: cells.put(i * n + i + 1 + j, (1.0,))))


def rows(cells, n):
    repeat(n, lambda i: repeat(n, lambda j: cells.put(n * i + j, (1.0,))))


def squares(cells, n):
    repeat(n, lambda i: cells.put(i * i - i, (1.0,)))


def ends(cells, n):
    def turn(k):
        at(k, 0, lambda: cells.put(k, (1.0,)))
        at(k, n - 1, lambda: cells.put(n - 1 - k, (2.0,)))
        at(k, n + 1, lambda: cells.put(k - 99, (3.0,)))

    repeat(n, turn)


def before(cells, n):
    # Of no use where n is 0 or 1, and not done then.
    repeat(n - 1, lambda k: cells.put(n - 2, (1.0,)))


def pairs(cells, n):
    repeat(n, lambda i: repeat(i, lambda j: repeat(i - j, lambda k: cells.put(i - 1 - j - k, (1.0,)))))


EXACT = [backwards, triangle, upper, rows, ends, before, pairs, squares]


@pytest.mark.parametrize("equation", EXACT)
@pytest.mark.parametrize(("low", "high"), [(0, 7), (3, 3), (1, 5)])
def test_the_bounds_are_the_places_that_are_reached(equation: Callable[..., Any], low: int, high: int) -> None:
    found = [place for n in range(low, high + 1) for place in reached(equation, n=n)]
    assert places(equation, n=(low, high)) == (min(found), max(found))


def test_many_turns_are_bounded_without_trying_them() -> None:
    assert places(rows, n=(0, 10**6)) == (0, 10**12 - 1)
    low, high = places(squares, n=(0, 1000))
    assert low <= 0
    assert 999 * 998 <= high <= 999 * 999


def test_an_address_outside_is_named() -> None:
    def equation(cells, n):
        @function
        def shifted(cells, first):
            repeat(n_turns, lambda k: cells.put(3 * k + first, (1.0,)))

        n_turns = 4
        shifted(cells, n + 1)

    recorded = program(equation, "n")
    bounds = check(recorded, {"n": (0, 5)}, {"cells": 16})
    assert bounds.places == {"cells": (1, 15)}
    text = "shifted: cells[n + 3 * k + 1] may lie from 1 to 15, and cells holds 15 numbers"
    with pytest.raises(OutsideError, match=re.escape(text)):
        check(recorded, {"n": (0, 5)}, {"cells": 15})
    with pytest.raises(OutsideError, match=re.escape("may lie from 0 to 9, and cells holds 9 numbers")):
        check(recorded, {"n": -1}, {"cells": 9})
    with pytest.raises(OutsideError, match=re.escape("may lie from -1 to 8")):
        check(recorded, {"n": -2}, {"cells": 10})


def test_a_size_that_the_program_states_is_checked() -> None:
    def equation(cells, n, lane):
        cells[n] = 1.0

    recorded = Subject(equation, (Memory("cells", True, True, 3),), {"n": INDEX}).program()
    assert check(recorded, {"n": (0, 2)}, {}).work == Work(stores=1)
    with pytest.raises(OutsideError, match=re.escape("run: cells[n] may lie from 0 to 3, and cells holds 3 numbers")):
        check(recorded, {"n": (0, 3)}, {})
    check(recorded, {"n": (0, 3)}, {"cells": 4})


def test_what_is_not_given_is_named() -> None:
    recorded = program(rows, "n")
    with pytest.raises(ValueError, match="no bounds for the count n"):
        work(recorded, {})
    with pytest.raises(ValueError, match="no size for the memory cells"):
        check(recorded, {"n": 3}, {})
    with pytest.raises(ValueError, match="from 3 to 2, the bounds of the count n"):
        work(recorded, {"n": (3, 2)})


# Work.


def test_loops_times_bodies_are_counted() -> None:
    @function
    def form(cells, x):
        return repeat(3, lambda i, total: (total + cells[i] * x,), 0.0)[0]

    def equation(cells, n):
        def turn(k, x):
            at(k, n - 1, lambda: cells.put(9, (x / 2.0,)))
            (y,) = when(less(x, 1.0), lambda x: (sqrt(-x),), x)
            return (form(cells, y) + form(cells, 2.0),)

        (x,) = repeat(n, turn, 0.5)
        (x,) = until(lambda x: less(x, 1.0), lambda x: (where(less(x, 2.0), x * x, x),), x, at_most=7)
        cells[0] = x + number_of(n)

    bounds = work(program(equation, "n"), {"n": (2, 5)})
    turn = Work(additions=7, multiplications=6, divisions=1, roots=1, negations=1, comparisons=1, truths=1, indices=2)
    turn = turn._replace(loads=6, stores=1)
    newton = Work(multiplications=1, comparisons=2, selects=1)
    assert [(loop.counter, loop.most) for loop in bounds.loops] == [("k", 5), ("turn1", 7)]
    assert bounds.loops[0].each == turn
    assert bounds.loops[1].each == newton
    # The division and its store come in the last turn alone.
    once = Work(divisions=1, stores=1)
    often = turn._replace(divisions=0, stores=0)
    rest = Work(additions=1, indices=1, stores=1)
    assert bounds.work == often.times(5).plus(once).plus(newton.times(7)).plus(rest)
    assert bounds.work.arithmetic == 5 * 14 + 1 + 7 + 1


def test_a_branch_on_a_counter_is_done_once_in_its_loop() -> None:
    def equation(cells, n, m):
        def outer(i):
            def inner(j):
                at(i, 3, lambda: cells.put(0, (cells[1] * 2.0,)))
                at(j, i, lambda: cells.put(1, (sqrt(cells[1]),)))
                at(n, m, lambda: cells.put(2, (cells[3] + 1.0,)))

            repeat(m, inner)

        repeat(n, outer)

    found = work(program(equation, "n", "m"), {"n": 5, "m": 4}).work
    assert found == Work(multiplications=4, roots=5, indices=3 * 20, loads=9, stores=9)
    found = work(program(equation, "n", "m"), {"n": (4, 5), "m": 4}).work
    assert (found.multiplications, found.roots, found.additions) == (4, 5, 20)


@settings(max_examples=60)
@given(scripts, st.integers(0, 3), st.integers(0, 2**64 - 1))
def test_a_random_program_stays_within_its_memory_and_does_no_more_than_is_counted(
    script: Script, count: int, seed: int
) -> None:
    drawn = subject(script)
    recorded, memories, inputs = drawn.program(), values(seed), {"count": count, "seed": seed}
    one = column(recorded, memories, 0)
    sizes = {"cells": CELLS, "table": TABLE, "out": OUT}
    bounds = check(recorded, {"count": (0, 3)}, sizes)
    exact = check(recorded, {"count": count}, sizes)
    run = Interpreter(recorded, one, inputs)
    assert all(a >= b for a, b in zip(bounds.work, exact.work, strict=True))
    assert all(a >= b for a, b in zip(exact.work, run.work, strict=True)), (exact.work, run.work)
    for name, places in run.places.items():
        assert all(exact.places[name][0] <= place <= exact.places[name][1] for place in places)
    same(drawn.plain(one, inputs), {name: np.array(cells) for name, cells in run.memories.items()}, "the interpreter")
