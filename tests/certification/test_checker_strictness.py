"""No certificate says more than was proved, and none leaves out what is shown, without being caught."""

import copy
import json
import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as some

from starhold.certification.certificate import write
from starhold.certification.certify import certify
from starhold.checker import check, passed
from tests.certification.edits import alone, claims_of, content_at, edited, replaced, spots
from tests.certification.loops import loop_of, textbook

UP, DOWN = 1.0 + 1e-4, 1.0 - 1e-4

# --- every number in the stronger direction ---------------------------------------------------------------------------

STRONGER = [
    ("lqr-II-uneven", "hysteresis", "convergence", ("level", "start", "slew_angle"), UP),
    ("lqr-I", "shortest", "convergence", ("level", "start", "slew_angle", "rate"), UP),
    ("pd-0", "shortest", "convergence", ("level", "start", "slew_angle", "rate"), UP),
    ("lqr-I", "hysteresis", "convergence", ("level", "start", "rate", "rate_everywhere"), UP),
    ("lqr-I", "as_published", "torque-limit", ("level", "start", "slew_angle", "rate", "limit"), UP),
    ("pd-0", "as_published", "torque-limit", ("level", "start", "slew_angle", "rate", "limit"), UP),
    ("pd-2", "as_published", "torque-limit", ("limit",), DOWN),
    ("lqr-III", "as_published", "disturbance", ("torque", "level", "start", "slew_angle", "rate_start"), UP),
    ("lqr-III", "as_published", "disturbance", ("torque", "angle", "rate"), DOWN),
    ("pd-0", "hysteresis", "disturbance", ("torque", "level", "start", "slew_angle", "rate_start", "rate_everywhere"), UP),
    ("pd-2", "shortest", "disturbance", ("torque", "level", "start", "slew_angle", "rate_start"), UP),
    ("lqr-I", "hysteresis", "inertia", ("start",), UP),
    ("lqr-I", "shortest", "inertia", ("start", "slew_angle"), UP),
    ("lqr-I", "shortest", "inertia", ("rate",), 1.5),
    ("lqr-I", "as_published", "sampling", ("period", "longest"), UP),
    ("lqr-I", "as_published", "sampling", ("period", "radius"), DOWN),
    ("sliding-1", "as_published", "sliding", ("margin",), UP),
    ("sliding-1", "as_published", "sliding", ("surface", "angle", "rate"), DOWN),
    ("sliding-1", "shortest", "sliding", ("margin", "start", "slew_angle", "rate_start"), UP),
    ("sliding-0", "hysteresis", "sliding", ("margin", "start", "slew_angle", "rate_start"), UP),
]


@pytest.mark.parametrize(("name", "sign_policy", "kind", "keys", "factor"), STRONGER)
def test_a_number_that_says_more_fails(made, name, sign_policy, kind, keys, factor):
    content = alone(made(name, sign_policy), kind)
    assert passed(check(content))
    for key in keys:
        changed = copy.deepcopy(content)
        numbers = claims_of(changed)[kind]["numbers"]
        assert numbers[key] is not None, key
        numbers[key] = min(numbers[key] * factor, 2.0 * math.pi * UP) if key == "slew_angle" else numbers[key] * factor
        assert not passed(check(changed)), key


TOLD = {
    "pd-2": "shortest",
    "lqr-I": "",
    "lqr-II-uneven": "hysteresis",
    "lyapunov-0": "as_published",
    "sliding-1": "shortest",
}
"""The policy of each loop that is not slow, so that each policy and each law is there once."""


@pytest.mark.parametrize(
    ("name", "sign_policy"),
    [
        pytest.param(name, policy, marks=() if policy == told else pytest.mark.slow)
        for name, told in TOLD.items()
        for policy in ("as_published", "shortest", "hysteresis")
    ],
)
def test_a_bound_that_is_dropped_or_a_witness_that_is_not_one_fails(made, name, sign_policy):
    whole = made(name, sign_policy, 1e-6)
    for kind, claim in claims_of(whole).items():
        if claim["outcome"] != "proved":
            continue
        content = alone(whole, kind)
        unbound = {"numbers": ("level", "start", "rate", "tolerance", "rate_start"), "witness": ("level",)}
        for part, keys in unbound.items():
            for key in keys:
                if claim[part].get(key) is not None:
                    assert not passed(check(edited(content, (kind, part, key), None))), (kind, key)
        for key in ("epsilon", "rho", "tau", "beta"):
            if claim["witness"].get(key):
                for value in (0.0, -claim["witness"][key], 1e9 * claim["witness"][key]):
                    assert not passed(check(edited(content, (kind, "witness", key), value))), (kind, key)
        if "everything" in claim["numbers"]:
            flag = not claim["numbers"]["everything"]
            assert not passed(check(edited(content, (kind, "numbers", "everything"), flag))), kind


def test_every_step_towards_the_end_is_needed_and_checked(made):
    content = alone(made("pd-0", disturbance=1e-4), "disturbance")
    steps = claims_of(content)["disturbance"]["witness"]["steps"]
    assert passed(check(content))
    assert len(steps) > 2
    for place in range(len(steps)):
        assert not passed(check(edited(content, ("disturbance", "witness", "steps"), steps[:place] + steps[place + 1 :])))
    path, step = ("disturbance", "witness", "steps", 1), steps[1]
    for key in ("decay", "spread"):
        for factor in (0.0, -1.0, 0.5, 2.0):
            assert not passed(check(edited(content, (*path, key), step[key] * factor))), key
    for factor in (-1.0, 1.0 - 1e-4, 1.0 + 1e-4):
        assert not passed(check(edited(content, (*path, "form"), [[x * factor for x in row] for row in step["form"]])))
    skew = copy.deepcopy(step["form"])
    skew[0][1] += 1e-9 * abs(skew[0][0])
    assert not passed(check(edited(content, (*path, "form"), skew)))
    # Without any shift the gyroscopic torque is bounded too widely, with another one wider still.
    for shift in (None, 0.0, 1e3):
        assert not passed(check(edited(content, ("disturbance", "witness", "shift"), shift)))


def test_the_bound_of_the_gyroscopic_torque_is_checked(tmp_path):
    loop = textbook()["lyapunov-0"]
    write([certify(loop_of("lyapunov", loop.gains, loop.craft, limit="norm"))], "made", tmp_path / "c.json")
    content = alone(json.loads((tmp_path / "c.json").read_text(encoding="utf-8")), "torque-limit")
    witness = claims_of(content)["torque-limit"]["witness"]
    assert passed(check(content))
    for key, values in (("shift", (None, 0.0, 1.0)), ("weight", (None, 0.0, -witness["weight"], 1e3))):
        for value in values:
            assert not passed(check(edited(content, ("torque-limit", "witness", key), value))), (key, value)


# --- the list of what is shown ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["pd-2", "lqr-II-uneven", "lyapunov-0", "sliding-1"])
def test_obligations_and_assumptions_are_exactly_those_needed(made, name):
    whole = made(name, disturbance=1e-6)
    for kind, claim in claims_of(whole).items():
        content = alone(whole, kind)
        spots = range(len(claim["obligations"]))
        for place in spots:
            for change in (
                lambda o, p: o.pop(p),
                lambda o, p: o.insert(p, copy.deepcopy(o[p])),
                lambda o, p: o[p].update(name="torque not felt"),
                lambda o, p: o[p].update(how="inspection"),
                lambda o, p: o[p].update(outcome="refuted"),
                lambda o, p: o[p].update(outcome="undecided"),
                lambda o, p: o[p].update(outcome="holds"),
                lambda o, p: o[p].update(evidence={"reason": "seen"}),
                lambda o, p: o[p].update(note=1),
                lambda o, p: o[p].pop("how"),
            ):
                changed = copy.deepcopy(content)
                change(claims_of(changed)[kind]["obligations"], place)
                assert not passed(check(changed)), (kind, place)
        changed = copy.deepcopy(content)
        claims_of(changed)[kind]["obligations"].reverse()
        assert not passed(check(changed))
        for place in range(len(claim["assumptions"])):
            changed = copy.deepcopy(content)
            del claims_of(changed)[kind]["assumptions"][place]
            assert not passed(check(changed)), (kind, place)
        for outcome in ("refuted", "undecided", "holds"):
            assert not passed(check(edited(content, (kind, "outcome"), outcome)))
    for outcome in ("refuted", "undecided", "holds"):
        changed = copy.deepcopy(whole)
        changed["certificates"][0]["outcome"] = outcome
        assert not passed(check(changed))


def told_apart(content, path):
    """The content with the one claim that the path is in, which is enough to see whether that fails, and the path there."""
    if path[:3] != ("certificates", 0, "claims") or len(path) < 5:
        return content, path
    return alone(content, content["certificates"][0]["claims"][path[3]]["kind"]), (*path[:3], 0, *path[4:])


@pytest.mark.parametrize(
    ("name", "sign_policy"), [("pd-2", "as_published"), ("lqr-II-uneven", "hysteresis"), ("sliding-1", "shortest")]
)
def test_a_claim_told_apart_holds(made, name, sign_policy):
    content = made(name, sign_policy, 1e-6)
    for place in range(len(content["certificates"][0]["claims"])):
        assert passed(check(told_apart(content, ("certificates", 0, "claims", place, "numbers"))[0])), place


@settings(max_examples=40)
@given(some.data())
def test_nothing_can_be_taken_away_or_be_of_another_type(made, data):
    content = made(data.draw(some.sampled_from(["pd-2", "lqr-II-uneven", "sliding-1"])), disturbance=1e-6)
    path = data.draw(some.sampled_from(list(spots(content))))
    # Versions are told, not claimed.
    assume("versions" not in path)
    content, path = told_apart(content, path)
    assert not passed(check(replaced(content, path, lambda spot, key: spot.pop(key))))
    other = data.draw(some.sampled_from([[], {}, "x", True, math.nan, math.inf, -math.inf, {"x": None}, 10**400]))
    text = path[-1] in ("scenario", "name") and other == "x" and "obligations" not in path
    flag = isinstance(other, bool) and other is content_at(content, path)
    assume(not text and not flag and other != content_at(content, path))
    # Whether there is a gravity gradient to bound is for the subject to say; bounds without one are as good.
    assume(path[-1] != "gravity_gradient")
    assert not passed(check(replaced(content, path, lambda spot, key: spot.__setitem__(key, other))))


@settings(max_examples=40)
@given(some.data())
def test_no_number_makes_the_checker_stumble(made, data):
    content = made(data.draw(some.sampled_from(["pd-2", "lqr-I", "sliding-1"])), "hysteresis", 1e-6)
    numbers = [p for p in spots(content) if type(content_at(content, p)) is float]
    path = data.draw(some.sampled_from(numbers))
    value = data.draw(some.floats(allow_nan=False, allow_infinity=False) | some.sampled_from([0.0, 5e-324, 1e308, -1.0]))
    content, path = told_apart(content, path)
    check(replaced(content, path, lambda spot, key: spot.__setitem__(key, value)))
