"""The Earth's flattening against the gradient of its potential, SciPy, and the orbits that keep pace with the Sun."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from starhold.parts.environments import oblateness
from starhold.parts.orbit import BODIES, Elements, from_elements
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly
from tests.making import built

GRAVITY, RADIUS = BODIES["Earth"]
SPHERE = sympy.symbols("x y z", real=True)
MU, J2, SIZE = sympy.symbols("mu J R", positive=True)


def potential():
    """The energy per mass in the second zonal harmonic, by the Legendre polynomial of the sine of the latitude."""
    r = sympy.sqrt(sum(x * x for x in SPHERE))
    return MU / r * J2 * (SIZE / r) ** 2 * sympy.legendre(2, SPHERE[2] / r)


def flown(inclination, period, duration):
    """The end of a flight from a circular orbit at 500 km, and its start."""
    place, velocity = from_elements(Elements(RADIUS + 5e5, 0.0, inclination, 0.3, 0.0, 0.0), GRAVITY)
    text = f"""
name = "flattened"
[spacecraft]
inertia = [0.05, 0.065, 0.025]
[initial]
angles = [0, 0, 0]
[orbit]
position = {list(place)}
velocity = {list(velocity)}
gravitational_parameter = {GRAVITY}
[simulation]
duration = {duration}
control_period = {period}
[[part]]
type = "oblateness"
[[law]]
type = "pd"
k_rate = 0.004
k_attitude = 0.0008
"""
    loop = built(parse(text, "flattened"))
    return fly(loop, round(duration / period), round(duration / period))[1].state, (*place, *velocity)


def test_it_is_the_slope_of_the_potential():
    state, craft = SimpleNamespace(position=SPHERE), SimpleNamespace(gravity=MU)
    found = oblateness.acceleration(state, oblateness.Params(J2, SIZE), craft, ())
    for x, a in zip(SPHERE, found, strict=True):
        assert sympy.simplify(sympy.nsimplify(a, rational=True) + sympy.diff(potential(), x)) == 0


def test_motion_against_scipy():
    whole = (potential() - MU / sympy.sqrt(sum(x * x for x in SPHERE))).subs({MU: GRAVITY, J2: 1.08262668e-3, SIZE: RADIUS})
    pull = sympy.lambdify(SPHERE, [-sympy.diff(whole, x) for x in SPHERE])
    end, start = flown(1.1, 1.0, 6000.0)
    found = solve_ivp(lambda t, y: [*y[3:], *pull(*y[:3])], (0.0, 6000.0), start, "DOP853", rtol=1e-13, atol=1e-6)
    assert np.abs(found.y[:3, -1] - end.position).max() < 1e-2


@pytest.mark.parametrize(("inclination", "daily"), [(97.4, 0.9856), (51.6, None), (90.0, 0.0)])
def test_the_plane_turns_as_it_must(inclination, daily):
    # At 97.4 deg and 500 km the plane keeps pace with the Sun: 0.9856 deg in a day.
    end, start = flown(math.radians(inclination), 10.0, 86400.0)
    normals = np.cross(end.position, end.velocity), np.cross(start[:3], start[3:])
    nodes = [math.degrees(math.atan2(n[0], -n[1])) for n in normals]
    rate = math.sqrt(GRAVITY / (RADIUS + 5e5) ** 3)
    share = (RADIUS / (RADIUS + 5e5)) ** 2
    expected = -1.5 * 1.08262668e-3 * rate * share * math.cos(math.radians(inclination)) * math.degrees(86400.0)
    assert nodes[0] - nodes[1] == pytest.approx(expected, rel=0.01, abs=1e-3)
    if daily is not None:
        assert nodes[0] - nodes[1] == pytest.approx(daily, abs=0.01)
