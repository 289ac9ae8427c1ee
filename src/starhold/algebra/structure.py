"""Arithmetic and storage of whole states: nested NamedTuples and tuples of floats, of any shape.

`move` is the step of an integrator, `load` and `store` keep a state in a column of an array `x[component, lane]`.
In plain Python they walk the structure; compiled, they are written out for its type, so nothing is left of the walk.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from typing import Any, TypeVar, cast

import numpy as np
from numba import types  # pyright: ignore
from numpy.typing import NDArray

from starhold.algebra.scalar import compiled_as
from starhold.algebra.vector import diagonal

_State = TypeVar("_State")

LANES = 128
"""Lanes of a block. It is a constant so that the compiler knows how far apart components lie and can vectorise over the
lanes; a block of two dozen components fits the processor's first cache."""


def move(state: _State, step: float, rate: Any) -> _State:
    """state + step * rate, component by component; where the rate is None the state stays."""
    if rate is None:
        return state
    if not isinstance(state, tuple):
        return cast(Any, state) + step * rate
    parts = [move(s, step, r) for s, r in zip(cast(Any, state), rate, strict=True)]
    return _rebuild(cast(Any, state), parts)


def load(x: Any, lane: int, like: _State) -> _State:
    """The state of a lane, shaped like `like`: a column of x[component, lane], or of a block (see `pack`), which is one
    array of LANES numbers for each component. An x that is a state already stands for every lane."""
    if isinstance(x, tuple):
        return cast(_State, x)
    return unflatten(_columns(x)[:, lane], like)


def store(x: Any, lane: int, state: Any) -> None:
    """Write the state of a lane where `load` reads it."""
    _columns(x)[:, lane] = flatten(state)


def _columns(x: Any) -> Any:
    return x if x.ndim == 2 else x.reshape(-1, LANES)


def pack(states: Any) -> NDArray[np.float64]:
    """Blocks (blocks, components * LANES) from states (components, lanes); the last lane fills up the last block."""
    components, lanes = states.shape
    blocks = -(-lanes // LANES)
    padded = np.pad(states, ((0, 0), (0, blocks * LANES - lanes)), mode="edge")
    return np.ascontiguousarray(padded.reshape(components, blocks, LANES).swapaxes(0, 1)).reshape(blocks, -1)


def unpack(blocks: Any, lanes: int) -> NDArray[np.float64]:
    """States (components, lanes) from blocks."""
    parts = blocks.reshape(len(blocks), -1, LANES)
    return np.ascontiguousarray(parts.swapaxes(0, 1).reshape(parts.shape[1], -1)[:, :lanes])


def flatten(state: Any) -> list[float]:
    """The numbers of a state in order. Arrays, which a law's memory may hold, are not among them: they change in place."""
    if isinstance(state, np.ndarray):
        return []
    return [x for part in cast(Any, state) for x in flatten(part)] if isinstance(state, tuple) else [state]


def unflatten(numbers: Any, like: _State) -> _State:
    """The state shaped like `like` that holds these numbers in order, and the arrays of `like`."""
    return _fill(iter(np.asarray(numbers, dtype=float).tolist()), like)


def _fill(source: Iterator[float], like: Any) -> Any:
    if isinstance(like, np.ndarray):
        return cast(Any, like)
    if not isinstance(like, tuple):
        return type(like)(next(source))
    return _rebuild(like, [_fill(source, part) for part in cast(tuple[Any, ...], like)])


def _rebuild(like: Any, parts: list[Any]) -> Any:
    return type(like)(*parts) if hasattr(like, "_fields") else tuple(parts)


def alike(values: Sequence[_State]) -> list[_State]:
    """The same values, with diagonals written as vectors turned into matrices where another value has a matrix."""
    return [reduce(_widened, values, value) for value in values]


def _widened(value: Any, other: Any) -> Any:
    if not isinstance(value, tuple) or not isinstance(other, tuple):
        return cast(Any, value)
    parts, others = cast(tuple[Any, ...], value), cast(tuple[Any, ...], other)
    if len(parts) == 3 and isinstance(others[0], tuple) and not isinstance(parts[0], tuple):
        return diagonal(cast(Any, parts))
    return _rebuild(value, [_widened(*pair) for pair in zip(parts, others, strict=True)])


class _Writer:
    """Writes the expression that builds a state of a given Numba type; `leaf` writes one number of it."""

    def __init__(self, leaf: Callable[[str, int], str]) -> None:
        self.leaf, self.classes, self.leaves = leaf, dict[str, Any](), 0

    def expression(self, kind: Any, path: str = "") -> str:
        if not isinstance(kind, types.BaseTuple):
            if isinstance(kind, types.Array):
                return f"like{path}"
            self.leaves += 1
            return self.leaf(path, self.leaves - 1)
        parts = [self.expression(part, f"{path}[{i}]") for i, part in enumerate(cast(Any, kind))]
        name = ""
        if isinstance(kind, types.BaseNamedTuple):
            cls: Any = cast(Any, kind).instance_class
            name = f"{cls.__name__}_{len(self.classes)}"
            self.classes[name] = cls
        closing = "," if parts and not name else ""
        return f"{name}({', '.join(parts)}{closing})"

    def function(self, head: str, body: str) -> Any:
        space: dict[str, Any] = dict(self.classes)
        exec(f"def written({head}):\n    {body}", space)
        return space["written"]


@compiled_as(move)
def _compiled_move(state: Any, step: Any, rate: Any) -> Any:
    still = tuple(path for path, kind in _leaves(rate) if isinstance(kind, types.NoneType))

    def leaf(path: str, index: int) -> str:
        return f"state{path}" if path.startswith(still) else f"state{path} + step * rate{path}"

    writer = _Writer(leaf)
    return writer.function("state, step, rate", f"return {writer.expression(state)}")


@compiled_as(load)
def _compiled_load(x: Any, lane: Any, like: Any) -> Any:
    if isinstance(x, types.BaseTuple):
        return lambda x, lane, like: x  # pyright: ignore
    writer = _Writer(lambda path, index: _place(x, index))
    return writer.function("x, lane, like", f"return {writer.expression(like)}")


@compiled_as(store)
def _compiled_store(x: Any, lane: Any, state: Any) -> Any:
    numbers = [path for path, kind in _leaves(state) if not isinstance(kind, types.Array)]
    lines = [f"{_place(x, i)} = state{path}" for i, path in enumerate(numbers)]
    return _Writer(lambda path, index: path).function("x, lane, state", "\n    ".join([*lines, "return"]))


def _place(x: Any, index: int) -> str:
    return f"x[{index * LANES} + lane]" if x.ndim == 1 else f"x[{index}, lane]"


def _leaves(kind: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if not isinstance(kind, types.BaseTuple):
        yield path, kind
        return
    for i, part in enumerate(cast(Any, kind)):
        yield from _leaves(part, f"{path}[{i}]")
