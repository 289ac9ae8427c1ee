"""The derivative of a program is a program: each number that depends on the varied memories gets its slope in one
direction.

Lanes are directions: all compute the same numbers and each its own slopes, so a vector of lanes gives as many columns of a
Jacobian, exact but for rounding. Source: A. Griewank, A. Walther, Evaluating Derivatives (2008), forward mode by
transformation of the source.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from starhold.algebra.operations import NUMBER, OPERATIONS
from starhold.trace.program import Block, Branch, Call, Function, Load, Loop, Memory, Op, Program, Slot, Store, Value, prune

ROUNDS = 2.0**51
"""Adding a constant of this size rounds to integers, and the result has zero slope."""
MARK = ".d"
"""Suffix of the slope of a name or of a memory; no other name contains it."""


def tangent(program: Program, varied: Collection[str]) -> Program:
    """Return a program that also computes the slopes of the numbers in the varied memories. Beside each stands a memory
    NAME.d for the slopes of its numbers.

    Raise ValueError if a number's bits are read, which have no slope."""
    made = _Tangent(varied)
    body = made.block(program.main.body, {})
    main = program.main._replace(body=prune(body, ())[0])
    beside = tuple(Memory(memory.name + MARK, True, memory.writable, memory.size)
                   for memory in program.memories if memory.name in varied)  # fmt: skip
    return Program((*program.functions[:-1], *made.functions, main), (*program.memories, *beside))


class _Tangent:
    """The transformation of one program. `slopes` maps the names of numbers to the names of their slopes."""

    def __init__(self, varied: Collection[str]) -> None:
        self.varied = varied
        self.functions: list[Function] = []
        self._made: dict[tuple[str, tuple[bool, ...]], tuple[Function, list[bool]]] = {}
        self._count = 0

    def block(self, block: Block, slopes: dict[Value, Value]) -> Block:
        """Return the statements of a block with those of the slopes added, and add to `slopes`."""
        result: list[Any] = []
        for s in block:
            if isinstance(s, Loop):
                result.append(self._loop(s, slopes))
            elif isinstance(s, Branch):
                result.append(s._replace(body=self.block(s.body, slopes)))
            elif isinstance(s, Call):
                result.append(self._call(s, slopes))
            else:
                result.append(s)
                if isinstance(s, Op):
                    self._op(s, slopes, result)
                elif s.memory in self.varied and isinstance(s, Load):
                    slopes[s.ref] = s.ref + MARK
                    result.append(Load(s.ref + MARK, s.memory + MARK, s.index))
                elif s.memory in self.varied:
                    result.append(Store(s.memory + MARK, s.index, slopes.get(s.value, 0.0)))
        return tuple(result)

    def _op(self, s: Op, slopes: dict[Value, Value], result: list[Any]) -> None:
        name, given = s.operation.name, [slopes.get(x) if isinstance(x, str) else None for x in s.args]
        if all(slope is None for slope in given):
            return
        if name == "bits_of":
            raise ValueError("the bits of a number have no slope")
        if s.operation.gives != NUMBER or (name == "plus" and any(_rounds(x) for x in s.args)):
            return

        def put(operation: str, *args: Value) -> Value:
            self._count += 1
            result.append(Op(f"{s.ref}{MARK}{self._count}", OPERATIONS[operation], args))
            return result[-1].ref

        def product(slope: Value | None, factor: Value) -> Value | None:
            return None if slope is None else put("product", slope, factor)

        if name in ("plus", "minus"):
            new = _joined(put, name, *given)
        elif name == "negative":
            new = put("negative", given[0])
        elif name == "product":
            new = _joined(put, "plus", product(given[0], s.args[1]), product(given[1], s.args[0]))
        elif name == "divide":
            new = put("divide", _joined(put, "minus", given[0], product(given[1], s.ref)), s.args[1])
        elif name == "sqrt":
            new = put("product", given[0], put("divide", 0.5, s.ref))
        elif name == "select":
            new = put("select", s.args[0], *(0.0 if slope is None else slope for slope in given[1:]))
        else:
            raise ValueError(f"{name} has no slope")
        slopes[s.ref] = new

    def _loop(self, s: Loop, slopes: dict[Value, Value]) -> Loop:
        """Return the loop with a slot for the slope of each slot that has one before it or after an iteration."""
        moving = {slot.name for slot in s.slots if slot.before in slopes}
        while True:
            inner = slopes | {name: name + MARK for name in moving}
            body = self.block(s.body, inner)
            more = {slot.name for slot in s.slots if slot.kind == NUMBER and slot.after in inner} | moving
            if more == moving:
                break
            moving = more
        slots = [
            Slot(slot.name + MARK, NUMBER, slopes.get(slot.before, 0.0), inner.get(slot.after, 0.0))
            for slot in s.slots
            if slot.name in moving
        ]
        slopes.update({slot.end: Slot(slot.name + MARK, NUMBER, 0.0, 0.0).end for slot in s.slots if slot.name in moving})
        return s._replace(slots=(*s.slots, *slots), body=body)

    def _call(self, s: Call, slopes: dict[Value, Value]) -> Call:
        """Return the call of the function that computes the slopes of its results too."""
        given = tuple(isinstance(x, str) and x in slopes for x in s.args)
        if not any(given):
            return s
        key = (s.function.name, given)
        if key not in self._made:
            self._made[key] = self._defined(s.function, given)
        function, kept = self._made[key]
        refs = [(name + MARK, kind) for (name, kind), keep in zip(s.refs, kept, strict=True) if keep]
        slopes.update({name: name + MARK for (name, _), keep in zip(s.refs, kept, strict=True) if keep})
        more = [slopes[x] for x, varies in zip(s.args, given, strict=True) if varies]
        return Call((*s.refs, *refs), function, (*s.args, *more))

    def _defined(self, function: Function, given: Sequence[bool]) -> tuple[Function, list[bool]]:
        """Return the function with slopes, and which of its results have one; given: which of its arguments do."""
        slopes: dict[Value, Value] = {x: x + MARK for (x, _), varies in zip(function.params, given, strict=True) if varies}
        params = (*function.params, *((slope, NUMBER) for slope in slopes.values()))
        body = self.block(function.body, slopes)
        kept = [isinstance(out, str) and out in slopes for out, _ in function.outs]
        outs = (*function.outs, *((slopes[out], NUMBER) for out, _ in function.outs if out in slopes))
        name = f"{function.name}{MARK}{len(self.functions)}"
        self.functions.append(Function(name, function.doc, params, body, outs))
        return self.functions[-1], kept


def _rounds(x: Value) -> bool:
    return isinstance(x, float) and abs(x) >= ROUNDS


def _joined(put: Any, operation: str, one: Value | None, other: Value | None) -> Value:
    """Return the sum or difference of two slopes, of which at most one is None."""
    if other is None:
        return one
    if one is None:
        return other if operation == "plus" else put("negative", other)
    return put(operation, one, other)
