"""The order of a program's statements in which a processor waits least for results.

An equation is recorded operation by operation, so that in long stretches each waits for the one before. A processor looks
some hundreds of operations ahead; here as many more are looked through, and of what is ready the first comes first. The
operations, and so the bits, stay as they are.
"""

from heapq import heapify, heappop, heappush
from typing import Any

from starhold.trace.program import Block, Branch, Call, Load, Loop, Op, Program, Store, reads, results, statements

WINDOW, WIDTH = 400, 3
"""How many statements from the first one that waits are looked through, for what is made early needs a register until it is
used; and how many operations begin in a cycle."""
CROWDED = 80
"""So many results that wait for their use, on average, leave no room for more: their block stays as it is."""
LATENCIES = {"product": 3, "plus": 3, "minus": 3, "less": 3, "less_equal": 3, "select": 2, "divide": 13, "sqrt": 21}
"""Cycles in which present processors do an operation on numbers; one for all others."""
ROWS, AROUND = 9, 60
"""Cycles of a call of several rows, and of a loop within the block."""


def ordered(program: Program) -> Program:
    """Return the program with the statements of each block of its main function in such an order."""
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
                # What reads and writes memory keeps its order.
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
    """Return how many operations a statement is, and in how many cycles it is done."""
    if isinstance(s, Op):
        return 1, LATENCIES.get(s.operation.name, 1)
    if isinstance(s, Call):
        return len(s.function.body), ROWS
    return 1, 1 if isinstance(s, (Load, Store)) else AROUND
