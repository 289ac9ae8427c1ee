"""The checker: what it accepts, and that no certificate says more than was proved without being caught."""

import ast
import copy
import json
import math
from functools import cache
from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from flint import fmpq
from hypothesis import assume, given, settings
from hypothesis import strategies as some

import starhold.checker as checker
from starhold.certification.certificate import write
from starhold.certification.certify import Wanted, certify
from starhold.checker import check, check_file, passed
from starhold.checker import exact as checking
from starhold.checker.reading import in_time, limited
from starhold.checker.subject import variables
from starhold.checker.torque import SHAPES, keeps_below
from starhold.errors import InputError
from starhold.laws import pd
from starhold.laws.sliding import Gains as Sliding
from tests.certification.loops import FULL, LOPSIDED, PRINCIPAL, loop_of, textbook
from tests.making import ORBITAL

LOOPS = textbook()
NAMES = sorted(LOOPS)
UP, DOWN = 1.0 + 1e-4, 1.0 - 1e-4
TEXTBOOK = (
    "rigid body",
    "inertia exactly as given",
    "exact measurement and ideal actuators",
    "torque applied continuously",
    "torque not limited",
    "no torque from outside but what the law cancels",
)


@cache
def _made(name, cover, disturbance, tmp):
    loop = LOOPS[name]
    loop = loop_of(loop.law.name, loop.gains, loop.craft, sign_policy=cover)
    path = Path(tmp) / f"{name}-{cover}-{disturbance}.json"
    write([certify(loop, name, Wanted(disturbance=disturbance))], "made", path)
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    folder = str(tmp_path_factory.mktemp("certificates"))
    return lambda name, sign_policy="as_published", disturbance=0.0: json.loads(
        _made(name, sign_policy, disturbance, folder)
    )


def claims_of(content):
    return {claim["kind"]: claim for claim in content["certificates"][0]["claims"]}


def alone(content, kind):
    """The same with one claim, which is enough to see whether that claim fails."""
    certificate = content["certificates"][0]
    claim = claims_of(content)[kind]
    # The linear loop alone proves nothing of where the motion ends.
    outcome = "undecided" if (kind, claim["outcome"]) == ("sampling", "proved") else claim["outcome"]
    return {**content, "certificates": [{**certificate, "outcome": outcome, "claims": [claim]}]}


def proved_by_hand(kind, names, numbers, witness, assumptions=TEXTBOOK):
    obligations = [{"name": name, "how": how, "outcome": "proved", "evidence": {}} for name, how in names]
    return {
        "kind": kind,
        "outcome": "proved",
        "numbers": numbers,
        "witness": witness,
        "assumptions": list(assumptions),
        "obligations": obligations,
    }


def by_hand(law, gains, claims, **changes):
    """A file with one certificate, written without the certifier."""
    subject = {
        "law": law,
        "gains": gains,
        "quaternion_sign": "as_published",
        "hysteresis_width": 0.5,
        "inertia": [[2.0, 0.1, 0.0], [0.1, 3.0, -0.25], [0.0, -0.25, 4.0]],
        "limit": "axis",
        "torque_limit": None,
        "orbit": None,
        "gravity_gradient": False,
        "target": "inertial",
        "history": None,
        "target_rate": 0.0,
        "target_acceleration": 0.0,
        "modelled_torque": [0.0, 0.0, 0.0],
        "modelled_torque_norm": 0.0,
        "disturbance": 0.0,
        "control_period": 0.25,
        "wheels": None,
        **changes,
    }
    outcome = "undecided" if [claim["kind"] for claim in claims] == ["sampling"] else "proved"
    certificate = {"name": law, "outcome": outcome, "subject": subject, "claims": claims}
    return {"format": "starhold certificate 1", "scenario": "hand", "versions": {}, "certificates": [certificate]}


HOWS = {
    "form": "exact identity",
    "positive": "exact inequality",
    "descent": "exact inequality",
    "target": "exact identity",
    "only rest": "LaSalle",
    "strict": "exact inequality",
    "single rest in the set": "exact inequality",
    "jumps lower V": "exact inequality",
    "other rest repels": "certified roots",
}


def converging(last="other rest repels", middle="only rest", **changes):
    names = [(n, HOWS[n]) for n in ("form", "positive", "descent", "target", middle, last)]
    numbers = {
        "level": None,
        "start": None,
        "slew_angle": 2.0 * math.pi,
        "rate": None,
        "rate_everywhere": None,
        "everything": True,
    }
    witness = {"stiffness": None, "epsilon": 0.0, "rho": 0.0, "rate_bound": None}
    numbers |= {k: v for k, v in changes.items() if k in numbers}
    witness |= {k: v for k, v in changes.items() if k in witness}
    return proved_by_hand("convergence", names, numbers, witness)


PD = {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}
SPUN = {"k_rate": [0.5, 0.6, 0.7], "k_attitude": [0.01, 0.02, 0.03], "gyroscopic": 0.0}


def reasons(content):
    return [finding.reason for finding in check(content) if finding.verdict == "fails"]


# --- what holds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cover", ["as_published", "shortest", "hysteresis"])
@pytest.mark.parametrize("name", NAMES)
def test_what_the_certifier_proves_holds(made, name, cover):
    content = made(name, cover)
    found = check(content)
    assert passed(found), [f for f in found if f.verdict == "fails"]
    for claim in content["certificates"][0]["claims"]:
        if claim["outcome"] == "proved":
            held = [f.obligation for f in found if f.claim == claim["kind"] and f.verdict == "holds"]
            assert [o["name"] for o in claim["obligations"]] == [name for name in held if name]


@pytest.mark.parametrize("cover", ["as_published", "shortest", "hysteresis"])
@pytest.mark.parametrize(("target", "limit"), [("orbital", "axis"), ("orbital", "norm"), ((1.0, 0.0, 0.0, 0.0), "norm")])
def test_moving_targets_and_limits_of_the_norm(tmp_path, cover, target, limit):
    chosen = [LOOPS[name] for name in ("pd-0", "pd-2", "lyapunov-0", "lqr-I", "sliding-1")]
    loops = [loop_of(o.law.name, o.gains, o.craft, sign_policy=cover, target=target, limit=limit) for o in chosen]
    write([certify(loop) for loop in loops], "made", tmp_path / "c.json")
    found = check_file(tmp_path / "c.json")
    assert passed(found), [f for f in found if f.verdict == "fails"]
    assert {f.claim for f in found if f.verdict == "holds"} >= {"convergence", "sliding", "sampling"}


@pytest.mark.parametrize("inertia", [[[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]], None])
def test_a_certificate_written_by_hand(inertia):
    changes = {} if inertia is None else {"inertia": inertia}
    assert passed(check(by_hand("pd", PD, [converging()], **changes)))
    assert passed(check(by_hand("lyapunov", {"k_rate": 0.09, "k_attitude": 0.009}, [converging()], **changes)))
    jumping = converging("jumps lower V")
    assert passed(check(by_hand("pd", PD, [jumping], quaternion_sign="hysteresis", **changes)))
    low = {"level": 0.017, "start": 0.017, "everything": False, "slew_angle": 2.9, "rate": 0.05}
    shorter = converging("single rest in the set", **low)
    assert passed(check(by_hand("pd", PD, [shorter], quaternion_sign="shortest", **changes)))


def test_false_claims_written_by_hand():
    everything = converging()
    # The feedback switches at q0 = 0, which V = s bounds.
    assert reasons(by_hand("pd", PD, [converging("single rest in the set")], quaternion_sign="shortest"))
    wide = {"level": 0.019, "start": 0.019, "everything": False, "slew_angle": 2.9, "rate": 0.05}
    assert reasons(by_hand("pd", PD, [converging("single rest in the set", **wide)], quaternion_sign="shortest"))
    # Unequal stiffness and gyroscopic torque leave a cubic term in V'.
    assert reasons(by_hand("lqr", SPUN, [everything]))
    assert reasons(by_hand("matrix-pd", {k: SPUN[k] for k in ("k_rate", "k_attitude")}, [everything]))
    # Negative damping, no damping, negative stiffness, stiffness of one axis only.
    negative = [[0.1, 0.0, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.1]]
    for k_rate, k_attitude in ((-0.1, 0.1), (0.0, 0.1), (0.1, -0.1), (negative, 0.1), (0.1, negative)):
        assert reasons(by_hand("matrix-pd", {"k_rate": k_rate, "k_attitude": k_attitude}, [everything]))
    assert passed(check(by_hand("matrix-pd", {"k_rate": 0.1, "k_attitude": 0.1}, [everything])))


def test_a_skew_stiffness_may_attract_the_other_rest():
    # The symmetric part is definite, but the linear loop has roots that the skew part moves.
    skew = [[0.01, 0.2, 0.0], [-0.2, 0.01, 0.0], [0.0, 0.0, 0.01]]
    assert reasons(by_hand("matrix-pd", {"k_rate": 0.1, "k_attitude": skew}, [converging()]))


def test_a_clipped_damping_must_leave_the_stiffness_its_torque():
    clipped = {**PD, "limit": "axis"}
    names = [(n, HOWS[n]) for n in ("form", "positive", "descent", "target", "only rest", "other rest repels")]
    numbers = {**converging()["numbers"], "limit": 0.05, "kind": "axis"}
    told = [a for a in TEXTBOOK if a != "torque not limited"]
    witness = {**converging()["witness"], "shift": None, "weight": None}
    claim = proved_by_hand("torque-limit", [*names, ("torque", "ball arithmetic")], numbers, witness, told)
    assert passed(check(by_hand("pd", clipped, [converging(), claim], torque_limit=0.05)))
    assert reasons(by_hand("pd", PD, [converging(), claim], torque_limit=0.05))
    assert reasons(by_hand("pd", clipped, [converging(), claim], torque_limit=0.05, limit="norm"))
    assert reasons(by_hand("pd", clipped, [converging(), claim], torque_limit=0.004))
    assert reasons(by_hand("pd", clipped, [converging(), claim], torque_limit=None))


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


@pytest.mark.parametrize(("name", "cover", "kind", "keys", "factor"), STRONGER)
def test_a_number_that_says_more_fails(made, name, cover, kind, keys, factor):
    content = made(name, cover)
    assert passed(check(content))
    for key in keys:
        changed = copy.deepcopy(alone(content, kind))
        numbers = claims_of(changed)[kind]["numbers"]
        assert numbers[key] is not None, key
        numbers[key] = min(numbers[key] * factor, 2.0 * math.pi * UP) if key == "slew_angle" else numbers[key] * factor
        assert not passed(check(changed)), key


@pytest.mark.parametrize(
    "name", ["pd-2", pytest.param("lqr-I", marks=pytest.mark.slow), "lqr-II-uneven", "lyapunov-0", "sliding-1"]
)
def test_a_bound_that_is_dropped_or_a_witness_that_is_not_one_fails(made, name):
    for cover in ("as_published", "shortest", "hysteresis"):
        whole = made(name, cover, 1e-6)
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
    loop = LOOPS["lyapunov-0"]
    write([certify(loop_of("lyapunov", loop.gains, loop.craft, limit="norm"))], "made", tmp_path / "c.json")
    content = alone(json.loads((tmp_path / "c.json").read_text(encoding="utf-8")), "torque-limit")
    witness = claims_of(content)["torque-limit"]["witness"]
    assert passed(check(content))
    for key, values in (("shift", (None, 0.0, 1.0)), ("weight", (None, 0.0, -witness["weight"], 1e3))):
        for value in values:
            assert not passed(check(edited(content, ("torque-limit", "witness", key), value))), (key, value)


def edited(content, place, value):
    changed = copy.deepcopy(content)
    kind, *path = place
    spot = claims_of(changed)[kind] if kind else changed["certificates"][0]["subject"]
    for key in path[:-1]:
        spot = spot[key]
    spot[path[-1]] = value
    return changed


# --- another loop -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_other_gains_or_another_inertia_fail(made, name):
    content = made(name)
    subject = content["certificates"][0]["subject"]

    def turned(value):
        return [turned(v) for v in value] if isinstance(value, list) else -value

    for gain, value in subject["gains"].items():
        if not isinstance(value, str) and np.any(value) and gain != "boundary_layer":
            assert not passed(check(edited(content, ("", "gains", gain), turned(value)))), gain
    if "sampling" in claims_of(content):
        inertia = (np.array(subject["inertia"]) * 1.05).tolist()
        assert not passed(check(edited(content, ("", "inertia"), inertia)))


def test_an_inertia_that_no_body_has_fails(made):
    content = made("pd-0")
    for inertia in (
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]],
        [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        [[1.0, 0.0], [0.0, 1.0]],
    ):
        assert not passed(check(edited(content, ("", "inertia"), inertia)))


def test_bounds_over_the_orbit_are_recomputed(tmp_path):
    gains = LOOPS["pd-0"].gains
    write([certify(loop_of("pd", gains, FULL, target=ORBITAL))], "made", tmp_path / "c.json")
    content = json.loads((tmp_path / "c.json").read_text())
    subject = content["certificates"][0]["subject"]
    assert passed(check(content))
    for key in ("target_rate", "target_acceleration", "modelled_torque_norm"):
        assert subject[key] > 0.0
        assert not passed(check(edited(content, ("", key), subject[key] * (1.0 - 1e-6)))), key
    for axis in range(3):
        assert not passed(check(edited(content, ("", "modelled_torque", axis), subject["modelled_torque"][axis] * 0.999)))
    assert not passed(check(edited(content, ("", "orbit"), None)))
    # Lower orbits have more of all.
    lower = [0.9 * x for x in subject["orbit"]["position"]]
    assert not passed(check(edited(content, ("", "orbit", "position"), lower)))


def test_the_bounds_over_the_orbit_hold_on_it():
    """Along an eccentric orbit, integrated by Kepler's equation, no torque and no rate exceeds what must be claimed."""
    mu, a, e = 3.986e14, 9e6, 0.2
    inertia = np.array([[2.0, 0.1, 0.0], [0.1, 3.0, -0.25], [0.0, -0.25, 4.0]])
    perigee = a * (1.0 - e)
    h = math.sqrt(mu * a * (1.0 - e * e))
    anomalies = np.linspace(0.0, 2.0 * math.pi, 721)
    r = a * (1.0 - e * e) / (1.0 + e * np.cos(anomalies))
    rate, swing = h / r**2, np.abs(2.0 * mu * e * np.sin(anomalies) / r**3)
    n = np.random.default_rng(1).normal(size=(20_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    torque = 3.0 * mu / perigee**3 * np.cross(n, n @ inertia)
    orbit = {"position": [perigee, 0.0, 0.0], "velocity": [0.0, h / perigee, 0.0], "gravitational_parameter": mu}
    least = {
        "target_rate": float(rate.max()),
        "target_acceleration": float(swing.max()),
        "modelled_torque_norm": float(np.linalg.norm(torque, axis=1).max()),
        "modelled_torque": np.abs(torque).max(axis=0).tolist(),
    }
    setting = {"orbit": orbit, "gravity_gradient": True, "target": "orbital"}
    roomy = {key: [2.0 * x for x in v] if isinstance(v, list) else 2.0 * v for key, v in least.items()}
    assert passed(check(by_hand("pd", PD, [converging()], **setting, **roomy)))
    for key, value in least.items():
        short = {**roomy, key: [0.99 * x for x in value] if isinstance(value, list) else 0.99 * value}
        assert not passed(check(by_hand("pd", PD, [converging()], **setting, **short))), key


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


def spots(value, path=()):
    """The paths of all values in a file."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from spots(inner, (*path, key))


def replaced(content, path, change):
    changed = copy.deepcopy(content)
    spot = changed
    for key in path[:-1]:
        spot = spot[key]
    change(spot, path[-1])
    return changed


@settings(max_examples=40)
@given(some.data())
def test_nothing_can_be_taken_away_or_be_of_another_type(made, data):
    content = made(data.draw(some.sampled_from(["pd-2", "lqr-II-uneven", "sliding-1"])), disturbance=1e-6)
    path = data.draw(some.sampled_from(list(spots(content))))
    # Versions are told, not claimed, and without one of its claims a certificate says less.
    assume("versions" not in path)
    assume(path[-2:-1] != ("claims",))
    assert not passed(check(replaced(content, path, lambda spot, key: spot.pop(key))))
    other = data.draw(some.sampled_from([[], {}, "x", True, math.nan, math.inf, -math.inf, {"x": None}, 10**400]))
    text = path[-1] in ("scenario", "name") and other == "x" and "obligations" not in path
    flag = isinstance(other, bool) and other is content_at(content, path)
    assume(not text and not flag and other != content_at(content, path))
    # Whether there is a gravity gradient to bound is for the subject to say; bounds without one are as good.
    assume(path[-1] != "gravity_gradient")
    assert not passed(check(replaced(content, path, lambda spot, key: spot.__setitem__(key, other))))


def content_at(content, path):
    for key in path:
        content = content[key]
    return content


@settings(max_examples=40)
@given(some.data())
def test_no_number_makes_the_checker_stumble(made, data):
    content = made(data.draw(some.sampled_from(["pd-2", "lqr-I", "sliding-1"])), "hysteresis", 1e-6)
    numbers = [p for p in spots(content) if type(content_at(content, p)) is float]
    path = data.draw(some.sampled_from(numbers))
    value = data.draw(some.floats(allow_nan=False, allow_infinity=False) | some.sampled_from([0.0, 5e-324, 1e308, -1.0]))
    check(replaced(content, path, lambda spot, key: spot.__setitem__(key, value)))


def test_unknown_keys_fail_everywhere(made):
    content = made("pd-0")
    places = [(), ("certificates", 0), ("certificates", 0, "subject"), ("certificates", 0, "subject", "gains")]
    places += [("certificates", 0, "claims", 0, part) for part in ("numbers", "witness")]
    places += [("certificates", 0, "claims", 0), ("certificates", 0, "subject", "orbit")]
    for path in places:
        changed = copy.deepcopy(content)
        content_at(changed, path)["more"] = 1.0
        assert not passed(check(changed)), path


@pytest.mark.parametrize("content", [None, [], {}, 3, {"format": "starhold certificate 1"}])
def test_what_is_no_certificate_fails(content):
    assert not passed(check(content))


# --- files ------------------------------------------------------------------------------------------------------------


def test_a_file_that_cannot_be_read_is_the_users_error(tmp_path):
    with pytest.raises(InputError) as missing:
        check_file(tmp_path / "none.json")
    assert "\n" not in str(missing.value)
    for bad in (b"{", b"", b"\xff\xfe", b"[" * 100_000):
        (tmp_path / "bad.json").write_bytes(bad)
        with pytest.raises(InputError) as error:
            check_file(tmp_path / "bad.json")
        assert "\n" not in str(error.value)


def test_a_readable_file_with_a_fault_fails(tmp_path, made):
    content = made("pd-0")
    plain = json.dumps(content)
    path = tmp_path / "c.json"
    path.write_text(plain, encoding="utf-8")
    assert passed(check_file(path))
    twice = plain.replace('"scenario": "made"', '"scenario": "made", "scenario": "made"')
    period = f'"control_period": {content["certificates"][0]["subject"]["control_period"]}'
    assert period in plain
    texts = [twice, plain.replace(period, '"control_period": NaN'), plain.replace(period, '"control_period": 1e999')]
    for text in [*texts, plain.replace("certificate 1", "certificate 2"), "[]", "null", '"x"']:
        path.write_text(text, encoding="utf-8")
        assert not passed(check_file(path)), text[:60]


def test_limits_of_a_file_are_refused_each_with_its_line(tmp_path, made):
    path = tmp_path / "c.json"
    plain = made("pd-0")
    deep = inner = []
    for _ in range(900):
        inner.append([])
        inner = inner[0]
    for part in ("numbers", "witness"):
        (reason,) = reasons(edited(plain, ("convergence", part, "level"), deep))
        assert reason == "the file is nested more than 32 deep"
    for text, told in (("[" * 100_000, "nested more than 32 deep"), ('{"x": ' + "1" * 5000 + "}", "more than 1000 digits")):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=told):
            check_file(path)
    with pytest.raises(InputError, match="is larger than 64 MiB"):
        check_file("/dev/zero")


@pytest.mark.parametrize("name", ["\ud800", "a\x1b[31mb", "a\nb", "x" * 1001])
def test_a_name_that_cannot_be_written_fails(made, name):
    content = made("pd-0")
    content["certificates"][0]["name"] = name
    assert reasons(content) == ["the certificate has something else than it may under name"]


def test_a_check_that_takes_too_long_is_given_up():
    loads, half = [[fmpq(1)] * len(SHAPES)], fmpq(1, 2)
    ways = [([loads], [fmpq(0)] * len(SHAPES))]
    assert keeps_below(ways, fmpq(100), half, half)
    with limited(0.0), pytest.raises(checking.CheckError, match="takes longer than"):
        keeps_below(ways, fmpq(100), half, half)
    # What is part of something gets no more time than that.
    with limited(0.0), limited(60.0), pytest.raises(checking.CheckError):
        in_time()
    in_time()


@pytest.mark.parametrize("size", [1e-300, 1e-30, 1e30, 1e104])
def test_gains_of_any_size_are_certified_and_checked_in_time(tmp_path, size):
    loop = loop_of("pd", pd.Gains(0.09 * size, 0.009 * size), FULL)
    begun = monotonic()
    write([certify(loop)], "made", tmp_path / "c.json")
    assert passed(check_file(tmp_path / "c.json")), [f for f in check_file(tmp_path / "c.json") if f.verdict == "fails"]
    # It takes a second; without a limit of the digits the roots of the sampled loop alone took minutes.
    assert monotonic() - begun < 20.0


# --- refuted and undecided --------------------------------------------------------------------------------------------


def test_what_is_refuted_or_undecided_is_not_claimed(tmp_path):
    refuted = loop_of("sliding", Sliding((0.08, 0.08, 0.08), (1e-7, 5e-3, 5e-3), 0.0))
    design = loop_of("lqr", LOOPS["lqr-I"].law.design(PRINCIPAL, LOPSIDED), PRINCIPAL)
    slow = loop_of("pd", LOOPS["pd-0"].gains, FULL, period=1e3)
    for loop, wanted in ((refuted, Wanted()), (design, Wanted(rate=math.inf)), (slow, Wanted(slew_angle=3.0))):
        certificate = certify(loop, "one", wanted)
        assert certificate.outcome != "proved"
        write([certificate], "made", tmp_path / "c.json")
        found = check_file(tmp_path / "c.json")
        assert passed(found), [f for f in found if f.verdict == "fails"]
        unproved = {claim.kind for claim in certificate.claims if claim.outcome != "proved"}
        assert {f.claim for f in found if f.verdict == "not claimed"} == unproved
        assert not any(f.verdict == "holds" for f in found if f.claim in unproved)


# --- its mathematics --------------------------------------------------------------------------------------------------

ROOTS = some.lists(some.complex_numbers(max_magnitude=3.0, allow_nan=False), min_size=1, max_size=3)


def polynomial(roots):
    """Real coefficients, lowest first, of roots taken with their conjugates, exact."""
    found = np.poly([z for root in roots for z in (root, root.conjugate())]).real
    return [checking.rational(float(c)) for c in found[::-1]]


@given(ROOTS)
def test_rouths_array_knows_where_the_roots_are(roots):
    assume(all(abs(z.real) > 1e-3 and abs(abs(z) - 1.0) > 1e-3 for z in roots))
    assume(min((abs(a - b) for i, a in enumerate(roots) for b in roots[:i]), default=1.0) > 1e-2)
    assume(all(abs(z.imag) > 1e-2 for z in roots))
    found = polynomial(roots)
    assert checking.hurwitz(found) == all(z.real < 0.0 for z in roots)
    assert checking.within_circle(found, fmpq(1)) == all(abs(z) < 1.0 for z in roots)
    assert checking.saddle(found) == any(z.real > 0.0 for z in roots)
    for z in roots:
        near = checking.rational(z.real + 1e-7), checking.rational(z.imag)
        assert checking.has_root_near(found, *near, fmpq(1, 100))
    assert not checking.has_root_near(found, fmpq(100), fmpq(0), fmpq(1))


def test_roots_on_the_border_are_not_inside():
    one = fmpq(1)
    assert not checking.hurwitz([one, fmpq(0), one])
    assert not checking.saddle([one, fmpq(0), one])
    assert not checking.saddle([fmpq(0), one, -one])
    # (x2 + 1)(x - 1): a root on the right, and two on the imaginary axis.
    assert not checking.saddle([-one, one, -one, one])
    # x2 - 1, whose halves share a root that is not on the axis.
    assert checking.saddle([-one, fmpq(0), one])
    for border in (1, -1):
        assert not checking.within_circle([fmpq(-border), one], one)
    assert not checking.within_circle([one, fmpq(0), one], one)


@given(some.lists(some.integers(-9, 9), min_size=9, max_size=9), some.integers(-5, 5))
def test_minors_tell_definite_matrices(entries, shift):
    a = np.reshape(np.array(entries, dtype=float), (3, 3))
    a = a @ a.T + shift * np.eye(3)
    rows = [[checking.rational(x) for x in row] for row in a.tolist()]
    least, most = np.linalg.eigvalsh(a)[[0, -1]]
    if abs(least) > 1e-9:
        assert checking.definite(rows) == checking.definite(rows, strictly=False) == (least > 0.0)
    bound = checking.greatest(rows)
    assert most <= checking.floating(bound) + 1e-12 <= most + 1e-11 * max(1.0, abs(most))


def test_a_singular_matrix_is_not_negative():
    rows = [[fmpq(0), fmpq(0)], [fmpq(0), fmpq(1)]]
    assert not checking.definite(rows)
    assert checking.definite(rows, strictly=False)
    assert not checking.definite([[fmpq(0), fmpq(0)], [fmpq(0), fmpq(-1)]], strictly=False)


@given(some.lists(some.floats(0.0, 2.0), min_size=12, max_size=12), some.floats(0.1, 3.0), some.floats(0.1, 3.0))
def test_tangents_bound_the_torque_closely(numbers, level, s):
    loads = [[0.0, numbers[0], numbers[1], 0.0, 0.0, 0.0], [*numbers[2:8]], [*numbers[6:12]]]
    t = np.linspace(0.0, min(level, 2.0 * s), 20_001)
    squares = t / s * (2.0 - t / s), 2.0 * np.maximum(level - t, 0.0)
    shapes = np.array([np.sqrt(np.maximum(squares[0], 0.0)) ** p * np.sqrt(squares[1]) ** r for p, r in SHAPES])
    sums = np.array(loads) @ shapes
    most = float((sums[0] + np.hypot(sums[1], sums[2])).max())
    assume(most > 1e-3)
    common, *others = [[checking.rational(x) for x in load] for load in loads]
    bounds = checking.rational(level), checking.rational(s)
    assert keeps_below([([others], common)], checking.rational(most * (1.0 + 1e-5)), *bounds)
    assert not keeps_below([([others], common)], checking.rational(most * (1.0 - 1e-9)), *bounds)


@given(some.integers(-9, 9), some.integers(-9, 9), some.tuples(some.integers(-9, 9), some.integers(-9, 9)))
def test_what_falls_on_an_interval(linear, square, ends):
    low, high = (fmpq(end) for end in sorted(ends))
    for interval in ((low, high), (None, high), (low, None), (None, None)):
        first = -20.0 if interval[0] is None else float(int(low))
        last = 20.0 if interval[1] is None else float(int(high))
        y = np.linspace(first, last, 4001)
        expected = bool((linear * y + square * y * y)[y != 0.0].max(initial=-1.0) < 0.0)
        held = checking.falls(fmpq(linear), fmpq(square), interval)
        assert expected if held else True
        # Beyond the grid nothing changes unless the interval has no end.
        if None not in interval:
            assert held == expected or abs(linear) < 1e-9 or not expected


def test_duals_differentiate():
    x, y, dx, dy = variables(("x", "y", "dx", "dy"))
    a, b = checking.Dual(x, dx), checking.Dual(y, dy)
    found = (3.0 - a) * b * b / 2.0 + 1.0 - a
    assert not (found.value - ((3.0 - x) * y * y / 2.0 + 1.0 - x)).terms
    assert not (found.slope - ((3.0 - x) * y * dy - dx * y * y / 2.0 - dx)).terms
    with pytest.raises(checking.CheckError):
        a / b


# --- independence -----------------------------------------------------------------------------------------------------


def test_the_checker_imports_nothing_of_the_certifier():
    folder = Path(checker.__file__).parent
    own = list(folder.glob("*.py"))
    assert len(own) >= 9
    above = (
        "starhold.checker.",
        "starhold.algebra.",
        "starhold.parts.",
        "starhold.laws.",
        "starhold.errors",
    )
    for path in own:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [node.module] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for module in modules:
                assert not module.startswith("starhold") or module.startswith(above), module
