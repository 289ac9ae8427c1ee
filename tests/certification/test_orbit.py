"""The bounds on an orbit hold wherever on it a certificate begins."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.certification.target_motion import perigee
from starhold.scenario.reading import load
from starhold.simulation.lane import fly
from tests.making import built


@pytest.mark.parametrize("steps", [0, 1, 50, 3000])
def test_perigee_is_the_same_all_along_an_orbit(steps):
    """An orbit through the x axis: the momentum about it is a rounding around zero once it has moved on."""
    loop = built(load("wheels-orbital"))
    moved = replace(loop, start=fly(loop, steps)[1].state) if steps else loop
    r, v = np.array(loop.start.position), np.array(loop.start.velocity)
    h, mu = np.cross(r, v), loop.craft.gravity
    apse = np.cross(v, h) / mu - r / np.linalg.norm(r)
    wanted = [h @ h / mu / (1.0 + np.linalg.norm(apse)), np.linalg.norm(h), np.linalg.norm(apse)]
    assert [float(ball.mid()) for ball in perigee(moved)[:3]] == pytest.approx(wanted, rel=1e-9, abs=1e-8)
