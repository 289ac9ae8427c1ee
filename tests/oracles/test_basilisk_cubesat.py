"""The built-in CubeSat at nadir flies alike in Basilisk: everything at once, each model alone, and its noise.

Both integrate with the classical Runge-Kutta method at the scenario's step and hold the command, and what the environment is
like, for a control period. In Basilisk its own compiled models fly (see `benchmarks/basilisk_cubesat.py`), under the C that
starhold exports of the law, its filter and its target. What is left between the two, in rad after five minutes:

* magnetic unloading, 1e-8 to 5e-8 with its gain: Basilisk takes the wheels' momentum relative to the body, starhold their
  absolute one, which differ by a share of 1e-5;
* drag, 2e-8: starhold holds the craft's course through the air for a control period, Basilisk does not;
* sunlight, 5e-10: Basilisk sees the Sun from the craft and not from the Earth's centre, on an ellipse, not by the almanac;
* residual dipole, 3e-12: the field's file and its epoch are rounded;
* wheels, oblateness, gravity gradient, 3e-15: quaternions and Rodrigues parameters are cut off otherwise.

In these runs the hub is so heavy that air and light do not push it: starhold has their torques alone. Of 12 kg it would be
26 m and 4e-6 rad away after an orbit.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from starhold.algebra.quaternion import relative
from starhold.laws.pd import Gains
from starhold.scenario.building import build
from starhold.scenario.reading import load
from starhold.simulation.lane import fly, label
from tests.export.flown import need

pytest.importorskip("Basilisk", reason="Basilisk comes with the test extra where it has a wheel")

from basilisk_cubesat import in_basilisk
from basilisk_software import POINTING, FlightCode, as_in_basilisk, errors_of, under, with_numbers, without
from common import gap
from tests.tiers import leading

ATTITUDE, MOMENTUM = 5e-8, 5e-8
"""Largest differences of all models together: rad and N m s, of rotors that hold some 1e-3."""
ALONE = {
    "residual-dipole": 1e-11,
    "drag": 5e-8,
    "solar-pressure": 2e-9,
    "oblateness": 1e-13,
    "gravity-gradient": 1e-13,
    "magnetic-unloading": 1e-7,
}
"""Largest difference of attitude (rad) with each model alone; without any of them 1e-13."""
STEPS = 1200
SCENARIO = load("cubesat-nadir")
LAW = build(SCENARIO, SCENARIO.pick("lyapunov")).gains
GAINS = Gains(LAW.k_rate, 2.0 * LAW.k_attitude)
"""Of Basilisk's own feedback, as stiff near the target: Rodrigues parameters are half of the quaternion's vector part."""


def whole(name):
    """The loop of one of the scenario's laws."""
    return as_in_basilisk(build(SCENARIO, SCENARIO.pick(name)))


def recorded(loop, steps, run=0):
    """A recording of every control step."""
    return label(loop, *fly(loop, steps, 1, run=run), 1)


def physics(*names):
    """The loop under Basilisk's own feedback on the true state, with these models alone; of none given, with all."""
    loop = under(without(whole("lyapunov"), "gyro", "star-tracker", "mekf"), POINTING, GAINS)
    leave = set(ALONE) - set(names or ALONE)
    return without(loop, *leave, *(["magnetometer"] if "magnetic-unloading" in leave else []))


@cache
def end(*names):
    """Where starhold's flight with these models ends, and the momenta of its rotors."""
    carry = fly(physics(*names), STEPS, STEPS)[1]
    return carry.state, np.array(carry.effectors[0].momentum)


def apart(vehicle, state, momenta):
    """Differences of attitude (rad) and of momenta (N m s)."""
    return gap(state, vehicle.state())[0], float(np.abs(momenta - vehicle.momenta()).max())


def differ(known, *flown):
    """Differences between starhold with some models and Basilisk with others, at the end of the run."""
    vehicle = in_basilisk(physics(*flown), GAINS)
    vehicle.fly(STEPS)
    return apart(vehicle, *end(*known))


@pytest.mark.parametrize("name", leading([entry.name for entry in SCENARIO.laws]))
def test_the_scenario_flies_alike(name):
    """With all models, the filter, noise of gyro and star tracker, and the wheel that is lost and then not counted on."""
    need("cc")
    loop = whole(name)
    lost, taken_over = (event.step for event in loop.events)
    stops = [lost // 6, lost, (lost + taken_over) // 2, taken_over + 400]
    run = recorded(loop, stops[-1])
    vehicle = in_basilisk(loop, FlightCode(loop, errors_of(run)))
    flown = 0
    for stop in stops:
        vehicle.fly(stop - flown)
        flown = stop
        state = loop.start._replace(attitude=run["attitude"][stop], rate=run["rate"][stop], position=run["position"][stop])
        attitude, momentum = apart(vehicle, state, run["wheel_momentum"][stop])
        assert attitude < ATTITUDE, (stop, attitude)
        assert momentum < MOMENTUM, (stop, momentum)
    # The lost motor is what both flew: its rotor has kept its momentum, the others' have changed.
    changed = np.abs(run["wheel_momentum"][stops[-1]] - run["wheel_momentum"][lost])
    assert sorted(changed)[0] < 1e-12 < 1e-5 < sorted(changed)[1]
    assert np.abs(errors_of(run).rate).max() > 1e-5, "no noise"


def test_all_models_fly_alike_under_basilisk_s_own_software():
    attitude, momentum = differ((), *ALONE)
    assert attitude < ATTITUDE
    assert momentum < MOMENTUM
    assert gap(end()[0], physics().start)[0] > 0.5, "it has to turn"


@pytest.mark.parametrize("name", ALONE)
def test_each_model_alone_and_missing(name):
    """Alone a model agrees to what explains it. Missing from Basilisk it shows in what the test of all measures."""
    attitude, _ = differ((name,), name)
    assert attitude < ALONE[name]
    attitude, momentum = differ((), *(set(ALONE) - {name}))
    assert max(attitude / ATTITUDE, momentum / MOMENTUM) > 5.0, (attitude, momentum)


def test_drag_differs_by_the_course_that_starhold_holds():
    """The difference falls with the control period, so it is no other model."""
    found = []
    for share in (1, 2, 4):
        loop = physics("drag")
        loop = replace(loop, period=loop.period / share, events=())
        carry = fly(loop, share * STEPS, share * STEPS)[1]
        vehicle = in_basilisk(loop, GAINS)
        vehicle.fly(share * STEPS)
        found.append(apart(vehicle, carry.state, np.array(carry.effectors[0].momentum))[0])
    assert found[0] / found[1] == pytest.approx(2.0, rel=0.1)
    assert found[1] / found[2] == pytest.approx(2.0, rel=0.1)


@pytest.mark.slow
def test_noise_of_basilisk_s_own_sensors_moves_the_craft_as_much():
    """With gyro and star tracker of Basilisk, which draw numbers of their own, the craft shakes as it does in starhold: the
    deviation from the flight without noise lies among those of starhold's runs."""
    need("cc")
    steps, settled, runs = 4000, 1000, 12
    loop = replace(with_numbers(whole("lyapunov"), "gyro", bias_walk=0.0), events=())
    still = with_numbers(with_numbers(loop, "gyro", noise=0.0), "star-tracker", cross=0.0, roll=0.0)
    every = 5
    quiet = recorded(still, steps)["attitude"][::every]

    def shaken(attitudes):
        """The deviation (rad) about each body axis once settled."""
        turns = [relative(tuple(a), tuple(b))[1:] for a, b in zip(quiet, attitudes, strict=True)]
        return np.sqrt(np.mean((2.0 * np.array(turns[settled // every :])) ** 2, axis=0))

    ours = np.log([shaken(recorded(loop, steps, run)["attitude"][::every]) for run in range(runs)])
    vehicle = in_basilisk(loop, FlightCode(loop))
    attitudes = [loop.start.attitude]
    for _ in range(steps // every):
        vehicle.fly(every)
        attitudes.append(vehicle.state().attitude)
    theirs = np.log(shaken(attitudes))
    spread = ours.std(axis=0, ddof=1)
    assert (np.abs(theirs - ours.mean(axis=0)) < 4.0 * spread).all(), (theirs, ours.mean(axis=0), spread)
    # Twice the noise, or half of it, would be seen.
    assert (4.0 * spread < np.log(2.0)).all(), spread
