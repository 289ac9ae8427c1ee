"""Prints an equation as a straight-line program for the proof kernel (inputs by name, steps, indices of outputs), and
evaluates such programs in floats."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache, reduce
from typing import Any

import numpy as np

from starhold.algebra.circular import SHIFT
from starhold.algebra.operations import WORD, Operation, unreadable
from starhold.algebra.structure import leaves
from starhold.errors import InputError
from starhold.kernel.numbers import rational
from starhold.trace.program import Load, Op, Store
from starhold.trace.recording import Recorder


def labelled(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the floats of a nested value with their names as inputs of a program, such as craft.inertia.0."""
    if isinstance(value, tuple):
        fields = getattr(value, "_fields", range(len(value)))  # pyright: ignore[reportUnknownArgumentType]
        for field, part in zip(fields, value, strict=True):  # pyright: ignore[reportUnknownVariableType,reportUnknownArgumentType]
            yield from labelled(f"{name}.{field}", part)
    elif isinstance(value, float):
        yield name, value


class _NumbersAlone(Recorder):
    def apply(self, operation: Operation, values: tuple[Any, ...]) -> Any:
        if WORD in (*operation.takes, operation.gives):
            raise unreadable(
                "a number's bits, of which sin, log and their like are made: proofs read + - * /, sqrt and cases"
            )
        return super().apply(operation, values)


def straight_line(equation: Callable[..., Any], **given: Any) -> dict[str, Any]:
    """Return an equation as a program of the proof kernel. The equation is called with the arguments given, whose floats
    become the program's inputs. Raise InputError if it has loops or buffers, UnreadableError if it has words."""
    recorder = _NumbersAlone()
    x, y = recorder.memory("x"), recorder.memory("y", writable=True)
    names = [label for name, value in given.items() for label, _ in labelled(name, value)]
    place = iter(range(len(names)))

    def handle(value: Any) -> Any:
        if isinstance(value, tuple):
            parts = [handle(part) for part in value]  # pyright: ignore[reportUnknownVariableType]
            return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)  # pyright: ignore
        return x[next(place)] if isinstance(value, float) else value

    with recorder.recording():
        for k, leaf in enumerate(leaves(equation(*(handle(value) for value in given.values())))):
            y[k] = leaf
    body = recorder.program("program").main.body
    used = sorted({s.index for s in body if isinstance(s, Load)})
    steps, outputs = list[list[Any]](), list[int]()
    places, constants, shifted = dict[str, int](), dict[str, int](), dict[str, Any]()

    def at(value: Any) -> int:
        if isinstance(value, str):
            return places[value]
        # Zeros of both signs are distinct.
        text = float(value).hex()
        if text not in constants:
            constants[text] = step("constant", text)
        return constants[text]

    def step(*parts: Any) -> int:
        steps.append([*parts])
        return len(used) + len(steps) - 1

    def rounded(value: Any) -> int:
        # Over exact numbers (x + shift) - shift is x: 0 where |x| < 1/2, and a quotient by zero elsewhere.
        near = step("both", step("less", at(value), at(0.5)), step("less", at(-0.5), at(value)))
        return step("divide", at(0.0), step("select", near, at(1.0), at(0.0)))

    for s in body:
        if isinstance(s, Load):
            places[s.ref] = used.index(s.index)
        elif isinstance(s, Op):
            name, args = s.operation.name, s.args
            if name == "plus" and args[1] == SHIFT:
                shifted[s.ref] = args[0]
            if name == "minus" and args[0] in shifted and args[1] == SHIFT:
                places[s.ref] = rounded(shifted[args[0]])
            else:
                places[s.ref] = step(name, *[at(value) for value in args])
        elif isinstance(s, Store):
            outputs.append(at(s.value))
        else:
            raise InputError("law", "", "loops or calls", "an equation without them: the kernel reads straight lines")
    return {"inputs": [names[k] for k in used], "steps": steps, "outputs": outputs}


READERS: dict[str, Callable[..., Any]] = {
    "plus": np.add, "minus": np.subtract, "product": np.multiply, "divide": np.divide, "negative": np.negative,
    "sqrt": np.sqrt, "less": np.less, "less_equal": np.less_equal, "select": np.where, "both": np.logical_and,
    "either": np.logical_or, "opposite": np.logical_not,
}  # fmt: skip
"""The operations of the kernel in floats."""


def evaluated(program: Mapping[str, Any], **given: Any) -> list[Any]:
    """Return the outputs of a program in floats, for arguments shaped like those of its recording; their numbers may be
    columns (n,)."""

    def read(name: str) -> Any:
        value, *path = name.split(".")
        return reduce(lambda part, key: part[int(key)] if key.isdigit() else getattr(part, key), path, given[value])

    values = [read(name) for name in program["inputs"]]
    for operation, *operands in program["steps"]:
        constant = operation == "constant"
        values.append(_float(operands[0]) if constant else READERS[operation](*(values[k] for k in operands)))
    return [values[k] for k in program["outputs"]]


@lru_cache(1 << 16)
def _float(text: str) -> float:
    return float(rational(text))
