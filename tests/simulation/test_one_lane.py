"""What is computed of several rows at once where one lane flies a built-in scenario, what is put into another order, and
what is prepared."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from starhold.loop.kernels import Numbers, make_step
from starhold.loop.programs import one
from starhold.parts.part import Fitted
from starhold.simulation.lane import fly
from starhold.trace.ordering import ordered
from starhold.trace.program import Call, Loop, Op, statements
from starhold.trace.rows import unrolled
from tests.making import built

STEPS = {
    # At most so many statements of a step, and at least so many rows that are computed with others.
    "cubesat-nadir": (3200, 190),
    "cubesat-mission": (3800, 199),
    "cubesat-detumble": (740, 86),
    "wheels-orbital": (1220, 32),
    "flexible-slew": (4500, 252),
    "geostationary": (1120, 0),
    "three-laws": (710, 0),
    "three-laws-noise": (1180, 6),
}


@cache
def program(name, by_rows=True):
    loop = built(name)
    return one(make_step(loop.composition()), loop.carry(), Numbers.of(loop.phases(1)[0]), loop.substeps, by_rows)


def step(program):
    """The statements of a control step."""
    (groups,) = (s for s in program.main.body if isinstance(s, Loop))
    (steps,) = (s for s in groups.body if isinstance(s, Loop))
    return steps.body


def rows(program):
    return sum(s.rows for s in statements(program.main.body) if isinstance(s, Call))


@pytest.mark.parametrize("name", STEPS)
def test_a_step_does_no_more_than_it_did(name):
    most, least = STEPS[name]
    assert len(step(program(name))) <= most
    assert rows(program(name)) >= least
    assert rows(program(name, by_rows=False)) == 0


@pytest.mark.parametrize("name", STEPS)
def test_the_page_computes_each_row_as_if_it_had_been_recorded_alone(name):
    alone, after = (
        sum(isinstance(s, Op) for s in statements(p.main.body)) for p in (program(name, False), unrolled(program(name)))
    )
    assert alone <= after <= alone + 3


@pytest.mark.parametrize("name", STEPS)
def test_all_but_the_flexible_panels_are_put_into_another_order(name):
    before, after = ([s.ref for s in step(p) if isinstance(s, Op)] for p in (program(name), ordered(program(name))))
    assert (before == after) is (name == "flexible-slew")
    assert sorted(before) == sorted(after)


def test_the_parts_of_a_loop_are_prepared_once_for_all_its_flights(monkeypatch):
    loop, prepared, prepare = replace(built("cubesat-nadir"), events=()), Counter(), Fitted.prepared

    def counted(self, period):
        prepared[self.called] += 1
        return prepare(self, period)

    monkeypatch.setattr(Fitted, "prepared", counted)
    first = fly(loop, 2)
    assert "drag" in prepared
    assert set(prepared.values()) == {1}
    assert np.array_equal(fly(loop, 2)[0], first[0])
    assert set(prepared.values()) == {1}
