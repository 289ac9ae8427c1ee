"""Parts of the magnetic field and of the Sun: a residual dipole, a magnetometer, a Sun sensor, and TRIAD."""

import math
from datetime import datetime, timedelta
from types import SimpleNamespace

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import normalise, to_body
from starhold.conformance.bench import CRAFT
from starhold.parts import sun
from starhold.parts.contract import Envelope
from starhold.parts.environments import residual_dipole
from starhold.parts.epoch import days_of
from starhold.parts.estimators import triad
from starhold.parts.random import Dice
from starhold.parts.sensors import gnss, magnetometer, star_tracker, sun_sensor
from starhold.parts.sun import EARTH
from tests.parts.fields import reference, states

PERIOD = 0.5
EPOCH = (2026.0, 9.0, 3.0, 4.0, 5.0, 6.0)


def body_field(state, time):
    """The magnetic field (T, body axes) by ppigrf, ERFA and SciPy."""
    days = days_of(EPOCH) + time / 86400.0
    earth = Rotation.from_rotvec([0.0, 0.0, erfa.gmst06(2451545.0, days, 2451545.0, days + 69.2 / 86400.0)])
    when = datetime(*(int(x) for x in EPOCH)) + timedelta(seconds=time)
    there = earth.apply(reference(earth.inv().apply(state.position)[None], when)[0])
    return Rotation.from_quat(state.attitude, scalar_first=True).inv().apply(there)


def test_torque_of_a_dipole():
    params = residual_dipole.Params((0.02, -0.05, 0.03), EPOCH)
    numbers = residual_dipole.prepare(params, PERIOD)
    for step, state in enumerate(states()):
        memory = residual_dipole.update(residual_dipole.remember(numbers), state, numbers, None, 1000 * step)
        found = residual_dipole.torque(state, numbers, CRAFT, memory)
        expected = np.cross(params.dipole, body_field(state, 1000 * step * PERIOD))
        # Of the field's harmonics beyond the eighth degree.
        assert np.abs(found - expected).max() < 160e-9 * np.linalg.norm(params.dipole)
        assert (
            np.linalg.norm(found)
            < residual_dipole.bound(params, Envelope(float(np.linalg.norm(state.position)), 0.0, 0.0, 0.0)).torque
        )
        # A torque across the field, and across the dipole.
        assert abs(np.dot(found, params.dipole)) < 1e-20


def test_magnetometer():
    params = magnetometer.Params(3e-8, (1e-7, 2e-7, -3e-7), 0.01, EPOCH, (3.0, 5.0))
    numbers = magnetometer.prepare(params, PERIOD)
    state = next(states())
    memory, errors, held = magnetometer.remember(numbers, state), [], None
    for step in range(1000):
        reading, memory = magnetometer.measure(state, memory, numbers, Dice((1, 2), step, 0), step)
        out = 6 <= step < 10
        assert reading.magnetic_field_is_new == (0.0 if out else 1.0)
        assert not out or reading.magnetic_field == held
        held = reading.magnetic_field
        if step % 20 == 0:
            errors.append(np.array(held) - 1.01 * body_field(state, step * PERIOD) - params.bias)
    assert np.std(np.subtract(errors, np.mean(errors, axis=0))) == pytest.approx(params.noise, rel=0.15)
    assert np.abs(np.mean(errors, axis=0)).max() < 160e-9 + 1e-8


@pytest.mark.slow
def test_sun_sensor():
    params = sun_sensor.Params(1e-3, (0.0, 3.0, 4.0), math.radians(40.0), EPOCH, (10.0, 20.0))
    numbers = sun_sensor.prepare(params, PERIOD)
    boresight = np.array(params.boresight) / 5.0
    counts, errors = {"seen": 0, "beside": 0, "shadow": 0, "out": 0}, []
    for step, state in enumerate(states(3000)):
        reading, _ = sun_sensor.measure(state, (), numbers, Dice((1, 2), step, 0), step)
        seen = sun.sun(step * PERIOD, sun.prepared(EPOCH))
        toward = Rotation.from_quat(state.attitude, scalar_first=True).inv().apply(seen.direction)
        behind, across = np.dot(state.position, seen.direction), np.linalg.norm(np.cross(state.position, seen.direction))
        # The shadow is a cylinder of the Earth's radius; the cone's edge is within 40 km of it.
        if abs(across - EARTH) < 4e4:
            continue
        out, beside = 10.0 <= step * PERIOD < 20.0, toward @ boresight < math.cos(math.radians(40.0))
        why = "out" if out else "beside" if beside else "shadow" if behind < 0.0 and across < EARTH else "seen"
        counts[why] += 1
        assert reading.sun_is_seen == (1.0 if why == "seen" else 0.0), (step, why)
        assert math.hypot(*reading.sun) == pytest.approx(reading.sun_is_seen, abs=1e-12)
        if why == "seen":
            errors.append(np.array(reading.sun) - toward)
    assert min(counts.values()) >= 10, counts
    # Of three components one is along the direction, and has no error.
    assert np.sqrt(np.mean(np.square(errors)) * 1.5) == pytest.approx(params.noise, rel=0.1)


def test_star_tracker_is_out():
    numbers = star_tracker.prepare(star_tracker.Params(1e-4, 1e-4, interval=1.0, outage=(2.0, 4.2)), PERIOD)
    found = []
    state = next(states())
    memory = star_tracker.remember(numbers, state)
    for step in range(14):
        reading, memory = star_tracker.measure(state, memory, numbers, Dice((1, 2), step, 0), step)
        found.append(reading.attitude_is_new)
    # Each second, none from 2 s on, the next at the first control step after 4.2 s.
    assert found == [1, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 1]


def test_receiver():
    state = next(states())
    params = gnss.prepare(gnss.Params(5.0, 0.2), 1.0)
    found = [gnss.measure(state, (), params, Dice((1, 2), step, 0), step)[0] for step in range(1000)]
    for name, deviation in (("position", 5.0), ("velocity", 0.2)):
        errors = np.array([getattr(one, name) for one in found]) - getattr(state, name)
        assert errors.std(axis=0) == pytest.approx(deviation, rel=0.06)
        assert np.abs(errors.mean(axis=0)).max() < 0.1 * deviation


def told(state, step, field, noise=0.0):
    """The readings of triad at a step."""
    numbers = sun_sensor.prepare(sun_sensor.Params(noise, epoch=EPOCH), PERIOD)
    reading, _ = sun_sensor.measure(state, (), numbers, Dice((3, 4), step, 0), step)
    return SimpleNamespace(**reading._asdict(), magnetic_field=field, position=state.position, rate=state.rate)


def turn(attitude):
    return Rotation.from_quat(attitude, scalar_first=True)


def test_triad_against_scipy():
    numbers = triad.prepare(triad.Params(EPOCH), PERIOD)
    computed = magnetometer.prepare(magnetometer.Params(epoch=EPOCH), PERIOD)
    noise, found_any = np.random.default_rng(3).normal(scale=1e-6, size=3), 0
    for state in states(40):
        exact = magnetometer.measure(state, (0.0,) * 3, computed, Dice((1, 2), 0, 0), 0)[0].magnetic_field
        readings = told(state, 0, tuple(np.array(exact) + noise), 1e-2)
        if readings.sun_is_seen < 0.5:
            continue
        found_any += 1
        estimate, memory = triad.estimate(readings, triad.remember(numbers, state), numbers, CRAFT, PERIOD)
        known = [sun.sun(0.0, numbers.sun).direction, turn(state.attitude).apply(exact)]
        # An infinite weight makes its least squares TRIAD.
        expected, _ = Rotation.align_vectors(known, [readings.sun, readings.magnetic_field], weights=[np.inf, 1.0])
        assert (expected.inv() * turn(estimate.attitude)).magnitude() < 1e-9
        assert (estimate.rate, estimate.attitude_age) == (state.rate, 0.0)
        # Without the Sun the gyro carries it on.
        dark = told(state, 1, readings.magnetic_field)
        dark.sun_is_seen, dark.sun = 0.0, (0.0, 0.0, 0.0)
        later, _ = triad.estimate(dark, memory, numbers, CRAFT, PERIOD)
        turned = turn(estimate.attitude) * Rotation.from_rotvec(PERIOD * np.array(state.rate))
        assert (turned.inv() * turn(later.attitude)).magnitude() < 1e-12
        assert later.attitude_age == PERIOD
    assert found_any > 15


def test_triad_refuses_directions_that_are_near_each_other():
    numbers = triad.prepare(triad.Params(EPOCH, math.radians(10.0)), PERIOD)
    state = next(states())
    toward = np.array(to_body(normalise(state.attitude), sun.sun(0.0, numbers.sun).direction))
    beside = np.cross(toward, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(toward, (0.0, 0.0, 1.0)))
    for degrees, used in ((9.9, False), (10.1, True), (169.8, True), (170.2, False)):
        angle = math.radians(degrees)
        field = tuple(3e-5 * (math.cos(angle) * toward + math.sin(angle) * beside))
        readings = told(state, 0, field)
        readings.sun, readings.sun_is_seen = tuple(toward), 1.0
        estimate, _ = triad.estimate(readings, triad.remember(numbers, state), numbers, CRAFT, PERIOD)
        assert (estimate.attitude_age == 0.0) == used, degrees


def test_a_year_that_no_model_has_is_refused():
    for part, year, words in ((magnetometer, 2035.0, "2025 to 2030"), (sun_sensor, 2051.0, "1950 to 2050")):
        with pytest.raises(ValueError, match=words):
            part.prepare(part.Params(epoch=(year, 1.0, 1.0, 0.0, 0.0, 0.0)), PERIOD)
