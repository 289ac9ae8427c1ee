"""Recorders that compute an equation of many rows for several rows at once: in short vectors on one lane, operation by
operation on many lanes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from starhold.algebra.operations import NUMBER, TRUTH, WORD
from starhold.algebra.structure import leaves
from starhold.trace.handles import Handle
from starhold.trace.program import Block, Branch, Call, Function, Loop, Op, Program, Value, prune, renamed
from starhold.trace.recording import Recorder

ROWS = 8
"""Most rows computed at once: the numbers in the widest register."""


class LanesRecorder(Recorder):
    """A recorder for many lanes: it records `each` of `algebra.several` operation by operation across all rows. Operations
    of different rows do not wait for each other, and read shared numbers while these are in registers."""

    def each(self, equation: Callable[..., Any], rows: Sequence[Any], shared: Any) -> tuple[Any, ...]:
        """Record an equation for every row, side by side if it consists of operations alone."""
        block, out, parts = self._open[-1], list[Any](), list[list[Any]]()
        begin = len(block)
        for row in rows:
            out.append(equation(*row, *shared))
            parts.append(block[begin + sum(map(len, parts)) :])
        if all(isinstance(s, Op) for s in block[begin:]):
            block[begin:] = _side_by_side(parts)
        return tuple(out)


def _side_by_side(parts: list[list[Op]]) -> list[Op]:
    """Return the operations of all parts in turn, each after those whose results it reads."""
    waiting = {s.ref for part in parts for s in part}
    left, order = [deque(part) for part in parts], list[Op]()
    while waiting:
        for part in left:
            if part and waiting.isdisjoint(x for x in part[0].args if isinstance(x, str)):
                waiting.remove(part[0].ref)
                order.append(part.popleft())
    return order


class RowRecorder(Recorder):
    """A recorder of `each` of `algebra.several` as calls over several rows."""

    by_rows = True

    def each(self, equation: Callable[..., Any], rows: Sequence[Any], shared: Any) -> tuple[Any, ...]:
        """Record an equation for every row, up to `ROWS` at once if it consists of the same operations for all."""
        if not self.by_rows:
            return super().each(equation, rows, shared)
        out: list[Any] = []
        for first in range(0, len(rows), ROWS):
            some = [(*row, *shared) for row in rows[first : first + ROWS]]
            together = self._together(equation, some) if len(some) > 1 else None
            out += together or [equation(*row) for row in some]
        return tuple(out)

    def _together(self, equation: Callable[..., Any], rows: Sequence[Any]) -> list[Any] | None:
        """Return each row's result of a call over several rows; None where their forms differ, or the equation does more
        than operations on its arguments."""
        if len({self._form(row) for row in rows}) > 1:
            return None
        # No other name has a dot, so a value from outside that is no argument has none of these names.
        self.by_rows = False
        function, kept, out = self._define(equation, rows[0], ".")
        self.by_rows = True
        names = {name for name, _ in function.params}
        if any(kind not in (NUMBER, TRUTH, WORD) for _, kind in function.params):
            return None
        for s in function.body:
            if not isinstance(s, Op) or not names.issuperset(x for x in s.args if isinstance(x, str)):
                return None
            names.add(s.ref)
        given = ([value for leaf in leaves(row) for value in self._parts(leaf)] for row in rows)
        flat = [[value.ref if isinstance(value, Handle) else value for value in row] for row in given]
        columns = {name: [row[place] for row in flat] for (name, _), place in zip(function.params, kept, strict=True)}
        made = [(name, kind) for name, kind in dict.fromkeys(function.outs) if name in names and name not in columns]
        places: dict[Value, int] = {name: k for k, name in enumerate(columns)}
        likeness = self._likeness(function.body, places)
        key = (likeness, tuple(places[name] for name, _ in made), repr([*columns.values()]))
        known: Any = next((seen[key] for seen in self._seen if key in seen), None)
        if known is None:
            known = [[self._names.new("t") for _ in rows] for _ in made]
            refs = tuple((ref, kind) for (_, kind), column in zip(made, known, strict=True) for ref in column)
            args = tuple(value for column in columns.values() for value in column)
            self._open[-1].append(Call(refs, function, args, len(rows)))
            self._seen[-1][key] = known
        columns |= {name: column for (name, _), column in zip(made, known, strict=True)}
        return [
            self._handles(out, [(columns[x][k] if x in columns else x, kind) for x, kind in function.outs])
            for k in range(len(rows))
        ]


def unrolled(program: Program) -> Program:
    """Return the program with the operations of each row separate, for printers of other languages."""
    known: dict[str, Function] = {}

    def of(function: Function) -> Function:
        if function.name not in known:
            known[function.name] = function._replace(body=block(function.body, {}))
        return known[function.name]

    def block(given: Block, seen: dict[Any, str]) -> Block:
        made: list[Any] = []
        seen = dict(seen)
        for s in given:
            if isinstance(s, Loop):
                s = s._replace(head=block(s.head, seen), body=block(s.body, seen))
            elif isinstance(s, Branch):
                s = s._replace(body=block(s.body, seen))
            elif isinstance(s, Call) and s.rows == 1:
                s = s._replace(function=of(s.function))
            elif isinstance(s, Call):
                for row in range(s.rows):
                    made += _operations(s, row, seen)
                continue
            made.append(s)
        return tuple(made)

    functions = tuple(of(function) for function in program.functions)
    main = functions[-1]._replace(body=prune(functions[-1].body, ())[0])
    return program._replace(functions=(*functions[:-1], main))


def _operations(s: Call, row: int, seen: dict[Any, str]) -> list[Op]:
    """Return the operations of a row that are not among those of earlier rows."""
    function, made = s.function, list[Op]()
    names: dict[Value, Value] = {name: s.args[k * s.rows + row] for k, (name, _) in enumerate(function.params)}
    outs = [out for out in dict.fromkeys(function.outs) if out not in function.params and isinstance(out[0], str)]
    refs = {name: s.refs[k * s.rows + row][0] for k, (name, _) in enumerate(outs)}
    for k, op in enumerate(function.body):
        args = tuple(renamed(x, names) for x in op.args)
        key: Any = (op.operation.name, *(x if isinstance(x, str) else (type(x), repr(x)) for x in args))
        if op.ref not in refs and key in seen:
            names[op.ref] = seen[key]
            continue
        names[op.ref] = refs.get(op.ref, f"{s.refs[0][0]}r{row}n{k}")
        seen.setdefault(key, names[op.ref])
        made.append(Op(names[op.ref], op.operation, args))
    return made
