"""Magnetorquers and what they unload: against SciPy in the field of an independent implementation, and the balance of the
angular momentum."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.algebra.scalar import absolute, clip, maximum
from starhold.algebra.several import each
from starhold.algebra.vector import scale
from starhold.parts.effectors.layouts import pyramid
from starhold.parts.effectors.magnetorquers import dipole_for, within
from starhold.scenario.reading import parse
from starhold.trace.calling import Compiled
from tests.making import spun
from tests.missions import cubesat
from tests.texts import toml

INERTIA = np.array([0.05, 0.065, 0.025])
WHEELS = toml("""
[wheels] layout = "pyramid"; inertia = 2e-5; torque_limit = "2 mN m"; momentum_limit = "15 mN m s"
momentum = "4 mN m s"
""")
AXES = np.array(pyramid())
METER = '[[part]]\ntype = "magnetometer"\n'
RODS = '[[part]]\ntype = "magnetorquers"\ndipole_limit = 0.2\n'
UNLOADING = '[[part]]\ntype = "magnetic-unloading"\ndipole_limit = 0.3\n'
PD = '[[law]]\ntype = "pd"\nk_rate = 4e-4\nk_attitude = 2e-6\n'


def test_the_body_turns_as_scipy_says_under_the_recorded_dipoles():
    run = sh.simulate(parse(cubesat(METER, RODS, PD, duration=400), "own"))
    torques, rate, attitude = run.torque.values, run.rate.values, run.attitude.values
    turns = Rotation.from_quat(attitude, scalar_first=True)
    for k in (0, 100, 333, 700):
        # The field rests in inertial axes for a control period; of it only what lies across the dipole acts.
        dipole = run.magnetic_dipole.values[k]
        field = turns[k].apply(run.magnetometer_magnetic_field.values[k])
        assert np.abs(np.cross(dipole, turns[k].inv().apply(field)) - torques[k]).max() < 1e-18

        def torque(t, q, dipole=dipole, field=field):
            return np.cross(dipole, Rotation.from_quat(q, scalar_first=True).inv().apply(field))

        _, end = spun(torque, (0.0, 0.5), attitude[k], rate[k], np.diag(INERTIA))
        assert np.abs(end[-1] - rate[k + 1]).max() < 1e-9


def reduced_always(dipole, limit):
    """The dipole by the formula for one that exceeds its limit, with no branch."""
    x, y, z = (absolute(m) / most for m, most in zip(dipole, limit, strict=True))
    return scale(1.0 / maximum(maximum(maximum(x, y), z), 1.0), dipole)


WITHIN = Compiled(lambda dipole, limit: within(dipole, limit, 0), (0.0,) * 3, (0.0,) * 3)
WHOLE = Compiled(lambda dipole, limit: each(clip, (reduced_always(dipole, limit), limit)), (0.0,) * 3, (0.0,) * 3)
dipoles = st.one_of(st.floats(-1.5, 1.5), st.sampled_from([0.0, -0.0, 0.3, -0.3, 5e-324, math.inf, -math.inf, math.nan]))
limits = st.sampled_from([0.0, 1e-308, 0.1, 0.3, 1.0, math.inf])


@settings(max_examples=40)
@given(st.lists(st.tuples(*[dipoles] * 3, *[limits] * 3), min_size=1, max_size=16))
def test_a_dipole_within_its_limits_has_the_bits_that_the_formula_for_others_gives(cases):
    """Alone, and in lanes of which some exceed theirs."""
    columns = np.array(cases).T
    expected = WHOLE.over(columns)
    alone = np.array([WITHIN(case[:3], case[3:]) for case in cases]).T
    for found in (alone, WITHIN.over(columns)):
        assert np.array_equal(np.isnan(found), np.isnan(expected))
        known = ~np.isnan(expected)
        assert np.array_equal(found[known].view(np.uint64), expected[known].view(np.uint64))


def test_a_dipole_gives_what_lies_across_the_field_and_no_more_than_it_can():
    rng = np.random.default_rng(5)
    limit = (0.2, 0.3, 0.1)
    for _ in range(200):
        torque, field = rng.normal(size=3) * 1e-6, rng.normal(size=3) * 3e-5
        dipole = np.array(dipole_for(tuple(torque), tuple(field)))
        across = torque - field * (field @ torque) / (field @ field)
        assert np.abs(np.cross(dipole, field) - across).max() < 1e-20
        # Of all dipoles that give it the least.
        assert abs(dipole @ field) < 1e-15 * np.linalg.norm(field)
        big = dipole * 100.0
        together, each = np.array(within(tuple(big), limit, 0)), np.array(within(tuple(big), limit, 1))
        assert np.abs(np.cross(together, big)).max() < 1e-15 * np.abs(big).max()
        assert np.max(np.abs(together) / limit) == pytest.approx(min(1.0, np.max(np.abs(big) / limit)))
        np.testing.assert_array_equal(each, np.clip(big, np.negative(limit), limit))
    assert dipole_for((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


LAW = '[[law]]\ntype = "lyapunov"\nk_rate = 0.01\nk_attitude = 0.002\n'


@pytest.mark.slow
def test_wheels_are_unloaded_by_what_comes_from_outside():
    plain = sh.simulate(parse(cubesat(WHEELS, LAW, duration=6000), "own"))
    run = sh.simulate(parse(cubesat(WHEELS, METER, UNLOADING, "gain = 2e-3\n", LAW, duration=6000), "own"))
    before, after = (np.linalg.norm(one.wheel_momentum.values[-1] @ AXES) for one in (plain, run))
    assert after < 0.05 * before
    # The law holds the attitude meanwhile.
    assert 2.0 * np.linalg.norm(run.attitude_error.values[-2000:, 1:], axis=1).max() < 2e-2
    turns = Rotation.from_quat(run.attitude.values, scalar_first=True)
    # The rotors' momentum is absolute: what turns with the body is the inertia without theirs about their axes.
    body = run.rate.values @ (np.diag(INERTIA) - 2e-5 * AXES.T @ AXES)
    total = turns.apply(body + run.wheel_momentum.values @ AXES)
    impulse = np.cumsum(turns.apply(run.unloading_torque.values), axis=0)[:-1] * 0.5
    # What body and wheels lose is the impulse of the torque, which turns a little within a control period.
    assert np.abs(total[1:] - total[0] - impulse).max() < 2e-3 * np.linalg.norm(total[0])
    assert np.abs(run.unloading_dipole.values).max() <= 0.3


def test_the_unloading_of_a_wheel_keeps_what_it_is_told_to():
    unloading = UNLOADING + "gain = 2e-3\nmomentum = [0, 3e-3, 0]\n"
    run = sh.simulate(parse(cubesat(WHEELS, METER, unloading, LAW, duration=6000), "own"))
    assert run.wheel_momentum.values[-1] @ AXES == pytest.approx([0.0, 3e-3, 0.0], abs=4e-4)
