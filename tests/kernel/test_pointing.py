"""The loop that flies: what is proved of it, flights that are chosen against that, and false claims."""

import copy
import math
import time
from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.evidence.finding import read
from starhold.certification.evidence.pointing import Chain
from starhold.kernel.check import check
from starhold.kernel.held import Held
from starhold.kernel.loops import AttitudeLoop
from tests.kernel.certificates import POINTING, contents, failing, flying, text
from tests.kernel.flights import Fleet, feedback, turn
from tests.kernel.oracle import Oracle, number
from tests.tiers import leading

PROVED = {"body": 0.13, "cubesat": 0.10, "moving": 0.13, "skew": 0.10, "calm": 0.10}
"""Within how many degrees motions are to end."""


def numbers(content):
    return {name: number(x) for name, x in content["claims"][0]["numbers"].items()}


@pytest.mark.parametrize("name", PROVED)
def test_the_loop_is_proved_to_point(name):
    content = contents("flying", name)
    begun = time.process_time()
    (proved,) = check(text(content))
    assert time.process_time() - begun < 4.0
    assert math.degrees(numbers(content)["end.angle"]) <= PROVED[name]
    assert "the torque is what the law asks for at the last sample" in proved.statement.written()


def one_level(numbers, told, **link):
    """A single level, from which no ellipsoid follows, and motions end where it says."""
    told["levels"], told["ellipsoids"] = [told["levels"][0] | link], []
    numbers |= {"end.angle": 0.2, "end.rate": 0.2, "settling": 5.0}


def low_level(numbers, told):
    one_level(numbers, told, end="1/1000000000")


def fast_fall(numbers, told):
    one_level(numbers, told, tau="1000", beta="399/100")
    told["levels"] = [told["levels"][0] | {"end": str(Fraction(numbers["level"]) / 2**k)} for k in (1, 2, 3, 4, 5)]


def small_ellipsoid(numbers, told):
    last = told["ellipsoids"][-1]
    shrunk = {
        "shape": [[str(Fraction(x) / 4) for x in row] for row in last["shape"]],
        "reach": str(4 * Fraction(last["reach"])),
    }
    told["ellipsoids"].append(last | shrunk)
    numbers |= {"end.angle": numbers["end.angle"] * 0.6, "settling": numbers["settling"] * 1.2}


def wide_entry(numbers, told):
    """Ellipsoids follow one level down, and are said to hold it at once."""
    claim, loop = copy.deepcopy(flying("calm").claims[0]), flying("calm")
    held = Held(AttitudeLoop(read(claim, loop.by_digest)))
    chain = Chain(held, "", 0.0)
    told["levels"] = [told["levels"][0] | {"end": str(Fraction(numbers["level"]) / 2)}]
    numbers["end.angle"], numbers["end.rate"] = chain.tighten(held.region(Fraction(told["levels"][0]["end"])))
    told["ellipsoids"] = [one | {"reach": "1000001/1000000"} for one in chain.ellipsoids]
    numbers["settling"] = 15.0


FALSE = {
    "turns from rest": lambda numbers, told: numbers.update({"angle": 1.5 * numbers["angle"]}),
    "V between samples": lambda numbers, told: numbers.update(highest=0.5 * numbers["level"]),
    "V falls": fast_fall,
    "level": low_level,
    "ellipsoid": small_ellipsoid,
    "entry": wide_entry,
    "end of the angle": lambda numbers, told: numbers.update({"end.angle": 0.6 * numbers["end.angle"]}),
    "end of the rate": lambda numbers, told: numbers.update({"end.rate": 0.4 * numbers["end.rate"]}),
    "settling": lambda numbers, told: numbers.update(settling=numbers["settling"] / 50),
}


@pytest.mark.parametrize("hypothesis", FALSE)
def test_only_this_hypothesis_fails_and_the_claim_is_false(hypothesis):
    name = "calm" if hypothesis == "entry" else "cubesat"
    content = contents("flying", name)
    (claim,) = content["claims"]
    exact = {key: number(x) for key, x in claim["numbers"].items()}
    FALSE[hypothesis](exact, claim["evidence"])
    claim["numbers"] = {key: str(Fraction(x)) for key, x in exact.items()}
    assert failing(claim, content["programs"]) == {hypothesis}
    assert not all(Oracle(content, claim, seed).holds() for seed in range(3))


@pytest.mark.parametrize("name", ["cubesat", "calm"])
def test_the_claims_that_were_changed_hold(name):
    content = contents("flying", name)
    assert Oracle(content, content["claims"][0]).holds()


@pytest.mark.parametrize(("name", "reached"), leading([("cubesat", 0.8), ("body", 0.8), ("skew", 0.8)], 2))
def test_no_flight_leaves_what_is_proved_and_some_come_near(name, reached):
    (J, k_rate, k_attitude, h), told = POINTING[name]
    J = np.diag(J) if np.ndim(J) == 1 else np.array(J)
    n = numbers(contents("flying", name))
    slow = math.sqrt(k_attitude / 2 / np.linalg.eigvalsh(J).max())
    fleet = Fleet(J, feedback(J, k_rate, k_attitude), h, *told[:2], slow)
    # A half from rest at the largest angle, and a half from rest on target, which lies in the last ellipsoid.
    (q, w), (target, _) = fleet.at_rest(told[2]), fleet.at_rest(0.0)
    near = np.arange(fleet.lanes) >= fleet.lanes // 2
    q[:, near], worst, V = target[:, near], 0.0, Oracle(contents("flying", name), contents("flying", name)["claims"][0])
    for k, attitude, rate in fleet.fly(q, w, 3000):
        ended = near | (k * h > n["settling"])
        worst = max(worst, float(turn(attitude)[ended].max()))
        assert np.linalg.norm(rate, axis=0)[ended].max() <= n["end.rate"]
        assert V.lyapunov(attitude, rate).max() <= n["highest"]
    assert reached * n["end.angle"] <= worst <= n["end.angle"]
