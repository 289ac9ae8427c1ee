"""What wheels surely give, against linear programmes that know nothing of how torque is shared out."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from starhold.parts.effectors.envelope import authority
from starhold.parts.effectors.layouts import nasa_standard, pyramid, three_orthogonal
from starhold.parts.effectors.wheel_arrays import MOST
from starhold.parts.effectors.wheels import allocate, allocate_peak, lose, make_wheels, with_facets

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
COPLANAR = (*three_orthogonal(), (1.0, 1.0, 0.0), (1.0, -2.0, 0.0))
LAYOUTS = {
    "orthogonal": three_orthogonal(),
    "pyramid": pyramid(),
    "steep pyramid": pyramid(1.2),
    "nasa": nasa_standard(),
    "four in a plane": COPLANAR,
    "doubled": three_orthogonal() * 2,
    "random": tuple(map(tuple, np.random.default_rng(5).normal(size=(7, 3)).tolist())),
}


def wheels_of(axes, limits=0.02):
    return make_wheels(axes, 1e-3, limits, 0.4)


def most(wheels, direction):
    """The largest multiple of a torque that some motor torques within their limits give: in the torque polytope
    {-A'tau : |tau_i| <= limit_i}, whatever the allocation."""
    axes, limits = np.array(wheels.axes), wheels.torque_limit
    equal = np.hstack([axes.T, np.array(direction)[:, None]])
    bounds = [*((-limit, limit) for limit in limits), (0.0, None)]
    found = linprog([0.0] * len(axes) + [-1.0], A_eq=equal, b_eq=np.zeros(3), bounds=bounds, method="highs")
    assert found.success
    return -found.fun


def steepest(row, kind, bound):
    """The most that a row gives of a torque within the box or ball, by a linear programme or in closed form."""
    if kind == "norm":
        return float(np.linalg.norm(row)) * bound
    return -linprog(-np.array(row), bounds=[(-bound, bound)] * 3, method="highs").fun


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kind", ["axis", "norm"])
def test_with_least_squares_the_bound_is_the_largest_that_no_motor_exceeds(layout, kind):
    limits = [0.02 + 0.005 * k for k in range(len(LAYOUTS[layout]))]
    wheels = wheels_of(LAYOUTS[layout], limits)
    bound = authority(wheels, kind)
    peaks = [steepest(row, kind, bound) / limit for row, limit in zip(wheels.least, limits, strict=True)]
    assert max(peaks) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_with_the_least_peak_the_box_is_the_largest_in_the_torque_polytope(layout):
    """A polytope that is convex holds a box if it holds its corners."""
    wheels = wheels_of(LAYOUTS[layout])
    bound = authority(wheels, "axis", peak=True)
    assert min(most(wheels, corner) for corner in CORNERS) == pytest.approx(bound, rel=1e-7)
    assert bound >= authority(wheels, "axis") * (1.0 - 1e-12)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_with_the_least_peak_the_ball_touches_the_torque_polytope(layout):
    wheels = wheels_of(LAYOUTS[layout])
    bound = authority(wheels, peak=True)
    random = np.random.default_rng(2).normal(size=(40, 3))
    # It touches where a facet is nearest: the normals of pairs of axes hold that direction.
    normals = [np.cross(a, b) for a, b in itertools.combinations(wheels.axes, 2)]
    directions = [d / np.linalg.norm(d) for d in (*random, *normals) if np.linalg.norm(d) > 1e-6]
    found = [most(wheels, d) for d in directions]
    assert min(found) == pytest.approx(bound, rel=1e-7)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(3, 8), st.booleans(), st.sampled_from(["axis", "norm"]))
def test_no_torque_within_the_bound_takes_a_motor_beyond_its_limit(seed, count, peak, kind):
    random = np.random.default_rng(seed)
    try:
        wheels = with_facets(wheels_of(random.normal(size=(count, 3)), random.uniform(0.01, 0.05, count)))
    except ValueError:
        assume(False)
        raise
    bound = authority(wheels, kind, peak=peak)
    share = allocate_peak if peak else allocate
    torques = np.vstack([CORNERS, random.uniform(-1.0, 1.0, size=(20, 3))])
    if kind == "norm":
        torques /= np.linalg.norm(torques, axis=1)[:, None]
    assert bound > 0.0
    for torque in (bound * torques).tolist():
        assert (np.abs(share(tuple(torque), wheels)) <= np.array(wheels.torque_limit) * (1.0 + 1e-9)).all()


def test_a_lost_wheel_leaves_less_and_none_while_it_is_counted_on():
    wheels = wheels_of(pyramid())
    for kind, peak in itertools.product(("axis", "norm"), (False, True)):
        left = authority(lose(wheels, 0), kind, peak=peak)
        assert 0.0 < left < authority(wheels, kind, peak=peak)
        counted_on = wheels._replace(torque_limit=(0.0, 0.02, 0.02, 0.02))
        assert authority(counted_on, kind, peak=peak) == 0.0


@pytest.mark.parametrize("count", [16, MOST])
def test_many_wheels_share_out_with_the_least_peak(count):
    wheels = with_facets(wheels_of(np.random.default_rng(count).normal(size=(count, 3)), 1.0))
    for torque in np.random.default_rng(1).normal(size=(5, 3)).tolist():
        taus = allocate_peak(tuple(torque), wheels)
        np.testing.assert_allclose(-np.array(taus) @ np.array(wheels.axes), torque, atol=1e-12)
        assert max(map(abs, taus)) == pytest.approx(1.0 / most(wheels, torque), rel=1e-7)


def test_wheels_without_facets_say_so():
    with pytest.raises(TypeError, match="with_facets"):
        allocate_peak((1.0, 0.0, 0.0), wheels_of(pyramid()))
