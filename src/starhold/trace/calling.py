"""Compiles one equation, to be called with numbers or over columns of numbers."""

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.operations import TRUTH
from starhold.algebra.scalar import where
from starhold.algebra.structure import leaves, mapped
from starhold.algebra.structured import Buffer, repeat
from starhold.trace.handles import Handle, kind_of
from starhold.trace.machine import aligned, load
from starhold.trace.program import Program
from starhold.trace.recording import Cells, Recorder

WIDTH = 8
"""Lanes in flight at once over columns."""


class Compiled:
    """An equation compiled for arguments shaped like `like`: its floats, including those in buffers, are arguments, and all
    else is constant."""

    def __init__(self, equation: Callable[..., Any], *like: Any) -> None:
        self.program, self._like = record_call(equation, like)
        self._count = len(list(_floats(like)))
        self._leaves = list(leaves(self._like))

    @cached_property
    def _one(self) -> Callable[..., None]:
        return load(self.program, 1)

    @cached_property
    def _many(self) -> Callable[..., None]:
        return load(self.program, WIDTH)

    def __call__(self, *values: Any) -> Any:
        """Return the result of the equation for these values, in the shape of the equation's result."""
        x = np.array(list(_floats(values)))
        y = np.empty(len(self._leaves))
        self._one(x.ctypes.data, y.ctypes.data, 1)
        source = iter(y.tolist())
        return mapped(self._like, lambda leaf: _plain(leaf, next(source)))

    def over(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the results (numbers, lanes) for arguments whose floats are the columns of an array (floats, lanes);
        truths are 1 and 0."""
        count = columns.shape[1]
        blocks = -(-count // WIDTH)
        x, y = aligned(blocks, self._count, WIDTH), aligned(blocks, len(self._leaves), WIDTH)
        padded = np.pad(columns, ((0, 0), (0, blocks * WIDTH - count)), mode="edge")
        x[:] = padded.reshape(self._count, blocks, WIDTH).swapaxes(0, 1)
        self._many(x.ctypes.data, y.ctypes.data, blocks)
        return y.swapaxes(0, 1).reshape(len(self._leaves), -1)[:, :count]


def _plain(leaf: Any, number: float) -> Any:
    if not isinstance(leaf, Handle):
        return leaf
    return number == 1.0 if leaf.kind == TRUTH else number


def record_call(equation: Callable[..., Any], like: tuple[Any, ...]) -> tuple[Program, Any]:
    """Return a program that reads the floats of the arguments from the memory `x` and writes the equation's results to `y`,
    for `count` sets of arguments; and the equation's result, with handles for numbers."""
    recorder = Recorder()
    x = recorder.memory("x", lanes=True)
    y = recorder.memory("y", lanes=True, writable=True)
    count = recorder.input("count", "index")
    size = len(list(_floats(like)))
    given: list[Any] = []

    def turn(k: Any) -> None:
        values = bind(like, x, k * size)
        given.append(equation(*values))
        for place, leaf in enumerate(leaves(given[0])):
            truth = kind_of(leaf) == TRUTH
            y[k * len(list(leaves(given[0]))) + place] = where(leaf, 1.0, 0.0) if truth else leaf

    with recorder.recording():
        repeat(count, turn)
    return recorder.program("call"), given[0]


def bind(like: Any, cells: Cells, base: Any = 0) -> Any:
    """Return the structure with its floats and buffers in memory from `base` on, in order."""
    place = 0

    def leaf(value: Any) -> Any:
        nonlocal place
        here, place = place, place + (value.size if isinstance(value, Buffer) else int(isinstance(value, float)))
        if isinstance(value, Buffer):
            return Buffer(cells, base + here, value.size)
        return cells[base + here] if isinstance(value, float) else value

    return mapped(like, leaf)


def _floats(values: Any) -> Iterator[float]:
    for leaf in leaves(values):
        if isinstance(leaf, Buffer):
            yield from leaf.row(0, leaf.size)
        elif isinstance(leaf, float):
            yield leaf
