"""Magnetic laws: against the damping that they stand for, as SciPy integrates it, and in flights from tumbling to rest."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.laws import b_dot, cross_product
from starhold.laws.interface import Measurement
from starhold.parts.craft import make_craft
from starhold.parts.magnetic_field import field, prepared
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, parse
from tests.missions import cubesat
from tests.refusals import refused, replaced

INERTIA = np.array([0.05, 0.065, 0.025])
CRAFT = make_craft(INERTIA)
EPOCH = (2026.0, 3.0, 5.0, 6.0, 30.0, 0.0)
PARTS = '[[part]]\ntype = "magnetometer"\n[[part]]\ntype = "magnetorquers"\ndipole_limit = 5.0\n'
ORBIT = 5677.0
"""s, of the scenario."""


def text(law, rate, duration=ORBIT, parts=PARTS):
    """The CubeSat with a law."""
    angles = '["20 deg", "-10 deg", "30 deg"]'
    return cubesat("record_every = 20\n", parts, f"[[law]]\n{law}", angles=angles, duration=duration, rate=rate)


def told(rate, magnetic_field, attitude=(1.0, 0.0, 0.0, 0.0)):
    """A measurement at a target at rest."""
    zero = (0.0, 0.0, 0.0)
    return Measurement(attitude, rate, rate, zero, zero, zero, zero, 0.5, zero, magnetic_field)


def test_b_dot_is_damping_across_the_field():
    rng = np.random.default_rng(2)
    gains = b_dot.Gains(3e-4)
    for _ in range(50):
        rate, before = rng.normal(size=3) * 1e-4, rng.normal(size=3) * 3e-5
        # A field that rests is seen to turn the other way.
        after = Rotation.from_rotvec(-0.5 * rate).apply(before)
        first, memory = b_dot.torque(told(rate, tuple(before)), gains, CRAFT, b_dot.remember(gains, CRAFT, 0.5))
        assert first == (0.0, 0.0, 0.0)
        given, _ = b_dot.torque(told(rate, tuple(after)), gains, CRAFT, memory)
        along = after / np.linalg.norm(after)
        wanted = -gains.k * (rate - along * (along @ rate))
        assert np.abs(np.array(given) - wanted).max() < 1e-4 * np.linalg.norm(wanted)


def test_the_cross_product_law_is_feedback_across_the_field():
    rng = np.random.default_rng(3)
    gains = cross_product.Gains(3e-4, 2e-6)
    for _ in range(50):
        rate, magnetic, q = rng.normal(size=3) * 1e-2, rng.normal(size=3) * 3e-5, rng.normal(size=4)
        q /= np.linalg.norm(q)
        given, _ = cross_product.torque(told(tuple(rate), tuple(magnetic), tuple(q)), gains, CRAFT, ())
        wanted = -gains.k_rate * rate - gains.k_attitude * q[1:]
        along = magnetic / np.linalg.norm(magnetic)
        assert np.abs(np.array(given) - (wanted - along * (along @ wanted))).max() < 1e-18


def test_b_dot_slows_tumbling_as_the_damping_does_that_it_stands_for():
    k = 2e-4
    run = sh.simulate(parse(text(f'type = "b-dot"\nk = {k}\n', ["8 deg/s", "-6 deg/s", "5 deg/s"]), "own"))
    numbers = prepared(EPOCH)
    places = run.position.values

    def slope(t, y):
        q, w = y[:4], y[4:]
        place = [np.interp(t, run.time.values, column) for column in places.T]
        b = Rotation.from_quat(q, scalar_first=True).inv().apply(field(tuple(place), t, numbers))
        torque = -k * (w - b * (b @ w) / (b @ b))
        turning = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
        return [*turning, *((torque - np.cross(w, INERTIA * w)) / INERTIA)]

    times = run.time.values[:60]
    start = [*run.attitude.values[0], *run.rate.values[0]]
    exact = solve_ivp(slope, (0.0, times[-1]), start, "DOP853", times, rtol=1e-9, atol=1e-10).y.T
    energy, wanted = (np.sum(INERTIA * w**2, axis=1) for w in (run.rate.values[:60], exact[:, 4:]))
    assert wanted[-1] < 0.4 * wanted[0]
    # The law measures the rate half a period and holds its torque another half later.
    assert np.abs(energy / wanted - 1.0).max() < 0.03
    # Within an orbit what is left is the turning of the field itself, some two turns an orbit.
    assert np.linalg.norm(run.rate.values[-1]) < 3.0 * math.tau / ORBIT
    assert np.abs(run.magnetic_dipole.values).max() <= 5.0


def test_the_design_of_b_dot_is_the_published_one():
    gains = b_dot.design(CRAFT, b_dot.Orbit(ORBIT, math.radians(80.0)))
    assert gains.k == pytest.approx(2.0 * (math.tau / ORBIT) * (1.0 + math.sin(math.radians(80.0))) * 0.025)
    law = 'type = "b-dot"\nform = "orbit"\norbit_period = 5677\ninclination = "80 deg"\n'
    run = sh.simulate(parse(text(law, [0.1, -0.1, 0.1]), "own"))
    assert np.linalg.norm(run.rate.values[-1]) < 0.1 * np.linalg.norm(run.rate.values[0])


def test_the_cross_product_law_brings_the_craft_to_rest_on_target_within_orbits():
    law = "k_rate = 1e-4\nk_attitude = 2e-7\n"
    run = sh.simulate(parse(text(f'type = "cross-product"\n{law}', [1e-3, -1e-3, 1e-3], duration=8 * ORBIT), "own"))
    angle = 2.0 * np.linalg.norm(run.attitude_error.values[:, 1:], axis=1)
    assert angle[0] > 0.5
    assert angle[-500:].max() < 0.01
    # The magnetorquers leave out the same of any law.
    other = sh.simulate(parse(text(f'type = "pd"\n{law}', [1e-3, -1e-3, 1e-3]), "own"))
    shared = len(other.time)
    assert np.abs(other.attitude.values - run.attitude.values[:shared]).max() < 1e-9
    assert np.abs(other.command.values - run.command.values[:shared]).max() > 1e-9


@pytest.mark.parametrize("law", ['type = "b-dot"\nk = 1e-4\n', 'type = "cross-product"\nk_rate = 1e-4\nk_attitude = 1e-6\n'])
def test_a_law_that_the_field_steers_needs_its_reading_and_has_no_claim_about_its_attitude(law):
    name = law.split('"')[1]
    with refused(f"law {name}: found no magnetic_field, which {name} needs; allowed: a sensor that measures magnetic_field"):
        sh.simulate(parse(text(law, [0.1, 0, 0], parts=""), "own"))
    (certificate,) = sh.certify(parse(text(law, [0.1, 0, 0]), "own"))
    assert [claim.kind for claim in certificate.claims if claim.outcome == "proved"] == ["detumbling"] * (name == "b-dot")
    assert certificate.outcome == "undecided"


WHEELS = '[wheels]\nlayout = "orthogonal"\ninertia = 2e-5\ntorque_limit = "2 mN m"\nmomentum_limit = "15 mN m s"\n'
MODES = """
[[law]]
name = "mission"
type = "modes"
mode = [
    { name = "detumble", type = "b-dot", k = 1e-3, effectors = ["wheels"], until = { after = "20 s" } },
    { name = "point", type = "pd", k_rate = 0.006, k_attitude = 0.0008 },
]
"""


@pytest.mark.parametrize("law", ["b-dot", "cross-product"])
def test_a_dipole_on_wheels_is_refused(law):
    """Wheels would only take the momentum over."""
    given = "k = 1e-3\n" if law == "b-dot" else "k_rate = 2e-4\nk_attitude = 2e-7\n"
    flown, own = builtin_text("cubesat-detumble").partition("[[law]]")[0], f'[[law]]\ntype = "{law}"\n{given}'
    rods = '[[part]]\ntype = "magnetorquers"\ndipole_limit = "0.2 A m^2"'
    tables = replaced(flown, rods, WHEELS)
    for text_of, where in ((own, f"law {law}"), (MODES, "law modes, mode detumble")):
        scenario = parse(tables + text_of, "mine.toml")
        with refused(" with wheels, which store the momentum", start=f"mine.toml: {where}: found "):
            build(scenario, scenario.laws[0])
    # A torque that nothing is said of may come from outside, as that of rods does.
    for parts in (flown, flown.replace(rods, "")):
        scenario = parse(parts + own, "mine.toml")
        assert build(scenario, scenario.laws[0]).law.name == law
