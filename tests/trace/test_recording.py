"""What is recorded of an equation, what is left out of it, and what is refused."""

import builtins
import math
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
import pytest

from starhold.algebra.scalar import both, either, less, sqrt, where
from starhold.algebra.structured import Buffer, at, function, repeat, unless, until, when
from starhold.algebra.words import word_add, word_xor
from starhold.errors import InputError
from starhold.trace.handles import Opposite, RecordingError
from starhold.trace.program import Branch, Call, Load, Loop, Op, Program, Store, single_turns, statements
from starhold.trace.recording import RESERVED, Recorder


def record(equation: Callable[..., Any]) -> Program:
    """The recording of an equation of cells that it may write, a table, a count and a word."""
    recorder = Recorder()
    cells = Buffer(recorder.memory("cells", lanes=True, writable=True), 0, 8)
    table = Buffer(recorder.memory("table"), 0, 8)
    count, seed = recorder.input("count", "index"), recorder.input("seed", "word")
    with recorder.recording():
        equation(cells, table, count, seed)
    return recorder.program("run")


def found(program: Program, kind: type, function_name: str = "run") -> list[Any]:
    """The statements of a kind in a function, in order."""
    (one,) = (f for f in program.functions if f.name == function_name)
    return [s for s in statements(one.body) if isinstance(s, kind)]


def operations(program: Program, function_name: str = "run") -> list[str]:
    """The names of the operations of a function, in order."""
    return [s.operation.name for s in found(program, Op, function_name)]


# Sharing.


def test_a_number_and_its_opposite_share_their_products() -> None:
    def equation(cells, table, *_):
        a, x, y = table[0], cells[0], cells[1]
        turned: Any = Opposite(a)
        cells[2] = (x * a + x * turned) - turned * y
        cells[3] = turned + (y + -turned)

    assert operations(record(equation)) == ["product", "minus", "product", "plus", "plus", "minus"]


def test_an_opposite_that_is_alone_is_a_negative() -> None:
    def equation(cells, table, *_):
        turned: Any = Opposite(table[0]) * cells[0]
        cells[1], cells[2] = turned, 1.0 / turned

    assert operations(record(equation)) == ["product", "negative", "divide"]


def test_equal_operations_are_recorded_once() -> None:
    def equation(cells, table, *_):
        x, y = cells[0], table[0]
        cells[1] = x * y + x * y
        cells[2] = sqrt(x * y) + sqrt(x * y)

    assert operations(record(equation)) == ["product", "plus", "sqrt", "plus"]


def test_a_loop_shares_what_stands_before_it_but_not_what_stands_in_another() -> None:
    def equation(cells, table, count, _):
        x = table[0]
        cells[0] = x * 2.0

        def turn(k):
            cells[k] = x * 2.0 + x * 3.0

        repeat(count, turn)
        repeat(count, turn)

    assert operations(record(equation)) == ["product", "product", "plus", "product", "plus"]


def test_equal_loops_that_write_nothing_are_recorded_once() -> None:
    def equation(cells, table, count, _):
        x = table[0]

        def turn(k, y, z):
            (y,) = when(less(z, table[k]), lambda y: (y * x,), y)
            return y, z + y

        def other(k, y, z):
            return y * x, z + table[k]

        first, again, apart = (repeat(count, body, x, 0.0) for body in (turn, turn, other))
        cells[0], cells[1], cells[2] = first[0], again[1], apart[1]
        later, last = (repeat(count, lambda k, y: (y + cells[k],), x) for _ in range(2))
        cells[3], cells[4] = later[0], last[0]

    recorded = found(record(equation), Loop)
    # The first with one within it, the other, and two that read what may have been written between them.
    assert [loop.most for loop in recorded] == ["count", 1, "count", "count", "count"]


def test_numbers_of_other_signs_or_kinds_are_not_taken_for_equal() -> None:
    def equation(cells, table, *_):
        x = table[0]
        cells[0], cells[1], cells[2] = x + 0.0, x + -0.0, x + math.nan
        cells[3] = where(less(x, 1.0), 1.0, 0.0)
        cells[4] = where(less(x, 1.0), 0.0, 1.0)

    assert operations(record(equation)) == ["plus", "plus", "plus", "less", "select", "select"]


def test_what_is_read_of_a_table_is_shared_and_what_is_read_of_written_memory_is_not() -> None:
    def equation(cells, table, *_):
        cells[0] = table[1] + table[1]
        cells[1] = cells[0] + cells[0]

    assert [s.memory for s in found(record(equation), Load)] == ["table", "cells", "cells"]


def test_indices_that_add_nothing_are_not_recorded() -> None:
    def equation(cells, _, count, __):
        cells[count + 0] = 1.0
        cells[0 + count] = 1.0
        cells[1 * count] = 1.0
        cells[count * 1 - 0] = 1.0
        at(count, count, lambda: cells.put(0, (2.0,)))

    program = record(equation)
    assert operations(program) == []
    assert not found(program, Branch)
    assert [s.index for s in found(program, Store)] == ["count"] * 4 + [0]


def test_a_truth_that_is_known_decides() -> None:
    def equation(cells, table, *_):
        p = less(table[0], 1.0)
        for place, truth in enumerate((both(True, p), both(p, False), either(p, True), either(False, p))):
            cells[place] = where(truth, table[1], table[2])
        (cells[4],) = unless(True, lambda x: (x + 1.0,), table[3])
        (cells[5],) = when(True, lambda x: (x * 3.0,), table[3])

    program = record(equation)
    assert operations(program) == ["less", "select", "product"]
    assert not found(program, Loop)


# Leaving out.


def test_what_nobody_reads_is_dropped() -> None:
    def equation(cells, table, count, seed):
        word_add(seed, 1)
        unused = table[0] * cells[1]
        repeat(3, lambda k, x: (x + unused,), 0.0)
        at(count, 3, lambda: table[4])
        until(lambda x: less(x, 0.0), lambda x: (x - 1.0,), table[1], at_most=5)
        cells[0] = table[2]

    program = record(equation)
    assert not operations(program)
    assert not found(program, Loop)
    assert not found(program, Branch)
    assert [s.memory for s in found(program, Load)] == ["table"]


def test_a_slot_that_nobody_reads_is_dropped_and_its_loop_stays() -> None:
    def equation(cells, table, *_):
        x, _, _ = repeat(3, lambda k, x, y, z: (x + 1.0, y * z, z - y), table[0], table[1], table[2])
        cells[0] = x

    program = record(equation)
    (loop,) = found(program, Loop)
    assert [slot.name for slot in loop.slots] == ["x"]
    assert operations(program) == ["plus"]


def test_a_slot_that_never_changes_stands_for_what_it_holds() -> None:
    def equation(cells, table, *_):
        def inner(k, x, y, z):
            return x + y, y, z

        def outer(k, x, y, z):
            return repeat(2, inner, x, y, z)

        cells[0], cells[1], cells[2] = repeat(3, outer, table[0], table[1], 2.5)

    program = record(equation)
    assert [[slot.name for slot in loop.slots] for loop in found(program, Loop)] == [["x"], ["x1"]]
    values = [s.value for s in found(program, Store)]
    assert values == ["x_", found(program, Load)[1].ref, 2.5]


def test_a_constant_that_a_turn_changes_is_no_constant() -> None:
    def equation(cells, *_):
        cells[0], cells[1], cells[2] = repeat(3, lambda k, x, y, z: (y, x, -0.0), 1.0, 2.0, 0.0)

    (loop,) = found(record(equation), Loop)
    assert [(slot.before, slot.after) for slot in loop.slots] == [(1.0, "y"), (2.0, "x"), (0.0, -0.0)]


def test_a_loop_of_one_turn_reads_what_stands_before_it() -> None:
    def equation(cells, table, *_):
        x, _ = when(less(table[0], 0.0), lambda x, y: (sqrt(x * y), y + 1.0), table[1], 2.0)
        cells[0] = x

    main = single_turns(record(equation).main)
    (loop,) = (s for s in main.body if isinstance(s, Loop))
    (slot,) = loop.slots
    product, root = loop.body
    assert product.args == (slot.before, 2.0)
    assert (root.operation.name, slot.after) == ("sqrt", root.ref)


# Functions.


def test_a_function_is_recorded_once_for_each_form_of_its_arguments() -> None:
    @function
    def scaled(cells: Buffer, factor: float, unused: float, twice: bool) -> float:
        """A number scaled."""
        cells[0] = factor
        return factor * (2.0 if twice else 1.0)

    def equation(cells, table, count, _):
        a = scaled(cells.part(1, 2), table[0], table[1], True)
        b = scaled(cells.part(1, 2), a, 3.0, True)
        c = scaled(cells.part(1, 2), b, 3.0, False)
        d = scaled(cells.part(count, 2), c, 3.0, False)
        cells[7] = scaled(cells.part(count + 1, 2), d, 3.0, False)

    program = record(equation)
    assert [f.name for f in program.functions] == ["scaled", "scaled1", "scaled2", "run"]
    assert [f.params for f in program.functions[:3]] == [
        (("factor", "number"),),
        (("factor", "number"),),
        (("cells1", "index"), ("factor", "number")),
    ]
    assert program.functions[0].doc == "A number scaled."
    assert [s.function.name for s in found(program, Call)] == ["scaled", "scaled", "scaled1", "scaled2", "scaled2"]


def test_functions_within_functions_have_names_of_their_own() -> None:
    @function
    def step(x: float, up: bool) -> float:
        return x + 1.0 if up else x - 1.0

    @function
    def outer(x: float) -> float:
        step_ = step(x, True)
        return step_ * x

    def equation(cells, table, *_):
        cells[0] = outer(table[0]) + step(table[1], False) + step(table[2], True)

    program = record(equation)
    assert [f.name for f in program.functions] == ["step", "outer", "step1", "run"]
    assert operations(program, "step") == ["plus"]
    assert operations(program, "step1") == ["minus"]


def test_what_a_function_gives_may_be_known() -> None:
    @function
    def pair(x: float) -> tuple[float, bool]:
        return 1.5, True

    def equation(cells, table, *_):
        x, truth = pair(table[0])
        cells[0] = where(truth, x, table[1])

    program = record(equation)
    assert program.functions[0].outs == ((1.5, "number"), (True, "truth"))
    assert operations(program) == ["select"]


def test_variables_have_names_that_every_language_allows() -> None:
    class Pair(NamedTuple):
        double: Any
        x_: Any

    def equation(cells, table, *_):
        def turn(int, pair, new, x):
            return Pair(pair.double + new, pair.x_), new * 2.0, x - table[int]

        pair, new, x = repeat(3, turn, Pair(table[0], table[1] * 1.5), table[2], table[3])
        cells.put(0, (*pair, new, x))

    (loop,) = found(record(equation), Loop)
    assert (loop.counter, [slot.name for slot in loop.slots]) == ("int1", ["double1", "new1", "x1"])
    assert {"double", "new", "int", "function", "uint64_t"} <= RESERVED


# Refusing.


def _written_by_done(cells, table, *_):
    def done(x):
        cells[0] = x
        return less(x, 0.0)

    until(done, lambda x: (x,), table[0], at_most=3)


@function
def _writing(cells, x):
    cells[0] = x
    return x


REFUSED: list[tuple[Callable[..., Any], str, str]] = [
    (
        lambda c, t, n, w: math.sqrt(t[0]),
        "a function that is none of the scalar operations",
        "sin, cos, atan2, exp, log, power",
    ),
    (lambda c, t, n, w: float(t[0]), "a function that is none of the scalar operations", "starhold.algebra.scalar"),
    (lambda c, t, n, w: math.floor(t[0]), "an operator that is none of the scalar operations", "starhold.algebra.scalar"),
    (lambda c, t, n, w: t[0] if t[0] else t[1], "an `if`", "where"),
    (lambda c, t, n, w: t[0] and t[1], "an `if`, `while`, `and`", "both"),
    (lambda c, t, n, w: not less(t[0], 0.0), "`not`", "opposite"),
    (lambda c, t, n, w: t[0] < 0.0, "a comparison of numbers by <", "less or less_equal"),
    (lambda c, t, n, w: t[0] == 0.0, "a comparison of numbers by < > == or !=", "less or less_equal"),
    (lambda c, t, n, w: abs(t[0]), "abs of a number", "absolute of starhold.algebra.scalar"),
    (lambda c, t, n, w: round(t[0]), "an operator that is none of the scalar operations", "starhold.algebra.scalar"),
    (lambda c, t, n, w: t[0] ** 2, "a power", "power and cbrt of starhold.algebra.elementary"),
    (lambda c, t, n, w: 2.0 ** t[0], "a power", "products, sqrt"),
    (lambda c, t, n, w: t[0] % 2.0, "an operator that is none of the scalar operations", "+ - * /"),
    (lambda c, t, n, w: w ^ 1, "an operator that is none of the scalar operations", "+ - * /"),
    (lambda c, t, n, w: w >> 3, "an operator that is none of the scalar operations", "+ - * /"),
    (lambda c, t, n, w: (*t[0],), "an operator that is none of the scalar operations", "+ - * /"),
    (lambda c, t, n, w: np.sin(t[0]), "a function of NumPy", "starhold.algebra.scalar"),
    (lambda c, t, n, w: np.array([t[0], t[1]], float), "a function that is none of the scalar operations", "+ - * /"),
    (lambda c, t, n, w: np.float64(2.0) * t[0], "a function of NumPy", "+ - * /"),
    (lambda c, t, n, w: t[0] * np.ones(3), "product of a value of kind ndarray", "a number"),
    (lambda c, t, n, w: c[t[0]], "an index made of numbers", "a count, a loop's counter"),
    (lambda c, t, n, w: t[n + t[0]], "index_plus of a value of kind number", "a count or a counter"),
    (lambda c, t, n, w: repeat(t[0], lambda k: None), "an index made of numbers", "a count"),
    (lambda c, t, n, w: n * 0.5, "index_product of a value of kind float", "a count or a counter"),
    (lambda c, t, n, w: t[0] * n, "product of a value of kind index", "number_of(index)"),
    (lambda c, t, n, w: less(n, 3.0), "less of a value of kind index", "number_of(index)"),
    (lambda c, t, n, w: t[0] + w, "plus of a value of kind word", "a number"),
    (lambda c, t, n, w: t[0] + True, "plus of a value of kind bool", "a number"),
    (lambda c, t, n, w: where(t[0], 1.0, 2.0), "select of a value of kind number", "a truth, as less gives"),
    (lambda c, t, n, w: both(less(t[0], 0.0), 1.0), "both of a value of kind float", "a truth, as less gives"),
    (lambda c, t, n, w: word_xor(w, t[0]), "word_xor of a value of kind number", "a word"),
    (lambda c, t, n, w: c.put(0, (n,)), "a value of kind index in a buffer", "a number"),
    (lambda c, t, n, w: t.put(0, (1.0,)), "writing to a table", "a buffer of the law's memory"),
    (lambda c, t, n, w: repeat(3, lambda k, x: (x, x), t[0]), "takes number and gives number, number", "the same"),
    (lambda c, t, n, w: repeat(3, lambda k, x: (less(x, 0.0),), t[0]), "takes number and gives truth", "the same"),
    (lambda c, t, n, w: repeat(3, lambda k, x: (x + 1,), n), "an index handed from turn to turn", "number_of(index)"),
    (lambda c, t, n, w: until(lambda x: x, lambda x: (x,), t[0], at_most=3), "ends by a value of kind number", "a truth"),
    (lambda c, t, n, w: until(lambda x: less(_writing(c, x), 0.0), lambda x: (x,), t[0], at_most=3), "writing", "turns"),
    (_written_by_done, "writing to a buffer to find out whether a loop is done", "writing in the turns of the loop"),
    (lambda c, t, n, w: function(lambda x: "1")(t[0]), "a value of type str", "numbers, and tuples of them"),
]


@pytest.mark.parametrize(("equation", "what", "instead"), REFUSED)
def test_a_refusal_names_the_line_and_what_to_write(equation: Callable[..., Any], what: str, instead: str) -> None:
    with pytest.raises(RecordingError) as caught:
        record(equation)
    assert issubclass(RecordingError, InputError)
    first = equation.__code__.co_firstlineno
    lines = range(first, first + 6) if equation is _written_by_done else [first]
    assert any(str(caught.value).startswith(f"test_recording.py, line {line}: ") for line in lines), str(caught.value)
    assert what in caught.value.given
    assert instead in caught.value.allowed
    line = Path(__file__).read_text().splitlines()[int(caught.value.where.split()[-1]) - 1]
    assert caught.value.given.endswith(f", in `{line.strip()}`")


def test_a_refusal_names_the_law() -> None:
    def squared(c, t, n, w):
        return t[0] ** 2

    law = FunctionType(squared.__code__, {"CARD": object(), "__builtins__": builtins})
    with pytest.raises(RecordingError, match=r"law test-recording: test_recording.py, line \d+: "):
        record(law)


def test_the_refusal_points_at_the_equation_and_not_at_what_it_calls() -> None:
    def equation(c, t, n, w):
        return both(less(t[0], 0.0), 1.0)

    with pytest.raises(RecordingError) as caught:
        record(equation)
    assert caught.value.where == f"test_recording.py, line {equation.__code__.co_firstlineno + 1}"
