"""Wheels that are mounted askew: the body moves as SciPy has it, law and allocation go on as if they were not."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.loop.kernels import make_step
from starhold.parts.effectors.wheels import gives_allocated_torque
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly
from tests.making import built, flown
from tests.refusals import refused
from tests.texts import toml

AXES = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0] / np.sqrt(3.0)])
TURNS = [["1 deg", "-0.5 deg", "2 deg"], None, ["0.3 deg", "1 deg", 0], ["-1 deg", 0, "0.5 deg"]]
ERRORS = np.radians([[1.0, -0.5, 2.0], [0.0, 0.0, 0.0], [0.3, 1.0, 0.0], [-1.0, 0.0, 0.5]])
INERTIA, ROTOR = np.diag([0.34, 0.36, 0.21]), 6e-4
TEXT = toml("""
name = "askew"
[spacecraft] inertia = [0.34, 0.36, 0.21]
[initial] attitude = [0.99, 0.05, -0.08, 0.03]; rate = [0.001, -0.002, 0.0015]
[simulation] duration = 60; control_period = 0.5; substeps = 4
[wheels] inertia = 6e-4; torque_limit = 0.01; top_speed = "3000 rpm"; momentum = 0.02
{shared}
{wheels}
[[law]] type = "wheel"; k_rate = 0.25; k_attitude = 0.02
""")


def scenario(turns=TURNS, shared="", **changes):
    tables = [
        f"[[wheel]]\naxis = {axis.tolist()}\n{f'mounting_error = {turn}' if turn else ''}\n"
        for axis, turn in zip(AXES, turns, strict=True)
    ]
    return parse(TEXT.format(shared=shared, wheels="".join(tables)), "askew.toml").with_(changes)


def by_scipy(run):
    """Rates and momenta of the rotors over time, under motors that share the recorded commands out along the stated axes."""
    turned = Rotation.from_quat(np.c_[0.5 * ERRORS, np.ones(4)]).apply(AXES)
    body, shares = INERTIA - ROTOR * AXES.T @ AXES, -np.linalg.pinv(AXES.T)
    state = np.r_[run["rate"][0], np.full(4, 0.02)]
    states = [state]
    for command in run["command"][:-1]:
        torques = shares @ command

        def slope(_, y, torques=torques):
            whole = body @ y[:3] + turned.T @ y[3:]
            return np.r_[np.linalg.solve(body, -turned.T @ torques - np.cross(y[:3], whole)), torques]

        state = solve_ivp(slope, (0.0, 0.5), state, "DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
        states.append(state)
    return np.array(states)


def test_the_body_moves_as_scipy_has_it_and_the_law_as_if_nothing_were_askew():
    loop = built(scenario())
    run, straight = flown(loop, 120), flown(built(scenario([None] * 4)), 120)
    expected = by_scipy(run)
    assert np.abs(expected[:, :3] - run["rate"]).max() < 1e-9
    assert np.abs(expected[:, 3:] - run["wheel_momentum"]).max() < 1e-9
    assert np.abs(straight["rate"] - run["rate"]).max() > 1e-4
    # The law is given the momentum along the stated axes, and what is asked of the motors is shared out along them.
    step, (_, carry) = make_step(loop.composition()), fly(loop, 40)
    given = step.measure(carry, 40, (1, 0), loop.known, loop.setup()).wheel_momentum
    assert np.abs(AXES.T @ carry.effectors[0].momentum - given).max() < 1e-15
    assert np.abs(run["wheel_command"] @ AXES + run["command"]).max() < 1e-15
    # All are turned alike by what they share; a lost wheel and the least peak keep to the stated axes too.
    shared = built(scenario([None] * 4, 'mounting_error = [0.01, 0, 0]\nallocation = "least-peak"')).wheels
    assert np.abs(Rotation.from_quat([0.005, 0.0, 0.0, 1.0]).apply(AXES) - shared.axes).max() < 1e-15
    assert np.abs(np.array(shared.known_axes) - AXES).max() < 1e-15
    losing = scenario(fault=[{"time": 10.0, "wheel": 4, "lost": True, "delay": 1.0, "action": "reallocate"}])
    lost = flown(built(losing), 120)
    assert np.abs(lost["wheel_command"][-20:, :3] + lost["command"][-20:]).max() < 1e-15


def test_campaigns_draw_mountings_that_no_law_is_told():
    over = {"wheel[1].mounting_error": {"distribution": "normal", "sigma": "1 deg"}}
    drawn = sh.campaign(scenario(), over=over, runs=4, search=False)
    table = drawn.frame()
    for run in range(4):
        error = [float(table[f"wheel[1].mounting_error[{k}]"][run]) for k in (1, 2, 3)]
        alone = flown(built(scenario(**{"wheel[1].mounting_error": error})), 120)
        last = np.linalg.norm(alone["rate_error"][90:], axis=1).max()
        assert last == pytest.approx(table["final_rate_error"][run], rel=1e-12)
    over["wheel[1].mounting_error"]["known_to_law"] = True
    with refused("known_to_law", "false, because no law receives it"):
        sh.campaign(scenario(), over=over, runs=4, search=False)


def test_a_law_takes_the_momentum_along_the_axes_of_its_nominal_craft():
    """The same as of wheels that are mounted askew so: what is told and shared out follows [nominal], what acts does not."""
    turned = Rotation.from_rotvec([0.0, 0.0, 0.02]).apply(AXES)
    other = scenario([None] * 4)
    tables = [{"axis": axis.tolist()} for axis in turned]
    loop = built(other.with_({"nominal": {"wheel": tables}}))
    step, (_, carry) = make_step(loop.composition()), fly(loop, 40)
    given = step.measure(carry, 40, (1, 0), loop.known, loop.setup()).wheel_momentum
    momentum = carry.effectors[0].momentum
    assert np.abs(turned.T @ momentum - given).max() < 1e-15
    assert np.abs(AXES.T @ momentum - given).max() > 1e-5
    run = flown(loop, 120)
    assert np.abs(run["wheel_command"] @ turned + run["command"]).max() < 1e-15
    # Of equal axes nothing changes.
    same = built(other.with_({"nominal": {"wheel": [{"axis": axis.tolist()} for axis in AXES]}}))
    assert same.wheels.known_axes == ()


@pytest.mark.slow
def test_no_claim_is_made_of_wheels_that_are_askew_and_large_turns_are_refused():
    for turns, proved in (([None] * 4, True), (TURNS, False)):
        claims = sh.certify(scenario(turns), "wheel")[0].claims
        assert any(claim.outcome == "proved" for claim in claims) == proved
    given = scenario([None] * 4).with_({"nominal": {"wheel": [{"axis": axis} for axis in AXES[::-1].tolist()]}})
    with refused("nominal", "no [nominal], for certification"):
        sh.certify(given, "wheel")
    with refused("mounting_error", "at most 28.6479 deg"):
        scenario([[2.0, 0.0, 0.0], None, None, None])


def test_no_claim_is_made_of_a_lost_wheel_that_turns_on_askew():
    """The others give the torque that is shared out, and the law cancels the lost one's momentum along another axis."""
    lost = {"fault": [{"time": 20.0, "wheel": 4, "lost": True}], "law[1].fault_action": "reallocate"}
    for turn in (None, TURNS[3]):
        given = scenario([None, None, None, turn]).with_(lost)
        after = built(given).events[-1].parts
        (wheels,) = (fitted.params for fitted in after if fitted.part.name == "wheels")
        assert gives_allocated_torque(wheels) == (turn is None)
        # What is claimed of straight ones takes seconds to prove.
        assert turn is None or not any(one.claims for one in sh.certify(given, "wheel"))
        working = np.array([axis for axis, limit in zip(wheels.axes, wheels.torque_limit, strict=True) if limit])
        rows = np.array([row for row, limit in zip(wheels.least, wheels.torque_limit, strict=True) if limit])
        assert np.abs(working.T @ rows + np.eye(3)).max() < 1e-12
