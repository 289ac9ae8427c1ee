"""A trace is a tree of blocks; a block is a list of operations, loads, stores, loops, branches and calls."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

from starhold.algebra.operations import NUMBER, Operation

Value: TypeAlias = Any
"""The name of an earlier statement's result (a str), or a constant (a float, bool or int)."""


class Op(NamedTuple):
    """An operation: ref = operation(args)."""

    ref: str
    operation: Operation
    args: tuple[Value, ...]


class Load(NamedTuple):
    """A load: ref = memory[index]."""

    ref: str
    memory: str
    index: Value


class Store(NamedTuple):
    """A store: memory[index] = value."""

    memory: str
    index: Value
    value: Value


class Slot(NamedTuple):
    """A variable of a loop, called `name` in the loop and `name_` after it; `before` is its value before the first
    iteration, `after` its value at the end of each."""

    name: str
    kind: str
    before: Value
    after: Value

    @property
    def end(self) -> str:
        """The name of its value after the loop."""
        return self.name + "_"


class Loop(NamedTuple):
    """A loop repeats the body at most `most` times, or until `done`, which `head` computes, holds at the start of an
    iteration."""

    counter: str
    most: Value
    slots: tuple[Slot, ...]
    head: tuple[Any, ...]
    done: Value | None
    body: tuple[Any, ...]


class Branch(NamedTuple):
    """A branch runs the body if a truth that all lanes share holds."""

    truth: Value
    body: tuple[Any, ...]


class Call(NamedTuple):
    """A call: refs = function(args). A call over several rows applies the function to each, all at once in short vectors:
    args has the values of a parameter in all rows side by side, and refs those of a result."""

    refs: tuple[tuple[str, str], ...]
    function: Function
    args: tuple[Value, ...]
    rows: int = 1


Block: TypeAlias = tuple[Any, ...]


class Function(NamedTuple):
    """A function: a block, its parameters and results as pairs of a name (or constant) and a kind; shape: how printers
    group them."""

    name: str
    doc: str
    params: tuple[tuple[str, str], ...]
    body: Block
    outs: tuple[tuple[Value, str], ...]
    shape: Any = None


class Memory(NamedTuple):
    """Memory passed to a program: a block of numbers for each lane, or one for all; `size` if it is known."""

    name: str
    lanes: bool
    writable: bool
    size: int | None = None


class Program(NamedTuple):
    """A program: its functions in order of definition, of which the last is run, and its memories in order."""

    functions: tuple[Function, ...]
    memories: tuple[Memory, ...]

    @property
    def main(self) -> Function:
        """The function that is run, which is the last."""
        return self.functions[-1]

    def memory(self, name: str) -> Memory:
        """Return the memory of this name."""
        return next(memory for memory in self.memories if memory.name == name)


def statements(block: Block) -> Iterator[Any]:
    """Yield all statements of a block and of those within it, but not of the functions it calls."""
    blocks = [iter(block)]
    while blocks:
        for s in blocks[-1]:
            yield s
            if isinstance(s, (Loop, Branch)):
                blocks.append(chain(s.head, s.body) if isinstance(s, Loop) else iter(s.body))
                break
        else:
            blocks.pop()


def results(s: Any) -> list[tuple[str, str]]:
    """Return the names and kinds of a statement's results."""
    if isinstance(s, Op):
        return [(s.ref, s.operation.gives)]
    if isinstance(s, Load):
        return [(s.ref, NUMBER)]
    return [(slot.end, slot.kind) for slot in s.slots] if isinstance(s, Loop) else list(getattr(s, "refs", ()))


def reads(block: Block) -> Iterator[Value]:
    """Return the names and constants that a block reads, with repetitions."""
    for s in statements(block):
        if isinstance(s, (Op, Call)):
            yield from s.args
        elif isinstance(s, Load):
            yield s.index
        elif isinstance(s, Store):
            yield from (s.index, s.value)
        elif isinstance(s, Branch):
            yield s.truth
        else:
            yield from (s.most, s.done, *(x for slot in s.slots for x in (slot.before, slot.after)))


def writes(block: Block) -> bool:
    """Return whether a block, or a function that it calls, writes to memory."""
    return any(isinstance(s, Store) or (isinstance(s, Call) and writes(s.function.body)) for s in statements(block))


def prune(block: Block, outs: Iterable[Value]) -> tuple[Block, dict[str, Value]]:
    """Return the block without operations and slots that are never read, and with slots that never change replaced by their
    values; and the values that replace their names."""
    wanted, names = set(outs), dict[str, Value]()
    # An inner loop may show that a slot of the outer loop never changes either.
    while any(_settles(slot) for s in statements(block) if isinstance(s, Loop) for slot in s.slots):
        settled: dict[str, Value] = {}
        block = _settled(block, settled)
        wanted = {renamed(out, settled) for out in wanted}
        names = {name: renamed(value, settled) for name, value in names.items()} | settled
    return pruned(block, live_names(block, wanted)), names


def single_turns(function: Function) -> Function:
    """Return the function with the slots of loops of one iteration replaced by their values: such a loop is a branch, and
    values read only by its slots are removed."""
    names: dict[str, Value] = {}
    for s in statements(function.body):
        if isinstance(s, Loop) and s.most == 1:
            names[s.counter] = 0
            names.update({slot.name: renamed(slot.before, names) for slot in s.slots})
    body, more = prune(_settled(function.body, names), [out for out, _ in function.outs])
    names = {name: renamed(value, more) for name, value in names.items()} | more
    return function._replace(body=body, outs=tuple((renamed(out, names), kind) for out, kind in function.outs))


def renamed(value: Value, names: dict[str, Value]) -> Value:
    """Return the value that stands for this one."""
    return names.get(value, value) if isinstance(value, str) else value


def _settled(block: Block, names: dict[str, Value]) -> Block:
    """Return the block with slots that never change replaced by their values, which are added to `names`."""
    result: list[Any] = []
    for s in block:
        if isinstance(s, (Op, Call)):
            if not names.keys().isdisjoint(s.args):
                s = s._replace(args=tuple(renamed(x, names) for x in s.args))
        elif isinstance(s, Loop):
            slots = [slot._replace(before=renamed(slot.before, names)) for slot in s.slots]
            for slot in slots:
                if _settles(slot):
                    names[slot.name] = names[slot.end] = slot.before
            head, body = _settled(s.head, names), _settled(s.body, names)
            kept = tuple(slot._replace(after=renamed(slot.after, names)) for slot in slots if slot.end not in names)
            s = Loop(s.counter, renamed(s.most, names), kept, head, renamed(s.done, names), body)
        elif isinstance(s, Branch):
            s = Branch(renamed(s.truth, names), _settled(s.body, names))
        elif isinstance(s, Load):
            s = s._replace(index=renamed(s.index, names))
        else:
            s = Store(s.memory, renamed(s.index, names), renamed(s.value, names))
        result.append(s)
    return tuple(result)


def _settles(slot: Slot) -> bool:
    """Return whether no iteration changes a slot."""
    after, before = slot.after, slot.before
    return after == slot.name or (not isinstance(after, str) and type(after) is type(before) and repr(after) == repr(before))


def live_names(block: Block, outs: Iterable[Value]) -> set[Value]:
    """Return the names on which the results, or anything written to memory, depend."""
    makers, names, todo = dict[Value, tuple[Value, ...]](), set[Value](), [*outs]
    for s in statements(block):
        if isinstance(s, Loop):
            for slot in s.slots:
                makers[slot.name] = makers[slot.end] = (s.most, s.done, slot.before, slot.after)
            if writes((s,)):
                todo += (s.most, s.done)
        elif isinstance(s, Branch):
            if writes((s,)):
                todo.append(s.truth)
        elif isinstance(s, Store) or (isinstance(s, Call) and writes((s,))):
            todo += reads((s,))
        else:
            read = (s.index,) if isinstance(s, Load) else s.args
            makers.update((ref, read) for ref in _refs(s))
    while todo:
        name = todo.pop()
        if name not in names:
            names.add(name)
            todo += makers.get(name, ())
    return names


def _refs(s: Op | Load | Call) -> list[str]:
    return [ref for ref, _ in s.refs] if isinstance(s, Call) else [s.ref]


def pruned(block: Block, names: set[Value]) -> Block:
    """Return the block without statements that compute none of these names."""
    result: list[Any] = []
    for s in block:
        if isinstance(s, Loop):
            slots = tuple(slot for slot in s.slots if {slot.name, slot.end} & names)
            s = s._replace(slots=slots, head=pruned(s.head, names), body=pruned(s.body, names))
            if not slots and not writes(s.body):
                continue
        elif isinstance(s, Branch):
            s = s._replace(body=pruned(s.body, names))
            if not writes(s.body):
                continue
        elif isinstance(s, Call):
            if not writes((s,)) and names.isdisjoint(_refs(s)):
                continue
        elif isinstance(s, (Op, Load)) and s.ref not in names:
            continue
        result.append(s)
    return tuple(result)
