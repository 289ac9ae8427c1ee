"""Claims of station keeping through the kernel: what is proved, by how much, and what is refused."""

import copy
import json
import random
import time

import pytest

from starhold.algebra.polynomial import Polynomial
from starhold.certification.invariant.theorems import program
from starhold.kernel.check import check
from starhold.kernel.numbers import RefusedError
from starhold.kernel.programs import digest
from tests.kernel.certificates import failing, rekeyed, text
from tests.kernel.mutations import refusals
from tests.kernel.stations import BEST, REST, SOFT, StationOracle, certify_station, flown, loop_of, proof
from tests.tiers import WHOLE, leading

ROUND = {"level": 0.49999952, "outer": 1.4142133, "velocity": 0.9999995}
WITHIN = {
    "smooth": {"level": 0.030478, "outer": 1.116644, "velocity": 0.246894},
    "relay with layer": {"level": 0.026367, "outer": 1.108892, "velocity": 0.229641},
}
CIRCLES = [
    ("l2-circle", "smooth"),
    ("l2-circle", "relay with layer"),
    ("l2-deficit", "deficit 5"),
    ("l2-nonlinear", "full model"),
]
PEAK = 3.4295901709068626
RELAY = SOFT._replace(boundary_layer=0.0)
MADE = {
    "circle": lambda: flown("l2-circle", "smooth"),
    "layer": lambda: certify_station(loop_of(SOFT)),
    "full": lambda: flown("l2-nonlinear", "full model"),
    "limit": lambda: certify_station(loop_of(BEST, 1.1 * PEAK)),
    "limit by axis": lambda: certify_station(loop_of(SOFT, 3.6, "axis")),
    "deficit": lambda: flown("l2-deficit", "deficit 5"),
    "relay": lambda: certify_station(loop_of(RELAY)),
    "rest": lambda: certify_station(loop_of(REST)),
    "limited axis": lambda: certify_station(loop_of(REST, 4.0, "axis")),
    "x leaves": lambda: certify_station(loop_of(BEST._replace(k_x=8.0))),
}
PLACES = {"limit": 1, "limit by axis": 1, "deficit": 1, "limited axis": 1}
COUNT = 400 if WHOLE else 60


def made(name):
    return copy.deepcopy(proof(MADE[name](), PLACES.get(name, 0)))


@pytest.mark.parametrize(("scenario", "law"), CIRCLES)
def test_the_circle_attracts_as_far_as_before(scenario, law):
    numbers = flown(scenario, law).claim("circle").numbers
    assert all(numbers[name] >= 0.98 * least for name, least in ROUND.items())
    assert numbers["inner"] < 0.0007


@pytest.mark.parametrize("law", WITHIN)
def test_the_control_stays_within_its_limit_as_far_as_before(law):
    numbers = flown("l2-circle", law).claim("control-limit").numbers
    assert all(numbers[name] >= 0.98 * least for name, least in WITHIN[law].items())


@pytest.mark.parametrize("name", MADE)
def test_proofs_hold_and_take_no_time(name):
    content = made(name)
    started = time.process_time()
    (proved,) = check(text(content))
    assert time.process_time() - started < 0.5
    assert proved.statement.text
    assert all(StationOracle(content, content["claims"][0], seed).holds() for seed in range(3))


@pytest.mark.parametrize("name", leading(MADE, 2))
def test_nothing_false_is_accepted(name):
    def true(content, claim):
        return StationOracle(content, claim).holds()

    assert refusals(made(name), random.Random(name), COUNT, true) > COUNT / 3


FALSE = [
    ("circle", "numbers", {"level": "50001/100000"}, "centre outside"),
    ("circle", "numbers", {"inner": "0"}, "inner circles"),
    ("circle", "numbers", {"outer": "3/2"}, "outer circles"),
    ("circle", "numbers", {"velocity": "1"}, "errors of the velocity"),
    ("circle", "subject", {"gains.k": "-1"}, "V does not increase"),
    ("circle", "subject", {"gains.rate": "0"}, "the circle is run through"),
    ("circle", "subject", {"gains.k_x": "44/5"}, "x returns"),
    ("circle", "subject", {"gains.k_velocity": "-1"}, "x returns"),
    ("limit", "numbers", {"limit.norm": "18/5"}, "norm of the control"),
    ("limit by axis", "numbers", {"limit.axis": "3"}, "control"),
    ("limited axis", "numbers", {"width": "1/2"}, "the limit turns motions round"),
    ("limited axis", "numbers", {"reach": str(10**16)}, "the law turns motions round"),
    ("limited axis", "subject", {"gains.k_x": "20"}, "the law turns motions round"),
    ("limited axis", "numbers", {"reach": "1/10"}, "x follows"),
    ("limited axis", "numbers", {"boundary": "2/5"}, "nothing returns from beyond"),
    ("deficit", "numbers", {"limit.norm": "7/2"}, "more than the limit"),
    ("deficit", "numbers", {"control": "100"}, "control"),
    ("relay", "numbers", {"radius": "1"}, "another circle"),
    ("rest", "subject", {"gains.k_x": "8"}, "returns"),
    ("rest", "subject", {"gains.k_velocity.1": "-1"}, "returns"),
]


@pytest.mark.parametrize(("name", "part", "changed", "hypothesis"), FALSE)
def test_only_this_hypothesis_fails_and_the_claim_is_false(name, part, changed, hypothesis):
    content = made(name)
    (claim,) = content["claims"]
    claim[part] |= changed
    assert failing(claim, content["programs"]) == {hypothesis}
    assert not all(StationOracle(content, claim, seed).holds() for seed in range(3))


# Steps that come after a program's own: an operand counts from the first of the program, or names an output.
PUSHED = [
    ("relay", "law", 0, [["constant", "1"], ["plus", "out", -1]], "the plane is not left"),
    ("relay", "law", 1, [["constant", "1000"], ["plus", "out", -1]], "the drift"),
    ("relay", "law", 1, [["constant", "1"], ["divide", -1, 34], ["select", 32, -1, 25], ["plus", "out", -1]], "the relay"),
    ("circle", "lyapunov", 0, [["minus", "out", 0]], "V is a sum of squares"),
    ("rest", "rest", 0, [["constant", "1"], ["plus", "out", -1]], "rest is one"),
    ("limited axis", "field", 0, [["constant", "1"], ["plus", "out", -1]], "the field along X"),
    ("limited axis", "law", 0, [["constant", "1"], ["plus", "out", -1]], "the law along X"),
    ("limited axis", "law", 1, [["constant", "1000"], ["plus", "out", -1]], "Y can be held"),
]


def push(content, role, place, steps):
    """Change an output of a program by further steps."""
    (claim,) = content["claims"]
    program = content["programs"][claim["programs"][role]]
    for name, *operands in steps:
        last = len(program["inputs"]) + len(program["steps"])
        known = {"out": program["outputs"][place], -1: last - 1}
        program["steps"].append([name, *(operands if name == "constant" else (known.get(k, k) for k in operands))])
    program["outputs"][place] = last
    return rekeyed(content)


@pytest.mark.parametrize(("name", "role", "place", "steps", "hypothesis"), PUSHED)
def test_only_this_hypothesis_about_a_program_fails_and_the_claim_is_false(name, role, place, steps, hypothesis):
    content = push(made(name), role, place, steps)
    (claim,) = content["claims"]
    assert failing(claim, content["programs"]) == {hypothesis}
    assert not all(StationOracle(content, claim, seed).holds() for seed in range(3))


def test_an_axis_that_another_one_moves_may_return():
    """x'' = -3x' - y, y'' = x - 2y - 3y': along x nothing pulls back but y, and all motions come to rest."""
    x, y, z, u, v, w = (Polynomial.variable(f"{name}.{k}") for name in ("position", "velocity") for k in range(3))
    content = made("x leaves")
    (claim,) = content["claims"]
    roles = {
        "field": program((0 * x - y, x - 2 * y, 0 * z - z), [f"position.{k}" for k in range(3)]),
        "law": program(tuple(-3 * a for a in (u, v, w)), [f"velocity.{k}" for k in range(3)]),
    }
    roles["law"]["inputs"] = [f"measurement.{name}" for name in roles["law"]["inputs"]]
    claim |= {"programs": {role: digest(one) for role, one in roles.items()}, "subject": {}}
    content["programs"] = {digest(one): one for one in roles.values()}
    assert failing(claim, content["programs"]) == {"an axis on its own"}
    assert not StationOracle(content, claim).holds()


def refused(name, match, **numbers):
    content = made(name)
    content["claims"][0]["numbers"] |= {key.replace("_", "."): str(value) for key, value in numbers.items()}
    with pytest.raises(RefusedError, match=match):
        check(json.dumps(content))


def test_each_number_is_needed():
    refused("circle", "nothing depends on clear", clear="1/1000")
    refused("full", "off it on the whole set", clear="1/100")
    refused("limited axis", "its root", root_low="3")
    refused("limited axis", "its root", root_high="29/10")
    refused("deficit", "on the circle|circle", y="1/10")
    refused("relay", "does not hold", radius="11/10")


@pytest.mark.parametrize(
    ("name", "key", "value", "match"),
    [
        ("circle", "gains.alpha", "-1", "V is"),
        ("circle", "plant.stiffness", "4", "V does not increase|x is"),
        ("circle", "craft.rate", "2", "V does not increase|x is"),
        ("layer", "gains.boundary_layer", "0", "V does not increase"),
        ("limited axis", "gains.y", "2", "can be held"),
        ("relay", "gains.boundary_layer", "1/1000", "has a layer"),
        ("x leaves", "gains.k_x", "10", "every axis returns|axis"),
    ],
)
def test_each_number_of_the_loop_matters(name, key, value, match):
    content = made(name)
    content["claims"][0]["subject"][key] = value
    with pytest.raises(RefusedError, match=match):
        check(json.dumps(content))


def test_another_model_than_the_one_that_is_flown_is_no_proof():
    content, linear = made("full"), made("circle")
    content["programs"] |= linear["programs"]
    content["claims"][0]["programs"]["law"] = linear["claims"][0]["programs"]["law"]
    content["programs"] = {n: p for n, p in content["programs"].items() if n in content["claims"][0]["programs"].values()}
    with pytest.raises(RefusedError):
        check(json.dumps(content))


def test_a_limit_that_cuts_in_another_way_is_no_clip():
    content = made("limited axis")
    name = content["claims"][0]["programs"]["limited"]
    program = content["programs"][name]
    program["steps"].append(["plus", program["outputs"][0], program["outputs"][0]])
    program["outputs"][0] = len(program["inputs"]) + len(program["steps"]) - 1
    with pytest.raises(RefusedError, match="limited"):
        check(json.dumps(rekeyed(content)))
