"""Random programs: nested statements that hypothesis draws, and what they mean as an equation.

A `Script` is made of blocks of statements; each statement is a kind, a code from which its operands are chosen among the
values at hand, and a block for what has one. Any draw is a program: addresses stay within their memories, and bits are
never taken of a NaN, which has different ones on different machines.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st

from starhold.algebra.operations import INDEX, WORD
from starhold.algebra.scalar import (
    absolute,
    both,
    clip,
    divide,
    either,
    is_finite,
    less,
    less_equal,
    maximum,
    minimum,
    minus,
    negative,
    opposite,
    plus,
    product,
    side,
    sign,
    sqrt,
    where,
)
from starhold.algebra.structured import Buffer, at, function, repeat, unless, until, when
from starhold.algebra.words import (
    bits_of,
    lowest_bit,
    number_in,
    number_of,
    rotate_left,
    shift_right,
    with_bits,
    word_add,
    word_and,
    word_of,
    word_or,
    word_xor,
)
from starhold.trace.program import Memory
from tests.trace.machines import Subject

SPECIAL = (0.0, -0.0, 1.0, -1.0, 5e-324, -5e-324, 2.2250738585072014e-308, 1e308, -1e308, math.inf, -math.inf, math.nan)
CONSTANTS = (*SPECIAL, 0.1, -2.5, 3.0, 1e-3)
CELLS, TABLE, OUT = 12, 12, 12

UNARY = (negative, sqrt, absolute, sign, side)
BINARY = (plus, minus, product, divide, minimum, maximum, clip)
WORDS = (word_add, word_xor, word_and, word_or)

SIMPLE = (*["binary"] * 3, *["load", "store"] * 2, "unary", "where", "truth", "word", "turned", "bits", "number", "table",
          "constant", "call")  # fmt: skip
NESTED = ("repeat", "until", "when", "at", "stop")


class Script(NamedTuple):
    """The block that is run, and those of two functions, the second of which may call the first."""

    main: tuple[Any, ...]
    functions: tuple[tuple[Any, ...], ...]


_codes = st.integers(0, 2**20 - 1)
_simple = st.tuples(st.sampled_from(SIMPLE), _codes, st.just(()))


def _blocks(depth: int, most: int) -> st.SearchStrategy[tuple[Any, ...]]:
    statement = _simple
    if depth:
        statement = _simple | _simple | st.tuples(st.sampled_from(NESTED), _codes, _blocks(depth - 1, 4))
    return st.lists(statement, min_size=1, max_size=most).map(tuple)


scripts = st.builds(Script, _blocks(3, 10), st.tuples(_blocks(1, 5), _blocks(1, 5)))


class _Scope:
    """The values at hand."""

    def __init__(self, cells: Buffer, table: Buffer, functions: list[Any]) -> None:
        self.cells, self.table, self.functions = cells, table, functions
        self.numbers: list[Any] = [1.5, -0.0]
        self.truths: list[Any] = [True, False]
        self.words: list[Any] = []
        self.indices: list[Any] = [2]

    def inner(self) -> _Scope:
        scope = _Scope(self.cells, self.table, self.functions)
        scope.numbers, scope.truths = [*self.numbers], [*self.truths]
        scope.words, scope.indices = [*self.words], [*self.indices]
        return scope


class _Code:
    """Choices, one after the other."""

    def __init__(self, code: int) -> None:
        self.code = code

    def below(self, count: int) -> int:
        self.code, choice = divmod(self.code, count)
        return choice

    def of(self, values: Any) -> Any:
        # The latest first: they are what the statements before have made.
        return values[len(values) - 1 - self.below(min(len(values), 6))]


def _place(scope: _Scope, code: _Code) -> Any:
    """An index from 0 to 11; all that are at hand lie from 0 to 3."""
    a, b, rest = code.of(scope.indices), code.of(scope.indices), code.below(3)
    return ((a + rest), (3 - a + rest), (2 * a + rest), (a * b + rest), rest)[code.below(5)]


def _numbers_of(word: Any) -> tuple[Any, Any]:
    return number_in(shift_right(word, 32)), number_in(word_and(word, 0xFFFFFFFF))


def run(block: tuple[Any, ...], scope: _Scope) -> None:
    """Do what the statements say."""
    for kind, number, inside in block:
        _STATEMENTS[kind](scope, _Code(number), inside)


def _unary(scope: _Scope, code: _Code, _: Any) -> None:
    scope.numbers.append(code.of(UNARY)(code.of(scope.numbers)))


def _binary(scope: _Scope, code: _Code, _: Any) -> None:
    operation = code.of(BINARY) if code.below(3) else (plus, minus, product)[code.below(3)]
    scope.numbers.append(operation(code.of(scope.numbers), code.of(scope.numbers)))


def _where(scope: _Scope, code: _Code, _: Any) -> None:
    scope.numbers.append(where(code.of(scope.truths), code.of(scope.numbers), code.of(scope.numbers)))


def _truth(scope: _Scope, code: _Code, _: Any) -> None:
    a, b, p, q = code.of(scope.numbers), code.of(scope.numbers), code.of(scope.truths), code.of(scope.truths)
    choice = code.below(8)
    if choice < 4:
        scope.truths.append((less, less_equal)[choice % 2](a, b))
    elif choice < 6:
        scope.truths.append((both, either)[choice % 2](p, q))
    else:
        scope.truths.append(opposite(p) if choice == 6 else is_finite(a))


def _word(scope: _Scope, code: _Code, _: Any) -> None:
    a, b = code.of(scope.words), code.of(scope.words)
    b = (b, 0xFFFFFFFF, 1, 1 << 63)[code.below(4)]
    scope.words.append(code.of(WORDS)(a, b))


def _turned(scope: _Scope, code: _Code, _: Any) -> None:
    a, count = code.of(scope.words), 1 + code.below(63)
    choice = code.below(5)
    if choice == 4:
        scope.truths.append(lowest_bit(a))
    else:
        scope.words.append((rotate_left, shift_right)[choice % 2](a, count))


def _bits(scope: _Scope, code: _Code, _: Any) -> None:
    x = code.of(scope.numbers)
    # With a word that is recorded: one that is known would pass for a number in the state of a loop.
    scope.words.append(word_xor(bits_of(where(less_equal(x, x), x, 2.0)), scope.words[0]))


def _number(scope: _Scope, code: _Code, _: Any) -> None:
    choice = code.below(4)
    if choice == 3:
        scope.words.append(word_xor(word_of(_place(scope, code) - code.below(4)), scope.words[0]))
    else:
        word = code.of(scope.words)
        index = code.of(scope.indices) * (code.below(4) - 1)
        made = (lambda: with_bits(word), lambda: number_in(shift_right(word, 20)), lambda: number_of(index))
        scope.numbers.append(made[choice]())


def _load(scope: _Scope, code: _Code, _: Any) -> None:
    scope.numbers.append(scope.cells[_place(scope, code)])


def _table(scope: _Scope, code: _Code, _: Any) -> None:
    scope.numbers.append(scope.table[_place(scope, code)])


def _store(scope: _Scope, code: _Code, _: Any) -> None:
    scope.cells[_place(scope, code)] = code.of(scope.numbers)


def _constant(scope: _Scope, code: _Code, _: Any) -> None:
    scope.numbers.append(CONSTANTS[code.below(len(CONSTANTS))])


def _call(scope: _Scope, code: _Code, _: Any) -> None:
    if scope.functions:
        which = code.below(len(scope.functions))
        cells = (scope.cells, Buffer(scope.cells.cells, scope.cells.base, scope.cells.size))[code.below(2)]
        given = code.of(scope.numbers), code.of(scope.numbers), code.of(scope.truths), code.of(scope.words)
        index = (code.of(scope.indices), code.below(4))[code.below(2)]
        _take(scope, scope.functions[which](cells, scope.table, index, given, ()))


def _state(scope: _Scope, code: _Code) -> tuple[Any, ...]:
    return code.of(scope.numbers), code.of(scope.numbers), code.of(scope.truths), code.of(scope.words)


def _take(scope: _Scope, state: Any) -> None:
    x, y, t, w = state
    scope.numbers += [x, y]
    scope.truths.append(t)
    scope.words.append(w)


def _left(scope: _Scope) -> tuple[Any, ...]:
    return scope.numbers[-1], scope.numbers[-2], scope.truths[-1], scope.words[-1]


def _turn(scope: _Scope, inside: Any, counter: Any, state: Any) -> tuple[Any, ...]:
    inner = scope.inner()
    inner.indices += [] if counter is None else [counter]
    _take(inner, state)
    run(inside, inner)
    return _left(inner)


def _repeat(scope: _Scope, code: _Code, inside: Any) -> None:
    count = (3, 2, scope.indices[0], code.of(scope.indices))[code.below(4)]
    _take(scope, repeat(count, lambda k, *state: _turn(scope, inside, k, state), *_state(scope, code)))


def _stop(scope: _Scope, code: _Code, inside: Any) -> None:
    state, limit = _state(scope, code), code.of(scope.numbers)
    turn = lambda k, *state: _turn(scope, inside, k, state)  # noqa: E731
    _take(scope, repeat(4, turn, *state, stop=lambda x, y, t, w: either(less(limit, x), t)))


def _until(scope: _Scope, code: _Code, inside: Any) -> None:
    state, most, odd = _state(scope, code), (1, 2, 3, 4)[code.below(4)], code.below(2)
    done = (lambda x, y, t, w: less_equal(x, y), lambda x, y, t, w: both(lowest_bit(w), opposite(t)))[odd]
    _take(scope, until(done, lambda *state: _turn(scope, inside, None, state), *state, at_most=most))


def _when(scope: _Scope, code: _Code, inside: Any) -> None:
    branch, truth = (when, unless)[code.below(2)], code.of(scope.truths)
    _take(scope, branch(truth, lambda *state: _turn(scope, inside, None, state), *_state(scope, code)))


def _at(scope: _Scope, code: _Code, inside: Any) -> None:
    def body() -> None:
        inner = scope.inner()
        run(inside, inner)
        inner.cells[code_place] = inner.numbers[-1]

    code_place = _place(scope, code)
    at(code.of(scope.indices), (code.of(scope.indices), code.below(3))[code.below(2)], body)


_STATEMENTS = {
    "unary": _unary, "binary": _binary, "where": _where, "truth": _truth, "word": _word, "turned": _turned, "bits": _bits,
    "number": _number, "load": _load, "table": _table, "store": _store, "constant": _constant, "call": _call,
    "repeat": _repeat, "until": _until, "when": _when, "at": _at, "stop": _stop,
}  # fmt: skip


def subject(script: Script) -> Subject:
    """The equation of a script, over cells that it writes, a table, and what it leaves."""
    functions: list[Any] = []
    for block in script.functions:
        functions.append(_function(block, [*functions]))

    def equation(cells: Buffer, table: Buffer, out: Buffer, count: Any, seed: Any, lane: Any) -> None:
        scope = _Scope(cells, table, functions)
        scope.numbers += [cells[0], cells[1], table[0], cells[2]]
        scope.truths += [less(cells[3], 0.0)]
        scope.words += [seed, word_add(seed, lane)]
        scope.indices = [count, 2, count]
        run(script.main, scope)
        for place in range(4):
            out[place] = scope.numbers[-1 - place]
        for place in range(2):
            out[4 + place] = where(scope.truths[-1 - place], 1.0, 0.0)
            out[6 + 2 * place], out[7 + 2 * place] = _numbers_of(scope.words[-1 - place])
        out[10], out[11] = number_of(scope.indices[-1]), scope.numbers[-5]

    memories = (Memory("cells", True, True, CELLS), Memory("table", False, False, TABLE), Memory("out", True, True, OUT))
    return Subject(equation, memories, {"count": INDEX, "seed": WORD})


def _function(block: tuple[Any, ...], callable_: list[Any]) -> Any:
    @function
    def part(cells: Buffer, table: Buffer, place: Any, state: Any, _: Any) -> Any:
        """A part of a script."""
        scope = _Scope(cells, table, callable_)
        scope.indices.append(place)
        _take(scope, state)
        run(block, scope)
        return _left(scope)

    return part


def values(seed: int) -> dict[str, Any]:
    """Memories for 16 lanes, special values among them."""
    random = np.random.default_rng(seed)

    def some(*shape: int) -> Any:
        numbers = random.normal(size=shape) * 10.0 ** random.integers(-3, 4, shape)
        return np.where(random.random(shape) < 0.3, random.choice(SPECIAL, shape), numbers)

    return {"cells": some(CELLS, 16), "table": some(TABLE), "out": some(OUT, 16)}


def turns(script: Script) -> Subject:
    """The script in each turn of a loop, in each block of lanes, with two numbers that all lanes share handed on from turn
    to turn, and what it leaves."""

    def equation(cells: Buffer, table: Buffer, blocks: Any, count: Any, seed: Any, lane: Any) -> None:
        def block(b: Any) -> None:
            mine = cells.part(b * CELLS, CELLS)

            def turn(k: Any, x: Any, y: Any, *state: Any) -> tuple[Any, ...]:
                scope = _Scope(mine, table, [])
                scope.indices = [count, 2, k]
                _take(scope, state)
                scope.numbers += [mine[0], table[0], x, y]
                scope.truths.append(less(x, y))
                scope.words.append(word_xor(seed, word_of(k)))
                run(script.main, scope)
                return where(less_equal(x, table[1]), x * table[2] - y, sqrt(y)), x + number_of(k), *_left(scope)

            words = word_add(seed, lane), word_add(seed, word_of(b))
            x, y, a, b_, truth, word = repeat(count, turn, table[3], 1.0, mine[1], table[4], less(mine[2], 0.0), words[0])
            mine.put(0, (x, y, a, b_))
            mine.put(1, (where(truth, 1.0, 0.0), *_numbers_of(word), number_in(shift_right(words[1], 20))))

        repeat(blocks, block)

    memories = (Memory("cells", True, True, 2 * CELLS), Memory("table", False, False, TABLE))
    return Subject(equation, memories, {"blocks": INDEX, "count": INDEX, "seed": WORD})
