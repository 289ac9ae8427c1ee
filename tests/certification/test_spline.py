"""A target that follows a history: what is claimed of its motion holds between the rows and the control steps too."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, RotationSpline

from starhold.algebra.quaternion import to_body
from starhold.algebra.vector import ZERO, add, cross, subtract
from starhold.analysis.trial import draw
from starhold.certification.certify import certify
from starhold.certification.matrices import number
from starhold.certification.spline import spline_bounds
from starhold.certification.wording import sentence
from starhold.checker import passed
from starhold.errors import InputError
from starhold.laws import pd, wheel
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.craft import tensor
from starhold.parts.targets.history import knots_of, tabulate
from tests.certification.edits import checked
from tests.certification.loops import FULL, energy, free, loop_of
from tests.tiers import leading


def history(seed, count, step, spread=0.4):
    """Times, not evenly apart, and attitudes that turn at random."""
    random = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(random.uniform(1.0 - spread, 1.0 + spread, size=count - 1))])
    turns = [Rotation.random(rng=random)]
    for turn in random.normal(size=(count - 1, 3)):
        turns.append(turns[-1] * Rotation.from_rotvec(step * turn))
    return times, Rotation.concatenate(turns).as_quat(scalar_first=True)


def peaks(times, attitudes):
    """The largest rate and acceleration of SciPy's spline at many points."""
    spline = RotationSpline(times, Rotation.from_quat(attitudes, scalar_first=True))
    t = np.unique(np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(times)]))
    return [float(np.linalg.norm(spline(t, order), axis=1).max()) for order in (1, 2)]


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6), st.floats(-3.0, 0.2))
def test_bounds_of_a_spline_hold_between_its_knots_and_are_close(seed, count, size):
    times, attitudes = history(seed, count, 10.0**size)
    try:
        knots = knots_of(times, attitudes, times[-1])
    except ValueError:
        assume(False)
    rate, acceleration = spline_bounds(knots)
    found = peaks(times, attitudes)
    assert found[0] <= number(rate) <= found[0] * 1.03
    assert found[1] <= number(acceleration) <= found[1] * 1.05 + 2e-3 * found[0] ** 2


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, -1.0, 1.0009, -0.9991]))
def test_signs_and_lengths_of_quaternions_do_not_matter(seed, factor):
    times, attitudes = history(seed, 4, 0.7)
    knots = knots_of(times, attitudes, times[-1])
    other = knots._replace(attitudes=knots.attitudes * np.where(np.arange(4) % 2 == 0, 1.0, factor)[:, None])
    pairs = zip(spline_bounds(other), spline_bounds(knots), strict=True)
    assert all(number(a) == pytest.approx(number(b), rel=1e-6) for a, b in pairs)


@pytest.mark.slow
@pytest.mark.parametrize("count", leading([2, 5]))
def test_a_history_of_one_attitude_is_a_target_at_rest(count, tmp_path):
    attitudes = np.tile([0.5, -0.5, 0.1, 0.7], (count, 1))
    times = np.arange(count) * 10.0
    knots = knots_of(times, attitudes, times[-1])
    assert spline_bounds(knots) == (0, 0)
    rows = tabulate(times, attitudes, [0.0, 1.0])
    for law, gains in (("pd", pd.Gains(0.09, 0.009)), ("wheel", wheel.Gains(0.09, (0.0045,) * 3, 0.0))):
        certificate = certify(free(loop_of(law, gains, target=rows, knots=knots)), law)
        assert certificate.claim("convergence").outcome == "proved"
        assert passed(checked(certificate, tmp_path))


def followed(period):
    """A loop whose target swings between the control steps; it is at rest as often as the law looks."""
    times = np.arange(0.0, 41.0, 1.0)
    angles = np.where(times % 2 == 0.0, 0.0, 0.05) * np.sin(times / 3.0)
    attitudes = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_quat(scalar_first=True)
    rows = tabulate(times, attitudes, np.arange(0.0, 40.0 + period, period))
    loop = free(loop_of("pd", pd.Gains(0.09, 0.009), target=rows, knots=knots_of(times, attitudes, 40.0), period=period))
    return loop, peaks(times, attitudes)


@pytest.mark.slow
@pytest.mark.parametrize("period", leading([2.0, 0.05]))
def test_claims_do_not_depend_on_how_often_the_law_looks(period, tmp_path):
    loop, found = followed(period)
    certificate = certify(loop, "pd")
    subject = certificate.subject
    assert found[0] <= subject["target_rate"] <= 1.03 * found[0]
    assert found[1] <= subject["target_acceleration"] <= 1.05 * found[1]
    assert subject["history"]["interpolant"] == "rotation spline"
    claim = certificate.claim("torque-limit")
    # Following takes more than the limit of this craft, although at the control steps it would not.
    least = 4.0 * found[1]
    assert least > loop.craft.torque_limit
    assert claim is None
    assert passed(checked(certificate, tmp_path))


@pytest.mark.slow
def test_rows_without_knots_are_knots_of_their_own(tmp_path):
    times, attitudes = history(5, 8, 0.1, spread=0.0)
    rows = tabulate(times, attitudes, times)
    certificate = certify(free(loop_of("pd", pd.Gains(0.09, 0.009), target=rows, period=1.0)), "pd")
    assert certificate.subject["history"]["times"] == list(range(8))
    assert certificate.subject["target_rate"] >= peaks(times, attitudes)[0] * (1.0 - 1e-9)
    assert passed(checked(certificate, tmp_path))


def test_knots_are_those_that_the_run_needs():
    times, attitudes = np.arange(-3.0, 20.0), np.tile([1.0, 0.0, 0.0, 0.0], (23, 1))
    attitudes[:, 1] = 0.01 * np.sin(times)
    assert knots_of(times, attitudes, 4.5).times.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert knots_of(times + 0.25, attitudes, 4.25).times.tolist() == [-0.75, 0.25, 1.25, 2.25, 3.25, 4.25]


def test_half_turns_and_wild_swings_are_refused():
    with pytest.raises(ValueError, match="from 1 to 2 s a half turn"):
        knots_of([0.0, 1.0, 2.0], [[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], 2.0)
    quick = Rotation.from_rotvec([[0, 0, 0], [0, 0, 1.0], [0, 0, 2.0], [0, 0, 2.0]]).as_quat(scalar_first=True)
    for use in (lambda *rows: knots_of(*rows, 60.0), lambda *rows: tabulate(*rows, [0.0, 60.0])):
        with pytest.raises(ValueError, match="swings far off"):
            use([0.0, 0.01, 0.02, 60.0], quick)


def test_a_certificate_of_rows_half_a_turn_apart_is_refused_in_one_line():
    rows = np.zeros((2, 10))
    rows[0, 0] = rows[1, 3] = 1.0
    with pytest.raises(InputError, match="half a turn apart"):
        certify(free(loop_of("pd", pd.Gains(0.09, 0.009), target=rows)), "pd")


def test_knots_make_the_spline_that_is_flown():
    # The cubic of the rotation vector from the rates at both ends is SciPy's own.
    times, attitudes = history(9, 6, 0.8)
    knots = knots_of(times, attitudes, times[-1])
    spline = RotationSpline(times, Rotation.from_quat(attitudes, scalar_first=True))
    for k, own in enumerate(np.moveaxis(spline.interpolator.c, 1, 0)):
        h, phi = times[k + 1] - times[k], (spline.rotations[k].inv() * spline.rotations[k + 1]).as_rotvec()
        u, angle = phi / np.linalg.norm(phi), np.linalg.norm(phi)
        w = knots.rates[k + 1]
        end = w + np.cross(phi, w) / 2.0 + (1.0 - angle / 2.0 / math.tan(angle / 2.0)) * np.cross(u, np.cross(u, w))
        cubic = [(h * (knots.rates[k] + end) - 2.0 * phi) / h**3, (3.0 * phi - h * (2.0 * knots.rates[k] + end)) / h**2]
        np.testing.assert_allclose(own, [*cubic, knots.rates[k], np.zeros(3)], atol=1e-9)


def test_no_state_of_the_set_needs_more_torque_than_told_anywhere_on_the_spline():
    times, attitudes = history(11, 6, 0.1)
    knots = knots_of(times, attitudes, times[-1])
    rows = tabulate(times, attitudes, [0.0, times[-1]])
    craft = FULL._replace(torque_limit=6.0)
    loop = free(loop_of("pd", pd.Gains(0.09, 0.009), craft, target=rows, knots=knots, period=times[-1]))
    certificate = certify(loop, "pd")
    claim = certificate.claim("torque-limit")
    assert claim.outcome == "proved"
    assert "rotation spline through its history" in sentence(claim, certificate.subject)
    random, count = np.random.default_rng(1), 4000
    states = draw(count, energy(tensor(FULL.inertia), 0.018), claim.numbers["start"], random)
    spline, t = (
        RotationSpline(times, Rotation.from_quat(attitudes, scalar_first=True)),
        random.uniform(0.0, times[-1], count),
    )
    # Where the target turns and swings most, too.
    grid = np.linspace(0.0, times[-1], 5001)
    for order in (1, 2):
        t[random.uniform(size=count) < 0.3] = grid[np.argmax(np.linalg.norm(spline(grid, order), axis=1))]
    largest = 0.0
    for state, rate, acceleration in zip(states.T, spline(t, 1), spline(t, 2), strict=True):
        q, w = tuple(state[:4]), tuple(state[4:7])
        turning, spinning = to_body(q, tuple(rate)), to_body(q, tuple(acceleration))
        measurement = Measurement(
            q, w, add(w, turning), turning, subtract(spinning, cross(w, turning)), ZERO, ZERO, 1.0, ZERO
        )
        largest = max(largest, *map(abs, loop.law.command(measurement, loop.gains, craft, NoMemory())[0]))
    assert 2.0 < largest <= 6.0
