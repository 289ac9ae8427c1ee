"""Parts that take equal numbers of the Earth's field compute it once in a kernel, and parts that do not each their own."""

import pytest

from starhold.algebra.structure import flatten
from starhold.laws.catalogue import catalogue
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import Numbers, fly_plainly, form, make_step
from starhold.loop.programs import many
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import fit
from starhold.parts.craft import make_craft
from starhold.simulation.lane import fly
from starhold.simulation.lanes import simulate_many
from starhold.trace.bounds import work
from tests.tiers import leading

ONE, OTHER = (2026.0, 3.0, 20.0, 12.0, 0.0, 0.0), (2027.0, 6.0, 1.0, 5.0, 0.0, 0.0)
FIELD = 900
"""Operations that the field takes at least."""


def loop_of(*epochs):
    """A magnetic body, with a dipole for each epoch."""
    law = catalogue()["pd"]
    dipoles = ((0.5, -0.2, 0.3), (-0.1, 0.4, 0.2))
    parts = [
        fit("environment", "residual-dipole", dipole, epoch, called=f"dipole {k}")
        for k, (dipole, epoch) in enumerate(zip(dipoles, epochs, strict=False))
    ]
    start = State((0.6, 0.0, 0.8, 0.0), (0.02, -0.03, 0.05), (6.9e6, 0.0, 1e5), (0.0, 5e3, 5.5e3), (0.0, 0.0, 0.0))
    around = (fit("environment", "two-body"), *parts)
    return ClosedLoop(make_craft((0.05, 0.06, 0.02)), law, law.examples()[0], start, 0.5, 2, parts=around)


def operations(loop):
    """Of a control step."""
    program = many(make_step(loop.composition()), loop.carry(), Numbers.of(loop.phases(1)[0]), loop.substeps, None)
    one, two = (work(program, {"first": 0, "blocks": 1, "width": 1, "count": n}).work.arithmetic for n in (1, 2))
    return two - one


def test_the_field_is_computed_once():
    single, same, apart = (operations(loop_of(*epochs)) for epochs in ([ONE], [ONE, ONE], [ONE, OTHER]))
    assert same - single < FIELD / 2 < FIELD < apart - single


@pytest.mark.slow
@pytest.mark.parametrize("epochs", leading([((ONE, OTHER),), ((ONE, ONE),), ((OTHER, ONE),), ((OTHER, OTHER),)]))
def test_every_machine_flies_the_epochs_it_is_given(epochs):
    """In any order: kernels are kept, and none serves numbers that are equal otherwise."""
    loop = loop_of(*epochs)
    plain = fly_plainly(loop, 20)
    assert flatten(fly(loop, 20)[1].state) == flatten(plain.state)
    assert flatten(simulate_many(loop, [loop.start] * 3, 20, threads=1).state(2)) == flatten(plain.state)


def test_the_form_of_numbers_says_which_are_equal():
    one, same, apart = (form(loop_of(*epochs).setup()) for epochs in ([ONE, ONE], [OTHER, OTHER], [ONE, OTHER]))
    assert one == same != apart
