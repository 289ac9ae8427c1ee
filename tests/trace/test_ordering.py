"""The order of statements: it changes none of them, and lets what does not wait go first."""

from collections import Counter
from itertools import pairwise

from hypothesis import given, settings

from starhold.algebra.structured import at, repeat
from starhold.trace.ordering import CROWDED, WINDOW, ordered
from starhold.trace.program import Branch, Load, Loop, Op, Store, reads, results, statements
from starhold.trace.recording import Recorder
from tests.trace.scripts import scripts, subject


def sound(block, known):
    """Every name is made before it is read."""
    for s in block:
        inner = (*s.head, *s.body) if isinstance(s, Loop) else s.body if isinstance(s, Branch) else ()
        if isinstance(s, (Loop, Branch)):
            first = (s.most, *(slot.before for slot in s.slots)) if isinstance(s, Loop) else (s.truth,)
            assert known.issuperset(x for x in first if isinstance(x, str))
            sound(inner, known | {s.counter, *(slot.name for slot in s.slots)} if isinstance(s, Loop) else known)
        else:
            assert known.issuperset(x for x in reads((s,)) if isinstance(x, str))
        known = known | {name for name, _ in results(s)}


@settings(max_examples=40)
@given(scripts)
def test_statements_are_the_same_and_each_comes_after_what_it_reads(script):
    program = subject(script).program()
    after = ordered(program)
    assert Counter(map(repr, leaves(after))) == Counter(map(repr, leaves(program)))
    assert [repr(s) for s in statements(after.main.body) if touches(s)] == [
        repr(s) for s in statements(program.main.body) if touches(s)
    ]
    sound(after.main.body, {name for name, _ in after.main.params})


def leaves(program):
    return [s for s in statements(program.main.body) if isinstance(s, (Op, Load, Store))]


def touches(s):
    return isinstance(s, (Load, Store))


def chains(count, length):
    """So many sums, each of which waits for itself alone, recorded one after the other; and a note in the last turn."""
    recorder = Recorder()
    with recorder.recording():
        given, out = recorder.memory("given"), recorder.memory("out", writable=True)

        def turn(k, *sums):
            made = []
            for total in sums:
                for _ in range(length):
                    total = total + given[0]
                made.append(total)
            at(k, 1, lambda: out.__setitem__(0, made[0]))
            return tuple(made)

        for place, total in enumerate(repeat(2, turn, *(given[k] for k in range(count)))):
            out[place] = total
    return recorder.program("chains")


def turn_of(program):
    (loop,) = (s for s in program.main.body if isinstance(s, Loop))
    return [s for s in loop.body if isinstance(s, Op) and s.operation.name == "plus"]


def test_chains_that_do_not_wait_for_each_other_go_side_by_side():
    before, after = (turn_of(program) for program in (chains(4, 30), ordered(chains(4, 30))))
    waits = [sum(b.args[0] == a.ref for a, b in pairwise(ops)) for ops in (before, after)]
    assert waits[0] == 4 * 29
    assert waits[1] <= 4


def test_no_more_is_drawn_forward_than_the_window():
    ops = turn_of(chains(4, WINDOW))
    places = {op.ref: k for k, op in enumerate(ops)}
    drawn = [places[op.ref] for op in turn_of(ordered(chains(4, WINDOW)))]
    ahead, first, begun = 0, 0, set()
    for place in drawn:
        ahead = max(ahead, place - first)
        begun.add(place)
        while first in begun:
            first += 1
    # Of the second chain something is begun with the first, of the third and the fourth nothing.
    assert 0 < ahead <= WINDOW + 1


def test_a_block_in_which_too_much_waits_already_stays_as_it_is():
    recorder = Recorder()
    with recorder.recording():
        given, out = recorder.memory("given"), recorder.memory("out", writable=True)

        def turn(_, x):
            numbers = [x]
            for _ in range(4 * CROWDED):
                numbers.append(numbers[-1] * given[1])
            total = x
            for number in numbers:
                total = total + number
            return (total,)

        out[0] = repeat(2, turn, given[0])[0]
    program = recorder.program("crowded")
    assert ordered(program) == program
