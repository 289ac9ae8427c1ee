"""The loop that flies: what is proved of it, flights that are chosen against that, and false claims."""

import math
import random
import time
from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.evidence import responses
from starhold.certification.evidence.chains import Chain
from starhold.certification.evidence.claims import floats
from starhold.certification.proofs import checked
from starhold.kernel.check import check
from starhold.kernel.numbers import Account, RefusedError, root, up
from starhold.kernel.polynomials import Poly, most, total
from starhold.kernel.regions import STATE, Region, factored, least_form
from starhold.kernel.theorems.pointing import periods
from starhold.kernel.theorems.response import Response
from tests.kernel.certificates import POINTING, contents, failing, flying, text
from tests.kernel.flights import along, turn
from tests.kernel.one_period import after_a_period, fleet_of, held_loop, states_of
from tests.kernel.oracle import Oracle, number
from tests.tiers import leading

PROVED = {"cubesat": 0.10, "moving": 0.13, "skew": 0.10, "body": 0.13, "calm": 0.10, "noisy": 0.40}
"""Within how many degrees motions are to end."""


def numbers(content):
    return {name: number(x) for name, x in content["claims"][0]["numbers"].items()}


@pytest.mark.parametrize("name", leading(PROVED, 2))
def test_the_loop_is_proved_to_point(name):
    content = contents("flying", name)
    begun = time.process_time()
    (proved,) = check(text(content))
    assert time.process_time() - begun < 4.0
    assert math.degrees(numbers(content)["end.angle"]) <= PROVED[name]
    assert "the torque is what the law asks for at the last sample" in proved.statement.written()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "power"), leading([("moving", 1), ("skew", 3), ("moving", 0.5), ("moving", 3), ("skew", 0.5), ("skew", 1)])
)
def test_a_period_takes_no_state_farther_than_its_bounds(name, power):
    oracle = Oracle(contents("flying", name), contents("flying", name)["claims"][0])
    level = oracle.numbers["level"] / 30.0**power
    push = 0.02 * math.sqrt(level * oracle.subject["gains.k_attitude"])
    slope = push / math.sqrt(level / oracle.J.max())
    held = held_loop(name, outside=push, error=2 * push, **{"outside.per.rate": slope / 4, "error.per.rate": slope})
    region = held.region(Fraction(level))
    fleet = fleet_of(name, push, 2 * push)
    q, w = states_of(oracle, level, fleet.lanes)
    x, tube = np.concatenate([w, q[1:]]), held.tube(region)
    sizes = np.array([float(region.sizes[name]) for name in STATE])
    assert (np.abs(x).max(axis=1) <= sizes).all()
    assert (np.abs(x).max(axis=1) > 0.5 * sizes).all()
    Q, H, F, pushed, rest, _ = held.fall(tube)
    Q, H, F, pushes = floats(Q), floats(H), floats(F), held.linear(tube)
    # What F has beside the push is of its growth in a period.
    grown, A = float(pushed / (tube.steady + tube.pushed)), held.near.A
    V = oracle.lyapunov(q, w)
    assert ((x * (H @ x)).sum(0) * (1 + 1e-9) >= V).all()
    for unit in (fleet.push(0, q, w), fleet.directions(), along(F[:3] @ x)):
        later, rate = after_a_period(fleet, q, w, unit, 1.2 * slope)
        size = 3 * push + 1.25 * slope * np.linalg.norm(w, axis=0)
        most = fleet.h * (grown * size * np.linalg.norm(F @ x, axis=0) + float(rest) - (x * (Q @ x)).sum(0))
        assert (oracle.lyapunov(later, rate) - V <= most).all()
        y = np.concatenate([rate, later[1:]])
        assert (np.abs(y) <= np.array([[float(tube.sizes[name])] for name in STATE])).all()
        drift = np.abs(rate - w).max(axis=1) / np.array([float(x) for x in tube.drift])
        assert 0.1 < drift.max() <= 1.0
        # What is not linear is a push of the first kind and, beside, of the others.
        left, (first, last, turned) = y - floats(A) @ x, [floats(B) * float(b) for B, b in pushes]
        for way in (np.eye(6), oracle.rng.normal(size=(200, 6))):
            most = sum(np.linalg.norm(way @ B, axis=1) for B in (first, last, turned))
            assert (np.abs(way @ left) <= most[:, None]).all()


def test_what_turns_the_rates_as_they_drift_is_a_push():
    """The law makes up for w x Jw at the sample alone. Almost nothing else pushes here."""
    oracle = Oracle(contents("flying", "skew"), contents("flying", "skew")["claims"][0])
    level = oracle.numbers["level"] / 1000.0
    held, fleet = held_loop("skew", outside=1e-12, error=1e-12), fleet_of("skew", 0.0, 0.0)
    tube = held.tube(held.region(Fraction(level)))
    q, w = states_of(oracle, level, fleet.lanes)
    later, rate = after_a_period(fleet, q, w, fleet.directions())
    left = np.concatenate([rate, later[1:]]) - floats(held.near.A) @ np.concatenate([w, q[1:]])

    def used():
        most = sum(np.linalg.norm(floats(B)[:3], axis=1) * float(b) for B, b in held.linear(tube))
        return float((np.abs(left[:3]) / most[:, None]).max())

    assert used() <= 1.0
    held.tumbled = [Poly({})] * 3
    assert used() > 1.0


def test_roots_and_rounded_numbers_are_not_below_and_near():
    Account.open()
    r = random.Random(4)
    for _ in range(500):
        x = Fraction(r.randrange(1, 10**9), r.randrange(1, 10**9)) * Fraction(10) ** r.randrange(-30, 30)
        assert x <= root(x) ** 2 <= x * (1 + Fraction(1, 10**15))
        assert x <= up(x) <= x * (1 + Fraction(1, 10**15))
        assert -x <= up(-x) <= -x * (1 - Fraction(1, 10**15))
    assert root(Fraction(0)) == up(Fraction(0)) == 0


@pytest.mark.parametrize("least", ["-1/2", "0", "3/5"])
def test_a_form_is_nowhere_above_its_polynomial(least):
    Account.open()
    r, low = random.Random(least), Fraction(least)
    sizes = {name: Fraction(r.randrange(1, 100), 100) for name in STATE} | {"q0": Fraction(1)}
    for _ in range(20):
        names = [sorted(r.choices([*STATE, "q0"], k=r.randrange(4))) for _ in range(6)]
        pairs = [r.choices(STATE, k=2) for _ in names]
        p = total(
            Poly({tuple(sorted(m + pair)): Fraction(r.randrange(-9, 10))}) for m, pair in zip(names, pairs, strict=True)
        )
        M = least_form(factored(p), Region([], sizes, low))
        for _ in range(30):
            x = {name: size * r.choice([-1, 1, Fraction(r.randrange(-100, 101), 100)]) for name, size in sizes.items()}
            x["q0"] = low + (1 - low) * Fraction(r.randrange(101), 100)
            form = sum(M[i][k] * x[a] * x[b] for i, a in enumerate(STATE) for k, b in enumerate(STATE))
            assert form <= p.at(x).number
            assert abs(p.at(x).number) <= most(p, sizes)
    # An even power of q0 is least within an interval about zero.
    assert (
        least_form(factored(Poly({("q0", "q0", "w1", "w1"): Fraction(1)})), Region([], sizes, low))[0][0] <= max(low, 0) ** 2
    )


SLOWER = [("1/2", "1", "3", "2"), ("1/100", "0", "1", "1/50"), ("1", "1", "9", "2")]


@pytest.mark.parametrize(("fall", "floor", "start", "end"), SLOWER)
def test_periods_are_enough_and_not_many(fall, floor, start, end):
    fall, floor, x, end = map(Fraction, (fall, floor, start, end))
    Account.open()
    count = 0
    while x > end:
        x, count = floor + (1 - fall) * (x - floor), count + 1
    assert count <= periods(fall, floor, Fraction(start), end) <= 2 * count + 2
    assert periods(fall, floor, end, end) == 0


def one_level(numbers, told, **link):
    """A single level, from which no ellipsoid follows, and motions end where it says."""
    told["levels"], told["ellipsoids"] = [told["levels"][0] | link], []
    del told["response"]
    numbers |= {"end.angle": 0.2, "end.rate": 0.2, "settling": 5.0}


def low_level(numbers, told):
    one_level(numbers, told, end="1/1000000000")


def fast_fall(numbers, told):
    one_level(numbers, told, tau="1000", beta="399/100")
    told["levels"] = [told["levels"][0] | {"end": str(Fraction(numbers["level"]) / 2**k)} for k in (1, 2, 3, 4, 5)]


def enclosed(name, numbers, told):
    """Ellipsoids follow the last level, in place of the response."""
    held = held_loop(name)
    chain, tube = Chain(held, "", 0.0), held.tube(held.region(Fraction(told["levels"][-1]["end"])))
    del told["response"]
    numbers["end.angle"], numbers["end.rate"] = chain.tighten(tube)
    told["ellipsoids"] = chain.ellipsoids


def small_ellipsoid(numbers, told):
    enclosed("cubesat", numbers, told)
    last = told["ellipsoids"][-1]
    shrunk = {
        "shape": [[str(Fraction(x) / 4) for x in row] for row in last["shape"]],
        "reach": str(4 * Fraction(last["reach"])),
    }
    told["ellipsoids"].append(last | shrunk)
    numbers |= {"end.angle": numbers["end.angle"] * 0.6, "settling": 600.0}


def wide_entry(numbers, told):
    """Ellipsoids follow one level down, and are said to hold it at once."""
    told["levels"] = [told["levels"][0] | {"end": str(Fraction(numbers["level"]) / 2)}]
    enclosed("calm", numbers, told)
    told["ellipsoids"] = [one | {"reach": "1000001/1000000"} for one in told["ellipsoids"]]
    numbers["settling"] = 15.0


def small_response(part, end, gain, share):
    """The loop is said to move less under pushes."""

    def change(numbers, told):
        gains = told["response"]["gains"]
        gains[part] = [str(Fraction(number(x) * gain)) for x in gains[part]]
        numbers[end] *= share

    return change


FALSE = {
    "turns from rest": lambda numbers, told: numbers.update({"angle": 1.5 * numbers["angle"]}),
    "V between samples": lambda numbers, told: numbers.update(highest=0.5 * numbers["level"]),
    "V decreases by a share": fast_fall,
    "level": low_level,
    "ellipsoid": small_ellipsoid,
    "entry": wide_entry,
    "response of the rate": small_response(0, "end.rate", 0.3, 0.5),
    "response of the turn": small_response(1, "end.angle", 0.6, 0.65),
    "end of the angle": lambda numbers, told: numbers.update({"end.angle": 0.6 * numbers["end.angle"]}),
    "end of the rate": lambda numbers, told: numbers.update({"end.rate": 0.4 * numbers["end.rate"]}),
    "settling": lambda numbers, told: numbers.update(settling=numbers["settling"] / 50),
}


UNTOLD = [
    *(("level", "cubesat", key, value) for key, value in (("tau", "0"), ("beta", "0"), ("beta", "401/100"), ("end", "0"))),
    *(("ellipsoid", "calm", key, value) for key, value in (("rate", "1"), ("reach", "0"), ("shares", ["0", "1/4", "1/4"]))),
    ("ellipsoid", "calm", "shares", ["1/2", "1/4", "1/4"]),
]


@pytest.mark.parametrize(("kind", "name", "key", "value"), UNTOLD)
def test_numbers_without_a_sense_are_refused(kind, name, key, value):
    """Else some would be divided by zero, and more than all of V would be lost in a period."""
    content = contents("flying", name)
    told = content["claims"][0]["evidence"]
    if kind == "ellipsoid":
        shape = [[str(int(i == k)) for k in range(6)] for i in range(6)]
        told["ellipsoids"] = [{"shape": shape, "shares": ["1/4"] * 3, "rate": "1/2", "reach": "2"}]
    told[f"{kind}s"][0][key] = value
    with pytest.raises(RefusedError, match=f"an? {kind} is not properly stated"):
        check(text(content))


def falsified(hypothesis):
    """A certificate with a claim that is false by this hypothesis alone."""
    content = contents("flying", "calm" if hypothesis == "entry" else "cubesat")
    (claim,) = content["claims"]
    exact = {key: number(x) for key, x in claim["numbers"].items()}
    FALSE[hypothesis](exact, claim["evidence"])
    claim["numbers"] = {key: str(Fraction(x)) for key, x in exact.items()}
    return content


@pytest.mark.parametrize("hypothesis", FALSE)
def test_only_this_hypothesis_fails(hypothesis):
    content = falsified(hypothesis)
    assert failing(content["claims"][0], content["programs"]) == {hypothesis}


@pytest.mark.slow
@pytest.mark.parametrize("hypothesis", FALSE)
def test_the_claim_is_false(hypothesis):
    content = falsified(hypothesis)
    assert not all(Oracle(content, content["claims"][0], seed).holds() for seed in range(3))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cubesat", "calm"])
def test_the_claims_that_were_changed_hold(name):
    content = contents("flying", name)
    assert Oracle(content, content["claims"][0]).holds()


@pytest.mark.parametrize("name", ["cubesat", "skew"])
def test_a_torque_that_turns_over_with_the_response_comes_as_far_as_is_said(name):
    held = held_loop(name)
    told, A, B = responses.find_response(held), floats(held.near.A), floats(held.near.B)
    count, rng = len(told["weights"][0]), np.random.default_rng(4)
    outputs = np.vstack([np.eye(6), floats(held.near.rates)])
    for place, gains in enumerate(told["gains"]):
        ways = [along(rng.normal(size=(3, 300))).T @ outputs[3 * place : 3 * place + 3]]
        for _ in range(count - 1):
            ways.append(ways[-1] @ A)
        x = np.zeros((6, 300))
        for way in reversed(ways):
            x = A @ x + B @ along(B.T @ way.T)
        far = float(np.einsum("ni,in->n", ways[0], x).max())
        assert 0.97 * number(gains[0]) < far <= number(gains[0])


def test_what_is_left_of_the_motion_before_a_response_counts(monkeypatch):
    """Else a response of few samples would end the motion where it does not end."""
    monkeypatch.setattr(responses, "LEFT", 0.5)
    content = contents("flying", "cubesat")
    (claim,) = content["claims"]
    claim["evidence"]["response"] = responses.find_response(held_loop("cubesat")) | {"rounds": 12}
    claim["numbers"]["end.angle"] = str(Fraction(number(claim["numbers"]["end.angle"]) * 0.6))
    assert failing(claim, content["programs"]) == {"end of the angle", "end of the rate"}
    begin = Response.__init__

    def dropped(self, count, gains, left, beside):
        begin(self, count, gains, [[0 * x for x in row] for row in left], beside)

    monkeypatch.setattr(Response, "__init__", dropped)
    assert failing(claim, content["programs"]) == set()
    assert not Oracle(content, claim).holds()


@pytest.mark.parametrize(("name", "reached"), leading([("cubesat", 0.8), ("body", 0.8), ("skew", 0.8)]))
def test_no_flight_leaves_what_is_proved_and_some_come_near(name, reached):
    told, n = POINTING[name][1], numbers(contents("flying", name))
    fleet = fleet_of(name, *told[:2])
    # A half from rest at the largest angle, and a half from rest on target, which lies in the last ellipsoid.
    (q, w), (target, _) = fleet.at_rest(told[2]), fleet.at_rest(0.0)
    near = np.arange(fleet.lanes) >= fleet.lanes // 2
    q[:, near], worst, V = target[:, near], 0.0, Oracle(contents("flying", name), contents("flying", name)["claims"][0])
    for k, attitude, rate in fleet.fly(q, w, 3000):
        ended = near | (k * fleet.h > n["settling"])
        worst = max(worst, float(turn(attitude)[ended].max()))
        assert np.linalg.norm(rate, axis=0)[ended].max() <= n["end.rate"]
        assert V.lyapunov(attitude, rate).max() <= n["highest"]
    assert reached * n["end.angle"] <= worst <= n["end.angle"]


@pytest.mark.slow
@pytest.mark.parametrize("name", leading(["cubesat", "skew", "calm"]))
def test_flights_from_the_set_stay_in_the_funnel_and_the_funnel_is_not_wide(name):
    (claim,) = checked(flying(name))
    times, angles = np.array(claim.numbers["funnel"]).T
    assert (times[0], times[-1], angles[-1]) == (0.0, claim.numbers["settling"], claim.numbers["angle"])
    assert (np.diff(times) > 0.0).all()
    assert (np.diff(angles) < 0.0).all()
    told = POINTING[name][1]
    fleet, closest = fleet_of(name, *told[:2]), 0.0
    for k, attitude, _ in fleet.fly(*fleet.at_rest(told[2]), int(1.2 * times[-1] / fleet.h)):
        most = angles[np.searchsorted(times, k * fleet.h, side="right") - 1]
        closest = max(closest, float(turn(attitude).max()) / most)
    assert 0.7 < closest <= 1.0
