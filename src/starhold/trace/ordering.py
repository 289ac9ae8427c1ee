"""Orders a program's statements so that a processor waits least for results.

An equation is recorded operation by operation, so in long stretches each waits for the one before. A processor looks some
hundreds of operations ahead; here a window of as many more is searched, and the first operation that is ready comes next.
The operations, and so the bits, are unchanged.
"""

from heapq import heapify, heappop, heappush
from typing import Any

from starhold.trace.program import Block, Branch, Call, Load, Loop, Op, Program, Store, reads, results, statements

WINDOW, WIDTH = 400, 3
"""How many statements are searched from the first one that waits (an early result needs a register until it is used), and
how many operations begin in a cycle."""
CROWDED = 80
"""Average number of results waiting for use above which registers are full, and the block keeps its order."""
LATENCIES = {"product": 3, "plus": 3, "minus": 3, "less": 3, "less_equal": 3, "select": 2, "divide": 13, "sqrt": 21}
"""Latencies of operations on numbers on present processors, in cycles; all others have one."""
ROWS, AROUND = 9, 60
"""Cycles assumed for a call over several rows, and for a loop within the block."""


def ordered(program: Program) -> Program:
    """Return the program with the statements of each block of its main function reordered."""
    main = program.main
    return program._replace(functions=(*program.functions[:-1], main._replace(body=_ordered(main.body))))


def _ordered(block: Block) -> Block:
    inner = [s._replace(body=_ordered(s.body)) if isinstance(s, (Loop, Branch)) else s for s in block]
    makers: dict[Any, int] = {}
    users: list[list[int]] = [[] for _ in inner]
    missing, ends = [0] * len(inner), [*range(len(inner))]
    last = -1
    for place, s in enumerate(inner):
        # Most statements are operations.
        single = isinstance(s, Op)
        before = {makers[name] for name in (s.args if single else reads((s,))) if name in makers}
        for other in before:
            ends[other] = place
        if single:
            makers[s.ref] = place
        else:
            makers.update((name, place) for name, _ in results(s))
            if _touches(s):
                # Statements that read or write memory keep their order.
                before |= {last} - {-1}
                last = place
        missing[place] = len(before)
        for other in before:
            users[other].append(place)
    if sum(end - place for place, end in enumerate(ends)) > CROWDED * len(inner):
        return tuple(inner)
    ready = [place for place, count in enumerate(missing) if not count]
    heapify(ready)
    coming, from_ = list[tuple[int, int]](), [0] * len(inner)
    order, begun = list[int](), [False] * len(inner)
    first = cycle = 0
    while len(order) < len(inner):
        while coming and coming[0][0] <= cycle:
            heappush(ready, heappop(coming)[1])
        room = WIDTH
        while room > 0 and ready and ready[0] < first + WINDOW:
            place = heappop(ready)
            order.append(place)
            begun[place] = True
            while first < len(inner) and begun[first]:
                first += 1
            size, cycles = _cost(inner[place])
            room -= size
            for user in users[place]:
                missing[user] -= 1
                from_[user] = max(from_[user], cycle + cycles)
                if not missing[user]:
                    heappush(coming, (from_[user], user))
        cycle += 1
    return tuple(inner[place] for place in order)


def _touches(s: Any) -> bool:
    """Return whether a statement reads or writes memory."""
    return any(isinstance(x, (Load, Store)) or (isinstance(x, Call) and x.rows == 1) for x in statements((s,)))


def _cost(s: Any) -> tuple[int, int]:
    """Return the number of operations of a statement, and its latency in cycles."""
    if isinstance(s, Op):
        return 1, LATENCIES.get(s.operation.name, 1)
    if isinstance(s, Call):
        return len(s.function.body), ROWS
    return 1, 1 if isinstance(s, (Load, Store)) else AROUND
