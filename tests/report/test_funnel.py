"""The proved bound of the angle over a flight: when the claim covers it, and that the flight stays below."""

import numpy as np
import pytest

from starhold.analysis.rigid_body import error_angle
from starhold.report.attitude_plots import funnel
from starhold.report.text import covered_text
from starhold.scenario.building import build
from starhold.studies.compare import fly_law, prove
from tests.campaign.flown import short


def proved(duration=80.0, **tables):
    """A flight of a loop of which a claim is proved, with its certificates."""
    settings = {"sensor": {"rate_noise": 1e-5, "attitude_noise": 1e-5}, "environment": {}, "certify": {"disturbance": 1e-4}}
    scenario = short(duration=duration, **(settings | tables))
    loop = build(scenario, scenario.laws[0])
    return prove(scenario, scenario.laws[0], loop, fly_law(scenario, scenario.laws[0], loop), pointing=True)


def test_a_flight_from_the_set_is_covered_from_the_start_and_stays_below():
    flight = proved(500.0, initial={"attitude": [1.0, 0.05, 0.0, -0.03]})
    assert flight.covered == (((0.0, 500.0),),)
    assert covered_text(flight, 0) == ""
    ((times, most),) = funnel(flight)
    run = flight.recording
    angle, above = error_angle(run["attitude_error"]), most[np.searchsorted(times, run["time"], side="right") - 1]
    assert (angle <= above).all()
    assert times[0] == 0.0
    assert times[-1] == 500.0
    assert (np.diff(most) <= 0.0).all()
    assert above[-1] < above[0] / 4.0


def test_a_flight_from_outside_is_covered_once_it_is_in_the_set():
    flight = proved()
    claim = flight.certificates[0].claim("pointing")
    (((begin, end),),) = flight.covered
    assert 0.0 < begin < end == 80.0
    assert covered_text(flight, 0) == f"it covers this flight from {begin:g} s on"
    assert any(one.time == 0.0 for one in flight.left(0, "pointing"))
    ((times, most),) = funnel(flight)
    run = flight.recording
    later = run["time"] >= begin
    angle = error_angle(run["attitude_error"])[later]
    assert (angle <= most[np.searchsorted(times, run["time"][later], side="right") - 1]).all()
    assert times[0] == pytest.approx(begin)
    assert error_angle(run["attitude_error"])[~later].max() > claim.numbers["slew_angle"]


def test_it_ends_where_the_loop_changes():
    fault = {"time": 40.0, "inertia": [2.2, 3.0, 4.0], "action": "none"}
    flight = proved(initial={"attitude": [1.0, 0.05, 0.0, -0.03]}, fault=[fault])
    assert flight.covered == (((0.0, 40.0),),)
    assert [times[-1] for times, _ in funnel(flight)] == [40.0]


def test_without_a_proof_there_is_none():
    flight = proved(certify={})
    bare = short(duration=4.0)
    loop = build(bare, bare.laws[0])
    unsought = prove(bare, bare.laws[0], loop, fly_law(bare, bare.laws[0], loop))
    assert unsought.covered == ((),)
    assert [*funnel(unsought)] == []
    assert len(flight.covered) == 1
