"""Straight-line programs give what the equations give that they were recorded from."""

import numpy as np
import pytest

from starhold.algebra.vector import ZERO
from starhold.laws.catalogue import catalogue
from starhold.laws.program import ASKED, law_program
from starhold.parts.craft import make_craft
from starhold.trace.straight_line import evaluated, straight_line

CRAFT = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]], torque_limit=0.05)


@pytest.mark.parametrize("name", ["pd", "lyapunov", "sliding", "lqr", "modal"])
def test_a_law_reads_back_as_it_is_called(name):
    law, random = catalogue()[name], np.random.default_rng(1)
    for gains in law.examples():
        program = law_program(law, gains, CRAFT, 0.1)
        states = random.normal(scale=0.1, size=(7, 20))
        states[:4] /= np.linalg.norm(states[:4], axis=0)
        memory = law.remember(gains, CRAFT, 0.1)

        def told(x):
            q, w = (tuple(part) for part in (x[:4], x[4:]))
            return ASKED["rigid-body"]._replace(attitude=q, rate=w, body_rate=w, period=0.1)

        expected = np.array([law.command(told(x.tolist()), gains, CRAFT, memory)[0] for x in states.T]).T
        columns = evaluated(program, measurement=told(states), gains=gains, craft=CRAFT)
        assert np.array_equal(np.broadcast_arrays(*columns, states[0])[:3], expected)


def test_numbers_that_no_column_reads_stay_numbers():
    program = straight_line(lambda a, b: (a[0] / 4.0, 2.0), a=ZERO, b=1.0)
    assert evaluated(program, a=(3.0, 0.0, 0.0), b=0.0) == [0.75, 2.0]
