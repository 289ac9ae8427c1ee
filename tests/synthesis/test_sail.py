"""Forces of sunlight on a panel, the way back from a force to the panel, the set of forces, and the Sun behind a disc."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from starhold.algebra.vector import norm
from starhold.synthesis.sail import (
    LAMBERT,
    MIRROR_CENTRE,
    MIRROR_RADIUS,
    Setting,
    ball,
    cone_for,
    force,
    lean_of,
    lit,
    lit_discs,
    make_sail,
    max_lean,
    normal_of,
    outline,
    push,
    reach,
    set_for,
    steer,
    steered,
    widest_cosine,
)
from starhold.synthesis.sail import given as force_of
from tests.algebra.readers import directions

PRESSURE = 4.5e-6
MIRROR = make_sail(PRESSURE, 150.0, 300.0)

parts = st.floats(0.0, 1.0)
optics = st.tuples(parts, parts).map(lambda p: (p[0], p[1] * (1.0 - p[0]))).filter(lambda p: sum(p) > 0.02)
sails = optics.map(lambda p: make_sail(PRESSURE, 150.0, 300.0, *p))
clocks = st.floats(-math.pi, math.pi)


def mirror(wanted, pressure):
    """The area (m2) and unit normal of a perfect mirror that give this force (N) at this pressure (N/m2)."""
    size = norm(wanted)
    return size**3 / (2.0 * pressure * wanted[0] ** 2), tuple(x / size for x in wanted)


@given(optics, st.floats(0.0, 1.5), clocks)
def test_the_force_is_the_momentum_that_the_light_loses(reflected, cone, clock):
    sail = make_sail(1.0, 1.0, 1.0, *reflected)
    normal = np.array(normal_of(Setting(1.0, cone, clock)))
    light = np.array([1.0, 0.0, 0.0])
    bounced = light - 2.0 * normal[0] * normal
    scattered = -LAMBERT * normal
    out = reflected[0] * bounced + reflected[1] * scattered
    assert force(tuple(normal.tolist()), 1.0, sail) == pytest.approx(normal[0] * (light - out), abs=1e-15)


def test_recoil_of_scattered_light_by_going_over_all_directions():
    tilt = (np.arange(20000) + 0.5) * (0.5 * math.pi / 20000)
    flux = np.cos(tilt) * np.sin(tilt)
    assert pytest.approx(np.sum(flux * np.cos(tilt)) / np.sum(flux), rel=1e-8) == LAMBERT


@given(sails, st.floats(0.0, 0.999), clocks, st.floats(0.01, 1.0))
@example(MIRROR, 0.0, 1.0, 1.0)
@example(make_sail(PRESSURE, 150.0, 300.0, 0.0, 1.0), 0.5, -3.0, 1.0)
def test_from_the_panel_to_the_force_and_back(sail, part, clock, share):
    widest = math.acos(widest_cosine(sail.specular, sail.diffuse))
    setting = Setting(share * sail.area, part * widest, clock)
    wanted = force_of(setting, sail)
    back = set_for(wanted, sail)
    assert force_of(back, sail) == pytest.approx(wanted, rel=1e-9, abs=1e-12 * norm(wanted))
    assert back.area == pytest.approx(setting.area, rel=1e-5)
    assert lean_of(back.cone, sail.specular, sail.diffuse) == pytest.approx(
        lean_of(setting.cone, sail.specular, sail.diffuse), abs=1e-12
    )
    if part > 1e-3 and lean_of(setting.cone, sail.specular, sail.diffuse) > 1e-6:
        assert math.remainder(back.clock - clock, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(sails, directions, st.floats(0.0, 1.0))
def test_every_control_within_reach_can_be_steered(sail, direction, share):
    control = tuple(share * reach(sail) * x / math.hypot(*direction) for x in direction)
    setting = steer(control, sail)
    assert 0.0 <= setting.area <= sail.area
    assert 0.0 <= setting.cone <= 0.5 * math.pi
    assert steered(setting, sail) == pytest.approx(control, abs=1e-9 * reach(sail))


@given(st.floats(0.0, 1.4), clocks)
def test_a_mirror_in_closed_form(cone, clock):
    setting = Setting(100.0, cone, clock)
    area, normal = mirror(force_of(setting, MIRROR), PRESSURE)
    assert area == pytest.approx(100.0)
    assert normal == pytest.approx(normal_of(setting), abs=1e-14)
    assert set_for(force_of(setting, MIRROR), MIRROR)[:2] == pytest.approx(setting[:2])


def test_forces_that_cannot_be_had():
    assert set_for((0.0, 0.0, 0.0), MIRROR) == Setting(0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="needs 300 m2 of sail"):
        set_for(tuple(2.0 * x for x in force_of(Setting(150.0, 0.3, 0.0), MIRROR)), MIRROR)
    for sail in (MIRROR, make_sail(PRESSURE, 150.0, 300.0, 0.5)):
        with pytest.raises(ValueError, match="leans at most"):
            set_for((-1e-6, 1e-6, 0.0), sail)
    with pytest.raises(ValueError, match=r"at most 30 deg from the light; this one has 45 deg"):
        set_for((1e-6, 1e-6, 0.0), make_sail(PRESSURE, 150.0, 300.0, 0.5))


@given(optics)
@example((1.0, 0.0))
@example((0.0, 1.0))
def test_the_widest_lean(reflected):
    cones = np.arccos(np.append(np.geomspace(1e-17, 1.0, 4000), np.linspace(0.0, 1.0, 4000)))
    leans = [lean_of(cone, *reflected) for cone in cones.tolist()]
    widest = max_lean(*reflected)
    assert max(leans) == pytest.approx(widest, abs=2e-6)
    assert max(leans) <= widest + 1e-12
    half = 0.5 * widest
    assert lean_of(cone_for(half, *reflected), *reflected) == pytest.approx(half, abs=1e-12)


@given(optics)
@example((1.0, 0.0))
@example((0.0, 1.0))
def test_the_set_of_forces_is_convex(reflected):
    corners = np.vstack([outline(*reflected, 400), [0.0, 0.0]])
    sides = np.diff(corners, axis=0)
    sides = sides[np.hypot(*sides.T) > 1e-9]
    turns = sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0]
    assert turns.min() > -1e-13


@pytest.mark.slow
@settings(max_examples=30)
@given(optics)
@example((0.83, 0.05))
@example((1.0, 0.0))
@example((0.0, 1.0))
def test_the_ball_is_the_largest_by_trying_them_all(reflected):
    found = ball(*reflected)
    curve = outline(*reflected, 4001)
    edge = np.outer(np.linspace(0.0, 1.0, 2001), curve[-1])
    border = np.vstack([curve, edge])
    centres = np.linspace(0.0, 2.0, 401)
    rooms = np.hypot(border[:, :1] - centres, border[:, 1:]).min(axis=0)
    inside = centres <= curve[0, 0]
    assert rooms[inside].max() <= found.radius + 1e-6
    assert np.hypot(border[:, 0] - found.centre, border[:, 1]).min() == pytest.approx(found.radius, abs=1e-6)


def test_push_and_reach_are_the_ball_in_the_units_of_the_craft():
    assert push(MIRROR) == pytest.approx(MIRROR_CENTRE * PRESSURE * 0.5)
    assert reach(MIRROR) == pytest.approx(MIRROR_RADIUS * PRESSURE * 0.5)


@given(st.floats(0.0, 2.0))
def test_the_light_of_equal_discs(offset):
    s = 0.5 * offset
    assert lit(offset) == pytest.approx(1.0 - 2.0 / math.pi * (math.acos(s) - s * math.sqrt(1.0 - s * s)))
    assert lit(offset) == pytest.approx(lit_discs(offset, 1.0, 1.0), abs=1e-12)
    assert lit(-offset) == lit(offset)


@settings(max_examples=30)
@given(st.floats(0.2, 3.0), st.floats(0.0, 1.3))
@example(0.5, 0.0)
@example(2.0, 0.0)
@example(1.0, 1.0)
def test_the_light_of_discs_by_counting_points(body, part):
    separation = part * (1.0 + body)
    side = np.linspace(-1.0, 1.0, 801)
    x, y = np.meshgrid(side, side)
    sun = x * x + y * y < 1.0
    seen = sun & ((x - separation) ** 2 + y * y > body * body)
    assert lit_discs(separation, 1.0, body) == pytest.approx(seen.sum() / sun.sum(), abs=4e-3)
