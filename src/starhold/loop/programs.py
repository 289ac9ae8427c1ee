"""Recorded programs that repeat the step of a closed loop: over one lane or many, a step at a time, over samples, and over
the calls of a law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from starhold.algebra.scalar import is_finite, less, where
from starhold.algebra.structure import flatten, mapped, move
from starhold.algebra.structured import Buffer, at, repeat
from starhold.algebra.words import number_of, whole_word, word_add, word_of
from starhold.loop.closed_loop import Composition
from starhold.loop.kernels import Arguments, Kernel, Numbers, Observer, form, make_step, numbers_of
from starhold.loop.step import Step
from starhold.parts.part import Part
from starhold.parts.random import Silent
from starhold.trace.program import Loop, Program, Store
from starhold.trace.recording import Cells, Recorder
from starhold.trace.rows import LanesRecorder, RowRecorder
from starhold.trace.sharing import differing, split

_HALVES: dict[Any, tuple[tuple[Kernel, Kernel], tuple[int, ...]]] = {}
CHUNK = 1024
"""Control steps for which the numbers common to all lanes are computed at once, before the lanes fly them."""


def _state(like: Any, cells: Cells, base: Any, known: dict[int, Any] | None = None) -> Any:
    """Return the state stored in memory from `base` on, in the order of `numbers_of`; known: numbers stored elsewhere, by
    index."""
    place, start = 0, len(flatten(like))

    def leaf(value: Any) -> Any:
        nonlocal place, start
        if isinstance(value, Buffer):
            start += value.size
            return Buffer(cells, base + start - value.size, value.size)
        here, place = place, place + 1
        return known[here] if known and here in known else cells[base + here]

    return mapped(like, leaf)


def _put(cells: Cells, base: Any, state: Any) -> None:
    for place, number in enumerate(flatten(state)):
        cells[base + place] = number


def one(step: Step, carry: Any, numbers: Numbers, substeps: int, by_rows: bool = False) -> Program:
    """Record the flight of one lane, or of a vector of lanes that draw the same random numbers: `groups` times `each`
    control steps from `first` on, with a sample of step `place` of every group, written from row `row` on. A lane stops
    when its motion diverges; its last carry stays in `carry`. by_rows: for one lane, `each` of `algebra.several` is
    recorded over several rows at once."""
    recorder = RowRecorder() if by_rows else Recorder()
    with recorder.recording():
        cells = recorder.memory("carry", lanes=True, writable=True)
        record = recorder.memory("record", lanes=True, writable=True)
        counts = [recorder.input(name, "index") for name in ("first", "groups", "each", "place", "row")]
        first, groups, each, place, row = counts
        key = (recorder.input("seed", "word"), recorder.input("run", "word"))
        gains, nominal, craft, setup = Arguments(*numbers).bound(recorder, 0)
        state = _state(carry, cells, 0)

        def lost(carry: Any) -> Any:
            return less(-1.0, carry.lost_at)

        def group(g: Any, carry: Any) -> Any:
            def turn(k: Any, carry: Any) -> Any:
                now = first + (g * each + k)
                updated = step.update(carry, now, key, gains, nominal, setup)

                def write() -> None:
                    sample = flatten(step.sample(updated, now, setup))
                    for i, number in enumerate(sample):
                        record[(row + g) * len(sample) + i] = number

                at(k, place, write)
                return (step.check(_propagated(step, updated, craft, setup, substeps), now + 1, setup),)

            return repeat(each, turn, carry, stop=lost)

        _put(cells, 0, repeat(groups, group, step.check(state, first, setup), stop=lost)[0])
    return recorder.program("fly", "Flies a closed loop.")


def many(
    step: Step,
    carry: Any,
    numbers: Numbers,
    substeps: int,
    observer: Observer | None,
    runs: Any = (),
    alike: tuple[int, ...] = (),
) -> Program:
    """Record the flight of many lanes: control steps first .. first+count-1 of every lane of `blocks` blocks of lanes, in
    place. Lane 0 is run number `run` and the others follow, or `runs` has each lane's number. The observer's notes are in
    `noted`. alike: indices of numbers of the carry that are equal in all lanes; they are in `common`, in this order."""
    recorder = LanesRecorder()
    with recorder.recording():
        cells = recorder.memory("carry", lanes=True, writable=True)
        common = recorder.memory("common")
        seen = recorder.memory("noted", lanes=True, writable=True)
        first, count, blocks, width = (recorder.input(name, "index") for name in ("first", "count", "blocks", "width"))
        seed, run = recorder.input("seed", "word"), recorder.input("run", "word")
        first_noted, more = ((), ()) if observer is None else (observer.first, observer.numbers)
        arguments = Arguments(*numbers, more, runs)

        def block(b: Any) -> None:
            gains, nominal, craft, setup, noting, own_run = arguments.bound(recorder, b * len(arguments.varying))
            along = word_add(word_add(run, word_of(b * width)), recorder.lane())
            key = (seed, along if isinstance(runs, tuple) else whole_word(own_run))
            base, place = b * len(numbers_of(carry)), b * len(flatten(first_noted))
            known = {row: common[k] for k, row in enumerate(alike)}
            state, noted = _state(carry, cells, base, known), _state(first_noted, seen, place)

            def turn(k: Any, carry: Any, noted: Any) -> Any:
                now = first + k
                updated = step.update(carry, now, key, gains, nominal, setup)
                after = step.check(_propagated(step, updated, craft, setup, substeps), now + 1, setup)
                if observer is not None:
                    noted = observer.note(noted, updated, after, now, setup, noting)
                return after, noted

            end, noted = repeat(count, turn, step.check(state, first, setup), noted)
            _put(cells, base, end)
            _put(seen, place, noted)

        repeat(blocks, block)
    return recorder.program("fly", "Flies many closed loops.")


class Given(NamedTuple):
    """A row of external data at a control instant: the readings of each sensor and, where they are finite, numbers of the
    body's state, of the effectors' states and of the acting command."""

    readings: Any
    state: Any
    effectors: Any
    command: Any


def replaying(step: Step, carry: Any, numbers: Numbers, substeps: int, like: Given) -> Program:
    """Record `count` control steps of one lane from `first` on, in which estimator and law process external readings.
    `given` has a row shaped as `like` for each step, `record` gets the step's sample with the law's own command. Numbers of
    the state that are not given are the estimated or measured ones, else those of the simulated motion."""
    recorder = Recorder()
    with recorder.recording():
        cells, record = (recorder.memory(name, lanes=True, writable=True) for name in ("carry", "record"))
        given = recorder.memory("given", lanes=True)
        first, count = recorder.input("first", "index"), recorder.input("count", "index")
        key = (recorder.input("seed", "word"), recorder.input("run", "word"))
        gains, nominal, craft, setup = Arguments(*numbers).bound(recorder, 0)

        def turn(k: Any, carry: Any) -> Any:
            row: Given = _state(like, given, k * len(flatten(like)))
            known = carry._replace(state=_finite(row.state, carry.state), effectors=_finite(row.effectors, carry.effectors))
            decided = step.update(known, first + k, key, gains, nominal, setup, seen=row.readings)
            _put_row(record, k, step.sample(decided, first + k, setup))
            command = _finite(row.command, decided.command)
            acting = step.update(known, first + k, key, gains, nominal, setup, command, row.readings)
            sources = (decided.memories.estimate, *row.readings)
            believed = {
                name: next((getattr(one, name) for one in sources if hasattr(one, name)), getattr(acting.state, name))
                for name in acting.state._fields
            }
            moving = acting._replace(state=_finite(row.state, acting.state._replace(**believed)))
            return (step.check(_propagated(step, moving, craft, setup, substeps), first + k + 1, setup),)

        _put(cells, 0, repeat(count, turn, _state(carry, cells, 0))[0])
    return recorder.program("replay", "Replays readings from outside.")


def _finite(given: Any, other: Any) -> Any:
    """Return the given numbers where they are finite, else the others, in the same structure."""
    source = iter(flatten(given))
    return mapped(other, lambda leaf: where(is_finite(number := next(source)), number, leaf))


def stepping(step: Step, carry: Any, numbers: Numbers, substeps: int, outside: bool) -> Program:
    """Record one control step, or none if `count` is 0, of each lane of `blocks` blocks of lanes. The law decides the
    command or, if `outside`, it is in `given`. The law's inputs at the end of the step are in `sensed`, the step's sample
    in `record`. Lane 0 is run number `run` and the others follow."""
    recorder = Recorder()
    with recorder.recording():
        cells, record, sensed = (recorder.memory(name, lanes=True, writable=True) for name in ("carry", "record", "sensed"))
        given = recorder.memory("given", lanes=True)
        now, count, blocks, width = (recorder.input(name, "index") for name in ("now", "count", "blocks", "width"))
        seed, run = recorder.input("seed", "word"), recorder.input("run", "word")
        arguments = Arguments(*numbers)
        carried, size = len(numbers_of(carry)), len(carry.command)

        def block(b: Any) -> None:
            gains, nominal, craft, setup = arguments.bound(recorder, 0)
            key = (seed, word_add(word_add(run, word_of(b * width)), recorder.lane()))
            command = tuple(given[b * size + i] for i in range(size)) if outside else None

            def turn(k: Any, carry: Any) -> Any:
                updated = step.update(carry, now + k, key, gains, nominal, setup, command)
                _put_row(record, b, step.sample(updated, now + k, setup))
                return (step.check(_propagated(step, updated, craft, setup, substeps), now + k + 1, setup),)

            end = repeat(count, turn, step.check(_state(carry, cells, b * carried), now, setup))[0]
            _put(cells, b * carried, end)
            _put_row(sensed, b, step.sense(end, now + count, key, gains, nominal, setup)[:3])

        repeat(blocks, block)
    return recorder.program("fly", "Flies a step of closed loops.")


def predicting(
    step: Step, sensors: Sequence[Part], made: Callable[..., tuple[Any, Numbers]], free: int, substeps: int, outside: bool
) -> tuple[Program, Program, Arguments]:
    """Record the flight predicted by `free` free numbers: the program that computes the carry from them, which `made`
    returns with the kernel's numbers, and one of `count` control steps from `first` on. All readings are in `record` and,
    if `outside`, all commands in `given`; then the law's memory does not change. step: see `silent` of `make_step`."""
    recorder = Recorder()
    with recorder.recording():
        cells, numbers = recorder.memory("carry", lanes=True, writable=True), recorder.memory("free", lanes=True)
        for place, number in enumerate(numbers_of(made([numbers[k] for k in range(free)])[0])):
            cells[place] = number
    begin, recorder = recorder.program("begin"), Recorder()
    with recorder.recording():
        cells, numbers = recorder.memory("carry", lanes=True, writable=True), recorder.memory("free", lanes=True)
        record, given = recorder.memory("record", lanes=True, writable=True), recorder.memory("given")
        first, count = recorder.input("first", "index"), recorder.input("count", "index")
        like, values = made([numbers[k] for k in range(free)])
        arguments = Arguments(*values)
        gains, nominal, craft, setup = arguments.bound(recorder, 0)

        def turn(k: Any, carry: Any) -> Any:
            now, state, memories = first + k, carry.state, carry.memories.sensors
            fitted = zip(sensors, memories, setup.sensors, strict=True)
            _put_row(record, now, tuple(s.module.measure(state, m, p, Silent(), now)[0] for s, m, p in fitted))
            command = tuple(given[now * 3 + i] for i in range(3)) if outside else None
            updated = step.update(carry, now, (0, 0), gains, nominal, setup, command)
            return (_propagated(step, updated, craft, setup, substeps),)

        begun = _state(like, cells, 0)
        end = repeat(count, turn, begun)[0]
        _put(cells, 0, end._replace(memory=begun.memory) if outside else end)
    return begin, recorder.program("predict"), arguments


def _put_row(cells: Cells, row: Any, values: Any) -> None:
    _put(cells, row * len(flatten(values)), values)


def steady(step: Step, alike: tuple[int, ...], *arguments: Any) -> tuple[Program, tuple[int, ...]]:
    """Return the program many(step, *arguments) with `alike` reduced to the indices at which the carry is equal in all
    lanes both before the flight and after it, and those indices."""
    while True:
        program = many(step, *arguments, alike=alike)
        names, (block,) = differing(program), [s for s in program.main.body if isinstance(s, Loop)]
        ends = [s.value for s in block.body if isinstance(s, Store) and s.memory == "carry"]
        stay = tuple(row for row in alike if ends[row] not in names)
        if stay == alike:
            return program, alike
        alike = stay


def make_halves(
    parts: Composition, width: int, alike: tuple[int, ...], *arguments: Any
) -> tuple[tuple[Kernel, Kernel], tuple[int, ...]]:
    """Return the kernels of `steady`, one for the values common to all lanes and one for a lane's own, and the reduced
    `alike`. They are called one after the other for at most `CHUNK` control steps."""
    key = (parts, width, form(arguments))
    if (*key, alike) not in _HALVES:
        program, stay = steady(make_step(parts), alike, *arguments)
        if (*key, stay) not in _HALVES:
            shared, lane = split(program, CHUNK)
            _HALVES[*key, stay] = (Kernel(shared, 1), Kernel(lane, width)), stay
        _HALVES[*key, alike] = _HALVES[*key, stay]
    return _HALVES[*key, alike]


def _propagated(step: Step, carry: Any, craft: Any, setup: Any, substeps: int) -> Any:
    """Return the carry after the substeps of a control step."""
    if substeps == 1:
        return step.propagate(carry, craft, setup)
    return repeat(substeps, lambda _, carry: (step.propagate(carry, craft, setup),), carry)[0]


def over_samples(
    note: Callable[..., Any], first: Any, numbers: tuple[Any, Any], columns: tuple[tuple[str, tuple[int, ...]], ...]
) -> Program:
    """Record the program that takes notes of `count` samples in `record`, from the instant `first` on, in `noted`.

    note(noted, quantities, instant, limit, numbers) -> noted; first: the shape of the notes; numbers: arguments of `note`,
    and the limit; columns: the recorded quantities with their shapes, () or (components,), in order."""
    recorder = Recorder()
    with recorder.recording():
        record, noted = recorder.memory("record"), recorder.memory("noted", writable=True)
        begin, count = recorder.input("first", "index"), recorder.input("count", "index")
        given, limit = Arguments(*numbers).bound(recorder, 0)
        width = sum(shape[0] if shape else 1 for _, shape in columns)

        def turn(k: Any, seen: Any) -> Any:
            place, quantities = k * width, dict[str, Any]()
            for name, shape in columns:
                values = tuple(record[place + i] for i in range(shape[0] if shape else 1))
                quantities[name], place = values if shape else values[0], place + len(values)
            return (note(seen, quantities, number_of(begin + k), limit, given),)

        _put(noted, 0, repeat(count, turn, _state(first, noted, 0))[0])
    return recorder.program("note", "Takes notes of samples.")


def replay(step: Step, carry: Any, numbers: Numbers) -> Program:
    """Record the control calls of a run for timing: updates on the states first .. first+count-1, one after another."""
    recorder = Recorder()
    with recorder.recording():
        cells, states = recorder.memory("carry", lanes=True, writable=True), recorder.memory("states")
        first, count = recorder.input("first", "index"), recorder.input("count", "index")
        key = (recorder.input("seed", "word"), recorder.input("run", "word"))
        gains, nominal, _, setup = Arguments(*numbers).bound(recorder, 0)
        like = (carry.state, carry.effectors)
        begun, width = _state(carry, cells, 0), len(flatten(like))

        def turn(k: Any, carry: Any) -> Any:
            # Each call waits for the torque of the previous call.
            u = carry.command
            wait = 0.0 * (u[0] + u[1] + u[2])
            state, effectors = _state(like, states, (first + k) * width)
            carry = carry._replace(state=move(state, wait, state), effectors=effectors)
            return (step.update(carry, first + k, key, gains, nominal, setup),)

        _put(cells, 0, repeat(count, turn, begun)[0])
    return recorder.program("replay", "Repeats the control calls of a run.")
