"""States, nested NamedTuples and tuples of floats of any shape, are updated as a whole and flattened into numbers in
order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from typing import Any, TypeVar, cast

from starhold.algebra.scalar import Truth, where
from starhold.algebra.structured import Buffer
from starhold.algebra.vector import diagonal

_State = TypeVar("_State")


def move(state: _State, step: float, rate: Any) -> _State:
    """Return state + step * rate, component by component; where the rate is None the state is unchanged."""
    if rate is None:
        return state
    if not isinstance(state, tuple):
        return cast(Any, state) + step * rate
    # Most leaves are numbers: a call for each would cost more than its sum.
    pairs = zip(cast(Any, state), rate, strict=True)
    parts = [s + step * r if type(s) is float and r is not None else move(s, step, r) for s, r in pairs]
    return rebuild(cast(Any, state), parts)


def runge_kutta(slope: Callable[..., Any]) -> Callable[..., Any]:
    """Return the substep of the classical fourth-order Runge-Kutta method for d(state)/dt = slope(state, *more)."""

    def advance(state: Any, h: Any, *more: Any) -> Any:
        a = slope(state, *more)
        b = slope(move(state, 0.5 * h, a), *more)
        c = slope(move(state, 0.5 * h, b), *more)
        d = slope(move(state, h, c), *more)
        return move(state, h / 6.0, move(move(move(a, 2.0, b), 2.0, c), 1.0, d))

    return advance


def leaves(value: Any) -> Iterator[Any]:
    """Yield the leaves of a nested value in order; None and () have none."""
    left: list[Iterator[Any]] = [iter((value,))]
    while left:
        for part in left[-1]:
            if isinstance(part, tuple):
                left.append(iter(cast(tuple[Any, ...], part)))
                break
            if part is not None:
                yield part
        else:
            left.pop()


def mapped(value: Any, leaf: Callable[[Any], Any]) -> Any:
    """Rebuild a structure with every leaf replaced by leaf(it)."""
    if isinstance(value, tuple):
        return rebuild(value, [mapped(part, leaf) for part in cast(tuple[Any, ...], value)])
    return None if value is None else leaf(value)


def rebuild(like: Any, parts: Sequence[Any]) -> Any:
    """Return a tuple or NamedTuple of the same type with other parts."""
    return type(like)(*parts) if hasattr(like, "_fields") else tuple(parts)


def put(value: Any, path: Sequence[str | int], new: Any) -> Any:
    """Return a structure in which the part at a path of fields and indices is replaced."""
    if not path:
        return new
    place = value._fields.index(path[0]) if isinstance(path[0], str) else path[0]
    return rebuild(value, [put(item, path[1:], new) if k == place else item for k, item in enumerate(value)])


def chosen(truth: Truth, one: _State, other: _State) -> _State:
    """Return `one` where the truth holds, else `other`, number by number; buffers are those of `other`."""

    def choose(a: Any, b: Any) -> Any:
        if isinstance(a, tuple):
            return rebuild(a, [choose(x, y) for x, y in zip(cast(tuple[Any, ...], a), b, strict=True)])
        return b if isinstance(a, Buffer) else where(truth, a, b)

    return choose(one, other)


def flatten(state: Any) -> list[float]:
    """Return the numbers of a state in order, without buffers, which a law's memory may contain and which change in
    place."""
    return [leaf for leaf in leaves(state) if not isinstance(leaf, Buffer)]


def places(state: Any) -> Any:
    """Return the state with each number replaced by its index in `flatten(state)`."""
    count = iter(range(1 << 40))
    return mapped(state, lambda leaf: leaf if isinstance(leaf, Buffer) else next(count))


def rows(state: Any) -> Any:
    """Return the state with each field replaced by the slice of its rows in a table of flattened states."""
    ends = [len(flatten(tuple(state[: k + 1]))) for k in range(len(state))]
    return rebuild(state, [slice(first, last) for first, last in zip([0, *ends], ends, strict=False)])


def floats(value: Any) -> list[float]:
    """Return the floats among the leaves of a nested value in order."""
    return [leaf for leaf in leaves(value) if isinstance(leaf, float)]


def buffers(state: Any) -> list[Buffer]:
    """Return the buffers of a state in order."""
    return [leaf for leaf in leaves(state) if isinstance(leaf, Buffer)]


def unflatten(numbers: Any, like: _State) -> _State:
    """Return the state shaped like `like` made of these numbers in order (rows of lanes stay arrays) and the buffers of
    `like`."""
    source = iter(numbers.tolist() if hasattr(numbers, "tolist") else numbers)

    def leaf(value: Any) -> Any:
        if isinstance(value, Buffer):
            return value
        number = next(source)
        return number if hasattr(number, "shape") else type(value)(number)

    return mapped(like, leaf)


def alike(values: Sequence[_State]) -> list[_State]:
    """Return the values in one shape: where some have a matrix and others its diagonal as a vector, all get a matrix."""
    return [reduce(_widened, values, value) for value in values]


def _widened(value: Any, other: Any) -> Any:
    if not isinstance(value, tuple) or not isinstance(other, tuple):
        return cast(Any, value)
    parts, others = cast(tuple[Any, ...], value), cast(tuple[Any, ...], other)
    if len(parts) == 3 and isinstance(others[0], tuple) and not isinstance(parts[0], tuple):
        return diagonal(cast(Any, parts))
    return rebuild(value, [_widened(*pair) for pair in zip(parts, others, strict=True)])
