"""From a scenario of a rigid body to closed loops."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.modes import join_targets
from starhold.parts.catalogue import find, fit
from starhold.parts.effectors.wheels import State as Rotors
from starhold.parts.part import Fitted
from starhold.scenario.bodies.rigid_body.craft import wheels_of
from starhold.scenario.bodies.rigid_body.faults import make_events
from starhold.scenario.bodies.rigid_body.rotors import start_momenta
from starhold.scenario.bodies.rigid_body.start import start_of, target_of

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario


def build(scenario: Scenario, entry: LawEntry) -> ClosedLoop:
    """The closed loop of one law on the scenario's spacecraft."""
    table, parts = scenario.table, parts_of(scenario)
    flown = (join_targets(entry.targets), *parts[1:]) if entry.targets else parts
    body = table.spacecraft
    return ClosedLoop(
        craft=scenario.craft,
        nominal=scenario.nominal_craft,
        law=entry.law,
        gains=entry.gains,
        start=start_of(scenario, parts[0]),
        period=table.simulation.control_period,
        substeps=table.simulation.substeps,
        parts=flown,
        limit="none" if np.isinf(body.torque_limit) else body.limit,
        command_limit=None if wheels_of(scenario) is None else body.torque_limit,
        sign_policy=entry.options.quaternion_sign,
        hysteresis_width=entry.options.hysteresis_width,
        seed=table.simulation.seed,
        run=table.simulation.run,
        events=make_events(scenario, entry, flown) if table.fault else (),
    )


def parts_of(scenario: Scenario) -> tuple[Fitted, ...]:
    """The parts of the scenario in the order in which they act, the target first."""
    table, wheels = scenario.table, wheels_of(scenario)
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
    return (*found, *(fitted for fitted in scenario.parts if fitted not in found))


def check_events(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> None:
    """InputError where the law cannot work with what an event of its run leaves it."""
    for event in loop.events:
        try:
            entry.law.remember(event.gains, event.nominal, loop.period)
        except ValueError as error:
            key = f'law {entry.name} from {event.step * loop.period:g} s (fault_action = "none" flies on as before)'
            raise InputError(scenario.where, key, "", str(error)) from None
