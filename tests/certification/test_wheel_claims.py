"""Certificates of the wheel law and of loops with wheels: further equilibria, stored momentum, limits of the wheels."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from starhold.algebra.quaternion import derivative
from starhold.algebra.vector import ZERO
from starhold.analysis.trial import BrokenClaimError, fly_claims
from starhold.certification.certificate import Certificate, write
from starhold.certification.certify import Wanted, certify
from starhold.certification.wording import sentence
from starhold.checker import check_file, passed
from starhold.laws import pd, wheel
from starhold.laws.catalogue import catalogue
from starhold.laws.interface import Measurement, NoMemory
from starhold.parts.bodies.rigid_body import angular_acceleration
from starhold.parts.craft import make_craft, tensor
from starhold.parts.effectors.layouts import three_orthogonal
from starhold.parts.effectors.wheels import axial_inertia, lose, make_wheels
from starhold.scenario.building import build
from starhold.scenario.reading import load, parse
from starhold.studies.bodies.rigid_body import certify_law
from tests import making
from tests.certification.loops import FULL, free, loop_of, rotors
from tests.making import ORBITAL, aimed, on_wheels
from tests.tiers import drawn, fewer, leading

EVEN = wheel.Gains(0.3, (0.015, 0.015, 0.015))
UNEVEN = wheel.Gains(0.3, (0.01, 0.015, 0.025))
weight = some.floats(0.001, 0.1)
BUILTIN = load("wheels-orbital").text
STRUCK = """
[[fault]]
time = "60 s"
wheel = 2
lost = true
delay = "10 s"
action = "{}"
"""


def motion(gains, craft):
    """d(q, w)/dt of the wheel law on a target at rest, of states (7,)."""

    def rates(x):
        q, w = tuple(x[:4]), tuple(x[4:])
        measurement = Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, 0.1)
        u, _ = wheel.torque(measurement, gains, craft, NoMemory())
        return np.array([*derivative(q, w), *angular_acceleration(w, u, craft)])

    return rates


def unstable(gains, craft, axis):
    """Numbers of eigenvalues on the right and on the imaginary axis, of the linear motion on the unit quaternions near rest
    at half a turn about an axis."""
    rates, x = motion(gains, craft), np.array([0.0, *axis, 0.0, 0.0, 0.0])
    assert np.abs(rates(x)).max() < 1e-15
    steps = 1e-6 * np.eye(7)
    A = np.array([(rates(x + step) - rates(x - step)) / 2e-6 for step in steps]).T
    # Along the quaternion itself there is no motion on the sphere.
    tangent = np.linalg.svd(x[None, :4])[2][1:]
    basis = np.zeros((7, 6))
    basis[:4, :3], basis[4:, 3:] = tangent.T, np.eye(3)
    roots = np.linalg.eigvals(basis.T @ A @ basis).real
    return int((roots > 1e-7).sum()), int((abs(roots) <= 1e-7).sum())


@given(some.lists(weight, min_size=3, max_size=3, unique=True), some.floats(0.05, 2.0))
def test_three_half_turns_where_weights_differ_and_each_is_unstable(k, damping):
    """S = 0 leaves, beside the target, half turns about the three axes: V decreases from them in 1, 2 or 3 directions."""
    k = [k[0], k[0] + k[1], k[0] + k[1] + k[2]]
    gains = wheel.Gains(damping, tuple(k))
    found = [unstable(gains, FULL, axis) for axis in np.eye(3)]
    # q.Mq with M = tr(k) - diag(k): the axis of the least weight is the top of V.
    assert found == [(3, 0), (2, 0), (1, 0)]
    random = np.random.default_rng(1)
    for _ in range(20):
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        torque = wheel.torque(Measurement((0.0, *axis), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.1), gains, FULL, NoMemory())[0]
        assert np.linalg.norm(torque) > 0.0


@given(weight, some.tuples(*[some.floats(-1.0, 1.0)] * 3))
def test_every_half_turn_where_weights_are_equal(k, axis):
    length = np.linalg.norm(axis)
    if length < 1e-3:
        axis, length = (1.0, 0.0, 0.0), 1.0
    # A sphere of rests: two directions along it are neutral, one leads away.
    assert unstable(wheel.Gains(0.3, (k, k, k)), FULL, np.array(axis) / length) == (1, 2)


def stored():
    """Gains, policies and targets: both gains and targets once each, then the others."""
    cases = sorted(product(range(2), range(3), range(2)), key=lambda case: case not in ((0, 0, 0), (1, 1, 1)))
    policies, targets = ("as_published", "shortest", "hysteresis"), (ORBITAL, aimed((1.0, 0.0, 0.0, 0.0)))
    return [((EVEN, UNEVEN)[i], policies[k], targets[j]) for i, k, j in cases]


@pytest.mark.parametrize(("gains", "sign_policy", "target"), drawn(stored(), 3, 2))
def test_the_wheel_law_converges_almost_always_whatever_the_wheels_store(gains, sign_policy, target):
    loop = rotors("wheel", gains, target, sign_policy=sign_policy)
    certificate = certify(loop)
    assert certificate.outcome == "proved"
    main = certificate.claim("convergence")
    assert main.numbers["everything"]
    assert [o.name for o in main.obligations][-1] == "V is non-increasing"
    assert certificate.claim("inertia").numbers["tolerance"] is None
    assert "half turns" in sentence(main, certificate.subject)


def test_without_compensation_it_holds_a_target_at_rest_only():
    gains = EVEN._replace(compensation=0.0)
    assert certify(rotors("wheel", gains)).claim("convergence").outcome == "proved"
    refused = certify(rotors("wheel", gains, ORBITAL)).claim("convergence")
    assert refused.outcome == "undecided"
    assert "h" in refused.obligations[0].evidence["reason"]


def test_another_law_on_wheels():
    """Stored momentum does no work on V of `pd`; on a moving target it does, and the certifier names it."""
    gains = pd.examples()[0]
    still = certify(rotors("pd", gains))
    assert still.outcome == "proved"
    assert still.claim("convergence").numbers["everything"]
    assert still.claim("wheels") is not None
    moving = certify(rotors("pd", gains, ORBITAL)).claim("convergence")
    assert moving.outcome == "undecided"


def test_momentum_that_piles_up_is_not_passed_over():
    """`lyapunov` cancels the gravity gradient and leaves w x H: as H grows without end the motion may stop short, so that
    what is proved is proved without any torque from outside."""
    loop = rotors("lyapunov", catalogue()["lyapunov"].examples()[0])
    assert certify(loop).claim("convergence").outcome == "proved"
    pulled = rotors("wheel", EVEN, ORBITAL).without("target").with_parts(loop.target)
    pulled = replace(pulled, law=loop.law, gains=loop.gains)
    found = certify(pulled).claim("convergence")
    assert "no-outside-torque" in found.assumptions
    assert "known-outside-torque" not in found.assumptions


@pytest.mark.slow
def test_claims_that_are_not_built_say_so():
    loop = rotors("wheel", EVEN)
    found = certify(loop, "", Wanted(disturbance=1e3)).claim("pointing")
    assert found.outcome == "undecided"
    peak = on_wheels(loop, allocation=1)
    assert certify(peak).claim("wheels") is None
    assert certify(peak, "", Wanted(slew_angle=0.1)).claim("wheels").outcome == "undecided"
    far = certify(loop, "", Wanted(slew_angle=3.0)).claim("wheels")
    assert far.outcome == "undecided"


def test_a_loop_that_counts_on_a_lost_wheel_claims_nothing():
    loop = rotors("wheel", EVEN)
    broken = loop.wheels._replace(torque_limit=(0.0, *loop.wheels.torque_limit[1:]))
    assert certify(on_wheels(loop, torque_limit=broken.torque_limit)).claims == ()
    after = certify(on_wheels(loop, **lose(loop.wheels, 0)._asdict()))
    assert after.outcome == "proved"
    claim = after.claim("wheels")
    assert claim.numbers["motors"][0] == 0.0
    assert claim.numbers["level"] < certify(loop).claim("wheels").numbers["level"]


@pytest.mark.parametrize(
    ("law", "limits", "binding"),
    leading(
        [
            ("wheel", (0.02, 10.0), "motors"),
            ("pd", (10.0, 0.3), "wheel_momentum"),
            ("pd", (0.02, 10.0), "motors"),
            ("wheel", (10.0, 0.3), "wheel_momentum"),
        ]
    ),
)
def test_limits_of_wheels_are_kept_and_nearly_used(law, limits, binding):
    """An optimiser over the certified set finds nothing beyond the told numbers, and comes near what binds."""
    gains = EVEN if law == "wheel" else pd.examples()[0]
    loop = rotors(law, gains, torque_limit=limits[0], momentum_limit=limits[1], layout=three_orthogonal)
    certificate = certify(loop, "", Wanted(momentum=0.05))
    claim = certificate.claim("wheels")
    assert claim.outcome == "proved"
    n, J = claim.numbers, tensor(loop.craft.inertia)
    random = np.random.default_rng(4)
    wheels, s = loop.wheels, 4.0 * gains.k_attitude[0] if law == "wheel" else 2.0 * gains.k_attitude
    shares = -np.array(wheels.least)
    begun = np.array(loop.rotors)
    kept = begun - shares @ (begun @ np.array(wheels.axes))
    most = {"motors": np.zeros(3), "wheel_momentum": np.zeros(3)}
    for _ in range(20_000):
        t = random.uniform(0.0, min(n["level"], s if law == "wheel" else 2.0 * s))
        q0 = math.sqrt(1.0 - t / s) if law == "wheel" else 1.0 - t / s
        axis, direction, total = random.normal(size=(3, 3))
        if random.uniform() < 0.5:
            # About one axis, where sums of sizes are reached.
            axis = direction = np.eye(3)[random.integers(3)]
        turned = np.linalg.solve(np.linalg.cholesky(J).T, direction / np.linalg.norm(direction))
        w = math.sqrt(2.0 * (n["level"] - t)) * turned
        q = (q0, *(math.sqrt(1.0 - q0 * q0) * axis / np.linalg.norm(axis)))
        stored = n["momentum"] * total / np.linalg.norm(total) - J @ w
        measurement = Measurement(q, tuple(w), tuple(w), ZERO, ZERO, ZERO, ZERO, 0.1, tuple(stored))
        u = np.array(loop.law.command(measurement, loop.gains, loop.craft, NoMemory())[0])
        most["motors"] = np.maximum(most["motors"], np.abs(shares @ u))
        most["wheel_momentum"] = np.maximum(most["wheel_momentum"], np.abs(kept + shares @ stored))
    for name in most:
        assert (most[name] <= np.array(n[name]) * (1.0 + 1e-9)).all()
    assert most[binding].max() > 0.8 * max(n[binding])
    assert max(n["motors"]) <= limits[0]
    assert max(n["wheel_momentum"]) <= 0.99 * limits[1]


def test_flights_keep_within_the_wheels_and_catch_what_does_not():
    loop = rotors("wheel", EVEN)
    certificate = certify(loop)
    trial = fly_claims(loop, certificate, flights=512)
    assert 0.5 < trial.torque_share <= 1.0
    claim = certificate.claim("wheels")
    strong = replace(claim, numbers={**claim.numbers, "start": 3.0 * claim.numbers["start"]})
    with pytest.raises(BrokenClaimError, match="limit"):
        fly_claims(loop, Certificate("too strong", certificate.subject, (strong,)), flights=512)


@pytest.mark.slow
def test_a_torque_limit_of_the_wheel_law_without_wheels():
    """Where other actuators give the torque the limit is the craft's, and the claim a set of turns up to a half."""
    loop = loop_of("wheel", wheel.Gains(0.05, (0.01, 0.01, 0.01)), make_craft(tensor(FULL.inertia), torque_limit=0.04))
    claim = certify(free(loop)).claim("torque-limit")
    assert claim.outcome == "proved"
    assert math.radians(100.0) < claim.numbers["slew_angle"] < math.pi
    asked = certify(loop, "", Wanted(slew_angle=math.radians(100.0)))
    assert asked.claim("torque-limit").outcome == "proved"
    assert fly_claims(free(loop), certify(free(loop)), flights=256).torque_share <= 1.0
    tight = replace(loop, craft=make_craft(tensor(FULL.inertia), torque_limit=0.01))
    refuted = certify(tight, "", Wanted(slew_angle=math.radians(60.0))).claim("torque-limit")
    assert refuted.outcome == "refuted"


def struck(action):
    at = BUILTIN.index("[simulation]")
    return parse(BUILTIN[:at] + STRUCK.format(action) + BUILTIN[at:], "here")


@pytest.mark.slow
@pytest.mark.parametrize(("action", "names"), leading([("both", ["wheel", "wheel from 70 s"]), ("none", ["wheel"])]))
def test_the_certificate_is_issued_again_once_the_fault_is_known(action, names, tmp_path):
    scenario = struck(action)
    entry = scenario.laws[0]
    found = certify_law(scenario, entry, build(scenario, entry))
    assert [issued.certificate.name for issued in found] == names
    if action == "both":
        before, after = (issued.certificate for issued in found)
        assert after.outcome == "proved"
        assert after.subject["gains"]["k_rate"] < before.subject["gains"]["k_rate"]
        assert after.subject["wheels"]["torque_limit"][1] == 0.0
        # The state in flight at that moment, with what the lost wheel holds.
        assert after.subject["wheels"]["momentum"][1] != 0.0
        assert after.claim("wheels").numbers["motors"][1] == 0.0
        write([before, after], "struck", tmp_path / "c.json")
        assert passed(check_file(tmp_path / "c.json"))


@pytest.mark.slow
def test_every_law_with_a_function_on_wheels_is_sound(tmp_path):
    """Whatever a law's certificate says on wheels, its checker agrees and flights do not contradict."""
    for name, law in catalogue().items():
        if law.lyapunov is None:
            continue
        # The others clip their torque to the craft's limit, and here there is none.
        every = [gains for gains in law.examples() if not getattr(gains, "limit", 0)]
        for gains in every[: fewer(len(every), len(every))]:
            loop = rotors(name, gains)
            certificate = certify(loop, name)
            write([certificate], "wheels", tmp_path / "c.json")
            found = check_file(tmp_path / "c.json")
            assert passed(found), (name, [f for f in found if f.verdict == "fails"])
            fly_claims(loop, certificate, flights=128)


@pytest.mark.slow
def test_no_claim_is_about_less_momentum_than_is_had_on_target(tmp_path):
    """A body that follows the orbit at rest on target has momentum; one with none is told of by nobody."""
    loop = rotors("wheel", catalogue()["wheel"].examples()[0], target=ORBITAL)
    loop = loop.with_parts(making.rotors(loop.wheels))
    whole = certify(loop)
    assert whole.claim("wheels").outcome == "proved"
    asked = certify(loop, "", Wanted(momentum=0.0)).claim("wheels")
    assert asked.outcome == "undecided"
    assert "so little momentum" in asked.obligations[0].evidence["reason"]
    # At rest on a target that is at rest a body has none.
    still = rotors("wheel", catalogue()["wheel"].examples()[0])
    still = still.with_parts(making.rotors(still.wheels))
    write([certify(still, "", Wanted(momentum=0.0))], "made", tmp_path / "s.json")
    assert passed(check_file(tmp_path / "s.json"))
    assert certify(still, "", Wanted(momentum=0.0)).claim("wheels").outcome == "proved"


def test_the_inertia_of_rotors_on_any_axes_is_symmetric():
    """To the last bit: the body's is the difference, of which nothing is proved under the gravity gradient otherwise."""
    random = np.random.default_rng(3)
    for _ in range(8):
        made = axial_inertia(make_wheels(random.normal(size=(5, 3)), random.uniform(1e-4, 1e-3, size=5), 0.1, 1.0))
        assert np.array_equal(made, made.T)
