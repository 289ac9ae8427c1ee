"""Finds what a program of functions needs: values, parameters, and the members of its structs."""

from __future__ import annotations

from typing import Any

from starhold.export.recording import Signature
from starhold.trace.program import Branch, Call, Function, Load, Loop, Op, Program, reads, single_turns, statements, writes


class Needs:
    """`members`: pairs of a struct and a member that is read; `params`: pairs of a function and a parameter; `live`: for
    each function that is called the names that are read there."""

    def __init__(self, program: Program) -> None:
        self.functions = {function.name: single_turns(function) for function in program.functions}
        self.members: set[tuple[str, str]] = set()
        self.params: set[tuple[str, str]] = set()
        self.live: dict[str, set[Any]] = {program.main.name: set()}
        self._writes = {name: writes(function.body) for name, function in self.functions.items()}
        main = program.main.shape
        for path in main.leaves:
            self.members |= set(path.through)
        before = None
        while before != (before := (len(self.members), len(self.params), sum(map(len, self.live.values())), len(self.live))):
            for name in list(self.live):
                self._visit(self.functions[name])

    def reads(self, path: Any) -> bool:
        """Tell whether a leaf is a member of nothing but structs that have it."""
        return set(path.through) <= self.members

    def _visit(self, function: Function) -> None:
        live = self.live[function.name]
        shape: Signature | None = function.shape
        for place, (out, _) in enumerate(function.outs):
            if shape is None or self.reads(shape.leaves[place]):
                live.add(out)
        order, before = [*statements(function.body)][::-1], -1
        acts = {id(s): self._acts(s.body) for s in order if isinstance(s, (Loop, Branch))}
        while before != (before := len(live)):
            for s in order:
                if isinstance(s, (Op, Load)):
                    if s.ref in live:
                        live.update(reads((s,)))
                elif isinstance(s, Call):
                    self._visit_call(s, live)
                elif isinstance(s, Loop):
                    slots = [slot for slot in s.slots if {slot.name, slot.end} & live]
                    if slots or acts[id(s)]:
                        live.update((s.most, s.done, *(x for slot in slots for x in (slot.before, slot.after))))
                elif isinstance(s, Branch):
                    if acts[id(s)]:
                        live.add(s.truth)
                else:
                    live.update(reads((s,)))
        if shape is not None:
            for param in shape.params:
                for path in param.leaves:
                    if path.text in live:
                        self.params.add((function.name, param.name))
                        self.members |= set(path.through)

    def _visit_call(self, s: Call, live: set[Any]) -> None:
        called = self.functions[s.function.name]
        if not (self._writes[called.name] or any(ref in live for ref, _ in s.refs)):
            return
        self.live.setdefault(called.name, set())
        shape: Signature | None = called.shape
        if shape is None:
            live.update(s.args)
            return
        for (ref, _), path in zip(s.refs, shape.leaves, strict=True):
            if ref in live:
                self.members |= set(path.through)
        args = iter(s.args)
        for param in shape.params:
            for path in param.leaves:
                value = next(args)
                if (called.name, param.name) in self.params and self.reads(path):
                    live.add(value)

    def _args(self, s: Call) -> tuple[Any, ...]:
        """Return the values that a call is given, with zeros for those that are not needed."""
        shape: Signature | None = s.function.shape
        if shape is None:
            return s.args
        needed = [
            (s.function.name, param.name) in self.params and self.reads(path)
            for param in shape.params
            for path in param.leaves
        ]
        return tuple(value if need else 0.0 for value, need in zip(s.args, needed, strict=True))

    def _acts(self, block: Any) -> bool:
        return any(
            self._writes[s.function.name] if isinstance(s, Call) else not isinstance(s, (Op, Load, Loop, Branch))
            for s in statements(block)
        )

    def program(self, program: Program) -> Program:
        """Return the program without what nothing needs."""
        kept: dict[str, Function] = {}
        for name, function in self.functions.items():
            if name in self.live:
                shape: Signature | None = function.shape
                outs = function.outs
                if shape is not None:
                    outs = tuple(
                        (out if self.reads(path) else 0.0, kind)
                        for (out, kind), path in zip(outs, shape.leaves, strict=True)
                    )
                kept[name] = function._replace(body=self._kept(function.body, self.live[name]), outs=outs)
        return program._replace(functions=tuple(kept.values()))

    def _kept(self, block: Any, live: set[Any]) -> tuple[Any, ...]:
        found: list[Any] = []
        for s in block:
            if isinstance(s, (Op, Load)):
                if s.ref not in live:
                    continue
            elif isinstance(s, Call):
                if not (self._writes[s.function.name] or any(ref in live for ref, _ in s.refs)):
                    continue
                s = s._replace(args=self._args(s))
            elif isinstance(s, Loop):
                slots = tuple(slot for slot in s.slots if {slot.name, slot.end} & live)
                if not slots and not self._acts(s.body):
                    continue
                s = s._replace(slots=slots, head=self._kept(s.head, live), body=self._kept(s.body, live))
            elif isinstance(s, Branch):
                if not self._acts(s.body):
                    continue
                s = s._replace(body=self._kept(s.body, live))
            found.append(s)
        return tuple(found)
