"""Test vectors of a law, and the self-test in C that requires their bits."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import flatten, floats, leaves, mapped, places
from starhold.algebra.structured import Buffer
from starhold.export.code import Code
from starhold.export.law import numbers
from starhold.export.types import Type
from starhold.trace.calling import bind
from starhold.trace.machine import load
from starhold.trace.recording import Recorder

EDGES = (0.0, -0.0, 5e-324, -2.2250738585072014e-308, 1e-160, 1.0, -1.0, 1e155, -1.7976931348623157e308, math.inf, -math.inf,
         math.nan)  # fmt: skip
"""Numbers at the edges of floating-point arithmetic."""
RUNS, STEPS = 12, 16
NAN = 0x7FF8000000000000
_PRIME, _BASIS = 0x100000001B3, 0xCBF29CE484222325


class Vector(NamedTuple):
    """A test vector: before a step, whether the state is reset, and the inputs that are read; after it, the numbers of the
    command, and the digest of the state."""

    first: bool
    inputs: list[float]
    command: list[float]
    digest: int


def kept_inputs(code: Code) -> list[int]:
    """Return the indices of the inputs' numbers that the law reads."""

    def those(kind: Type | None, value: Any) -> list[int]:
        kept = [place for member, part in code.types.members(kind, value) for place in those(member.type, part)]
        return kept or [code.types.within(value)]

    kind = code.given["input"]
    return [] if kind is None else those(kind, places(code.flight.inputs))


def random_columns(
    rng: np.random.Generator, value: Any, count: int, edges: float = 0.0, name: str = ""
) -> NDArray[np.float64]:
    """Return random numbers (numbers, count) to replace the floats of a value: quaternions of unit length, flags of 0 or 1,
    others of any size up to twice the largest of their field; a share `edges` of them comes from EDGES."""
    if hasattr(value, "_fields"):
        pairs = list(zip(value._fields, value, strict=True))
    elif isinstance(value, tuple) and any(isinstance(part, tuple) for part in value):
        pairs = [(name, part) for part in value]  # pyright: ignore
    else:
        pairs = []
    if pairs:
        return np.vstack([np.empty((0, count)), *(random_columns(rng, part, count, edges, field) for field, part in pairs)])
    flat = floats(value)
    shape = (len(flat), count)
    if name in ("attitude", "followed") and len(flat) == 4:
        values = rng.normal(size=shape)
        values /= np.linalg.norm(values, axis=0)
    elif name in ("attitude_is_new", "begun"):
        values = rng.integers(0, 2, shape).astype(float)
    elif name == "sign":
        values = rng.choice([-1.0, 1.0], shape)
    else:
        size = max([abs(x) for x in flat if math.isfinite(x)] or [0.0]) or 1.0
        values = size * rng.uniform(-2.0, 2.0, shape) * 10.0 ** rng.uniform(-4.0, 0.0, shape)
    special = rng.choice(np.array(EDGES), shape)
    return np.where(rng.random(shape) < edges, special, values)


def with_numbers(value: Any, column: NDArray[np.float64]) -> Any:
    """Return a value with its floats replaced by these, in order."""
    source = iter(column.tolist())
    return mapped(value, lambda leaf: next(source) if isinstance(leaf, float) else leaf)


class Stepper:
    """The reference step for C, step(state, inputs) -> (command, state): the equations of the simulation, recorded and
    compiled as there, so that it continues past a division by zero, as C does."""

    def __init__(self, code: Code) -> None:
        flight, recorder = code.flight, Recorder()
        like = (flight.parameters, flight.start, flight.inputs)
        with recorder.recording():
            given, gives = recorder.memory("given", writable=True), recorder.memory("gives", writable=True)
            command, state = flight.equation()(*bind(like, given))
            for place, leaf in enumerate(flatten((command, state))):
                gives[place] = leaf
        self._like, self._after = like, (mapped(command, lambda _: 0.0), flight.start)
        self._gives = np.empty(len(flatten(self._after)))
        self._call = load(recorder.program("step"), 1)

    def __call__(self, state: Any, inputs: Any) -> tuple[Any, Any]:
        values = (self._like[0], state, inputs)
        given = np.array([x for leaf in leaves(values) for x in _in_order(leaf)])
        self._call(given.ctypes.data, self._gives.ctypes.data)
        numbers, left = iter(self._gives.tolist()), iter(given.tolist())
        cells_of = [[next(left) for _ in _in_order(leaf)] for leaf in leaves(values)]
        buffers = iter([cells for cells, leaf in zip(cells_of, leaves(values), strict=True) if isinstance(leaf, Buffer)])
        return mapped(self._after, lambda leaf: Buffer(next(buffers)) if isinstance(leaf, Buffer) else next(numbers))


def _in_order(leaf: Any) -> list[float]:
    if isinstance(leaf, Buffer):
        return list(leaf.row(0, leaf.size))
    return [leaf] if isinstance(leaf, float) else []


def fresh(state: Any) -> Any:
    """Return a copy of a state whose buffers are its own."""
    return mapped(state, lambda leaf: Buffer([leaf[k] for k in range(leaf.size)]) if isinstance(leaf, Buffer) else leaf)


def digest(values: list[float]) -> int:
    """Return the 64-bit FNV-1a hash of the bits of numbers; all NaNs count as equal."""
    value = _BASIS
    for word in bits(values):
        for shift in range(0, 64, 8):
            value = ((value ^ (word >> shift & 0xFF)) * _PRIME) & 0xFFFFFFFFFFFFFFFF
    return value


def bits(values: list[float]) -> list[int]:
    """Return the bits of numbers; all NaNs count as equal."""
    words = np.asarray(values, dtype=float).view(np.uint64).tolist()
    return [NAN if math.isnan(x) else int(word) for x, word in zip(values, words, strict=True)]


def vectors(code: Code, seed: int = 1) -> list[Vector]:
    """Return test vectors of several runs from the start, each step with its own measurements; in every second run some of
    these come from EDGES."""
    rng, step, keep = np.random.default_rng(seed), Stepper(code), kept_inputs(code)
    flights: list[Vector] = []
    for run in range(RUNS // 3 if code.buffers else RUNS):
        state = fresh(code.flight.start)
        for k in range(STEPS):
            column = random_columns(rng, code.flight.inputs, 1, edges=0.1 * (run % 2))[:, 0]
            inputs = with_numbers(code.flight.inputs, column)
            command, state = step(state, inputs)
            given = numbers(inputs)
            flights.append(Vector(k == 0, [given[place] for place in keep], numbers(command), digest(numbers(state))))
    return flights


def selftest_rows(cases: list[Vector]) -> str:
    """Return the lines of the self-test in C, which runs these steps and fails unless every bit agrees."""
    return ",\n".join("    {" + ", ".join([str(int(c.first)), _braced(c.inputs), _braced(c.command), _word(c.digest)]) + "}"
                      for c in cases)  # fmt: skip


def _braced(values: list[float]) -> str:
    return "{" + ", ".join(map(_word, bits(values) or [0])) + "}"


def _word(word: int) -> str:
    return f"UINT64_C(0x{word:016X})"
