"""Regions around the level sets of V: how far states of these are turned."""

import math
from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.matrices import floats
from starhold.certification.subject import make_subject
from starhold.kernel.regions import ANGLE
from tests.kernel.flights import along
from tests.making import built


@pytest.fixture(scope="module")
def searches():
    """Of a law with its own potential and with another one, on a body whose moments of inertia differ."""
    loop = Loop(make_subject(built("cubesat-nadir", "wheel")))
    first = Pushed(loop, loop.known.against(loop.known.envelope(False)))
    return [first, first.by_another()]


@pytest.mark.parametrize("angle", [0.5, 1.5])
@pytest.mark.parametrize("own", [True, False])
def test_no_state_of_a_level_is_turned_farther_than_its_region_says_and_some_nearly_as_far(own, angle, searches):
    """Turned about an axis, with the rate that makes V the least, up to where V reaches the level."""
    pushed = searches[not own]
    assert pushed.even == own
    shape, h = pushed.usual[-1], np.linspace(0.0, math.pi / 2.0 if own else math.pi, 20001)
    motion, level = pushed.sampled(shape).motion, pushed.chain(shape, angle, 0.002).level
    G, region = floats(motion.G), motion.region(Fraction(level))
    S = G[3:, 3:] - G[3:, :3] @ np.linalg.solve(G[:3, :3], G[:3, 3:])
    axes = np.concatenate([np.eye(3), along(np.random.default_rng(1).normal(size=(3, 200))).T])
    stiffness = np.einsum("ni,ij,nj->n", axes, S, axes)[:, None]
    V = float(motion.s) * (1.0 - np.cos(h)) + np.sin(h) ** 2 * stiffness
    farthest = h[np.argmax(level < V, axis=1) - 1]
    assert float(region.least) <= np.cos(farthest).min() <= float(region.least) + 0.01
    assert np.sin(farthest).max() <= float(region.sizes[ANGLE]) <= np.sin(farthest).max() * 1.02
