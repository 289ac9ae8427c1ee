"""Orbits by position and velocity or by elements, against their invariants and against Basilisk, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from starhold.errors import InputError
from starhold.parts.orbit import BODIES, Elements, body_of, from_elements, highest, lowest, meets_at
from starhold.scenario.reading import builtin_text, parse
from tests.refusals import refused, replaced, rows

EARTH = BODIES["Earth"]
BASE = builtin_text("three-laws")
STATE = "position = [7.0e6, 0, 0]         # m, inertial\nvelocity = [0, 7550, 0]"
FALLING = 'position = ["7000 km", 0, 0]\nvelocity = [0, 6000, 0]'

angle = st.floats(0.0, math.tau)
ellipses = st.builds(Elements, st.floats(6.5e6, 1e9), st.floats(0.0, 0.95), st.floats(0.0, math.pi), angle, angle, angle)
hyperbolas = st.builds(
    lambda a, e, i, node, periapsis, share: Elements(-a, e, i, node, periapsis, share * math.acos(-1.0 / e)),
    st.floats(1e6, 1e9),
    st.floats(1.01, 5.0),
    st.floats(0.0, math.pi),
    angle,
    angle,
    st.floats(-0.9, 0.9),
)


def orbit(text, duration="2000.0"):
    return parse(replaced(BASE, STATE, text).replace("2000.0", duration), "my.toml").table.orbit


@given(st.one_of(ellipses, hyperbolas))
def test_elements_come_back_from_the_invariants_of_the_motion(elements):
    """Energy gives the axis, the eccentricity vector its length and direction, the angular momentum the plane."""
    r, v = (np.array(found) for found in from_elements(elements, EARTH.gravity))
    a, e, i, node, periapsis, anomaly = elements
    distance = np.linalg.norm(r)
    energy = v @ v / 2 - EARTH.gravity / distance
    scale = EARTH.gravity / distance
    assert energy == pytest.approx(-EARTH.gravity / (2 * a), abs=1e-12 * scale)
    h = np.cross(r, v)
    pole = np.array([math.sin(i) * math.sin(node), -math.sin(i) * math.cos(node), math.cos(i)])
    assert h / np.linalg.norm(h) == pytest.approx(pole, abs=1e-11)
    assert h @ h == pytest.approx(EARTH.gravity * a * (1 - e * e), rel=1e-11)
    eccentricity = np.cross(v, h) / EARTH.gravity - r / distance
    ascent = np.array([math.cos(node), math.sin(node), 0.0])
    to_perigee = math.cos(periapsis) * ascent + math.sin(periapsis) * np.cross(pole, ascent)
    assert eccentricity == pytest.approx(e * to_perigee, abs=1e-11)
    onward = math.cos(anomaly) * to_perigee + math.sin(anomaly) * np.cross(pole, to_perigee)
    assert r / distance == pytest.approx(onward, abs=1e-11)


def test_elements_agree_with_basilisk():
    motion = pytest.importorskip("Basilisk.utilities.orbitalMotion", reason="Basilisk comes with the test extra")
    for elements in (
        Elements(7e6, 0.0, 1.7, 0.3, 0.0, 2.0),
        Elements(2.66e7, 0.74, math.radians(63.4), 5.0, math.radians(270), 1.0),
        Elements(-4e7, 1.5, 0.4, 1.0, 2.0, -1.2),
    ):
        given_to = motion.ClassicElements()
        given_to.a, given_to.e, given_to.i, given_to.Omega, given_to.omega, given_to.f = elements
        for mine, theirs in zip(
            from_elements(elements, EARTH.gravity), motion.elem2rv(EARTH.gravity, given_to), strict=True
        ):
            assert mine == pytest.approx(theirs, abs=1e-12 * np.linalg.norm(theirs))


# Most orbits that come to mind start too low for any surface to be met.
@settings(suppress_health_check=[HealthCheck.filter_too_much])
@given(st.one_of(ellipses, hyperbolas), st.floats(0.05, 2.0))
def test_the_moment_of_coming_down_is_on_the_orbit(elements, share):
    """Kepler's equation, by quadrature of the radius: dt = r dr / sqrt(2 (E r^2 + mu r) - h^2), free of the formula used."""
    state = from_elements(elements, EARTH.gravity)
    low, begun = lowest(*state, EARTH.gravity), math.hypot(*state[0])
    assert low == pytest.approx(elements.semi_major_axis * (1 - elements.eccentricity), rel=1e-9)
    ends = elements.eccentricity < 1.0
    assert highest(*state, EARTH.gravity) == pytest.approx(
        elements.semi_major_axis * (1 + elements.eccentricity) if ends else math.inf, rel=1e-6
    )
    surface = low * (1 + share)
    assume(surface < 0.99 * begun)
    assert meets_at(*state, EARTH.gravity, 0.99 * low) == math.inf
    moment = meets_at(*state, EARTH.gravity, surface)
    radial = np.dot(*state)
    if radial >= 0.0 and elements.eccentricity > 1.0:
        assert moment == math.inf
        return
    # From the surface back in time, which is as long, the same motion mirrored reaches the start.
    a, e = elements.semi_major_axis, elements.eccentricity
    x = np.linspace(0.0, 1.0, 20001)

    def between(inner, outer):
        r = inner + (outer - inner) * (x * x * (3 - 2 * x))
        # Substituted so that the turning points leave no poles.
        slope = (outer - inner) * 6 * x * (1 - x)
        under = EARTH.gravity * (2 * r - r * r / a - a * (1 - e * e))
        inside = np.where(under > 0, r * slope / np.sqrt(np.maximum(under, 1e-300)), 0.0)
        return np.trapezoid(inside, x)

    high = a * (1 + e)
    expected = between(surface, begun) if radial < 0 else between(begun, high) + between(surface, high)
    assert moment == pytest.approx(expected, rel=2e-2, abs=1.0)


def test_a_parabola_has_no_highest_place():
    assert highest((1.0, 0.0, 0.0), (0.0, 2.0, 0.0), 2.0) == math.inf


def test_a_circular_orbit_by_altitude_and_inclination():
    found = orbit('altitude = "622 km"\ninclination = "97.9 deg"')
    r, v = found.start
    assert math.hypot(*r) == pytest.approx(6378137.0 + 622e3, rel=1e-15)
    assert math.hypot(*v) == pytest.approx(math.sqrt(3.986e14 / 7000137.0), rel=1e-14)
    assert np.dot(r, v) == pytest.approx(0.0, abs=1e-3)
    assert (r[1], r[2]) == (0.0, 0.0)
    assert math.atan2(v[2], v[1]) == pytest.approx(math.radians(97.9), rel=1e-14)
    later = orbit('altitude = "622 km"\ninclination = 0\ntrue_anomaly = "90 deg"\nraan = "-90 deg"')
    assert later.start[0] == pytest.approx((7000137.0, 0, 0), abs=1e-6)
    moon = orbit('altitude = "100 km"\ninclination = 0\ngravitational_parameter = "4902.8 km^3/s^2"')
    assert math.hypot(*moon.start[0]) == pytest.approx(1837.4e3)
    assert body_of(4.9028e12) == "Moon"
    rock = orbit("altitude = 1e4\ninclination = 0\ngravitational_parameter = 4.46e5\nradius = 8e3")
    assert math.hypot(*rock.start[0]) == pytest.approx(18e3)


def test_keplerian_elements_in_a_file():
    text = 'semi_major_axis = "26600 km"\neccentricity = 0.7\ninclination = "63.4 deg"\nargument_of_perigee = "270 deg"'
    found = orbit(text)
    expected = from_elements(Elements(2.66e7, 0.7, math.radians(63.4), 0.0, 1.5 * math.pi, 0.0), 3.986e14)
    assert np.allclose(found.start, expected, rtol=1e-12)


def test_a_low_altitude_that_states_its_unit_is_taken():
    assert orbit('altitude = "90 km"\ninclination = 1', "1.0").altitude == 9e4
    assert orbit('altitude = 5e4\ninclination = 1\ngravitational_parameter = "4902.8 km^3/s^2"', "1.0").altitude == 5e4


FAULTS = rows("""
 | orbit.position | altitude or semi_major_axis
position = [7e6, 0, 0] | orbit.velocity | together
STATE↵inclination = 1 | orbit.inclination | either
altitude = 5e5↵semi_major_axis = 7e6↵inclination = 1 | orbit.semi_major_axis | either
altitude = 5e5 | orbit.inclination | angle
altitude = 5e5↵inclination = 1↵eccentricity = 0.1 | orbit.eccentricity | semi_major_axis
altitude = 5e5↵inclination = 1↵gravitational_parameter = 1e10 | orbit.radius | altitude is measured
semi_major_axis = 7e6↵eccentricity = 1↵inclination = 1 | orbit.semi_major_axis | eccentricity
semi_major_axis = 7e6↵eccentricity = 2↵inclination = 1 | orbit.semi_major_axis | negative
semi_major_axis = -7e6↵eccentricity = 2↵inclination = 1↵true_anomaly = 2.2 | orbit.true_anomaly | 120
altitude = 5e5↵inclination = 97 | orbit.inclination | "97 deg"
altitude = 620↵inclination = 1 | orbit.altitude: found 620 | "620 km" or "620 m"
altitude = "620 m"↵inclination = 1 | orbit.altitude: found "620 m" | 620 m is inside; is 620 km meant
altitude = "0.62 km"↵inclination = 1 | orbit.altitude | is 620 km meant
altitude = "35.786 km"↵inclination = 1 | orbit.altitude | is 35786 km meant
altitude = 35786.0↵inclination = 0 | orbit.altitude | "35786 km"
position = [7000, 0, 0]↵velocity = [0, 7550, 0] | orbit.position | 6378.14 km | in m
semi_major_axis = 7000↵inclination = 1 | orbit.semi_major_axis | in m
position = ["6300 km", 0, 0]↵velocity = [0, 7900, 0] | orbit.position | the Earth's radius
STATE↵radius = 8e6 | orbit.position | 8000 km
STATE↵gravitational_parameter = 398600.4 | orbit.gravitational_parameter | Earth | km^3/s^2
position = [50, 0, 0]↵velocity = [0, 3, 0]↵gravitational_parameter = 4.46e5 | orbit.position | outside the central body
position = ["7000 km", 0, 0]↵velocity = [0, 7.55, 0] | orbit.velocity | surface | after 385 | m/s
position = ["7000 km", 0, 0]↵velocity = [0, 0, 0] | orbit.velocity | through
position = ["7000 km", 0, 0]↵velocity = [100, 0, 0] | orbit.velocity | through
semi_major_axis = 6.5e6↵eccentricity = 0.1↵inclination = 1↵true_anomaly = 3.14 | orbit.semi_major_axis | surface
""")


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row[1])
def test_what_is_refused_of_an_orbit(row):
    with refused(*row[1:], start="my.toml: "):
        orbit(row[0].replace("STATE", STATE), "6000.0")


def test_an_orbit_that_comes_down_after_the_run_is_warned_of():
    with pytest.warns(UserWarning, match=r"orbit\.velocity: the orbit meets the Earth's surface after \d+"):
        orbit(FALLING, "20.0")
    with pytest.raises(InputError, match="surface"):
        orbit(FALLING, "6000.0")
    with pytest.warns(UserWarning, match=r"orbit\.velocity: 708 times the speed of escape"):
        orbit('position = ["7000 km", 0, 0]\nvelocity = [0, "7557 km/s", 0]')


def test_a_plain_altitude_in_thousandths_of_a_metre_is_refused():
    """500 km times a thousand is farther than the Moon; with its unit it is taken, and so is a geostationary one."""
    with pytest.raises(InputError, match=r"orbit\.altitude: found 500000000.0; .*is 500000 m meant\?$"):
        orbit("altitude = 500000e3\ninclination = 0")
    for text in ('altitude = "500000 km"', "altitude = 35786e3"):
        orbit(f"{text}\ninclination = 0")
