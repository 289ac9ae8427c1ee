"""Conditions of modes that can never hold are refused in one line; those that only did not hold in a flight are named."""

import math

import numpy as np
import pytest

import starhold as sh
from starhold.laws.conditions import TESTED, Facts, Sight, Watch, sky_at, station_at
from starhold.scenario import possible
from starhold.scenario.reading import parse
from tests.making import built
from tests.missions import GUARDED, WHEELS, cubesat, mode
from tests.refusals import refused, rows

PYRAMID = WHEELS.split("[[part]]", 1)[0]
# Inclined by 23.2 deg.
LOW = ('"-1.017 km/s", "7.544 km/s"', '"7.0 km/s", "3.0 km/s"')


def text(condition, *tables, guard=GUARDED):
    ends = mode("work", f"until = {{ {condition} }}") + mode("pass") + mode("safe")
    return cubesat(*tables, guard) + ends


# Four wheels of 15 mN m s on the faces of a pyramid: at most 4 x 15 mN m s / sqrt(3) together, along its axis.
REFUSED = rows("""
wheel_momentum_above = 0.0351 | mode work: until.wheel_momentum_above: found 0.0351 N m s; allowed: less than 0.03464 N m s
wheel_momentum_above = "1 N m s" | mode work: until.wheel_momentum_above: found 1 N m s
elevation_above = "10 deg", latitude = "45 deg", longitude = 0 | elevation_above: found 10 deg; allowed: less than 3.695 deg
elevation_above = "1 deg", latitude = "-60 deg", longitude = 0 | elevation_above: found 1 deg; allowed: less than -9.
angle_above = "180 deg" | until.angle_above: found 180 deg; allowed: less than 180 deg
sun_angle_above = "180 deg", axis = [1, 0, 0] | until.sun_angle_above: found 180 deg
not_after = 20, after = 30 | until.not_after: found 20 s; allowed: a time from 30 s on
not_before = "10 s", not_after = 20, dwell = 30 | until.not_after: found 20 s; allowed: a time from 40 s on
""")


@pytest.mark.parametrize(("condition", "told"), REFUSED)
def test_what_can_never_hold_is_refused_in_one_line(condition, told):
    with refused(told):
        built(parse(text(condition, PYRAMID).replace(*LOW), "mission.toml"))


@pytest.mark.parametrize(
    "condition",
    [
        "wheel_momentum_above = 0.0346",
        'elevation_above = "3 deg", latitude = "45 deg", longitude = 0',
        'angle_above = "179.9 deg"',
        "not_after = 20, after = 15, dwell = 5",
    ],
)
def test_what_can_hold_is_read(condition):
    built(parse(text(condition, PYRAMID).replace(*LOW), "mission.toml"))


def test_momentum_needs_wheels_and_losses_as_many():
    with refused("until.wheel_momentum_above: found 0.001 N m s; allowed: a loop with wheels"):
        built(parse(text("wheel_momentum_above = 0.001"), "mission.toml"))
    guard = GUARDED.replace('on_loss = "safe"', 'on_loss = "safe"\nwheels_lost = 5')
    with refused("law mission: wheels_lost: found 5; allowed: at most the number of wheels, 4"):
        built(parse(text("after = 5", PYRAMID, guard=guard), "mission.toml"))


@pytest.mark.parametrize("inclination", [5.0, 28.5, 51.6, 97.5, 150.0])
def test_no_station_ever_sees_an_orbit_above_its_bound(inclination):
    """Against the elevations, by the equation that flies, at all places of an ellipse and at all turns of the Earth."""
    random, tilt = np.random.default_rng(int(inclination)), math.radians(inclination)
    argument, size, eccentricity = random.uniform(0.0, math.tau), 8.0e6, 0.01
    along = np.array([math.cos(argument), math.sin(argument) * math.cos(tilt), math.sin(argument) * math.sin(tilt)])
    across = np.array([-math.sin(argument), math.cos(argument) * math.cos(tilt), math.cos(argument) * math.sin(tilt)])
    anomalies = np.linspace(0.0, math.tau, 73)
    radii = size * (1.0 - eccentricity**2) / (1.0 + eccentricity * np.cos(anomalies))
    path = radii[:, None] * (np.cos(anomalies)[:, None] * along + np.sin(anomalies)[:, None] * across)
    speed = math.sqrt(3.986004418e14 * (1.0 + eccentricity) / (size * (1.0 - eccentricity)))
    orbit = f"position = {(path[0]).tolist()}\nvelocity = {(speed * across).tolist()}"
    loop = built(parse(text("after = 5").replace(_orbit_of(text("after = 5")), orbit), "mission.toml"))
    sky = sky_at((2026.0, 3.0, 5.0, 6.0, 30.0, 0.0))
    for latitude in (-85.0, -60.0, -30.0, 0.0, 30.0, 60.0, 85.0):
        settings = {"latitude": math.radians(latitude), "longitude": 0.3, "height": 0.0}
        _, bound = possible._highest_seen(loop, settings)
        settings["station"] = station_at(settings)
        seen = max(_elevation(place, hour, sky, settings) for place in path for hour in range(24))
        assert seen < bound + 1e-9
        # It is hardly wider than its margins: near the horizon a degree of latitude is some degrees of elevation.
        assert seen > 0.5 or bound - seen < 0.15


def _orbit_of(scenario):
    lines = scenario.splitlines()
    return "\n".join(line for line in lines if line.startswith(("position", "velocity")))


def _elevation(place, hour, sky, settings):
    facts = Facts(_Period(), Watch(3600.0 * hour, sky, (), 0.0), Sight(_State(tuple(place.tolist())), (), None))
    return math.asin(TESTED["elevation"].value(facts, settings))


class _Period:
    period = 1.0


class _State:
    def __init__(self, position):
        self.position = position


@pytest.mark.parametrize(
    ("until", "back", "said"),
    [
        (
            'elevation_above = "10 deg", latitude = "40 deg", longitude = 0, to = "pass"',
            'after = 5000, to = "dark"',
            (
                "pass never begins: elevation_above holds at no time of this flight",
                "dark never begins: its condition needs 5000 s, and the flight ends at 300 s",
            ),
        ),
        (
            'sunlight_below = 0.5, to = "dark"',
            'after = 5000, to = "pass"',
            (
                "pass never begins: its condition needs 5000 s, and the flight ends at 300 s",
                "dark never begins: sunlight_below holds at no time of this flight",
            ),
        ),
        ('rate_below = 1e-9, to = "pass"', 'after = 10, to = "dark"', ("pass never begins",)),
    ],
)
def test_a_flight_names_the_modes_that_never_began(until, back, said):
    modes = mode("work", f"until = {{ {until} }}", f"back = {{ {back} }}")
    modes += mode("pass", 'until = { after = 5, to = "dark" }') + mode("dark", 'until = { after = 5, to = "work" }')
    (flight,) = sh.compare(parse(cubesat(GUARDED) + modes + mode("safe"), "mission.toml"))
    assert flight.never == said
