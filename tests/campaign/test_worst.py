"""The search for the worst, and brackets: flown <= searched <= proved of one and the same quantity."""

import contextlib
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import starhold as sh
from starhold.campaign import worst
from starhold.campaign.campaign import begin, with_campaign
from starhold.cli.arguments import INTERNAL_ERROR
from starhold.errors import InputError
from starhold.parts.catalogue import parts
from starhold.parts.part import Fitted
from starhold.scenario.building import build
from starhold.scenario.writing import part_table
from starhold.simulation.lanes import ThreadPool
from starhold.studies.compare import record
from tests.campaign.flown import fly, normal, short, uniform
from tests.certification.hunt import random_inertia
from tests.missions import BASE, DETUMBLE, POINT
from tests.running import starhold

RATE = {"initial.rate": {"distribution": "shell", "high": "2 deg/s"}}
LIMITED = uniform(0.1, 0.2)
PEAK = {"metric": "peak_torque", "at_most": 1, "share": 0.5}


def job_of(scenario, over, metric="effort", **changes):
    asked = [{"metric": metric, "at_most": 1, "share": 0.5} | changes]
    name = scenario.laws[0].name
    job = begin(with_campaign(scenario, {"over": over, "requirement": asked, "runs": 16}), [name])
    return job, name, job.requirements(name)[0]


def proved(scenario, over=RATE, metric="peak_torque"):
    return worst.proved_of(*job_of(scenario, over, metric))[0]


def test_the_torque_is_bounded_by_the_limit_that_acts_on_the_body():
    assert proved(short()) == 0.3
    assert proved(short(), metric="peak_torque_norm") == pytest.approx(0.3 * math.sqrt(3.0))
    norm = short().with_({"spacecraft.limit": "norm"})
    assert proved(norm) == proved(norm, metric="peak_torque_norm") == 0.3
    assert proved(short().with_({"spacecraft.actuator_lag": 0.5, "spacecraft.torque_rate_limit": 0.2})) == 0.3
    assert proved(short().with_({"spacecraft.limit": "none"})) is None
    for key, drawn in (
        ("spacecraft.torque_limit", LIMITED),
        ("spacecraft.limit", {"distribution": "choice", "values": ["axis", "none"]}),
    ):
        assert proved(short(), {key: drawn}) is None


def test_nothing_is_proved_of_what_effectors_make_of_a_command():
    acting = [part for part in parts("effector").values() if part.flag("ACTS")]
    assert len(acting) > 3
    loop = job_of(short(), RATE)[0].lanes("pd").base.loop
    assert not loop.used("effector")
    for part in acting:
        job, *asked = job_of(short(), RATE, "peak_torque")
        lanes = job.lanes("pd")
        lanes.base = replace(lanes.base, loop=replace(loop, parts=(*loop.parts, Fitted(part, part.examples()[0]))))
        assert worst.proved_of(job, *asked) == (None, "")


@pytest.mark.slow
def test_claims_about_motions_in_the_end_bound_no_flight():
    """Such a claim is proved of this loop, and some of its flights are far from their end."""
    tables = tomllib.loads(BASE + DETUMBLE + POINT)
    slow = short(certify={"disturbance": 1e-4}, sensor={}, environment={})
    claims = sh.certify(slow)[0].claims
    assert any(claim.kind == "pointing" and claim.outcome == "proved" for claim in claims)
    for metric in ("final_attitude_error", "final_rate_error"):
        for scenario in (slow, sh.scenario(tables)):
            assert proved(scenario, metric=metric) is None


def test_a_flight_beyond_what_is_proved_is_told_as_a_fault_of_starhold(tmp_path, monkeypatch, brief):
    monkeypatch.setattr(worst, "proved_of", lambda *_: (1e-9, "a wrong theorem"))
    found = fly(tmp_path / "c", scenario=short(), over=RATE, requirement=[PEAK], runs=4, search=True)
    assert found.contradicted
    assert found.laws[0].brackets[0].assumption == "a wrong theorem"
    (tmp_path / "s.toml").write_text(with_campaign(short(), {"over": RATE, "requirement": [PEAK], "runs": 4}).text)
    told = starhold("campaign", "s.toml", "-o", "d", "--threads", "1", cwd=tmp_path)
    assert told.returncode == INTERNAL_ERROR
    assert "error in starhold" in " ".join(told.stdout.split())
    assert "error in starhold" in (tmp_path / "d" / "report.html").read_text()


def test_the_search_tells_how_many_of_its_flights_are_done(brief):
    """Of flights that are refused too, and of a search that ends early, all are counted in the end."""
    over = {"spacecraft.inertia": normal("9 %", relative=True), "sensor.rate_noise": normal(4e-5)}
    job, name, asked = job_of(short(), over)
    heard = []
    found = worst.search(job, name, asked, 1, notice=lambda *given: heard.append(given))
    sought = worst.Sought(f"worst {asked.name}", 32 + 3 * 16)
    assert {(law, what) for law, _, what in heard} == {(name, sought)}
    assert sum(more for _, more, _ in heard) == sought.flights >= found.evaluations
    assert len(heard) > 4
    assert min(more for _, more, _ in heard) >= 0


def test_rounding_contradicts_nothing():
    one = worst.Bracket("peak_torque", "N m", 0.1 * (1 + 1e-15), "", 0, 0.1, "")
    assert not one.contradicted
    assert replace(one, flown=0.1001).contradicted
    assert replace(one, at_most=False, flown=0.0999).contradicted
    assert not replace(one, flown=math.nan).contradicted


def test_what_cannot_be_is_worst_in_no_sense(tmp_path, brief):
    """Within three sigma lie inertias that no body has, and noises below nothing; the few runs draw none of them."""
    over = {"spacecraft.inertia": normal("9 %", relative=True), "sensor.rate_noise": normal(4e-5)}
    for _ in range(2):
        asked = [{"metric": "effort", "at_most": 9, "share": 0.5}]
        found = fly(tmp_path / "c", scenario=short(), over=over, requirement=asked, runs=6, search=True, resume=True)
    (bracket,) = found.laws[0].brackets
    own = sh.load(found.folder / bracket.file)
    moments = np.sort(np.diagonal(own.table.spacecraft.inertia))
    assert moments[2] <= moments[0] + moments[1]
    assert 0 < bracket.evaluations < 32 + 3 * 16


def test_what_only_reading_refuses_is_left_out_too(brief):
    """Each lane is made by itself, and one starts in the ground."""
    orbit = {"position": ["6600 km", 0, 0], "velocity": [0, "7.8 km/s", 0], "radius": "6378 km"}
    over = {"orbit.position[1]": uniform("6500 km", "6700 km")}
    job, name, _ = job_of(short(orbit=orbit, environment={"gravity_gradient": True}), over)
    columns = {"orbit.position[1]": np.array([6.6e6, 6.3e6, 6.65e6])}
    refused = np.zeros(3, dtype=bool)
    with ThreadPool(1) as pool:
        found = job.measure(name, columns, np.zeros(3, dtype=np.int64), pool, refused=refused)()
    assert refused.tolist() == [False, True, False]
    assert np.isnan(found["effort"]).tolist() == refused.tolist()


@pytest.mark.slow
def test_the_search_finds_worse_than_many_flights_at_random():
    """The worst of it and of twenty thousand random flights of the same box."""
    over = {"initial.attitude": {"distribution": "rotations"}, "initial.rate": {"distribution": "shell", "high": "4 deg/s"}}
    job, name, asked = job_of(short(sensor={}, environment={}), over)
    found = [worst.search(job, name, asked, 1, seed=seed) for seed in (0, 1)]
    low, high = np.array(worst.box(job)).T
    unit = np.random.default_rng(5).uniform(low, high, (20_000, len(low))).T
    with ThreadPool(1) as pool:
        others = job.measure(name, job.plan.values(unit), np.zeros(20_000, dtype=np.int64), pool)()["effort"]
    assert found[0].value == pytest.approx(found[1].value, rel=2e-3)
    assert min(one.value for one in found) > others.max()


def random_mission(random):
    """The tables of a scenario with a campaign, all at random: any effector, modes, faults, limits below what disturbs."""

    def some(*choices):
        return choices[int(random.integers(len(choices)))]

    inertia = random_inertia(random, 10.0 ** random.uniform(-2, 2))
    scale = float(np.trace(inertia)) / 3.0
    effectors = parts("effector")
    name = some(*[None] * 8, "wheels", "both", *effectors)
    magnetic = name in ("magnetorquers", "magnetic-unloading", "both")
    craft = {"inertia": inertia.tolist(), "limit": some("axis", "norm", "axis", "axis", "none")}
    craft |= {"torque_limit": scale * 10.0 ** random.uniform(-4, -1)} if random.uniform() < 0.9 else {}
    lags = [{"actuator_lag": 0.3}, {"torque_rate_limit": 1e-2 * scale}, {"actuator_lag": 0.5, "torque_rate_limit": scale}]
    craft |= some({}, *lags) if name != "thrusters" and not magnetic else {}
    tables = {
        "name": "hunted",
        "spacecraft": craft,
        "initial": {"attitude": random.normal(size=4), "rate": 0.05 * random.normal(size=3)},
    }
    tables["initial"]["attitude"] /= np.linalg.norm(tables["initial"]["attitude"])
    tables["initial"]["relative_to"] = some("inertial", "target")
    period = some(0.1, 0.5, 2.0)
    tables["simulation"] = {
        "duration": 60 * period,
        "control_period": period,
        "substeps": 20,
        "seed": int(random.integers(99)),
    }
    if magnetic or random.uniform() < 0.3:
        tables["orbit"] = {"position": [7e6, 0, 0], "velocity": [0, 4e3, 6.4e3]}
        tables["target"] = {"mode": some("inertial", "orbital")}
    fitted = [] if name in (None, "wheels") else [effectors["magnetorquers" if name == "both" else name]]
    if name in ("wheels", "magnetic-unloading", "both"):
        tables["wheels"] = {"layout": some("orthogonal", "pyramid"), "inertia": 1e-6 * scale, "torque_limit": 1e-2 * scale}
        tables["wheels"] |= {"momentum_limit": scale, "viscous": some(0.0, 1e-4 * scale)}
    tables["part"] = [part_table(part, some(*part.examples())) for part in fitted]
    tables["part"] += [{"type": "magnetometer", "noise": 1e-9}] if magnetic else []
    if random.uniform() < 0.3:
        push = {
            "type": "constant-torque",
            "torque": (scale * 10.0 ** random.uniform(-5, -1) * random.normal(size=3)).tolist(),
        }
        tables["part"].append(push)
    if random.uniform() < 0.4:
        fault = {"time": 20 * period, "action": "none"}
        struck = {"wheel": 1, "lost": True} if "wheels" in tables else {"inertia": (1.3 * inertia).tolist()}
        tables["fault"] = [fault | struck]
    gains = {
        "k_rate": scale * random.uniform(0.05, 0.5) / period,
        "k_attitude": scale * random.uniform(0.01, 0.1) / period**2,
    }
    law = {"type": some("pd", "lyapunov"), **gains, "quaternion_sign": "shortest"}
    if name == "both" or random.uniform() < 0.3:
        modes = [
            law | {"name": "first", "until": {"after": 15 * period}},
            law | {"name": "then", "type": "pd", "k_rate": gains["k_rate"] / 2},
        ]
        if name == "both":
            modes[0]["effectors"], modes[1]["effectors"] = ["magnetorquers"], ["wheels"]
        law = {"type": "modes", "mode": [{k: v for k, v in mode.items() if k != "quaternion_sign"} for mode in modes]}
    tables["law"] = [law | {"name": "flown"}]
    small = uniform(0.97, 1.03, relative=True)
    drawn = {
        "initial.attitude": {"distribution": "rotations"},
        "initial.rate": {"distribution": "shell", "high": 0.1},
        "spacecraft.inertia": small | {"known_to_law": some(True, False), "together": True},
        "spacecraft.torque_limit": small,
        "spacecraft.limit": {"distribution": "choice", "values": ["axis", "norm", "none"]},
        "fault[1].time": uniform(5 * period, 40 * period),
        "law.flown.k_rate": small,
        "wheels.viscous": uniform(0.0, 1e-4 * scale),
    }
    absent = {"fault[1].time": "fault" not in tables, "wheels.viscous": "wheels" not in tables}
    absent |= {"law.flown.k_rate": "mode" in law, "spacecraft.torque_limit": "torque_limit" not in craft}
    possible = [key for key in drawn if not absent.get(key)]
    over = {key: drawn[key] for key in random.choice(possible, int(random.integers(1, 4)), replace=False)}
    metrics = ["peak_torque", "peak_torque_norm", some("final_attitude_error", "final_rate_error", "effort", "peak_rate")]
    asked = [{"metric": metric, some(*["at_most"] * 5, "at_least"): 1.0, "share": 0.5} for metric in metrics]
    return tables | {"campaign": {"runs": 12, "over": over}, "requirement": [one | {"method": "campaign"} for one in asked]}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(0, 60, 2))
def test_no_flight_of_random_campaigns_is_beyond_its_bracket(seed, tmp_path, brief):
    """Flown <= searched <= proved, and the file of the worst flies it, measured by a recording of every control step."""
    random, found = np.random.default_rng(seed), None
    while found is None:
        # Drawn again where a scenario cannot be.
        with contextlib.suppress(InputError):
            found = sh.campaign(sh.scenario(random_mission(random)), tmp_path / "c", threads=1, force=True)
    frame = found.frame()
    for bracket in found.laws[0].brackets:
        values, side = frame[bracket.metric].to_numpy(), 1.0 if bracket.at_most else -1.0
        assert math.isnan(bracket.flown) or not np.isnan(values).any()
        assert math.isnan(bracket.flown) or side * bracket.flown >= (side * values).max()
        assert not bracket.contradicted
        own = sh.load(found.folder / bracket.file).with_({"simulation.record_every": 1})
        recording = record(own, build(own, own.laws[0]))
        if "torque" in bracket.metric and not math.isnan(bracket.flown):
            torque = np.linalg.norm(recording["torque"], axis=1, ord=2 if "norm" in bracket.metric else np.inf).max()
            assert torque == pytest.approx(bracket.flown, rel=1e-12)
            assert bracket.proved is None or torque <= bracket.proved * (1.0 + 1e-12)
