"""From the fault tables of a scenario to what changes during a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from starhold.errors import InputError
from starhold.loop.closed_loop import Event
from starhold.models.wheels import Wheels, authority, lose
from starhold.scenario.reading import LawEntry, Scenario
from starhold.scenario.schema import FaultTable


def make_events(scenario: Scenario, entry: LawEntry) -> tuple[Event, ...]:
    """The events of a law's run: each fault when it happens, and what is done about it when it is diagnosed.

    InputError where a fault names a wheel that is not there, or comes after the end, or where fewer than three axes are
    left to a law that should go on.
    """
    table, wheels, craft = scenario.table, scenario.wheels, scenario.craft
    period, gains = table.simulation.control_period, entry.gains
    begun = 0.0 if wheels is None else authority(wheels)
    moments: list[tuple[float, int, FaultTable, bool]] = []
    for place, fault in enumerate(table.fault, 1):
        _check(scenario, wheels, place, fault)
        moments.append((fault.time, place, fault, False))
        if fault.action != "none":
            moments.append((fault.time + fault.delay, place, fault, True))
    events: list[Event] = []
    for time, place, fault, diagnosed in sorted(moments, key=lambda moment: (moment[0], moment[3], moment[1])):
        assert wheels is not None
        if not diagnosed:
            wheels = _struck(wheels, fault)
        else:
            try:
                left = lose(wheels, _index(fault)) if fault.lost else wheels
            except ValueError as error:
                raise InputError(scenario.where, f"fault[{place}]", "", f'{error}; action = "none" flies on') from None
            if fault.action in ("retune", "both"):
                gains = _retuned(scenario, entry, authority(left) / begun, place)
            wheels = wheels if fault.action == "retune" else left
        events.append(Event(round(time / period), wheels, gains, craft))
    return tuple(events)


def _check(scenario: Scenario, wheels: Wheels | None, place: int, fault: FaultTable) -> None:
    if wheels is None:
        raise InputError(scenario.where, f"fault[{place}]", "no wheels", "a fault only with [wheels] or [[wheel]] tables")
    if _index(fault) >= len(wheels.axes):
        raise InputError(scenario.where, f"fault[{place}].wheel", str(fault.wheel), f"1 to {len(wheels.axes)}")
    if fault.time > scenario.table.simulation.duration:
        raise InputError(
            scenario.where, f"fault[{place}].time", f"{fault.time:g} s", f"at most {scenario.table.simulation.duration:g} s"
        )


def _index(fault: FaultTable) -> int:
    return (fault.wheel or 1) - 1


def _struck(wheels: Wheels, fault: FaultTable) -> Wheels:
    """The wheels after a fault that nobody knows of: the allocation is as before."""
    changes: dict[str, Any] = {}
    given = {
        "torque_limit": 0.0 if fault.lost else fault.torque_limit,
        "momentum_limit": fault.momentum_limit,
        "viscous": fault.viscous,
        "coulomb": fault.coulomb,
    }
    for name, value in given.items():
        if value is not None:
            numbers = list(getattr(wheels, name))
            numbers[_index(fault)] = float(value)
            changes[name] = tuple(numbers)
    return wheels._replace(**changes)


def _retuned(scenario: Scenario, entry: LawEntry, share: float, place: int) -> Any:
    """The gains designed for the torque that is left."""
    if entry.form is None or "torque" not in entry.spec._fields:
        allowed = 'a law with form = "degree-of-stability", whose gains follow the torque'
        raise InputError(scenario.where, f"fault[{place}].action", f"retune for law {entry.name}", allowed)
    if not np.isfinite(share) or share <= 0.0:
        raise InputError(scenario.where, f"fault[{place}].action", "no torque left about some axis", 'action = "none"')
    return entry.law.design(scenario.craft, entry.spec._replace(torque=entry.spec.torque * min(1.0, share)))
