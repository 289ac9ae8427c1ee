"""What is printed of a program: readable text, the same bits on every machine, and nothing that a compiler warns of."""

import math
import shutil
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from starhold.algebra.operations import INDEX, WORD
from starhold.algebra.scalar import absolute, both, divide, either, less, less_equal, negative, opposite, select, sqrt, where
from starhold.algebra.structured import Buffer, at, function, repeat, unless, until, when
from starhold.algebra.words import bits_of, number_in, number_of, rotate_left, shift_right, word_add, word_of, word_xor
from starhold.trace.c99 import C99
from starhold.trace.javascript import JavaScript
from starhold.trace.llvm import Llvm
from starhold.trace.program import Memory
from starhold.trace.recording import Recorder
from tests.trace.machines import MACHINES, STRICT, Job, Subject, agree, need, on_c, on_lanes, on_node, same
from tests.trace.scripts import SPECIAL

CELLS = Memory("cells", True, True, 24)
TABLE = Memory("table", False, False, 12)
COUNT, SEED = {"count": INDEX}, {"seed": WORD}


def threefry(cells: Buffer, seed: Any, lane: Any) -> None:
    """Counted random words, and numbers of them."""
    key = (seed, word_add(lane, 7))
    keys = (*key, word_xor(word_xor(*key), 0x1BD11BDAA9FC1A22))
    a, b = word_add(1, keys[0]), word_add(2, keys[1])
    for i in range(20):
        a = word_add(a, b)
        b = word_xor(rotate_left(b, (16, 42, 12, 31, 16, 32, 24, 21)[i % 8]), a)
        if i % 4 == 3:
            j = i // 4 + 1
            a, b = word_add(a, keys[j % 3]), word_add(word_add(b, keys[(j + 1) % 3]), j)
    cells.put(0, ((number_in(shift_right(a, 12)) + 0.5) * 2.0**-52, (number_in(shift_right(b, 12)) + 0.5) * 2.0**-52))


def cholesky(cells: Buffer, count: Any, lane: Any) -> None:
    """The factor of a matrix of count rows, at most three, in place of its lower triangle: nested loops over a buffer."""
    repeat(count, lambda i: cells.part(4 * i, 1).put(0, (absolute(cells[4 * i]) + 9.0,)))

    def column(k):
        root = sqrt(cells[4 * k])
        cells[4 * k] = root

        def scaled(i):
            cells[3 * (k + 1 + i) + k] = cells[3 * (k + 1 + i) + k] / root

        def reduced(i):
            def entry(j):
                row, place = k + 1 + i, k + 1 + j
                cells[3 * row + place] = cells[3 * row + place] - cells[3 * row + k] * cells[3 * place + k]

            repeat(i + 1, entry)

        repeat(count - 1 - k, scaled)
        repeat(count - 1 - k, reduced)

    repeat(count, column)


def roots(cells: Buffer, table: Buffer, lane: Any) -> None:
    """Newton's iteration until it stands still, a different number of turns in every lane, with a branch within."""

    def turn(x, a, turns):
        x, turns = 0.5 * (x + divide(a, x)), turns + 1.0
        x, turns = when(less(x, 1e-3), lambda x, turns: (2.0 * x, turns + 100.0), x, turns)
        return x, a, turns

    def done(x, a, turns):
        return less(absolute(x * x - a), 1e-9 * a)

    for place in range(4):
        x, _, turns = until(done, turn, 1.0, absolute(cells[place]), 0.0, at_most=60)
        cells.put(2 + place, (x, turns))


class Sum(NamedTuple):
    """A sum of squares, whether all of them are small, and bits of them."""

    total: Any
    small: Any
    bits: Any


@function
def squared(values: Buffer, state: Sum, limit: float) -> Sum:
    """Add the squares of a buffer.

    They are summed in order /* as written */; nothing is reassociated.
    """

    def turn(k, state):
        x = values[k]
        values[k] = x * x
        return (Sum(state.total + x * x, both(state.small, less(x, limit)), word_xor(state.bits, word_of(k))),)

    return repeat(values.size, turn, state)[0]


@function
def mean(values: Buffer, count: Any, lost: float) -> float:
    """The mean of some squares, or what stands for it."""
    state = squared(values, Sum(0.0, True, bits_of(lost)), 2.0)
    return where(state.small, state.total / number_of(count), lost)


def functions(cells: Buffer, table: Buffer, count: Any, seed: Any, lane: Any) -> None:
    """Functions within functions, of parts of memory, that give numbers, truths and words."""
    first = squared(cells.part(0, count), Sum(0.0, True, word_add(seed, lane)), table[0])
    second = squared(cells.part(count, 3), first, table[1])
    cells.put(4, (first.total, second.total, where(second.small, 1.0, 0.0)))
    cells[20] = number_in(shift_right(second.bits, 40))
    cells[21] = mean(cells.part(count + 1, 2), count, 0.25)

    def turn(k, total):
        at(k, count - 1, lambda: cells.put(22, (mean(cells.part(k, 2), k + 1, -0.0),)))
        (total,) = unless(less(total, 0.5), lambda total: (total + mean(cells.part(2 * k, 2), 2, total),), total)
        return (total,)

    (cells[23],) = repeat(count, turn, 1.0)


def shapes(cells: Buffer, table: Buffer, lane: Any) -> None:
    """Expressions whose value depends on where parentheses stand."""
    a, b, c, d = (cells[i] for i in range(4))
    p, q, r = less(a, b), less_equal(c, d), less(d, 0.0)
    cells.put(1, (a - (b - c), a - (b + c), (a - b) - c, a + (b + c)))
    cells.put(2, (divide(a, b * c), divide(a, divide(b, c)), a * (b * c), divide(a * b, c)))
    cells.put(3, (negative(-a), -(a - b), -a - -b, -(-0.0 * a)))
    # What is read stays what it was, and what a lane does not reach it does not write.
    before = cells[14]
    cells[14] = a
    when(p, lambda: cells.put(15, (before,)))
    cells[16] = where(both(either(p, q), opposite(r)), a, where(either(both(p, q), r), b, c))
    cells[17] = where(either(p, either(q, r)), where(opposite(p), a, b), c)
    cells[18] = select(opposite(both(opposite(p), opposite(both(q, r)))), -1.0, 5e-324) * (a + b)
    cells[19] = (where(p, a, b) + where(q, c, d)) * -2.5
    cells[20] = where(less(table[0] - a, math.inf), table[1] * 1e308, math.nan)
    cells[21] = where(p, math.inf, -math.inf) * where(q, 0.0, 1.0)


@function
def kept(a: float, b: float, c: float, p: bool, q: bool, w: Any) -> tuple[float, float, bool, bool]:
    """Truths that are handed on to loops as they are."""

    def turn(x, p, q):
        return x + a, less(x, b), either(p, q)

    x, p, q = until(lambda x, p, q: opposite(p), turn, c, p, q, at_most=4)
    (y,) = when(q, lambda y: (y + number_in(shift_right(w, 60)),), a)
    return x, y, p, q


def truths(cells: Buffer, seed: Any, lane: Any) -> None:
    """Truths as arguments of functions, more than fit in registers."""
    a, b, c = cells[0], cells[1], cells[2]
    x, y, p, q = kept(a, b, c, less(a, b), less(b, c), word_add(seed, lane))
    x, y, p, q = kept(x, y, b, q, p, seed)
    cells.put(0, (x, y, where(p, 1.0, 0.0), where(q, 1.0, 0.0)))


SUBJECTS = {
    "threefry": (Subject(threefry, (CELLS,), SEED), {"seed": 0xFEDCBA9876543210}),
    "cholesky": (Subject(cholesky, (CELLS,), COUNT), {"count": 3}),
    "no rows": (Subject(cholesky, (CELLS,), COUNT), {"count": 0}),
    "roots": (Subject(roots, (CELLS, TABLE), {}), {}),
    "functions": (Subject(functions, (CELLS, TABLE), COUNT | SEED), {"count": 3, "seed": (1 << 64) - 5}),
    "truths": (Subject(truths, (CELLS,), SEED), {"seed": 0xFEDCBA9876543210}),
    "shapes": (Subject(shapes, (CELLS, TABLE), {}), {}),
}


def filled(subject: Subject, special: bool) -> dict[str, Any]:
    """Numbers for 16 lanes."""
    random = np.random.default_rng(5)
    shapes = {memory.name: (memory.size, 16) if memory.lanes else (memory.size,) for memory in subject.memories}
    arrays = {name: random.normal(size=shape) for name, shape in shapes.items()}
    if special:
        arrays = {
            name: np.where(random.random(a.shape) < 0.5, random.choice(SPECIAL, a.shape), a) for name, a in arrays.items()
        }
    return arrays


@pytest.mark.parametrize("machine", MACHINES)
def test_every_machine_leaves_the_bits_of_plain_python(machine: str) -> None:
    need(machine)
    agree(machine, *((subject, filled(subject, s), given) for subject, given in SUBJECTS.values() for s in (False, True)))


C_TEXT = """\
/* A law.
   Second line. */
void law(double *cells, const double *table, long count)
{
    double total_ = 0.0;
    for (long k = 0; k < count; k++) {
        const double total = total_;
        const double t3 = cells[2 * k + 1];
        cells[2 * k] = t3 * t3 - table[k];
        total_ = total + (t3 - table[k + 1]);
    }
    double x_ = total_;
    if (total_ < 0.0) {
        x_ = sqrt(-total_);
    }
    cells[0] = x_ < 1.0 ? -1.0 : x_;
}
"""
JAVASCRIPT_TEXT = """\
/* A law.
   Second line. */
function law(cells, table, count) {
    let total_ = 0.0;
    for (let k = 0; k < count; k++) {
        const total = total_;
        const t3 = cells[2 * k + 1];
        cells[2 * k] = t3 * t3 - table[k];
        total_ = total + (t3 - table[k + 1]);
    }
    let x_ = total_;
    if (total_ < 0.0) {
        x_ = Math.sqrt(-total_);
    }
    cells[0] = x_ < 1.0 ? -1.0 : x_;
}
"""


def test_the_text_reads_like_written_code() -> None:
    recorder = Recorder()
    cells = Buffer(recorder.memory("cells", lanes=True, writable=True), 0, 8)
    table, count = recorder.memory("table"), recorder.input("count", "index")

    def turn(k, total):
        x = cells[2 * k + 1]
        cells[2 * k] = x * x - table[k]
        return (total + (x - table[k + 1]),)

    with recorder.recording():
        (total,) = repeat(count, turn, 0.0)
        (x,) = when(less(total, 0.0), lambda x: (sqrt(-x),), total)
        cells[0] = where(less(x, 1.0), -1.0, x)
    program = recorder.program("law", "A law.\nSecond line.")
    assert str(C99(program)).endswith(f"\n\n{C_TEXT}")
    assert str(JavaScript(program)) == f'"use strict";\n\n{JAVASCRIPT_TEXT}'
    assert all(len(line) <= 110 for line in [*str(C99(program)).splitlines(), *str(JavaScript(program)).splitlines()])


def awkward() -> Subject:
    """Names that mean something to C or JavaScript, and what is given and not read."""

    @function
    def remainder(cells: Buffer, out0: float, log: float) -> tuple[float, float]:
        cells[0] = out0 * log
        return out0 - log, out0 + log

    @function
    def exp(cells: Buffer, isnan: float) -> float:
        a, b = remainder(cells, isnan, 2.0)
        return a * b

    @function
    def arguments(x: float, t: float) -> float:
        return x * t

    @function
    def nothing(cells: Buffer) -> None:
        cells[5] = 1.5

    def equation(cells, untouched, read, unread, count, seed, lane):
        def main(arguments_, exp, round, await_):
            return exp + read[0], round * 2.0, -await_

        exp_, floor, yield_ = repeat(3, main, cells[0], cells[1], cells[2])
        a, _ = remainder(cells, exp_, yield_)
        _, b = remainder(cells, a, floor)
        cells[3] = exp(cells, a) + arguments(b, floor)
        exp(cells.part(6, 2), b)
        nothing(cells)

    memories = (
        CELLS,
        Memory("untouched", True, True, 3),
        Memory("out1", False, False, 2),
        Memory("delete", False, False, 2),
    )
    return Subject(equation, memories, {"undefined": INDEX, "lane": WORD})


@pytest.mark.parametrize("machine", MACHINES)
def test_any_name_and_anything_unused_compiles_without_a_warning(machine: str) -> None:
    need(machine)
    subject = awkward()
    memories = filled(subject, False)
    program = subject.program()
    names = [memory.name for memory in program.memories]
    assert names == ["cells", "untouched", "out1", "delete1"]
    given = {name: 3 for name, _ in program.main.params}
    renamed = Subject(subject.equation, program.memories, dict(program.main.params))
    agree(machine, (renamed, dict(zip(names, memories.values(), strict=True)), given))


def test_c_shows_the_linker_one_function(tmp_path: Path) -> None:
    need("gcc")
    subject, _ = SUBJECTS["functions"]
    text = C99(subject.program("flight_step"))
    (tmp_path / "law.c").write_text(str(text))
    flags = [*STRICT, "-Wshadow", "-O1", "-c"]
    subprocess.run(["gcc", *flags, "law.c"], cwd=tmp_path, check=True)

    def symbols(flag: str) -> set[str]:
        done = subprocess.run(["nm", flag, "law.o"], cwd=tmp_path, check=True, capture_output=True, text=True)
        return {line.split()[-1] for line in done.stdout.splitlines()}

    assert symbols("-g") - symbols("-u") == {"flight_step"}
    assert symbols("-u") <= {"sqrt"}


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_arithmetic_that_is_not_ieee_is_refused(compiler: str, tmp_path: Path) -> None:
    need(compiler)
    subject, _ = SUBJECTS["roots"]
    (tmp_path / "law.c").write_text(str(C99(subject.program())))
    for flags in (["-ffast-math"], ["-Ofast"]):
        done = subprocess.run([compiler, *flags, "-c", "law.c"], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode != 0
        assert "needs IEEE arithmetic" in done.stderr


def test_nothing_is_fused_where_the_compiler_would_by_default() -> None:
    """x * x - y is another number where it is rounded once."""

    def equation(cells, lane):
        cells[1] = cells[0] * cells[0] - 1.0000000000000004

    need("clang")
    subject = Subject(equation, (CELLS,), {})
    memories = {"cells": np.full(24, 1.0 + 2.0**-52)}
    program = subject.program()
    expected = subject.plain(memories, {})
    assert expected["cells"][1] == 0.0
    for found in (on_lanes(Job(program, memories, {})), *on_node_if_there(program, memories)):
        same(expected, found, "any")
    for level in (("-O3", "-march=native"), ("-O3", "-march=native", "-ffp-contract=on")):
        same(expected, on_c([Job(program, memories, {})], "clang", *level)[0], str(level))


def on_node_if_there(program: Any, memories: Any) -> list[Any]:
    """What JavaScript leaves, where node is installed."""
    return on_node([Job(program, memories, {})]) if shutil.which("node") else []


def test_what_all_lanes_would_write_to_is_refused() -> None:
    def equation(record, lane):
        record[0] = 1.0

    program = Subject(equation, (Memory("record", False, True, 3),), {}).program()
    assert on_lanes(Job(program, {"record": np.zeros(3)}, {}))["record"].tolist() == [1.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="record: all lanes write to the same memory"):
        Llvm(program, 8)
