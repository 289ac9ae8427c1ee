"""The checks for laws that hold a place near a libration point."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from starhold.algebra.vector import ZERO
from starhold.analysis.libration_point import goal_of, measure
from starhold.certification.station import certify_station
from starhold.conformance.verdicts import STEPS, agree, declares_itself, require, round_trips
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.point import PointMeasurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import PRIMARIES, PointState
from starhold.parts.catalogue import fit
from starhold.parts.part import Fitted, Part
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.scenario.writing import scenario_with
from starhold.simulation.lane import fly, label

LIMIT = 4.0
PARTS = (fit("environment", "three-body-gravity"), fit("actuator", "lag", 0.0086))
PLANT = PRIMARIES["sun-earth"].point("L2")


def _loop(law: Law, gains: Any) -> ClosedLoop:
    start = PointState((0.01, 0.9, 0.1), (0.1, 0.0, 1.3), ZERO)
    return ClosedLoop(PLANT, law, gains, start, 1e-3, parts=PARTS, limit="norm", command_limit=LIMIT)


def loop_with(part: Part, params: Any) -> ClosedLoop:
    """A loop that holds a part, and a field where it gives none."""
    law = catalogue("libration-point")["l2-circle"]
    field = () if part.hook("acceleration") else PARTS[:1]
    return replace(_loop(law, law.examples()[0]), parts=(*field, Fitted(part, params)))


def _states(count: int) -> Any:
    random = np.random.default_rng(1)
    for _ in range(count):
        x, v = random.normal(size=(2, 3)) * 10.0 ** random.uniform(-9.0, 1.0)
        yield PointMeasurement(tuple(x.tolist()), tuple(v.tolist()), 1e-3, LIMIT)


def _call(law: Any, measurement: PointMeasurement, gains: Any) -> Any:
    return law.command(measurement, gains, PLANT, law.remember(gains, PLANT, measurement.period))[0]


def is_pure(law: Law) -> None:
    """The control depends on nothing but its arguments."""
    for gains in law.examples():
        for measurement in _states(10):
            require(_call(law, measurement, gains) == _call(law, measurement, gains), f"two calls differ at {measurement}")


def stays_finite(law: Law) -> None:
    """Finite control near the point and far away."""
    rest = PointMeasurement(ZERO, ZERO, 1e-3, LIMIT)
    for gains in law.examples():
        for measurement in (rest, *_states(200)):
            require(bool(np.isfinite(_call(law, measurement, gains)).all()), f"not finite at {measurement}")


def reads_alike(law: Law) -> None:
    """Plain Python, one lane and every lane of a batch agree bit for bit."""
    for gains in law.examples():
        loop = _loop(law, gains)
        agree(loop, [loop.start] * 3, range(3))


def survives_toml(law: Law) -> None:
    """Gains written to a scenario file and read back are the same; unknown keys are refused."""
    round_trips(law, scenario_with, parse)


def flies_a_scenario(law: Law) -> None:
    """It flies from a scenario file, is measured and certified, or the certificate says what cannot be read."""
    for gains in law.examples():
        scenario = parse(scenario_with(law, gains), law.name)
        loop = build(scenario, scenario.laws[0])
        table = scenario.table
        run = label(loop, *fly(loop, STEPS), 1)
        measure(run, table.libration.units, goal_of(gains), table.settling.tolerance)
        for claim in certify_station(loop, law.name).claims:
            for obligation in claim.obligations:
                told = obligation.outcome == "proved" or bool(obligation.evidence)
                require(told, f"{claim.kind}: {obligation.name} is {obligation.outcome} without a reason")


CHECKS = (declares_itself, is_pure, stays_finite, reads_alike, survives_toml, flies_a_scenario)
