"""The forms of loops, branches and buffers that equations may use.

`repeat` counts, `until` tests numbers, `when` and `unless` are branches; the state of a loop is passed from iteration to
iteration, as a tuple. A `Buffer` holds numbers in memory. In plain Python these are ordinary loops and lists; while a trace
is recorded they become loops of the trace, which all lanes of a batch execute together: a lane that has finished waits.

Every loop has a bound that is known before it starts, and a buffer's index is made of counts and counters, never of
numbers: so no address depends on data, and the work is bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextvars import ContextVar
from functools import wraps
from typing import Any, TypeAlias, TypeVar, cast

from starhold.algebra.scalar import Scalar, Truth, opposite
from starhold.algebra.words import same_index

RECORDER: ContextVar[Any] = ContextVar("recorder", default=None)
"""The recorder of the equations that run now; None in plain Python."""

Index: TypeAlias = int
"""A count, a loop's counter, or a sum, difference or product of these: the same for all lanes."""
State: TypeAlias = tuple[Any, ...]

_Function = TypeVar("_Function", bound=Callable[..., Any])


class Buffer:
    """A buffer of `size` numbers in memory from `base` on. `cells` is a list of floats, or memory of a trace."""

    __slots__ = ("base", "cells", "size")

    def __init__(self, cells: Any, base: Index = 0, size: Index | None = None) -> None:
        self.cells, self.base = cells, base
        self.size = len(cells) if size is None else size

    def __getitem__(self, index: Index) -> Scalar:
        return self.cells[self._place(index)]

    def __setitem__(self, index: Index, value: Scalar) -> None:
        self.cells[self._place(index)] = value

    def _place(self, index: Index) -> Index:
        # Only plain ints are checked here; the bounds of recorded indices are checked over the whole trace.
        if type(index) is type(self.size) is int and not 0 <= index < self.size:
            raise IndexError(f"{index} of {self.size} numbers")
        return self.base + index

    def part(self, start: Index, size: Index) -> Buffer:
        """Return `size` of its numbers from `start` on as a buffer in the same memory."""
        return Buffer(self.cells, self.base + start, size)

    def row(self, k: Index, width: int) -> tuple[Scalar, ...]:
        """Return the k-th group of `width` numbers."""
        return tuple(self[width * k + i] for i in range(width))

    def put(self, k: Index, values: Iterable[Scalar]) -> None:
        """Write `values` as the k-th group of that many numbers."""
        numbers = tuple(values)
        for i, value in enumerate(numbers):
            self[len(numbers) * k + i] = value


def repeat(count: Index, body: Callable[..., Any], *state: Any, stop: Callable[..., Truth] | None = None) -> State:
    """Return the state after body(0, *state), body(1, *state), and so on, `count` times; each returns the next state, a
    tuple (None where there is no state). It ends early once stop(*state) holds; `stop` must not write to buffers."""
    recorder = RECORDER.get()
    if recorder is not None:
        return recorder.loop(count, stop, body, state, counted=True)
    for k in range(count):
        if stop is not None and stop(*state):
            break
        state = body(k, *state) or ()
    return state


def until(done: Callable[..., Truth], body: Callable[..., Any], *state: Any, at_most: Index) -> State:
    """Return the state once done(*state) holds, or after `at_most` iterations of body(*state). `done` must not write to
    buffers."""
    recorder = RECORDER.get()
    if recorder is not None:
        return recorder.loop(at_most, done, body, state, counted=False)

    def turn(_: Index, *now: Any) -> Any:
        return body(*now)

    return repeat(at_most, turn, *state, stop=done)


def unless(truth: Truth, body: Callable[..., Any], *state: Any) -> State:
    """Return body(*state) where the truth does not hold, else the state: a branch that runs only if a lane needs it. For a
    few operations `where` costs less."""
    if truth is True or truth is False:
        return state if truth else body(*state) or ()
    return until(lambda *_: truth, body, *state, at_most=1)


def when(truth: Truth, body: Callable[..., Any], *state: Any) -> State:
    """Return body(*state) where the truth holds, else the state."""
    return unless(opposite(truth), body, *state)


def at(index: Index, place: Index, body: Callable[..., Any]) -> None:
    """Run body() in the loop iteration in which `index` is `place`; it returns nothing, but may write to buffers."""
    recorder = RECORDER.get()
    if recorder is not None:
        recorder.branch(same_index(index, place), body)
    elif index == place:
        body()


def function(equation: _Function) -> _Function:
    """Record an equation once as a function of the trace, for equations too long to be repeated at each call. It reads and
    writes nothing but its arguments; Python's integers and booleans are constants in it."""

    @wraps(equation)
    def call(*values: Any) -> Any:
        recorder = RECORDER.get()
        return equation(*values) if recorder is None else recorder.call(equation, values)

    return cast(_Function, call)
