"""The checker: what it accepts, and what of another loop it does not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from starhold.certification.certificate import write
from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import differences
from starhold.certification.matrices import number
from starhold.certification.subject import make_subject
from starhold.checker import check, check_file, passed
from starhold.laws.sliding import Gains as Sliding
from starhold.parts.craft import make_craft, tensor
from tests.certification.loops import FULL, LOPSIDED, PRINCIPAL, loop_of, textbook
from tests.making import ORBITAL, aimed

LOOPS = textbook()
NAMES = sorted(LOOPS)
POLICIES = ("as_published", "shortest", "hysteresis")
FULL_OF_PRODUCTS = [[2.0, 0.1, 0.0], [0.1, 3.0, -0.25], [0.0, -0.25, 4.0]]


# --- what holds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "sign_policy"),
    [
        # Each law once, and each policy; the other pairs are slow.
        pytest.param(name, policy, marks=() if place % 3 == number else pytest.mark.slow)
        for place, name in enumerate(NAMES)
        for number, policy in enumerate(POLICIES)
    ],
)
def test_what_the_certifier_proves_holds(made, name, sign_policy):
    content = made(name, sign_policy)
    found = check(content)
    assert passed(found), [f for f in found if f.verdict == "fails"]
    for claim in content["certificates"][0]["claims"]:
        held = [f.obligation for f in found if f.claim == claim["kind"] and f.verdict == "holds"]
        assert bool(held) == (claim["outcome"] == "proved"), claim["kind"]


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


# --- another loop -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["pd-0", "lqr-I", "sliding-1", "wheel-0"])
def test_other_gains_or_another_inertia_are_another_loop(made, name):
    loop, claims = LOOPS[name], made(name)["claims"]
    assert claims
    assert not any(differences(claim, loop) for claim in claims)
    heavier = replace(loop, craft=make_craft((1.05 * tensor(loop.craft.inertia)).tolist(), torque_limit=0.05))
    assert any(differences(claim, heavier) for claim in claims)
    for gain, value in loop.gains._asdict().items():
        if isinstance(value, float) and value:
            changed = replace(loop, gains=loop.gains._replace(**{gain: 1.05 * value}))
            assert any(differences(claim, changed) for claim in claims), gain


def test_a_limit_is_compared_with_what_the_orbit_has():
    loop = loop_of("pd", LOOPS["pd-0"].gains, FULL, target=ORBITAL)
    limited = certify(loop).claim("torque-limit").proof.claim
    assert not differences(limited, loop)
    lower = loop.start._replace(position=tuple(0.9 * x for x in loop.start.position))
    assert {text for text in differences(limited, replace(loop, start=lower)) if text.endswith("is exceeded")}


def test_the_bounds_over_the_orbit_hold_on_it():
    """Along an eccentric orbit, by Kepler's equation, no torque and no rate exceeds what is claimed of it, nor is that much
    more than there is."""
    mu, a, e = 3.986e14, 9e6, 0.2
    inertia = np.array(FULL_OF_PRODUCTS)
    perigee = a * (1.0 - e)
    h = math.sqrt(mu * a * (1.0 - e * e))
    anomalies = np.linspace(0.0, 2.0 * math.pi, 721)
    r = a * (1.0 - e * e) / (1.0 + e * np.cos(anomalies))
    n = np.random.default_rng(1).normal(size=(20_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    torque = 3.0 * mu / perigee**3 * np.cross(n, n @ inertia)
    loop = loop_of("pd", LOOPS["pd-0"].gains, make_craft(FULL_OF_PRODUCTS)._replace(gravity=mu), target=ORBITAL)
    begun = loop.start._replace(position=(perigee, 0.0, 0.0), velocity=(0.0, h / perigee, 0.0))
    subject = make_subject(replace(loop, start=begun))
    for bound, found in (
        (subject.target_rate, h / r**2),
        (subject.target_acceleration, np.abs(2.0 * mu * e * np.sin(anomalies) / r**3)),
        (subject.modelled_norm, np.linalg.norm(torque, axis=1)),
        *zip(subject.modelled, np.abs(torque).T, strict=True),
    ):
        assert found.max() <= number(bound) <= 2.0 * found.max()


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
