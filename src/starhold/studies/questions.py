"""Turns the checks of a scenario's numbers into programs of the keys that a page moves: the checks of the craft and the
start, and each law's own `check` and `remember`, with the texts of their refusals."""

from collections.abc import Callable, Container, Iterator, Mapping
from functools import reduce
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.scalar import both, opposite, where
from starhold.algebra.structure import leaves
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.craft import matrix
from starhold.scenario.reading import LawEntry, Scenario
from starhold.trace.calling import record_call
from starhold.trace.handles import Handle, RecordingError
from starhold.trace.program import Program
from starhold.trace.recording import MARK, Path

MOST = 100
"""The most paths through a check."""

Words = list[str | tuple[int, str]]
"""The text of a refusal: pieces of text, and numbers as their place among those of the program and their format."""


def record_check(check: Callable[..., Any], like: tuple[Any, ...]) -> tuple[Program, list[tuple[int, Words]]] | None:
    """Return a program of the floats of the arguments, as from `record_call`, and for each refusal the index of the number
    that is 1 where it applies, with its text; None where the check never refuses these arguments. RecordingError where the
    check cannot be recorded."""
    refusals: list[tuple[int, Words]] = []

    def ways(*values: Any) -> tuple[Any, ...]:
        refusals.clear()
        recorder = next(leaf.recorder for leaf in leaves(values) if isinstance(leaf, Handle))
        numbers: list[Any] = []
        left, count = [list[bool]()], 0
        while left:
            turns, count = left.pop(), count + 1
            if count > MOST:
                raise RecordingError("", "", f"more than {MOST} paths through a check", "fewer comparisons")
            recorder.path = path = Path(turns)
            try:
                check(*values)
                refusal = None
            except RecordingError:
                raise
            except (InputError, ValueError) as error:
                refusal = str(error)
            except (TypeError, AttributeError) as error:
                raise RecordingError("", "", str(error), "the scalar operations") from None
            finally:
                recorder.path = None
            left += [[*path.taken[:place], True] for place in range(len(turns), len(path.taken))]
            if refusal is None:
                continue
            met = zip(path.truths, path.taken, strict=True)
            holds = reduce(both, (truth if taken else opposite(truth) for truth, taken in met), True)
            first = len(numbers) + 1
            refusals.append((len(numbers), _words(refusal, first)))
            numbers += [where(holds, 1.0, 0.0), *path.numbers]
        return tuple(numbers)

    program, _ = record_call(ways, like)
    return (program, refusals) if refusals else None


def _words(text: str, first: int) -> Words:
    """Return the pieces of a text whose numbers begin at `first`."""
    pieces: Words = []
    for turn, piece in enumerate(text.split(MARK)):
        if turn % 2:
            place, _, spec = piece.partition(":")
            pieces.append((first + int(place), spec))
        elif piece:
            pieces.append(piece)
    return pieces


UNASKED = "the law's check of it cannot be recorded"
NEAR, RANGE = 3.0, 10.0
"""The largest factors by which inertias, and other numbers, are moved."""


class Question(NamedTuple):
    """A program of the values of these keys, in order; for each refusal the index of the number that is 1 where it applies,
    with its text; and the law whose check it is, "" for the scenario."""

    law: str
    keys: tuple[str, ...]
    program: Program
    refusals: list[tuple[int, Words]]


class Asked(NamedTuple):
    """All checks; keys that cannot be moved, each with the reason; and keys that can be moved only up to a factor, within
    which a law with an unrecorded check was tested."""

    questions: tuple[Question, ...]
    fixed: dict[str, str]
    ranged: dict[str, float]


def ask(scenario: Scenario, loops: Mapping[str, ClosedLoop], dials: Mapping[str, Any], flown: Container[str]) -> Asked:
    """Return the checks of these keys by a scenario whose laws have these loops, and of which those named fly."""
    shared = {key: value for key, value in dials.items() if not key.startswith("law.")}
    questions, unasked = _recorded("", lambda values: scenario.hooks.admitted(scenario, values), shared)
    fixed, ranged = dict.fromkeys(unasked, UNASKED), dict[str, float]()
    # First the checks of all laws as a file is read, then those as loops are built.
    built = [entry for entry in scenario.laws if entry.name in flown]
    for entry, reads in [*((entry, True) for entry in scenario.laws), *((entry, False) for entry in built)]:
        check, prefix = _check(scenario, entry, loops[entry.name], reads), f"law.{entry.name}."
        gains = {key: value for key, value in dials.items() if key.startswith(prefix) and "." not in key[len(prefix) :]}
        more, unasked = _recorded(entry.name, check, shared | gains)
        questions += more
        fixed |= {key: UNASKED for key in unasked if key in gains}
        for key in unasked:
            if key in shared:
                ranged[key] = NEAR if isinstance(shared[key], tuple) else RANGE
                if not all(_takes(scenario, check, {key: value}) for value in _corners(shared[key], ranged[key])):
                    fixed[key] = UNASKED
    return Asked(tuple(questions), fixed, ranged)


def _check(scenario: Scenario, entry: LawEntry, loop: ClosedLoop, reads: bool) -> Callable[[Mapping[str, Any]], None]:
    """Return the checks by a law of its gains and its nominal craft, under values of keys, as its file is read or its memory
    made."""

    def check(values: Mapping[str, Any]) -> None:
        gains_given = {key.rpartition(".")[2]: value for key, value in values.items() if key.startswith("law.")}
        shared = {key: value for key, value in values.items() if not key.startswith("law.")}
        gains, craft = entry.gains._replace(**gains_given), scenario.hooks.moved(scenario, loop, shared).nominal
        try:
            if not reads:
                entry.law.remember(gains, craft, loop.period)
            elif not scenario.allow_unstable:
                entry.law.check(gains, craft)
        except (InputError, ZeroDivisionError):
            raise
        except ValueError as error:
            raise InputError("", f"law {entry.name}", "", str(error)) from None

    return check


def _recorded(
    law: str, check: Callable[[Mapping[str, Any]], Any], values: Mapping[str, Any]
) -> tuple[list[Question], list[str]]:
    """Return a check as a program, if it checks anything, and the keys that it uses in ways that cannot be recorded."""

    def of(keys: tuple[str, ...]) -> list[Question]:
        made = record_check(lambda given: check(dict(zip(keys, given, strict=True))), (tuple(values[key] for key in keys),))
        return [] if made is None else [Question(law, keys, *made)]

    def recordable(key: str) -> bool:
        try:
            of((key,))
        except RecordingError:
            return False
        return True

    try:
        return (of(tuple(values)) if values else []), []
    except RecordingError:
        kept = tuple(key for key in values if recordable(key))
    try:
        return (of(kept) if kept else []), [key for key in values if key not in kept]
    except RecordingError:
        return [], list(values)


def _takes(scenario: Scenario, check: Callable[[Mapping[str, Any]], Any], values: Mapping[str, Any]) -> bool:
    """Return whether a law accepts these values, as it does where no body has them."""
    try:
        scenario.hooks.admitted(scenario, values)
    except InputError:
        return True
    try:
        check(values)
    except (InputError, ZeroDivisionError):
        return False
    return True


def _corners(value: Any, factor: float) -> Iterator[Any]:
    """Return a number multiplied and divided by the factor; an inertia with each axis scaled so."""
    if not isinstance(value, tuple):
        yield from (value / factor, value * factor)
        return
    for factors in product((1.0 / factor, factor), repeat=len(value)):
        if isinstance(value[0], tuple):
            yield matrix(np.sqrt(np.outer(factors, factors)) * np.array(value))
        else:
            yield tuple(x * f for x, f in zip(value, factors, strict=True))
