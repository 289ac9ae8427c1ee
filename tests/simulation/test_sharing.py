"""What lanes share is flown once for all of them, what differs is not, and the arithmetic of a lane does not grow unseen."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.algebra.structure import flatten, unflatten
from starhold.loop.kernels import Numbers, make_step
from starhold.loop.programs import steady
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_names, builtin_text, load, parse
from starhold.simulation.lane import fly
from starhold.simulation.lanes import RunningBatch, carry_columns, simulate_many, stacked
from starhold.trace.bounds import work
from starhold.trace.program import Loop
from starhold.trace.sharing import split
from tests.making import built
from tests.texts import toml

STEP = {
    "cubesat-detumble": (1138, 21, 1941, 28),
    "cubesat-mission": (1846, 43, 3310, 42),
    "cubesat-nadir": (1440, 37, 3398, 33),
    "cubesat-slew": (513, 36, 2791, 50),
    "flexible-slew": (111, 1, 6012, 8),
    "geostationary": (215, 17, 796, 0),
    "l2-circle": (11, 1, 174, 2),
    "l2-deficit": (11, 1, 174, 2),
    "l2-equilibrium": (11, 1, 146, 0),
    "l2-nonlinear": (8, 3, 340, 26),
    "landing": (50, 1, 485, 1),
    "landing-limits": (50, 1, 485, 1),
    "three-laws": (152, 9, 478, 0),
    "three-laws-noise": (153, 9, 802, 12),
    "wheels-orbital": (238, 25, 1038, 0),
}
"""Of a control step of each built-in scenario's first law: sums and products, and divisions and roots, first those that all
lanes share, then those of each lane. Lanes differ in attitude and rate, or in position near a libration point. Numbers of a
change that needs fewer belong here."""

QUIET = (1440, 37, 2129, 17)
"""The same of cubesat-nadir where nothing that it may leave out is needed."""


def starts_of(loop, lanes=2):
    """Starts apart: the loop's own is the last."""
    rows = slice(0, 3) if loop.body.name == "libration-point" else slice(0, 7)
    starts = np.repeat(np.array(flatten(loop.start))[:, None], lanes, axis=1)
    starts[rows] = starts[rows] * np.linspace(0.5, 1.0, lanes) + np.linspace(1e-3, 0.0, lanes)
    return starts


def halves_of(loop, starts):
    """The shared program and that of a lane, and the places of what lanes keep alike."""
    alike = RunningBatch(loop, carry_columns(loop, starts), 0, 2).alike
    numbers = Numbers.of(loop.phases(1)[0])
    program, stay = steady(make_step(loop.composition()), alike, loop.carry(), numbers, loop.substeps, None)
    return split(program, 1), stay


def counted(halves):
    """The numbers of a step as `STEP` has them."""
    found = []
    for half in halves:
        one, two = (work(half, {"first": 0, "blocks": 1, "width": 1, "count": count}).work for count in (1, 2))
        step = {name: after - before for name, before, after in zip(one._fields, one, two, strict=True)}
        found += [step["additions"] + step["multiplications"], step["divisions"] + step["roots"]]
    return tuple(found)


@pytest.mark.parametrize("name", builtin_names())
def test_a_step_has_no_more_arithmetic_than_before(name):
    loop = built(name)
    found = counted(halves_of(loop, starts_of(loop))[0])
    assert all(now <= before for now, before in zip(found, STEP[name], strict=True)), found


def always(block):
    """What of a block is computed even where no branch is taken."""
    kept = []
    for s in block:
        if isinstance(s, Loop):
            s = s._replace(body=() if s.most == 1 else always(s.body))
        kept.append(s)
    return tuple(kept)


def test_ideal_bearings_the_shadow_steps_without_a_new_attitude_and_limits_of_dipoles_cost_a_lane_nothing():
    loop = built("cubesat-nadir")
    halves = halves_of(loop, starts_of(loop))[0]
    *functions, main = halves[1].functions
    quiet = halves[1]._replace(functions=(*functions, main._replace(body=always(main.body))))
    found = counted((halves[0], quiet))
    assert all(now <= before for now, before in zip(found, QUIET, strict=True)), found


def lanes_end_as_flights_alone(loops, starts, steps):
    """Compare lanes, each with the numbers of its loop, with the flights of the loops."""
    phases = stacked([loop.phases(steps) for loop in loops])
    batch = simulate_many(loops[0], starts, steps, phases=phases)
    assert len(np.unique(batch.states, axis=1)) == len(batch.states)
    for lane, loop in enumerate(loops):
        alone = replace(loop, start=unflatten(starts[: len(flatten(loop.start)), lane], loop.start))
        assert batch.states[:, lane].tolist() == flatten(fly(alone, steps, run=lane)[1][:2])[: len(batch.states)]


def three_laws():
    return built("three-laws", "lyapunov")


def test_an_orbit_that_differs_is_not_shared():
    loop = three_laws()
    starts, apart = starts_of(loop, 3), starts_of(loop, 3)
    apart[7] *= np.array([1.0, 1.01, 0.99])
    state = RunningBatch(loop, carry_columns(loop, starts), 0, 2).rows.state
    orbit = {*state.position, *state.velocity}
    assert orbit <= set(halves_of(loop, starts)[1])
    assert orbit.isdisjoint(halves_of(loop, apart)[1])
    lanes_end_as_flights_alone([loop] * 3, apart, 40)


def test_an_orbit_that_drag_moves_is_a_lanes_own():
    """Drag depends on the attitude, so only a force that moves the orbit makes lanes that differ in it part."""
    plates = {"type": "drag", "plates": [[1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]], "density": 1e-11}
    for moves, shared in (("no", True), ("yes", False)):
        scenario = load("three-laws").with_({"spacecraft.mass": 12.0, "part": [plates | {"moves_orbit": moves}]})
        loop = build(scenario, scenario.pick("lyapunov"))
        starts = starts_of(loop, 3)
        state = RunningBatch(loop, carry_columns(loop, starts), 0, 2).rows.state
        orbit = {*state.position, *state.velocity}
        stay = set(halves_of(loop, starts)[1])
        assert (orbit <= stay) if shared else orbit.isdisjoint(stay)
        lanes_end_as_flights_alone([loop] * 3, starts, 40)


def test_two_zeros_differ():
    loop = three_laws()
    starts = starts_of(loop)
    starts[7:] = 0.0
    starts[9] = 0.0, -0.0
    state = RunningBatch(loop, carry_columns(loop, starts), 0, 2).rows.state
    assert set(RunningBatch(loop, carry_columns(loop, starts), 0, 2).alike).isdisjoint(state.position[2:])


def test_lanes_that_part_late_are_shared_no_longer():
    """They start alike, without noise; a fault gives each another inertia, which turns the rates, and later one more."""
    faults = toml("""
[[fault]] time = 10; inertia = [[{0}, 0.2, -0.1], [0.2, 8.5, 0.3], [-0.1, 0.3, 5.5]]

[[fault]] time = 20; inertia = [[8.0, 0.2, -0.1], [0.2, 8.5, 0.3], [-0.1, 0.3, 5.5]]
""")
    text = builtin_text("wheels-orbital")
    loops = [built(parse(text + faults.format(7.0 + 0.1 * lane), "here")) for lane in range(3)]
    starts = np.repeat(np.array(flatten(loops[0].start))[:, None], 3, axis=1)
    lanes_end_as_flights_alone(loops, starts, round(30.0 / loops[0].period))


def test_a_flight_longer_than_a_chunk_goes_on_where_it_was(monkeypatch):
    loop = three_laws()
    starts = starts_of(loop, 20)
    whole = simulate_many(loop, starts, 100)
    monkeypatch.setattr("starhold.simulation.lanes.CHUNK", 7)
    assert np.array_equal(whole.states, simulate_many(loop, starts, 100, threads=3, width=4).states)
