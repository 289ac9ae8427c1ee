"""Scenarios of a rotating rigid body, recognized by their [spacecraft] table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.errors import input_at
from starhold.laws.catalogue import Law
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.modes import join_targets
from starhold.parts.part import Fitted
from starhold.scenario.bodies.rigid_body.craft import Made, effectors_of, make, written_out
from starhold.scenario.bodies.rigid_body.dials import Dials
from starhold.scenario.bodies.rigid_body.faults import make_events
from starhold.scenario.bodies.rigid_body.start import mode_target, start_of, target_of, told_to_design
from starhold.scenario.bodies.rigid_body.tables import AttitudeLawTable, RigidBodyTable

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario

EXAMPLE = """\
name = "written"
[spacecraft]
inertia = [2.0, 3.0, 4.0]
torque_limit = 0.05
[simulation]
duration = 1.0
control_period = 0.1
"""
ORBIT = """\
[orbit]
position = [7e6, 0.0, 0.0]
velocity = [0.0, 4e3, 6.4e3]
"""


class Options(NamedTuple):
    """The keys that a law's table may hold besides its gains."""

    quaternion_sign: Any
    hysteresis_width: float
    fault_action: str | None
    """The reaction of this law to every fault; None for the action that each fault's table states."""


class RigidBody(Dials):
    """A rotating spacecraft, with or without wheels."""

    name = "rigid-body"
    marker = "spacecraft"
    tables = RigidBodyTable
    law_table = AttitudeLawTable
    example = EXAMPLE
    modes = True
    orbit = ORBIT
    modelled = ("spacecraft", "wheels", "wheel")
    designed = ("initial", "orbit")

    def make(self, table: RigidBodyTable, where: str) -> Made:
        return make(table, where)

    def complete(self, scenario: Scenario, law: Law, spec: Any, law_table: AttitudeLawTable) -> Any:
        return law.complete(spec, lambda: told_to_design(scenario, law_table.quaternion_sign))

    def target(self, scenario: Scenario, given: Any, context: Any, key: str) -> Fitted:
        return mode_target(scenario, given, context, key)

    def options(self, scenario: Scenario, law_table: AttitudeLawTable, gains: Any, key: str) -> Options:
        return Options(law_table.quaternion_sign, law_table.hysteresis_width, law_table.fault_action)

    def given(self, scenario: Scenario, entry: LawEntry) -> dict[str, Any]:
        body, target, effectors = scenario.table.spacecraft, target_of(scenario), effectors_of(scenario)
        parts = written_out(scenario, target, effectors)
        parts = (join_targets(entry.targets, entry.slews), *parts[1:]) if entry.targets else parts
        return {
            "start": start_of(scenario, target),
            "parts": parts,
            "limit": "none" if math.isinf(body.torque_limit) else body.limit,
            "command_limit": body.torque_limit if effectors else None,
            "sign_policy": entry.options.quaternion_sign,
            "hysteresis_width": entry.options.hysteresis_width,
            "events": make_events(scenario, entry, parts),
        }

    def examine(self, scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> None:
        for event in loop.events:
            key = f'law {entry.name} from {event.step * loop.period:g} s (fault_action = "none" flies on as before)'
            with input_at(scenario.where, key):
                entry.law.remember(event.gains, event.nominal, loop.period)


BODY = RigidBody()
