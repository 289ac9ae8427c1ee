"""Runs a program statement by statement by the plain meanings of its operations, and counts what it does."""

from collections.abc import Mapping
from typing import Any

from starhold.algebra.operations import NUMBER
from starhold.trace.bounds import KINDS, Work
from starhold.trace.program import Branch, Call, Function, Load, Op, Program, Store

_KIND = {name: kind for kind, names in KINDS.items() for name in names}


class Interpreter:
    """One run of a program, on lane 0: what its memories hold, what has been done, and the places used of each memory."""

    def __init__(self, program: Program, memories: Mapping[str, Any], inputs: Mapping[str, int]) -> None:
        self.memories = {name: [float(x) for x in cells] for name, cells in memories.items()}
        self.done = dict.fromkeys(Work._fields, 0)
        self.places: dict[str, set[int]] = {name: set() for name in memories}
        self._block(program.main.body, dict(inputs))

    @property
    def work(self) -> Work:
        """What has been done."""
        return Work(**self.done)

    def _block(self, block: tuple[Any, ...], known: dict[str, Any]) -> None:
        def value(x: Any) -> Any:
            return known[x] if isinstance(x, str) else x

        for s in block:
            if isinstance(s, Op):
                self.done[_KIND[s.operation.name]] += 1
                known[s.ref] = s.operation.plain(*map(value, s.args))
            elif isinstance(s, Load):
                self.done["loads"] += 1
                self.places[s.memory].add(value(s.index))
                known[s.ref] = self.memories[s.memory][value(s.index)]
            elif isinstance(s, Store):
                self.done["stores"] += 1
                self.places[s.memory].add(value(s.index))
                self.memories[s.memory][value(s.index)] = value(s.value)
            elif isinstance(s, Call):
                given = self._call(s.function, [value(x) for x in s.args])
                known.update(zip((name for name, _ in s.refs), given, strict=True))
            elif isinstance(s, Branch):
                if value(s.truth):
                    self._block(s.body, known)
            else:
                known.update((slot.name, value(slot.before)) for slot in s.slots)
                for k in range(value(s.most)):
                    known[s.counter] = k
                    self._block(s.head, known)
                    if s.done is not None and value(s.done):
                        break
                    self._block(s.body, known)
                    # All at once: one may hold what another held before.
                    known.update([(slot.name, value(slot.after)) for slot in s.slots])
                known.update((slot.end, known[slot.name]) for slot in s.slots)

    def _call(self, function: Function, args: list[Any]) -> list[Any]:
        known = dict(zip((name for name, _ in function.params), args, strict=True))
        self._block(function.body, known)
        values = [known[x] if isinstance(x, str) else x for x, _ in function.outs]
        return [float(x) if kind == NUMBER else x for x, (_, kind) in zip(values, function.outs, strict=True)]
