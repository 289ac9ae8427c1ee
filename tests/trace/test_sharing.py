"""A program that is split into what lanes share and what is their own leaves the bits of the whole."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from starhold.algebra.scalar import less, sqrt, where
from starhold.algebra.structured import repeat, when
from starhold.trace.bounds import work
from starhold.trace.program import Memory, Program
from starhold.trace.sharing import differing, split
from tests.tiers import fewer
from tests.trace.machines import Job, Subject, on_lanes, same
from tests.trace.scripts import CELLS, Script, scripts, turns, values

BLOCKS, WIDTH = 2, 8


def in_halves(program: Program, memories: dict[str, Any], counts: dict[str, int]) -> Any:
    """What both halves leave, one after the other."""
    shared, lane = split(program, counts["count"])
    more = {m.name: np.full(m.size, np.nan) for m in lane.memories if m.name not in memories}
    alone = {m.name: memories[m.name][:, :1] if m.lanes else (memories | more)[m.name] for m in shared.memories}
    handed = on_lanes(Job(shared, alone, counts))
    return on_lanes(Job(lane, memories | {name: handed[name] for name in more}, counts), WIDTH)["cells"]


@settings(
    max_examples=fewer(60), phases=[Phase.generate], suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)
@given(scripts, st.integers(0, 2**64 - 1), st.integers(0, 3))
def test_both_halves_leave_the_bits_of_the_whole(script: Script, seed: int, count: int) -> None:
    program, counts = turns(script).program(), {"blocks": BLOCKS, "count": count, "seed": seed}
    given = values(seed)
    cells = given["cells"].reshape(BLOCKS * CELLS, WIDTH)
    memories = {"cells": cells, "table": given["table"]}
    whole = on_lanes(Job(program, memories, counts), WIDTH)["cells"]
    same({"cells": whole}, {"cells": in_halves(program, memories, counts)}, "halves")


def laid(turn: Any) -> Program:
    """A loop over blocks of lanes in which each lane goes through turns from a shared number and one of its own."""

    def equation(cells: Any, table: Any, blocks: Any, count: Any, seed: Any, lane: Any) -> None:
        def block(b: Any) -> None:
            x, y = repeat(count, lambda k, x, y: turn(cells, table, k, x, y), table[0], cells[b])
            cells[b] = x + y

        repeat(blocks, block)

    memories = Memory("cells", True, True, 2), Memory("table", False, False, 3)
    return Subject(equation, memories, {"blocks": "index", "count": "index", "seed": "word"}).program()


def parts(program: Program) -> Any:
    """The work of the shared half and of a lane's, for one turn more."""
    found: list[Any] = []
    for half in split(program, 2):
        one, two = (work(half, {"blocks": 1, "count": count}).work for count in (1, 2))
        found.append({name: b - a for name, a, b in zip(one._fields, one, two, strict=True)})
    return found


def test_what_comes_from_shared_numbers_alone_is_computed_once() -> None:
    shared, lane = parts(laid(lambda cells, table, k, x, y: (sqrt(x * table[1]), y * (x / table[2]))))
    assert (shared["roots"], shared["divisions"], shared["multiplications"]) == (1, 1, 1)
    assert (lane["roots"], lane["divisions"], lane["multiplications"]) == (0, 0, 1)


def test_a_number_that_a_lane_moves_is_its_own() -> None:
    def turn(cells: Any, table: Any, k: Any, x: Any, y: Any) -> Any:
        # Its end differs, so it does from the second turn on.
        return where(less(y, 0.0), x, sqrt(x)), y

    program = laid(turn)
    assert "x" in differing(program)
    shared, lane = parts(program)
    assert (shared["roots"], lane["roots"]) == (0, 1)


@pytest.mark.parametrize("own", [False, True])
def test_a_branch_differs_where_its_condition_or_what_it_writes_does(own: bool) -> None:
    def turn(cells: Any, table: Any, k: Any, x: Any, y: Any) -> Any:
        (z,) = when(less(y if own else x, table[1]), lambda z: (sqrt(z),), x)
        return x, y * z

    shared, lane = parts(laid(turn))
    assert (shared["roots"], lane["roots"]) == ((0, 1) if own else (1, 0))
