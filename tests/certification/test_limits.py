"""Limits of which claims speak are the lowest that fly: a torque limit beside wheels, a motor's power, momentum that
friction moves from wheel to wheel."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from starhold.analysis.departure import departures
from starhold.certification.certify import Wanted, certify
from starhold.certification.comparison import _numbers as numbers_apart
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import read
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.kernel.loops import AttitudeLoop
from starhold.kernel.numbers import Account
from starhold.kernel.theorems.limits import within_limits
from starhold.kernel.theorems.pointing import points
from starhold.laws import wheel
from starhold.parts.effectors.layouts import pyramid, three_orthogonal
from starhold.parts.effectors.wheels import State
from starhold.simulation.lane import fly, label
from tests.certification.loops import rotors
from tests.making import on_wheels

GAINS = wheel.Gains(0.3, (0.015, 0.015, 0.015))


def limits_of(loop):
    return Loop(make_subject(loop)).limits


def test_a_limit_of_the_torque_beside_that_of_the_wheels_is_kept_too():
    loop = rotors("wheel", GAINS)
    assert {name[:6] for name in limits_of(loop)} == {"motors", "stored"}
    limited = replace(loop, limit="axis", craft=loop.craft._replace(torque_limit=1e-3))
    assert limits_of(limited) == limits_of(loop) | {"limit": 1e-3}
    # What the wheels surely give together is no limit of the command.
    assert limits_of(replace(limited, command_limit=0.5)) == limits_of(loop) | {"limit": 0.5}
    assert limits_of(replace(limited, limit="norm")) == limits_of(loop) | {"limit.norm": 1e-3}


def test_a_motor_gives_no_more_than_its_power_leaves_when_the_wheel_is_full():
    loop = on_wheels(rotors("wheel", GAINS), power_limit=(0.5,) * 4)
    # 1 N m s in a rotor of 1e-3 kg m2 is 1000 rad/s.
    assert [limits_of(loop)[f"motors.{k}"] for k in range(4)] == [5e-4] * 4


def test_a_claim_within_other_limits_is_not_about_the_loop():
    loop = rotors("wheel", GAINS)
    found = Loop(make_subject(loop))
    told = {name: str(Fraction(x)) for name, x in found.limits.items()}

    def apart(other, numbers):
        claim = found.claim("converges", found.words, None) | {"numbers": numbers}
        return list(numbers_apart(claim, Loop(make_subject(other))))

    assert apart(loop, told) == []
    assert apart(on_wheels(loop, power_limit=(0.5,) * 4), told) == [f"motors.{k} is lower" for k in range(4)]
    limited = replace(loop, limit="norm", craft=loop.craft._replace(torque_limit=1e-3))
    assert apart(limited, told) == ["the limit is not stated"]
    assert apart(limited, told | {"limit.norm": "1/1000"}) == []
    # Three components within the limit may have a norm beyond it.
    assert apart(limited, told | {"limit": "1/1000"}) == ["the limit is one of another kind"]


def test_a_motor_has_room_for_what_the_law_is_told_wrongly_and_a_wheel_for_what_is_uneven_between_samples():
    Account.left = 10**12
    found = Loop(make_subject(rotors("wheel", GAINS)))
    own = Pushed(found, Pushes(1e-5))
    claim = own.claim(own.leans[0][1], own.numbers | found.limits | {"level": 1e-4})
    loop = AttitudeLoop(read(claim, found.by_digest))
    ways = ({}, {"less": Fraction(1, 100)}, {"between": Fraction(1, 50)})
    exact, misread, uneven = (dict(within_limits(loop, **way)) for way in ways)
    rows = np.linalg.pinv(np.array(pyramid()).T / np.linalg.norm(pyramid(), axis=1))
    assert {name.split()[0] for name in exact} == {"motor", "wheel"}
    for name, o in exact.items():
        size, motor = np.linalg.norm(rows[int(name.split()[1].strip("+-")) - 1]), name.startswith("motor")
        for less, wanted in ((misread, 0.01 * size * motor), (uneven, 0.02 * size * (not motor))):
            assert wanted <= float((o.p - less[name].p).number) <= wanted * (1.0 + 1e-9), name


@pytest.mark.slow
def test_friction_and_a_lag_leave_less_room_in_a_wheel_between_samples():
    Account.left = 10**12
    found = Loop(make_subject(rotors("wheel", GAINS)))

    def room(friction, late):
        """What the claim leaves of a wheel's room at samples, in N m s."""
        own = Pushed(found, Pushes(1e-5))
        more = {"error": friction, "late.torque.mean": 0.5, "late.torque.kept": 0.1, "late.torque.weight": 1.0}
        more |= {"late.torque.begun": 0.0, "late.torque.rest": late}
        numbers = own.numbers | found.limits | {"level": 1e-6, "highest": 1.0, "end.angle": 1.0, "end.rate": 1.0}
        claim = own.claim(own.leans[0][1], numbers | {k: x for k, x in more.items() if late or k == "error"})
        steps = points(read(claim | {"theorem": "points"}, found.by_digest))
        return next(float(o.p.at(dict.fromkeys(o.p.names, 0)).number) for name, o in steps if name == "wheel +1")

    h, (row, *_) = found.loop.period, np.linalg.pinv(np.array(pyramid()).T / np.linalg.norm(pyramid(), axis=1))
    even = room(0.0, 0.0)
    for friction, late in ((1e-3, 0.0), (1e-3, 2e-3)):
        assert even - room(friction, late) > 0.999 * h / 2.0 * (friction + late) * np.linalg.norm(row)


@pytest.mark.slow
@pytest.mark.parametrize("layout", [pyramid, three_orthogonal])
def test_friction_fills_a_rotor_of_four_with_what_others_keep(layout):
    """Coulomb friction takes most from where rotors turn against one another, until one has what three would share."""
    loop = on_wheels(rotors("wheel", GAINS, layout=layout), coulomb=(3e-4,) * len(layout()))
    wheels = loop.find("wheels")
    axes = np.array(wheels.params.axes)
    # As little in all rotors as the momentum allows.
    begun = np.linalg.pinv(axes.T) @ (0.4 * axes[0])
    loop = loop.with_parts(replace(wheels, start=State(tuple(begun.tolist()))))
    certificate = certify(loop, "", Wanted(pointing=True, alone=True, momentum=0.42))
    claim = certificate.claim("pointing")
    assert claim.outcome == "proved"
    assert ("spare-momentum" in claim.assumptions) == (len(axes) > 3)
    run = label(loop, *fly(loop, 15_000), 1)
    most = np.abs(run["wheel_momentum"]).max(axis=0)
    assert (most[0] > 1.25 * begun[0]) == (len(axes) > 3)
    # The same wheels, of which each is full with little more than it has at the start.
    small = on_wheels(loop, momentum_limit=(1.1 * float(begun[0]),) * len(axes))
    left = [one.how for one in departures(certificate, small, run)["pointing"]]
    assert ("a wheel is full" in left) == (len(axes) > 3)
