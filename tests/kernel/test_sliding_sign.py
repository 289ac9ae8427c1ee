"""How near to its surface a sliding motion must begin for the sign that it feeds back never to change."""

import pytest

from starhold.algebra.quaternion import vector_part
from starhold.algebra.scalar import sign
from starhold.algebra.vector import add, cross, scale, subtract
from starhold.kernel.numbers import RefusedError
from tests.kernel.certificates import contents, failing
from tests.kernel.handmade import case


def surface(m):
    """s = w + q / 10."""
    return add(m.rate, scale(0.1, vector_part(m.attitude)))


def reaching(m):
    """s' = -sign(s) / 10 of a body with an inertia of 1 about every axis."""
    turned = add(scale(m.attitude[0], m.rate), cross(vector_part(m.attitude), m.rate))
    return subtract(scale(-0.05, turned), tuple(0.1 * sign(x) for x in surface(m)))


@pytest.mark.parametrize(("level", "failed"), [(0.0048, set()), (0.0049, {"the sign never changes"})])
def test_the_sign_stays_below_half_of_what_the_surface_is_at_half_a_turn(level, failed):
    """s.Js is at least 0.99 * 0.099^2 = 2 * 0.00485 there, by the least moment and slope that are told."""
    told = {"taken": ["shortest sign"], "level": level, "inertia_low": 0.99, "surface_low": 0.099}
    assert failing(*case(reaching, theorem="reaches its surface", s=surface, **told)) == failed


def test_a_motion_that_ends_far_from_its_target_is_no_claim():
    content = contents("cubesat-slew", "sliding", 0)
    (claim,) = content["claims"]
    claim["numbers"]["end.angle"] = "3"
    with pytest.raises(RefusedError, match="an angle is too large"):
        failing(claim, content["programs"])
