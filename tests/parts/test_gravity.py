"""Gravity: attraction, its torque and the Earth's flattening, against point masses, potentials, SciPy, and known orbits."""

import math
from types import SimpleNamespace

import numpy as np
import sympy
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from starhold.algebra.quaternion import NO_TURN, derivative, to_body
from starhold.algebra.vector import apply, cross, dot, scale
from starhold.parts.craft import Craft, make_craft
from starhold.parts.environments import oblateness
from starhold.parts.environments.gravity_gradient import gravity_gradient
from starhold.parts.orbit import BODIES, Elements, from_elements
from starhold.scenario.reading import parse
from starhold.simulation.lane import fly
from tests.algebra.readers import components, reduced_by_unit_norm, symbols, vanishes
from tests.equations import two_body, two_body_gravity_gradient
from tests.making import built
from tests.missions import cubesat

DIAGONAL = make_craft([2.0, 3.0, 4.0])
FULL = [[2.0, 0.1, -0.3], [0.1, 3.0, 0.2], [-0.3, 0.2, 4.0]]
places = st.tuples(components, components, components).filter(lambda v: math.hypot(*v) > 0.1)


def test_attraction_keeps_energy_and_angular_momentum():
    r, v = symbols("x y z"), symbols("u v w")
    mu = sympy.symbols("mu", positive=True)
    acceleration, _ = two_body(r, NO_TURN, Craft((1, 1, 1), (1, 1, 1), sympy.oo, mu))
    energy = dot(v, v) / 2 - mu / sympy.sqrt(dot(r, r))
    change = sum(sympy.diff(energy, x) * dx for x, dx in zip((*r, *v), (*v, *acceleration), strict=True))
    assert vanishes(sympy.simplify(sympy.nsimplify(change, rational=True)))
    assert all(vanishes(part) for part in cross(r, acceleration))


def test_gravity_acts_on_the_rotors_too():
    place, attitude = (7.0e6, -1.0e6, 2.0e6), (0.5, 0.5, -0.1, 0.7)
    for rotors in ((2.1, 3.2, 4.1), make_craft(FULL).inertia):
        craft = DIAGONAL._replace(with_rotors=rotors)
        assert two_body_gravity_gradient(place, attitude, craft) == two_body_gravity_gradient(
            place, attitude, make_craft(rotors)
        )


def test_torque_is_the_slope_of_the_potential():
    # U = (3 mu / 2 r5) R.J R; turning the body at the rate w does the work w.M = -U'.
    q, r, w = symbols("q0:4"), symbols("r1:4"), symbols("w1:4")
    j = symbols("j1:7")
    strength = sympy.symbols("s", positive=True)
    for inertia in (j[:3], ((j[0], j[3], j[4]), (j[3], j[1], j[5]), (j[4], j[5], j[2]))):
        craft = Craft(inertia, inertia, sympy.oo, 1)
        # Body components turn as R' = -w x R; the exact quaternion kinematics say so for a unit quaternion.
        body = symbols("b1:4")
        potential = strength * dot(body, apply(inertia, body)) / 2
        change = sum(sympy.diff(potential, x) * d for x, d in zip(body, scale(-1, cross(w, body)), strict=True))
        assert vanishes(change + dot(w, gravity_gradient(body, strength, craft)))
    turned = to_body(q, r)
    for x, d in zip(turned, cross(w, turned), strict=True):
        along = sum(sympy.diff(x, c) * dc for c, dc in zip(q, derivative(q, w), strict=True))
        assert reduced_by_unit_norm(along + d, q) == 0


GRAVITY, RADIUS = BODIES["Earth"]
FLATTENING = 1.08262668e-3
PLACE = sympy.symbols("x y z", real=True)
MASS, J2, SIZE = sympy.symbols("mu J R", positive=True)


def flattened():
    """The energy per mass in the second zonal harmonic, by the Legendre polynomial of the sine of the latitude."""
    r = sympy.sqrt(dot(PLACE, PLACE))
    return MASS / r * J2 * (SIZE / r) ** 2 * sympy.legendre(2, PLACE[2] / r)


PARTS = '[[part]]\ntype = "oblateness"\n[[law]]\ntype = "pd"\nk_rate = 0.004\nk_attitude = 0.0008\n'


def orbited(inclination, period, duration):
    """The end of a flight from a circular orbit at 500 km, and its start."""
    place, velocity = from_elements(Elements(RADIUS + 5e5, 0.0, inclination, 0.3, 0.0, 0.0), GRAVITY)
    orbit = f"position = {list(place)}\nvelocity = {list(velocity)}\ngravitational_parameter = {GRAVITY}\n"
    text = cubesat(PARTS, duration=duration, period=period, rate=(0, 0, 0))
    text = text[: text.index("position")] + orbit + text[text.index("epoch") :]
    steps = round(duration / period)
    return fly(built(parse(text, "own")), steps, steps)[1].state, (*place, *velocity)


def test_flattening_is_the_slope_of_the_potential():
    state, craft = SimpleNamespace(position=PLACE), SimpleNamespace(gravity=MASS)
    found = oblateness.acceleration(state, oblateness.Params(J2, SIZE), craft, ())
    for x, a in zip(PLACE, found, strict=True):
        assert sympy.simplify(sympy.nsimplify(a, rational=True) + sympy.diff(flattened(), x)) == 0


def test_motion_about_a_flattened_earth_is_scipy_s():
    whole = (flattened() - MASS / sympy.sqrt(dot(PLACE, PLACE))).subs({MASS: GRAVITY, J2: FLATTENING, SIZE: RADIUS})
    pull = sympy.lambdify(PLACE, [-sympy.diff(whole, x) for x in PLACE])
    end, start = orbited(1.1, 1.0, 6000.0)
    found = solve_ivp(lambda t, y: [*y[3:], *pull(*y[:3])], (0.0, 6000.0), start, "DOP853", rtol=1e-13, atol=1e-6)
    assert np.abs(found.y[:3, -1] - end.position).max() < 1e-2
