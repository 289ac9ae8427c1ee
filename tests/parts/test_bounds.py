"""What parts say of the largest torques and errors that they make: never exceeded, and not far above the largest."""

from math import pi

import numpy as np
import pytest

from starhold.parts.contract import Envelope
from starhold.parts.craft import make_craft
from starhold.parts.effectors import wheels
from starhold.parts.effectors.layouts import three_orthogonal
from starhold.parts.environments import gravity_gradient
from starhold.parts.orbit import BODIES, Elements, from_elements, highest_speed, lowest
from starhold.parts.plates import largest_torque
from tests.tiers import leading

GRAVITY = BODIES["Earth"].gravity


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
