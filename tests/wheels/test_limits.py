"""The limit that binds a spacecraft on wheels: what laws reckon with, what metrics count and pictures draw."""

import math
from types import ModuleType

import numpy as np
import pytest

from starhold.algebra.vector import ZERO
from starhold.analysis.rigid_body import METRICS, measure
from starhold.errors import InputError
from starhold.loop.kernels import fly_plainly, make_step
from starhold.parts.effectors.envelope import authority
from starhold.parts.effectors.wheel_arrays import MOST
from starhold.parts.effectors.wheels import allocate_peak, with_facets
from starhold.parts.part import Fitted, Part
from starhold.report.attitude_plots import collect
from starhold.scenario.bodies.rigid_body.craft import torque_limit
from starhold.scenario.bodies.rigid_body.faults import fault_times
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly
from starhold.studies.flight import Flight
from tests.making import built, flown, wheels_after
from tests.refusals import refused
from tests.texts import toml
from tests.tiers import leading

CRAFT = toml("""
name = "on wheels"
[spacecraft] inertia = [6.0, 8.0, 5.0]
{limit}
[initial] angles = ["120 deg", "-15 deg", "20 deg"]
[wheels] layout = "{layout}"; inertia = 1e-3; torque_limit = "20 mN m"; momentum_limit = "{momentum} N m s"
allocation = "{allocation}"
[simulation] duration = 60; control_period = 0.1
""")
STIFF = '\n[[law]]\ntype = "lyapunov"\nk_rate = 0.6\nk_attitude = 0.06\n'
GENTLE = '\n[[law]]\ntype = "lyapunov"\nk_rate = 0.1\nk_attitude = 0.005\n'
MPC = '\n[[law]]\ntype = "mpc"\nq_attitude = 0.2\nq_rate = 0.2\nr = 5.0\nlimit = "{kind}"\n'
LOST = "\n[[fault]]\ntime = 20\nwheel = 2\nlost = true\ndelay = 5\n"


def made(*parts, law=0, limit="", layout="pyramid", momentum=4.0, allocation="least-squares"):
    text = CRAFT.format(limit=limit, layout=layout, momentum=momentum, allocation=allocation) + "".join(parts)
    scenario = parse(text, "here")
    return scenario, build(scenario, scenario.laws[law])


def share_on_limit(run):
    return measure(run, 1e-3, 1e-3)["limit_share"]


@pytest.mark.parametrize("allocation", ["least-squares", "least-peak"])
def test_a_motor_at_its_torque_limit_counts_as_on_limit(allocation):
    _, loop = made(STIFF, allocation=allocation)
    run = flown(loop)
    at = (np.abs(run["wheel_torque"]) >= 0.02 * (1.0 - 1e-12)).any(axis=1)
    assert 0.02 < at.mean() < 0.5
    assert share_on_limit(run) == at.mean()
    # There the body gets less than what is asked, and elsewhere just that.
    short = np.abs(run["torque"] - run["command"]).max(axis=1) > 1e-12
    assert (short <= at).all()
    assert short.sum() > 0.8 * at.sum()
    assert share_on_limit(flown(made(GENTLE, allocation=allocation)[1])) == 0.0


def test_a_motor_that_its_momentum_stops_counts_as_on_limit():
    _, loop = made(GENTLE, momentum=0.02)
    run = flown(loop)
    assert np.abs(run["wheel_torque"]).max() < 0.02
    short = np.abs(run["torque"] - run["command"]).max(axis=1) > 1e-9
    assert short.mean() > 0.1
    assert share_on_limit(run) == pytest.approx(short.mean(), abs=0.02)


def test_a_lost_motor_counts_as_on_limit_as_long_as_torque_is_asked_of_it():
    run = flown(made(LOST, GENTLE + 'fault_action = "reallocate"\n')[1])
    assert (run["wheel_available"][200:, 1] == 0.0).all()
    assert share_on_limit(run) == 50 / 601
    assert share_on_limit(flown(made(LOST, GENTLE + 'fault_action = "none"\n')[1])) == 401 / 601


def test_what_a_motor_gives_is_what_is_asked_or_what_it_can():
    run = flown(made(STIFF, momentum=0.1)[1])
    given = np.sign(run["wheel_command"]) * np.minimum(np.abs(run["wheel_command"]), run["wheel_available"])
    fading = run["wheel_available"] < 0.02
    assert 0.0 < fading.mean() < 1.0
    np.testing.assert_allclose(run["wheel_torque"][~fading], given[~fading], rtol=0.0, atol=1e-16)
    assert (np.abs(run["wheel_torque"]) <= run["wheel_available"] * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("allocation", ["least-squares", "least-peak"])
@pytest.mark.parametrize("kind", ["axis", "norm", "none"])
def test_laws_see_the_lesser_of_their_limit_and_what_the_wheels_surely_give(kind, allocation):
    sure = authority(made(STIFF)[1].wheels, "norm" if kind == "norm" else "axis", peak=allocation == "least-peak")
    for given in (None, 0.01, 1.0):
        limit = f'limit = "{kind}"\n' + ("" if given is None else f"torque_limit = {given}")
        _, loop = made(STIFF, limit=limit, allocation=allocation)
        assert loop.craft.torque_limit == (sure if given is None or kind == "none" else min(sure, given))
        # What is cut off before it is shared out is what the file says, and nothing else.
        assert loop.setup().limit == (math.inf if given is None else given)


def test_the_command_is_cut_off_where_the_file_says():
    _, loop = made(STIFF, limit="torque_limit = 0.03")
    assert loop.craft.torque_limit < 0.03
    run = flown(loop)
    assert np.abs(run["command"]).max() == 0.03
    at = (np.abs(run["command"]) == 0.03).any(axis=1)
    assert share_on_limit(run) >= at.mean() > 0.0


@pytest.mark.parametrize("allocation", leading(["least-peak", "least-squares"]))
@pytest.mark.parametrize("kind", leading(["axis", "norm"]))
def test_mpc_plans_within_the_wheels_torque_and_after_a_loss_within_what_is_left(kind, allocation):
    law = MPC.format(kind=kind) + 'fault_action = "reallocate"\n'
    scenario, loop = made(LOST, law, limit=f'limit = "{kind}"', allocation=allocation)
    run = flown(loop)
    size = np.abs(run["command"]).max(axis=1) if kind == "axis" else np.linalg.norm(run["command"], axis=1)
    before, after = scenario.craft.torque_limit, loop.events[1].nominal.torque_limit
    assert after == torque_limit(scenario.table, loop.events[1].parts) < before
    assert size[:250].max() == pytest.approx(before, rel=1e-9)
    assert size[250:].max() <= after * (1.0 + 1e-12)
    told = np.delete(np.arange(601), np.arange(200, 250))
    assert (np.abs(run["wheel_command"][told]) <= 0.02 * (1.0 + 1e-9)).all()
    # Nothing is lost on the way from the command to the body.
    np.testing.assert_allclose(run["torque"][told], run["command"][told], rtol=0.0, atol=1e-15)


def test_a_lagging_torque_is_shared_out_as_it_changes():
    _, loop = made(STIFF, limit="actuator_lag = 0.3", allocation="least-peak")
    end = fly_plainly(loop, 12)
    assert fly(loop, 12)[1].effectors == end.effectors
    # A tenth of a second after the command, wheels have what the lag let through by then, not what is given at its end.
    first = fly_plainly(loop, 1)
    reached = allocate_peak(first.state.torque, with_facets(loop.wheels))
    assert np.abs(first.effectors[0].momentum).max() < 0.7 * 0.1 * np.abs(reached).max()


@pytest.mark.parametrize("allocation", ["least-squares", "least-peak"])
def test_a_held_torque_shared_out_once_is_that_shared_out_at_every_stage(allocation):
    _, loop = made(STIFF, allocation=allocation)
    held = ModuleType("held")
    vars(held).update(CARD=None, ROLE="actuator", rates=lambda *_: ZERO)
    idle = loop.with_parts(Fitted(Part("held", held)))
    once, always = make_step(loop.composition()), make_step(idle.composition())
    carry = once.update(loop.carry(), 0, (1, 0), loop.gains, loop.craft, loop.setup())
    after = always.propagate(carry, loop.craft, idle.setup())
    assert once.propagate(carry, loop.craft, loop.setup()) == after


@pytest.mark.parametrize(
    ("parts", "limit", "said"),
    [
        ((STIFF,), "", "torque that the wheels always give about all axes at once, "),
        ((STIFF,), "torque_limit = 0.01", "limit of each axis, 0.01 N m"),
        (
            (LOST, GENTLE + 'fault_action = "none"\n'),
            'limit = "norm"',
            "torque that the wheels always give in norm before a fault, ",
        ),
    ],
)
def test_pictures_draw_the_limit_that_binds_first(parts, limit, said):
    scenario, loop = made(*parts, limit=limit)
    run = flown(loop)
    plots = collect([Flight("one", "lyapunov", run, measure(run, 1e-3, 1e-3), {}, METRICS)], 1000, scenario)
    assert plots.torque.dashed.startswith(said)
    sure = scenario.craft.torque_limit
    assert f"{sure:g} N m" in plots.torque.dashed
    assert limit == 'limit = "norm"' or plots.torque.panels[0].levels == (-sure, sure)


# What each law does about faults.


def test_laws_that_can_be_retuned_compare_with_laws_that_cannot():
    own = '\n[[law]]\ntype = "wheel"\nform = "degree-of-stability"\ntorque = 0.01\nmomentum = 0.4\nangle = 2\nrate = 0\n'
    parts = (LOST, own, GENTLE + 'fault_action = "reallocate"\n', GENTLE + 'name = "unaware"\nfault_action = "none"\n')
    scenario, retuned = made(*parts)
    kept, unaware = (made(*parts, law=law)[1] for law in (1, 2))
    assert [event.gains == retuned.gains for event in retuned.events] == [True, False]
    assert [event.gains == kept.gains for event in kept.events] == [True, True]
    assert wheels_after(kept.events[1]) == wheels_after(retuned.events[1]) != unaware.wheels
    assert [event.step for event in unaware.events] == [200]
    assert fault_times(scenario) == (20.0, 25.0)
    # A law may ask for more than the fault does, too.
    silent = LOST + 'action = "none"\n'
    assert fault_times(made(silent, GENTLE)[0]) == (20.0,)
    assert [event.step for event in made(silent, GENTLE + 'fault_action = "reallocate"\n')[1].events] == [200, 250]


def test_fault_actions_that_cannot_be():
    with refused("law[1].fault_action: found \"pray\"; allowed: 'none', 'reallocate'"):
        made(LOST, GENTLE + 'fault_action = "pray"\n')
    with refused("found retune for law lyapunov"):
        made(LOST + 'action = "none"\n', GENTLE + 'fault_action = "retune"\n')


def test_a_law_whose_gains_do_not_fit_what_is_left_is_refused_before_it_flies():
    pd = '\n[[law]]\ntype = "pd"\nk_rate = 0.3\nk_attitude = 0.013\nlimit = "axis"\nfault_action = "{}"\n'
    with pytest.raises(InputError, match=r"law pd from 25 s .*needs k_attitude below the torque limit of 0\.011547 N m"):
        made(LOST, pd.format("reallocate"))
    assert made(LOST, pd.format("none"))[1].events[0].nominal.torque_limit > 0.013


def test_a_motor_that_is_diagnosed_to_give_nothing_is_lost():
    weak = LOST.replace("lost = true", "torque_limit = 0") + 'action = "reallocate"\n'
    assert wheels_after(made(weak, GENTLE)[1].events[1]) == wheels_after(
        made(LOST + 'action = "reallocate"\n', GENTLE)[1].events[1]
    )


def test_too_many_wheels_are_refused_in_one_line():
    axes = "".join(f"\n[[wheel]]\naxis = [1, {k}, {k * k}]\n" for k in range(MOST + 1))
    text = CRAFT.format(limit="", layout="", momentum=4.0, allocation="least-peak").replace('layout = ""\n', "")
    with pytest.raises(InputError, match=rf"^here: wheel: at most {MOST} wheels are taken, not {MOST + 1}$"):
        parse(text + axes + STIFF, "here")


@pytest.mark.parametrize("slow", ["actuator_lag = 0.3", "torque_rate_limit = 0.02"])
def test_a_command_on_the_limit_counts_though_the_actuator_lags_behind(slow):
    text = CRAFT.split("[wheels]", maxsplit=1)[0].format(limit=f"torque_limit = 0.01\n{slow}")
    run = flown(built(parse(text + "[simulation]\nduration = 60\n" + STIFF, "here")))
    at = (np.abs(run["command"]) == 0.01).any(axis=1)
    assert share_on_limit(run) == at.mean() > 0.1
