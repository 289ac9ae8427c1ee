"""Splits a program of many lanes in two, so that values common to all lanes are computed once: the shared part runs first
and stores a row of numbers for each iteration of the loop, which the lane's part reads.

A value differs between lanes if it depends on the number of the lane or of its block, on a lane's own memory, or on another
such value. Only numbers are stored: truths, words and indices are cheap, and are computed in both parts.
"""

from starhold.algebra.operations import NUMBER, OPERATIONS
from starhold.trace.program import (
    Block,
    Call,
    Load,
    Loop,
    Memory,
    Op,
    Program,
    Store,
    Value,
    live_names,
    prune,
    results,
    statements,
    writes,
)

ROWS, ENDS = "rows", "ends"
"""Memories between the parts: the numbers of each iteration, row after row, and those after the last one."""


def differing(program: Program) -> set[Value]:
    """Return the names of the values that differ between the lanes of a program that is a loop over blocks of lanes."""
    of_lanes = {memory.name for memory in program.memories if memory.lanes}
    blocks, place = _loops(program)
    names, before = {blocks.counter}, -1
    # The values at the end of an iteration are those at the start of the next.
    while before != (before := len(names)):
        for s in statements(program.main.body):
            if isinstance(s, Op):
                if s.operation.name == "lane" or not names.isdisjoint(s.args):
                    names.add(s.ref)
            elif isinstance(s, Load):
                if s.memory in of_lanes or s.index in names:
                    names.add(s.ref)
            elif isinstance(s, Call):
                names.update(name for name, _ in s.refs)
            elif isinstance(s, Loop):
                # A block that writes for each lane stays in the lane's part as a whole.
                apart = s is not blocks and s is not blocks.body[place] and writes(s.body)
                for slot in s.slots:
                    if apart or not names.isdisjoint((s.most, s.done, slot.before, slot.after)):
                        names.update((slot.name, slot.end))
    return names


def split(program: Program, most: int) -> tuple[Program, Program]:
    """Split a loop over blocks of lanes, which contains a loop of a given count of at most `most` iterations. Return the
    program of the values common to all lanes, which runs first, and that of a lane."""
    names, (blocks, place), main = differing(program), _loops(program), program.main
    loop: Loop = blocks.body[place]
    before, after = blocks.body[:place], blocks.body[place + 1 :]
    around = tuple(s for s in main.body if s is not blocks)

    def same(block: Block) -> Block:
        """Return the part of a block that is common to all lanes; a loop keeps the slots that all share."""
        shared = (
            s._replace(slots=tuple(slot for slot in s.slots if slot.name not in names)) if isinstance(s, Loop) else s
            for s in block
            if not writes((s,))
        )
        return tuple(s for s in shared if (made := results(s)) and names.isdisjoint(name for name, _ in made))

    slots = [slot for slot in loop.slots if slot.name not in names and slot.kind == NUMBER]
    wholly = (results(s) for s in loop.body if s in same((s,)) and not isinstance(s, Load))
    moved = {name for made in wholly if all(kind == NUMBER for _, kind in made) for name, _ in made}

    def lane(handed: list[str], last: list[str]) -> Block:
        body = tuple(s for s in loop.body if moved.isdisjoint(name for name, _ in results(s)))
        loads = (Load(name, ROWS, f"row.{k}") for k, name in enumerate(handed))
        differ = tuple(slot for slot in loop.slots if slot not in slots)
        turn = loop._replace(slots=differ, body=(*_places(loop, len(handed)), *loads, *body))
        ends = (Load(name, ENDS, k) for k, name in enumerate(last))
        return (*around, blocks._replace(body=(*before, turn, *ends, *after)))

    handed, last = [*(slot.name for slot in slots), *sorted(moved)], [slot.end for slot in slots]
    live = live_names(lane(handed, last), ())
    handed, last = [name for name in handed if name in live], [name for name in last if name in live]
    rows = (Store(ROWS, f"row.{k}", name) for k, name in enumerate(handed))
    turn = loop._replace(
        slots=tuple(slot for slot in loop.slots if slot.name not in names),
        body=(*same(loop.body), *_places(loop, len(handed)), *rows),
    )
    ends = (Store(ENDS, k, name) for k, name in enumerate(last))
    sizes = {ROWS: most * len(handed), ENDS: len(last)}

    def part(body: Block, writable: bool) -> Program:
        between = (Memory(name, False, writable, size) for name, size in sizes.items())
        functions = (*program.functions[:-1], main._replace(body=prune(body, ())[0]))
        return Program(functions, (*program.memories, *between))

    return part((*around, *same(before), turn, *ends), True), part(lane(handed, last), False)


def _loops(program: Program) -> tuple[Loop, int]:
    """Return the loop over blocks of lanes, and the index in its body of the loop of each lane."""
    (blocks,) = (s for s in program.main.body if isinstance(s, Loop))
    counts = {name for name, _ in program.main.params}
    return blocks, next(k for k, s in enumerate(blocks.body) if isinstance(s, Loop) and s.most in counts)


def _places(loop: Loop, width: int) -> list[Op]:
    """Return the indices of the numbers in an iteration's row; no other name has a dot."""
    begin = Op("row.", OPERATIONS["index_product"], (loop.counter, width))
    return [begin, *(Op(f"row.{k}", OPERATIONS["index_plus"], ("row.", k)) for k in range(width))]
