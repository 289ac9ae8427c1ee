"""A craft whose inertia changes in flight, with wheels and without: what the body does and what the law knows."""

import numpy as np
import pytest

from starhold.algebra.quaternion import to_reference
from starhold.algebra.vector import ZERO
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.craft import make_craft, tensor
from starhold.parts.effectors.envelope import authority
from starhold.scenario.bodies.rigid_body.craft import craft_with, torque_limit, wheels_of
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, parse
from starhold.simulation.lane import fly, label
from starhold.studies.certificates import certify_scenario
from tests import small
from tests.making import wheels_after
from tests.refusals import refused

WHEELS = builtin_text("wheels-orbital").replace("gravity_gradient = true", "gravity_gradient = false")
PLAIN = small.CRAFT.replace("rate = [0, 0, 0]", "rate = [0.03, -0.02, 0.04]").replace("duration = 5.0", "duration = 30.0")
LYAPUNOV = '[[law]]\ntype = "lyapunov"\nk_rate = 0.2\nk_attitude = 0.03\n'
FORM_II = '[[law]]\ntype = "lqr"\nform = "II"\nq = [1, 1, 1, 1, 2, 3]\nr = [1e3, 1e3, 1e3]\n'
FORM_III = FORM_II.replace('"II"', '"III"')
MOVED = "[2.6, 2.9, 3.5]"
TURNED = "[[2.6, 0.2, -0.1], [0.2, 2.9, 0.3], [-0.1, 0.3, 3.5]]"
WHEELED = "[[7.0, 0.2, -0.1], [0.2, 8.5, 0.3], [-0.1, 0.3, 5.5]]"
MIDDLE = 100
"""The control step of a fault at 10 s."""


def fault(inertia, time=10, **given):
    lines = "".join(f"{key} = {value}\n" for key, value in given.items())
    return f"\n[[fault]]\ntime = {time}\ninertia = {inertia}\n{lines}"


def made(text, law=0):
    scenario = parse(text, "here")
    return scenario, build(scenario, scenario.laws[law])


CASES = {
    "diagonal": PLAIN + LYAPUNOV + fault(MOVED, delay=5, action='"reallocate"'),
    "full": PLAIN + LYAPUNOV + fault(TURNED, delay=5, action='"reallocate"'),
    "wheels": WHEELS + fault(WHEELED, delay=5),
    "a wheel too": WHEELS + fault(WHEELED, wheel=2, lost="true", delay=5),
}


@pytest.mark.parametrize("case", CASES)
def test_angular_momentum_is_kept_while_the_rate_jumps(case):
    _, loop = made(CASES[case])
    end = fly(loop, MIDDLE)[1]
    before = end.state
    after = label(loop, *fly(loop, MIDDLE + 1), 1)
    new = loop.events[0].craft
    kept = tensor(loop.craft.inertia) @ before.rate
    assert tensor(new.inertia) @ after["rate"][MIDDLE] == pytest.approx(kept, rel=1e-12)
    assert np.abs(after["rate"][MIDDLE] - before.rate).max() > 0.01 * np.linalg.norm(before.rate)
    assert after["attitude"][MIDDLE].tolist() == list(before.attitude)
    if loop.wheels is not None:
        assert after["wheel_momentum"][MIDDLE].tolist() == list(end.effectors[0].momentum)


def test_total_angular_momentum_is_kept_over_the_event():
    text = WHEELS.replace('# momentum = "0.1 N m s"', 'momentum = "0.1 N m s"')
    _, loop = made(text + fault(WHEELED, wheel=2, lost="true", delay=5))
    run = label(loop, *fly(loop, 3000), 1)
    old, new = tensor(loop.craft.inertia), tensor(loop.events[0].craft.inertia)
    axes, total = np.array(loop.wheels.axes), []
    for k, (q, w, h) in enumerate(zip(run["attitude"], run["rate"], run["wheel_momentum"], strict=True)):
        body = (old if k < MIDDLE else new) @ w + h @ axes
        total.append(to_reference(tuple(q), tuple(body)))
    total = np.array(total)
    assert np.abs(total - total[0]).max() <= 1e-12 * np.linalg.norm(total[0])
    assert np.ptp(run["wheel_momentum"], axis=0).max() > 0.1 * np.linalg.norm(total[0])


def test_a_fault_at_the_start_changes_the_rate_given():
    _, loop = made(PLAIN + LYAPUNOV + fault(MOVED, time=0, action='"none"'))
    run = label(loop, *fly(loop, 1), 1)
    assert run["rate"][0] == pytest.approx(np.array([0.03 * 2.0 / 2.6, -0.02 * 3.0 / 2.9, 0.04 * 4.0 / 3.5]), rel=1e-15)


def test_all_phases_are_flown_by_one_kernel():
    _, loop = made(PLAIN + FORM_III + fault(TURNED))
    assert isinstance(loop.craft.inertia[0], float)
    phases = loop.phases(300)
    assert [(phase.first, phase.last) for phase in phases] == [(0, 100), (100, 300)]
    for phase in phases:
        for matrix in (*phase.craft[:2], *phase.nominal[:2], *phase.gains[:2]):
            assert np.shape(matrix) == (3, 3)
    assert np.array_equal(tensor(phases[0].craft.inertia), tensor(loop.craft.inertia))


@pytest.mark.parametrize("action", ["none", "reallocate"])
def test_the_law_reckons_with_the_old_inertia_until_the_diagnosis(action):
    scenario, loop = made(PLAIN + LYAPUNOV + fault(MOVED, delay=5, action=f'"{action}"'))
    run = label(loop, *fly(loop, 300), 1)
    old, new = scenario.craft, make_craft([2.6, 2.9, 3.5], 0.05)
    told, apart = 300 if action == "none" else 150, 0
    for k in range(300):
        q, w = tuple(run["attitude_error"][k].tolist()), tuple(run["rate"][k].tolist())
        seen = Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, loop.period)
        by_old, by_new = (loop.law.command(seen, loop.gains, craft, NoMemory())[0] for craft in (old, new))
        assert tuple(run["command"][k].tolist()) == (by_old if k < told else by_new)
        apart += by_old != by_new
    assert apart > 250


def test_gains_stay_unless_they_are_retuned():
    cases = {"none": [False], "reallocate": [False, False], "retune": [False, True], "both": [False, True]}
    for action, expected in cases.items():
        scenario, loop = made(PLAIN + FORM_II + fault(MOVED, delay=5, action=f'"{action}"'))
        entry, new = scenario.laws[0], make_craft([2.6, 2.9, 3.5], 0.05)
        fresh = entry.law.design(new, entry.spec)
        assert fresh != entry.gains
        assert [event.step for event in loop.events] == [100, 150][: len(expected)]
        assert [event.gains for event in loop.events] == [fresh if retuned else entry.gains for retuned in expected]
        assert [event.craft for event in loop.events] == [new] * len(expected)
        assert [event.nominal for event in loop.events] == [scenario.craft, new][: len(expected)]


@pytest.mark.parametrize("action", ["retune", "both"])
def test_gains_follow_the_inertia_and_the_torque_left(action):
    later = fault("[9.0, 8.0, 6.0]", time=30, action=f'"{action}"')
    scenario, loop = made(WHEELS + fault(WHEELED, wheel=2, lost="true", delay=5, action='"both"') + later)
    entry = scenario.laws[0]
    share = authority(wheels_after(loop.events[1])) / authority(wheels_of(scenario))
    spec = entry.spec._replace(torque=entry.spec.torque * share)
    assert 0.0 < share < 1.0
    struck, acted, changed, known = loop.events
    rows = [[float(x) for x in row.split(",")] for row in WHEELED.strip("[]").split("], [")]
    assert acted.gains == entry.law.design(craft_with(scenario, rows), spec)
    body, left = craft_with(scenario, rows), torque_limit(scenario.table, acted.parts)
    assert left < scenario.craft.torque_limit
    assert struck.craft == body
    assert acted.craft == acted.nominal == body._replace(torque_limit=left)
    assert changed.gains == acted.gains
    # The torque left is not forgotten when only the body changes.
    assert known.gains == entry.law.design(craft_with(scenario, [9.0, 8.0, 6.0]), spec)
    assert wheels_after(known) == wheels_after(acted)


def test_what_is_diagnosed_late_does_not_hide_what_came_since():
    slow, fast = fault(MOVED, delay=15, action='"reallocate"'), fault(TURNED, time=12, delay=1, action='"reallocate"')
    scenario, loop = made(PLAIN + LYAPUNOV + slow + fast)
    first, second, known, late = loop.events
    assert (first.step, second.step, known.step, late.step) == (100, 120, 130, 250)
    assert second.craft == known.craft == known.nominal == late.nominal != first.craft
    assert first.nominal == second.nominal == scenario.craft


def test_a_fault_that_the_law_never_knows_of_leaves_the_certificate():
    tried = certify_scenario(parse(small.CRAFT + small.PD + fault(MOVED, time=1, action='"none"'), "here"))[0]
    assert tried.certificate == certify_scenario(parse(small.CRAFT + small.PD, "here"))[0].certificate
    assert tried.trial is not None


def test_moments_may_have_units():
    _, loop = made(PLAIN + LYAPUNOV + fault('["26000 kg cm^2", 2.9, 3.5]', action='"none"'))
    assert tensor(loop.events[0].craft.inertia) == pytest.approx(np.diag([2.6, 2.9, 3.5]), rel=1e-14)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (fault("[2.6, -2.9, 3.5]"), "fault[1].inertia: found [2.6, -2.9, 3.5]; allowed: inertia must be positive definite"),
        (fault("[2.0, 3.0, 6.0]"), "fault[1].inertia: found [2.0, 3.0, 6.0]; allowed: no body has these principal moments"),
        (fault("[2.0, 3.0]"), "fault[1].inertia: found [2.0, 3.0]; allowed: three principal moments or a 3x3 matrix"),
        (fault('"heavy"'), 'fault[1].inertia: found "heavy"; allowed: three principal moments or a 3x3 matrix'),
        (fault('["2 N", 3, 4]'), "fault[1].inertia: "),
        (fault(MOVED, wheel=1), "fault[1].lost: found False; allowed: true, or a new torque_limit"),
        (fault(MOVED, lost="true"), "fault[1].wheel"),
        (fault(MOVED, wheel=1, lost="true"), "fault[1]: found no wheels; allowed: a wheel's fault only with [wheels]"),
        (fault(MOVED, time=40), "fault[1].time: found 40 s; allowed: at most 30 s"),
        (fault(MOVED), "fault[1].action: found retune for law lyapunov; allowed: a law with a form"),
        ("\n[[fault]]\ntime = 1\n", "or a new inertia of the body"),
    ],
)
def test_inertia_faults_that_cannot_be(text, said):
    with refused(said, start="here: "):
        made(PLAIN + LYAPUNOV + text)


def test_inertia_faults_that_the_wheels_or_the_law_cannot_bear():
    with refused("fault[1].inertia: the rotors have more inertia than the craft"):
        made(WHEELS + fault("[1e-3, 1e-3, 1e-3]"))
    with refused("fault[1]: no gains for law lqr: form 'II' needs a diagonal inertia"):
        made(PLAIN + FORM_II + fault(TURNED))
    pd = '\n[[law]]\ntype = "pd"\nname = "given"\nk_rate = 0.3\nk_attitude = 0.03\n'
    with refused("retune for law given; allowed: a law with a form"):
        made(WHEELS + pd + fault(WHEELED, wheel=1, lost="true"), law=2)
