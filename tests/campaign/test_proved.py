"""Brackets by the claim about the loop as it flies: which flights have its premises, and what bounds them from then on."""

import math
from dataclasses import replace

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.quaternion import relative
from starhold.analysis.departure import shown_at, value_of
from starhold.analysis.premise_notes import PREMISES
from starhold.analysis.rigid_body import error_angle
from starhold.campaign import proved
from starhold.campaign.campaign import with_campaign
from starhold.campaign.job import Job, Source, scenario_of
from starhold.campaign.results import ByClaim, Within
from starhold.certification.certificate import STEADY, UNTIL, Claim
from starhold.cli.arguments import INTERNAL_ERROR
from starhold.parts.craft import tensor
from starhold.scenario.building import build
from starhold.simulation.lanes import ThreadPool
from starhold.studies.body import study_of
from starhold.studies.compare import record
from tests.campaign.flown import fly, normal, short, uniform
from tests.running import starhold
from tests.tiers import drawn

NOISY = {"rate_noise": 1e-5, "attitude_noise": 1e-5}
ANYWHERE = {"initial.attitude": {"distribution": "rotations"}, "initial.rate": {"distribution": "shell", "high": "8 deg/s"}}


def steady(**changes):
    """A loop of which a claim is proved, whose flights come near its target well before they end."""
    return short(duration=80.0, environment={}, certify={"disturbance": 1e-4}, **({"sensor": NOISY} | changes))


def flown(over=ANYWHERE, runs=40, **options):
    scenario = options.pop("scenario", None) or steady()
    return fly(scenario=scenario, over=over, requirement=[], runs=runs, proof=True, **options)


def told_otherwise(monkeypatch, **numbers):
    """Claims have other numbers than those that are proved."""
    begun = proved._subjects

    def false(job, law):
        subjects, lacking = begun(job, law)
        others = [{name: number(one.claim.numbers) for name, number in numbers.items()} for one in subjects]
        return [
            one._replace(claim=replace(one.claim, numbers=one.claim.numbers | other))
            for one, other in zip(subjects, others, strict=True)
        ], lacking

    monkeypatch.setattr(proved, "_subjects", false)


def own_runs(found, count):
    """The loop and the recording of every control step of the first runs of a campaign, and their rows."""
    frame = found.frame()
    for run in range(count):
        scenario = found.again(run).scenario.with_({"simulation.record_every": 1})
        loop = build(scenario, scenario.laws[0])
        yield loop, record(scenario, loop), frame.iloc[run]


def test_flights_are_covered_from_when_they_are_in_the_claims_set():
    """Of some runs this is read from recordings, with V of the start by itself."""
    found = flown(runs=12)
    (claim,) = found.laws[0].claims
    scenario = steady()
    (issued,) = study_of(scenario.body).certify(scenario, scenario.laws[0], build(scenario, scenario.laws[0]), pointing=True)
    stated = issued.certificate.claim("pointing")
    covered, worst = 0, 0.0
    for loop, recording, row in own_runs(found, 12):
        angle, rate = error_angle(recording["attitude_error"]), np.linalg.norm(recording["rate_error"], axis=1)
        quiet = loop.without("sensor")
        first = value_of(stated.programs, quiet, shown_at(quiet, loop.start)) <= stated.numbers["start"]
        inside = (angle <= stated.numbers["slew_angle"]) & (rate <= stated.numbers["rate_start"])
        inside &= recording["attitude_error"][:, 0] > 0.0
        # Windows of time end later than the instant at which a flight comes in, and are the sooner all within.
        assert bool(first or inside.any())
        covered += 1
        worst = max(worst, row["final_attitude_error"])
    assert (claim.runs, claim.covered, claim.left) == (12, covered, {})
    angle = claim.within[0]
    assert angle.metric == "final_attitude_error"
    assert 0.0 < angle.flown <= worst
    assert angle.beyond == 0
    assert not found.contradicted
    assert "spans of 3600.2 s" in claim.text
    assert claim.share == pytest.approx(0.9973)


@pytest.mark.slow
def test_the_bound_is_that_of_the_funnel_at_the_last_quarter():
    """This claim settles after the flight; what it says of 60 s is weaker, and holds of flights covered from the start."""
    near = steady(initial={"attitude": [1.0, 0.05, 0.0, -0.03]})
    claim = flown({"initial.rate": {"distribution": "shell", "high": "1 deg/s"}}, scenario=near).laws[0].claims[0]
    (issued,) = study_of(near.body).certify(near, near.laws[0], build(near, near.laws[0]), pointing=True)
    stated = issued.certificate.claim("pointing")
    assert stated.numbers["settling"] > 80.0
    assert {one.metric for one in claim.within} == {"final_attitude_error", "peak_torque_norm"}
    assert claim.within[0].proved == stated.angle_from(60.0) > stated.numbers["angle"]
    assert claim.within[1].proved == pytest.approx(0.3 * math.sqrt(3.0))


@pytest.mark.slow
def test_what_differs_from_the_claims_loop_is_not_covered():
    found = flown({"spacecraft.inertia": normal("3 %", relative=True)}, runs=3)
    assert found.laws[0].claims[0].left == {proved.OTHER: 3}
    assert found.laws[0].claims[0].within == ()
    # The claim is against the part's torque and as much again, as [certify] asks.
    torque = uniform(0.0, 4e-4)
    scenario = steady(part=[{"type": "constant-torque", "torque": [1e-4, 0.0, 0.0]}])
    weak = flown({"part[1].torque[1]": torque}, runs=8, scenario=scenario)
    less = int((weak.frame()["part[1].torque[1]"] <= 2e-4).sum())
    assert 0 < less < 8
    assert weak.laws[0].claims[0].covered == less


@pytest.mark.slow
def test_a_part_whose_numbers_have_no_bound_any_more_makes_another_loop():
    """The errors of a gyro are bounded without an error of its scale factor, and the claim is about those."""
    gyro = {"type": "gyro", "bias": [1e-5, 0.0, 0.0]}
    found = flown({"part.gyro.scale_error": uniform(-0.2, 0.2)}, scenario=steady(sensor={}, part=[gyro]), runs=3)
    assert found.laws[0].claims[0].left == {proved.OTHER: 3}


def test_it_is_said_why_nothing_is_proved():
    faulty = steady(fault=[{"time": 40.0, "inertia": [2.1, 3.0, 4.0], "action": "none"}])
    assert "what changes at 40 s" in flown(runs=2, scenario=faulty).laws[0].claims[0].text


def test_a_share_of_flights_may_be_beyond_and_more_may_not():
    one = Within("final_attitude_error", "rad", 1.0, 0.5, 1000, 1)
    claim = ByClaim("", "", 1000, {}, 0.9973, 0, (one,))
    assert not claim.contradicted
    assert replace(claim, share=None).contradicted
    assert replace(claim, within=(replace(one, beyond=30),)).contradicted
    assert replace(claim, misled=30).contradicted
    assert not replace(claim, misled=5).contradicted
    assert not replace(claim, share=None, within=(replace(one, beyond=0),)).contradicted


def test_a_false_claim_is_contradicted(tmp_path, monkeypatch):
    told_otherwise(monkeypatch, funnel=lambda n: [(time, angle / 1e4) for time, angle in n["funnel"]])
    found = flown({"initial.rate": ANYWHERE["initial.rate"]})
    assert found.contradicted
    assert found.laws[0].claims[0].within[0].beyond == found.laws[0].claims[0].within[0].covered > 0
    scenario = with_campaign(steady(), {"over": {"initial.rate": ANYWHERE["initial.rate"]}, "runs": 6})
    (tmp_path / "s.toml").write_text(scenario.text)
    told = starhold("campaign", "s.toml", "-o", "d", "--threads", "1", "--proof", cwd=tmp_path)
    assert told.returncode == INTERNAL_ERROR
    assert "error in starhold" in " ".join(told.stdout.split())
    assert "Proved of the loop as it flies" in (tmp_path / "d" / "report.html").read_text()


@pytest.mark.slow
def test_more_wrongly_told_than_assumed_is_counted(monkeypatch):
    told_otherwise(monkeypatch, attitude_error=lambda n: n["attitude_error"] / 1.6)
    over = {"initial.rate": ANYWHERE["initial.rate"]}
    assert flown(over, runs=4).laws[0].claims[0].misled is None
    told = [{"type": "gyro", "noise": 1e-5}, {"type": "star-tracker", "cross": 2e-5, "roll": 2e-5, "interval": 0.2}]
    claim = flown(over, scenario=steady(part=told).with_({"sensor": None})).laws[0].claims[0]
    assert 0 < claim.misled < claim.covered


def test_results_are_the_same_with_a_proof():
    plain = fly(scenario=steady(), over=ANYWHERE, requirement=[], runs=6)
    assert plain.laws[0].claims == ()
    assert plain.digest == flown(runs=6).digest


def test_the_notes_on_premises_are_what_recordings_show():
    """With an estimator, whose errors are those that the law is told, and with wheels."""
    nadir = sh.load("cubesat-nadir").with_({"simulation.duration": 20.0, "fault": None, "requirement": None})
    scenario = with_campaign(nadir, {"runs": 2, "over": {"initial.rate[1]": uniform(-0.01, 0.01)}})
    seen = []
    job = Job(Source.of(scenario), scenario.table.campaign, extras=(PREMISES,))
    with ThreadPool(1) as pool:
        job.measure("wheel", job.plan.columns(0, 2), np.arange(2), pool, lambda *given: seen.append(given))()
    ((_, windows, lot),), meter = seen, job.meter("wheel")
    assert lot.runs.tolist() == [0, 1]
    for run in range(2):
        own = scenario_of(job, job.plan.columns(run, 1), run).with_({"simulation.record_every": 1})
        loop = build(own, own.pick("wheel"))
        seen = record(own, loop)
        attitude, told = (tuple(seen[name].T) for name in ("attitude", "mekf_attitude"))
        rotors = seen["wheel_momentum"]
        total = seen["rate"] @ np.array(tensor(loop.craft.inertia)).T + rotors @ np.array(loop.wheels.axes)
        expected = {
            "told_attitude": error_angle(np.transpose(relative(attitude, told))),
            "told_rate": np.linalg.norm(seen["mekf_rate"] - seen["rate"], axis=1),
            "momentum": np.linalg.norm(total, axis=1),
            "wheel_momentum": np.abs(rotors).max(axis=1),
            "other_quaternion": np.maximum(-seen["attitude_error"][:, 0], 0.0),
            "late_torque": np.linalg.norm(seen["torque"] - seen["command"], axis=1),
        }
        begin, ends = 0, [*meter.cuts()[:-1], len(seen["time"])]
        for number, end in enumerate(ends):
            for row, (name, window) in enumerate(meter.windows.items()):
                if name in expected:
                    value = window.value(windows[number, row, run])
                    assert value == pytest.approx(expected[name][begin:end].max(), rel=1e-9, abs=1e-14), name
            begin = end


def test_a_claim_about_motions_between_jumps_bounds_no_flight(monkeypatch):
    """Nor one about less time than a flight lasts."""
    begun = Claim.limited_to
    monkeypatch.setattr(Claim, "limited_to", lambda claim, until: begun(replace(claim, assumptions=(STEADY,)), until))
    assert flown(runs=2).laws[0].claims[0].text == "the claim holds only if the target does not jump"
    monkeypatch.setattr(Claim, "limited_to", lambda claim, until: begun(replace(claim, assumptions=(f"{UNTIL}79",)), until))
    assert flown(runs=2).laws[0].claims[0].text == "the claim holds only if the flight lasts 79 s at most"


WIDE = {
    "initial.angles": uniform(["-60 deg"] * 3, ["60 deg"] * 3),
    "initial.rate": {"distribution": "shell", "high": "3 deg/s"},
}
SLOW = WIDE | {"initial.rate": {"distribution": "shell", "high": "0.6 deg/s"}}
ATTACKED = {
    "three-laws lyapunov": (None, {}, 3000),
    "wheels-orbital wheel": (WIDE, {"certify.momentum": 0.2}, 1500),
    "wheels-orbital uncompensated": (SLOW, {"certify.momentum": 0.1, "simulation.duration": 4000}, 1500),
    "cubesat-nadir lyapunov": (WIDE, {"fault": None, "certify.momentum": 0.006}, 1500),
    "cubesat-nadir wheel": (WIDE, {}, 1500),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", drawn(ATTACKED, 2))
def test_no_more_flights_than_the_share_are_beyond_what_is_proved(name):
    """From inside and outside of the claims' sets, before faults and after."""
    (scenario, law), (over, changes, runs) = name.split(), ATTACKED[name]
    attacked = sh.load(scenario).with_({"requirement": None} | changes)
    found = sh.campaign(attacked, runs=runs, over=over, law=law, search=False, proof=True)
    (claim,) = found.laws[0].claims
    assert claim.covered > runs / 10
    assert not found.contradicted
    assert [one.beyond for one in claim.within] == [0] * len(claim.within)
    assert len(claim.within) >= 2
    assert not claim.misled


def test_flights_that_begin_with_a_torque_further_from_the_command_than_a_lag_may_be_are_covered_later(monkeypatch):
    """Within the set of V there are larger commands than that of the start, and the torque begins with none."""
    lag = {"spacecraft": {"inertia": [2.0, 3.0, 4.0], "torque_limit": 3.0, "actuator_lag": 0.1}, "sensor": {}}
    scenario = steady(**lag).with_({"simulation.substeps": 8, "initial.attitude": [1.0, 0.02, 0.0, 0.0]})
    faster = {"initial.rate": {"distribution": "shell", "low": "5 deg/s", "high": "17 deg/s"}}
    looked, look = [], proved._look
    monkeypatch.setattr(proved, "_look", lambda *given: looked.append((given, look(*given))) or looked[-1][1])
    found = flown(scenario=scenario, over=faster, runs=12)
    ((about, _, _, _, _, lot, _), seen) = looked[0]
    assert proved._starts_inside(about, lot).all()
    first = [np.linalg.norm(run["torque"][0] - run["command"][0]) for _, run, _ in own_runs(found, 12)]
    further = np.array(first) > about.claim.numbers["late_torque"]
    assert 0 < further.sum() < 12
    assert (seen.begun[further] > 0).all()
    assert (seen.begun[~further] == 0).all()
