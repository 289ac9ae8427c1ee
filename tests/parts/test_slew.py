"""A slew: times by the formulas of textbooks, its path by SciPy, its torque by Euler's equation, the Sun by ERFA."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.parts.targets import slew
from starhold.scenario.reading import parse
from starhold.studies.compare import record
from tests.making import built
from tests.missions import cubesat
from tests.refusals import refused
from tests.sky import MARCH, to_sun
from tests.texts import toml
from tests.tiers import WHOLE

RATE, ACCELERATION, PERIOD = math.radians(0.5), math.radians(0.02), 0.5
LAW = '[[law]]\ntype = "lyapunov"\nk_rate = 0.006\nk_attitude = 0.0008\n'


def profile(angle, **more):
    """The slew about a slanted axis by an angle, and its goals at every control step."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    end = (Rotation.from_quat([0.1, 0.2, -0.3, 0.9]) * Rotation.from_rotvec(angle * axis)).as_quat()[[3, 0, 1, 2]]
    start = Rotation.from_quat([0.1, 0.2, -0.3, 0.9]).as_quat()[[3, 0, 1, 2]]
    params = slew.Params(tuple(end), RATE, ACCELERATION, tuple(start), 10.0, **more)
    numbers = slew.prepare(params, PERIOD)
    return numbers, [slew.goal(numbers, None, step, None) for step in range(1000)], Rotation.from_quat(end[[1, 2, 3, 0]])


@pytest.mark.parametrize("angle", [0.05, 0.3, 2.8])
def test_a_slew_goes_from_rest_to_rest_at_its_limits_in_the_least_time(angle):
    numbers, goals, end = profile(angle)
    rates, slopes = (np.array([getattr(goal, name) for goal in goals]) for name in ("rate", "acceleration"))
    turns = Rotation.from_quat(np.array([goal.attitude for goal in goals])[:, [1, 2, 3, 0]])
    coasts = angle > RATE**2 / ACCELERATION
    least = angle / RATE + RATE / ACCELERATION if coasts else 2.0 * math.sqrt(angle / ACCELERATION)
    assert 2.0 * numbers.legs[0].speeding + numbers.legs[0].coasting == pytest.approx(least, rel=1e-12)
    moving = np.flatnonzero(np.linalg.norm(rates, axis=1) > 0.0) * PERIOD
    assert (moving[0], moving[-1]) == pytest.approx((10.5, 10.0 + least), abs=PERIOD)
    assert np.linalg.norm(rates, axis=1).max() <= (RATE if coasts else math.sqrt(angle * ACCELERATION)) * (1.0 + 1e-12)
    assert set(np.round(np.linalg.norm(slopes, axis=1) / ACCELERATION, 12)) <= {0.0, 1.0}
    assert (turns[-1].inv() * end).magnitude() < 1e-14
    # The step from one attitude to the next is the mean rate of a profile of straight pieces.
    steps = (turns[:-1].inv() * turns[1:]).as_rotvec() / PERIOD
    assert np.abs(steps - 0.5 * (rates[1:] + rates[:-1])).max() < 0.5 * ACCELERATION * PERIOD
    flat = np.all(slopes[1:] == slopes[:-1], axis=1)
    assert np.abs(steps - 0.5 * (rates[1:] + rates[:-1]))[flat].max() < 1e-14


PART = toml("""
[[part]] type = "slew"; attitude = [0.3, 0.8, -0.5, 0.1]; rate = "0.5 deg/s"; acceleration = "0.02 deg/s^2"; begin = 20
""")
START = "angles = [0, 0, 0]\nrate = [0, 0, 0]"


def scenario(more="", end=(0.3, 0.8, -0.5, 0.1)):
    part = PART.replace("[0.3, 0.8, -0.5, 0.1]", str([float(x) for x in end]))
    text = cubesat(part + more, LAW, duration=400, angles="[0, 0, 0]", rate=(0.0, 0.0, 0.0))
    return parse(text, "slew.toml")


def test_a_law_that_is_told_the_profile_follows_it_with_the_torque_that_it_takes():
    own = scenario()
    run = record(own, built(own))
    errors = 2.0 * np.linalg.norm(run["attitude_error"][:, 1:], axis=1)
    assert math.degrees(errors.max()) < 0.05
    assert errors[-1] < 1e-4
    numbers = slew.prepare(slew.Params((0.3, 0.8, -0.5, 0.1), RATE, ACCELERATION), PERIOD)
    inertia, axis = np.diag([0.05, 0.065, 0.025]), np.array(numbers.legs[0].axis)
    gyroscopic = np.abs(np.cross(axis, inertia @ axis)) * RATE**2
    most = (ACCELERATION * np.abs(inertia @ axis) + gyroscopic).max()
    assert 0.9 * most < np.abs(run["torque"]).max() < 1.1 * most
    with refused("part slew", f"the slew takes up to {most:.4g} N m about a body axis, more than {0.9 * most:.4g} N m"):
        built(scenario(f"torque_limit = {0.9 * most}\n"))
    built(scenario(f"torque_limit = {1.0001 * most}\n"))


TO_EDGE = (0.6200708393513185, 0.2580926042544815, 0.22539442072852267, 0.7057603820842773)
FROM_EDGE = (0.06739684609426541, -0.19202066765658107, -0.2843411559818094, 0.9368755708973284)


def test_a_path_leads_around_the_cone_about_the_sun():
    """The angle to the Sun, at every control step, by SciPy and ERFA."""
    sun = to_sun(MARCH)
    epoch, around = (2026.0, 3.0, 5.0, 6.0, 30.0, 0.0), 0
    for turns in Rotation.random(200, rng=5).as_quat(scalar_first=True).reshape(100, 2, 4):
        params = slew.Params(tuple(turns[1]), RATE, ACCELERATION, tuple(turns[0]), 0.0, epoch=epoch)
        params = params._replace(axis=(3.0, 0.0, 4.0), keep_out=math.radians(40.0))
        axes = Rotation.from_quat(turns, scalar_first=True).apply([0.6, 0.0, 0.8])
        if np.arccos(axes @ sun).min() < math.radians(40.0):
            with refused("the axis is", "from the Sun where the slew", "it is to keep 40 deg"):
                built(scenario(f"start = {turns[0].tolist()}\naxis = [3, 0, 4]\nkeep_out = 0.6981317\n", turns[1]))
            continue
        numbers = slew.prepare(params, 5.0)
        goals = [slew.goal(numbers, None, step, None) for step in (*range(0, 799, 1 if WHOLE else 5), 799)]
        path = Rotation.from_quat([goal.attitude for goal in goals], scalar_first=True)
        assert np.arccos(path.apply([0.6, 0.0, 0.8]) @ sun).min() > math.radians(39.98)
        assert abs(path[-1].as_quat(scalar_first=True) @ turns[1]) == pytest.approx(1.0, abs=1e-14)
        straight = (path[0].inv() * path[-1]).magnitude() * RATE**-1 + RATE / ACCELERATION
        around += (
            2.0 * sum(leg.speeding for leg in numbers.legs) + sum(leg.coasting for leg in numbers.legs) > straight + 1.0
        )
    assert 10 < around < 40
    # Both ends at the edge of the cone, and much roll between them.
    turns = Rotation.from_quat([TO_EDGE, FROM_EDGE], scalar_first=True)
    onto, _ = Rotation.align_vectors([sun], [[0.0, 0.0, 1.0]])
    start, end = (onto * turns).as_quat(scalar_first=True).tolist()
    with refused("part slew", "the axis passes the Sun at 39.82 deg on the best detour of two turns; it is to keep 40 deg"):
        built(scenario(f'start = {start}\naxis = [0, 0, 1]\nkeep_out = "40 deg"\n', end))


def test_a_slew_of_a_mode_is_refused_where_its_craft_cannot():
    modes = toml("""
[[law]] name = "mission"; type = "modes"
[[law.mode]] name = "slew"; type = "lyapunov"; k_rate = 0.006; k_attitude = 0.0008
target = { type = "slew", attitude = [0.3, 0.8, -0.5, 0.1], rate = 0.01, acceleration = 3e-4, torque_limit = LIMIT }
until = { after = "380 s" }
[[law.mode]] name = "rest"; type = "lyapunov"; k_rate = 0.006; k_attitude = 0.0008
""")
    text = cubesat(modes, duration=400, angles="[0, 0, 0]", rate=(0.0, 0.0, 0.0))
    built(parse(text.replace("LIMIT", "1e-4"), "m.toml"))
    with refused("the slew takes up to"):
        built(parse(text.replace("LIMIT", "1e-6"), "m.toml"))
