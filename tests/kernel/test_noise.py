"""Errors that noise drives: what is proved of them, simulations of them, flights, and false claims."""

import math
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm, solve_discrete_lyapunov
from scipy.spatial.transform import Rotation

import starhold as sh
from starhold.algebra.quaternion import multiply, relative, vector_part
from starhold.algebra.vector import scale
from starhold.certification.evidence import noise
from starhold.certification.evidence.attitude import Loop
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import driven_errors, samples_of
from starhold.conformance.bench import CRAFT
from starhold.kernel.numbers import Account
from starhold.kernel.theorems.noise import tail
from starhold.parts.estimators import mekf
from tests.kernel.certificates import contents, failing, radii_of
from tests.kernel.flights import along
from tests.kernel.oracle import Oracle, number
from tests.making import built
from tests.tiers import leading

SIZES = np.repeat([1e-7, 1e-7, 1e-7, 1e-2, 1e-1, 1e-2], 3)
"""Small errors (rad, rad/s), and small noise as shares of its deviations."""


@pytest.fixture(scope="module")
def nadir():
    """The CubeSat that points to nadir."""
    return built("cubesat-nadir", "wheel")


def oracle_of(loop, **more):
    """What is claimed of the noise of a loop, as another reader has it."""
    found = Loop(make_subject(loop))
    numbers, evidence = radii_of(found)
    told = numbers | {"period": loop.period, "momentum": found.bounds(found.words)["momentum"]}
    claim = found.claim("points", [], None, **told | more) | {"evidence": evidence}
    return Oracle({"programs": found.by_digest}, claim)


@pytest.mark.parametrize("k", [1.5, 3.0, 5.0, 6.04, 8.0])
def test_the_bound_of_a_tail_is_not_below_it_and_near(k):
    Account.open()
    found = float(tail(Fraction(k), Fraction(1)))
    assert stats.chi(3).sf(k) <= found <= stats.chi(3).sf(k) * (1.0 + 0.7 / k**2)


@pytest.mark.slow
@pytest.mark.parametrize("share", leading([0.3, 0.02]))
def test_errors_leave_their_radii_no_more_often_than_is_claimed(nadir, share, monkeypatch):
    """Nor the motion that they cause with any momentum, in many spans of 4000 samples. A radius of the quantile itself is at
    most 1.35 times smaller, or 1.75 times for the motion, of which samples on end are like one another."""
    monkeypatch.setattr(noise, "RARELY", Fraction(share))
    monkeypatch.setattr(noise, "samples_of", lambda loop: 4000)
    oracle = oracle_of(nadir)
    H = oracle.numbers["momentum"] * along(np.random.default_rng(5).normal(size=(3, 1000))).T
    most, radii = oracle.largest_errors(4000, [flown_with(oracle, one) for one in H]), oracle.radii()[:4]
    assert (most > radii).any(axis=0).mean() <= share
    for own, radius, part, near in zip(most, radii[:, 0], noise.SHARES[:4], (1.35, 1.35, 1.75, 1.75), strict=True):
        assert radius <= near * np.quantile(own, 1.0 - share * part)


def test_the_recursion_is_that_of_the_filter_that_flies(nadir):
    """Each error and each noise, by the filter's own equations at the target's rate, after it has settled."""
    oracle, period = oracle_of(nadir), nadir.period
    fitted = next(f for f in nadir.parts if f.part.name == "mekf")
    params, (tracker, every, gyro, walk) = fitted.prepared(period), sensors(nadir)
    rate = (0.0, -1.107e-3, 0.0)
    onward = tuple(Rotation.from_rotvec(np.array(rate) * period).as_quat(scalar_first=True))

    def shown(attitude, random, bias, new):
        seen = turned(attitude, np.array(tracker) @ random[2])
        off = np.array(rate) + bias + gyro * np.array(random[0])
        return SimpleNamespace(attitude=seen, rate=tuple(off.tolist()), attitude_is_new=float(new))

    memory, attitude, none = mekf.remember(params, None), (1.0, 0.0, 0.0, 0.0), np.zeros((3, 3))
    for step in range(4000 * every):
        new = step % every == 0
        _, memory = mekf.estimate(shown(attitude, none, np.zeros(3), new), memory, params, CRAFT, period)
        attitude = multiply(attitude, onward)
    before = memory
    for role, new in (("errors carried", False), ("errors corrected", True)):
        wanted = oracle.errors(role)
        found = np.zeros_like(wanted)
        for place in range(found.shape[1]):
            errors, random = changed = np.zeros((2, 3, 3))
            changed.flat[place] = SIZES[place]
            kept = before._replace(
                attitude=turned(multiply(attitude, conjugate(onward)), errors[0]),
                bias=tuple((np.array(before.bias) + errors[1]).tolist()),
                rate=tuple((np.array(rate) + errors[2]).tolist()),
            )
            bias = walk * random[1]
            told, after = mekf.estimate(shown(attitude, random, bias, new), kept, params, CRAFT, period)
            parts = (
                difference(attitude, after.attitude), np.array(after.bias) - bias,
                np.array(after.rate) - rate - bias,
                difference(attitude, told.attitude), np.array(told.rate) - rate,
            )  # fmt: skip
            found[:, place] = np.concatenate(parts)
        assert np.abs(found - wanted * SIZES[: len(wanted.T)]).max() < 1e-11, role
        assert (np.abs(found).max(axis=0) > 1e-9).all()


def sensors(loop):
    """The noise of gyro and star tracker."""
    known = {f.part.name: f.part.module.noise(f.params, loop.period) for f in loop.used("sensor") if f.part.hook("noise")}
    gyro, tracker = known["gyro"], known["star-tracker"]
    return tracker.attitude, tracker.every, gyro.rate, gyro.walk


def turned(attitude, angles):
    """The attitude turned on by small angles."""
    x = np.concatenate([[1.0], np.array(angles) / 2.0])
    return tuple((np.array(multiply(attitude, tuple(x.tolist()))) / np.linalg.norm(x)).tolist())


def conjugate(q):
    return (q[0], -q[1], -q[2], -q[3])


def difference(true, estimated):
    """The small angles from one attitude to another."""
    error = relative(true, estimated)
    return np.array(scale(math.copysign(2.0, error[0]), vector_part(error)))


def test_a_flight_keeps_the_radii_once_the_filter_has_settled(nadir):
    n, run = oracle_of(nadir).numbers, sh.simulate(sh.load("cubesat-nadir"), "wheel")
    values = {name: np.squeeze(np.asarray(run[name])) for name in ("time", "attitude", "rate", "mekf_attitude", "mekf_rate")}
    true, told = (Rotation.from_quat(values[name], scalar_first=True) for name in ("attitude", "mekf_attitude"))
    late = values["time"] > 300.0
    off = np.linalg.norm((true.inv() * told).as_rotvec(), axis=1)[late]
    wrong = np.linalg.norm(values["mekf_rate"] - values["rate"], axis=1)[late]
    assert 0.4 * n["noise.attitude"] < off.max() < n["noise.attitude"]
    assert 0.6 * n["noise.rate"] < wrong.max() < n["noise.rate"]


def test_an_orbit_has_so_many_samples(nadir):
    radius = np.linalg.norm(nadir.start.position)
    orbit = 2.0 * math.pi * math.sqrt(radius**3 / nadir.craft.gravity)
    assert samples_of(nadir.without("oblateness")) == math.ceil(orbit / nadir.period)
    # Oblateness may make an orbit longer.
    assert 1.0 < samples_of(nadir) * nadir.period / orbit < 1.02
    assert samples_of(nadir.without("two-body")) == 3600.0 / nadir.period + 1


def flown_with(oracle, H):
    """A period near rest with a momentum that does not change and that the law makes up for as it measures the rates: of
    (w, q), and of the errors of attitude and rate."""
    C, K = oracle.linear()
    N, zero, spun = np.linalg.inv(oracle.J), np.zeros((3, 3)), np.cross(np.eye(3), H).T
    drift = np.block([[-N @ spun, zero, N], [np.eye(3) / 2, zero, zero], [np.zeros((3, 9))]])
    Phi = expm(drift * oracle.numbers["period"])[:6]
    torque = np.hstack([spun - C, -K])
    return Phi[:, :6] + Phi[:, 6:] @ torque, Phi[:, 6:] @ np.hstack([-K / 2, spun - C])


def test_covariances_are_hardly_above_those_of_motion_and_errors(nadir):
    """With a momentum and the opposite one, along each axis."""
    oracle = oracle_of(nadir)
    A, B = flown_with(oracle, np.zeros(3))
    evidence, most = oracle.claim["evidence"], 1.7321 * oracle.numbers["momentum"]
    assert len(evidence["covariances"]) == 12
    for axis in range(3):
        H = np.eye(3)[axis] * most * 1e-4
        # To the first order in the momentum.
        ahead, back = (flown_with(oracle, sign * H) for sign in (1, -1))
        D, E = (1e4 / 2 * (x - y) for x, y in zip(ahead, back, strict=True))
        steps = []
        for role in ("errors carried", "errors corrected"):
            own, told = np.split(oracle.errors(role), [9])
            zero = np.zeros((9, 6))
            steps.append(
                np.block([[A + D / 2, D / 2, (B + E) @ told], [-D / 2, A - D / 2, (B - E) @ told], [zero, zero, own]])
            )
        whole, Q = np.eye(21), np.zeros((21, 21))
        for step in (steps[0], steps[0], steps[0], steps[1]):
            own, noise = step[:, :21], step[:, 21:]
            whole, Q = own @ whole, own @ Q @ own.T + noise @ noise.T
        exact, told = solve_discrete_lyapunov(whole, Q), evidence["covariances"][4 * axis + 3]
        above = np.array([[number(x) for x in row] for row in told]) - exact
        size = np.sqrt(np.diag(exact))
        assert np.linalg.eigvalsh(above / np.outer(size, size))[0] > 0.0
        assert (np.diag(above) < 2e-3 * np.diag(exact)).all()
        half = np.hstack([np.eye(3), np.zeros((3, 3))]) / 2
        apart = np.hstack([half, -half, np.zeros((3, 9))])
        parts = [exact[:3, :3], exact[3:6, 3:6], exact[6:9, 6:9], exact[9:12, 9:12], apart @ exact @ apart.T]
        for part, place in zip(parts, (2, 3, 2, 3, 4), strict=True):
            assert np.linalg.eigvalsh(part)[-1] < number(evidence["deviations"][place]) ** 2


def narrow(claim, place, covariances=1.0, deviation=1.0):
    """Make a radius smaller, of the attitude that is told or of the turn that errors cause, and what bounds it."""
    told = claim["evidence"]
    told["deviations"][place] = str(Fraction(told["deviations"][place]) * Fraction(deviation))
    told["covariances"] = [
        [[str(Fraction(number(x)) * Fraction(covariances)) for x in row] for row in shape] for shape in told["covariances"]
    ]
    radii = {0: (claim["numbers"], "noise.attitude"), 2: (told["swayed"], 0), 3: (told["swayed"], 1)}
    own, key = radii[place]
    own[key] = str(Fraction(number(own[key])) * Fraction(0.6))


FALSE = [
    ("covariance", {"place": 0, "covariances": 0.2, "deviation": 0.6}),
    ("deviation of the attitude", {"place": 0, "deviation": 0.6}),
    ("deviation of the motion's rate", {"place": 2, "deviation": 0.6}),
    ("deviation of the motion's turn", {"place": 3, "deviation": 0.6}),
    ("share", {"place": 3}),
]


@pytest.mark.parametrize(("hypothesis", "change"), leading(FALSE))
def test_only_this_hypothesis_fails_and_the_claim_is_false(hypothesis, change):
    content = contents("flying", "noisy")
    (claim,) = content["claims"]
    narrow(claim, **change)
    assert failing(claim, content["programs"]) == {hypothesis}
    assert not Oracle(content, claim).holds()


@pytest.mark.slow
def test_the_claim_that_was_changed_holds():
    content = contents("flying", "noisy")
    assert Oracle(content, content["claims"][0]).holds()


@pytest.mark.slow
def test_errors_without_end_are_not_taken_in(nadir):
    """A gyro whose bias walks has no estimator; a filter that takes the bias for constant does not settle."""
    assert driven_errors(nadir.without("mekf")) is None
    fitted = next(f for f in nadir.parts if f.part.name == "mekf")
    constant = replace(fitted, params=fitted.params._replace(bias_walk=0.0))
    assert driven_errors(nadir.with_parts(constant)) is None
