"""The checker: what it accepts, and what of another loop it does not."""

import json
import math

import numpy as np
import pytest

from starhold.certification.certificate import write
from starhold.certification.certify import Wanted, certify
from starhold.checker import check, check_file, passed
from starhold.laws.sliding import Gains as Sliding
from tests.certification.by_hand import HOWS, PD, SPUN, TEXTBOOK, by_hand, converging, proved_by_hand
from tests.certification.edits import claims_of, edited, reasons
from tests.certification.loops import FULL, LOPSIDED, PRINCIPAL, loop_of, textbook
from tests.making import ORBITAL, aimed

LOOPS = textbook()
NAMES = sorted(LOOPS)


# --- what holds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign_policy", ["as_published", "shortest", "hysteresis"])
@pytest.mark.parametrize("name", NAMES)
def test_what_the_certifier_proves_holds(made, name, sign_policy):
    content = made(name, sign_policy)
    found = check(content)
    assert passed(found), [f for f in found if f.verdict == "fails"]
    for claim in content["certificates"][0]["claims"]:
        if claim["outcome"] == "proved":
            held = [f.obligation for f in found if f.claim == claim["kind"] and f.verdict == "holds"]
            assert [o["name"] for o in claim["obligations"]] == [name for name in held if name]


@pytest.mark.parametrize(
    ("target", "limit", "sign_policy"),
    [
        # Each target, limit and policy once; the other pairs are slow.
        pytest.param(target, limit, policy, marks=pytest.mark.slow if place != number else ())
        for place, (target, limit) in enumerate(
            [(ORBITAL, "axis"), (ORBITAL, "norm"), (aimed((1.0, 0.0, 0.0, 0.0)), "norm")]
        )
        for number, policy in enumerate(["hysteresis", "as_published", "shortest"])
    ],
)
def test_moving_targets_and_limits_of_the_norm(tmp_path, sign_policy, target, limit):
    # One clipped, one with a gyroscopic torque, one that slides: each other law has one of these terms or none.
    chosen = [LOOPS[name] for name in ("pd-2", "lqr-I", "sliding-1")]
    loops = [loop_of(o.law.name, o.gains, o.craft, sign_policy=sign_policy, target=target, limit=limit) for o in chosen]
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
    shorter = converging("single equilibrium in the set", **low)
    assert passed(check(by_hand("pd", PD, [shorter], quaternion_sign="shortest", **changes)))


def test_false_claims_written_by_hand():
    everything = converging()
    # The feedback switches at q0 = 0, which V = s bounds.
    assert reasons(by_hand("pd", PD, [converging("single equilibrium in the set")], quaternion_sign="shortest"))
    wide = {"level": 0.019, "start": 0.019, "everything": False, "slew_angle": 2.9, "rate": 0.05}
    assert reasons(by_hand("pd", PD, [converging("single equilibrium in the set", **wide)], quaternion_sign="shortest"))
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
    names = [(n, HOWS[n]) for n in ("form", "positive", "descent", "target", "only equilibrium", "other equilibrium repels")]
    numbers = {**converging()["numbers"], "limit": 0.05, "kind": "axis"}
    told = [a for a in TEXTBOOK if a != "torque not limited"]
    witness = {**converging()["witness"], "shift": None, "weight": None}
    claim = proved_by_hand("torque-limit", [*names, ("torque", "ball arithmetic")], numbers, witness, told)
    assert passed(check(by_hand("pd", clipped, [converging(), claim], torque_limit=0.05)))
    assert reasons(by_hand("pd", PD, [converging(), claim], torque_limit=0.05))
    assert reasons(by_hand("pd", clipped, [converging(), claim], torque_limit=0.05, limit="norm"))
    assert reasons(by_hand("pd", clipped, [converging(), claim], torque_limit=0.004))
    assert reasons(by_hand("pd", clipped, [converging(), claim], torque_limit=None))


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
