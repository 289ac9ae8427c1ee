"""Rest beside a libration point: what is claimed of the X axis with limited control, and what flights say to it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from starhold.algebra.vector import ZERO
from starhold.certification.station import certify_station
from starhold.laws import l2_equilibrium
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import PRIMARIES, PointState, make_libration
from starhold.simulation.lanes import simulate_many
from tests.making import point_loop

EARTH = PRIMARIES["sun-earth"]
PLANT = make_libration(EARTH.larger, EARTH.smaller, EARTH.separation)
GAINS = l2_equilibrium.design(PLANT, l2_equilibrium.Degree(y=1.0))
STEEP = 1.0 + 2.0 * PLANT.stiffness
REST = PointState((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), ZERO)


def loop_of(gains=GAINS, limit=math.inf, kind="axis", **changes):
    return point_loop(
        PLANT, catalogue("libration-point")["l2-equilibrium"], gains, REST, 1e-3, limit=limit, kind=kind, **changes
    )


def claims_of(*given, **changes):
    return {claim.kind: claim for claim in certify_station(loop_of(*given, **changes)).claims}


@pytest.mark.parametrize("limit", [1.0, 3.5, 20.0])
def test_the_saturated_axis_is_certified_up_to_the_separatrix(limit):
    """|x + x'/s| < U/p, which is |x + x'| < 1 in the scaled time and twice the linear zone, within 1 %."""
    claim = claims_of(GAINS._replace(y=0.1), limit)["saturated-axis"]
    assert claim.outcome == "proved"
    true = limit / STEEP
    assert 0.99 * true < claim.numbers["width"] < true <= claim.numbers["boundary"] < true * (1.0 + 1e-12)
    zone = limit / (GAINS.k_velocity[0] * math.sqrt(STEEP))
    assert true / zone == pytest.approx(2.0)


def test_flights_return_from_inside_and_from_nowhere_else():
    limit = 4.0
    numbers = claims_of(GAINS, limit)["saturated-axis"].numbers
    s, random = math.sqrt(STEEP), np.random.default_rng(2)
    x = np.concatenate([random.uniform(-3.0, 3.0, 200), [0.0, 0.0]]) * numbers["width"]
    for share, returns in ((0.999, True), (1.001 * numbers["boundary"] / numbers["width"], False)):
        sigma = share * numbers["width"] * np.where(np.arange(x.size) % 2 == 0, 1.0, -1.0)
        states = np.zeros((9, x.size))
        states[0], states[1], states[3] = x, GAINS.y, s * (sigma - x)
        # The Coriolis acceleration that X makes along Y is undone, within the limit, while x' is small enough.
        states = states[:, 2.0 * np.abs(states[3]) + (PLANT.stiffness - 1.0) < limit]
        assert states.shape[1] > 20
        batch = simulate_many(replace(loop_of(limit=limit), divergence_bound=50.0), states, 12_000)
        if returns:
            assert (batch.lost_at < 0.0).all()
            np.testing.assert_allclose(batch.states[0], 0.0, atol=1e-6)
        else:
            assert (batch.lost_at >= 0.0).all()


def test_rest_attracts_without_a_limit():
    assert claims_of()["equilibrium"].outcome == "proved"
    assert claims_of(GAINS._replace(model=1), model="nonlinear")["equilibrium"].outcome == "proved"
    assert claims_of(model="nonlinear")["equilibrium"].outcome == "undecided"
    assert claims_of(GAINS._replace(k_x=0.9 * STEEP))["equilibrium"].outcome == "refuted"
    assert "saturated-axis" not in claims_of(GAINS._replace(k_x=0.9 * STEEP), 1.0)


def test_feedback_off_the_separatrix_is_left_undecided():
    near = GAINS._replace(y=0.1)
    assert claims_of(near._replace(k_x=1.2 * GAINS.k_x), 1.0)["saturated-axis"].outcome == "undecided"
    assert claims_of(near._replace(k_x=GAINS.k_x * (1.0 + 1e-9)), 1.0)["saturated-axis"].outcome == "proved"


def test_nothing_is_said_of_x_where_the_others_cannot_be_held_or_the_model_is_another():
    claim = claims_of(GAINS, 2.9)["saturated-axis"]
    assert claim.outcome == "undecided"
    assert "cannot be held" in claim.obligations[0].evidence["reason"]
    assert claims_of(GAINS, 3.0)["saturated-axis"].outcome == "proved"
    assert "saturated-axis" not in claims_of(GAINS._replace(model=1), 4.0, model="nonlinear")
