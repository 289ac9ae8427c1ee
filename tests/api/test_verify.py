"""Requirements are decided by the methods that they name, each used once, and only what was shown is said to be met."""

import csv
import hashlib
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

import starhold as sh
from starhold.campaign import verify
from starhold.parts.catalogue import find
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation import lane
from starhold.studies import budget, compare, deciding
from starhold.studies.verification import verdicts_of_flight
from tests.making import built
from tests.missions import BASE, DETUMBLE, POINT
from tests.refusals import complains, refused
from tests.required import ALL, BETWEEN, ERROR, KEPT, MANY, OFF, PHASE, PROOF, SETTLES, STILL, TURN, turn
from tests.running import starhold
from tests.tiers import leading


def verdict(*required, **changes):
    """The verdict on the last of some requirements."""
    return sh.verify(turn(*required, **changes))[-1]


def test_numbers_of_a_flight_are_those_of_its_recording():
    run = sh.simulate(turn())
    time, turned = run["time"].to_numpy(), run["error_angle"].to_numpy()
    settles, still, off, between = sh.verify(turn(SETTLES, STILL, OFF, BETWEEN))
    rate = np.linalg.norm(run["rate_error"], axis=1)
    outside = (turned > np.radians(0.1)) | (rate > np.radians(0.01))
    assert settles.number == pytest.approx(time[np.flatnonzero(outside)[-1] + 1])
    assert still.number == pytest.approx(turned[time >= 300].max(), rel=1e-9)
    inside = (time >= 50) & (time <= 120)
    assert between.number == pytest.approx(np.linalg.norm(run["rate"], axis=1)[inside].max(), rel=1e-9)
    # The first column of the rotation matrix from body to inertial axes holds, in its last row, the cosine of z and X.
    q = run["attitude"].to_numpy().T
    cosine = 2.0 * (q[1] * q[3] + q[0] * q[2])
    assert off.number == pytest.approx(np.arccos(cosine).min(), rel=1e-6)
    assert [one.verdict for one in (settles, still, off, between)] == ["met"] * 4
    assert off.margin == pytest.approx(off.number - np.radians(1.0))
    assert still.margin == pytest.approx(np.radians(20 / 3600) - still.number)


def test_a_mode_is_measured_each_time_that_it_flies():
    text = BASE + DETUMBLE + POINT
    asked = {"method": "flight", "metric": "peak_attitude_error", "in_mode": "point", "at_most": 1.0}
    scenario = parse(text, "mission.toml")
    run = sh.simulate(scenario)
    begun = run["time"].to_numpy()[run["mode"].to_numpy() == 2][0]
    for after in (0, 5):
        found = sh.verify(scenario.with_({"requirement": [asked | {"after": after}]}))[0]
        turned = run["error_angle"].to_numpy()[run["time"].to_numpy() >= begun + after]
        assert found.number == pytest.approx(turned.max(), rel=1e-9)
        assert "in its mode point" in found.evidence
    never = sh.verify(scenario.with_({"requirement": [asked | {"after": 59}]}))[0]
    assert (never.verdict, never.number) == ("not decided", None)


def test_a_gain_margin_is_asked_for_in_decibels():
    asked = {"method": "margin", "metric": "gain_margin", "at_least": "6 dB"}
    typed, plain = (sh.verify(turn(asked | {"at_least": least}))[0] for least in ("6 dB", 10 ** (6 / 20)))
    assert (typed.number, typed.limit, typed.margin, typed.unit) == (plain.number, plain.limit, plain.margin, "1")


@pytest.mark.slow
def test_each_number_is_that_of_its_own_command():
    phase, error, many, kept, proof = sh.verify(turn(*ALL))[4:]
    assert phase.number == min(one.phase for one in sh.margins(turn()))
    assert phase.left_out == ("sensor gaussian",)
    assert phase.sentence == "met, leaving out sensor gaussian"
    level = sh.budget(turn()).level("all together", "APE")
    assert (error.number, error.verdict) == (level, "missed")
    campaign = sh.campaign(turn(MANY, KEPT), search=False)
    first, second = campaign.laws[0].verdicts
    assert (many.verdict, many.number) == (first.outcome, 300.0 - first.margin_bound)
    assert (kept.verdict, kept.number, kept.limit) == (second.outcome, second.observed, 0.9)
    assert campaign.digest in many.evidence
    assert campaign.digest in kept.evidence
    claim = sh.certify(turn())[0].claim("pointing")
    assert (proof.number, proof.verdict) == (claim.numbers["angle"], "met")


def test_what_is_measured_where_it_is_asked_for_is_the_same_in_a_campaign_and_in_a_flight():
    asked = [{"metric": metric, "at_most": 9} for metric in ("peak_attitude_error", "peak_rate_error", "overshoot")]
    rows = sh.campaign(turn(), runs=1, over={}, requirement=asked, search=False).frame()
    for one in sh.verify(turn(*(one | {"method": "flight"} for one in asked))):
        assert rows[one.metric][0] == pytest.approx(one.number, rel=1e-12)


def test_each_method_is_used_once_and_only_if_it_is_asked_for(monkeypatch):
    used = []

    def counted(module, name):
        function = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, **more: used.append(name) or function(*given, **more))

    for module, name in ((verify, "fly_law"), (verify, "fly_campaign"), (budget, "study"), (verify, "linear_of")):
        counted(module, name)
    study = deciding.study_of("rigid-body")
    monkeypatch.setattr(type(study), "certify", lambda *given, **more: used.append("certify") or [])
    flown = [name for name in ("fly",) if counted(compare, name) is None]
    sh.verify(turn(*ALL, *(one | {"id": one["id"] + "-2"} for one in ALL)))
    assert sorted(used) == sorted(["fly_law", *flown, "fly_campaign", "study", "linear_of", "certify"])
    for method, names in {
        "flight": ["fly_law", "fly"],
        "margin": ["linear_of"],
        "proof": ["certify"],
        "inspection": [],
    }.items():
        used.clear()
        sh.verify(turn(*(one for one in ALL if one["method"] == method), {"id": "i", "method": "inspection"}))
        assert used == names


def test_a_flight_gives_its_verdicts_without_another(monkeypatch):
    scenario = turn(*ALL, {"id": "i", "method": "inspection"})
    entry = scenario.pick(None)
    flight = compare.fly_law(scenario, entry, build(scenario, entry))
    for module in (compare, lane, budget):
        for name in ("fly", "study"):
            monkeypatch.setattr(module, name, None, raising=False)
    found = verdicts_of_flight(scenario, flight)
    assert [one.verdict for one in found] == ["met"] * 4 + ["not decided"] * 6
    assert {one.evidence for one in found[4:9]} == {"left to starhold verify"}


# --- proofs -----------------------------------------------------------------------------------------------------------


def test_a_proof_is_met_or_not_decided_and_never_missed():
    angle = verdict(PROOF).number
    tight = verdict(PROOF | {"at_most": 0.5 * angle})
    assert (tight.verdict, tight.number) == ("not decided", angle)
    assert tight.margin < 0.0
    assert "only this bound is proved" in tight.evidence


def test_what_is_proved_before_the_ultimate_bound_decides_earlier_times():
    later, sooner = verdict(PROOF), verdict(PROOF | {"after": "4 min", "at_most": 20})
    assert sooner.number > later.number
    assert (sooner.verdict, "from 240 s on" in sooner.evidence) == ("met", True)
    flight = verdict(PROOF | {"after": "4 min", "at_most": 20, "method": "flight"})
    assert flight.number <= sooner.number
    assert verdict(PROOF | {"after": "4 min", "at_most": 0.99 * sooner.number}).verdict == "not decided"


@pytest.mark.parametrize(
    ("asked", "changes", "why"),
    leading(
        [
            ({"metric": "final_rate_error", "after": 0, "at_most": 1}, {}, "not by 300 s"),
            ({}, {"initial": {"angles": [3.1, 0, 0], "rate": [0.5, 0, 0]}}, "begins outside of the set"),
            ({}, {"nominal": {"spacecraft": {"inertia": [2, 3, 3.9]}}}, "nominal model is not the craft"),
            (
                {"metric": "settling_time", "at_most": "1 h", "after": 0},
                {"settling": {"attitude_tolerance": 1e-6}},
                "tolerances",
            ),
        ]
    ),
)
def test_what_no_proof_speaks_of_is_not_decided(asked, changes, why):
    found = verdict(PROOF | asked, **changes)
    assert (found.verdict, found.number) == ("not decided", None)
    assert why in found.evidence


def test_what_a_proof_leaves_out_stands_in_the_verdict():
    fine = TURN["simulation"] | {"substeps": 20}
    panels = [[0.1, 0, 0.5, 0, 1, 0, 0, 0, 0.1, 0, 0.01, 0.01, 0.01, 2.0, 0.04, 0]]
    part = {"type": "hinged-panels", "mass": 20, "panels": panels}
    found = verdict(PROOF, part=[part], sensor={}, initial={"angles": ["8 deg", 0, 0]}, simulation=fine)
    assert found.verdict == "met"
    assert found.sentence.startswith("met, leaving out the effector hinged-panels")
    lost = {"time": "1 min", "inertia": [2.1, 3, 4], "action": "none"}
    assert "what changes at 60 s" in verdict(PROOF, fault=[lost]).left_out


# --- what is not met, what is wrong -----------------------------------------------------------------------------------


def test_a_parent_is_as_the_worst_of_what_is_derived_from_it():
    parent = {"id": "S"}
    below = [STILL | {"parent": "S"}, {"id": "i", "method": "inspection", "parent": "S"}]
    assert [one.verdict for one in sh.verify(turn(parent, *below))] == ["not decided", "met", "not decided"]
    missed = SETTLES | {"at_most": 1, "parent": "S"}
    assert sh.verify(turn(parent, *below, missed))[0].verdict == "missed"


def test_what_has_no_value_is_missed():
    slow = {"law": [{"type": "pd", "k_rate": 0.3, "k_attitude": 1e-6}]}
    found = verdict(SETTLES, **slow)
    assert (found.verdict, found.number, found.margin) == ("missed", None, None)
    wild = {"initial": {"angles": [1, 0, 0], "rate": ["3e3 rad/s", 0, 0]}}
    assert [one.verdict for one in sh.verify(turn({"method": "flight", "metric": "lost"}, STILL, **wild))] == ["missed"] * 2
    unstable = {"law": [{"type": "pd", "k_rate": 30, "k_attitude": 3}]}
    assert verdict(PHASE, **unstable).evidence == "the linear loop is not stable"


def test_an_inspection_is_met_as_by_its_record(tmp_path):
    asked = {"id": "I", "method": "inspection", "record": "review.txt"}
    scenario = sh.scenario(TURN | {"requirement": [asked]}, tmp_path)
    assert sh.verify(scenario)[0].verdict == "not decided"
    (tmp_path / "review.txt").write_text("seen")
    found = sh.verify(scenario)[0]
    assert (found.verdict, found.evidence.rpartition(" ")[2]) == ("met", hashlib.sha256(b"seen").hexdigest())


@pytest.mark.parametrize(
    ("required", "line"),
    [
        ([{"id": "a", "metric": "effort", "at_most": 1}], "requirement[1].method: found nothing"),
        ([{"method": "margin", "metric": "effort", "at_most": 1}], 'requirement[1].metric: found "effort"; allowed: one of'),
        ([STILL, {"method": "flight", "metric": "final_distance", "at_most": 1}], 'requirement[2].metric: found "final'),
        ([SETTLES | {"at_most": "3 deg"}], 'requirement[1].at_most: found "3 deg"; allowed: a quantity in s'),
        ([PHASE | {"at_least": "3 s"}], 'requirement[1].at_least: found "3 s"; allowed: a quantity in rad'),
        ([STILL, STILL | {"id": "STILL"}], 'requirement[2].id: found "STILL"; allowed: an id that no other'),
        ([{"id": "T"}, STILL | {"parent": "S"}], 'requirement[2].parent: found "S"; allowed: the id of another requirement'),
        ([STILL | {"parent": "i"}, {"id": "i", "parent": "still"}], "requirement[1].parent"),
        (
            [STILL | {"in_mode": "nadir"}],
            'requirement[1].in_mode: found "nadir"; allowed: no mode, because the law pd has none',
        ),
        ([STILL | {"after": "1 h"}], 'requirement[1].after: found "1 h"; allowed: between 0 s and the flight\'s 400 s'),
        ([BETWEEN | {"window": [5, 4]}], "requirement[1].window: found [5, 4]; allowed: two times, the later one last"),
        ([BETWEEN | {"after": 1}], "requirement[1].window: found [50, '2 min']; allowed: either after or window"),
        ([STILL | {"share": 0.9}], 'requirement[1].share: found 0.9; allowed: only with method = "campaign"'),
        ([PROOF | {"at_least": 1, "at_most": None}], "requirement[1].at_least: found 1; allowed: at_most, with a proof"),
        ([{"method": "flight", "at_most": 1}], "requirement[1].metric: found nothing"),
        ([{"method": "look", "metric": "lost"}], "requirement[1].method"),
        ([{"id": "a[b]", "method": "inspection"}], "requirement[1].id"),
        ([], "requirement: found none"),
    ],
)
def test_a_mistake_is_told_in_one_line_before_anything_is_flown(monkeypatch, required, line):
    monkeypatch.setattr(verify, "fly_law", None)
    with refused(line):
        sh.verify(turn(*required))


def test_other_mistakes_are_told_too():
    with refused("campaign: found no [campaign] table"):
        sh.verify(turn(MANY, campaign=None))
    with refused('requirement[1].method: found "margin"; allowed: flight, campaign or inspection'):
        sh.verify(sh.load("l2-circle").with_({"requirement": [PHASE]}))
    for table in ("campaign", "budget"):
        with refused(f"{table}.requirement: found an old key; allowed: [[requirement]] tables", f'method = "{table}"'):
            turn(**{table: {"requirement": [{"metric": "lost"}]}})


# --- the command ------------------------------------------------------------------------------------------------------


def test_the_command_prints_a_line_each_and_writes_a_matrix_and_junit(tmp_path):
    (tmp_path / "met.toml").write_text(turn(SETTLES, PHASE).text, encoding="utf-8")
    (tmp_path / "open.toml").write_text(turn(SETTLES, {"id": "i", "method": "inspection"}).text, encoding="utf-8")
    (tmp_path / "missed.toml").write_text(turn(SETTLES | {"at_most": 1}, ERROR).text, encoding="utf-8")
    done = starhold("verify", "met.toml", "-o", "met", cwd=tmp_path, code=0)
    assert "settles" in done.stdout
    assert "≤ 5 min" in done.stdout
    assert "leaving out" in done.stdout
    done = starhold("verify", "open.toml", "-o", "open", cwd=tmp_path, code=4)
    assert "i: no record is named." in done.stdout
    starhold("verify", "missed.toml", "-o", "missed", cwd=tmp_path, code=3)
    complains(starhold("verify", "met.toml", "-o", "met", cwd=tmp_path), "results already there")
    with (tmp_path / "missed" / "verify.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["id"], row["verdict"], row["unit"]) for row in rows] == [
        ("settles", "missed", "s"),
        ("error", "missed", "rad"),
    ]
    assert float(rows[0]["margin"]) == pytest.approx(1.0 - float(rows[0]["number"]))
    suites = {name: ElementTree.parse(tmp_path / name / "verify.xml").getroot() for name in ("met", "open", "missed")}
    told = {name: [suite.get(key) for key in ("tests", "failures", "errors")] for name, suite in suites.items()}
    assert told == {"met": ["2", "0", "0"], "open": ["2", "0", "1"], "missed": ["2", "2", "0"]}
    assert [case.find("failure") is not None for case in suites["missed"].iter("testcase")] == [True, True]


GATHERING = {
    "name": "gathering",
    "spacecraft": {"inertia": [6.0, 8.0, 5.0]},
    "initial": {"angles": ["5 deg", "-5 deg", "3 deg"]},
    "wheels": {"layout": "pyramid", "inertia": 1e-3, "torque_limit": "20 mN m", "momentum_limit": "0.4 N m s"},
    "part": [{"type": "constant-torque", "torque": [1e-4, 0, 0]}],
    "simulation": {"duration": 10_000, "control_period": 0.1},
    "requirement": [PROOF | {"at_most": "2 deg", "after": "3000 s"}],
    "law": [{"type": "wheel", "k_rate": 0.5, "k_attitude": 0.02}],
}
"""A torque that never changes fills the wheels within the flight, which ends half a turn from its target."""


@pytest.mark.parametrize(("momentum", "enough"), [(0.0, False), (0.99, False), (1.01, True)])
def test_the_momentum_that_a_claim_assumes_is_compared_with_what_gathers(momentum, enough):
    loop = built(sh.scenario(GATHERING))
    numbers = {"torque": 1e-4, "torque_per_rate": 0.0, "told": False, "momentum": momentum}
    claim = SimpleNamespace(numbers=numbers, assumptions=("bounded-momentum",))
    issued = SimpleNamespace(loop=loop, certificate=SimpleNamespace(subject={"modelled_torque_norm": 0.0}))
    assert (deciding._grown(issued, claim, 10_000.0) == "") == enough
    assert deciding._grown(issued, claim, 1e5)
    assert not any(deciding._unloads(f.part) for f in loop.used("effector"))
    assert deciding._unloads(find("effector", "magnetic-unloading"))
    assert not deciding._unloads(find("effector", "magnetorquers"))


@pytest.mark.slow
def test_a_torque_that_fills_the_wheels_leaves_a_proof_undecided():
    (found,) = sh.verify(sh.scenario(GATHERING))
    assert found.verdict == "not decided"
    assert "total momentum of up to 1 N m s" in found.evidence
