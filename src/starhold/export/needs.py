"""Finds what a program of functions needs: values, parameters, and the members of its structs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from starhold.export.recording import Parameter
from starhold.export.types import Path
from starhold.trace.program import Call, Function, Program, live_names, pruned, single_turns, writes


class Needs:
    """`members`: pairs of a struct and a member that is read; `live`: the names that each function that is called reads."""

    def __init__(self, program: Program) -> None:
        self._functions = {function.name: single_turns(function) for function in program.functions}
        self._writes = {name: writes(function.body) for name, function in self._functions.items()}
        self.members = {member for path in program.main.shape.leaves for member in path.through}
        self.live: dict[str, set[Any]] = {program.main.name: set()}
        before = None
        while before != (before := (len(self.members), [len(names) for names in self.live.values()])):
            for name in list(self.live):
                function = self._functions[name]
                self.live[name] |= live_names(function.body, self._outs(function), self._arguments)
                self._read(path for path in _leaves(function) if path.text in self.live[name])

    def reads(self, path: Path) -> bool:
        """Tell whether a leaf is a member of nothing but structs that have it."""
        return self.members.issuperset(path.through)

    def takes(self, function: Function, param: Parameter) -> bool:
        """Tell whether a function reads anything of a parameter."""
        return not self.live[function.name].isdisjoint(path.text for path in param.leaves)

    def program(self, program: Program) -> Program:
        """Return the program without what nothing needs."""
        functions: list[Function] = []
        for name in (name for name in self._functions if name in self.live):
            function = self._functions[name]
            outs = tuple(zip(self._outs(function), (kind for _, kind in function.outs), strict=True))
            functions.append(function._replace(body=pruned(function.body, self.live[name], self._arguments), outs=outs))
        return program._replace(functions=tuple(functions))

    def _read(self, leaves: Any) -> None:
        self.members.update(member for path in leaves for member in path.through)

    def _outs(self, function: Function) -> list[Any]:
        """Return what a function gives, with zeros for what is not needed."""
        pairs = zip(function.outs, function.shape.leaves, strict=True)
        return [out if self.reads(path) else 0.0 for (out, _), path in pairs]

    def _arguments(self, s: Call, names: set[Any]) -> Sequence[Any] | None:
        """Return what a call reads, with zeros for what is not needed; None for a call that none of these names needs."""
        function = s.function
        if not self._writes[function.name] and names.isdisjoint(ref for ref, _ in s.refs):
            return None
        self.live.setdefault(function.name, set())
        self._read(path for (ref, _), path in zip(s.refs, function.shape.leaves, strict=True) if ref in names)
        taken = (
            self.takes(function, param) and self.reads(path) for param in function.shape.params for path in param.leaves
        )
        return [value if needed else 0.0 for value, needed in zip(s.args, taken, strict=True)]


def _leaves(function: Function) -> list[Path]:
    return [path for param in function.shape.params for path in param.leaves]
