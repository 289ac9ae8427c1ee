"""Targets: rates are the differences of the attitudes that they give; stations, Sun and yaw against the IAU's routines."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.algebra.quaternion import NO_TURN, stretch, to_reference
from starhold.algebra.structured import Buffer
from starhold.algebra.vector import cross, dot, scale, unit
from starhold.certification.target_motion import NOWHERE
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import find, fit
from starhold.parts.contract import UNLIMITED
from starhold.parts.craft import EARTH
from starhold.parts.targets import history, orbital
from starhold.parts.targets.history import tabulate
from starhold.scenario.reading import parse
from tests.algebra.readers import angles, close, directions, from_axis_angle, quaternions
from tests.making import orbited
from tests.missions import cubesat
from tests.parts.files import part
from tests.tiers import leading

erfa = pytest.importorskip("erfa", reason="the routines of the IAU come with the test extra")
EPOCH = (2026.0, 3.0, 5.0, 6.0, 30.0, 0.0)
JULIAN = 2400000.5, sum(erfa.cal2jd(2026, 3, 5)) - 2400000.5 + 6.5 / 24.0
LATITUDE, LONGITUDE = math.radians(52.0), math.radians(80.0)
PERIOD = 0.5


def conic(eccentricity, anomaly, axis, lean, size=7.0e6):
    """Position and velocity at a true anomaly on an orbit of semi-latus rectum `size`, in any plane."""
    speed = math.sqrt(EARTH / size)
    c, s = math.cos(anomaly), math.sin(anomaly)
    r = size / (1.0 + eccentricity * c)
    plane = from_axis_angle(axis, lean)
    return to_reference(plane, (r * c, r * s, 0.0)), to_reference(plane, (-speed * s, speed * (eccentricity + c), 0.0))


conics = st.builds(conic, st.just(0.0) | st.floats(0.0, 0.8), st.floats(0.0, 2.0 * math.pi), directions, angles)


def in_orbit(position, velocity, before):
    """The orbital frame."""
    return orbital.goal((), SimpleNamespace(position=position, velocity=velocity), 0, before)


@given(conics, quaternions)
def test_orbital_axes_point_where_they_should_at_keplers_rate_and_never_jump(place, before):
    position, velocity = place
    found = in_orbit(position, velocity, before)
    attitude = found.attitude
    first, second, third = (to_reference(attitude, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    assert close(third, scale(-1.0, unit(position)), 2e-15)
    assert close(second, scale(-1.0, unit(cross(position, velocity))), 4e-15)
    assert close(first, cross(second, third), 4e-15)
    assert dot(first, velocity) > 0.0
    assert abs(sum(c * c for c in attitude) - 1.0) < 2e-15
    # h/r2 about the orbit normal.
    assert -found.rate[1] * dot(position, position) == pytest.approx(math.sqrt(EARTH * 7.0e6), rel=1e-13)
    assert (found.rate[0], found.rate[2], found.acceleration[0], found.acceleration[2]) == (0.0, 0.0, 0.0, 0.0)
    # Of q and -q it is the one nearer to that before.
    assert sum(x * y for x, y in zip(attitude, before, strict=True)) >= -1e-15
    opposite = stretch(-1.0, attitude)
    assert in_orbit(position, velocity, opposite).attitude == opposite


def tumble(seed, count=9, step=0.5):
    """Times and attitudes of a motion with turns of up to a radian between them, of arbitrary signs."""
    generator = np.random.default_rng(seed)
    times = np.cumsum(generator.uniform(0.5, 1.5, count))
    attitude, attitudes = Rotation.random(rng=generator), []
    for turn in generator.normal(scale=step, size=(count, 3)):
        attitude = attitude * Rotation.from_rotvec(turn)
        attitudes.append(attitude.as_quat(scalar_first=True) * generator.choice([-1.0, 1.0]))
    return times, np.array(attitudes)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.99))
def test_table_passes_through_its_points_with_the_derivatives_of_its_attitudes(seed, share):
    times, attitudes = tumble(seed)
    rows = tabulate(times, attitudes, times)
    assert rows.shape == (len(times), 10)
    assert np.abs(np.abs(np.sum(rows[:, :4] * attitudes, axis=1)) - 1.0).max() < 1e-12
    h = 1e-4
    for middle in (times[0] + share * (times[-1] - times[0]), 0.5 * (times[3] + times[4])):
        rows = tabulate(times, attitudes, [middle - h, middle, middle + h])
        rate, acceleration = rows[1, 4:7], rows[1, 7:]
        # In target axes: the turn from one row to the next is measured in the axes that turn.
        turns = Rotation.from_quat(rows[:, :4], scalar_first=True)
        np.testing.assert_allclose(rate, (turns[0].inv() * turns[2]).as_rotvec() / (2.0 * h), rtol=0.0, atol=1e-5)
        # The acceleration is continuous, its slope is not: over a point of the table the difference is of first order.
        np.testing.assert_allclose(acceleration, (rows[2, 4:7] - rows[0, 4:7]) / (2.0 * h), rtol=0.0, atol=5e-3)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 399))
def test_table_has_no_jumps_and_starts_on_the_side_it_is_given(seed, step):
    times, attitudes = tumble(seed)
    rows = tabulate(times, attitudes, np.linspace(times[0], times[-1], 400))
    # Of q and -q the first attitude given is kept, as the fixed attitude of an inertial target is.
    np.testing.assert_allclose(rows[0, :4], attitudes[0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rows[:, :4], axis=1), 1.0, atol=1e-14)
    assert (np.sum(rows[1:, :4] * rows[:-1, :4], axis=1) > 0.9).all()
    found = history.goal(Buffer(rows.ravel().tolist()), None, step, None)
    assert [*found.attitude, *found.rate, *found.acceleration] == rows[step].tolist()


def test_table_goes_through_full_turns():
    times = np.linspace(0.0, 10.0, 41)
    attitudes = Rotation.from_rotvec(np.outer(times, [0.0, 0.0, 4.0 * math.pi / 10.0])).as_quat(scalar_first=True)
    rows = tabulate(times, attitudes, np.linspace(0.0, 10.0, 101))
    np.testing.assert_allclose(rows[50, :4], (-1.0, 0.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(rows[-1, :4], (1.0, 0.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(rows[:, 4:7], np.tile((0.0, 0.0, 0.4 * math.pi), (101, 1)), atol=1e-10)


EVEN, COVERED = (0.0, 2.5, 5.0, 7.5, 10.0), "the target history covers 0 to 10 s"


@pytest.mark.parametrize(
    ("times", "attitudes", "samples", "words"),
    [
        *((EVEN, [NO_TURN] * 5, samples, COVERED) for samples in ([-0.1, 1], [0, 10.1], [1, 12, 3], [1, math.nan])),
        ([0.0, 2.0, 1.0, 3.0], [NO_TURN] * 4, [0.0, 0.5], "."),
        ([0.0, 1.0, 1.0, 3.0], [NO_TURN] * 4, [0.0, 0.5], "."),
        ([0.0, 1.0, 3.0], [NO_TURN] * 4, [0.0, 0.5], "."),
        ([0.0, 1.0, 3.0], [NO_TURN, (0.0, 0.0, 0.0, 0.0), NO_TURN], [0.0, 0.5], "."),
        ([0.0, 1.0, 3.0], [NO_TURN, (math.nan, 0.0, 0.0, 1.0), NO_TURN], [0.0, 0.5], "."),
    ],
)
def test_tables_that_mean_nothing_and_times_not_covered_are_refused(times, attitudes, samples, words):
    with pytest.raises(ValueError, match=words):
        tabulate(times, attitudes, samples)


def orbit(position, velocity, times):
    """Positions and velocities (n, 3) in two-body motion."""
    return np.hsplit(orbited(position, velocity, times), 2)


def goals(name, steps, places, speeds, **params):
    """The goals of an installed target at these control steps, and the rotations that take body axes to inertial ones."""
    target = find("target", name)
    numbers, before, found = fit("target", name, *target.params(**params)).prepared(PERIOD), (1.0, 0.0, 0.0, 0.0), []
    for step, place, speed in zip(steps, places.tolist(), speeds.tolist(), strict=True):
        state = State(before, (0.0,) * 3, tuple(place), tuple(speed), (0.0,) * 3)
        found.append(target.module.goal(numbers, state, int(step), before))
        before = found[-1].attitude
    return found, Rotation.from_quat(np.array([goal.attitude for goal in found]), scalar_first=True)


START = np.array([6.878e6, 0.0, 0.0]), np.array([0.0, -1.017e3, 7.544e3])
# Near the zero meridian, over the equator: the station is in view.
NOON = {"epoch": (2026.0, 3.0, 5.0, 13.0, 5.0, 0.0)}
STRIP = (
    dict(
        zip(
            ("latitude", "longitude", "to_latitude", "to_longitude", "begin", "duration"),
            (0.1, 0.0, 0.3, -0.1, 60.0, 300.0),
            strict=True,
        )
    )
    | NOON
)
CASES = {
    "orbital": {},
    "sun": {"reference": (0.3, -0.2, 1.0), **NOON},
    "yaw-steering": NOON,
    "ground-station": {"latitude": 0.1, "longitude": 0.0, "elevation": 0.0, **NOON},
    "ground-strip": STRIP,
    "scan": {"amplitude": 0.4, "swing": 800.0},
    "scan raster": {"amplitude": 0.4, "swing": 300.0, "shape": 1},
}


@pytest.mark.parametrize("name", CASES)
def test_rates_and_accelerations_are_those_of_the_attitude(name):
    steps = np.arange(0, 900, 1)
    places, speeds = orbit(START[0], 1.05 * START[1], steps * PERIOD)
    found, rotations = goals(name.partition(" ")[0], steps, places, speeds, **CASES[name])
    differences = (rotations[:-2].inv() * rotations[2:]).as_rotvec() / (2.0 * PERIOD)
    rates, accelerations = (np.array([getattr(goal, key) for goal in found]) for key in ("rate", "acceleration"))
    # A jump of the target, as a station comes into view, is no rate.
    smooth = np.linalg.norm(differences, axis=1) < 0.1
    if name in ("ground-strip", "scan raster"):
        # Where the place begins to move, and where lines turn round.
        jumps = [np.abs(np.diff(x, axis=0)).max(axis=1) > 0.05 * np.abs(x).max() for x in (rates, accelerations)]
        smooth &= ~(jumps[0] | jumps[1])[1:] & ~(jumps[0] | jumps[1])[:-1]
    assert smooth.mean() > 0.97
    size = np.abs(rates).max()
    assert size > (1e-8 if name == "sun" else 1e-3)
    assert np.abs(differences - rates[1:-1])[smooth].max() < 2e-5 * size
    slopes = (rates[2:] - rates[:-2]) / (2.0 * PERIOD)
    steady = np.abs(slopes).max(axis=1) < 1e-3
    assert np.abs(slopes - accelerations[1:-1])[smooth & steady].max() < 1e-4 * np.abs(accelerations).max() + 1e-18


def test_a_strip_is_followed_on_the_ellipsoid_of_the_iau():
    """The axis meets the ellipsoid at places that lie in the plane of the ends, evenly spread between them."""
    steps = np.arange(0, 900, 5)
    places, speeds = orbit(*START, steps * PERIOD)
    turns, dates = goals("ground-strip", steps, places, speeds, **STRIP)[1], steps * PERIOD / 86400.0
    spins = Rotation.from_rotvec(np.outer(erfa.gmst82(JULIAN[0], JULIAN[1] + (6.0 + 35.0 / 60.0) / 24.0 + dates), [0, 0, 1]))
    here, ahead = spins.inv().apply(places), spins.inv().apply(turns.apply([0.0, 0.0, 1.0]))
    shrink = np.array([1.0, 1.0, 1.0 / (1.0 - 1.0 / 298.257223563)]) / 6378137.0
    p, d = here * shrink, ahead * shrink
    b, c = np.sum(p * d, axis=1), np.sum(p * p, axis=1) - 1.0
    met = here + ahead * ((-b - np.sqrt(b * b - np.sum(d * d, axis=1) * c)) / np.sum(d * d, axis=1))[:, None]
    first, last = (np.array(erfa.gd2gc(1, *place, 0.0)) for place in ((0.0, 0.1), (-0.1, 0.3)))
    first, last, met = (x / np.linalg.norm(x, axis=-1)[..., None] for x in (first, last, met))
    share = np.clip((steps * PERIOD - 60.0) / 300.0, 0.0, 1.0)[:, None]
    angle = math.acos(first @ last)
    wanted = (np.sin((1.0 - share) * angle) * first + np.sin(share * angle) * last) / math.sin(angle)
    assert np.abs(met - wanted).max() < 1e-6


@pytest.mark.parametrize("shape", ["sinusoidal", "raster"])
def test_a_scan_swings_across_the_motion(shape):
    steps = np.arange(0, 600)
    places, speeds = orbit(*START, steps * PERIOD)
    params = {"amplitude": 0.4, "swing": 100.0, "shape": ("sinusoidal", "raster").index(shape), "turning": 0.1}
    turns = goals("scan", steps, places, speeds, **params)[1]
    axis, normal = turns.apply([0.0, 0.0, 1.0]), np.cross(places, speeds)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    down = -places / np.linalg.norm(places, axis=1)[:, None]
    assert np.abs(np.sum(axis * np.cross(normal, down), axis=1)).max() < 1e-14
    angles, phase = np.arctan2(np.sum(axis * normal, axis=1), np.sum(axis * down, axis=1)), steps * PERIOD / 100.0
    if shape == "sinusoidal":
        assert np.abs(angles - 0.4 * np.sin(math.tau * phase)).max() < 1e-14
    else:
        straight = 2.0 / math.pi * np.arcsin(np.sin(math.tau * phase))
        flat = np.abs(straight) < 0.89
        assert np.abs(angles - 0.4 * straight / 0.95)[flat].max() < 1e-14
        assert np.abs(angles).max() == pytest.approx(0.4, abs=1e-14)


def test_a_station_is_seen_where_the_iau_s_routines_have_it():
    steps = np.arange(0, 6000, 20)
    places, speeds = orbit(*START, steps * PERIOD)
    least, site = math.radians(10.0), erfa.gd2gc(1, LONGITUDE, LATITUDE, 80.0)
    params = {"latitude": LATITUDE, "longitude": LONGITUDE, "height": 80.0, "elevation": least, "epoch": EPOCH}
    _, turns = goals("ground-station", steps, places, speeds, **params)
    up, seen = np.array(erfa.s2c(LONGITUDE, LATITUDE)), 0
    for step, place, speed, turn in zip(steps, places, speeds, turns, strict=True):
        spin = Rotation.from_rotvec([0.0, 0.0, erfa.gmst82(JULIAN[0], JULIAN[1] + step * PERIOD / 86400.0)])
        ahead = spin.apply(site) - place
        height = math.asin(-spin.apply(up) @ ahead / np.linalg.norm(ahead))
        if abs(height - least) < 1e-6:
            continue
        wanted = ahead if height > least else -place
        pointed = turn.apply([0.0, 0.0, 1.0])
        assert np.linalg.norm(np.cross(pointed, wanted)) < 2e-7 * np.linalg.norm(wanted)
        assert pointed @ wanted > 0.0
        # The second axis lies in the plane of this direction and the orbit's normal, against that.
        normal, other = np.cross(place, speed), turn.apply([0.0, 1.0, 0.0])
        assert abs(other @ np.cross(wanted, normal)) < 1e-9 * np.linalg.norm(np.cross(wanted, normal))
        assert other @ normal < 0.0
        seen += height > least
    assert 0 < seen < len(steps)


def sun_at(step):
    """The direction of the Sun by the IAU's ephemeris, from axes of J2000 to those of date, in which orbits are."""
    earth = erfa.epv00(JULIAN[0], JULIAN[1] + (step * PERIOD + 69.2) / 86400.0)[0]["p"]
    return erfa.pmat76(*JULIAN) @ (-earth / np.linalg.norm(earth))


def test_yaw_is_that_of_navigation_satellites():
    radius, tilt = 26560e3, math.radians(55.0)
    steps = np.arange(0, 80000, 800)
    speed = math.sqrt(EARTH / radius)
    start = np.array([radius, 0.0, 0.0]), speed * np.array([0.0, math.cos(tilt), math.sin(tilt)])
    places, speeds = orbit(*start, steps * PERIOD)
    yaws = []
    for step, place, speed, turn in zip(
        steps, places, speeds, goals("yaw-steering", steps, places, speeds, epoch=EPOCH)[1], strict=True
    ):
        sun, normal = sun_at(step), np.cross(place, speed) / np.linalg.norm(np.cross(place, speed))
        beta = math.asin(sun @ normal)
        ahead = np.cross(normal, place / np.linalg.norm(place))
        midnight = math.atan2(sun @ ahead, -(sun @ place) / np.linalg.norm(place))
        x = turn.apply([1.0, 0.0, 0.0])
        yaws.append(math.atan2(x @ -normal, x @ ahead))
        assert abs(math.remainder(yaws[-1] - math.atan2(-math.tan(beta), math.sin(midnight)), math.tau)) < 1e-3
        # The axis that panels turn about is square to the Sun.
        assert abs(turn.apply([0.0, 1.0, 0.0]) @ sun) < 3e-4
        assert turn.apply([0.0, 0.0, 1.0]) @ place < -(1.0 - 1e-12) * radius
    assert np.ptp(np.unwrap(yaws)) > 1.0


@pytest.mark.parametrize("ephemeris", [0, 1])
@pytest.mark.parametrize("reference", [(0.0, 0.0, 1.0), (0.3, -0.4, -1.0), (1.0, 1.0, 1.2)])
def test_a_body_towards_the_sun_turns_no_faster_than_it_says(reference, ephemeris):
    """The bounds are those of every year: the Sun is fastest in January, its axes where it is nearest to the reference."""
    epoch = (2026.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    found = fit("target", "sun", (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), reference, epoch, ephemeris)
    numbers, most = found.prepared(3600.0), found.part.module.motion(found.params, NOWHERE)
    goals = [found.part.module.goal(numbers, None, step, NO_TURN) for step in range(0, 8766, 24)]
    for told, part_of, sharp in zip(most[:2], (1, 2), (0.97, 0.05), strict=True):
        largest = max(np.linalg.norm(goal[part_of]) for goal in goals)
        assert sharp * (reference[0] == 0.0) * told < largest <= told
    assert found.part.module.motion(found.params._replace(reference=(1.0, 0.0, 0.1)), NOWHERE) == UNLIMITED


def test_the_third_axis_points_at_the_sun():
    steps = np.array([0, 7200, 172800])
    still = np.tile(START[0], (3, 1)), np.tile(START[1], (3, 1))
    for step, turn in zip(steps, goals("sun", steps, *still, epoch=EPOCH)[1], strict=True):
        assert math.acos(min(1.0, turn.apply([0.0, 0.0, 1.0]) @ sun_at(step))) < math.radians(0.012)
        assert abs(turn.apply([0.0, 1.0, 0.0]) @ [0.0, 0.0, 1.0]) < 1e-12


LAW = '[[law]]\ntype = "lyapunov"\nk_rate = 0.02\nk_attitude = 0.004\n'


@pytest.mark.parametrize(
    "keys",
    leading(
        [
            'type = "sun"\n',
            'type = "yaw-steering"\nother = [0, 1, 0]\n',
            'type = "ground-station"\nlatitude = "60 deg"\nlongitude = "20 deg"\n',
        ]
    ),
)
def test_a_law_holds_the_target_from_a_scenario(keys):
    start = {"angles": '[0, 0, 0]\nrelative_to = "target"', "rate": (0, 0, 0)}
    text = cubesat(LAW, part(keys), **start)
    run = sh.simulate(parse(text, "own"))
    assert 2.0 * np.linalg.norm(run.attitude_error.values[:, 1:], axis=1).max() < 2e-4
    (certificate,) = sh.certify(parse(text, "own"))
    name = keys.split('"')[1]
    without = [f"without:target {name}" in claim.assumptions for claim in certificate.claims]
    assert without
    assert not any(without)
