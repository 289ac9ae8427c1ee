"""Laws of modes: each mode flies as its law alone would from there, and switches come when their conditions say."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from starhold.algebra.structure import flatten
from starhold.loop.kernels import fly_plainly
from starhold.loop.modes import loop_of_mode
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly, recorded
from starhold.simulation.lanes import simulate_many
from tests.making import built
from tests.missions import BASE, DETUMBLE, POINT
from tests.texts import toml


def loop_of(modes=DETUMBLE + POINT, text=BASE):
    return built(parse(text + modes, "mission.toml"))


def flown(loop, steps=600):
    samples, carry = fly(loop, steps)
    rows, row = {}, 0
    for name, _, size in recorded(loop):
        rows[name] = samples[row : row + size]
        row += size
    return rows, carry


def same_in_every_lane(loop, steps, factors=(1.0, 0.3)):
    """Each of many lanes, whose rates at the start are so many times as large, ends as its own flight, bit for bit."""
    starts = [loop.start._replace(rate=tuple(factor * w for w in loop.start.rate)) for factor in factors]
    many = simulate_many(loop, starts * 3, steps)
    for lane, start in enumerate(starts * 3):
        alone = fly(replace(loop, start=start), steps)[1]
        assert many.states[:, lane].tolist() == flatten((alone.state, alone.effectors))


def test_modes_fly_as_their_laws_one_after_another_from_the_switch():
    loop = loop_of()
    both, _ = flown(loop)
    switch = int(np.argmax(both["mode"][0] > 1.5))
    assert 50 < switch < 500
    assert (both["mode"][0][switch:] == 2.0).all()
    first, carry = flown(loop_of_mode(loop, 0), switch)
    second = loop_of_mode(loop, 1)
    # The quaternion's sign goes on where it was, as h is carried.
    then, _ = flown(replace(second, start=carry.state), 600 - switch)
    for name in ("attitude", "rate", "command"):
        joined = np.concatenate([first[name][:, :switch], then[name]], axis=1)
        assert joined.tobytes() == both[name].tobytes(), name


def test_a_dwell_is_counted_without_breaks_a_switch_leads_back_and_all_machines_agree():
    loop = loop_of(DETUMBLE + POINT + 'back = { rate_above = "1 deg/s" }\n')
    run, carry = flown(loop, 400)
    mode, held, wanted = 1.0, 0, list[float]()
    for now in np.degrees(np.linalg.norm(run["rate"], axis=0)):
        held = held + 1 if now < 0.5 else 0
        # So many instants span 2 s.
        mode, held = (2.0, 0) if mode == 1.0 and held == 21 else (1.0, 0) if mode == 2.0 and now > 1.0 else (mode, held)
        wanted.append(mode)
    assert run["mode"][0].tolist() == wanted
    # There and back again.
    assert {(1.0, 2.0), (2.0, 1.0)} <= set(pairwise(wanted))
    assert np.array(flatten(fly_plainly(loop, 400))).tobytes() == np.array(flatten(carry)).tobytes()
    same_in_every_lane(loop, 400, (1.0, 3.0, 0.05))


SUN = toml("""
[[law.mode]] name = "sun"; type = "lyapunov"; k_rate = 0.006; k_attitude = 0.0008
target = { mode = "inertial", angles = ["40 deg", "10 deg", "0 deg"] }; until = { after = "20 s" }
[[law.mode]] name = "nadir"; type = "lyapunov"; k_rate = 0.006; k_attitude = 0.0008; target = { mode = "orbital" }
""")
ORBIT = BASE.replace("[initial]", '[orbit]\naltitude = "500 km"\ninclination = "97 deg"\n[initial]')


def test_modes_with_targets_of_their_own_fly_as_their_laws_towards_them():
    loop = loop_of(SUN, ORBIT)
    both, _ = flown(loop, 300)
    assert both["mode"][0].tolist() == [1.0] * 200 + [2.0] * 101
    first, ended = flown(loop_of_mode(loop, 0), 200)
    second = replace(loop_of_mode(loop, 1), start=ended.state)
    assert (second.target.part.name, loop_of_mode(loop, 0).target.part.name) == ("orbital", "inertial")
    then, _ = flown(second, 100)
    # The quaternion of a target that follows may begin with the other sign, which the shorter way does not tell.
    for name in ("attitude", "rate", "command", "rate_error"):
        joined = np.concatenate([first[name][:, :200], then[name]], axis=1)
        assert joined.tobytes() == both[name].tobytes(), name


DELAYED = """
from typing import Annotated, Any, NamedTuple
from starhold.algebra.structured import Buffer
from starhold.algebra.vector import scale
from starhold.laws.interface import Card, Gain

CARD = Card(title="Delayed", summary="u = -k w, some calls ago", sources=("mine",), assumptions=("slow",), claims="none")


class Gains(NamedTuple):
    k: Annotated[float, Gain("N m s", above=0.0)]


class Memory(NamedTuple):
    past: Any
    sum: float


def remember(gains, craft, period):
    return Memory(Buffer([1e-4, 2e-4, 3e-4]), 0.0)


def torque(measurement, gains, craft, memory):
    first, past = memory.past[0], memory.past
    past[0], past[1], past[2] = past[1], past[2], -gains.k * measurement.rate[0]
    return (first, -gains.k * memory.sum, 0.0), Memory(past, memory.sum + measurement.rate[1])


def examples():
    return [Gains(0.01)]
"""
HOLD = toml("""
[[law.mode]] name = "hold"; file = "delayed.py"; k = 0.001; until = { after = "2 s", to = "turn" }
""")
TURN = toml("""
[[law.mode]] name = "turn"; type = "pd"; k_rate = 0.006; k_attitude = 0.0008; until = { after = "1 s", to = "hold" }
""")


def test_a_memory_and_its_buffers_begin_anew_each_time(tmp_path):
    (tmp_path / "delayed.py").write_text(DELAYED)
    loop = built(parse(BASE + TURN + HOLD, "mission.toml", tmp_path))
    both, carry = flown(loop, 60)
    assert both["mode"][0].tolist() == [1.0] * 10 + [2.0] * 20 + [1.0] * 10 + [2.0] * 20 + [1.0]
    state, done = loop.start, []
    for mode, steps in ((0, 10), (1, 20), (0, 10), (1, 20)):
        own, ended = flown(replace(loop_of_mode(loop, mode), start=state), steps)
        done.append(own["command"][:, :steps])
        state = ended.state
    assert np.concatenate(done, axis=1).tobytes() == both["command"][:, :60].tobytes()
    same_in_every_lane(loop, 60)
    assert flatten(fly_plainly(loop, 60).state) == flatten(carry.state)


RODS_THEN_WHEELS = toml("""
[[law.mode]] name = "detumble"; type = "b-dot"; k = 1e-3; effectors = ["magnetorquers"]; until = { after = "20 s" }
[[law.mode]] name = "point"; type = "lyapunov"; k_rate = 0.006; k_attitude = 0.0008
effectors = ["wheels", "magnetic-unloading"]
""")
CUBESAT = ORBIT.replace(
    "[simulation]",
    toml("""[wheels] layout = "pyramid"; inertia = 2.2e-5; torque_limit = "2 mN m"; momentum = "2 mN m s"
momentum_limit = "15 mN m s"; viscous = 1e-8
[[part]] type = "magnetometer"
[[part]] type = "magnetorquers"; dipole_limit = "0.2 A m^2"
[[part]] type = "magnetic-unloading"; gain = 1e-3; dipole_limit = "0.2 A m^2"
[simulation]"""),
).replace("torque_limit = 0.002\n", "")


def test_effectors_that_a_mode_does_without_rest_in_it():
    loop = loop_of(RODS_THEN_WHEELS, CUBESAT)
    both, _ = flown(loop, 230)
    first = flown(loop_of_mode(loop, 0), 200)[0]
    for name in ("attitude", "rate", "command", "magnetic_dipole", "wheel_momentum"):
        assert both[name][:, :200].tobytes() == first[name][:, :200].tobytes(), name
    dipole, unloading = (np.abs(both[name]).max(axis=0) for name in ("magnetic_dipole", "unloading_dipole"))
    assert (both["mode"][0] == 1.0).sum() == 200
    # The first sample of a mode shows what it begins with; B-dot needs a second reading before it acts.
    assert (dipole[2:200] > 0.0).all()
    assert (dipole[201:] == 0.0).all()
    assert (unloading[:200] == 0.0).all()
    assert (unloading[201:] > 0.0).all()
    asked = np.abs(both["wheel_command"]).max(axis=0)
    assert (asked[:200] == 0.0).all()
    assert (asked[201:] > 0.0).all()
    # Rotors that are asked for nothing coast down by their friction.
    assert (np.abs(np.diff(both["wheel_momentum"][:, :200], axis=1)) > 0.0).all()
