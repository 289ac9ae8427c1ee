"""Every loop gives the same bits in plain Python, on one lane, on every lane of many, in C and in JavaScript."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from starhold.algebra.structure import flatten
from starhold.loop.kernels import Arguments, Numbers, form, make_step, numbers_of, state_of
from starhold.loop.programs import one
from starhold.simulation.lane import fly
from starhold.simulation.lanes import simulate_many
from tests.simulation.loops import builtin, choices
from tests.tiers import drawn, fewer, of_the_day
from tests.trace.machines import LEVELS, Job, on_c, on_node

pytestmark = pytest.mark.usefixtures("optimised")
STEPS = 450
"""More than the last change of a flight with faults comes after."""

RUN = 3
COSTLY = 30
"""Steps of a law that solves a program at each, in plain Python."""

SLOW = pytest.mark.slow
"""Each compiler's other level, and what takes long to compile, is left to `make test-all`."""

BUILTIN = builtin()
LOOPS = BUILTIN | choices()


def is_costly(name: str) -> bool:
    return "mpc" in name


def steps_of(name: str) -> int:
    return COSTLY if is_costly(name) else STEPS if LOOPS[name].events else fewer(STEPS, 15)


def choices_of(loop: Any) -> set[Any]:
    """What a loop is made of: its law, its parts with what is constant in a kernel, and what it is told to do."""
    steps = ("in steps", loop.substeps > 1), ("changes", bool(loop.events)), ("watches", loop.law.flag("WATCHES"))
    made = [(f.part.name, getattr(f.params, "allocation", None)) for f in loop.parts]
    return {loop.law.name, loop.sign_policy, loop.limit, loop.body.name, *steps, *made}


def siblings() -> set[str]:
    """Loops that are made of nothing that one before lacks, those of many parts first: some for `make test-all`."""
    seen, found = set[Any](), set[str]()
    for name in sorted(LOOPS, key=lambda name: -len(LOOPS[name].parts)):
        own = choices_of(LOOPS[name])
        found |= {name} if own <= seen else set()
        seen |= own
    return found


ALIKE = siblings()
SIBLINGS = {*of_the_day(sorted(ALIKE), 12)}
"""Those of the day: what is compared of the others is compared of loops that are made of the same."""
TODAY = [name for name in LOOPS if name in SIBLINGS or name not in ALIKE]


class Leg(NamedTuple):
    """A phase of a flight in plain Python: what is carried into it, the sample of its last step, what is carried on."""

    phase: Any
    begun: Any
    sample: list[float]
    end: Any


@cache
def legs(name: str) -> list[Leg]:
    """The flight in plain Python."""
    loop, found = LOOPS[name], list[Leg]()
    step, key, carry = make_step(loop.composition()), (getattr(loop, "seed", 0), RUN), loop.carry()
    for phase in loop.phases(steps_of(name)):
        carry = phase.entered(carry)
        # Buffers change in place.
        begun = state_of(np.array(numbers_of(carry)), carry)
        sample: list[float] = []
        for k in range(phase.first, phase.last):
            carry = step.update(step.check(carry, k, phase.setup), k, key, phase.gains, phase.nominal, phase.setup)
            sample = flatten(step.sample(carry, k, phase.setup)) if k == phase.last - 1 else sample
            for _ in range(loop.substeps):
                carry = step.propagate(carry, phase.craft, phase.setup)
        carry = step.check(carry, phase.last, phase.setup)
        found.append(Leg(phase, begun, sample, carry))
    return found


def same(found: Any, expected: Any) -> None:
    assert np.array_equal(np.asarray(found).view(np.uint64), np.asarray(expected).view(np.uint64))


FLOWN = [pytest.param(name, marks=SLOW if name in SIBLINGS else ()) for name in TODAY]


@pytest.mark.parametrize("name", FLOWN)
def test_one_lane(name):
    same(numbers_of(fly(LOOPS[name], steps_of(name), run=RUN)[1]), numbers_of(legs(name)[-1].end))


EIGHT = [pytest.param(name, 8, marks=SLOW if name in SIBLINGS or name not in BUILTIN else ()) for name in TODAY]
LANES = [*EIGHT, *drawn([(name, 16) for name in LOOPS if not is_costly(name)], 15)]
"""Loops of built-in scenarios on eight lanes and one on sixteen; by `make test-all` those of the day on either."""


@pytest.mark.parametrize(("name", "width"), LANES)
def test_every_lane_of_many(name, width):
    loop = LOOPS[name]
    # Lanes differ in their starts, so that what is alike in all of them cannot hide a mixture; the last is the loop's own.
    start = np.array(flatten(loop.start))
    starts = np.repeat(start[:, None], width, axis=1)
    differs = slice(0, 3) if loop.body.name == "libration-point" else slice(4, 7)
    starts[differs] = starts[differs] * np.linspace(0.3, 1.0, width) + np.linspace(1e-3, 0.0, width)
    batch = simulate_many(loop, starts, steps_of(name), first_run=RUN - width + 1, width=width)
    same(batch.states[:, -1], numbers_of(legs(name)[-1].end)[: len(batch.states)])
    assert len(np.unique(batch.states[differs.start])) == width


@cache
def jobs(siblings: bool) -> list[tuple[Leg, Job]]:
    """Every leg of every flight as a job of the printed program, of the siblings or of all others."""
    programs, found = dict[Any, Any](), list[tuple[Leg, Job]]()
    for name in TODAY:
        loop = LOOPS[name]
        if (name in SIBLINGS) != siblings:
            continue
        for leg in legs(name):
            phase = leg.phase
            numbers = Numbers(phase.gains, phase.nominal, phase.craft, phase.setup)
            arguments, steps = Arguments(*numbers), phase.last - phase.first
            key = (loop.composition(), form(leg.begun), form(numbers), loop.substeps)
            if key not in programs:
                programs[key] = one(make_step(loop.composition()), leg.begun, numbers, loop.substeps)
            memories = {"carry": np.array(numbers_of(leg.begun)), "record": np.zeros(len(leg.sample))}
            memories |= {"shared": arguments.shared, "own": np.zeros(0), "tables": arguments.tables}
            counts = {"first": phase.first, "groups": 1, "each": steps, "place": steps - 1, "row": 0}
            counts |= {"seed": getattr(loop, "seed", 0), "run": RUN}
            found.append((leg, Job(programs[key], memories, counts)))
    return found


def compare(siblings: bool, results: list[Any]) -> None:
    for (leg, _), found in zip(jobs(siblings), results, strict=True):
        same(found["carry"], numbers_of(leg.end))
        same(found["record"], leg.sample)


PRINTED = pytest.mark.parametrize("siblings", [False, pytest.param(True, marks=SLOW)])


@pytest.mark.slow
@PRINTED
@pytest.mark.parametrize(
    ("compiler", "level"),
    [
        ("gcc", LEVELS[0]),
        pytest.param("clang", LEVELS[1], marks=SLOW),
        pytest.param("gcc", LEVELS[1], marks=SLOW),
        pytest.param("clang", LEVELS[0], marks=SLOW),
    ],
)
def test_c(compiler, level, siblings):
    compare(siblings, on_c([job for _, job in jobs(siblings)], compiler, *level))


@pytest.mark.slow
@PRINTED
def test_javascript(siblings):
    compare(siblings, on_node([job for _, job in jobs(siblings)]))
