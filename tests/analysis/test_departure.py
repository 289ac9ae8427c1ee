"""When flights leave what is claimed of their laws."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from starhold.algebra.scalar import side
from starhold.analysis.departure import CHANGES, LOST, TURNED, departures, fed_back, shown_at, start_inside, value_of
from starhold.certification.assumptions import ASSUMPTIONS, WITHOUT, assumption
from starhold.certification.certificate import BESIDE, STEADY, Certificate, write
from starhold.certification.certify import certify
from starhold.certification.evidence.isotropic import Shape
from starhold.certification.proofs import IN_THE_LOOP
from starhold.certification.wording import HEADINGS, sentence
from starhold.checker import check_file, passed
from starhold.checker.check import ENDS
from starhold.kernel.sentences import ASSUMPTIONS as SENTENCES
from starhold.parts.craft import tensor
from starhold.parts.quaternion_sign import SIGN_POLICIES
from starhold.report.proved import section
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_text, load, parse
from starhold.simulation.lane import Recording, fly, label
from starhold.studies.compare import fly_law, prove
from tests.making import built
from tests.missions import BASE as MISSION
from tests.missions import DETUMBLE, POINT
from tests.texts import toml
from tests.tiers import fewer

BASE = builtin_text("three-laws").split("[[law]]")[0].replace("duration = 2000.0", "duration = 60.0")
ROTOR = "[[wheel]]\naxis = {}\ninertia = 5e-5\ntorque_limit = 1.0\nmomentum_limit = 0.5\nmomentum = {}\n"
LAW = '\n[[law]]\ntype = "lyapunov"\nk_rate = 0.09\nk_attitude = 0.009\n'


def proved_flight(text, law=None):
    """The flight of a law of a scenario, the first if none is named, with what it leaves."""
    scenario = parse(text, "here")
    entry = scenario.pick(law) if law else scenario.laws[0]
    loop = build(scenario, entry)
    return prove(scenario, entry, loop, fly_law(scenario, entry, loop))


def flown(text):
    """The loop, its certificate and flight, with what the flight leaves."""
    flight = proved_flight(text)
    return built(parse(text, "here")), flight.certificates[0], flight, flight.departures[0]


def test_every_assumption_is_told_and_looked_at():
    """The certifier names what the kernel names, but for what it composes so; and a torque that nobody models."""
    assert set(ASSUMPTIONS) == (set(SENTENCES) - IN_THE_LOOP) | {"unknown-outside-torque", STEADY}
    # A part that a claim leaves out is there for the whole flight.
    told = assumption(f"{WITHOUT}sensor gyro")
    assert (told.text, told.unmet(None)) == ("without the sensor gyro", [(True, "the loop has the sensor gyro")])


def test_a_flight_that_keeps_to_the_assumptions_leaves_nothing():
    text = BASE.replace("attitude = [0, 1, 1, 1]", "attitude = [1, 0.1, 0.1, 0.1]")
    text = text.replace("rate = [0.04, 0.03", "rate = [0.004, 0.003")
    _, certificate, flight, left = flown(text.replace("gravity_gradient = true", "gravity_gradient = false") + LAW)
    kinds = {"convergence", "torque-limit", "inertia", "sampling"}
    assert {claim.kind for claim in certificate.claims} == kinds
    assert left == {"convergence": (), "torque-limit": (), "inertia": ()}
    assert "leaves the claim" not in section([flight])
    assert all(claim["left_at"] is None for claim in flight.results()["claims"])


def test_the_first_time_on_the_limit_ends_a_claim_about_unlimited_torque():
    weak = BASE.replace('"0.01 N m"', '"0.004 N m"').replace("attitude = [0, 1, 1, 1]", "attitude = [1, 0.05, 0, 0]")
    text = weak.replace("rate = [0.04, 0.03, 0.02]", "rate = [0.0, 0.0, 0.02]").replace(
        "gravity_gradient = true", "gravity_gradient = false"
    )
    loop, certificate, flight, left = flown(text + LAW.replace("k_rate = 0.09", "k_rate = 0.02").replace("0.009", "0.03"))
    command = np.abs(flight.recording["command"]).max(axis=1)
    on = np.flatnonzero(command >= 0.004)
    assert 0 < on[0] < len(command) - 1
    assert left["convergence"] == ((pytest.approx(on[0] * loop.period), "the torque reaches its limit"),)
    assert "with unlimited torque, " in sentence(certificate.claim("convergence"), certificate.subject)
    assert f"at {on[0] * 0.1:.4g} s the torque reaches its limit" in section([flight])
    told = next(claim for claim in flight.results()["claims"] if claim["claim"] == "convergence")
    assert (told["outcome"], told["left_at"]) == ("proved", left["convergence"][0].time)
    assert json.loads(json.dumps(told)) == told


@pytest.mark.slow
def test_a_law_that_keeps_within_its_limit_assumes_no_unlimited_torque(tmp_path):
    """It flies on the limit, and what is proved of it is proved of that flight too."""
    text = BASE.replace("gravity_gradient = true", "gravity_gradient = false").replace("[0.04, 0.03", "[0.4, 0.03")
    text = text.replace("attitude = [0, 1, 1, 1]", "attitude = [0, 1, 0, 0]")
    _, certificate, flight, left = flown(text + LAW.replace("lyapunov", "pd") + 'limit = "axis"\n')
    assert np.abs(flight.recording["command"]).max() >= 0.01 * (1.0 - 1e-12)
    assert left == dict.fromkeys(("convergence", "torque-limit", "inertia"), ())
    for claim in certificate.claims:
        assert "unlimited-torque" not in claim.assumptions
        assert "unlimited" not in sentence(claim, certificate.subject)
    write([certificate], "mine", tmp_path / "certificate.json")
    assert passed(check_file(tmp_path / "certificate.json"))


@pytest.mark.parametrize(
    ("old", "new", "how"),
    [
        ("[sensor]", "", None),
        ("torque_limit", 'actuator_lag = "0.5 s"\ntorque_limit', "the loop has the actuator lag"),
        ("[environment]", "[environment]\ntorque_noise = 1e-5", "the loop has the environment random-torque"),
        ("[simulation]", "[sensor]\nrate_noise = 1e-5\n[simulation]", "the loop has the sensor gaussian"),
    ],
)
def test_what_acts_all_the_time_is_told_from_the_start(old, new, how):
    _, _, _, left = flown(BASE.replace(old, new, 1) + LAW)
    assert [one.how for one in left["convergence"] if one.time == 0.0] == ([] if how is None else [how])
    # This start is outside the set of small torques, whatever else.
    assert "it is outside the set" in [one.how for one in left["torque-limit"]]


def test_only_a_law_that_does_not_cancel_gravity_leaves_by_it():
    plain = LAW.replace('"lyapunov"', '"pd"')
    assert "the gravity gradient acts" in [one.how for one in flown(BASE + plain)[3]["convergence"]]
    assert flown(BASE + LAW)[3]["convergence"] == ()


QUIET = {
    "attitude = [0, 1, 1, 1]": "attitude = [1, 0.02, 0.02, 0.02]",
    "rate = [0.04, 0.03, 0.02]": "rate = [0, 0, 0]",
    "gravity_gradient = true": "gravity_gradient = false",
}


def quiet(text, **more):
    for old, new in (QUIET | more).items():
        text = text.replace(old, new)
    return text


def test_a_flight_that_is_driven_out_of_its_set_is_told_when():
    loop, certificate, flight, left = flown(quiet(BASE) + LAW)
    assert left["torque-limit"] == ()
    run = flight.recording
    pushed = run["rate_error"].copy()
    pushed[200:] += 0.1
    struck = Recording(run.arrays | {"rate_error": pushed}, run.attrs)
    (gone,) = departures(certificate, loop, struck)["torque-limit"]
    assert (gone.time, gone.how) == (pytest.approx(20.0), "it leaves the set")
    # A claim about every state is left by none.
    assert departures(certificate, loop, struck)["convergence"] == ()


def test_noisy_sensors_do_not_keep_a_start_from_being_judged():
    loop = built(parse(BASE + "\n[sensor]\nrate_noise = 1e-5\n" + LAW, "here"))
    assert start_inside(certify(loop, "lyapunov"), loop)["torque-limit"] is False


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.tuples(*[st.floats(-0.06, 0.06)] * 3))
@settings(max_examples=fewer(30))
def test_the_limit_is_kept_by_every_flight_that_does_not_leave_the_claim(turn, rate):
    """The theorem: from inside the set and under the assumptions nothing is left, and no torque reaches the limit."""
    loop, certificate = kept_loop()
    half = np.array([1.0, *turn]) / np.linalg.norm([1.0, *turn])
    flying = replace(loop, start=loop.start._replace(attitude=tuple(half.tolist()), rate=rate))
    run = label(flying, *fly(flying, 300), 1)
    left = departures(certificate, flying, run)
    inside = start_inside(certificate, flying)["torque-limit"]
    assert (left["torque-limit"] == ()) == inside
    if inside:
        assert np.abs(run["command"]).max() <= loop.craft.torque_limit
        assert left["convergence"] == ()


@cache
def kept_loop():
    loop = built(parse(quiet(BASE) + LAW, "here"))
    return loop, certify(loop, "lyapunov")


@pytest.mark.slow
def test_torque_held_for_too_long_ends_every_claim_about_the_motion():
    text = quiet(BASE, **{"control_period = 0.1": "control_period = 5.0", 'limit = "axis"': 'limit = "none"'})
    _, certificate, _, left = flown(text + '[[law]]\ntype = "modal"\nform = "equal"\na = -0.428\n')
    assert certificate.claim("sampling").outcome == certificate.outcome == "refuted"
    assert list(left) == ["region"]
    assert left["region"][0].time == 0.0
    assert "even the linear loop is unstable" in left["region"][0].how


WHIRLING = toml("""
name = "whirling"
[spacecraft] inertia = [0.05, 0.05, 0.05]
[initial] angles = ["3 deg", "2 deg", 0]
[simulation] duration = 300; control_period = 1.0; substeps = 100
[[law]] type = "wheel"; k_rate = 0.004; k_attitude = [5e-5, 5e-5, 5e-5]
""")


def test_momentum_that_turns_a_held_torque_leaves_every_claim_of_torque_applied_continuously():
    """What is proved of held torque is proved without stored momentum; with it this one drives the body away."""
    rotors = [ROTOR.format(axis, momentum) for axis, momentum in (("[1, 0, 0]", 0), ("[0, 1, 0]", 0), ("[0, 0, 1]", 0.3))]
    flight = proved_flight(WHIRLING + "".join(rotors))
    assert {claim.outcome for claim in flight.certificates[0].claims} == {"proved"}
    assert all(left[0] == (0.0, TURNED.format(1.0)) for left in flight.departures[0].values())
    angle = 2.0 * np.arcsin(np.linalg.norm(flight.recording["attitude_error"][:, 1:], axis=1))
    assert angle[-1] > 4.0 * angle[0]


def test_turning_leaves_claims_sooner_the_nearer_the_period_is_to_the_longest():
    slow = {"[2.0, 3.0, 4.0]": "[1.0, 1.0, 1.0]", "control_period = 0.1": "control_period = 1.0\nsubsteps = 40"}
    text = quiet(BASE, **slow).replace("rate = [0, 0, 0]", "rate = [0, 0, 0.5]").replace('torque_limit = "0.01 N m"', "")
    near, far = (
        proved_flight(text + LAW.replace("0.09", rate).replace("0.009", "0.1")).departures[0]["convergence"]
        for rate in ("1.85", "0.8")
    )
    assert near[0].time == 0.0
    assert far == ()


def test_a_craft_too_fast_to_be_followed_leaves_even_a_claim_about_every_state():
    _, _, flight, left = flown(BASE.replace("rate = [0.04", 'rate = ["100.04 rad/s"') + LAW)
    assert flight.lost == 0.0
    assert left["convergence"] == ((0.0, LOST), (0.0, TURNED.format(1.0)))


def test_a_body_that_turns_far_while_its_torque_is_held_leaves_even_a_claim_about_every_state():
    """Continuous torque brings it to rest; held torque, which the linear loop allows, keeps it at 2.3 turns a second."""
    text = quiet(
        BASE, **{"[2.0, 3.0, 4.0]": "[1.1, 3.0, 4.0]", "control_period = 0.1": "control_period = 0.5\nsubsteps = 40"}
    )
    text = text.replace("rate = [0, 0, 0]", 'rate = [6, -5, "14 rad/s"]').replace('torque_limit = "0.01 N m"', "")
    flight = proved_flight(text + LAW.replace("0.09", "0.96").replace("0.009", "0.15"))
    assert {claim.kind: claim.outcome for claim in flight.certificates[0].claims} == dict.fromkeys(
        ("convergence", "inertia", "sampling"), "proved"
    )
    assert flight.departures[0]["convergence"][0] == (0.0, TURNED.format(1.0))
    assert np.linalg.norm(flight.recording["rate"][-1]) > 10.0


WHEELED = builtin_text("wheels-orbital").replace('duration = "10 min"', "duration = 15.0")
LOST_WHEEL = '\n[[fault]]\ntime = {}\nwheel = 2\nlost = true\naction = "{}"\n'


@pytest.mark.slow
def test_a_fault_ends_the_claims_of_the_first_certificate():
    flight = proved_flight(WHEELED + LOST_WHEEL.format(10, "both"))
    assert len(flight.certificates) == 2
    first, second = (left["convergence"] for left in flight.departures)
    assert first[-1] == (10.0, CHANGES)
    assert all(one.time >= 10.0 for one in second)
    # One at the very start, of which the law does not know.
    (left,) = proved_flight(WHEELED + LOST_WHEEL.format(0, "none")).departures
    assert left
    assert all((0.0, CHANGES) in departed for departed in left.values())


@pytest.mark.slow
def test_a_fault_ends_the_claims_of_the_mode_that_flies_and_of_all_that_follow():
    wheels = '[wheels]\nlayout = "pyramid"\ninertia = 2.2e-5\ntorque_limit = 0.002\nmomentum_limit = 0.015\n'
    text = MISSION.replace("torque_limit = 0.002\n", "").replace("[initial]", f"{wheels}[initial]") + DETUMBLE
    text += POINT.replace('"pid"', '"lyapunov"').partition("k_integral")[0]
    text = text.replace('until = { rate_below = "0.5 deg/s", dwell = "2 s" }', 'until = { after = "10 s" }')
    text = text.replace('quaternion_sign = "shortest"\n', "")

    def left(time):
        flight = proved_flight(text + (LOST_WHEEL.format(time, "none") if time else ""))
        assert [begun.time for begun in flight.modes] == [0.0, pytest.approx(10.0, abs=0.15)]
        kinds = ("convergence", "convergence", "hand-over")
        found = [flight.left(number, kind) for number, kind in enumerate(kinds)]
        lacks = "while it has the loop of the claim"
        return [
            [one.time if one.how == CHANGES else lacks for one in departed if one.how == CHANGES or lacks in one.how]
            for departed in found
        ]

    assert left(None) == [[], [], []]
    assert left(20) == [[], [20.0], [20.0]]
    before, *after = left(5)
    assert before == [5.0]
    assert after == [["while it has the loop of the claim"]] * 2


def test_a_law_that_switches_at_rest_leaves_its_claim_where_its_torque_is_held():
    """Each held switch turns the body by more than the surface is wide: with these gains it ends 50 deg off its target."""
    text = quiet(BASE, **{"[2.0, 3.0, 4.0]": "[399.0, 377.0, 377.0]", 'torque_limit = "0.01 N m"': ""})
    law = '[[law]]\ntype = "sliding"\nsurface_gain = 0.015\nswitching_gain = 59.0\nboundary_layer = {}\n'
    flight = proved_flight(text + law.format(0.0))
    certificate = flight.certificates[0]
    assert [(c.kind, c.outcome) for c in certificate.claims] == [("sliding", "proved"), ("sampling", "undecided")]
    held = "the torque is held for 0.1 s, for which stability is not proved"
    assert flight.departures[0]["sliding"][0] == (0.0, held)
    assert np.degrees(flight.metrics["final_attitude_error"]) > 10.0
    # Of a layer that is wide enough the held torque is proved to do.
    calm = proved_flight(text + law.format(0.05))
    assert calm.certificates[0].claim("sampling").outcome == "proved"
    assert calm.departures[0]["sliding"] == ()


def test_a_hand_over_is_left_where_the_next_mode_holds_its_torque_for_too_long():
    text = MISSION.replace("control_period = 0.1", "control_period = 5.0") + DETUMBLE.replace("0.02", "0.005")
    text = text.replace('rate_below = "0.5 deg/s", dwell = "2 s"', 'after = "10 s"')
    text += POINT.replace('"pid"', '"pd"').partition("k_integral")[0].replace("0.006", "0.03")
    flight = proved_flight(text.replace('quaternion_sign = "shortest"\n', ""))
    handed = flight.certificates[2]
    assert {c.kind: c.outcome for c in handed.claims} == {"hand-over": "proved", "sampling": "refuted"}
    held = "the torque is held for 5 s, so long that even the linear loop is unstable"
    assert flight.left(2, "hand-over")[0] == (10.0, held)


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60), st.floats(0.05, 0.9))
@settings(max_examples=fewer(60))
def test_the_quaternion_that_is_fed_back_is_that_of_the_loop(cosines, width):
    loop = replace(built(parse(BASE + LAW, "here")), sign_policy="hysteresis", hysteresis_width=width)
    errors = np.array([(q0, np.sqrt(max(0.0, 1.0 - q0 * q0)), 0.0, 0.0) for q0 in cosines])
    h, expected = side(cosines[0]), []
    for error in errors:
        shown, h = SIGN_POLICIES["hysteresis"](tuple(error), h, loop.hysteresis_width)
        expected.append(shown)
    assert np.array_equal(fed_back(loop, errors), np.array(expected))


@pytest.mark.slow
def test_the_set_of_a_claim_is_that_of_the_program_in_its_proof():
    """Of a law whose V decreases with a mixed term alone, and of one that is told by its root."""
    craft = BASE.replace("gravity_gradient = true", "gravity_gradient = false")
    mixed = '[[law]]\ntype = "lqr"\nform = "II"\nq = [1, 1, 1, 1, 2, 3]\nr = [1e3, 1e3, 1e3]\n'
    for law, kind in ((mixed, "torque-limit"), ('[[law]]\ntype = "modal"\nform = "equal"\na = -0.428\n', "region")):
        loop = built(parse(craft + law, "here"))
        certificate = certify(loop)
        claim = certificate.claim(kind)
        shown = shown_at(loop, loop.start)
        columns = shown._replace(attitude=tuple(np.full(3, x) for x in shown.attitude))
        n, w, q = claim.witness, np.array(shown.rate), np.array(shown.attitude)
        if kind == "region":
            expected = Shape(**n).value(shown.attitude, shown.rate)
        else:
            assert n["epsilon"] > 0.0
            own = loop.law.lyapunov(shown, loop.gains, loop.craft)
            expected = own + n["epsilon"] * q[1:] @ tensor(loop.craft.inertia) @ w
        for told in (shown, columns):
            assert value_of(claim.proof.roles, loop, told) == pytest.approx(expected)
        inside = start_inside(certificate, loop)[kind]
        assert inside == (expected <= claim.numbers["level"])


# --- station keeping --------------------------------------------------------------------------------------------------


def test_a_lost_flight_first_leaves_the_claim_that_it_ends_on_the_circle():
    deficit = proved_flight(builtin_text("l2-deficit"), "2.786 as printed")
    left = deficit.departures[0]["circle"]
    assert [one.how for one in left] == ["the control reaches its limit", "it leaves the set", LOST]
    assert 0.0 < left[0].time < left[1].time < left[2].time == deficit.lost
    assert "With unlimited control, from the level set" in section([deficit])
    assert "This flight leaves the claim" in section([deficit])
    (circle,) = (claim for claim in deficit.results()["claims"] if claim["claim"] == "circle")
    assert circle["left_at"] == left[0].time


@pytest.mark.parametrize("place", range(3))
def test_a_flight_on_its_control_limit_leaves_the_claim_that_it_ends_at_the_equilibrium(place):
    """All three ride on it, and two come to rest all the same, as the claim about the limited axis says."""
    scenario = load("l2-equilibrium")
    entry = scenario.laws[place]
    flight = proved_flight(scenario.text, entry.name)
    run, left = flight.recording, flight.departures[0]["equilibrium"]
    assert flight.certificates[0].claim("equilibrium").outcome == "proved"
    on = np.abs(run["command"]).max(axis=1) >= build(scenario, entry).saturation_limit()
    assert left[0].how == "the control reaches its limit"
    assert left[0].time == pytest.approx(run["time"][np.argmax(on)] * run.attrs["time_unit_s"])
    assert "the control reaches its limit" in section([flight])
    assert (flight.departures[0]["saturated-axis"] == ()) == (flight.lost is None)


# --- a certificate as a whole -----------------------------------------------------------------------------------------


def test_the_linear_loop_alone_proves_no_certificate(tmp_path):
    """A law of which nothing but the sampling claim is made: the checker, too, refuses that to be called proved."""
    text = BASE + LAW
    whole = certify(built(parse(text, "here")), "lyapunov")
    assert whole.outcome == "proved"
    alone = Certificate(whole.name, whole.subject, tuple(claim for claim in whole.claims if claim.kind == "sampling"))
    assert alone.claims[0].outcome == "proved"
    assert {kind for kind in HEADINGS if kind not in BESIDE} == set(ENDS)
    assert alone.outcome == "undecided"
    path = tmp_path / "certificate.json"
    write([alone], "here", path)
    assert passed(check_file(path))
    path.write_text(path.read_text().replace('"outcome": "undecided"', '"outcome": "proved"', 1))
    assert "does not follow" in " ".join(finding.reason for finding in check_file(path) if finding.verdict == "fails")
