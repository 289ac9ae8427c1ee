"""Kernels that repeat the step of a closed loop over one lane or many: programs recorded from the equations of a step and
compiled on first use.

One lane, any lane of a batch, plain Python, C and JavaScript agree bit for bit. No fast-math anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from itertools import repeat
from math import copysign
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structure import buffers, flatten, leaves, mapped, rebuild, unflatten
from starhold.algebra.structured import Buffer
from starhold.loop.closed_loop import ClosedLoop, Composition, Phase
from starhold.loop.step import Step, make_equations
from starhold.parts.random import Dice, Silent
from starhold.trace.handles import Opposite
from starhold.trace.machine import load, word
from starhold.trace.program import Program
from starhold.trace.recording import Recorder

Array: TypeAlias = NDArray[np.float64]


class Numbers(NamedTuple):
    """The arguments of a kernel: gains, the law's nominal model of the craft, the true craft, the setup. Numbers that
    differ between lanes are arrays (lanes,). Integers are constants of the kernel."""

    gains: Any
    nominal: Any
    craft: Any
    setup: Any

    @classmethod
    def of(cls, phase: Phase) -> Numbers:
        """Return the numbers of a phase."""
        return cls(phase.gains, phase.nominal, phase.craft, phase.setup)


class Observer(NamedTuple):
    """An observer takes notes (accumulated numbers) at each control step: note(noted, decided, carry, step, setup, numbers)
    -> noted. `decided` is the carry at the control instant `step`, with the command decided there, and `carry` that at the
    end of the step; `first` has the shape of the notes, `numbers` are arguments of the kernel."""

    note: Callable[..., Any]
    first: Any
    numbers: Any


@cache
def make_step(parts: Composition, silent: bool = False) -> Step:
    """Return the equations of a control step of these parts; silent: without any noise."""
    return make_equations(parts, Silent if silent else Dice)


def form(value: Any) -> Any:
    """Return a key that is equal for arguments that one kernel serves: their structure, their constants, and which of the
    numbers common to parts are equal."""
    return _form(value, {})


def _form(value: Any, known: dict[str, int]) -> Any:
    if isinstance(value, float):
        return "number"
    if isinstance(value, tuple):
        shared = _in_common(value)  # pyright: ignore
        equal = () if shared is None else (known.setdefault(shared, len(known)),)
        equal += tuple(_sizes(getattr(value, name)) for name in getattr(value, "SIZES_IN_COMMON", ()))  # pyright: ignore
        # Most parts are numbers: a call for each would cost more than all else.
        parts = ["number" if type(part) is float else _form(part, known) for part in value]  # pyright: ignore
        return (type(value), *equal, *parts)  # pyright: ignore
    if isinstance(value, Buffer):
        return ("buffer", value.size)
    if isinstance(value, np.ndarray):
        return "lanes"
    return (type(value), value)


def _in_common(value: tuple[Any, ...]) -> str | None:
    """Return a key that is equal for bitwise equal numbers common to parts; None for others, and if lanes differ."""
    if not getattr(value, "IN_COMMON", False) or not all(isinstance(leaf, float) for leaf in leaves(value)):
        return None
    return repr(value)


def _sizes(rows: Any) -> tuple[tuple[int, bool], ...]:
    """Return for each number of some rows, besides constants, the place of the first of its size, and whether it has the
    other sign; () where some differ between lanes."""
    numbers, places = [x for x in leaves(rows) if not isinstance(x, int)], dict[float, int]()
    if any(isinstance(x, np.ndarray) for x in numbers):
        return ()
    firsts = [places.setdefault(abs(x), place) for place, x in enumerate(numbers)]
    return tuple((k, copysign(1.0, x) != copysign(1.0, numbers[k])) for k, x in zip(firsts, numbers, strict=True))


def fly_plainly(loop: ClosedLoop, steps: int) -> Any:
    """Return the carry of a loop without events after `steps` control steps in plain Python."""
    step, carry, setup = make_step(loop.composition()), loop.carry(), loop.setup()
    key = (loop.seed, loop.run)
    for k in range(steps):
        carry = step.update(step.check(carry, k, setup), k, key, loop.gains, loop.known, setup)
        for _ in range(loop.substeps):
            carry = step.propagate(carry, loop.craft, setup)
    return step.check(carry, steps, setup)


class Arguments:
    """The numbers in a kernel's memories: those that all lanes share, those that differ between lanes, and tables."""

    def __init__(self, *values: Any) -> None:
        self.values = values
        numbers = list(leaves(values))
        self.shared = np.array([leaf for leaf in numbers if isinstance(leaf, float)])
        self.varying = [leaf for leaf in numbers if isinstance(leaf, np.ndarray)]
        self.tables = np.array([x for table in buffers(values) for x in table.cells])

    def bound(self, recorder: Recorder, base: Any) -> Any:
        """Return the values while recording; a lane's own numbers begin at `base`."""
        shared, varying, tables = (recorder.memory(name, lanes=name == "own") for name in ("shared", "own", "tables"))
        places = {name: iter(range(1 << 40)) for name in ("shared", "own")}
        offset = 0

        def leaf(value: Any) -> Any:
            nonlocal offset
            if isinstance(value, float):
                return shared[next(places["shared"])]
            if isinstance(value, np.ndarray):
                return varying[base + next(places["own"])]
            if isinstance(value, Buffer):
                offset += value.size
                return Buffer(tables, offset - value.size, value.size)
            return value

        def merged(rows: Any) -> Any:
            """Return rows in which equal numbers are one number, and opposite ones are opposites of it."""
            sizes, numbers = _sizes(rows), list[Any]()

            def one(value: Any) -> Any:
                if not sizes or isinstance(value, int):
                    return leaf(value)
                numbers.append(leaf(value))
                first, turned = sizes[len(numbers) - 1]
                return Opposite(numbers[first]) if turned else numbers[first]

            return mapped(rows, one)

        met: dict[str, Any] = {}

        def part(value: Any) -> Any:
            if not isinstance(value, tuple):
                return None if value is None else leaf(value)
            shared = _in_common(value)  # pyright: ignore
            if shared in met:
                # So the computations of a second part with them are common subexpressions.
                for _ in leaves(value):
                    next(places["shared"])
                return met[shared]
            sized = getattr(value, "SIZES_IN_COMMON", ())  # pyright: ignore
            named = zip(getattr(value, "_fields", repeat("")), value, strict=False)  # pyright: ignore
            made = rebuild(value, [merged(x) if name in sized else part(x) for name, x in named])  # pyright: ignore
            if shared is not None:
                met[shared] = made
            return made

        return part(self.values)

    def rows(self, lanes: int) -> Array:
        """Return the arguments that differ between lanes, as an array (arguments, lanes)."""
        return np.array([np.broadcast_to(row, (lanes,)) for row in self.varying]).reshape(len(self.varying), lanes)


def numbers_of(state: Any) -> list[float]:
    """Return a state's scalars in order, followed by the contents of its buffers."""
    return [*flatten(state), *(buffer[k] for buffer in buffers(state) for k in range(buffer.size))]


def state_of(numbers: Any, like: Any) -> Any:
    """Return the state shaped like `like` made of the numbers of `numbers_of`."""
    values = numbers.tolist()
    count = len(flatten(like))
    rest = iter(values[count:])
    state = unflatten(values[:count], like)
    if len(values) == count:
        return state
    return mapped(state, lambda leaf: Buffer([next(rest) for _ in range(leaf.size)]) if isinstance(leaf, Buffer) else leaf)


class Kernel:
    """A compiled program, called with its memories by name, then counts and words in the program's order."""

    def __init__(self, program: Program, width: int, passes: bool | None = None) -> None:
        """passes: see `load`."""
        self.program = program
        self._call = load(program, width, passes)

    def __call__(self, memories: dict[str, Array], *counts: int) -> None:
        self.on(memories)(*map(word, counts))

    def on(self, memories: dict[str, Array]) -> Callable[..., None]:
        """Return the program bound to these memories, which must not move; it is called with counts and words alone."""
        return partial(self._call, *(memories[memory.name].ctypes.data for memory in self.program.memories))


_PROGRAMS: dict[Any, Program] = {}
_KERNELS: dict[Any, Kernel] = {}


def make_program(kind: Callable[..., Program], parts: Composition, *arguments: Any) -> Program:
    """Return the program kind(step, *arguments), recorded once for all arguments of the same form."""
    key = (kind, parts, form(arguments))
    if key not in _PROGRAMS:
        _PROGRAMS[key] = kind(make_step(parts), *arguments)
    return _PROGRAMS[key]


def make_kernel(
    kind: Callable[..., Program], parts: Composition, width: int, *arguments: Any, passes: bool | None = None
) -> Kernel:
    """Return the kernel of a program kind(step, *arguments), compiled once for arguments of one form. passes: see `load`."""
    key = (kind, parts, width, passes, form(arguments))
    if key not in _KERNELS:
        _KERNELS[key] = Kernel(make_program(kind, parts, *arguments), width, passes)
    return _KERNELS[key]
