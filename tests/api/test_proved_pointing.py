"""What is proved of the pointing beside budgets and losses of wheels, held against flights and against other claims."""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import starhold as sh
from starhold.report.attitude_plots import collect
from starhold.report.commands.failures import present
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.studies.budget import TOGETHER
from starhold.studies.certificates import certify_scenario
from starhold.studies.failures import _flown, _left
from starhold.studies.pointing import ProvedPointing, prove_pointing
from tests.running import starhold
from tests.tiers import fewer

HELD = {
    "name": "held",
    "spacecraft": {"inertia": [0.13, 0.10, 0.05], "torque_limit": "2 mN m"},
    "orbit": {"position": ["6878 km", 0, 0], "velocity": [0, "-1.017 km/s", "7.544 km/s"]},
    "initial": {"angles": ["10 deg", 0, 0]},
    "environment": {"gravity_gradient": True},
    "sensor": {"attitude_noise": "8 arcsec", "rate_noise": "0.001 deg/s"},
    "simulation": {"duration": 1000.0, "control_period": 0.25},
    "budget": {"start": 900.0, "window": 10.0, "separation": 30.0, "runs": 4, "confidence": 1.0},
    "law": [{"type": "lyapunov", "k_rate": 0.02, "k_attitude": 0.004, "quaternion_sign": "shortest"}],
}
PUSH = {"type": "constant-torque", "torque": ["1e-7 N m", 0, 0]}
DESIGNED = {"torque": "20 mN m", "momentum": "0.4 N m s", "angle": "40 deg", "rate": "0.3 deg/s"}
WHEELED = {
    "name": "wheeled",
    "spacecraft": {"inertia": [6.0, 8.0, 5.0]},
    "orbit": HELD["orbit"],
    "initial": {"relative_to": "target", "angles": ["8 deg", 0, 0]},
    "target": {"mode": "orbital"},
    "environment": {"gravity_gradient": True},
    "wheels": {"layout": "pyramid", "inertia": 1e-3, "torque_limit": "20 mN m", "momentum_limit": "0.4 N m s"},
    "simulation": {"duration": 60.0, "control_period": 0.5},
    "law": [{"type": "wheel", "form": "degree-of-stability", **DESIGNED}],
}
SWITCHES = {"gravity gradient": ("environment.gravity_gradient", False), "rate noise": ("sensor.rate_noise", 0.0)}


@pytest.fixture(scope="module")
def held():
    return sh.budget(sh.scenario(HELD), proof=True)


def loop_of(scenario):
    return build(scenario, scenario.pick(None))


def proved_of(scenario):
    return prove_pointing(scenario, loop_of(scenario))


@pytest.mark.slow
def test_flights_from_the_set_of_an_even_v_begin_on_the_side_of_the_target():
    """On the other side the same V may increase: there motions turn the long way round a half turn."""
    (tried,) = certify_scenario(load("wheels-orbital"), "uncompensated")
    (claim,) = (claim for claim in tried.certificate.claims if claim.kind == "pointing")
    assert claim.outcome == "proved"
    assert tried.trial.highest_share <= 1.0 + 1e-6


@pytest.mark.slow
def test_no_flight_of_the_budget_exceeds_what_is_proved(held):
    """All instants of all runs, for the confidence is 1; they begin in the set of the claim, and late enough."""
    assert held.proof.starts_inside
    assert held.proof.settling <= HELD["budget"]["start"]
    flown = held.level(TOGETHER, "APE")
    assert 0.02 * held.proof.angle < flown < held.proof.angle
    assert held.proof.share == pytest.approx(0.9973)


@pytest.mark.slow
def test_shares_are_what_the_bound_without_each_source_lacks(held):
    assert set(held.proof.shares) == {"gravity gradient", "attitude noise", "rate noise"}
    assert all(share > 0.0 for share in held.proof.shares.values())
    assert sum(held.proof.shares.values()) < 1.05 * held.proof.angle
    for name, (key, none) in [*SWITCHES.items()][: fewer(2)]:
        other = proved_of(sh.scenario(HELD).with_({key: none}))
        assert held.proof.angle - held.proof.shares[name] == pytest.approx(other.angle, rel=0.05)


@pytest.mark.slow
def test_a_random_torque_is_in_the_claim_with_its_share():
    scenario = sh.scenario(HELD | {"environment": {"torque_noise": 1e-7}, "part": [PUSH]})
    without = {"push": {"part.constant-torque": None}, "noise": {"environment.torque_noise": 0.0}}
    others = {name: partial(loop_of, scenario.with_(changes)) for name, changes in without.items()}
    proof = prove_pointing(scenario, loop_of(scenario), others)
    assert proof.left_out == ()
    assert min(proof.shares.values()) > 0.0


def test_what_is_not_proved_is_told_with_the_reason():
    switching = sh.load("cubesat-mission")
    assert "single modes" in proved_of(switching).sentence
    unstable = sh.scenario(HELD | {"law": [HELD["law"][0] | {"k_rate": 1e-6}]}, allow_unstable=True)
    assert proved_of(unstable).angle is None


@pytest.mark.slow
def test_a_loss_of_a_wheel_is_flown_within_what_is_proved_after_it():
    """From the start of the file, which lies in the set, until long after the settling."""
    scenario = sh.scenario(WHEELED)
    left = _left(wheels_of(scenario), (1,), 1.0)
    failure = _flown(scenario, scenario.pick(None), replace(left, proof=ProvedPointing(""), eta_intact=0.05))
    assert failure.proof.starts_inside
    fault = {"time": 0.0, "wheel": 1, "lost": True, "action": "both"}
    run = sh.simulate(scenario.with_({"fault": [fault], "simulation.duration": 3000.0}))
    angle = np.squeeze(run["error_angle"].to_numpy())[run["time"].to_numpy() > failure.proof.settling]
    assert len(angle) > 100
    assert 0.0 < angle.max() < failure.proof.angle
    shown = present(scenario, scenario.pick(None), [failure])
    assert f"lost 1: {failure.proof.sentence}" in shown.blocks
    assert dict(zip(shown.numbers.heads(), shown.numbers.rows[0], strict=True))["proved angle (rad)"] == failure.proof.angle
    assert "proved within, °" in [axis.get_xlabel() for axis in shown.figure().axes]


def plotted(**initial):
    """The error angle of a flight (deg) with its times (s), and what its plot has of a bound."""
    changes = {"initial": initial, "certify.disturbance": 1e-9, "simulation.duration": 300.0}
    scenario = sh.scenario(HELD).with_(changes)
    flights = sh.compare(scenario)
    panel = collect(flights, 10_000, scenario).angle.panels[0]
    return flights[0].recording["time"], panel.curves[0], panel.bounds


@pytest.mark.slow
def test_the_page_draws_the_bound_above_a_flight_from_when_it_is_in_the_set():
    times, flown, ((number, since, most),) = plotted(angles=["10 deg", 0, 0])
    bound = most[np.searchsorted(since, times, side="right") - 1]
    assert number == 0
    assert since[0] == 0.0
    assert np.count_nonzero(since < 300.0) > 3
    assert (flown <= bound).all()
    # One that begins outside has it from when it is in the set.
    ((_, since, _),) = plotted(angles=["179 deg", 0, 0])[2]
    assert since[0] > 0.0


@pytest.mark.slow
def test_the_command_tells_the_proof_only_where_it_is_asked_for(held, tmp_path):
    path = tmp_path / "held.toml"
    path.write_text(sh.scenario(HELD).text)
    plain, proved = (
        starhold("budget", path, *more, "-o", name, cwd=tmp_path, code=0)
        for name, more in (("plain", ()), ("proved", ("--proof",)))
    )
    assert "proved" not in plain.stdout.lower()
    assert "proof" not in json.loads((tmp_path / "plain" / "summary.json").read_text())["laws"]["lyapunov"]
    told = " ".join(proved.stdout.split())
    assert held.proof.sentence in told
    assert "no part is left out" in told
    assert f"{math.degrees(held.proof.angle) * 3600.0:.4g}" in told


@pytest.mark.slow
def test_a_loop_with_appendages_is_first_proved_with_them():
    """Which leaves out nothing, and begins nearer; what is proved of the rigid body is told beside it."""
    scenario = load("flexible-slew")
    proof = prove_pointing(scenario, build(scenario, scenario.pick("stiff")))
    assert proof.left_out == ()
    assert proof.angle == pytest.approx(math.radians(0.0002538), rel=0.01)
    first, other = proof.sentence.split(" Also proved: ")
    assert "with states of the appendages" in first
    assert "; no part is left out" in first
    assert other.startswith("without the effector hinged-panels, ")
