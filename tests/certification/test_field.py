"""The field along an orbit, and the claim about detumbling, against flights."""

import numpy as np
import pytest

import starhold as sh
from starhold.certification.certify import certify
from starhold.certification.field import field_along, positions
from starhold.parts.magnetic_field import field, prepared
from starhold.scenario.building import build
from tests.kernel import flights

EPOCH = (2026.0, 3.0, 20.0, 12.0, 0.0, 0.0)
ELLIPSE = {
    "semi_major_axis": "8100 km", "eccentricity": 0.15, "inclination": "70 deg", "epoch": "2026-03-20T12:00:00Z",
}  # fmt: skip


def fields(times, places):
    """The field (n, 3) at times and places, T, inertial axes."""
    known = prepared(EPOCH)
    return np.array([field(tuple(p), t, known) for p, t in zip(places.tolist(), times.tolist(), strict=True)])


def exact(**changes):
    """The CubeSat that detumbles, with a magnetometer that does not err."""
    quiet = {"part.magnetometer.noise": 0.0, "part.magnetometer.bias": [0.0, 0.0, 0.0], "simulation.record_every": 1}
    return sh.load("cubesat-detumble").with_(quiet | changes)


@pytest.mark.parametrize("orbit", ["cubesat-detumble", "elliptic"])
def test_positions_and_field_are_those_of_flights(orbit):
    start = {"initial.rate": [0.0, 0.0, 0.0], "simulation.duration": "2 h"}
    given = exact(**start)
    if orbit == "elliptic":
        given = given.with_({"orbit": ELLIPSE})
    loop = build(given, given.pick("b-dot"))
    run = sh.simulate(given, "b-dot")
    times, place = run.time.values, run.position.values
    assert np.abs(positions(loop, times).T - place).max() < 1.0
    least, change = field_along(loop, EPOCH)
    # Pairs of control instants, a minute apart.
    before, after = (fields(times[k:-1:30], place[k:-1:30]) for k in (0, 1))
    count = min(len(before), len(after))
    before, after = before[:count], after[:count]
    size = np.linalg.norm(before, axis=1)
    flown = np.linalg.norm(after - before, axis=1) / size / loop.period
    # Within what is stated, but for a day the flight is short.
    assert least < size.min() < 2.0 * least
    assert 0.6 * change < flown.max() < change


def test_a_law_that_no_sensor_tells_the_field_has_no_claim():
    given = exact(**{"simulation.duration": "30 min"})
    loop = build(given, given.pick("b-dot"))
    blind = loop.without("magnetometer")
    claims = [certify(one).claim("detumbling") for one in (loop, blind)]
    assert [claim is not None and claim.outcome == "proved" for claim in claims] == [True, False]


FLOWN = [("b-dot", ["6 deg/s", "-5 deg/s", "6.2 deg/s"]), ("quick", ["1 deg/s", "1 deg/s", "-0.5 deg/s"])]


@pytest.mark.parametrize(("law", "rate"), FLOWN)
def test_flights_with_all_parts_keep_the_claim(law, rate):
    given = exact(**{"initial.rate": rate, "simulation.duration": "30 min"})
    loop = build(given, given.pick(law))
    claim = certify(loop).claim("detumbling")
    assert claim.outcome == "proved"
    assert not claim.left_out
    run = sh.simulate(given, law)
    B = fields(run.time.values, run.position.values)
    b, q, w = (B / np.linalg.norm(B, axis=1)[:, None]).T, run.attitude.values.T, run.rate.values
    energy = 0.5 * (w**2 * np.array([0.05, 0.065, 0.025])).sum(axis=1)
    held = b[:, 1:-1]
    turning = np.linalg.norm(flights.seen(q[:, 2:], held) - flights.seen(q[:, :-2], held), axis=0) / (2.0 * loop.period)
    gained = np.diff(energy)[1:] / loop.period
    fast = np.linalg.norm(w, axis=1)
    numbers, seen = claim.numbers, 0
    for place, limit in enumerate(numbers["rates"]):
        slow = np.r_[False, np.maximum.reduce([fast[k : len(fast) - 3 + k] for k in range(4)]) < limit * 0.99]
        assert gained[slow].max(initial=-1.0) <= numbers["rise"][place]
        falling = slow & (turning > numbers["turning"][place])
        assert gained[falling].max(initial=-1.0) < 0.0
        seen += falling.sum()
    assert seen > 30
