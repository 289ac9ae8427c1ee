"""False claims about loops with appendages of which all is shown but one thing: that thing is not idle."""

import copy
import random
from fractions import Fraction

import pytest

from starhold.kernel.numbers import rational
from tests.kernel.certificates import failing, with_program
from tests.kernel.mutations import refusals
from tests.kernel.swaying import Swaying, content_of
from tests.tiers import fewer


def scaled(*numbers):
    """Numbers of the claim, each with a factor."""

    def change(content, claim):
        for name, factor in numbers:
            claim["numbers"][name] = str(rational(claim["numbers"][name]) * rational(factor))

    return change


def lower(content, claim):
    """V is always lower than where the motion begins."""
    claim["numbers"]["highest"] = str(rational(claim["numbers"]["level"]) / 2)


def boxed(content, claim):
    """Motions end in the last box, which is larger than what the response says."""
    claim["evidence"].pop("response")
    scaled(("end.angle", "8"), ("end.rate", "8"))(content, claim)


def at_once(content, claim):
    """The motion is where it ends after a period of each round."""
    for one in claim["evidence"]["rounds"][:-1]:
        one["periods"] = 1
    claim["numbers"]["settling"] = str(rational(claim["numbers"]["period"]) * len(claim["evidence"]["rounds"]))
    boxed(content, claim)


def nearer(content, claim):
    """The last box is a hundred times smaller, and what is claimed of the end is that."""
    last = claim["evidence"]["rounds"][-1]
    last["sizes"] = [str(Fraction(x) / 100) for x in last["sizes"]]
    boxed(content, claim)
    scaled(("end.angle", "1/100"), ("end.rate", "1/100"))(content, claim)


def small_response(part, end, gain, share):
    """The loop is said to move less under pushes."""

    def change(content, claim):
        gains = claim["evidence"]["response"]["gains"]
        gains[part] = [str(rational(x) * Fraction(gain)) for x in gains[part]]
        scaled((end, share))(content, claim)

    return change


def reversed_torque(content, claim):
    """A torque about the third axis of more than the half of what is felt turns the body the other way."""
    program = copy.deepcopy(content["programs"].pop(claim["programs"]["motion"]))
    rounds = claim["evidence"]["rounds"]
    most = max(Fraction(one["torques"][2]) for one in rounds) / 4
    for one in rounds:
        one["torques"] = [str(min(Fraction(x), most * Fraction(9, 10))) for x in one["torques"]]
    count, place = len(program["inputs"]), program["inputs"].index("torque.2")
    guard = [
        ["constant", str(most)], ["less", count, place], ["negative", place], ["less", count, count + 2],
        ["either", count + 1, count + 3], ["select", count + 4, count + 2, place],
    ]  # fmt: skip

    def moved(k):
        return count + 5 if k == place else k if k < count else k + len(guard)

    steps = [step if step[0] == "constant" else [step[0], *map(moved, step[1:])] for step in program["steps"]]
    program = program | {"steps": guard + steps, "outputs": list(map(moved, program["outputs"]))}
    with_program(content, "motion", program)


def backwards(content, claim):
    """The body turns against its rate."""
    program = copy.deepcopy(content["programs"][claim["programs"]["turning"]])
    count = len(program["inputs"]) + len(program["steps"])
    program["steps"] += [["constant", "-1"], *(["product", count, k] for k in program["outputs"])]
    program["outputs"] = [count + 1 + k for k in range(4)]
    with_program(content, "turning", program)


FALSE = {
    "turning": ("bent", backwards),
    "turns from rest": ("bent", scaled(("angle", "3/2"))),
    "samples": ("bent", at_once),
    "between samples": ("biased", nearer),
    "response of the rate": ("biased", small_response(0, "end.rate", "2/5", "3/5")),
    "response of the turn": ("biased", small_response(1, "end.angle", "3/5", "13/20")),
    "held torque": ("bent", reversed_torque),
    "highest V": ("bent", lower),
    "limit": ("bent", scaled(("limit", "1/20"))),
    "end of the angle": ("biased", scaled(("end.angle", "9/10"))),
    "end of the rate": ("biased", scaled(("end.rate", "1/1000"))),
    "settling": ("bent", scaled(("settling", "1/1000"))),
}


QUICK = ("samples", "held torque", "turns from rest")


@pytest.mark.parametrize("hypothesis", [pytest.param(h, marks=[pytest.mark.slow] * (h not in QUICK)) for h in FALSE])
def test_only_this_hypothesis_about_appendages_fails_and_a_flight_contradicts_the_claim(hypothesis):
    name, change = FALSE[hypothesis]
    content = copy.deepcopy(content_of(name))
    (claim,) = content["claims"]
    change(content, claim)
    assert failing(claim, content["programs"]) == {hypothesis}
    assert not all(Swaying(content, seed, 32).holds(20.0 if name == "bent" else 300.0) for seed in range(3))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bent", "biased"])
def test_nothing_false_is_accepted(name):
    def true(content, claim):
        return claim["theorem"] == "points with appendages" and Swaying(content, 1, 32).holds(20.0)

    count = fewer(200)
    assert refusals(content_of(name), random.Random(name), count, true) > count / 2
