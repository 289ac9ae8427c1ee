"""Own laws that read what a claim has not in it, or are not the same at both quaternions: nothing is claimed of flights that
these contradict."""

import numpy as np
import pytest

import starhold as sh
from starhold.analysis.departure import covered, departures, start_inside
from starhold.certification.assumptions import ASSUMPTIONS
from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import differences
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import certificate
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.errors import InputError
from starhold.kernel.check import check
from starhold.simulation.lane import fly, label
from tests.kernel.certificates import text
from tests.making import built

LAW = """
from typing import Annotated, NamedTuple

from starhold.algebra.quaternion import vector_part
from starhold.algebra.vector import add, apply, dot, scale
from starhold.laws.interface import Card, Gain

CARD = Card(title="Own", summary="u", sources=("a textbook",), assumptions=("rigid body",), claims="none")


class Gains(NamedTuple):
    d: Annotated[float, Gain("N m s", above=0.0, text="damping")]
    k: Annotated[float, Gain("N m", above=0.0, text="stiffness")]


def torque(measurement, gains, craft, memory):
    e = measurement.external_torque
    u = add(scale(-gains.d, measurement.rate), scale(-gains.k, vector_part(measurement.attitude)))
    return add(u, {told}), memory


def lyapunov(measurement, gains, craft):
    q, w = vector_part(measurement.attitude), measurement.rate
    return 0.5 * dot(w, apply(craft.inertia, w)) + {potential}


def examples():
    return [Gains(0.5, 0.05)]
"""
BALLAST = """
from typing import Annotated, NamedTuple

from starhold.algebra.vector import ZERO, add, cross, scale
from starhold.parts.contract import Card, Parameter, Push

CARD = Card(title="Ballast", summary="more inertia, or momentum", sources=("a textbook",), assumptions=("none",))
ROLE, ACTS = "effector", {acts}


class Params(NamedTuple):
    inertia: Annotated[float, Parameter("kg m^2", text="that it adds")] = 0.0
    momentum: Annotated[float, Parameter("N m s", text="that it has")] = 0.0


def command(applied, params):
    return applied


def reaction(state, command, body, params):
    held = scale(-1.0, cross(body.rate, momentum(state, params)))
    return add(command, held) if ACTS else held


def rates(state, command, body, acceleration, params):
    return None


def momentum(state, params):
    return (params.momentum, 0.0, 0.0)


def applied(state, command, body, params):
    return command


def bound(params, envelope):
    return Push(1e-9, abs(params.momentum))


def error(params, envelope):
    return Push(0.0)


def examples():
    return [Params()]
"""
ADDED = """

def inertia(state, params):
    return ((params.inertia, 0.0, 0.0), (0.0, params.inertia, 0.0), (0.0, 0.0, params.inertia))
"""
PLACE = """
from typing import Annotated, NamedTuple

from starhold.algebra.quantity import Quantity
from starhold.algebra.vector import Vector, scale
from starhold.parts.contract import NO_ERRORS, Card, NoParams

CARD = Card(title="Place", summary="a place", sources=("a textbook",), assumptions=("none",))
ROLE, Params = "sensor", NoParams


class Reading(NamedTuple):
    position: Annotated[Vector, Quantity("m", "position as it is told", "axis")]


def measure(state, memory, params, dice, step):
    return Reading(scale(0.4, state.position)), memory


def error(params):
    return NO_ERRORS


def examples():
    return [Params()]
"""
ALL, ONE, NONE = "scale(3000.0, e)", "(0.0, 3000.0 * e[1], 0.0)", "(0.0, 0.0, 0.0)"
WELL, EVEN = "2.0 * gains.k * (1.0 - measurement.attitude[0])", "gains.k * dot(q, q)"
PULLED = {"orbit": {"altitude": "400 km", "inclination": "50 deg"}, "environment": {"gravity_gradient": True}}
ASKEW = [0.8, 0.36, 0.48, 0.0]


def loop_of(folder, told, potential=WELL, gains=(0.5, 0.05), attitude=None, **tables):
    (folder / "own.py").write_text(LAW.replace("{told}", told).replace("{potential}", potential))
    law = {"name": "own", "file": str(folder / "own.py"), "d": gains[0], "k": gains[1], "quaternion_sign": "as_published"}
    given = {
        "name": "own", "spacecraft": {"inertia": [2.0, 3.0, 4.0]}, "law": [law],
        "simulation": {"duration": "20 min", "control_period": 0.1}, "target": {"mode": "inertial", "attitude": ASKEW},
        "initial": {"attitude": attitude or ASKEW},
    } | tables  # fmt: skip
    return built(sh.scenario(given))


def flown(loop, steps):
    run = label(loop, *fly(loop, steps), 1)
    return run, 2.0 * np.arcsin(np.minimum(np.linalg.norm(run.arrays["attitude_error"][:, 1:], axis=1), 1.0))


def test_a_claim_without_a_told_torque_is_about_no_loop_that_is_told_one(tmp_path):
    """The kernel's claim that is found without gravity has room for its torque, but not for what the law makes of it."""
    quiet, pulled = loop_of(tmp_path, ALL), loop_of(tmp_path, ALL, **PULLED)
    outside = float(make_subject(pulled).modelled_norm)
    recorded = Loop(make_subject(quiet))
    assert Pushed(recorded, Pushes(1.01 * outside)).find(np.radians(10.0)), recorded.failed
    content = certificate(recorded.programs, recorded.claims)
    (proved,) = check(text(content))
    assert "untold-torque" in proved.statement.assumptions
    assert "the law is given no torque from outside" in proved.statement.written()
    (claim,) = content["claims"]
    assert differences(claim, quiet) == []
    assert differences(claim, pulled) == ["its law is given a torque from outside"]
    _, angles = flown(pulled, 12000)
    assert angles[8000:].max() > 100.0 * float(proved.claim.numbers["end.angle"])


@pytest.mark.parametrize("told", [ONE, NONE])
def test_a_law_that_reads_one_component_of_a_told_torque_is_told_of_it(told, tmp_path):
    loop = loop_of(tmp_path, told, **PULLED)
    claim = certify(loop, "", Wanted(pointing=True, alone=True)).claim("pointing")
    run, angles = flown(loop, 12000)
    assert run.arrays["rate"].shape == (12001, 3)
    if told == NONE:
        assert "untold-torque" not in claim.assumptions
        assert angles.max() < claim.numbers["angle"]
    else:
        # What was proved without it, to 0.009 degrees, is false by half.
        assert claim is None or claim.outcome != "proved"
        assert np.degrees(angles[9000:].max()) > 0.5


def test_flights_tell_that_a_law_is_told_of_a_torque(tmp_path):
    from starhold.analysis.departure import Span

    for tables, violated in (({}, False), (PULLED, True)):
        loop = loop_of(tmp_path, ALL, **tables)
        run, _ = flown(loop, 2)
        ((where, how),) = ASSUMPTIONS["untold-torque"].unmet(Span(loop, run))
        assert (where, how) == (violated, "the law is given a torque from outside")


def test_the_other_quaternion_is_outside_the_set_of_an_odd_law_with_an_even_v(tmp_path):
    """V of the law is as low there, and the set is the part with q0 > 0: a flight turns by a full turn."""
    craft = {"spacecraft": {"inertia": [20.0, 30.0, 25.0], "torque_limit": "0.5 N m"}}
    at = {"target": {"mode": "inertial", "attitude": [1, 0, 0, 0]}}
    for q0, inside in ((1.0, True), (-1.0, False)):
        attitude = [q0 * 0.999997, 0.001, 0.002, 0.001]
        attitude = (np.array(attitude) / np.linalg.norm(attitude)).tolist()
        loop = loop_of(tmp_path, NONE, EVEN, (8.0, 3.0), attitude, **craft, **at)
        issued = certify(loop, "", Wanted(pointing=True, alone=True))
        claim = issued.claim("pointing")
        assert claim.outcome == "proved"
        assert start_inside(issued, loop)["pointing"] is inside
        run, angles = flown(loop, 1500)
        left = departures(issued, loop, run)["pointing"]
        begin, _ = covered(issued, loop, run)
        if inside:
            assert (left, begin) == ((), 0.0)
            assert angles.max() < claim.numbers["funnel"][0][1]
        else:
            assert left[0] == (0.0, "it is outside the set")
            assert angles.max() > 3.0
            # It comes from there, and is covered once it is in the set.
            assert angles[round(begin / loop.period) :].max() < claim.numbers["funnel"][0][1]
            assert run.arrays["attitude_error"][round(begin / loop.period), 0] > 0.0


def test_a_law_is_not_even_because_its_card_says_so(tmp_path, monkeypatch):
    """Its claim would hold at the other quaternion too, from which it turns the body by a full turn."""
    monkeypatch.setitem(globals(), "LAW", LAW.replace('claims="none"', 'claims="none", quaternion_sign="even"'))
    with pytest.raises(InputError, match="its torque at q differs from that at -q, but its card says: even"):
        loop_of(tmp_path, NONE, EVEN)
    # One that is.
    by = "scale(measurement.attitude[0], vector_part(measurement.attitude))"
    monkeypatch.setitem(globals(), "LAW", LAW.replace("vector_part(measurement.attitude))", f"{by})", 1))
    assert loop_of(tmp_path, NONE, EVEN).law.card.quaternion_sign == "even"


@pytest.mark.parametrize(
    ("added", "told", "numbers", "there"),
    [
        (ADDED, NONE, {"inertia": 60.0}, False),
        ("", "scale(0.5, measurement.wheel_momentum)", {"momentum": 0.01}, False),
        # A law that does not read it, and momentum that is none.
        ("", NONE, {"momentum": 1e-4}, True),
        ("", "scale(0.5, measurement.wheel_momentum)", {}, True),
    ],
)
def test_no_bound_of_a_torque_is_one_of_inertia_or_of_momentum_that_a_law_reads(added, told, numbers, there, tmp_path):
    """The largest torque of an effector says neither; a flight that was covered by the claim broke it by far."""
    (tmp_path / "ballast.py").write_text(BALLAST.replace("{acts}", str(not added)) + added)
    part = {"file": str(tmp_path / "ballast.py")} | numbers
    attitude = [float(np.cos(0.05)), 0.0, float(np.sin(0.05)), 0.0]
    here = {"target": {"mode": "inertial", "attitude": [1, 0, 0, 0]}}
    loop = loop_of(tmp_path, told, attitude=attitude, part=[part], **here)
    issued = certify(loop, "", Wanted(pointing=True, alone=True))
    claim = issued.claim("pointing")
    assert claim.outcome == "proved"
    run, angles = flown(loop, 6000)
    (time, most), *_ = ((x, y) for x, y in claim.numbers["funnel"] if x > 300.0)
    kept = angles[round(time / loop.period) :].max() <= most
    assert (claim.left_out, kept) == (([], True) if there else (["effector ballast"], False))
    assert (covered(issued, loop, run) is not None) is there


def test_errors_of_an_attitude_are_none_of_a_place_at_which_a_torque_is_told(tmp_path):
    """A sensor that says how wrongly it tells attitude and rate at most, which is not at all, tells a place far too low."""
    (tmp_path / "place.py").write_text(PLACE)
    loop = loop_of(tmp_path, "scale(-1.0, e)", part=[{"file": str(tmp_path / "place.py")}], **PULLED)
    issued = certify(loop, "", Wanted(pointing=True, alone=True))
    claim = issued.claim("pointing")
    assert (claim.outcome, claim.left_out) == ("proved", ["sensor place"])
    assert covered(issued, *(loop, flown(loop, 3)[0])) is None
    _, angles = flown(loop, 12000)
    assert angles[11000:].max() > 1.2 * claim.numbers["angle"]
