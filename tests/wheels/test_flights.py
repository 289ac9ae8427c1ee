"""A spacecraft on reaction wheels, from the scenario file to the flight."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.parts.craft import make_craft
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, load, parse
from starhold.simulation.lane import fly, label
from tests.making import built, rotors
from tests.refusals import refused

BUILTIN = builtin_text("wheels-orbital")
LOST = "wheel = 2\nlost = true\ndelay = 5"
STRUCK = f"\n[[fault]]\ntime = 20\n{LOST}\n"


def flight(text, law=0, steps=None):
    scenario = parse(text, "here")
    loop = build(scenario, scenario.laws[law])
    samples, carry = fly(loop, scenario.table.simulation.steps if steps is None else steps)
    return scenario, loop, label(loop, samples, carry, 1)


def angle(recording):
    return 2.0 * np.degrees(np.arcsin(np.linalg.norm(recording["attitude_error"][:, 1:], axis=1)))


def test_the_builtin_scenario_holds_the_orbital_frame_on_its_first_run():
    scenario, loop, run = flight(BUILTIN)
    assert angle(run)[0] > 20.0
    # Held for good, by what is compensated: the frame turns and gravity pulls.
    assert angle(run)[3000:].max() < 0.01
    _, _, plain = flight(BUILTIN, law=1)
    assert 0.01 < angle(plain)[3000:].max() < 1.0
    limits = np.array(loop.wheels.torque_limit)
    assert (np.abs(run["wheel_torque"]) <= limits * (1.0 + 1e-12)).all()
    assert (np.abs(run["wheel_momentum"]) <= np.array(loop.wheels.momentum_limit)).all()
    assert wheels_of(scenario) is not None


def test_locked_rotors_fall_through_gravity_like_one_body():
    """Friction holds the rotors fast in a body that no law turns: it moves as the rigid body of the whole inertia."""
    text = BUILTIN.replace("inertia = 1.0e-3 ", "inertia = 1.0 ").replace('"10 min"', '"20 min"')
    text = text.replace("# viscous = 1e-6", 'viscous = "10 N m s"').replace('"pyramid"', '"nasa-standard"')
    text = text.replace("control_period = 0.1", "control_period = 0.1\nsubsteps = 2")
    loop = built(parse(text, "here"))
    # So small a limit leaves no torque of the law.
    idle = replace(loop, command_limit=5e-324, limit="axis")
    speeds = np.array(loop.wheels.axes) @ loop.start.rate
    carried = idle.with_parts(rotors(loop.wheels, speeds.tolist()))
    rigid = make_craft([6.0, 8.0, 5.0], 5e-324, loop.craft.gravity)
    bare = replace(idle.without("wheels"), craft=rigid)
    with_wheels, without = (label(each, *fly(each, 12_000), 1) for each in (carried, bare))
    apart = np.abs(with_wheels["rate"] - without["rate"]).max()
    assert apart < 1e-3 * np.ptp(without["rate"], axis=0).max()


def test_a_pyramid_that_loses_a_wheel_goes_on():
    _, _, whole = flight(BUILTIN)
    settled = {}
    for action in ("none", "reallocate", "retune", "both"):
        _, loop, run = flight(BUILTIN + STRUCK + f'action = "{action}"\n')
        assert len(loop.events) == (1 if action == "none" else 2)
        body = -run["wheel_torque"] @ np.array(loop.wheels.axes)
        assert np.abs(run["torque"] - body).max() < 1e-15
        lost = run["wheel_torque"][201:, 1]
        assert np.abs(lost).max() == 0.0
        left = np.flatnonzero(angle(run) > 0.1)
        settled[action] = (left[-1] + 1) * 0.1
    left = (np.flatnonzero(angle(whole) > 0.1)[-1] + 1) * 0.1
    assert 0.95 * left < settled["both"] < 1.6 * left
    assert 0.95 * left < settled["reallocate"] < settled["none"]
    assert settled["none"] > 2.0 * settled["both"]


def axes(*rows):
    return BUILTIN.replace('layout = "pyramid"', "", 1) + "".join(f"\n[[wheel]]\naxis = {row}\n" for row in rows)


def fault(lines, text=BUILTIN):
    return text + f"\n[[fault]]\ntime = 20\n{lines}\n"


UNTUNED = '\n[[law]]\ntype = "lyapunov"\nk_rate = 0.6\nk_attitude = 0.06\n'
ORTHOGONAL = BUILTIN.replace('"pyramid"', '"orthogonal"')


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BUILTIN.replace('layout = "pyramid"', 'layout = "ring"', 1), "wheels.layout"),
        (BUILTIN.replace('layout = "pyramid"', "", 1), "wheels.layout"),
        (BUILTIN.replace("inertia = 1.0e-3", "", 1), "wheel 1 has no inertia: give it, or a unit"),
        (BUILTIN.replace("inertia = 1.0e-3", 'unit = "RW-7"', 1), "no wheel unit 'RW-7'"),
        (axes([1, 0], [0, 1, 0], [1, 1, 1]), "wheel[1].axis"),
        (fault("wheel = 7\nlost = true"), "fault[1].wheel: found 7; allowed: 1 to 4"),
        (fault("wheel = 0\nlost = true"), "fault[1].wheel: found 0"),
        (fault("lost = true"), "fault[1].wheel"),
        (fault("wheel = 1"), "fault[1].lost"),
        (fault("wheel = 1\ntorque_limit = -1"), "fault[1].torque_limit"),
        (fault("wheel = 1\nlost = true\nmood = 3"), "fault[1].mood: found an unknown key"),
        (fault('wheel = 1\nlost = true\naction = "pray"'), "fault[1].action"),
        (fault(LOST).replace("= 20\n", "= 2000\n"), "fault[1].time: found 2000 s; allowed: at most 600 s"),
        (fault(LOST, ORTHOGONAL), "fault[1]: without wheel 2 the others give no torque about the body direction (0, 1, 0)"),
        (fault(LOST, load("three-laws").text), "fault[1]: found no wheels"),
    ],
)
def test_wheels_and_faults_that_cannot_be(text, said):
    with refused(said, start="here: "):
        flight(text, steps=1)


def test_a_law_that_cannot_be_retuned_is_told_what_to_do():
    with refused("law lyapunov", 'or fault_action = "reallocate" in its [[law]] table'):
        flight(fault(LOST, BUILTIN + UNTUNED), law=2, steps=1)


def test_single_wheels_take_what_they_share_and_their_own():
    text = axes([1, 0, 0], [0, 1, 0], [0, 0, 2]).replace('# momentum = "0.1 N m s"', "momentum = 0.1")
    text += 'torque_limit = 0.05\nmomentum = -0.2\nunit = "RW0"\n'
    scenario, loop, _ = flight(text, steps=1)
    assert wheels_of(scenario).axes[2] == (0.0, 0.0, 1.0)
    assert wheels_of(scenario).torque_limit == (0.02, 0.02, 0.05)
    assert wheels_of(scenario).momentum_limit == (0.4, 0.4, 0.02)
    assert loop.rotors == (0.1, 0.1, -0.2)
