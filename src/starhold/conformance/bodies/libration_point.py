"""The checks for laws of station keeping near a libration point."""

from dataclasses import replace
from typing import Any

from starhold.algebra.vector import ZERO
from starhold.analysis.libration_point import goal_of, measure
from starhold.certification.station import certify_station
from starhold.conformance.bodies.any_body import is_pure, reads_alike, stays_finite, survives_toml
from starhold.conformance.verdicts import STEPS, declares_itself, gives_reasons
from starhold.laws.catalogue import Law, catalogue
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
    """Return a loop with a part, and with a gravity field if the part is none."""
    law = catalogue("libration-point")["l2-circle"]
    field = () if part.hook("acceleration") else PARTS[:1]
    return replace(_loop(law, law.examples()[0]), parts=(*field, Fitted(part, params)))


def flies_a_scenario(law: Law) -> None:
    """It flies from a scenario file, is measured and certified, or the certificate says what cannot be read."""
    for gains in law.examples():
        scenario = parse(scenario_with(law, gains), law.name)
        loop = build(scenario, scenario.laws[0])
        table = scenario.table
        run = label(loop, *fly(loop, STEPS), 1)
        measure(run, table.libration.units, goal_of(gains), table.settling.tolerance)
        gives_reasons(certify_station(loop, law.name))


CHECKS = (declares_itself, is_pure, stays_finite, reads_alike, survives_toml, flies_a_scenario)
