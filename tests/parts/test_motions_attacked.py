"""Attacks on what targets say of their largest rate and acceleration: random numbers of the parts, orbits, epochs, places on
the orbit and instants by own formulas, and climbs from the worst of them; and what they do not know of perturbed motion."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from starhold.algebra.quaternion import NO_TURN, conjugate, multiply
from starhold.certification.target_motion import motion_of
from starhold.parts import sun
from starhold.parts.catalogue import PACKAGES, fit, parts
from starhold.parts.epoch import days_of, sidereal
from starhold.parts.targets import ground_station, ground_strip, scan, slew, yaw_steering
from starhold.parts.targets.alignment import RADIUS, SPIN, geodetic
from tests.certification.flattened import MU, flattened, pull
from tests.making import ORBIT, hub
from tests.parts.attacks import EARTH, Orbit, along, climbed, epoch, orbit, size, turned, vector
from tests.tiers import fewer, leading

STATES, PARAMS, WORST = fewer(1_000_000, 100), fewer(200, 20), 10


def unit_of(a):
    """A direction and its derivatives, of a vector (3, n, 3) and its derivatives."""
    r = np.linalg.norm(a[0], axis=1, keepdims=True)
    u, c = a[0] / r, a[1] / r
    growth = (u * c).sum(1, keepdims=True)
    v = c - growth * u
    across = a[2] / r - 2.0 * growth * v
    return np.stack([u, v, across - (u * across).sum(1, keepdims=True) * u - (v * v).sum(1, keepdims=True) * u])


def product(a, b):
    """The vector product with its derivatives."""
    first = np.cross(a[1], b[0]) + np.cross(a[0], b[1])
    return np.stack([np.cross(a[0], b[0]), first, np.cross(a[2], b[0]) + 2 * np.cross(a[1], b[1]) + np.cross(a[0], b[2])])


def moved(first, second):
    """Sizes of rate and acceleration of a frame with its third axis along a direction, its second square to another."""
    z = unit_of(first)
    y = unit_of(product(z, second))
    x = product(y, z)
    # w = sum of a x a' over the axes, and so its derivative, in half.
    w = [0.5 * sum(np.cross(a[0], a[k]) for a in (x, y, z)) for k in (1, 2)]
    return tuple(np.linalg.norm(part, axis=1) for part in w)


def flown(around, x):
    """Position with its derivatives, and the orbit's normal, at anomalies."""
    place, velocity = around.at(x)
    r = np.linalg.norm(place, axis=1, keepdims=True)
    normal = np.broadcast_to(np.cross(around.axes[0], around.axes[1]), place.shape)
    return np.stack([place, velocity, -MU * place / r**3]), np.stack([normal, 0.0 * normal, 0.0 * normal])


def carried(fixed, begun, times):
    """A vector in axes of the Earth, with its derivatives, as it moves in inertial axes."""
    c, s = (np.asarray(f(2.0 * math.pi * begun + SPIN * times)) for f in (np.cos, np.sin))
    spun = [np.stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1], v[:, 2]], axis=1) for v in fixed]
    pole = np.array([[0.0, 0.0, SPIN]])
    first = spun[1] + np.cross(pole, spun[0])
    return np.stack([spun[0], first, spun[2] + 2.0 * np.cross(pole, spun[1]) + np.cross(pole, np.cross(pole, spun[0]))])


def near_plane(random, direction):
    """An orbit that comes near a direction."""
    x = along(np.array(direction) + 0.1 * random.normal(size=3))
    y = along(np.cross(x, random.normal(size=3)))
    return orbit(random)._replace(axes=np.array([x, y, np.cross(x, y)]))


# Each attack gives numbers of its part, an orbit, and a function from normal numbers (n, 2) to instants (s), anomalies, and
# the sizes of rate and acceleration there.


def of_scan(random):
    given = scan.Params(random.uniform(1e-3, 1.5), size(random, 1.0, 1e4), int(random.integers(2)), random.uniform(0.1, 1.0))
    given, around = given._replace(about=vector(random, 1.0)), orbit(random)

    def swung(phase):
        """Angle, rate and acceleration after so much of a swing, of a line with parabolas at its ends for the raster."""
        if not given.shape:
            return [
                given.amplitude * (math.tau / given.swing) ** k * f
                for k, f in enumerate((np.sin(math.tau * phase), np.cos(math.tau * phase), -np.sin(math.tau * phase)))
            ]
        # From one end, at 0, to the other; the speed grows for a time and falls for as long.
        begun = (phase + 0.25) % 1.0
        way, t, slow = np.where(begun < 0.5, 1.0, -1.0), begun % 0.5, given.turning / 4.0
        top = 2.0 * given.amplitude / (0.5 - slow)
        up, down = np.minimum(t, slow), np.maximum(t - 0.5 + slow, 0.0)
        angle = top * (up**2 / (2.0 * slow) + t - up - down**2 / (2.0 * slow)) - given.amplitude
        speed, slope = top * (up - down) / slow, np.where(t < slow, top / slow, np.where(t > 0.5 - slow, -top / slow, 0.0))
        return [way * part / given.swing**k for k, part in enumerate((angle, speed, slope))]

    def motion(x):
        phase, anomaly = x[:, 0] % 1.0, 3.0 * x[:, 1]
        a, v, slope = swung(phase)
        nadir, normal = flown(around, anomaly)
        z = unit_of(-nadir)
        # In target axes, from those of the frame.
        n = np.linalg.norm(np.cross(z[0], z[1]), axis=1)
        slow = (normal[0] * np.cross(z[0], z[2])).sum(1)
        ahead = np.array([0.0, -1.0, 0.0])
        about = along(np.array(given.about))
        turn = np.column_stack([np.cos(a / 2.0), *(np.sin(a / 2.0)[:, None] * about).T])
        carried = [turned(turn, np.outer(part, ahead)) for part in (n, slow)]
        rate = carried[0] + np.outer(v, about)
        gained = carried[1] + np.outer(slope, about) + np.cross(carried[0], np.outer(v, about))
        return phase * given.swing, anomaly, np.linalg.norm(rate, axis=1), np.linalg.norm(gained, axis=1)

    return scan, given, around, motion


def of_slew(random):
    begun, ended = (tuple(along(random.normal(size=4)).tolist()) for _ in range(2))
    given = slew.Params(ended, size(random, 1e-4, 0.1), size(random, 1e-6, 1e-2), begun)
    # Turns the shorter way.
    angle = 2.0 * math.acos(min(1.0, abs(np.dot(begun, ended))))
    up = min(given.rate / given.acceleration, math.sqrt(angle / given.acceleration))
    flat = angle / (given.acceleration * up) - up

    def motion(x):
        time = x[:, 0] % 1.0 * (2.0 * up + flat)
        rate = given.acceleration * np.minimum(np.minimum(time, up), 2.0 * up + flat - time)
        return time, 0.0 * time, rate, np.where((time < up) | (time > up + flat), given.acceleration, 0.0)

    return slew, given, orbit(random), motion


def of_yaw(random):
    given, around = yaw_steering.Params(epoch=epoch(random), ephemeris=int(random.integers(2))), orbit(random)
    numbers, times = sun.prepared(given.epoch, given.ephemeris), np.linspace(0.0, 86400.0, 25)
    seen = np.array([sun.sun(float(t), numbers).direction for t in times])

    def motion(x):
        time, anomaly = x[:, 0] % 1.0 * 86400.0, 3.0 * x[:, 1]
        light = np.stack([np.interp(time, times, column) for column in seen.T], axis=1)
        slow = np.stack([light, np.broadcast_to((seen[-1] - seen[0]) / 86400.0, light.shape), 0.0 * light])
        return time, anomaly, *moved(-flown(around, anomaly)[0], slow)

    return yaw_steering, given, around, motion


def of_station(random):
    place = random.uniform(-1.5, 1.5), random.uniform(-3.0, 6.0), size(random, 1.0, 9000.0)
    given = ground_station.Params(*place, random.uniform(0.0, 1.4), epoch=epoch(random))
    begun, (fixed, up) = sidereal(days_of(given.epoch)), geodetic(*place)
    around = near_plane(random, carried([np.array([fixed])] * 3, begun, 0.0)[0, 0])

    def motion(x):
        time, anomaly = 1e4 * x[:, 0] ** 2, 0.3 * x[:, 1]
        at, above = np.broadcast_to(fixed, (len(x), 3)), np.broadcast_to(up, (len(x), 3))
        craft, normal = flown(around, anomaly)
        seen = carried([at, 0.0 * at, 0.0 * at], begun, time) - craft
        zenith = carried([above, 0.0 * above, 0.0 * above], begun, time)[0]
        view = -(zenith * seen[0]).sum(1) > math.sin(given.elevation) * np.linalg.norm(seen[0], axis=1)
        pairs = zip(moved(seen, normal), moved(-craft, normal), strict=True)
        return time, anomaly, *(np.where(view, *pair) for pair in pairs)

    return ground_station, given, around, motion


def of_strip(random):
    place = random.uniform(-1.4, 1.4), random.uniform(-3.0, 3.0)
    ends = (*place, *(x + size(random, 1e-3, 0.2) * random.normal() for x in place))
    given = ground_strip.Params(
        *np.clip(ends, -1.5, 3.1).tolist(), float(random.choice([0.0, 300.0])), size(random, 5.0, 600.0), epoch=epoch(random)
    )
    strip = ground_strip.prepare(given, 1.0)
    sides = np.array([strip.end, strip.normal])
    x, normal = carried([sides, 0.0 * sides, 0.0 * sides], strip.turn, np.zeros(2))[0]
    normal = along(normal + size(random, 1e-3, 0.3) * random.normal(size=3))
    x = along(x - (x @ normal) * normal)
    around = orbit(random)._replace(axes=np.array([x, np.cross(normal, x), normal]))
    end, ahead = np.array(strip.end), np.array(strip.along)

    def motion(x):
        time, anomaly = x[:, 0] % 1.0 * (given.begin + given.duration), 0.3 * x[:, 1]
        angle, h = (strip.rate * np.clip(time - given.begin, 0.0, given.duration))[:, None], 1e-3

        def on_ground(a):
            u = np.cos(a) * end + np.sin(a) * ahead
            return u / np.sqrt(((u / [RADIUS, RADIUS, ground_strip.POLAR]) ** 2).sum(1, keepdims=True))

        before, now, after = (on_ground(angle + t) for t in (-h, 0.0, h))
        speed = np.where(time >= given.begin, strip.rate, 0.0)[:, None]
        fixed = [now, speed * (after - before) / (2 * h), speed**2 * (after - 2 * now + before) / h**2]
        side = np.broadcast_to(strip.normal, now.shape)
        seen = carried(fixed, strip.turn, time) - flown(around, anomaly)[0]
        return time, anomaly, *moved(seen, carried([side, 0.0 * side, 0.0 * side], strip.turn, time))

    return ground_strip, given, around, motion


ATTACKS = {"scan": of_scan, "slew": of_slew, "yaw-steering": of_yaw, "ground-station": of_station, "ground-strip": of_strip}
SHARP = {
    "scan": (0.9, 0.9),
    "slew": (0.99, 0.99),
    "yaw-steering": (0.9, 0.51),
    "ground-station": (0.9, 0.55),
    "ground-strip": (0.8, 0.51),
}
"""The shares of the bounds of rate and acceleration that are reached: those that are halved are noticed."""
SHARPNESS = {"scan": (1.01, 1.01), "yaw-steering": (1.1, 1.3), "ground-station": (1.02, 1.6), "ground-strip": (1.2, 2.3)}
"""How many times what is reached on a circle 550 km high a bound of rate, and of acceleration, is at most."""


def test_every_target_that_says_its_motion_is_attacked():
    # A rest, the frame and the Sun have tests of their own.
    assert {part.name for part in parts("target").values() if part.hook("motion")} == {
        *ATTACKS,
        "inertial",
        "orbital",
        "sun",
    }
    assert "target" in PACKAGES


def on_orbit(part, given, around):
    """A loop with a target on an orbit."""
    (position,), (velocity,) = (x.tolist() for x in around.at(np.array([0.0])))
    loop = hub(*ORBIT, fit("target", part.__name__.split(".")[-1].replace("_", "-"), *given), period=1.0)
    return replace(loop, start=loop.start._replace(position=tuple(position), velocity=tuple(velocity)))


@pytest.mark.parametrize("name", sorted(ATTACKS))
def test_no_instant_exceeds_the_motion_and_some_come_near(name):
    random, most, bounded = np.random.default_rng(7), [0.0, 0.0], 0
    for _ in range(PARAMS):
        part, given, around, motion = ATTACKS[name](random)
        told = motion_of(on_orbit(part, given, around))
        if told is None:
            continue
        bounded += 1
        x = random.normal(size=(STATES // PARAMS, 2))
        for k, bound in enumerate(told[:2]):

            def share(x, k=k, bound=bound, motion=motion):
                return motion(x)[2 + k] / bound

            found = share(x)
            worst = np.argsort(-found)[:WORST]
            most[k] = max(most[k], float(found[worst[0]]), climbed(share, x[worst], random))
            assert most[k] <= 1.0 + 1e-9, (given, around)
    assert bounded > 0.2 * PARAMS
    assert all(x > sharp for x, sharp in zip(most, SHARP[name], strict=True)), most


@pytest.mark.slow
@pytest.mark.parametrize("name", SHARPNESS)
def test_what_targets_say_is_not_much_more_than_what_their_orbit_reaches(name, monkeypatch):
    """Of the worst of places and instants over one orbit, as a bound is about every pass."""
    circle = Orbit(EARTH + 5.5e5, 0.0, np.eye(3))
    monkeypatch.setitem(globals(), "orbit", lambda random: circle)
    random, most = np.random.default_rng(3), [0.0, 0.0]
    for _ in range(40):
        part, given, around, motion = ATTACKS[name](random)
        told = motion_of(on_orbit(part, given, around))
        x = random.normal(size=(4000, 2))
        for k, bound in enumerate(told[:2] if told else ()):

            def share(x, k=k, bound=bound, motion=motion):
                return motion(x)[2 + k] / bound

            most[k] = max(most[k], climbed(share, x[np.argsort(-share(x))[:WORST]], random))
    assert all(1.0 / x < sharp for x, sharp in zip(most, SHARPNESS[name], strict=True)), [1.0 / x for x in most]


@pytest.mark.parametrize("name", sorted(ATTACKS))
def test_own_formulas_are_those_of_the_target(name):
    random = np.random.default_rng(8)
    for _ in range(4):
        part, given, around, motion = ATTACKS[name](random)
        x = random.normal(size=(20, 2))
        times, anomalies, *sizes = motion(x)
        for k, time in enumerate(times):
            place, velocity = (tuple(v[0].tolist()) for v in around.at(anomalies[k : k + 1]))
            state = SimpleNamespace(position=place, velocity=velocity)
            goal = part.goal(part.prepare(given, float(time)), state, 1, NO_TURN)
            for found, own in zip(goal[1:], sizes, strict=True):
                assert np.linalg.norm(found) == pytest.approx(own[k], rel=1e-4, abs=1e-11)


UNKNOWN = fit("target", "scan", 0.3, 40.0), fit("target", "yaw-steering"), fit("target", "ground-station", 0.1, 0.2)


@pytest.mark.parametrize(
    ("target", "start"), leading([(t, s) for t in UNKNOWN for s in ((0.0, 1.1, 0.0), (0.02, 2.3, 1.0))], 6)
)
def test_a_target_around_the_flattened_earth_moves_as_it_tells_but_for_what_it_says(target, start):
    """By differences along the path, over an orbit."""
    loop = flattened(*start)
    loop = loop.without("target").with_parts(target)
    told = motion_of(loop)
    module, h, worst = target.part.module, 1e-2, [0.0, 0.0]
    place, velocity = np.array(loop.start.position), np.array(loop.start.velocity)
    for k in range(60):
        a = pull(loop, place)
        jerk = (pull(loop, place + velocity * 1e-3) - pull(loop, place - velocity * 1e-3)) / 2e-3
        goals, seen = [], NO_TURN
        for t in (-h, 0.0, h):
            state = SimpleNamespace(
                position=tuple(place + velocity * t + a * t**2 / 2 + jerk * t**3 / 6),
                velocity=tuple(velocity + a * t + jerk * t**2 / 2),
            )
            timed = target.prepared(1000.0 * k + t + h)
            goals.append(module.goal(timed, state, 1, seen))
            seen = goals[-1].attitude
        turned_by = np.array(multiply(conjugate(goals[0].attitude), goals[2].attitude)[1:]) / h
        gained = (np.array(goals[2].rate) - goals[0].rate) / (2.0 * h)
        off = turned_by - goals[1].rate, gained - goals[1].acceleration
        worst = [max(w, np.linalg.norm(x)) for w, x in zip(worst, off, strict=True)]
        assert np.linalg.norm(turned_by) <= told.rate
        # On by a minute and a half.
        for _ in range(10):
            velocity = velocity + 10.0 * pull(loop, place)
            place = place + 10.0 * velocity
    assert worst[0] < told.off_rate + 1e-9
    assert worst[1] < told.off_acceleration + 1e-9
