"""Claims of station keeping through the kernel: what is proved, by how much, and what is refused."""

import copy
import json
import time

import pytest

from starhold.algebra.polynomial import Polynomial
from starhold.certification.invariant.theorems import program
from starhold.kernel.check import check
from starhold.kernel.numbers import RefusedError, rational
from starhold.kernel.programs import digest
from tests.kernel.certificates import failing, rekeyed, text
from tests.kernel.mutations import refusals
from tests.kernel.stations import BEST, REST, SOFT, StationOracle, certify_station, flown, loop_of, proof
from tests.tiers import WHOLE, leading, source

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
COUNT = 100 if WHOLE else 60


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


@pytest.mark.parametrize("name", leading(MADE, 1))
def test_nothing_false_is_accepted(name):
    def true(content, claim):
        return StationOracle(content, claim).holds()

    assert refusals(made(name), source(name), COUNT, true) > COUNT / 3


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
    ("deficit", "numbers", {"z": "2", "control": "7/2"}, "on the circle"),
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


# Steps that come after a program's own: an operand counts from the first of the program, or back from the step, or names an
# output.
DISTANCE = [["product", 1, 1], ["product", 2, 2], ["plus", -1, -2], ["product", 0, 0], ["plus", -1, -2]]
ROOTED = [["sqrt", -1], ["minus", -1, -1], ["plus", "out", -1]]
"""What adds nothing, but where the last has no root has no value."""
PUSHED = [
    ("relay", "law", 0, [["constant", "1"], ["plus", "out", -1]], "the plane is not left"),
    ("relay", "law", 1, [["constant", "1000"], ["plus", "out", -1]], "the drift"),
    ("relay", "law", 1, [["constant", "1"], ["divide", -1, 34], ["select", 32, -1, 25], ["plus", "out", -1]], "the relay"),
    ("circle", "lyapunov", 0, [["minus", "out", 0]], "V is a sum of squares"),
    ("rest", "rest", 0, [["constant", "1"], ["plus", "out", -1]], "rest is one"),
    ("limited axis", "field", 0, [["constant", "1"], ["plus", "out", -1]], "the field along X"),
    ("limited axis", "law", 0, [["constant", "1"], ["plus", "out", -1]], "the law along X"),
    ("limited axis", "law", 1, [["constant", "1000"], ["plus", "out", -1]], "Y can be held"),
    ("limited axis", "law", 2, [["constant", "1000"], ["plus", "out", -1]], "Z can be held"),
    ("circle", "law", 0, [["plus", "out", 1]], "x is on its own"),
    # A limit that lets twice as much act on one side, or nothing.
    ("limited axis", "limited", 0,
     [["plus", 5, 5], ["less", 0, -1], ["select", -1, -2, 0], ["select", 4, 3, -1]], "limited at least"),
    ("limited axis", "limited", 0,
     [["plus", 3, 3], ["less", -1, 0], ["select", -1, -2, 0], ["select", 6, 5, -1]], "limited at most"),
    ("limited axis", "limited", 0,
     [["constant", "0"], ["less", "out", -1], ["select", -1, "out", -2]], "limited near from below"),
    ("limited axis", "limited", 0,
     [["constant", "0"], ["less", -1, "out"], ["select", -1, "out", -2]], "limited near from above"),
]  # fmt: skip


MULTIPLIERS = {
    "limited at most": {"limited near from below 1": ["0", "32"], "limited near from above 1": ["0", "96"]},
    "limited near from below": {"limited near from above 0": ["0", "0", "4"]},
    "limited near from above": {"limited near from below 0": ["0", "0", "4"]},
}
"""Evidence that an interior point does not find, because it has no interior."""


def push(content, role, place, steps):
    """Change an output of a program by further steps."""
    (claim,) = content["claims"]
    program = content["programs"][claim["programs"][role]]
    for name, *operands in steps:
        last = len(program["inputs"]) + len(program["steps"])
        back = {"out": program["outputs"][place], -1: last - 1, -2: last - 2}
        program["steps"].append([name, *(operands if name == "constant" else (back.get(k, k) for k in operands))])
    program["outputs"][place] = last
    return rekeyed(content)


@pytest.mark.parametrize(("name", "role", "place", "steps", "hypothesis"), PUSHED)
def test_only_this_hypothesis_about_a_program_fails_and_the_claim_is_false(name, role, place, steps, hypothesis):
    content = push(made(name), role, place, steps)
    (claim,) = content["claims"]
    told = MULTIPLIERS.get(hypothesis, {})
    claim["evidence"] |= {key: {"multipliers": m, "cofactors": [], "gram": [["0"]]} for key, m in told.items()}
    assert failing(claim, content["programs"]) == {hypothesis}
    assert not all(StationOracle(content, claim, seed).holds() for seed in range(3))


def test_the_circle_that_asks_for_more_is_that_of_the_errors():
    """Errors that vanish at a place off the circle, where the law asks for more."""
    content = push(made("deficit"), "errors", 0, [["constant", "3/2"], ["product", 1, -1], ["minus", "out", -1]])
    (claim,) = content["claims"]
    claim["numbers"] |= {"z": "2", "control": "7/2"}
    assert failing(claim, content["programs"]) == {"the errors are those of a circle"}
    assert not StationOracle(content, claim).holds()


def test_the_slope_of_the_field_has_the_root_that_is_told():
    """The law damps as for a point that repels more."""
    content = made("limited axis")
    (claim,) = content["claims"]
    claim["subject"]["gains.k_x"] = "30"
    root = str(30 / rational(claim["subject"]["gains.k_velocity.0"]))
    claim["numbers"] |= {"root.low": root, "root.high": root}
    assert failing(claim, content["programs"]) == {"its root"}
    assert not StationOracle(content, claim).holds()


def test_errors_of_the_velocity_that_make_v_smaller_grow():
    """y'' and z'' for which V = f1^2 - f2^2 + f3^2 falls, while f2 grows."""
    x, y, z, u, v, w = (Polynomial.variable(f"{name}.{k}") for name in ("position", "velocity") for k in range(3))
    f1, f2, f3 = y * y + z * z - 1, v + z, w - y
    control = -1 * x - 2 * u, 2 * f1 * y + f2 - w, -2 * f1 * z - f3 + v
    V = (f1 * f1 - f2 * f2 + f3 * f3) / 2
    functions = {"field": (0 * x,) * 3, "law": control, "errors": (f1, f2, f3), "lyapunov": (V,)}
    names = [f"{name}.{k}" for name in ("position", "velocity") for k in range(3)]
    roles = {role: program(parts, names) for role, parts in functions.items()}
    for role in ("law", "errors", "lyapunov"):
        roles[role]["inputs"] = [f"measurement.{name}" for name in names]
    content = made("circle")
    (claim,) = content["claims"]
    claim |= {"programs": {role: digest(one) for role, one in roles.items()}, "subject": {}}
    content["programs"] = {digest(one): one for one in roles.values()}
    assert failing(claim, content["programs"]) == {"V is positive"}
    assert not StationOracle(content, claim).holds()


@pytest.mark.parametrize(
    ("steps", "clear", "hypothesis"),
    [
        ([["product", 0, 1]], "1/2", "a root has a value"),
        ([*DISTANCE, ["constant", "1/2"], ["minus", -2, -1]], "4/5", "off it on the whole set"),
        ([*DISTANCE, ["constant", "2"], ["minus", -2, -1]], "11/5", "off the line of the bodies"),
    ],
)
def test_only_this_hypothesis_fails_and_a_root_has_no_value_somewhere(steps, clear, hypothesis):
    content = push(made("full"), "field", 0, [*steps, *ROOTED])
    (claim,) = content["claims"]
    claim["numbers"]["clear"] = clear if "off" in hypothesis else claim["numbers"]["clear"]
    assert failing(claim, content["programs"]) == {hypothesis}
    with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
        StationOracle(content, claim).holds()


VALUELESS = [
    # Zero times what has no value at x = 0, where no body is, at most places, or at the place that is told.
    ("rest", [["divide", 0, 1], ["minus", -1, -1], ["plus", "out", -1]], "a divisor may be zero"),
    ("x leaves", [["divide", 0, 1], ["minus", -1, -1], ["plus", "out", -1]], "a divisor may be zero"),
    ("rest", [["product", 0, 0], ["sqrt", -1], ["divide", 1, -1], ["minus", -1, -1], ["plus", "out", -1]], "may be zero"),
    ("rest", [["product", 0, 1], ["sqrt", -1], ["minus", -1, -1], ["plus", "out", -1]], "a root may have no value"),
    ("limited axis", [["divide", 0, 1], ["minus", -1, -1], ["plus", "out", -1]], "a divisor may be zero"),
    ("deficit", [["divide", 0, 0], ["minus", -1, -1], ["plus", "out", -1]], "divides by zero there"),
]


@pytest.mark.parametrize(("name", "steps", "match"), VALUELESS)
def test_zero_times_what_has_no_value_is_none(name, steps, match):
    content = push(made(name), "law", 0, steps)
    with pytest.raises(RefusedError, match=match):
        check(text(content))


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
