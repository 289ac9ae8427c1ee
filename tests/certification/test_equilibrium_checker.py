"""The checker's reading of certificates about equilibria beside a libration point and about the X axis with limited
control."""

import copy
import json
import math

import pytest
from flint import arb, ctx

from starhold.certification.certificate import write
from starhold.certification.station import certify_station, described_station
from starhold.checker import check, check_file, passed
from starhold.checker.exact import rational
from starhold.checker.station import HELD
from starhold.laws import l2_equilibrium
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import POINTS, PRIMARIES
from tests.certification.by_hand import by_hand
from tests.certification.edits import changed, faults, holds_unrefuted, lists_are_exact, outcomes, with_kinds
from tests.certification.equilibria import GAINS, OFF, PLANT, STEEP, STEEPNESS, STRONG, WEAK, loop_of
from tests.making import point_loop

REST, AXIS = (("certificates", 0, "claims", place) for place in (0, 1))
SUBJECT = ("certificates", 0, "subject")


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """What the certifier writes."""
    path = tmp_path_factory.mktemp("rests") / "certificate.json"
    done = {}

    def make(gains=GAINS, limit=math.inf, kind="axis", **changes):
        key = (gains, limit, kind, *sorted(changes.items()))
        if key not in done:
            write([certify_station(loop_of(gains, limit, kind, **changes))], "made", path)
            assert [f for f in check_file(path) if f.verdict == "fails"] == []
            done[key] = path.read_text(encoding="utf-8")
        return json.loads(done[key])

    return make


# --- what holds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gains", [GAINS, STRONG, WEAK, OFF, GAINS._replace(y=0.0, z=0.0)])
@pytest.mark.parametrize("limit", [4.0, 8.0, 1e4])
def test_what_the_certifier_claims_holds(made, gains, limit):
    content = made(gains, limit)
    assert outcomes(content) == {"equilibrium": "proved", "saturated-axis": "proved"}
    assert {f.verdict for f in check(content)} == {"holds"}


def test_feedback_far_off_the_separatrix_is_not_claimed(made):
    content = made(GAINS._replace(k_x=1.1 * GAINS.k_x), 4.0)
    assert outcomes(content) == {"equilibrium": "proved", "saturated-axis": "undecided"}
    assert {(f.claim, f.verdict) for f in check(content)} == {("equilibrium", "holds"), ("saturated-axis", "not claimed")}


@pytest.mark.parametrize("name", sorted(PRIMARIES))
def test_all_points_hold(made, name):
    for point in POINTS:
        plant = PRIMARIES[name].point(point)
        content = made(l2_equilibrium.design(plant, l2_equilibrium.Degree(y=0.3)), 5.0, plant=plant)
        assert outcomes(content) == {"equilibrium": "proved", "saturated-axis": "proved"}
        assert {f.verdict for f in check(content)} == {"holds"}


@pytest.mark.parametrize(("limit", "kind"), [(math.inf, "axis"), (math.inf, "norm"), (3.0, "norm"), (3.0, "none")])
def test_without_a_limit_by_axis_rest_alone_is_claimed(made, limit, kind):
    content = made(GAINS, limit, kind)
    assert outcomes(content) == {"equilibrium": "proved"}
    assert {f.verdict for f in check(content)} == {"holds"}


def test_the_full_problem_holds_away_from_the_bodies(made):
    content = made(GAINS._replace(model=1), model="nonlinear")
    assert outcomes(content) == {"equilibrium": "proved"}
    assert {f.verdict for f in check(content)} == {"holds"}
    assert content["certificates"][0]["claims"][0]["assumptions"][-1] == "never at the centre of one of the two bodies"
    assert faults(changed(content, (*REST, "assumptions"), content["certificates"][0]["claims"][0]["assumptions"][:-1]))


# --- what fails -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gains", [GAINS, STRONG, WEAK, OFF])
def test_a_number_that_says_more_fails(made, gains):
    content = made(gains, 4.0)
    numbers = content["certificates"][0]["claims"][1]["numbers"]
    place = (*AXIS, "numbers")
    for key, share, where_ in (
        ("width", 1.0011, "stays"),
        ("boundary", 1.0 - 1e-13, "nothing returns from beyond"),
        ("reach", 1e-4, "stays"),
        ("limit", 1.0 + 1e-15, ""),
        ("limit", 1.0 - 1e-15, ""),
    ):
        assert ("saturated-axis", where_) in faults(changed(content, (*place, key), numbers[key] * share)), (key, share)
    for key in numbers:
        for value in (-1.0, 0.0, None, math.inf, math.nan, "1", True):
            assert faults(changed(content, (*place, key), value)), (key, value)
    assert faults(changed(content, (*place, "slew_angle"), 1.0))
    assert faults(changed(content, (*place, "width"), numbers["boundary"]))
    # What says less holds.
    for key, share in (("width", 0.9), ("reach", 0.9), ("boundary", 2.0)):
        assert not faults(changed(content, (*place, key), numbers[key] * share)), (key, share)


def test_gains_off_the_separatrix_hold_up_to_a_reach(made):
    """|D| reach < (K - 1) width: with rounding alone the reach is huge but not without bound."""
    content = made(OFF, 4.0)
    width = content["certificates"][0]["claims"][1]["numbers"]["width"]
    reach = width / (OFF.k_x / STEEP - 2.0)
    at = (*AXIS, "numbers", "reach")
    assert not faults(changed(content, at, 0.999999 * reach))
    assert ("saturated-axis", "stays") in faults(changed(content, at, 1.000001 * reach))
    rounded = made(GAINS, 4.0)
    assert not faults(changed(rounded, at, 1e12))
    with ctx.workprec(192):
        error = abs(arb(rational(GAINS.k_x)) - arb(rational(GAINS.k_velocity[0])) * (1 + 2 * arb(PLANT.stiffness)).sqrt())
        reach = float(width * STEEP / error)
    assert 1e12 < reach < 1e18
    assert not faults(changed(rounded, at, 0.999 * reach))
    assert faults(changed(rounded, at, 1.001 * reach))


def test_the_witness_must_make_the_function_fall(made):
    content = made(GAINS, 4.0)
    numbers, at = content["certificates"][0]["claims"][1]["numbers"], (*AXIS, "witness", "mu")
    bound = 4.0 * (4.0 / STEEP / numbers["width"] - 1.0)
    assert not faults(changed(content, at, 0.999 * bound))
    for mu in (1.001 * bound, 10.0, 1e-40, 0.0, -1.0):
        assert set(faults(changed(content, at, mu))) == {("saturated-axis", "strict")}, mu
    for mu in (None, "1", True, math.inf):
        assert faults(changed(content, at, mu))
    assert faults(changed(content, (*AXIS, "witness"), {}))
    assert faults(changed(content, (*AXIS, "witness", "epsilon"), 1.0))
    assert faults(changed(content, (*REST, "witness"), {"mu": 1.0}))


def test_obligations_and_assumptions_are_those_of_the_claim(made):
    content = made(GAINS, 4.0)
    for place in (REST, AXIS):
        lists_are_exact(content, place, {"name": "descent", "how": "certified roots", "evidence": {"state": 1}})
    # Rest along Y and Z at the start is not enough, and a motion in the full problem is another.
    assert faults(changed(content, (*AXIS, "assumptions", -1), HELD.replace("held", "starts")))
    assert faults(changed(content, (*AXIS, "assumptions", -1), "control not limited"))
    assert faults(changed(content, (*AXIS, "assumptions", 0), "motion exactly as modelled"))


def test_a_claim_of_the_other_kind_fails(made):
    content = made(GAINS, 4.0)
    main, limited = content["certificates"][0]["claims"]
    for one, kind in ((main, "saturated-axis"), (limited, "equilibrium"), (main, "circle"), (limited, "control-limit")):
        renamed = copy.deepcopy(content)
        renamed["certificates"][0]["claims"] = [{**one, "kind": kind}]
        assert faults(with_kinds(renamed))
    attitude = by_hand("lyapunov", {"k_attitude": 0.1, "k_rate": 0.5}, [main])
    assert "there is no kind of claim equilibrium about such a loop" in faults(attitude).values()


def test_other_laws_make_no_equilibrium_attractive(made):
    content = made(GAINS, 4.0)
    for law in catalogue("libration-point").values():
        for gains in law.examples():
            loop = point_loop(PLANT, law, gains, loop_of().start, 1e-3, limit=4.0, kind="axis")
            other = changed(content, SUBJECT, json.loads(json.dumps(described_station(loop))))
            if law.name != "l2-equilibrium":
                assert set(faults(other).values()) == {f"the law {law.name} makes no equilibrium attractive"}


@pytest.mark.parametrize(
    ("key", "value", "failing"),
    [
        (("gains", "k_x"), 1.1 * GAINS.k_x, ("saturated-axis", "stays")),
        (("gains", "k_x"), 0.9 * GAINS.k_x, ("saturated-axis", "stays")),
        (("gains", "k_x"), 0.9 * STEEP, ("equilibrium", "each axis returns")),
        (("gains", "k_x"), -1.0, ("", "")),
        (("gains", "k_velocity"), [0.5 * STEEPNESS, 1.0, 1.0], ("saturated-axis", "stays")),
        (("gains", "k_velocity"), [0.0, 1.0, 1.0], ("equilibrium", "each axis returns")),
        (("gains", "k_velocity"), [6.0, 0.0, 1.0], ("equilibrium", "each axis returns")),
        (("gains", "k_velocity"), [6.0, 1.0, -1.0], ("equilibrium", "each axis returns")),
        (("gains", "k_velocity"), [6.0, 1.0], ("", "")),
        (("gains", "model"), "nonlinear", ("equilibrium", "form")),
        (("gains", "model"), "nonlinear", ("saturated-axis", "")),
        (("gains", "other"), 1.0, ("", "")),
        (("model",), "nonlinear", ("equilibrium", "")),
        (("law",), "l2-circle", ("", "")),
        (("limit",), "norm", ("saturated-axis", "")),
        (("limit",), "none", ("saturated-axis", "")),
        (("control_limit",), None, ("saturated-axis", "")),
        (("control_limit",), 3.9, ("saturated-axis", "")),
        (("control_limit",), 4.1, ("saturated-axis", "")),
        (("control_limit",), -1.0, ("", "")),
        (("plant",), {**PRIMARIES["sun-earth"].point("L1")._asdict()}, ("saturated-axis", "stays")),
        (("plant",), {**PRIMARIES["sun-earth"].point("L3")._asdict()}, ("saturated-axis", "nothing returns from beyond")),
        *[(("plant", name), 1.01 * getattr(PLANT, name), ("", "")) for name in PLANT._fields],
    ],
)
def test_the_claims_are_about_this_loop(made, key, value, failing):
    assert failing in faults(changed(made(GAINS, 4.0), (*SUBJECT, *key), value))


def test_another_place_of_rest_holds_too(made):
    content = made(GAINS, 4.0)
    assert not faults(changed(content, (*SUBJECT, "gains", "y"), -3.0))


def test_the_limited_axis_of_the_full_problem_is_not_claimed(made):
    """There the control along X also spends itself on what the linear model leaves out."""
    content = made(GAINS, 4.0)
    content["certificates"][0]["subject"] |= {"model": "nonlinear"}
    content["certificates"][0]["subject"]["gains"]["model"] = "nonlinear"
    content["certificates"][0]["claims"][1]["assumptions"][0] = "motion exactly as modelled"
    content["certificates"][0]["claims"].pop(0)
    content["certificates"][0]["outcome"] = "undecided"
    assert faults(with_kinds(content)) == {("saturated-axis", ""): "the limited control is read for the linear model alone"}


# --- refutations ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "gains",
    [
        GAINS._replace(k_x=0.9 * STEEP),
        GAINS._replace(k_velocity=(0.0, 1.0, 1.0)),
        GAINS._replace(k_velocity=(1.0, -1.0, 1.0)),
        GAINS._replace(k_velocity=(1.0, 1.0, -1e-300)),
    ],
)
def test_what_does_not_return_is_refuted(made, gains):
    content = made(gains, 4.0)
    assert outcomes(content) == {"equilibrium": "refuted"}
    assert [(f.obligation, f.verdict) for f in check(content)] == [
        ("form", "not claimed"),
        ("each axis returns", "not claimed"),
    ]
    assert not passed(check(changed(content, (*SUBJECT, "gains"), made()["certificates"][0]["subject"]["gains"])))
    assert not passed(check(changed(content, (*REST, "obligations", 1, "evidence"), {"axis": 1})))
    assert not passed(check(changed(content, (*SUBJECT, "model"), "nonlinear")))
    proved = copy.deepcopy(content)
    proved["certificates"][0]["outcome"] = proved["certificates"][0]["claims"][0]["outcome"] = "proved"
    proved["certificates"][0]["claims"][0]["obligations"][1]["outcome"] = "proved"
    assert set(faults(proved)) == {("equilibrium", "each axis returns")}


def test_nothing_refutes_what_holds(made):
    content = made(GAINS, 4.0)
    for place, names in ((0, ("form", "each axis returns")), (1, ("stays", "strict", "nothing returns from beyond"))):
        holds_unrefuted(content, place, names)
