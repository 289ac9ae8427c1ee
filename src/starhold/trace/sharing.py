"""Which values of a program differ between lanes, and which all lanes share: those are computed once, in scalars.

A value differs where it comes from a lane's own memory or number, or from another that differs; a loop that lanes leave at
different turns leaves them with different slots.
"""

from collections.abc import Iterator
from typing import Any

from starhold.algebra.operations import INDEX
from starhold.trace.program import Call, Function, Load, Loop, Op, Program, Store, Value, statements


def differing(program: Program, function: Function) -> set[Value]:
    """Return the names of a function's values that differ between lanes. What calls give and take differs."""
    own = {memory.name for memory in program.memories if memory.lanes}
    names: set[Value] = set()
    if function is not program.main:
        names.update(name for name, kind in function.params if kind != INDEX)
    before = -1
    # What the end of a turn gives is the start of the next.
    while before != (before := len(names)):
        for s in statements(function.body):
            if isinstance(s, Op):
                if s.operation.name == "lane" or not names.isdisjoint(s.args):
                    names.add(s.ref)
            elif isinstance(s, Load):
                if s.memory in own:
                    names.add(s.ref)
            elif isinstance(s, Call):
                names.update(name for name, _ in s.refs)
            elif isinstance(s, Loop):
                for slot in s.slots:
                    if not names.isdisjoint((s.done, slot.before, slot.after)):
                        names.update((slot.name, slot.end))
    return names


def spread(program: Program, function: Function, names: set[Value]) -> set[Value]:
    """Return the shared values that something else reads in all lanes; names: of those that differ."""
    return {value for value in _in_lanes(program, function, names) if isinstance(value, str)} - names


def _in_lanes(program: Program, function: Function, names: set[Value]) -> Iterator[Any]:
    for s in statements(function.body):
        if isinstance(s, Op):
            yield from s.args if s.ref in names else ()
        elif isinstance(s, Call):
            yield from s.args
        elif isinstance(s, Store):
            if program.memory(s.memory).lanes:
                yield s.value
        elif isinstance(s, Loop):
            for slot in s.slots:
                yield from (slot.before, slot.after) if slot.name in names else ()
    yield from (value for value, _ in function.outs)

