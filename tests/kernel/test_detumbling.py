"""The theorem about a law that opposes the change of the magnetic field: flown against the worst of what may act, changed in
one place, and without each of its hypotheses."""

import copy
import random
from fractions import Fraction
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.scalar import divide, less, where
from starhold.algebra.vector import ZERO, add, cross, dot, scale, subtract
from starhold.certification.comparison import differences
from starhold.certification.evidence.detumbling import find_detumbling
from starhold.certification.evidence.finding import certificate, read
from starhold.certification.evidence.recorded import ASKED
from starhold.certification.subject import make_subject
from starhold.kernel.check import check
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import RefusedError, rational
from starhold.kernel.theorems import detumbling
from starhold.laws import b_dot
from starhold.loop.modes import loop_of_mode
from starhold.parts.contract import NoParams, Push
from starhold.parts.part import Fitted, Part
from starhold.scenario.building import build
from starhold.trace.straight_line import straight_line
from tests.kernel.certificates import failing, rekeyed, text, with_program
from tests.kernel.mutations import refusals
from tests.kernel.tumbling import Tumbling
from tests.making import built
from tests.tiers import WHOLE


@cache
def tumbling(scenario="cubesat-detumble", law="b-dot"):
    """The certificate of a law, or of the first mode of one."""
    loop = built(scenario, law)
    loop = loop if law != "mission" else loop_of_mode(loop, 0)
    found = find_detumbling(make_subject(loop))
    assert not found.failed
    return certificate(found.programs, found.claims)


def flown(content, **more):
    return Tumbling(content, content["claims"][0], **more)


def changed(number, factor, content=None):
    """The certificate with another number."""
    content = copy.deepcopy(content or tumbling())
    numbers = content["claims"][0]["numbers"]
    numbers[number] = str(rational(numbers[number]) * rational(factor))
    return content


@pytest.mark.parametrize("loop", [(), ("cubesat-detumble", "quick"), ("cubesat-mission", "mission")])
def test_no_flight_breaks_the_claim_and_the_worst_comes_near_its_rise(loop):
    flights = flown(tumbling(*loop))
    assert flights.holds()
    # Of what is proved the flights reach a third or more at some rate.
    assert 0.3 < flights.highest < 1.0


def test_the_claim_says_its_numbers():
    (proved,) = check(text(tumbling()))
    said = proved.statement.written()
    assert proved.statement.label == "detumbling"
    assert "rods of up to 0.2 A m2" in said
    assert "no wheels turn" in said
    (proved,) = check(text(tumbling("cubesat-mission", "mission")))
    assert "wheels that keep up to 0.0057" in proved.statement.written()
    assert "wheels keep their momentum" in proved.statement.written()


SAYS_MORE = {
    "energy falls": ("above.1", "99/100"),
    "energy falls by a part": ("fall.1", "101/100"),
    "energy rises": ("rise.1", "99/100"),
    "least moment": ("inertia.low", "101/100"),
    "largest moment": ("inertia.high", "99/100"),
    "turns too far": ("rate.0", "4"),
    "gyroscopic": ("gyroscopic", "1/2"),
}


@pytest.mark.parametrize("hypothesis", SAYS_MORE)
def test_a_claim_that_says_more_is_refused(hypothesis):
    with pytest.raises(RefusedError, match=hypothesis):
        check(text(changed(*SAYS_MORE[hypothesis])))


def test_rods_that_are_too_weak_are_refused_where_the_law_asks_for_more():
    with pytest.raises(RefusedError, match="at the limit"):
        check(text(changed("dipole.limit", "1/100")))


BEYOND = {"outside": 30.0, "outside.across": 10.0, "field.change": 5.0, "dipole.limit": 0.02}


@pytest.mark.parametrize("number", BEYOND)
def test_what_acts_beyond_what_is_told_breaks_the_claim(number):
    content = tumbling()
    acting = float(rational(content["claims"][0]["numbers"][number])) * BEYOND[number]
    assert not flown(content, beyond={number: acting}).holds()


def test_wheels_that_keep_more_break_the_claim():
    content = tumbling("cubesat-mission", "mission")
    assert not flown(content, beyond={"stored": 0.2}).holds()
    with pytest.raises(RefusedError, match="nothing depends on stored"):
        check(text(unworded(content)))


def unworded(content):
    content = copy.deepcopy(content)
    content["claims"][0]["taken"] = []
    return content


def along(measurement, gains, craft, memory):
    """Speeds the body up."""
    torque, memory = b_dot.torque(measurement, gains, craft, memory)
    return scale(-1.0, torque), memory


def stale(measurement, gains, craft, memory):
    """Remembers its first measurement alone."""
    return b_dot.torque(measurement, gains, craft, memory)[0], memory


def idle(measurement, gains, craft, memory):
    """Never finds that it has measured before."""
    torque, after = b_dot.torque(measurement, gains, craft, memory)
    return torque, after._replace(known=memory.known)


def undivided(measurement, gains, craft, memory):
    dipole = scale(-gains.k / measurement.period, subtract(measurement.magnetic_field, memory.field))
    return cross(dipole, measurement.magnetic_field), b_dot.Memory(measurement.magnetic_field, 1.0)


def switching(measurement, gains, craft, memory):
    """Opposes half of fields' changes alone."""
    torque, memory = b_dot.torque(measurement, gains, craft, memory)
    return scale(where(less(0.0, measurement.magnetic_field[0]), 1.0, -1.0), torque), memory


def halved(measurement, gains, craft, memory):
    """Divides by twice the field's square."""
    field = measurement.magnetic_field
    square = dot(field, field)
    share = where(less(0.0, square), divide(-gains.k / measurement.period, 2.0 * square), 0.0)
    dipole = scale(memory.known * share, subtract(field, memory.field))
    return cross(dipole, field), b_dot.Memory(field, where(less(0.0, square), 1.0, 0.0))


def drifting(measurement, gains, craft, memory):
    field = measurement.magnetic_field
    torque, memory = b_dot.torque(measurement, gains, craft, memory)
    return add(torque, scale(1e-5 * divide(1.0, dot(field, field)), cross((1.0, 0.0, 0.0), field))), memory


def with_law(law):
    """The certificate about another law."""
    gains, craft = b_dot.examples()[0], None
    memory = b_dot.remember(gains, craft, 1.0)
    program = straight_line(law, measurement=ASKED, gains=gains, craft=craft, memory=memory)
    return with_program(copy.deepcopy(tumbling()), "law", program)


@pytest.mark.parametrize("law", [along, stale, idle, undivided, switching, halved, drifting])
def test_a_law_that_does_something_else_is_refused_and_breaks_the_claim(law):
    content = with_law(law)
    assert not flown(content).holds()
    with pytest.raises(RefusedError):
        check(text(content))


def test_that_the_law_divides_by_the_square_of_the_field_is_a_hypothesis_of_its_own():
    content = with_law(halved)
    assert failing(content["claims"][0], content["programs"]) == {"square of the field"}


@pytest.mark.parametrize(("number", "factor"), [("outside", 1000), ("outside.across", 10), ("stored", 2)])
def test_each_torque_may_turn_the_body_faster(number, factor):
    """The field turns in a body that a torque begins to turn, so that it has to turn faster for its energy to fall."""
    content = changed(number, str(factor), tumbling("cubesat-mission", "mission"))
    more = power_of(content) - power_of(tumbling("cubesat-mission", "mission"))
    numbers = {name: rational(x) for name, x in content["claims"][0]["numbers"].items()}
    torque = numbers[number] * (1 - Fraction(1, factor)) * (numbers["rate.0"] if number == "stored" else 1)
    assert more >= torque / numbers["inertia.low"]


def power_of(content):
    """How fast rates may begin to change, as the power of what is across the field has it."""
    claim = content["claims"][0]
    loop = AttitudeLoop(read(claim, content["programs"]), quotients=True)
    numbers, h = loop.claim.numbers, loop.claim.subject["measurement.period"]
    others = detumbling.power_at(loop, numbers["rate.0"]).others
    return (detumbling.value(others, 0) - numbers["rate.0"] * numbers["outside"]) / (h * numbers["outside.across"])


def led(measurement, gains, craft, memory):
    """Does more where the target moves, of which the claim says nothing."""
    torque, memory = b_dot.torque(measurement, gains, craft, memory)
    return add(torque, scale(1e-3, measurement.target_rate)), memory


def told_of(measurement, gains, craft, memory):
    torque, memory = b_dot.torque(measurement, gains, craft, memory)
    return add(torque, scale(1e3, measurement.external_torque)), memory


@pytest.mark.parametrize("law", [led, told_of])
def test_a_law_that_is_told_of_more_than_the_field_is_refused(law):
    """Where nothing is told of it is the law of the claim, and the claim does not assume that."""
    with pytest.raises(RefusedError, match="given more than the field"):
        check(text(with_law(law)))


def test_nothing_false_is_accepted():
    original = tumbling()
    # One rate, so that a change meets what depends on it.
    numbers = original["claims"][0]["numbers"]
    one = {name: x for name, x in numbers.items() if not name[-1].isdigit()} | {
        f"{name}.0": numbers[f"{name}.1"] for name in ("rate", "above", "often", "fall", "rise")
    }
    original = copy.deepcopy(original)
    original["claims"][0]["numbers"] = one
    assert check(text(rekeyed(original)))

    def true(content, claim):
        return Tumbling(content, claim, lanes=200).holds(1)

    count = 400 if WHOLE else 40
    assert refusals(original, random.Random(5), count, true) > count / 3


def loop_of(r):
    """A random body, gain, period, orbit and disturbance."""
    moments = np.sort(r.uniform(0.02, 0.1, 3))
    moments[2] = min(moments[2], 0.95 * (moments[0] + moments[1]))
    turn, _ = np.linalg.qr(r.normal(size=(3, 3)))
    inertia = turn @ np.diag(moments) @ turn.T
    period, rate = float(r.choice([0.25, 0.5, 1.0, 2.0])), r.normal(size=3)
    rate *= np.radians(r.uniform(0.5, 8.0)) / np.linalg.norm(rate)
    return sh.scenario(
        {
            "name": "tumbling",
            "spacecraft": {"inertia": ((inertia + inertia.T) / 2).tolist()},
            "orbit": {
                "altitude": f"{r.uniform(400, 900):.0f} km", "inclination": f"{r.uniform(20, 110):.0f} deg",
                "epoch": "2026-03-20T12:00:00Z",
            },
            "initial": {"rate": rate.tolist()},
            "environment": {"gravity_gradient": bool(r.integers(2))},
            "simulation": {"duration": "1 h", "control_period": period},
            "part": [
                {"type": "residual-dipole", "dipole": (1e-3 * r.normal(size=3)).tolist()},
                {"type": "magnetometer"},
                {"type": "magnetorquers", "dipole_limit": float(r.uniform(0.05, 1.0))},
            ],
            "law": [{"type": "b-dot", "k": float(10.0 ** r.uniform(-4.5, -2.5))}],
        }
    )  # fmt: skip


@pytest.mark.parametrize("first", [0, pytest.param(10, marks=pytest.mark.slow)])
def test_random_loops_keep_their_claims(first):
    proved = 0
    for seed in range(first, 2 if not first else 60):
        given = loop_of(np.random.default_rng(seed))
        found = find_detumbling(make_subject(build(given, given.laws[0])))
        if found.claims:
            content = certificate(found.programs, found.claims)
            assert check(text(content))
            assert flown(content, seed=seed, lanes=300 if not first else 1000).holds(2), seed
            proved += 1
    assert proved > (0 if not first else 25)


def test_a_limit_of_the_command_is_one_that_the_law_does_not_reach():
    given = loop_of(np.random.default_rng(1)).with_({"spacecraft.torque_limit": "1 mN m"})
    found = find_detumbling(make_subject(build(given, given.laws[0])))
    content = certificate(found.programs, found.claims)
    (proved,) = check(text(content))
    assert "unlimited-torque" not in proved.statement.assumptions
    numbers = content["claims"][0]["numbers"]
    gain = rational(content["claims"][0]["subject"]["gains.k"])
    # What the law asks for where the field does not turn by itself.
    still = gain * rational(numbers["rate.0"]) / rational(numbers["limit"])
    assert still < 1
    with pytest.raises(RefusedError, match="limit 0"):
        check(text(changed("limit", str(still * Fraction(1000001, 1000000)), content)))
    assert "unlimited-torque" in check(text(tumbling()))[0].statement.assumptions


def test_a_claim_is_compared_with_the_loop_that_flies():
    (claim,) = tumbling()["claims"]
    given = sh.load("cubesat-detumble")
    loops = {"": build(given, given.pick("b-dot"))}
    for key, value in OTHER.items():
        other = given.with_({key: value})
        loops[key] = build(other, other.pick("b-dot"))
    apart = {changes: differences(claim, loop) for changes, loop in loops.items()}
    assert apart.pop("") == apart.pop("initial.rate") == []
    assert apart == {
        "part.magnetorquers.dipole_limit": ["dipole.limit is lower"],
        "part.residual-dipole.dipole": ["outside.across is exceeded"],
        "orbit.altitude": ["field.least is lower"],
    }


def test_a_torque_that_grows_with_the_rate_is_compared_at_the_rates_of_the_claim():
    """A flight that begins slowly may come to turn as fast as the claim covers."""
    (claim,) = tumbling()["claims"]
    slow = sh.load("cubesat-detumble").with_({"initial.rate": [0.01, 0.0, 0.0], "environment.gravity_gradient": False})
    loop, told = build(slow, slow.pick("b-dot")), float(Fraction(claim["numbers"]["outside"]))
    rubbing = SimpleNamespace(ROLE="environment", torque=lambda *_: ZERO, bound=lambda *_: Push(0.0, 0.5 * told / 0.01))
    rubs = loop.with_parts(Fitted(Part("rubbing", rubbing), NoParams()))
    assert differences(claim, loop) == []
    assert differences(claim, rubs) == ["outside is exceeded"]


OTHER = {
    "part.magnetorquers.dipole_limit": "0.1 A m^2",
    "initial.rate": ["1 deg/s", "0 deg/s", "0 deg/s"],
    "part.residual-dipole.dipole": ["6 mA m^2", "-3 mA m^2", "4 mA m^2"],
    "orbit.altitude": "700 km",
}


@pytest.mark.parametrize(
    ("part", "without"), [("", []), ("noise", ["sensor magnetometer"]), ("bias", ["sensor magnetometer"])]
)
def test_a_magnetometer_that_errs_is_left_out_by_name(part, without):
    given = loop_of(np.random.default_rng(2))
    errors = {"noise": "100 nT", "bias": ["50 nT", "0 nT", "0 nT"]}
    given = given.with_({f"part.magnetometer.{part}": errors[part]}) if part else given
    (certified,) = sh.certify(given)
    claim = certified.claim("detumbling")
    assert claim.outcome == "proved"
    assert claim.left_out == ["sensor magnetometer"] * bool(part)
    assert certified.outcome == "undecided"
