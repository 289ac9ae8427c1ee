"""Brackets by the claims about single modes: each is about the flights that end in its mode, from when that began, and with
the loop that is left after a fault that the law knows of."""

import numpy as np
import pytest

import starhold as sh
from starhold.analysis.rigid_body import error_angle
from starhold.campaign import proved
from starhold.report.attitude_plots import funnel
from starhold.report.text import covered_text
from starhold.scenario.building import build
from starhold.studies.bodies.rigid_body import STUDY
from starhold.studies.compare import fly_law, prove, record
from tests.campaign.flown import fly, short

LAW = {"type": "lyapunov", "k_rate": 1.6, "k_attitude": 0.7}
FIRST = LAW | {"name": "first", "k_attitude": 0.12, "until": {"after": "10 s", "angle_below": "15 deg"}}
MODES = {"type": "modes", "name": "flown", "quaternion_sign": "shortest", "mode": [FIRST, LAW | {"name": "second"}]}
TURNED = {"initial.attitude": {"distribution": "rotations"}, "initial.rate": {"distribution": "shell", "high": "8 deg/s"}}


def mission(**changes):
    """Two modes with one law each; the second one begins once the first one is near the target."""
    settings = {"sensor": {"rate_noise": 1e-5, "attitude_noise": 1e-5}, "environment": {}, "certify": {"disturbance": 1e-4}}
    return short(duration=60.0, **({"laws": [MODES]} | settings | changes))


def flown(scenario, runs=24, over=TURNED):
    return fly(scenario=scenario, over=over, requirement=[], runs=runs, proof=True)


def test_each_claim_is_about_the_flights_that_end_in_its_mode():
    """As recordings of their flights show."""
    found = flown(mission())
    claims = {one.about.partition(": ")[2]: one for one in found.laws[0].claims}
    modes, worst = [], list[float]()
    for run in range(24):
        scenario = found.again(run).scenario.with_({"simulation.record_every": 1})
        seen = record(scenario, build(scenario, scenario.laws[0]))
        modes.append(int(seen["mode"][-1]))
        if modes[-1] == 1:
            worst.append(error_angle(seen["attitude_error"])[seen["time"] >= 45.0].max())
    assert 4 < modes.count(1) < 20
    for place, name in enumerate(("first", "second"), 1):
        assert claims[name].left[proved.ELSEWHERE] == 24 - modes.count(place)
        assert 0 < claims[name].covered <= modes.count(place)
    angle = claims["first"].within[0]
    assert angle.metric == "final_attitude_error"
    # Not all flights are in the set of the claim from then on.
    assert 0.0 < angle.flown <= max(worst) * (1.0 + 1e-3)
    assert min(abs(angle.flown - x) for x in worst) < 1e-3 * angle.flown
    assert angle.beyond == 0
    assert not found.contradicted


def test_flights_are_compared_with_the_claim_of_their_last_mode_from_when_it_began(monkeypatch):
    """Were the claim about each mode that of the other one, flights would come before the mode begins that it is about."""
    seen, judged = [], proved._judged
    monkeypatch.setattr(proved, "_judged", lambda subjects, looked: seen.extend(looked) or judged(subjects, looked))
    found = flown(mission(), runs=8)
    first, second = (each[0] for each in seen)
    assert (first.there == ~second.there).all()
    for run in np.flatnonzero(second.there).tolist():
        scenario = found.again(run).scenario.with_({"simulation.record_every": 1})
        recording = record(scenario, build(scenario, scenario.laws[0]))
        begun = len(recording["time"]) - 1 - round(recording["time_in_mode"][-1] / 0.2)
        assert second.begun[run] == -1 or second.begun[run] >= begun
    assert (second.begun >= 0).any()


@pytest.mark.slow
def test_a_fault_that_the_law_knows_of_begins_other_claims():
    fault = {"time": 30.0, "inertia": [2.1, 3.0, 4.0], "action": "reallocate"}
    scenario = mission(fault=[fault], initial={"attitude": [1.0, 0.05, 0.0, -0.03]})
    entry = scenario.laws[0]
    loop = build(scenario, entry)
    flight = prove(scenario, entry, loop, fly_law(scenario, entry, loop), pointing=True)
    names = [one.name for one in flight.certificates]
    before, after = (names.index(f"flown{when}: second") for when in ("", " from 30 s"))
    (((begin, fault),), ((then, end),)) = (flight.covered[place] for place in (before, after))
    assert 10.0 <= begin < fault == then == 30.0 < end == 60.0
    assert "to 30 s" in covered_text(flight, before)
    assert covered_text(flight, after) == "it covers this flight from 30 s on"
    assert [one.time for one in flight.left(before, "pointing")][:2] == [30.0]
    assert flight.left(after, "pointing") == ()
    run = flight.recording
    angle = error_angle(run["attitude_error"])
    drawn = [*funnel(flight)]
    for times, most in drawn:
        there = (run["time"] >= times[0]) & (run["time"] < times[-1])
        assert (angle[there] <= most[np.searchsorted(times, run["time"][there], side="right") - 1]).all()
    assert len(drawn) >= 2
    # Of what does not fly in it, a certificate says so.
    never = flight.left(names.index("flown from 30 s: first"), "pointing")
    assert [one.how for one in never] == ["this flight has no such mode while it has the loop of the claim"]
    assert not any(STUDY.start_inside(one) for one in STUDY.certify(scenario, entry, loop) if one.step)


SURVEY = {"certify.momentum": 0.004, "fault": [{"time": "80 min", "wheel": 2, "lost": True, "action": "reallocate"}]}
ATTACKED = {
    "as it is": ({}, "12 deg/s", "nadir", 2000),
    # It ends with three wheels.
    "a lost wheel": (SURVEY | {"initial.rate": [0.0, 0.0, 0.0]}, "1 deg/s", "from 4800 s: nadir", 600),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ATTACKED)
def test_no_flight_of_the_mission_is_beyond_what_is_proved_of_its_modes(name):
    changes, fastest, last, runs = ATTACKED[name]
    over = {"initial.attitude": {"distribution": "rotations"}, "initial.rate": {"distribution": "shell", "high": fastest}}
    scenario = sh.load("cubesat-mission").with_({"requirement": None} | changes)
    found = sh.campaign(scenario, runs=runs, over=over, search=False, proof=True)
    claims = found.laws[0].claims
    assert not found.contradicted
    assert {metric.beyond for one in claims for metric in one.within} == {0}
    assert any(one.about.endswith(last) and one.covered > runs / 2 for one in claims)
