"""Attacks on what parts say of the largest torques and errors that they make: random numbers of the parts, orbits from 200
km to beyond the geostationary ones, 10^6 states by own formulas, and climbs from the worst of them."""

from math import pi

import numpy as np
import pytest

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.vector import ZERO
from starhold.parts import magnetic_field, sun
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import PACKAGES, parts
from starhold.parts.contract import DEVIATIONS, Envelope, Errors
from starhold.parts.effectors import magnetic_unloading, wheels
from starhold.parts.effectors.layouts import pyramid, three_orthogonal
from starhold.parts.environments import constant_torque, drag, random_torque, residual_dipole, solar_pressure, torque_table
from starhold.parts.epoch import SIDEREAL
from starhold.parts.random import Dice
from starhold.parts.sensors import gaussian, gyro, magnetometer, star_tracker
from starhold.trace.straight_line import evaluated, straight_line
from tests.parts.attacks import EARTH, Orbit, along, climbed, epoch, orbit, size, turned, vector
from tests.tiers import fewer

STATES, PARAMS, WORST = fewer(1_000_000, 50), fewer(200, 20), 20
"""States in all, sets of numbers that they are shared out among, and states that are climbed from."""


def envelope(around, **more):
    given = {"momentum": 0.0, "moment": 0.0} | more
    return Envelope(around.perigee * (1.0 - 1e-9), around.fastest * (1.0 + 1e-9), **given)


def field_strength(numbers):
    """A function to the Earth's field (n, 3) at places in its axes."""
    program = straight_line(
        lambda place, given: magnetic_field.earth_fixed(place, given), place=(7e6, 1.0, 1.0), given=numbers
    )
    return lambda place: np.array(evaluated(program, place=tuple(place.T), given=numbers)).T


# Each attack makes numbers of its part, and returns them with a function from normal numbers (n, WIDTH) to torques or errors
# as shares of the bound.
WIDTH = 14


def plates(random, light):
    """Rows of plates: one, a box, panels heavier than the body, or any."""
    count = int(random.choice([1, 2, 6, 9]))
    normals = random.normal(size=(count, 3)) if random.uniform() < 0.6 else np.eye(3)[random.integers(3, size=count)]
    places = size(random, 1e-2, 1e2) * random.normal(size=(count, 3))
    shares = random.dirichlet(np.ones(3), count)[:, :2]
    rows = np.column_stack([10.0 ** random.uniform(-4, 3, count), normals, places, *([shares] if light else [])])
    return tuple(map(tuple, rows.tolist()))


def of_dipole(random):
    around = orbit(random)
    given = residual_dipole.Params(vector(random, size(random, 1e-4, 1e3)), epoch(random, 2025, 2029))
    field, bound = field_strength(magnetic_field.prepared(given.epoch, 1.0)), residual_dipole.bound(given, envelope(around))

    def share(x):
        # The Earth may have any attitude to the orbit about its axis.
        place, _ = around.at(3.0 * x[:, 0])
        c, s = np.cos(3.0 * x[:, 1]), np.sin(3.0 * x[:, 1])
        fixed = np.column_stack([c * place[:, 0] - s * place[:, 1], s * place[:, 0] + c * place[:, 1], place[:, 2]])
        torque = np.cross(np.linalg.norm(given.dipole) * along(x[:, 2:5]), field(fixed))
        return np.linalg.norm(torque, axis=1) / max(bound.torque, 1e-300)

    return share


def of_drag(random, thin=False):
    """thin: air that thins so slowly and turns so fast that the orbit's highest place counts."""
    around, rows = orbit(random), plates(random, False)
    height = size(random, 1e5, 1e6)
    given = drag.Params(rows, size(random, 0.1, 5.0), size(random, 1e-16, 1e-8), height, size(random, 1e4, 1e7))
    given = given._replace(rotation=float(random.choice([0.0, 1.0, size(random, 0.1, 50.0)])))
    if thin:
        given = given._replace(scale_height=5e6, rotation=30.0)
    elif random.uniform() < 0.3:
        heights = np.sort(random.uniform(0.0, 4e7, 5))
        logs = -30.0 - np.cumsum(random.uniform(0.1, 5.0, 5))
        table = [(h, f, float(np.exp(y + f / 100.0))) for h, y in zip(heights, logs, strict=True) for f in (70.0, 200.0)]
        given = given._replace(table=tuple(map(tuple, np.array(table).tolist())), flux=70.0)
    rows = np.array(rows)
    areas, normals, centres = rows[:, 0], along(rows[:, 1:4]), rows[:, 4:7]
    bound, turn = drag.bound(given, envelope(around)), given.rotation * 2.0 * pi * SIDEREAL / 86400.0

    def density(above):
        if not given.table:
            return given.density * np.exp((given.height - above) / given.scale_height)
        slopes = np.diff(logs + 0.7) / np.diff(heights)
        found = np.interp(above, heights, logs + 0.7)
        low, high = np.minimum(above - heights[0], 0.0), np.maximum(above - heights[-1], 0.0)
        return np.exp(found + slopes[0] * low + slopes[-1] * high)

    def share(x):
        place, velocity = around.at(3.0 * x[:, 0])
        wind = velocity - turn * np.column_stack([-place[:, 1], place[:, 0], 0.0 * place[:, 0]])
        speed, course = np.linalg.norm(wind, axis=1), along(x[:, 1:4])
        pressure = density(np.linalg.norm(place, axis=1) - EARTH) * speed**2 / 2.0
        force = given.coefficient * np.maximum(course @ normals.T, 0.0) * areas
        arm = force @ centres
        torque = pressure[:, None] * np.cross(course, arm)
        return np.linalg.norm(torque, axis=1) / max(bound.torque, 1e-300)

    return share


def of_light(random):
    rows, begun = plates(random, True), epoch(random)
    given = solar_pressure.Params(rows, begun, ephemeris=int(random.integers(2)))
    rows = np.array(rows)
    areas, normals, centres, (mirrored, scattered) = rows[:, 0], along(rows[:, 1:4]), rows[:, 4:7], rows[:, 7:9].T
    numbers, year = sun.prepared(begun, given.ephemeris), 365.25 * 86400.0
    bound = solar_pressure.bound(given, envelope(Orbit(7e6, 0.0, np.eye(3))))
    days = [sun.pressure(sun.sun(year * k / 60.0, numbers)) for k in range(60)]

    def share(x):
        s = along(x[:, :3])
        pressure = np.take(days, (np.abs(x[:, 3]) * 60).astype(int) % 60)
        c = np.maximum(s @ normals.T, 0.0)
        forces = (c * areas * (1.0 - mirrored))[:, :, None] * s[:, None, :]
        forces = forces + (2.0 * c * areas * (mirrored * c + scattered / 3.0))[:, :, None] * normals
        torque = -pressure[:, None] * np.cross(centres[None], forces).sum(axis=1)
        return np.linalg.norm(torque, axis=1) / max(bound.torque, 1e-300)

    return share


def of_constant(random):
    given = constant_torque.Params(vector(random, size(random, 1e-9, 1e3)), int(random.integers(2)))
    bound = constant_torque.bound(given, envelope(Orbit(7e6, 0.0, np.eye(3)))).torque
    return lambda x: np.linalg.norm(turned(along(x[:, :4]), np.array([given.torque])), axis=1) / bound


def of_table(random):
    times = np.cumsum(random.uniform(0.1, 3.0, 6))
    torques = size(random, 1e-9, 1e3) * random.normal(size=(6, 3))
    given = torque_table.Params(tuple(map(tuple, np.column_stack([times, torques]).tolist())))
    bound = torque_table.bound(given, envelope(Orbit(7e6, 0.0, np.eye(3)))).torque

    def share(x):
        now = times[0] + np.abs(x[:, 0]) % 1.0 * (times[-1] - times[0])
        return np.linalg.norm([np.interp(now, times, column) for column in torques.T], axis=0) / bound

    return share


def of_unloading(random, weak=False):
    """weak: so little is asked for that the rods are never on their limit."""
    around = orbit(random)
    limit = tuple(10.0 ** random.uniform(-3, 2, 3))
    given = magnetic_unloading.Params(
        size(random, 1e-6, 10.0), limit, int(random.integers(2)), epoch=epoch(random, 2025, 2029)
    )
    momentum, moment, wrong = size(random, 1e-6, 10.0), size(random, 1e-5, 10.0), size(random, 1e-12, 1e-3)
    if weak:
        given, momentum, wrong = given._replace(gain=1e-6, dipole_limit=(1e3,) * 3), size(random, 1e-3, 1.0), 1e-15
    given = given._replace(momentum=vector(random, float(random.choice([0.0, momentum]))))
    field = field_strength(magnetic_field.prepared(given.epoch, 1.0))
    bound = magnetic_unloading.bound(given, envelope(around, momentum=momentum, moment=moment, field_error=wrong))
    wrong = float(random.choice([0.0, wrong]))

    def share(x):
        place, _ = around.at(3.0 * x[:, 0])
        true = turned(along(x[:, 1:5]), field(place))
        # In part along where the torque grows most.
        seen = true + wrong * along(x[:, 5:8])
        rate = np.exp(5.0 * (x[:, 8:9] - 1.0)) * along(x[:, 8:11])
        stored = momentum * along(x[:, 11:14]) - moment * rate
        wanted = -given.gain * (stored - np.array(given.momentum))
        dipole, most = np.cross(seen, wanted) / np.maximum((seen**2).sum(axis=1), 1e-300)[:, None], given.dipole_limit
        if not given.limited:
            dipole = dipole / np.maximum((np.abs(dipole) / most).max(axis=1), 1.0)[:, None]
        torque = np.cross(np.clip(dipole, -np.array(most), most), true)
        return np.linalg.norm(torque, axis=1) / (bound.torque + bound.per_rate * np.linalg.norm(rate, axis=1))

    return share


def of_wheels(random, kinds=None):
    """kinds: of friction, 1 for those that there are: viscous, Coulomb's, and that which sticks."""
    axes = [three_orthogonal(), pyramid(), along(random.normal(size=(5, 3)))][int(random.integers(3))]
    count = len(axes)
    inertia, limit = 10.0 ** random.uniform(-7, 0, count), 10.0 ** random.uniform(-4, 2, count)
    chosen = random.choice([0.0, 1.0], (3, 1)) if kinds is None else np.array(kinds)[:, None]
    viscous, coulomb, sticking = 10.0 ** random.uniform(-9, -2, (3, count)) * chosen
    try:
        given = wheels.make_wheels(axes, inertia.tolist(), 1.0, limit.tolist(), viscous.tolist(), coulomb.tolist())
    except ValueError:
        return of_wheels(random, kinds)
    over = 10.0 ** random.uniform(-1, 2, count)
    if sticking.any():
        given = given._replace(sticking=tuple(sticking.tolist()), stribeck_speed=tuple(over.tolist()))
    A, bound = np.array(given.axes), wheels.error(given, Envelope(7e6, 7.6e3, 0.1, 0.065))

    def share(x):
        full = limit * np.clip(x[:, :count], -1.0, 1.0)
        rate = np.exp(5.0 * (x[:, 8:9] - 1.0)) * along(x[:, 9:12])
        speed = full / inertia - rate @ A.T
        grip = viscous * speed + coulomb * np.clip(speed / wheels.CREEP, -1.0, 1.0)
        grip = grip + sticking * np.exp(0.5) * speed / over * np.exp(-0.5 * (speed / over) ** 2)
        fast = np.linalg.norm(rate, axis=1)
        return np.linalg.norm(grip @ A, axis=1) / np.maximum(bound.torque + bound.per_rate * fast, 1e-300)

    return share


def of_magnetometer(random):
    given = magnetometer.Params(
        bias=vector(random, float(random.choice([0.0, size(random, 1e-9, 1e-4)]))),
        scale_error=random.uniform(-0.5, 0.5),
        epoch=epoch(random, 2025, 2029),
        mounting_error=vector(random, float(random.choice([0.0, random.uniform(0.0, 0.5)]))),
        axis_errors=tuple(map(tuple, (float(random.choice([0.0, 0.3])) * random.normal(size=(3, 3))).tolist())),
        resolution=float(random.choice([0.0, size(random, 1e-9, 1e-5)])),
    )
    field, q = (
        field_strength(magnetic_field.prepared(given.epoch, 1.0)),
        along(np.append(1.0, np.array(given.mounting_error) / 2)),
    )
    skew = (np.eye(3) + np.array(given.axis_errors)) @ turned(np.tile(q, (3, 1)), np.eye(3)).T
    bound = magnetometer.error(given).field

    def share(x):
        true = turned(along(x[:, :4]), field(magnetic_field.GROUND * along(x[:, 4:7])))
        shown = (1.0 + given.scale_error) * true @ skew.T + np.array(given.bias)
        if given.resolution:
            shown = given.resolution * np.round(shown / given.resolution)
        return np.linalg.norm(shown - true, axis=1) / bound

    return share


def of_gyro(random):
    given = gyro.Params(
        bias=vector(random, size(random, 1e-6, 1.0)), resolution=float(random.choice([0.0, size(random, 1e-7, 1.0)]))
    )
    if random.uniform() < 0.6:
        # One of these errors may be much of the whole, or all are.
        given = given._replace(
            scale_error=float(random.choice([0.0, random.uniform(-0.5, 0.5)])),
            mounting_error=vector(random, float(random.choice([0.0, random.uniform(0.0, 0.5)]))),
            axis_errors=tuple(map(tuple, (float(random.choice([0.0, 0.3])) * random.normal(size=(3, 3))).tolist())),
            delay=float(random.choice([0.0, size(random, 1e-3, 10.0)])),
            jitter=float(random.choice([0.0, size(random, 1e-4, 1.0)])),
        )
    bound, q = gyro.error(given), along(np.append(1.0, np.array(given.mounting_error) / 2))
    skew = (np.eye(3) + np.array(given.axis_errors)) @ turned(np.tile(q, (3, 1)), np.eye(3)).T

    def share(x):
        # The rate changes evenly for as long as a reading takes.
        rate, change = 0.01 * x[:, :3], np.exp(2.0 * x[:, 6:7] - 4.0) * along(x[:, 3:6])
        late = given.delay + DEVIATIONS * given.jitter * np.tanh(x[:, 7:8])
        before = rate - late * change
        shown = (1.0 + given.scale_error) * before @ skew.T + np.array(given.bias)
        shown = given.resolution * np.round(shown / given.resolution) if given.resolution else shown
        fast = np.maximum(*(np.linalg.norm(one, axis=1) for one in (rate, before)))
        most = bound.rate + bound.turned * fast + bound.late * np.linalg.norm(change, axis=1)
        return np.linalg.norm(shown - rate, axis=1) / most

    return share


def of_tracker(random):
    period, delay = size(random, 0.01, 10.0), float(random.choice([0.0, random.uniform(0.0, 3.0)]))
    jitter = float(random.choice([0.0, random.uniform(0.0, 0.3)]))
    given = star_tracker.Params(
        0.0, 0.0, mounting_error=vector(random, random.uniform(0.0, 0.5)), delay=delay * period, jitter=jitter * period
    )
    bound, whole = star_tracker.error(given), np.floor(delay)
    mounted = along(np.append(1.0, np.array(given.mounting_error) / 2))

    def share(x):
        # It turns evenly, by up to 2 rad in a period; between control steps the quaternion is interpolated.
        rate = 2.0 / period * np.abs(np.tanh(x[:, :1])) * along(x[:, 1:4])

        def before(steps):
            half = -0.5 * steps * period * np.linalg.norm(rate, axis=1)[:, None]
            return np.concatenate([np.cos(half), np.sin(half) * along(rate)], axis=1)

        share = delay - whole + DEVIATIONS * jitter * np.tanh(x[:, 4:5])
        seen = along(before(whole) + share * (before(whole + 1.0) - before(whole)))
        q0 = seen[:, 0] * mounted[0] - seen[:, 1:] @ mounted[1:]
        most = bound.attitude + bound.turning * np.linalg.norm(rate, axis=1)
        return 2.0 * np.arccos(np.minimum(np.abs(q0), 1.0)) / most

    return share


ATTACKS = {
    "residual-dipole": of_dipole,
    "drag": of_drag,
    "drag in thin air": lambda random: of_drag(random, thin=True),
    "solar-pressure": of_light,
    "constant-torque": of_constant,
    "torque-table": of_table,
    "magnetic-unloading": of_unloading,
    "magnetic-unloading of little": lambda random: of_unloading(random, weak=True),
    "wheels": of_wheels,
    "wheels with viscous friction": lambda random: of_wheels(random, (1.0, 0.0, 0.0)),
    "wheels with Coulomb friction": lambda random: of_wheels(random, (0.0, 1.0, 0.0)),
    "magnetometer": of_magnetometer,
    "gyro": of_gyro,
    "star-tracker": of_tracker,
}
QUIET = {"gaussian"}
"""Parts that have no errors but noise."""


def saying():
    """The installed parts that say a bound or an error."""
    found = [part for role in set(PACKAGES) - {"body"} for part in parts(role).values()]
    return {part.name for part in found if part.hook("bound") or part.hook("error")}


def test_every_part_that_says_a_bound_is_attacked():
    assert saying() == {*(name.partition(" ")[0] for name in ATTACKS), *QUIET}
    assert gaussian.error(gaussian.examples()[0]) == Errors()


@pytest.mark.parametrize("name", sorted(ATTACKS))
def test_no_state_exceeds_a_bound_and_some_exceed_its_half(name):
    """So a bound that is halved is noticed."""
    random, most = np.random.default_rng(5), 0.0
    for _ in range(PARAMS):
        share = ATTACKS[name](random)
        x = random.normal(size=(STATES // PARAMS, WIDTH))
        found = share(x)
        worst = np.argsort(-found)[:WORST]
        most = max(most, float(found[worst[0]]), climbed(share, x[worst], random))
        assert most <= 1.0 + 1e-9
    assert most > 0.5


def off_of(part, given, count):
    """What a sensor shows beside the true state at so many instants, and what its bias gains from one to the next: vectors
    by name."""
    numbers, state = part.prepare(given, 0.1) if hasattr(part, "prepare") else given, State(NO_TURN, ZERO, PLACE, ZERO, ZERO)
    memory = part.remember(numbers, state) if hasattr(part, "remember") else None
    seen = {"attitude": [], "rate": [], "field": [], "walk": []}
    for step in range(count):
        # At one instant, for the field turns.
        reading, after = part.measure(state, memory, numbers, Dice((5, 6), step, 0), 0)
        if hasattr(reading, "attitude"):
            q = np.array(reading.attitude)
            seen["attitude"].append(2.0 * np.arctan2(np.linalg.norm(q[1:]), q[0]) * along(q[1:]))
        seen["rate"] += [reading.rate] if hasattr(reading, "rate") else []
        seen["field"] += [reading.magnetic_field] if hasattr(reading, "magnetic_field") else []
        seen["walk"] += [np.subtract(after, memory)] if part is gyro else []
        memory = part.remember(numbers, state) if hasattr(part, "remember") else None
    return {name: np.array(found) for name, found in seen.items() if found}


PLACE = (7e6, 1e5, -2e5)
MEASURED = magnetometer.Params(noise=3e-8, noise_density=1e-7, epoch=(2026.0, 1.0, 1.0, 0.0, 0.0, 0.0))
ABOUT = np.outer((0.0, 0.6, 0.8), (0.0, 0.6, 0.8))
NOISY = {
    "gaussian": (gaussian, gaussian.Params(2e-3, 3e-4), {"attitude": 2e-3, "rate": 3e-4}),
    "gyro": (gyro, gyro.Params(noise=3e-5, bias_walk=2e-4), {"rate": 3e-5 / 0.1**0.5, "walk": 2e-4 * (0.1 / 3600.0) ** 0.5}),
    "star-tracker": (
        star_tracker,
        star_tracker.Params(2e-5, 9e-5, (0.0, 1.2, 1.6)),
        {"attitude": 2e-5 * np.eye(3) + 7e-5 * ABOUT},
    ),
    "magnetometer": (magnetometer, MEASURED, {"field": np.hypot(3e-8, 1e-7 * (0.5 / 0.1) ** 0.5)}),
}
"""A sensor with numbers, and the roots of the covariances of what it shows every tenth of a second."""


@pytest.mark.parametrize("name", NOISY)
def test_noise_is_as_large_as_its_numbers_and_the_part_say(name):
    """Neither half of it nor twice as much: a claim for a share of orbits hangs on it."""
    part, given, roots = NOISY[name]
    told, found = part.noise(given, 0.1), off_of(part, given, 3000)
    for kind, root in roots.items():
        root = root * np.eye(3) if np.ndim(root) == 0 else root
        assert np.array(getattr(told, kind)) * (1.0 if kind == "attitude" else np.eye(3)) == pytest.approx(root, rel=1e-12)
        # In units of it the covariance is that of independent numbers of size one.
        units = np.linalg.solve(root, (found[kind] - found[kind].mean(axis=0)).T)
        assert np.allclose(np.cov(units), np.eye(3), atol=0.15), kind


def test_every_part_that_says_its_noise_is_measured():
    found = [part for role in set(PACKAGES) - {"body"} for part in parts(role).values()]
    assert {part.name for part in found if part.hook("noise")} == {*NOISY, "random-torque"}


def test_a_random_torque_is_as_large_as_it_says():
    given = random_torque.Params(3e-4)
    torques = np.array([random_torque.update(ZERO, None, given, Dice((5, 6), step, 0), step) for step in range(3000)])
    units = torques / random_torque.noise(given, 0.1).torque
    assert np.allclose(np.cov(units.T), np.eye(3), atol=0.15)
    # Neither with the one before.
    assert np.abs(units[1:].T @ units[:-1] / len(units)).max() < 0.1
