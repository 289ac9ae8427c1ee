"""Claims about loops whose sensors are late, or off in proportion to the motion, used directly and through a filter."""

from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from starhold.certification.comparison import differences
from starhold.certification.evidence.finding import read
from starhold.certification.matrices import floats
from starhold.certification.measured import _gains, measured
from starhold.certification.unmodelled import GROWING
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Account, RefusedError
from starhold.kernel.regions import AMISS, RATE, SPEED, TURN
from starhold.kernel.theorems import pointing
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import Noise
from starhold.parts.estimators import complementary_filter
from tests.certification.own_spacecraft import TEXTS, claim_of, loop_with, worst_of
from tests.kernel.flights import along, seen, turned_on
from tests.tiers import leading


@pytest.mark.parametrize("parts", leading(TEXTS))
def test_an_own_spacecraft_has_a_claim_with_all_of_its_sensors(parts):
    claim = claim_of(TEXTS[parts])
    assert (claim.outcome, claim.left_out) == ("proved", [])
    assert claim.numbers["angle"] < 0.02
    assert claim.numbers["slew_angle"] > 1.0
    assert any(claim.numbers["told_growth"])
    # What is late is in the flights that come near the bound.
    assert worst_of(TEXTS[parts], 16, 30, (40, 1000)).angle > 0.4


@pytest.mark.parametrize("parts", leading(TEXTS))
def test_a_claim_with_less_than_its_parts_say_is_of_another_loop(parts):
    (_, loop), claim = loop_with(TEXTS[parts]), claim_of(TEXTS[parts]).proof.claim
    assert not differences(claim, loop)
    grown = [name for name in GROWING if Fraction(claim["numbers"].get(name, 0))]
    assert len(grown) > 3
    for name in grown:
        half = str(Fraction(claim["numbers"][name]) / 2)
        assert differences(claim | {"numbers": claim["numbers"] | {name: half}}, loop), name


# --- one period -----------------------------------------------------------------------------------------------------------

EACH = {"error.attitude.per.rate": 4.0, "error.attitude.per.acceleration": 10.0, "error.rate.per.rate": 0.2}
EACH |= {"error.rate.per.acceleration": 1.0}


def held(**numbers):
    Account.left = 10**12
    proof = claim_of(TEXTS["late"]).proof
    kept = {name: x for name, x in proof.claim["numbers"].items() if name not in GROWING}
    given = kept | {name.replace("_", "."): str(Fraction(x)) for name, x in numbers.items()}
    return Held(AttitudeLoop(read(proof.claim | {"numbers": given}, dict(proof.programs)), remembers=True))


@pytest.mark.parametrize("name", EACH)
def test_what_is_told_off_in_proportion_to_the_motion_moves_the_body_within_its_tube_and_beyond_that_without(name):
    motion = held(**{name: EACH[name], "error.ago": 0.5})
    region = motion.region((motion.s + motion.G[3][3]) / 2**20)
    J, h, random = np.diag([1.0, 1.2, 0.8]), float(motion.h), np.random.default_rng(2)
    T, X = floats(motion.near.torque), floats(region.X)
    tube = motion.tube(region)
    x = np.linalg.cholesky(X) @ along(random.normal(size=(6, 4000)))
    # The states from which rates change most, with and without what is told off.
    ways = X @ (np.linalg.inv(J) @ T).T
    x = np.concatenate([x, ways / np.sqrt(np.einsum("ik,ik->k", (np.linalg.inv(J) @ T).T, ways))], axis=1)
    asked = T @ x
    told = np.linalg.norm(x[RATE] if name.endswith("per.rate") else np.linalg.solve(J, asked), axis=0) * EACH[name]
    columns = T[:, RATE] if name.startswith("error.rate") else T[:, TURN] / 2.0
    moved = np.abs(asked) + told * np.linalg.norm(columns, axis=1)[:, None]
    drift = h * (moved / np.diag(J)[:, None]).max(axis=1)
    assert (drift <= [float(d) for d in tube.end]).all()
    motion.moving = [[Fraction(0)] * 2, [Fraction(0), Fraction(1, 2**40)]]
    assert (drift > [float(d) for d in motion.tube(region).end]).any()


def test_a_smaller_set_counts_once_what_the_body_did_before_is_forgotten(monkeypatch):
    for kept, windows in ((0.0, 1), (0.5, 3)):
        motion = held(error_attitude_per_rate=0.5, error_ago=1.1, error_kept=kept)
        large, small = (motion.tube(motion.region((motion.s + motion.G[3][3]) / 2**k)) for k in (4, 12))
        assert [large.region.sizes[x] > small.region.sizes[x] for x in AMISS] == [True, False]
        assert pointing.waited(motion, small, small) == 0
        assert pointing.waited(motion, large, small) >= 5 * windows
    motion = held(error_attitude_per_rate=0.5, error_ago=0.0)
    assert pointing.waited(motion, large, small) >= 1
    with pytest.raises(RefusedError, match="not forgotten"):
        held(error_attitude_per_rate=0.5, error_kept=1.0)
    # The bounds of parts are of a body that turns by less than 2 rad in a period, with its target.
    for rate, turns in ((7.5, False), (8.5, True)):
        motion = held(error_attitude_per_rate=2.0**-40)
        motion.extents["r"] = Fraction(rate)
        with pytest.raises(RefusedError, match="turns too far") if turns else nullcontext():
            motion.tube(motion.region(motion.s / 2**20))
    motion = held(error_rate_per_acceleration=1e3)
    with pytest.raises(RefusedError, match="too long for the rates"):
        motion.tube(motion.region(motion.s / 2**20))


def test_errors_beside_noise_take_what_is_told_no_further_than_they_do_without():
    motion = held(**{"noise.attitude": 0.05, "error.attitude": 0.2})
    region, T, random = (
        motion.region((motion.s + motion.G[3][3]) / 2**20),
        floats(motion.near.torque),
        np.random.default_rng(4),
    )
    x = np.linalg.cholesky(floats(region.X)) @ along(random.normal(size=(6, 4000)))
    q = np.concatenate([[np.sqrt(1.0 - (x[TURN] ** 2).sum(axis=0))], x[TURN]])
    noise, error = (size * along(random.normal(size=(3, 4000))) for size in (0.05, 0.2))
    for told in (turned_on(turned_on(q, noise), error), turned_on(turned_on(q, error), noise)):
        beside = np.linalg.norm(T[:, TURN] @ (told[1:] - q[1:] - noise / 2.0), axis=0)
        assert 0.9 < beside.max() / float(motion.misread(region)[1]) <= 1.0


def test_errors_that_grow_with_the_motion_do_with_that_of_the_target():
    """From a rate across the target's, with all that turns both the same way."""
    fast, slow, own, target, h = 0.3, 0.2, 0.05, 0.07, 1e-6
    about = SimpleNamespace(moving=[[1, 0], [0, 1]], size={"r": Fraction(slow), "a": Fraction(target)}.get)
    rate, acceleration = map(float, Held.misleads(about, {SPEED: Fraction(fast)}, Fraction(own)))
    x, y, z = np.eye(3)[:, :, None]
    turn = turned_on(np.eye(4)[:, :1], h * fast * x)
    later = (fast * x - h * own * z) + seen(turn, slow * y - h * target * z)
    assert np.isclose(np.linalg.norm(later - fast * x - slow * y) / h, acceleration, rtol=1e-5)
    assert np.isclose(rate, fast + slow)


# --- the filter -----------------------------------------------------------------------------------------------------------


def stepped(turned, rate, memory, params, period, *, new, seen, read):
    """The filter's estimate and memory, of attitudes that are rotation vectors from the true one."""
    every = [
        SimpleNamespace(
            attitude=tuple((turned * Rotation.from_rotvec(one)).as_quat(scalar_first=True)), attitude_is_new=float(new)
        )
        for one in seen
    ]
    readings = SimpleNamespace(rate=tuple(rate + read), every=every)
    return complementary_filter.estimate(readings, memory, params, None, period)


def test_errors_of_the_complementary_filter_follow_its_recursion():
    period, rate, random = 0.25, np.array([2e-3, -1e-2, 3e-3]), np.random.default_rng(3)
    params = complementary_filter.prepare(complementary_filter.Params(0.3, 0.05), period)
    noise = Noise(
        ((2e-7, 0, 0), (0, 1e-7, 1e-8), (0, 0, 3e-7)), 2, 3e-8, 1e-8, more=(((1e-7, 0, 0), (0, 2e-7, 0), (0, 0, 1e-7)),)
    )
    recursion = complementary_filter.recursion(params, noise, period, tuple(rate))
    roots, true = [np.array(noise.attitude), np.array(noise.more[0])], Rotation.identity()
    begun = complementary_filter.remember(params, None)._replace(begun=1.0)
    memories, errors, bias = [begun, begun], ((0.0,) * 3,) * 2, np.zeros(3)
    for step in range(120):
        new, drawn, told = step % 2 == 1, random.normal(size=(recursion.noises, 3)), []
        for k, size in enumerate((1.0, 0.0)):
            seen = [size * root @ one for root, one in zip(roots, drawn[2:], strict=True)]
            read = size * (bias + noise.rate * drawn[0])
            estimate, memories[k] = stepped(true, rate, memories[k], params, period, new=new, seen=seen, read=read)
            off = (true.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec()
            told.append((off, np.array(estimate.rate)))
        errors, attitude, off = (recursion.corrected if new else recursion.carried)(errors, tuple(map(tuple, drawn)))
        for found, wanted in zip(np.subtract(*told), (attitude, off), strict=True):
            assert np.abs(found - wanted).max() < 1e-11
        bias, true = bias + noise.walk * drawn[1], true * Rotation.from_rotvec(rate * period)
    assert np.abs(attitude).max() > 1e-8
    assert complementary_filter.recursion(params._replace(bias_gain=0.0), noise, period, tuple(rate)) is None


@pytest.mark.parametrize("reading", leading(["gyro", "tracker", "acceleration"]))
def test_the_filter_that_flies_comes_as_far_as_its_bound_says_and_no_further(reading):
    """Each reading is off by as much as it may, with the signs of the response."""
    period, every, small = 0.25, 2, 1e-7
    params = complementary_filter.prepare(complementary_filter.Params(0.3, 0.3), period)
    eye = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    towards, later, steps, kept = _gains(
        complementary_filter.recursion, (params, period, (0.0, 0.0, 0.0)), Noise(eye, every, 1.0)
    )
    bounds = np.array(later if reading == "acceleration" else [row[reading == "tracker"] for row in towards])

    def fly(signs, count):
        """Errors of attitude and rate about an axis at each step, of a unit of what is off."""
        memory, out, turn, rate = complementary_filter.remember(params, None)._replace(begun=1.0), [], 0.0, 0.0
        for k in range(count):
            off = small * signs(k)
            seen, read = (off, 0.0) if reading == "tracker" else (0.0, off if reading == "gyro" else 0.0)
            true, x = Rotation.from_rotvec([turn, 0, 0]), np.eye(3)[0]
            estimate, memory = stepped(
                true, rate * x, memory, params, period, new=k % every == 1, seen=[seen * x], read=read * x
            )
            found = (true.inv() * Rotation.from_quat(estimate.attitude, scalar_first=True)).as_rotvec()[0]
            out.append((found, estimate.rate[0] - rate))
            if reading == "acceleration":
                turn, rate = turn + period * rate + period**2 / 2.0 * off, rate + period * off
        return np.array(out) / small

    count = 120
    first = [fly(lambda k, at=at: float(k == at), count) for at in range(every)]
    # What is off later does the same as much later.
    moved = [(at % every, at - at % every) for at in range(count)]
    responses = [np.concatenate([np.zeros((by, 2)), first[at][: count - by]]) for at, by in moved]
    assert np.abs(responses[57] - fly(lambda k: float(k == 57), count)).max() < 1e-5 * bounds.min()
    # What is off at each step does to attitude and rate at the last two, as one of which an attitude is new.
    most = np.max([np.abs([one[end] for one in responses]).sum(axis=0) for end in (count - 2, count - 1)], axis=0)
    assert (most <= bounds * (1.0 + 1e-5)).all()
    assert (most > 0.98 * bounds).all()
    # From `steps` on no more than the share is left of what was before.
    for n in (1, 2):
        left = [np.abs([one[end] for one in responses[: end - n * steps + 1]]).sum(axis=0) for end in (count - 2, count - 1)]
        assert (np.max(left, axis=0) <= kept**n * bounds * (1.0 + 1e-5) + 1e-6).all()


def test_an_estimate_that_does_not_forget_is_left_out_by_name():
    _, loop = loop_with(TEXTS["filtered"])
    (fitted,) = loop.used("estimator")
    assert measured(loop) is not None
    slow = replace(fitted, params=fitted.params._replace(bias_gain=0.0))
    other: ClosedLoop = replace(loop, parts=tuple(slow if f == fitted else f for f in loop.parts))
    assert measured(other) is None
