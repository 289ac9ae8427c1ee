"""From a scenario to closed loops."""

from __future__ import annotations

import numpy as np

from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.catalogue import find, fit
from starhold.parts.effectors.wheels import State as Rotors
from starhold.parts.part import Fitted
from starhold.scenario.checking import check_substeps, try_law
from starhold.scenario.faults import make_events
from starhold.scenario.reading import LawEntry, Scenario
from starhold.scenario.rotors import start_momenta
from starhold.scenario.start import start_of, target_of


def build(scenario: Scenario, entry: LawEntry) -> ClosedLoop:
    """The closed loop of one law on the scenario's spacecraft. InputError where the law cannot work with its gains."""
    table = scenario.table
    body = table.spacecraft
    loop = ClosedLoop(
        craft=scenario.craft,
        law=entry.law,
        gains=entry.gains,
        start=start_of(scenario, target_of(scenario)),
        period=table.simulation.control_period,
        substeps=table.simulation.substeps,
        parts=_parts(scenario),
        limit="none" if np.isinf(body.torque_limit) else body.limit,
        command_limit=None if scenario.wheels is None else body.torque_limit,
        sign_policy=entry.quaternion_sign,
        hysteresis_width=entry.hysteresis_width,
        seed=table.simulation.seed,
        events=make_events(scenario, entry, _parts(scenario)) if table.fault else (),
    )
    check_substeps(loop, scenario.where)
    try_law(loop, scenario.where, f"law {entry.name}")
    for event in loop.events:
        try:
            entry.law.remember(event.gains, event.nominal, loop.period)
        except ValueError as error:
            key = f'law {entry.name} from {event.step * loop.period:g} s (fault_action = "none" flies on as before)'
            raise InputError(scenario.where, key, "", str(error)) from None
    return loop


def _parts(scenario: Scenario) -> tuple[Fitted, ...]:
    """The parts that the tables of the scenario give, in the order in which they act."""
    table, wheels = scenario.table, scenario.wheels
    noise, body = table.sensor, table.spacecraft
    found = [target_of(scenario)]
    if table.orbit is not None:
        found.append(fit("environment", "two-body"))
    if table.environment.gravity_gradient:
        found.append(fit("environment", "gravity-gradient"))
    if table.environment.torque_noise > 0.0:
        found.append(fit("environment", "random-torque", table.environment.torque_noise))
    if wheels is not None:
        momenta = start_momenta(table.wheels, table.wheel, len(wheels.axes))
        found.append(Fitted(find("effector", "wheels"), wheels, start=Rotors(momenta)))
    if noise.attitude_noise > 0.0 or noise.rate_noise > 0.0:
        found.append(fit("sensor", "gaussian", noise.attitude_noise, noise.rate_noise))
    if body.actuator_lag > 0.0:
        found.append(fit("actuator", "lag", body.actuator_lag, body.torque_rate_limit))
    elif np.isfinite(body.torque_rate_limit):
        found.append(fit("actuator", "rate-limit", body.torque_rate_limit))
    return tuple(found)
