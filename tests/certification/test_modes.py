"""What is certified of modes, and of the hand-over from one to the next."""

import json
import math
from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.certificate import write
from starhold.certification.subject import make_subject
from starhold.checker import check_file, passed
from starhold.parts.craft import tensor
from starhold.scenario.building import build
from starhold.scenario.reading import load, parse
from starhold.studies.bodies.rigid_body import STUDY
from starhold.studies.certificates import compare_programs
from starhold.studies.compare import fly_law, prove
from starhold.studies.modes import loop_of_mode, most_stored, named_modes
from tests.certification.handed import POINT, bounded, handed, issued
from tests.making import built
from tests.missions import BASE, DETUMBLE


def test_each_mode_is_certified_as_its_law_alone_is():
    found = issued(DETUMBLE + POINT)
    alone = parse(
        BASE.partition("[[law]]")[0]
        + "[[law]]"
        + POINT.partition("]]")[2].replace('name = "point"', 'quaternion_sign = "shortest"'),
        "alone.toml",
    )
    own = STUDY.certify(alone, alone.laws[0], build(alone, alone.laws[0]))[0].certificate
    of_mode = found["mission: point"].certificate
    assert of_mode.outcome == "proved"
    assert (of_mode.subject, of_mode.claims) == (own.subject, own.claims)


def test_a_hand_over_is_proved_exactly_as_far_as_the_level_of_v_reaches(tmp_path):
    """V = w.Jw/2 + 2 k (1 - q0), by the largest moment, up to the level 2 k at which the quaternion's sign switches."""
    k, moment, angle = 0.0008, 0.065, math.radians(150.0)
    most = math.degrees(math.sqrt(2.0 * 2.0 * k * math.cos(0.5 * angle) / moment))
    inside, outside = (handed(bounded(f"{share * most:.6g} deg/s", "150 deg") + POINT) for share in (0.9999, 1.0001))
    assert (inside.outcome, outside.outcome) == ("proved", "undecided")
    path = tmp_path / "certificate.json"
    write([inside, outside], "mission", path)
    assert [f for f in check_file(path) if f.verdict not in ("holds", "not claimed")] == []


def test_a_hand_over_that_says_more_is_refused_and_one_that_says_less_is_another(tmp_path):
    angle = math.radians(150.0)
    most = math.degrees(math.sqrt(2.0 * 2.0 * 0.0008 * math.cos(0.5 * angle) / 0.065))
    modes = bounded(f"{0.9999 * most:.6g} deg/s", "150 deg") + POINT
    path, scenario = tmp_path / "certificate.json", parse(BASE + modes, "mission.toml")

    write([handed(modes)], "mission", path)
    made = path.read_text()

    def told(name, factor):
        content = json.loads(made)
        numbers = content["claims"][0]["numbers"]
        numbers[f"start.{name}"] = str(Fraction(numbers[f"start.{name}"]) * Fraction(factor))
        path.write_text(json.dumps(content))
        return path

    for name in ("rate", "angle"):
        assert not passed(check_file(told(name, "1.001")))
        assert compare_programs(told(name, "1"), scenario) == []
        less = compare_programs(told(name, "0.99"), scenario)
        assert less == [f"mission: detumble to point: the previous mode may end with a larger {name}"]


@pytest.mark.slow
def test_a_hand_over_to_a_law_that_converges_from_everywhere_needs_no_bounds():
    text = BASE.replace('quaternion_sign = "shortest"\n', "")
    after = DETUMBLE.replace('rate_below = "0.5 deg/s"', 'after = "10 s"') + POINT
    assert handed(after, text).outcome == "proved"
    # Where a level bounds the set, nothing is known of where the mode before ends.
    assert set(issued(after)) == {"mission: detumble", "mission: point"}


def test_a_mode_towards_a_target_that_claims_leave_out_is_checked_without_it(tmp_path):
    """Where the Sun comes into the orbit's plane yaw steering turns at any rate: no bound of the mode before is relative to
    it."""
    text = BASE.replace('quaternion_sign = "shortest"\n', "").replace(
        "[simulation]", '[orbit]\naltitude = "500 km"\ninclination = "97 deg"\nepoch = "2027-03-20"\n[simulation]'
    )
    found = issued(bounded("0.5 deg/s") + POINT + 'target = { type = "yaw-steering" }\n', text)
    certificates = [one.certificate for one in found.values()]
    write(certificates, "mission", tmp_path / "certificate.json")
    assert passed(check_file(tmp_path / "certificate.json"))
    over = found["mission: detumble to point"].certificate
    assert (over.outcome, over.claims[0].numbers["rate"]) == ("proved", None)
    assert over.claims[0].assumptions[-1] == "without:target yaw-steering"


def test_a_law_with_a_memory_is_handed_to_without_a_claim():
    pid = POINT.replace("lyapunov", "pid") + "k_integral = 1e-5\nintegral_limit = 1e-4\n"
    assert set(issued(DETUMBLE + pid)) == {"mission: detumble", "mission: point"}


def test_a_flight_leaves_the_claims_of_a_mode_when_that_ends():
    scenario = parse(BASE + bounded("0.5 deg/s", "178 deg") + POINT, "mission.toml")
    entry = scenario.laws[0]
    loop = build(scenario, entry)
    flight = prove(scenario, entry, loop, fly_law(scenario, entry, loop))
    names = [certificate.name for certificate in flight.certificates]
    assert names == ["mission: detumble", "mission: point", "mission: detumble to point"]
    run = flight.recording
    switch = float(run["time"][np.argmax(run["mode"] > 1.5)])
    assert ("another mode begins", switch) in [(one.how, one.time) for one in flight.left(0, "convergence")]
    assert (flight.left(1, "convergence"), flight.left(2, "hand-over")) == ((), ())
    assert loop_of_mode(loop, 1).law.name == "lyapunov"


def test_claims_of_a_mode_assume_the_momentum_at_which_it_ends_or_begins():
    """In cubesat-mission nadir ends at 3 mN m s, and unload begins by it; sun begins with that of resting rotors."""
    loop = built("cubesat-mission")
    rotors = 0.01 / math.sqrt(3.0)
    assert [most_stored(loop, place) for place in range(4)] == [math.inf, pytest.approx(rotors), 0.003, 0.003]
    nadir = named_modes(loop, "mission")["mission: nadir"]
    begun = make_subject(nadir).total_momentum
    subject = make_subject(nadir, stored=0.003)
    own = np.linalg.norm(tensor(nadir.craft.inertia), 2) * float(subject.target_rate)
    assert float(subject.total_momentum) == pytest.approx(0.003 * 1.05 + own, rel=1e-9)
    assert subject.total_momentum < begun
    assert make_subject(nadir, stored=1.0).total_momentum == begun
    assert float(make_subject(nadir, momentum=0.02, stored=0.003).total_momentum) == 0.02


@pytest.mark.slow
def test_the_mission_points_as_it_flies_with_all_its_parts_in_the_claim_once_its_wheels_are_unloaded():
    scenario = load("cubesat-mission")
    loop = build(scenario, scenario.laws[0])
    found = {one.certificate.name: one for one in STUDY.certify(scenario, scenario.laws[0], loop, pointing=True)}
    run = fly_law(scenario, scenario.laws[0], loop).recording
    for mode, angle in (("nadir", 0.13), ("unload", 0.53)):
        one = found[f"mission: {mode}"]
        (claim,) = (claim for claim in one.certificate.claims if claim.kind == "pointing")
        assert (claim.outcome, claim.left_out) == ("proved", [])
        assert math.degrees(claim.numbers["angle"]) < angle
        left = STUDY.departures(one, loop, run)["pointing"]
        # Both begin with the momentum of the rotors at separation, and nadir again when that is unloaded.
        assert any("momentum" in one.how for one in left)
        assert max(one.time for one in left) < 4850.0
