"""From a scenario of station keeping to closed loops."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from starhold.algebra.scalar import is_finite
from starhold.algebra.vector import ZERO, add, dot, norm
from starhold.analysis.libration_point import goal_of
from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import PointMeasurement, PointState
from starhold.parts.catalogue import fit

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario

NEAR = 0.4
"""The divergence bound as a share of the nearer body's distance, unless the file gives one."""


def build(scenario: Scenario, entry: LawEntry) -> ClosedLoop:
    """The closed loop of one law."""
    table, plant = scenario.table, scenario.craft
    nearer = min(abs(plant.from_smaller), abs(plant.from_larger))
    field = "linear-gravity" if table.libration.model == "linear" else "three-body-gravity"
    surfaces = (fit("actuator", "lag", entry.options.lag),) if entry.options.lag > 0.0 else ()
    return ClosedLoop(
        craft=plant,
        nominal=scenario.nominal_craft,
        law=entry.law,
        gains=entry.gains,
        start=_start(scenario, entry),
        period=table.simulation.control_period,
        substeps=table.simulation.substeps,
        parts=(fit("environment", field), *surfaces, *scenario.parts),
        limit="none" if math.isinf(entry.options.limit) else table.control.limit_kind,
        command_limit=entry.options.limit,
        seed=0,
        divergence_bound=table.simulation.lost_beyond or NEAR * nearer,
    )


def check_start(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> None:
    """InputError where the law starts too far away, or asks for all the control there is where that has no limit."""
    away = norm(loop.start.position)
    if away >= loop.divergence_bound:
        raise InputError(
            scenario.where,
            "initial.position",
            f"a start {away:.6g} away",
            f"less than lost_beyond, {loop.divergence_bound:.6g}",
        )
    measurement = PointMeasurement(loop.start.position, loop.start.velocity, loop.period, entry.options.limit)
    command, _ = loop.law.command(measurement, entry.gains, loop.known, loop.carry().memory)
    if not is_finite(dot(command, command)):
        allowed = "a limit, margin or deficit: this law takes as much control as there is"
        raise InputError(scenario.where, f"law {entry.name}", "no limit of the control", allowed)


def _start(scenario: Scenario, entry: LawEntry) -> PointState:
    """The first state; control surfaces that lag start without control."""
    start = scenario.table.initial
    if start.relative_to == "point":
        return PointState(start.position, start.velocity, ZERO)
    position, velocity = goal_of(entry.gains).at(start.phase)
    return PointState(add(position, start.position), add(velocity, start.velocity), ZERO)
