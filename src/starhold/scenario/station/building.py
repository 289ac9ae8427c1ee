"""From a scenario of station keeping to closed loops."""

from __future__ import annotations

import math

from starhold.algebra.scalar import is_finite
from starhold.algebra.vector import ZERO, add, dot, norm
from starhold.analysis.station import goal_of
from starhold.errors import InputError
from starhold.laws.point import PointMeasurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import PointState
from starhold.parts.catalogue import fit
from starhold.scenario.checking import check_substeps, try_law
from starhold.scenario.station.reading import StationEntry, StationScenario

NEAR = 0.4
"""Share of the nearer body's distance at which a motion counts as lost unless the file says where."""


def build(scenario: StationScenario, entry: StationEntry) -> ClosedLoop:
    """The closed loop of one law. InputError where the law cannot work with what it has."""
    table, plant = scenario.table, scenario.craft
    nearer = min(abs(plant.from_smaller), abs(plant.from_larger))
    field = "linear-gravity" if table.libration.model == "linear" else "three-body-gravity"
    surfaces = (fit("actuator", "lag", entry.lag),) if entry.lag > 0.0 else ()
    loop = ClosedLoop(
        craft=plant,
        law=entry.law,
        gains=entry.gains,
        start=_start(scenario, entry),
        period=table.simulation.control_period,
        substeps=table.simulation.substeps,
        parts=(fit("environment", field), *surfaces),
        limit="none" if math.isinf(entry.limit) else table.control.limit_kind,
        command_limit=entry.limit,
        seed=0,
        far=table.simulation.lost_beyond or NEAR * nearer,
    )
    check_substeps(loop, scenario.where)
    try_law(loop, scenario.where, f"law {entry.name}")
    away = norm(loop.start.position)
    if away >= loop.far:
        raise InputError(
            scenario.where, "initial.position", f"a start {away:.6g} away", f"less than lost_beyond, {loop.far:.6g}"
        )
    measurement = PointMeasurement(loop.start.position, loop.start.velocity, loop.period, entry.limit)
    command, _ = entry.law.command(measurement, entry.gains, plant, loop.carry().memory)
    if not is_finite(dot(command, command)):
        allowed = "a limit, margin or deficit: this law takes as much control as there is"
        raise InputError(scenario.where, f"law {entry.name}", "no limit of the control", allowed)
    return loop


def _start(scenario: StationScenario, entry: StationEntry) -> PointState:
    """The first state; control surfaces that lag start without control."""
    start = scenario.table.initial
    if start.relative_to == "point":
        return PointState(start.position, start.velocity, ZERO)
    position, velocity = goal_of(entry.gains).at(start.phase)
    return PointState(add(position, start.position), add(velocity, start.velocity), ZERO)
