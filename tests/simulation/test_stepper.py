"""A flight that is asked for one control period at a time has the bits of one that is flown in one go."""

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.structure import flatten
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_names, builtin_text, load, parse
from starhold.simulation.lane import fly, label
from starhold.simulation.stepper import Stepper
from tests.simulation.loops import FAULT

STEPS = 150


def loops_of(name):
    scenario = load(name)
    return {entry.name: build(scenario, entry) for entry in scenario.laws}


def command_of(run, loop):
    """The command of each instant, (steps, 3)."""
    return run["command" if "command" in run else loop.body.module.COMMAND].to_numpy()


def assert_same(run, other, count):
    assert list(run.data_vars) == list(other.data_vars)
    for name in run.data_vars:
        assert np.array_equal(run[name][:count], other[name][:count], equal_nan=True), name


def check_bits(loop, steps=STEPS):
    whole, flight = label(loop, *fly(loop, steps), 1).dataset(), Stepper(loop)
    for _ in range(steps):
        flight.step()
    assert_same(whole, flight.dataset(), steps + 1)
    assert whole.attrs == flight.dataset().attrs
    # The law's own commands, given from outside.
    told = Stepper(loop)
    for command in command_of(whole, loop)[:steps]:
        told.step(command)
    assert len(told.dataset()["time"]) == steps
    assert_same(whole, told.dataset(), steps)
    assert flatten(told.state) == flatten(flight.state)


@pytest.mark.parametrize("name", ["three-laws-noise", "cubesat-mission", "l2-nonlinear"])
def test_the_bits_are_those_of_one_go(name):
    check_bits(next(iter(loops_of(name).values())))


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_names())
def test_the_bits_of_every_builtin_loop(name):
    for loop in loops_of(name).values():
        check_bits(loop, 400)


def test_a_fault_comes_at_its_step_in_every_lane():
    loop = build(scenario := parse(builtin_text("wheels-orbital") + FAULT, "here"), scenario.laws[0])
    steps = loop.events[-1].step + 5
    assert len(loop.events) == 2
    check_bits(loop, steps)
    many, single = Stepper(loop, lanes=3, record=True), Stepper(loop)
    for _ in range(steps):
        many.step()
        single.step()
    assert_same(single.dataset(), many.dataset(lane=2), steps + 1)


def test_lanes_are_runs():
    loop = next(iter(loops_of("three-laws-noise").values()))
    many = sh.steppers("three-laws-noise", 11, record=True)
    for _ in range(STEPS):
        readings = many.step()
    for lane in (0, 10):
        assert_same(label(loop, *fly(loop, STEPS, run=loop.run + lane), 1).dataset(), many.dataset(lane), STEPS + 1)
    assert readings.measurement.rate[0].shape == (11,)
    assert len(set(readings.measurement.rate[0])) == 11
    assert many.diverged.tolist() == [False] * 11


def test_readings_are_what_the_law_is_given():
    """The estimate and the readings that are recorded at an instant are those told at the end of the period before."""
    flight = sh.stepper("cubesat-nadir")
    told = [flight.reset(), *(flight.step() for _ in range(40))]
    run = flight.dataset()
    for instant in (0, 17, 40):
        assert told[instant].time == run["time"][instant]
        for part, reading in (told[instant].sensors | {"mekf": told[instant].estimate}).items():
            for field in reading._fields:
                assert np.array_equal(run[f"{part}_{field}".replace("-", "_")][instant], getattr(reading, field))
    assert set(told[0].sensors) == {"gyro", "star-tracker", "magnetometer"}
    # The law knows what is estimated, and not the true rate.
    assert told[40].measurement.rate != flight.state.rate


def test_a_copy_goes_on_by_itself():
    flight = sh.stepper("three-laws-noise")
    for _ in range(5):
        flight.step((1e-3, 0.0, 0.0))
    same, other = flight.copy(), flight.copy()
    flight.step((2e-3, 0.0, 0.0))
    same.step((2e-3, 0.0, 0.0))
    other.step((-2e-3, 0.0, 0.0))
    assert flight.state == same.state != other.state
    assert_same(flight.dataset(), same.dataset(), 6)


def test_random_numbers_and_start_are_chosen_by_reset():
    flight = sh.stepper("three-laws-noise")
    first = flight.step().numbers
    flight.reset()
    assert np.array_equal(flight.step().numbers, first)
    for choice in ({"seed": 99}, {"run": 99}, {"start": flight.state._replace(rate=(0.0, 0.0, 0.01))}):
        flight.reset(**choice)
        assert not np.array_equal(flight.step().numbers, first)
    assert len(flight.dataset()["time"]) == 2


def test_a_command_is_saturated_and_one_that_is_none_is_refused():
    flight = sh.stepper("three-laws")
    flight.step((1.0, -1.0, 0.0))
    assert flight.recording()["torque"][0].tolist() == [0.01, -0.01, 0.0]
    before = flight.state
    for wrong in ((1.0, 2.0), (np.nan, 0.0, 0.0), 3.0, (1.0, np.inf, 0.0)):
        with pytest.raises(ValueError, match=r"^command: found .*; allowed: finite numbers \(3,\)$"):
            flight.step(wrong)
    for wrong in ((1.0, 0.0), before._replace(rate=(np.inf, 0.0, 0.0)), before._replace(rate=(np.ones(2), 0.0, 0.0))):
        with pytest.raises(ValueError, match=r"^start: found .*; allowed: (a state such as|finite numbers)"):
            flight.reset(start=wrong)
    assert flight.state == before
    with pytest.raises(ValueError, match=r"^recording: found no sample"):
        sh.stepper("three-laws", record=False).dataset()
