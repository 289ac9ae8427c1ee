"""A law that asks for the time gets it, from the start of the flight, whoever flies it; others cannot use it."""

import numpy as np
import pytest

import starhold as sh
from starhold.algebra.structure import flatten
from starhold.loop.kernels import make_step
from starhold.scenario.building import build
from starhold.simulation.lane import fly, label
from starhold.simulation.stepper import Stepper
from tests.refusals import refused

LAW = """
from typing import Annotated, NamedTuple

from starhold.laws.interface import Card, Gain

CARD = Card(title="Clock", summary="u = k t", sources=("a test",), assumptions=(), claims="none")
{reads}

class Gains(NamedTuple):
    k: Annotated[float, Gain("N m/s", above=0.0)]


def torque(measurement, gains, craft, memory):
    t = {use}
    return (gains.k * t, 0.0, 0.0), memory


def examples():
    return [Gains(1e-6)]
"""
BODY = {
    "name": "clock",
    "spacecraft": {"inertia": [2.0, 3.0, 4.0]},
    "initial": {},
    "simulation": {"duration": 8.0, "control_period": 0.125},
    "settling": {"attitude_tolerance": "1 deg", "rate_tolerance": "0.1 deg/s"},
}
CLOCK = {"file": "clock.py", "k": 2.0**-20}
MODES = {"type": "modes", "mode": [{"name": "early", "until": {"after": 3.0}, **CLOCK}, {"name": "late", **CLOCK}]}
FAULT = [{"time": 4.0, "inertia": [4.0, 6.0, 8.0]}]


def made(folder, law=CLOCK, reads='READS = ("time",)', use="measurement.time", **more):
    (folder / "clock.py").write_text(LAW.format(reads=reads, use=use))
    return sh.scenario(BODY | {"law": [law]} | more, folder=folder)


@pytest.mark.parametrize(
    "more",
    [{}, {"fault": FAULT, "law": CLOCK | {"fault_action": "reallocate"}}, {"law": MODES}],
    ids=("plain", "fault", "modes"),
)
def test_the_time_counts_from_the_start_of_the_flight(more, tmp_path):
    scenario = made(tmp_path, **more)
    loop = build(scenario, scenario.laws[0])
    run = label(loop, *fly(loop, 64), 1).dataset()
    # Powers of two, of which products are exact.
    assert run["command"][:, 0].to_numpy()[:64].tolist() == (np.arange(64) * 2.0**-23).tolist()
    flight = Stepper(loop)
    for step in range(40):
        assert flight.step().measurement.time == (step + 1) * 0.125
    assert np.array_equal(flight.dataset()["command"][:40], run["command"][:40])


@pytest.mark.parametrize(
    "use", ["2.0 * measurement.time", "measurement.time / 2.0", "tanh(measurement.time)", "-measurement.time"]
)
def test_a_law_that_does_not_ask_is_refused_with_what_to_write(use, tmp_path):
    with refused(match=r'clock.py, line 14: .* nothing gives, in `t = .*READS = \("time",\)'):
        sh.simulate(made(tmp_path, reads="from starhold.algebra.elementary import tanh", use=use))


def test_a_loop_without_the_time_has_no_number_for_it():
    loop = build(sh.load("three-laws"), sh.load("three-laws").laws[0])
    step = make_step(loop.composition())
    phase = loop.phases(1)[0]
    seen = step.sense(loop.carry(), 7, (1, 0), phase.gains, phase.nominal, phase.setup).measurement
    assert flatten((seen.time,)) == []


def test_no_claim_is_made_of_a_law_that_reads_the_time(tmp_path):
    (certificates,) = [flight.certificates for flight in sh.compare(made(tmp_path))]
    (claim,) = certificates[0].claims
    assert claim.outcome == "undecided"
    assert claim.obligations[0].evidence["reason"] == "the law reads the time, of which no claim speaks"
