"""What parts say of the largest torques and errors that they make: never exceeded, and not far above the largest."""

from math import pi
from types import SimpleNamespace

import numpy as np
import pytest

from starhold.algebra.quaternion import NO_TURN, to_body
from starhold.algebra.vector import ZERO
from starhold.parts import magnetic_field
from starhold.parts.bodies.rigid_body import State
from starhold.parts.contract import Envelope
from starhold.parts.craft import make_craft
from starhold.parts.effectors import magnetic_unloading, wheels
from starhold.parts.effectors.layouts import pyramid, three_orthogonal
from starhold.parts.environments import drag, gravity_gradient
from starhold.parts.orbit import BODIES, Elements, from_elements, highest_speed, lowest
from starhold.parts.plates import BOX, largest_torque
from tests.tiers import leading

GRAVITY, CRAFT = BODIES["Earth"].gravity, make_craft([0.05, 0.065, 0.025])
COUNT = 200
"""States at which the equations themselves are called."""


def directions(random, count):
    found = random.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


def orbit(random):
    """A place on a random orbit, and its envelope without momentum."""
    radius, eccentricity = 6.378e6 + random.uniform(2e5, 2e6), random.choice([0.0, random.uniform(0.0, 0.5)])
    angles = random.uniform(0.0, 2.0 * pi, 4)
    angles[0] /= 2.0
    elements = Elements(radius / (1.0 - eccentricity), eccentricity, *angles.tolist())
    begun = from_elements(elements, GRAVITY)
    around = Envelope(lowest(*begun, GRAVITY), highest_speed(*begun, GRAVITY), 0.0, 0.065)
    # The bound is one of the whole orbit; where it is nearest it is looked at most.
    elements = elements._replace(true_anomaly=float(random.choice([0.0, angles[3]])))
    return from_elements(elements, GRAVITY), around


def state_at(random, place):
    attitude = random.normal(size=4)
    return State(tuple((attitude / np.linalg.norm(attitude)).tolist()), ZERO, *place, ZERO)


def shares(params, seed):
    """The torques at random places and attitudes, as shares of the bound."""
    random, numbers = np.random.default_rng(seed), drag.prepare(params, 1.0)
    for _ in range(20):
        place, around = orbit(random)
        bound = drag.bound(params, around)
        assert bound.per_rate == 0.0
        for _ in range(COUNT // 10):
            state = state_at(random, place)
            torque = drag.torque(state, numbers, CRAFT, drag.update(None, state, numbers, None, 0))
            yield float(np.linalg.norm(torque)) / bound.torque


WING = (*BOX, (0.2, 0.6, 0.0, 0.8, 0.0, 0.4, 0.0), (0.2, 1.0, 1.0, 1.0, 0.0, -0.4, 0.1))
DRAG = [
    (drag.Params(BOX, density=1.5e-12), 0.5),
    (drag.Params(WING, scale_height=2e6), 0.3),
    (drag.Params(BOX[:1], scale_height=5e6, rotation=30.0), 0.1),
]
"""In air that gets thinner so slowly, the orbit's highest place counts; attacks seldom try it."""


@pytest.mark.parametrize(("params", "reached"), DRAG)
def test_no_torque_of_the_air_exceeds_its_bound_and_some_come_near(params, reached):
    found = list(shares(params, 1))
    assert reached < max(found) <= 1.0 + 1e-12


def changes_of_gravity(random, count, size):
    """How fast the gravity gradient changes on a random orbit, by the slope of an own formula, in what is said of it; of
    bodies that turn by up to `size` in the rate of a circular orbit."""
    inertia = np.diag(random.uniform(0.5, 1.0, 3))
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    J = axes @ inertia @ axes.T
    (place, velocity), around = orbit(random)
    said = gravity_gradient.torque_change((), make_craft(J.tolist(), gravity=GRAVITY), around)
    r, along = np.linalg.norm(place), np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
    R, v = along @ place, along @ velocity
    w = size * (GRAVITY / around.distance**3) ** 0.5 * random.uniform(size=(count, 1)) * directions(random, count)
    turned = v - np.cross(w, R)
    slope = np.cross(turned, R @ J) + np.cross(R, turned @ J) - 5.0 * (np.dot(place, velocity) / r**2) * np.cross(R, R @ J)
    change = 3.0 * GRAVITY / r**5 * np.linalg.norm(slope, axis=1)
    return change / (said.torque + said.per_rate * np.linalg.norm(w, axis=1))


@pytest.mark.parametrize(("size", "reached"), [(0.0, 0.5), (1.0, 0.6), (100.0, 0.95)])
def test_no_gravity_gradient_changes_faster_than_is_said_and_some_nearly_do(size, reached):
    """So what is said is noticed if it is halved, of bodies that turn and of those that do not."""
    random = np.random.default_rng(7)
    found = max(float(changes_of_gravity(random, 4000, size).max()) for _ in range(25))
    assert reached < found <= 1.0 + 1e-12


def plates_of_a_kind(random, kind, count):
    """Normals, and arms of taken, mirrored and scattered light: any, of boxes, in a plane, of one sheet."""
    normals = directions(random, count)
    if kind == "box":
        normals = np.concatenate([np.eye(3), -np.eye(3)])[random.integers(6, size=count)]
    elif kind == "plane":
        normals = np.cross(normals, directions(random, 1))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
    elif kind == "sheet":
        normals = normals[:1] * random.choice([-1.0, 1.0], (count, 1))
    return normals, *random.normal(size=(3, count, 3))


@pytest.mark.parametrize("kind", ["any", "box", "plane", "sheet"])
@pytest.mark.parametrize("count", leading([6, 1, 2, 9]))
@pytest.mark.parametrize("light", [False, True])
def test_no_side_is_pushed_more_than_the_largest_torque(kind, count, light):
    """From 10^5 sides, of which an own formula tells the torque."""
    random = np.random.default_rng(count)
    normals, taken, mirrored, scattered = plates_of_a_kind(random, kind, count)
    s = directions(random, 100_000)
    # Some from where plates are seen edge on.
    s[::2] = np.cross(s[::2], normals[random.integers(count, size=50_000)])
    s /= np.linalg.norm(s, axis=1)[:, None]
    cosines = np.maximum(s @ normals.T, 0.0)
    torque = np.cross(s, cosines @ taken)
    if light:
        torque = torque - cosines**2 @ mirrored - cosines @ scattered
    found = largest_torque(normals, taken, *((mirrored, scattered) if light else ()))
    largest = np.linalg.norm(torque, axis=1).max()
    assert largest <= found * (1.0 + 1e-12)
    assert found < (5.0 if light else 2.0) * largest


def unloaded(params, random, field_error, momentum, count):
    """Torques of the unloading, and what is said of them at the body's rate."""
    numbers = magnetic_unloading.prepare(params, 1.0)
    inertia = np.diag([0.05, 0.065, 0.025])
    for _ in range(count):
        place, around = orbit(random)
        state, step = state_at(random, place), int(random.integers(10**6))
        around = around._replace(momentum=momentum, field_error=field_error)
        field = magnetic_field.field_at(state.position, step, numbers.field)
        measured = np.array(to_body(state.attitude, field)) + field_error * directions(random, 1)[0]
        rate = 10.0 ** random.uniform(-4, 0) * directions(random, 1)[0]
        stored = momentum * directions(random, 1)[0] - inertia @ rate
        shown = SimpleNamespace(wheel_momentum=tuple(stored.tolist()), magnetic_field=tuple(measured.tolist()))
        switched = magnetic_unloading.switch(magnetic_unloading.remember(numbers), None, shown, state, numbers, step)
        torque, bound = magnetic_unloading.reaction(switched, None, state, numbers), magnetic_unloading.bound(params, around)
        yield float(np.linalg.norm(torque)), bound.torque + bound.per_rate * float(np.linalg.norm(rate))


@pytest.mark.parametrize("limited", leading([1, 0]))
@pytest.mark.parametrize(
    ("gain", "field_error", "momentum", "reached"),
    [
        (3e-4, 0.0, 5e-3, 0.8),
        (3e-4, 2e-6, 5e-3, 0.4),
        (3e-4, 6e-5, 5e-3, 0.1),
        (0.05, 0.0, 5e-3, 0.3),
        (0.05, 3e-5, 1.0, 0.4),
    ],
)
def test_unloading_keeps_what_it_says(gain, field_error, momentum, reached, limited):
    params = magnetic_unloading.Params(
        gain, (0.2, 0.1, 0.2), limited, (1e-3, 0.0, -5e-4), (2029.0, 9.0, 21.0, 12.0, 30.0, 15.0)
    )
    pairs = list(unloaded(params, np.random.default_rng(limited), field_error, momentum, COUNT // 10))
    found = [size / bound for size, bound in pairs]
    assert reached < max(found) <= 1.0 + 1e-12


@pytest.mark.parametrize(
    "axes", [three_orthogonal(), pyramid(), [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0.2), (0.1, 0, 1)]]
)
@pytest.mark.parametrize("friction", leading([{"viscous": 2e-7, "coulomb": 3e-5}, {"viscous": 2e-7}, {"coulomb": 3e-5}]))
def test_friction_is_an_error_of_the_command(axes, friction):
    """Rotors within their limits, as bad as can be: all at full speed, in all senses."""
    params = wheels.make_wheels(axes, 2.2e-5, 2e-3, 15e-3, **friction)
    bound, random, found = wheels.error(params, Envelope(7e6, 7.6e3, 0.1, 0.065)), np.random.default_rng(3), []
    for _ in range(COUNT):
        full = 0.98 * 15e-3 * random.choice([-1.0, 1.0], len(axes)) * random.choice([1.0, random.uniform()])
        rate = 10.0 ** random.uniform(-4, 2) * directions(random, 1)[0]
        wanted = tuple((1e-4 * directions(random, 1)[0]).tolist())
        body = State(NO_TURN, tuple(rate.tolist()), ZERO, ZERO, ZERO)
        given = wheels.applied(wheels.State(tuple(full.tolist())), wheels.command(wanted, params), body, params)
        said = bound.torque + bound.per_rate * np.linalg.norm(rate)
        found.append(float(np.linalg.norm(np.subtract(given, wanted)) / said))
    assert 0.7 < max(found) <= 1.0 + 1e-9


def test_friction_that_grows_without_end_has_no_bound():
    params = wheels.make_wheels(three_orthogonal(), 2.2e-5, 2e-3, float("inf"), viscous=1e-7)
    assert wheels.error(params, Envelope(7e6, 7.6e3, 0.1, 0.065)).torque == float("inf")
    smooth = wheels.make_wheels(three_orthogonal(), 2.2e-5, 2e-3, float("inf"), coulomb=1e-5)
    assert wheels.error(smooth, Envelope(7e6, 7.6e3, 0.1, 0.065)) == (pytest.approx(3**0.5 * 1e-5), 0.0)


@pytest.mark.parametrize("eccentricity", [0.0, 0.3, 0.9, 1.5])
def test_an_orbit_is_nowhere_faster(eccentricity):
    size = 7e6 / (1.0 - eccentricity)
    for anomaly in np.linspace(-1.5, 1.5, 7).tolist():
        begun = from_elements(Elements(size, eccentricity, 0.4, 0.1, 0.2, anomaly), GRAVITY)
        found = highest_speed(*begun, GRAVITY)
        assert found == pytest.approx((GRAVITY * (1.0 + eccentricity) / 7e6) ** 0.5, rel=1e-9)
        assert found >= np.hypot(*begun[1][:2]) * (1.0 - 1e-12)
