"""Attitudes computed from measured directions: how far off they may be, and claims about loops that use them."""

import math
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.vector import Vector
from starhold.analysis.departure import Span
from starhold.certification.assumptions import assumption
from starhold.certification.certificate import FRESH
from starhold.certification.directions import WIDER
from starhold.certification.measured import measured
from starhold.parts.catalogue import fit
from starhold.parts.contract import DEVIATIONS, Direction
from starhold.parts.estimators import quest, triad
from starhold.simulation.lane import fly, label
from tests.certification.own_spacecraft import claim_of, loop_with, worst_of
from tests.kernel.flights import along
from tests.tiers import WHOLE, fewer, leading

OWN = """
name = "own"
[spacecraft]
inertia = [0.05, 0.065, 0.025]
[orbit]
altitude = "600 km"
inclination = "97.8 deg"
raan = "60 deg"
epoch = "2026-03-20T12:00:00Z"
[initial]
angles = ["20 deg", "-10 deg", "15 deg"]
[target]
mode = "inertial"
[environment]
gravity_gradient = true
[simulation]
duration = 200.0
control_period = 0.25
[certify]
disturbance = "1e-6 N m"
[[law]]
type = "lyapunov"
form = "bandwidth"
bandwidth = 0.1
damping = 0.9
[[part]]
type = "gnss"
position = 10.0
[[part]]
type = "sun-sensor"
noise = "0.05 deg"
mounting_error = ["0.02 deg", "-0.03 deg", "0.02 deg"]
[[part]]
type = "magnetometer"
noise = "20 nT"
bias = ["50 nT", "-40 nT", "60 nT"]
resolution = "10 nT"
[[part]]
type = "gyro"
noise = 2e-5
bias = ["0.002 deg/s", "-0.001 deg/s", "0.0015 deg/s"]
"""
TRIAD = '[[part]]\ntype = "triad"\napart = "30 deg"\n'
QUEST = """
[[part]]
type = "horizon-sensor"
noise = "0.05 deg"
limb_height = 500.0
[[part]]
type = "quest"
apart = "30 deg"
sun = "0.1 deg"
field = "0.3 deg"
nadir = "0.1 deg"
"""
SLOWER = OWN.replace('noise = "0.05 deg"', 'noise = "0.05 deg"\ninterval = 0.5\ndelay = 0.05').replace(
    'noise = "20 nT"', 'noise = "20 nT"\ninterval = 0.5\ndelay = 0.05'
)
TEXTS = {"triad": OWN + TRIAD, "quest": OWN + QUEST, "late": SLOWER.replace("position = 10.0", "jitter = 0.001") + TRIAD}


@pytest.mark.parametrize("name", leading(TEXTS, 0))
def test_an_own_spacecraft_has_a_claim_with_all_of_its_sensors(name):
    claim = claim_of(TEXTS[name])
    assert (claim.outcome, claim.left_out) == ("proved", [])
    assert claim.numbers["angle"] < {"triad": 0.026, "quest": 0.036, "late": 0.06}[name]
    assert claim.numbers["share"] == pytest.approx(0.9973)
    assert f"{FRESH}{0.25 * (name == 'late')!r}" in claim.assumptions
    assert any(claim.numbers.get("told_growth", [])) == (name == "late")


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTS)
def test_flights_do_not_break_the_claim(name):
    assert worst_of(TEXTS[name], 200, 50, (100, 1500), rounds=2).angle > 0.5


def with_changed(loop, name, **numbers):
    return replace(
        loop,
        parts=tuple(replace(f, params=f.params._replace(**numbers)) if f.part.name == name else f for f in loop.parts),
    )


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("gyro", {"bias_walk": 1e-6}),
        ("sun-sensor", {"delay": 0.1}),
        ("sun-sensor", {"interval": 1.0}),
        ("sun-sensor", {"jitter": 1e-3}),
        ("sun-sensor", {"ephemeris": 1}),
        ("sun-sensor", {"noise": 0.07}),
        ("magnetometer", {"epoch": (2026.0, 3.0, 21.0, 12.0, 0.0, 0.0)}),
        ("magnetometer", {"limit": 5e-5}),
        ("gnss", {"position": 1e4}),
        ("triad", {"apart": 0.0}),
    ],
)
def test_what_has_no_bound_is_left_out(name, numbers):
    loop = loop_with(TEXTS["triad"])[1]
    assert measured(loop) is not None
    assert measured(with_changed(loop, name, **numbers)) is None


def test_coarse_sun_sensors_are_left_out_but_not_where_the_estimator_does_not_read_them():
    loop = loop_with(TEXTS["triad"])[1]
    coarse = fit("sensor", "coarse-sun-sensors")
    assert measured(replace(loop, parts=(*loop.parts, coarse))) is not None
    assert measured(replace(loop, parts=(coarse, *loop.parts))) is None


def with_module(loop, name, **changed):
    """A loop with an own part that is another one but for these names."""
    module = ModuleType(name)
    vars(module).update({**vars(loop.find(name).part.module), **changed})
    own = replace(loop.find(name).part, module=module)
    return replace(loop, parts=tuple(replace(f, part=own) if f.part.name == name else f for f in loop.parts))


def test_a_sensor_of_two_directions_that_tells_errors_of_one_is_left_out():
    class Both(NamedTuple):
        nadir: Vector
        nadir_is_seen: float
        sun: Vector
        sun_is_seen: float

    loop = loop_with(TEXTS["quest"])[1]
    assert measured(with_module(loop, "horizon-sensor")) is not None
    assert measured(with_module(loop, "horizon-sensor", Reading=Both)) is None
    other = {"direction": lambda params, period, sky: Direction("sun", 1e-3)}
    assert measured(with_module(loop, "horizon-sensor", **other)) is None


def test_an_own_estimator_that_does_not_tell_its_age_is_left_out():
    class Ageless(NamedTuple):
        attitude: Quaternion
        rate: Vector
        is_valid: float

    loop = loop_with(TEXTS["triad"])[1]
    assert measured(with_module(loop, "triad")) is not None
    assert measured(with_module(loop, "triad", Estimate=Ageless)) is None


@pytest.mark.parametrize("sine", [1e-3, 0.3])
def test_a_direction_is_further_from_another_by_the_angle_between_them(sine):
    random, seen = np.random.default_rng(4), Direction("field", 0.1, 0.02)
    moved = seen.beside(sine)
    a = unit(random.normal(size=(1000, 3)))
    side = across(a, random)
    cosine = math.sqrt(1.0 - sine * sine)
    for error in (0.1 * side, 0.1 * unit(random.normal(size=a.shape))):
        off = np.linalg.norm((cosine * a + sine * side + error) / cosine - a, axis=1)
        assert off.max() <= moved.error * (1.0 + 1e-12)
    assert np.linalg.norm((cosine * a + sine * side + 0.1 * side) / cosine - a, axis=1).max() > moved.error * (1.0 - 1e-9)
    assert moved.deviation == seen.deviation / cosine
    assert seen.beside(1.0).error == math.inf


@pytest.mark.parametrize("every", [2, 3, 7])
def test_a_body_that_accelerates_between_readings_of_the_gyro_puts_a_carried_attitude_off(every):
    """It turns to and fro, with each turn over when the gyro is read."""
    loop, period, most = loop_with(TEXTS["triad"])[1], 0.25, 0.1
    for name in ("sun-sensor", "magnetometer"):
        loop = with_changed(loop, name, interval=every * period)
    numbers, unseen = triad.prepare(triad.Params(), period), {"sun": (0.0, 0.0, 0.0), "sun_is_seen": 0.0}
    readings = SimpleNamespace(**unseen, magnetic_field=(1e-5, 0.0, 0.0), position=(7e6, 0.0, 0.0), rate=(0.0, 0.0, 0.0))
    memory = triad.remember(None, None)
    for _ in range(every - 1):
        estimate, memory = triad.estimate(readings, memory, numbers, None, period)
    turned = Rotation.from_rotvec((every - 1) * most * period**2 / 4.0 * np.eye(3)[0])
    off = (turned.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).magnitude()
    assert 0.4 < off / (measured(loop).amiss.attitude_per_acceleration * most) < 1.0


def test_a_limit_that_the_field_does_not_reach_does_nothing():
    loop = loop_with(TEXTS["triad"])[1]
    assert measured(with_changed(loop, "magnetometer", limit=1e-4)).amiss == measured(loop).amiss


def test_flights_in_which_directions_are_missing_leave_the_claim():
    loop = with_changed(loop_with(TEXTS["triad"])[1], "sun-sensor", outage=(0.5, 1.5))
    run = label(loop, *fly(loop, 12), 1)
    for age, missed in ((0.0, 4), (0.25, 3), (1.0, 0)):
        ((unmet, _),) = assumption(f"{FRESH}{age!r}").unmet(Span(loop, run))
        assert unmet.sum() == missed


def test_noise_that_follows_earlier_noise_is_as_rare_as_wider_gaussian_noise():
    for k in np.linspace(4.6, 12.0, 50):
        gaussian = math.log(0.8 * (k + 1.0 / k)) - k * k / 2.0
        wide = WIDER * k
        assert 1.5 * math.log(wide * wide / 3.0) + 1.5 - wide * wide / 2.0 < gaussian
    # Within an orbit or an hour of the longest control periods no radius is less than that.
    assert 0.8 * (4.6 + 1.0 / 4.6) * math.exp(-(4.6**2) / 2.0) > 0.0027 / 36


# --- one attitude ---------------------------------------------------------------------------------------------------------


def unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def across(a, random):
    """Vectors of unit length at right angles to unit vectors a (n, 3)."""
    return unit(np.cross(a, random.normal(size=a.shape)))


def errors_of(a, plane, size, random):
    """Errors of directions a of this size: in the plane with another direction, across it, or anyhow."""
    side = unit(np.cross(a, plane))
    choices = np.array([side, np.cross(a, side), unit(random.normal(size=a.shape))])
    picked = np.take_along_axis(choices, random.integers(3, size=len(a))[None, :, None], 0)[0]
    return size * random.choice([-1.0, 1.0], size=(len(a), 1)) * picked * random.uniform(0.7, 1.0, size=(len(a), 1)) ** 0.1


def angles_of(rotations):
    return Rotation.from_matrix(rotations).magnitude()


def frames(first, second):
    middle = unit(np.cross(first, second))
    return np.stack([first, middle, np.cross(first, middle)], -1)


def deviation_of(combined):
    return float(np.max(np.abs(np.array(combined[1].attitude))))


def drawn(random, apart, off, count):
    """Pairs of unit vectors, of which many are hardly as far apart as they have to be."""
    first = unit(random.normal(size=(count, 3)))
    near = apart + off * random.uniform(-1.0, 1.0, size=count)
    angle = np.where(random.uniform(size=count) < 0.7, near, random.uniform(apart, math.pi - apart, size=count))
    angle = np.where(random.uniform(size=count) < 0.5, angle, math.pi - angle)[:, None]
    return first, np.cos(angle) * first + np.sin(angle) * across(first, random)


def test_triad_is_no_further_off_than_it_says():
    random, worst, count = np.random.default_rng(1), [], 0
    for _ in range(fewer(60, 20)):
        apart = min(math.radians(10.0 ** random.uniform(0.5, 1.95)), 1.5)
        sizes = 10.0 ** random.uniform(-5.0, -1.0, size=4) * apart / (1.0, 1.0, DEVIATIONS, DEVIATIONS)
        sun, field = Direction("sun", *sizes[::2]), Direction("field", *sizes[1::2])
        said = triad.combined(triad.Params(apart=apart), (field, sun))
        if said is None:
            continue
        s, b = drawn(random, apart, sun.most + field.most, 20_000)
        n, m = (errors_of(x, y, DEVIATIONS * d.deviation, random) for x, y, d in ((s, b, sun), (b, s, field)))
        seen, other = unit(s + n + errors_of(s, b, sun.error, random)), unit(b + m + errors_of(b, s, field.error, random))
        fresh = np.linalg.norm(np.cross(seen, other), axis=-1) > math.sin(apart)
        found = frames(seen, other) @ frames(s, b).swapaxes(1, 2)
        u = unit(np.cross(s, b))
        sine, cosine = np.linalg.norm(np.cross(s, b), axis=-1, keepdims=True), np.sum(s * b, -1, keepdims=True)
        about = (np.sum(m * u, -1, keepdims=True) - cosine * np.sum(n * u, -1, keepdims=True)) / sine
        linear = Rotation.from_rotvec(np.cross(s, n) + about * s).as_matrix()
        worst.append(angles_of(linear.swapaxes(1, 2)[fresh] @ found[fresh]).max() / said[0].attitude)
        count += fresh.sum()
        # Shuster and Oh (1981), equation 85.
        p = (
            sun.deviation**2 * np.eye(3)
            + (
                sun.deviation**2 * cosine[:, :, None] * (s[:, :, None] * b[:, None, :] + b[:, :, None] * s[:, None, :])
                + (field.deviation**2 - sun.deviation**2) * s[:, :, None] * s[:, None, :]
            )
            / sine[:, :, None] ** 2
        )
        share = np.sqrt(np.linalg.eigvalsh(p[fresh])[:, -1].max()) / deviation_of(said)
        assert 0.9 < share < 1.0 + 1e-9
    assert max(worst) < 1.0
    assert max(worst) > (0.9 if WHOLE else 0.2)
    assert count > fewer(500_000, 20)


def test_quest_is_no_further_off_than_it_says():
    random, worst, count = np.random.default_rng(2), [], 0
    for _ in range(fewer(100, 20)):
        apart = math.radians(min(10.0 ** random.uniform(0.7, 1.9), 80.0))
        deviations = dict(zip(("sun", "field", "nadir"), 10.0 ** random.uniform(-3.5, -1.5, size=3), strict=True))
        kinds = [*deviations][: random.integers(2, 4)]
        kinds += random.choice(kinds[:2], size=random.integers(0, 3)).tolist()
        scale = 10.0 ** random.uniform(-4.0, 0.0)
        given = [
            Direction(kind, *(scale * deviations[kind] * 10.0 ** random.uniform(-1.0, 0.3, size=2) / (1.0, DEVIATIONS)))
            for kind in kinds
        ]
        said = quest.combined(quest.Params(**deviations, apart=apart), tuple(given))
        if said is None:
            continue
        first, second = drawn(random, apart, given[0].most + given[1].most, 10_000)
        third = np.where(random.uniform(size=(len(first), 1)) < 0.5, unit(random.normal(size=first.shape)), first)
        true = {"sun": first, "field": second, "nadir": third}
        F, B, pull, spread, fresh, seen = 0.0, 0.0, 0.0, 0.0, False, []
        for k, (kind, d) in enumerate(zip(kinds, given, strict=True)):
            r, plane = true[kind], second if kind == "sun" else first + 1e-6
            n = errors_of(r, plane, DEVIATIONS * d.deviation, random)
            b = unit(r + n + errors_of(r, plane, d.error, random))
            there = (random.uniform(size=(len(r), 1)) < 0.5) | (k < 2)
            w = there[..., None] / deviations[kind] ** 2
            information = w * (np.eye(3) - r[:, :, None] * r[:, None, :])
            F, B = F + information, B + w * b[:, :, None] * r[:, None, :]
            pull, spread = pull + w[..., 0] * np.cross(r, n), spread + w * d.deviation**2 * information
            for other, was in seen:
                fresh = fresh | (
                    there & was & (np.linalg.norm(np.cross(b, other), axis=-1, keepdims=True) > math.sin(apart))
                )
            seen.append((b, there))
        fresh = fresh[:, 0]
        # Markley (1988): the attitude by singular values.
        U, _, V = np.linalg.svd(B[fresh])
        U[:, :, 2] *= (np.linalg.det(U) * np.linalg.det(V))[:, None]
        inverse = np.linalg.inv(F[fresh])
        linear = Rotation.from_rotvec((inverse @ pull[fresh][:, :, None])[..., 0]).as_matrix()
        worst.append(angles_of(linear.swapaxes(1, 2) @ (U @ V)).max() / said[0].attitude)
        count += fresh.sum()
        covariance = inverse @ spread[fresh] @ inverse
        assert np.sqrt(np.linalg.eigvalsh((covariance + covariance.swapaxes(1, 2)) / 2.0)[:, -1].max()) < deviation_of(said)
    assert max(worst) < 1.0
    assert max(worst) > (0.9 if WHOLE else 0.2)
    assert count > fewer(500_000, 20)


def test_the_equations_that_fly_are_those_of_the_bound():
    """As they are recorded, in floats, with weights far apart and directions at their least angle."""
    random, distance = np.random.default_rng(3), 7e6
    for module, params in (
        (triad, triad.Params(apart=math.radians(10.0))),
        (quest, quest.Params(sun=1e-3, field=3e-2, apart=math.radians(10.0))),
    ):
        given = Direction("sun", 1e-4), Direction("field", 2e-3)
        bound = module.combined(params, given)[0].attitude
        numbers, worst = module.prepare(params, 0.25), 0.0
        for _ in range(fewer(1500, 20)):
            position = tuple((distance * along(random.normal(size=(3, 1)))[:, 0]).tolist())
            light = np.array(triad.sun.sun(0.0, triad.sun.prepared(params.epoch)).direction)
            field = np.array(triad.magnetic_field.field(position, 0.0, triad.magnetic_field.prepared(params.epoch)))
            true = Rotation.random(random_state=int(random.integers(2**31)))
            s, b = (true.inv().apply(x)[None] for x in (light, field / np.linalg.norm(field)))
            readings = SimpleNamespace(
                sun=tuple(unit(s + errors_of(s, b, 1e-4, random))[0]), sun_is_seen=1.0, rate=(0.0,) * 3, position=position,
                magnetic_field=tuple(np.linalg.norm(field) * unit(b + errors_of(b, s, 2e-3, random))[0]),
            )  # fmt: skip
            estimate, _ = module.estimate(readings, module.remember(params, None), numbers, None, 0.25)
            if estimate.is_valid:
                off = (true.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).magnitude()
                worst = max(worst, off / bound)
        assert 0.1 < worst < 1.0
