"""The circle round a libration point: what is claimed, refuted, and what flights and random states say to it."""

import math

import numpy as np
import pytest

from starhold.algebra.vector import ZERO
from starhold.certification.station import certify_station
from starhold.laws import l2_circle
from starhold.laws.catalogue import catalogue
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import PRIMARIES, PointState, linear, make_libration
from starhold.simulation.lanes import simulate_many
from tests.making import point_loop

EARTH = PRIMARIES["sun-earth"]
PLANT = make_libration(EARTH.larger, EARTH.smaller, EARTH.separation)
BEST = l2_circle.design(PLANT, l2_circle.Best(1.0))
PEAK = l2_circle.peak_demand(PLANT, BEST.rate)
RELAY = BEST._replace(feedback=1, k=0.3)


def loop_of(gains=BEST, limit=math.inf, kind="norm", **changes):
    start = PointState((0.0, gains.radius, 0.0), (0.0, 0.0, gains.rate * gains.radius), ZERO)
    return point_loop(
        PLANT, catalogue("libration-point")["l2-circle"], gains, start, 1e-3, limit=limit, kind=kind, **changes
    )


def claims_of(*given, **changes):
    return {claim.kind: claim for claim in certify_station(loop_of(*given, **changes)).claims}


def drawn(gains, level, count, random):
    """Positions and velocities (3, count) in the plane x = 0 on {V = level}."""
    s = random.uniform(-1.0, 1.0, count)
    f1 = s * math.sqrt(2.0 * level / gains.alpha)
    error, turn, angle = np.sqrt(2.0 * level * (1.0 - s * s)), *random.uniform(0.0, 2.0 * np.pi, (2, count))
    r = np.sqrt(gains.radius**2 + f1)
    y, z = r * np.cos(turn), r * np.sin(turn)
    zero = np.zeros(count)
    return np.array([zero, y, z]), np.array(
        [zero, error * np.cos(angle) - gains.rate * z, error * np.sin(angle) + gains.rate * y]
    )


def seen_at(position, velocity):
    return PointMeasurement(tuple(position.tolist()), tuple(velocity.tolist()), 1e-3, math.inf)


def test_nominal_demand_is_the_largest_on_the_circle():
    """2 Omega sqrt(C - Omega^2) radius at the best rate, 3.429 radius; the printed 2.786 leaves out a part of it."""
    assert pytest.approx(2.0 * math.sqrt(PLANT.stiffness - 1.0), rel=1e-12) == PEAK
    assert pytest.approx(3.429, abs=1e-3) == PEAK
    assert 2.0 * BEST.rate == pytest.approx(2.786, abs=1e-3)
    norms = []
    for phase in np.linspace(0.0, 2.0 * np.pi, 721):
        y, z = math.cos(phase), math.sin(phase)
        measurement = PointMeasurement((0.0, y, z), (0.0, -BEST.rate * z, BEST.rate * y), 1e-3, math.inf)
        norms.append(np.linalg.norm(l2_circle.feedback(measurement, BEST, PLANT)))
    assert max(norms) == pytest.approx(PEAK, rel=1e-9)


@pytest.mark.parametrize("gains", [BEST, BEST._replace(alpha=3.0, k=0.2, radius=2.0), RELAY._replace(boundary_layer=0.05)])
def test_attracts_up_to_the_centre(gains):
    claim = claims_of(gains)["circle"]
    centre = gains.alpha * gains.radius**4 / 2.0
    assert claim.outcome == "proved"
    assert 0.999 * centre < claim.numbers["level"] < centre
    # V falls at random states by the model's and the law's own equations.
    random = np.random.default_rng(3)
    for position, velocity in zip(*(x.T for x in drawn(gains, claim.numbers["level"], 300, random)), strict=True):
        measurement = seen_at(position, velocity)
        acceleration = np.add(
            linear(measurement.position, measurement.velocity, PLANT), l2_circle.feedback(measurement, gains, PLANT)
        )
        step = 1e-5
        before, after = (
            l2_circle.lyapunov(seen_at(position + h * velocity, velocity + h * acceleration), gains, PLANT)
            for h in (-step, step)
        )
        assert (after - before) / (2.0 * step) < 1e-9


def test_flights_from_the_set_end_on_the_circle():
    claim = claims_of()["circle"]
    random = np.random.default_rng(4)
    # Near the centre the motion takes for ever; a level away from it does not.
    position, velocity = drawn(BEST, 0.9 * claim.numbers["level"], 200, random)
    batch = simulate_many(loop_of(), np.vstack([position, velocity, np.zeros_like(position)]), 60_000)
    assert (batch.lost_at < 0.0).all()
    np.testing.assert_allclose(np.hypot(batch.states[1], batch.states[2]), 1.0, atol=2e-3)


def test_a_relay_without_a_layer_holds_other_circles():
    claim = claims_of(RELAY)["circle"]
    assert claim.outcome == "refuted"
    evidence = claim.refutation().evidence
    assert evidence["needs"] <= evidence["of"] == 0.3
    r = evidence["radius"]
    assert 2.0 * abs(r * r - 1.0) * r == pytest.approx(evidence["needs"])
    start = PointState((0.0, r, 0.0), (0.0, 0.0, BEST.rate * r), ZERO)
    held, drawn_in = (
        simulate_many(point_loop(PLANT, catalogue("libration-point")["l2-circle"], gains, start, 1e-4), [start], 63_000)
        for gains in (RELAY, RELAY._replace(boundary_layer=0.3))
    )
    # One revolution of the axes: the relay alone leaves it there but for its chatter, a layer lets it come home.
    assert np.hypot(*held.states[1:3, 0]) == pytest.approx(r, rel=2e-3)
    assert np.hypot(*drawn_in.states[1:3, 0]) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(("kind", "margin"), [("norm", 1.05), ("norm", 1.2), ("axis", 1.2)])
def test_the_control_stays_within_its_limit(kind, margin):
    limit = margin * PEAK if kind == "norm" else margin * 2.94
    claim = claims_of(BEST, limit, kind)["control-limit"]
    assert claim.outcome == "proved"
    random = np.random.default_rng(5)
    needs = []
    for level in (claim.numbers["level"], 1.5 * claim.numbers["level"]):
        states = drawn(BEST, level, 4000, random)
        pairs = zip(states[0].T, states[1].T, strict=True)
        u = np.array([l2_circle.feedback(seen_at(*pair), BEST, PLANT) for pair in pairs]).T
        size = np.linalg.norm(u, axis=0) if kind == "norm" else np.abs(u).max(axis=0)
        needs.append(float(size.max()) / limit)
    assert needs[0] <= 1.0
    assert needs[1] > 0.99


def test_a_deficit_is_refuted_by_the_circle_itself():
    claim = claims_of(BEST, 0.95 * PEAK)["control-limit"]
    assert claim.outcome == "refuted"
    assert claim.refutation().evidence["control"] == pytest.approx(PEAK)


def test_what_the_law_does_not_undo_is_told():
    claim = claims_of(BEST, model="nonlinear")["circle"]
    assert claim.outcome == "undecided"
    assert "full problem" in claim.obligations[0].evidence["reason"]
    assert claims_of(BEST._replace(model=1), model="nonlinear")["circle"].outcome == "proved"
    assert claims_of(BEST._replace(k_x=8.0))["circle"].outcome == "refuted"
    optimal = catalogue("libration-point")["l2-optimal"]
    assert certify_station(point_loop(PLANT, optimal, optimal.examples()[0], loop_of().start, 1e-3)).outcome == "undecided"
