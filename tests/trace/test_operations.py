"""Every operation means something to every reader that it concerns, and the same."""

import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import pytest
import sympy
from flint import fmpq

from starhold.algebra import scalar, words
from starhold.algebra.operations import EXACT, INDEX, NUMBER, OPERATIONS, PRINTED, STATIC, TRUTH, UNIFORM, WORD
from starhold.algebra.polynomial import Polynomial, exact, pieces
from starhold.algebra.structured import Buffer, at, repeat
from starhold.trace.bounds import KINDS, Work
from starhold.trace.program import Memory
from tests.algebra.balls import Ball
from tests.algebra.readers import middle, radius
from tests.trace.machines import MACHINES, Subject, agree, need
from tests.trace.scripts import SPECIAL

NUMBERS = (*SPECIAL, 0.1, -2.5)
WORDS = (0, 1, 0xFFFFFFFF, 1 << 31, 1 << 32, 1 << 63, 0x9E3779B97F4A7C15, 0x7FF0000000000000, (1 << 64) - 1)
INDICES = (0, 3, -2, 1 << 20)
COUNTS = (1, 13, 31, 32, 33, 63)
INPUTS = {f"w{k}": WORD for k in range(len(WORDS))} | {f"i{k}": INDEX for k in range(len(INDICES))}
FINITE = (0.0, 1.0, -1.5, 2.25, 0.001)

REFUSED = ("sqrt", "divide", "less_equal", "both", "either", "opposite")
"""What polynomials refuse."""

about_numbers = sorted(name for name, entry in OPERATIONS.items() if not entry.missing() and EXACT[0] in entry.meanings)


def named(name: str) -> Callable[..., Any]:
    """The operation as equations call it."""
    return getattr(scalar, name, None) or getattr(words, name)


class Exercise(NamedTuple):
    """An equation that applies an operation to all values at hand, and what its memories hold."""

    subject: Subject
    memories: dict[str, Any]


def put(out: Buffer, place: Any, kind: str, made: Any) -> None:
    """Write what an operation gives."""
    if kind == WORD:
        high, low = words.shift_right(made, 32), words.word_and(made, 0xFFFFFFFF)
        out.put(place, (words.number_in(high), words.number_in(low)))
    elif kind == TRUTH:
        out[place] = scalar.where(made, 1.0, 0.0)
    else:
        out[place] = words.number_of(made) if kind == INDEX else made


def of_numbers(name: str) -> Exercise:
    """Of an operation on numbers and truths: a loop over them."""
    entry, operation = OPERATIONS[name], named(name)
    known = [x for x in NUMBERS if name != "bits_of" or not math.isnan(x)]
    cases = list(itertools.product(*(known if kind == NUMBER else (0.0, 1.0) for kind in entry.takes)))
    width, each = (2 if entry.gives == WORD else 1), len(entry.takes)

    def equation(given: Buffer, out: Buffer, *_: Any) -> None:
        def turn(k: Any) -> None:
            values = [
                given[each * k + i] if kind == NUMBER else scalar.less(0.5, given[each * k + i])
                for i, kind in enumerate(entry.takes)
            ]
            put(out, k, entry.gives, operation(*values))

        repeat(len(cases), turn)

    memories = Memory("given", False, False, each * len(cases)), Memory("out", True, True, width * len(cases))
    filled = {"given": np.array(cases).ravel(), "out": np.zeros((width * len(cases), 16))}
    return Exercise(Subject(equation, memories, INPUTS), filled)


def of_integers(name: str) -> Exercise:
    """Of an operation on words or indices: one case after the other."""
    entry, operation = OPERATIONS[name], named(name)
    sizes = {WORD: len(WORDS), INDEX: len(INDICES), STATIC: len(COUNTS)}
    cases = list(itertools.product(*(range(sizes[kind]) for kind in entry.takes)))
    width = 2 if entry.gives == WORD else 1

    def equation(out: Buffer, *rest: Any) -> None:
        inputs, lane = rest[:-1], rest[-1]
        pools = {WORD: inputs[: len(WORDS)], INDEX: inputs[len(WORDS) :], STATIC: COUNTS}
        for place, case in enumerate(cases):
            chosen = [pools[kind][k] for kind, k in zip(entry.takes, case, strict=True)]
            if entry.gives == UNIFORM:
                out[place] = 0.0
                at(*chosen, lambda place=place: out.put(place, (1.0,)))
            else:
                put(out, place, entry.gives, lane if name == "lane" else operation(*chosen))

    memories = (Memory("out", True, True, width * len(cases)),)
    return Exercise(Subject(equation, memories, INPUTS), {"out": np.zeros((width * len(cases), 16))})


@pytest.mark.parametrize("name", sorted(OPERATIONS))
def test_no_meaning_is_missing(name: str) -> None:
    entry = OPERATIONS[name]
    assert not entry.missing()
    assert set(entry.meanings) <= {*PRINTED, *EXACT}
    assert entry.plain.__doc__
    assert [kind for kind, names in KINDS.items() if name in names]


def test_every_kind_of_work_is_a_field() -> None:
    assert {*KINDS, "loads", "stores"} == set(Work._fields)


@pytest.mark.parametrize("machine", MACHINES)
def test_every_machine_gives_what_plain_python_gives(machine: str) -> None:
    need(machine)
    inputs = dict(zip(INPUTS, (*WORDS, *INDICES), strict=True))
    exercises = [
        of_integers(name) if {*entry.takes} <= {WORD, INDEX, STATIC} else of_numbers(name)
        for name, entry in sorted(OPERATIONS.items())
    ]
    agree(machine, *((exercise.subject, exercise.memories, inputs) for exercise in exercises))


def finite_cases(name: str) -> list[tuple[Any, ...]]:
    """Arguments of an operation on numbers for which it gives a finite number; two numbers stand for a truth about them."""
    pairs = ((0.0, 1.0), (1.0, 0.0))
    cases = itertools.product(*(FINITE if kind == NUMBER else pairs for kind in OPERATIONS[name].takes))
    if name == "divide":
        return [case for case in cases if case[1] != 0.0]
    return [case for case in cases if name != "sqrt" or case[0] >= 0.0]


def applied(name: str, case: tuple[Any, ...], number: Callable[[float], Any]) -> Any:
    """An operation of numbers of a reader."""
    kinds = OPERATIONS[name].takes
    values = [
        number(x) if kind == NUMBER else scalar.less(number(x[0]), number(x[1])) for x, kind in zip(case, kinds, strict=True)
    ]
    return named(name)(*values)


@pytest.mark.parametrize("name", about_numbers)
def test_sympy_gives_what_plain_python_gives(name: str) -> None:
    for case in finite_cases(name):
        plain, exact = applied(name, case, float), applied(name, case, lambda x: sympy.Rational(x))
        assert isinstance(exact, sympy.Basic)
        if isinstance(plain, bool):
            assert bool(exact) is plain
        else:
            assert float(exact) == pytest.approx(plain, rel=1e-15, abs=0.0)


@pytest.mark.parametrize("name", about_numbers)
def test_balls_hold_what_plain_python_gives(name: str) -> None:
    for case in finite_cases(name):
        plain, ball = applied(name, case, float), applied(name, case, Ball)
        if isinstance(plain, bool):
            assert ball is plain
        else:
            assert isinstance(ball, Ball)
            assert abs(middle(ball) - plain) <= radius(ball) + math.ulp(plain)


@pytest.mark.parametrize("name", about_numbers)
def test_polynomials_give_what_plain_python_gives_or_refuse(name: str) -> None:
    cases = finite_cases(name)
    if name in REFUSED:
        variables = (Polynomial.variable(f"x{k}") for k in itertools.count())
        with pytest.raises(TypeError, match="polynomial"):
            applied(name, cases[-1], lambda _: next(variables))
        return
    for case in cases:
        point: dict[str, fmpq] = {}

        def number(x: float, point: dict[str, fmpq] = point) -> Polynomial:
            variable = f"x{len(point)}"
            point[variable] = exact(x)
            return Polynomial.variable(variable)

        plain, made = applied(name, case, float), applied(name, case, number)
        if isinstance(plain, bool):
            assert bool(made.positive.at(point) > 0) is plain
        else:
            (value,) = (
                piece.value.at(point)
                for piece in pieces(made)
                if all(bool(condition.positive.at(point) > 0) is holds for condition, holds in piece.truths)
            )
            assert float(Fraction(int(value.p), int(value.q))) == pytest.approx(plain, rel=1e-15, abs=0.0)


def test_an_operation_on_words_means_nothing_to_a_reader_that_proves() -> None:
    with pytest.raises(TypeError, match="word_add means nothing to the reader polynomial"):
        words.word_add(fmpq(1), 1)
