"""The checker's reading of certificates about circles round a libration point: what holds, what fails, its mathematics."""

import copy
import json
import math

import pytest

from starhold.certification.certificate import write
from starhold.certification.station import certify_station, described_station
from starhold.checker import check, check_file, passed
from starhold.checker.exact import floating
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import POINTS, PRIMARIES
from tests.certification.by_hand import by_hand
from tests.certification.circles import BACK, BEST, PLANT, RELAY, SOFT, WIDE, loop_of, peak, station
from tests.certification.edits import changed, faults, holds_unrefuted, lists_are_exact, outcomes, with_kinds
from tests.making import point_loop

CLAIM, NUMBERS = ("certificates", 0, "claims", -1), ("certificates", 0, "claims", -1, "numbers")
SUBJECT = ("certificates", 0, "subject")


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """What the certifier writes, by gains, margin of the limit over what the circle needs, and kind of the limit."""
    path = tmp_path_factory.mktemp("stations") / "certificate.json"
    done = {}

    def make(gains=BEST, margin=math.inf, kind="norm", **changes):
        key = (gains, margin, kind, *sorted(changes.items()))
        if key not in done:
            loop = loop_of(gains, margin * peak(gains, kind, changes.get("plant", PLANT)), kind, **changes)
            write([certify_station(loop)], "made", path)
            assert [f for f in check_file(path) if f.verdict == "fails"] == []
            done[key] = path.read_text(encoding="utf-8")
        return json.loads(done[key])

    return make


# --- what holds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gains", "margin", "kind"),
    [
        (BEST, math.inf, "norm"),
        (BEST, 1.001, "norm"),
        (BEST, 1.05, "norm"),
        (BEST, 2.0, "norm"),
        (BEST, 1.05, "axis"),
        (BEST, 1.5, "axis"),
        (SOFT, 1.2, "norm"),
        (SOFT, 1.2, "axis"),
        (RELAY._replace(boundary_layer=1e-3, k=0.05), 1.02, "norm"),
        (RELAY._replace(boundary_layer=5.0), 1.3, "norm"),
        (WIDE, 1.05, "norm"),
        (WIDE, 1.3, "axis"),
        (BACK, 1.3, "norm"),
        (BEST._replace(alpha=0.1, k=3.0, radius=0.3), 1.05, "norm"),
        (BEST._replace(radius=1e-4), 1.2, "norm"),
        (BEST._replace(radius=1e3, alpha=1e-6), 1.2, "norm"),
    ],
)
def test_what_the_certifier_claims_holds(made, gains, margin, kind):
    content = made(gains, margin, kind)
    proved = {"circle": "proved"} | ({} if math.isinf(margin) else {"control-limit": "proved"})
    assert outcomes(content) == proved
    assert {f.verdict for f in check(content)} == {"holds"}


@pytest.mark.parametrize("gains", [BEST, SOFT])
def test_the_full_problem_holds_with_its_feed_forward(made, gains):
    content = made(gains._replace(model=1), model="nonlinear")
    assert outcomes(content) == {"circle": "proved"}
    assert {f.verdict for f in check(content)} == {"holds"}


@pytest.mark.parametrize("name", sorted(PRIMARIES))
def test_all_points_are_read(name):
    for point in POINTS:
        plant = PRIMARIES[name].point(point)
        assert floating(station(plant=plant).plant.stiffness) == plant.stiffness


def test_other_laws_are_read_and_claim_no_circle(made):
    content = made()
    for law in catalogue("libration-point").values():
        for gains in law.examples():
            loop = point_loop(PLANT, law, gains, loop_of().start, 1e-3)
            other = changed(content, SUBJECT, json.loads(json.dumps(described_station(loop))))
            if law.name != "l2-circle":
                assert "makes no circle attractive" in " ".join(faults(other).values())
            other["certificates"][0] |= {"claims": [], "kinds": [], "outcome": "undecided"}
            assert {f.verdict for f in check(other)} == {"not claimed"}


# --- what fails -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gains", "margin", "kind"),
    [
        (BEST, math.inf, "norm"),
        (BEST, 1.2, "norm"),
        (BEST, 1.2, "axis"),
        pytest.param(SOFT, 1.3, "norm", marks=pytest.mark.slow),
        (WIDE, 1.05, "norm"),
    ],
)
def test_a_number_that_says_more_fails(made, gains, margin, kind):
    content = made(gains, margin, kind)
    numbers = content["certificates"][0]["claims"][-1]["numbers"]
    limited = not math.isinf(margin)
    for key, share, where_ in (
        ("level", 1.15 if limited else 1.0001, "control" if limited else "centre outside"),
        ("inner", 0.9999, ""),
        ("outer", 1.0001, ""),
        ("velocity", 1.0001, ""),
        *([("limit", 0.96, "control"), ("limit", 1.0001, "control")] if limited else []),
    ):
        more = changed(content, (*NUMBERS, key), numbers[key] * share)
        assert (outcomes(content).popitem()[0], where_) in faults(more), (key, share)
        for value in (-1.0, 0.0, 1e9, None, math.inf, "1", True):
            # A circle of radius zero or beyond the outer one is more too; a smaller error of the velocity is not.
            if (key, value) != ("velocity", 0.0):
                assert faults(changed(content, (*NUMBERS, key), value)), (key, value)
    assert faults(changed(content, (*NUMBERS, "inner"), gains.radius * 1.01))
    assert faults(changed(content, (*NUMBERS, "outer"), gains.radius * 0.99))
    if limited:
        assert faults(changed(content, (*NUMBERS, "kind"), "axis" if kind == "norm" else "norm"))
        assert faults(changed(content, (*NUMBERS, "kind"), "none"))


@pytest.mark.parametrize(("gains", "margin"), [(BEST, 1.2), (SOFT, math.inf)])
def test_obligations_and_assumptions_are_those_of_the_claim(made, gains, margin):
    whole = made(gains, margin)
    for told in whole["certificates"][0]["claims"]:
        # One claim is enough to see whether that claim fails.
        content = with_kinds(changed(whole, ("certificates", 0, "claims"), [told]))
        # The limit alone proves nothing of where the motion ends.
        content["certificates"][0]["outcome"] = "proved" if told["kind"] == "circle" else "undecided"
        assert faults(content) == {}
        place = ("certificates", 0, "claims", 0)
        lists_are_exact(content, place, {"name": "target", "how": "certified roots", "evidence": {"state": 1}})
        assert faults(changed(content, (*place, "witness"), {"epsilon": 1.0}))
        assert faults(changed(content, (*place, "kind"), "region"))


def test_a_claim_of_the_other_kind_fails(made):
    content = made(BEST, 1.2)
    circle, limit = content["certificates"][0]["claims"]
    for one, other in ((circle, limit), (limit, circle)):
        renamed = copy.deepcopy(content)
        renamed["certificates"][0]["claims"] = [{**one, "kind": other["kind"]}]
        assert faults(with_kinds(renamed))
    attitude = by_hand("lyapunov", {"k_attitude": 0.1, "k_rate": 0.5}, [circle])
    assert "there is no kind of claim circle about such a loop" in faults(attitude).values()


@pytest.mark.parametrize(
    ("key", "value", "failing"),
    [
        (("gains", "radius"), 1.1, ("circle", "")),
        (("gains", "radius"), 0.9, ("circle", "centre outside")),
        (("gains", "rate"), 0.0, ("circle", "only the circle")),
        (("gains", "rate"), 1.8, ("control-limit", "control")),
        (("gains", "alpha"), 0.9, ("circle", "centre outside")),
        (("gains", "alpha"), 1.1, ("circle", "")),
        (("gains", "k"), 2.5, ("control-limit", "control")),
        (("gains", "k"), -1.0, ("", "")),
        (("gains", "k_x"), 8.8, ("circle", "x returns")),
        (("gains", "k_velocity"), 0.0, ("", "")),
        (("gains", "feedback"), "relay", ("circle", "only the circle")),
        (("gains", "feedback"), 1, ("", "")),
        (("gains", "boundary_layer"), -1.0, ("", "")),
        (("gains", "model"), "nonlinear", ("circle", "form")),
        (("gains", "other"), 1.0, ("", "")),
        (("model",), "nonlinear", ("circle", "")),
        (("model",), "other", ("", "")),
        (("law",), "l2-equilibrium", ("", "")),
        (("law",), "lyapunov", ("", "")),
        (("limit",), "axis", ("control-limit", "control")),
        (("limit",), "none", ("control-limit", "control")),
        (("control_limit",), None, ("control-limit", "control")),
        (("control_limit",), 4.0, ("control-limit", "control")),
        (("control_limit",), -1.0, ("", "")),
        (("control_period",), 0.0, ("", "")),
        (("lag",), -1.0, ("", "")),
        (("lag",), None, ("", "")),
        (("inertia",), 1.0, ("", "")),
        *[(("plant", name), 1.01 * getattr(PLANT, name), ("", "")) for name in PLANT._fields],
        *[(("plant", name), 0.0, ("", "")) for name in PLANT._fields],
        (("plant", "moon"), 1.0, ("", "")),
        (("plant",), {**PRIMARIES["sun-earth"].point("L1")._asdict()}, ("control-limit", "control")),
    ],
)
def test_the_claims_are_about_this_loop(made, key, value, failing):
    assert failing in faults(changed(made(BEST, 1.2), (*SUBJECT, *key), value))


def test_a_relay_without_a_layer_is_not_claimed(made):
    content = made(SOFT, 1.2)
    bare = changed(content, (*SUBJECT, "gains", "boundary_layer"), 0.0)
    assert {("circle", "only the circle"), ("control-limit", "only the circle")} <= set(faults(bare))


# --- refutations ------------------------------------------------------------------------------------------------------


def refuted(content, name):
    claim = next(c for c in content["certificates"][0]["claims"] if c["outcome"] == "refuted")
    assert [o["name"] for o in claim["obligations"] if o["outcome"] == "refuted"] == [name]
    return content["certificates"][0]["claims"].index(claim), next(
        k for k, o in enumerate(claim["obligations"]) if o["name"] == name
    )


@pytest.mark.parametrize(("gains", "kind"), [(BEST, "norm"), (BEST, "axis"), (SOFT, "norm"), (BACK, "norm"), (WIDE, "axis")])
def test_a_deficit_must_be_one(made, gains, kind):
    content = made(gains, 0.95, kind)
    claim, spot = refuted(content, "control")
    evidence = ("certificates", 0, "claims", claim, "obligations", spot, "evidence")
    assert not passed(check(changed(content, (*SUBJECT, "control_limit"), 2.0 * peak(gains, kind))))
    told = content["certificates"][0]["claims"][claim]["obligations"][spot]["evidence"]
    enough = changed(content, (*SUBJECT, "control_limit"), 1.05 * peak(gains, kind))
    assert not passed(
        check(changed(enough, ("certificates", 0, "claims", claim, "numbers", "limit"), 1.05 * peak(gains, kind)))
    )
    for turns in (math.pi, -math.pi):
        # The circle needs the same on the other side.
        assert passed(check(changed(content, (*evidence, "angle"), told["angle"] + turns)))
    for key, value in (("angle", told["angle"] + 0.25 * math.pi), ("control", 1.01 * told["control"]), ("state", 1.0)):
        assert not passed(check(changed(content, (*evidence, key), value))), key
    assert not passed(check(changed(content, evidence, {})))


def test_another_circle_must_be_held(made):
    content = made(RELAY)
    claim, spot = refuted(content, "only the circle")
    evidence = ("certificates", 0, "claims", claim, "obligations", spot, "evidence")
    told = content["certificates"][0]["claims"][claim]["obligations"][spot]["evidence"]

    def held(r, **more):
        needs = 2.0 * RELAY.alpha * abs(r * r - 1.0) * r
        return passed(check(changed(content, evidence, {"radius": r, "needs": needs, "of": RELAY.k} | more)))

    assert held(told["radius"])
    # 2 (r^2 - 1) r = 0.3 at r = 1.0680 and 0.9143.
    assert held(1.0679)
    assert held(0.9144)
    assert not held(1.0681)
    assert not held(0.9142)
    # So near the centre it takes little again, but nearer circles are not held.
    assert not held(0.1)
    for wrong in (1.0, 0.0, -1.05):
        assert not held(wrong)
    assert not held(1.05, of=0.4)
    assert not held(1.05, needs=0.1)
    assert not held(1.05, control=0.1)
    for key, value in (("feedback", "smooth"), ("boundary_layer", 0.1), ("k", 0.1), ("model", "nonlinear")):
        assert not passed(check(changed(content, (*SUBJECT, "gains", key), value)))


def test_what_does_not_return_along_x_is_refuted(made):
    content = made(BEST._replace(k_x=8.0))
    refuted(content, "x returns")
    assert not passed(check(changed(content, (*SUBJECT, "gains", "k_x"), 9.0)))
    # Nothing refutes what holds.
    other = made()
    holds_unrefuted(other, 0, ("form", "descent", "only the circle", "centre outside", "x returns"))


@pytest.mark.parametrize(
    ("gains", "change"),
    [
        (RELAY, {"radius": 1000.0}),
        (RELAY, {"k": 3e-51}),
        (RELAY, {"radius": 1e-150, "k": 3e199}),
        (BEST, {"radius": 1e-150}),
        (BEST, {"radius": 1e200}),
        (SOFT, {"k": 1e-300}),
    ],
)
def test_gains_of_any_size_end_in_what_the_checker_takes(tmp_path, gains, change):
    write([certify_station(loop_of(gains._replace(**change), 1.0))], "made", tmp_path / "c.json")
    assert [f for f in check_file(tmp_path / "c.json") if f.verdict == "fails"] == []
