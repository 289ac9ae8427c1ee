"""From a scenario to closed loops."""

from __future__ import annotations

import numpy as np

from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.actuators.dynamics import Dynamics
from starhold.parts.sensors.gaussian import Noise
from starhold.scenario.checking import check_substeps, try_law
from starhold.scenario.faults import make_events
from starhold.scenario.reading import LawEntry, Scenario
from starhold.scenario.start import knots_for, start_of, target_of


def build(scenario: Scenario, entry: LawEntry) -> ClosedLoop:
    """The closed loop of one law on the scenario's spacecraft. InputError where the law cannot work with its gains."""
    table = scenario.table
    goal = target_of(scenario)
    body = table.spacecraft
    loop = ClosedLoop(
        craft=scenario.craft,
        law=entry.law,
        gains=entry.gains,
        start=start_of(scenario, goal),
        period=table.simulation.control_period,
        substeps=table.simulation.substeps,
        orbit=table.orbit is not None,
        gravity_gradient=table.environment.gravity_gradient,
        target=goal,
        knots=knots_for(scenario),
        noise=Noise(table.environment.torque_noise, table.sensor.attitude_noise, table.sensor.rate_noise),
        limit="none" if np.isinf(body.torque_limit) else body.limit,
        command_limit=None if scenario.wheels is None else body.torque_limit,
        dynamics=Dynamics(body.actuator_lag, body.torque_rate_limit),
        sign_policy=entry.quaternion_sign,
        hysteresis_width=entry.hysteresis_width,
        seed=table.simulation.seed,
        wheels=scenario.wheels,
        allocation="least-squares" if table.wheels is None else table.wheels.allocation,
        events=make_events(scenario, entry) if table.fault else (),
    )
    check_substeps(loop, scenario.where)
    try_law(loop, scenario.where, f"law {entry.name}")
    for event in loop.events:
        try:
            entry.law.remember(event.gains, event.known, loop.period)
        except ValueError as error:
            key = f'law {entry.name} from {event.step * loop.period:g} s (fault_action = "none" flies on as before)'
            raise InputError(scenario.where, key, "", str(error)) from None
    return loop
