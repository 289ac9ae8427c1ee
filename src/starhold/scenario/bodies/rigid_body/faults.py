"""Turns the fault tables of a scenario into the events of a run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from starhold.errors import InputError, input_at
from starhold.loop.closed_loop import Event
from starhold.parts.craft import Craft
from starhold.parts.effectors.envelope import authority
from starhold.parts.effectors.wheels import Wheels, lose
from starhold.parts.part import Fitted
from starhold.scenario.bodies.rigid_body.craft import craft_with, effectors_of, torque_limit, wheels_of
from starhold.scenario.bodies.rigid_body.tables import FaultTable

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario


def action_on(fault: FaultTable, entry: LawEntry) -> str:
    """Return the reaction of a law to a fault."""
    return entry.options.fault_action or fault.action


def fault_times(scenario: Scenario) -> tuple[float, ...]:
    """Return the times (s) of faults and of the reactions to them."""
    faults: list[FaultTable] = scenario.table.fault
    acted = [f.time + f.delay for f in faults if any(action_on(f, entry) != "none" for entry in scenario.laws)]
    return tuple(sorted({*(fault.time for fault in faults), *acted}))


def make_events(scenario: Scenario, entry: LawEntry, parts: tuple[Fitted, ...]) -> tuple[Event, ...]:
    """Return the events of a law's run: each fault when it happens, and the reaction when it is diagnosed. InputError where
    a fault names a wheel that does not exist, happens after the end, leaves the body less inertia than its rotors have,
    leaves torque about fewer than three axes to a law that continues, or asks for new gains of a law without a design form.
    """
    table, period = scenario.table, scenario.table.simulation.control_period
    moments: list[tuple[float, bool, int]] = []
    for place, fault in enumerate(table.fault, 1):
        _check(scenario, place, fault)
        moments.append((fault.time, False, place))
        if action_on(fault, entry) != "none":
            moments.append((fault.time + fault.delay, True, place))
    now = Event(0, parts, entry.gains, scenario.craft, scenario.known.craft)
    effectors = effectors_of(scenario)
    wheels = wheels_of(scenario)
    begun = 0.0 if wheels is None else authority(wheels)
    share, learnt, limit = 1.0, (0.0, 0), scenario.known.craft.torque_limit
    events: list[Event] = []
    for time, diagnosed, place in sorted(moments):
        fault = table.fault[place - 1]
        action = action_on(fault, entry)
        body = _body(scenario, place, fault)
        if not diagnosed:
            wheels = None if wheels is None else _struck(wheels, fault)
            now = now._replace(parts=_on(now.parts, wheels), craft=body or now.craft)
        else:
            # The diagnosis of an inertia that has changed again in the meantime is obsolete.
            if body is not None and (fault.time, place) > learnt:
                now, learnt = now._replace(nominal=body), (fault.time, place)
            if wheels is not None and fault.strikes_wheel:
                now = now._replace(gains=_told(now.gains, wheels, fault))
                left = _left(scenario, wheels, place, fault, now.gains)
                share, limit = authority(left) / begun, torque_limit(scenario.known.table, _on(effectors, left))
                wheels = wheels if action == "retune" else left
                now = now._replace(parts=_on(now.parts, wheels))
            # The law's limit does not affect the body, so both crafts have it.
            now = now._replace(nominal=now.nominal._replace(torque_limit=limit))
            if action in ("retune", "both"):
                now = now._replace(gains=_retuned(scenario, entry, now.nominal, share, place))
        now = now._replace(step=round(time / period), craft=now.craft._replace(torque_limit=limit))
        events.append(now)
    return tuple(events)


def _on(parts: tuple[Fitted, ...], wheels: Wheels | None) -> tuple[Fitted, ...]:
    """Return the parts with these wheels in place of theirs."""
    return tuple(replace(f, params=wheels) if f.part.name == "wheels" else f for f in parts)


def _check(scenario: Scenario, place: int, fault: FaultTable) -> None:
    where, wheels, end = scenario.where, wheels_of(scenario), scenario.table.simulation.duration
    if fault.strikes_wheel and wheels is None:
        raise InputError(where, f"fault[{place}]", "no wheels", "a wheel's fault only with [wheels] or [[wheel]] tables")
    if wheels is not None and _index(fault) >= len(wheels.axes):
        raise InputError(where, f"fault[{place}].wheel", str(fault.wheel), f"1 to {len(wheels.axes)}")
    if fault.time > end:
        raise InputError(where, f"fault[{place}].time", f"{fault.time:g} s", f"at most {end:g} s")


def _index(fault: FaultTable) -> int:
    return (fault.wheel or 1) - 1


def _body(scenario: Scenario, place: int, fault: FaultTable) -> Craft | None:
    """Return the craft with the inertia after the fault, or None if the fault does not change it."""
    if fault.inertia is None:
        return None
    with input_at(scenario.where, f"fault[{place}].inertia"):
        return craft_with(scenario, fault.inertia)


def _struck(wheels: Wheels, fault: FaultTable) -> Wheels:
    """Return the wheels after a fault that is not diagnosed yet: their allocation is unchanged."""
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


def _told(gains: Any, wheels: Wheels, fault: FaultTable) -> Any:
    """Return the gains of a law after a lost wheel is diagnosed: one fewer has to be lost before its mode on loss begins."""
    if not hasattr(gains, "wheels_lost") or wheels.torque_limit[_index(fault)] > 0.0:
        return gains
    return gains._replace(wheels_lost=gains.wheels_lost - 1.0)


def _left(scenario: Scenario, wheels: Wheels, place: int, fault: FaultTable, gains: Any) -> Wheels:
    """Return the wheels with the torque allocated to those that remain after a diagnosed fault; unchanged if too few remain
    and another mode takes over."""
    try:
        return lose(wheels, _index(fault)) if wheels.torque_limit[_index(fault)] == 0.0 else wheels
    except ValueError as error:
        if getattr(gains, "wheels_lost", 1.0) < 0.5:
            return wheels
        raise InputError(scenario.where, f"fault[{place}]", "", f'{error}; action = "none" flies on') from None


def _retuned(scenario: Scenario, entry: LawEntry, known: Craft, share: float, place: int) -> Any:
    """Return the gains redesigned for the known inertia and the remaining share of the torque."""
    key, changed = f"fault[{place}].action", scenario.table.fault[place - 1].inertia is not None
    follows = entry.form is not None and "torque" in entry.spec._fields
    if not follows and (entry.form is None or not changed):
        allowed = 'a law with form = "degree-of-stability", whose gains follow the torque'
        allowed = "a law with a form, whose gains follow the inertia" if changed else allowed
        allowed = f'{allowed}; or fault_action = "reallocate" in its [[law]] table'
        raise InputError(scenario.where, key, f"retune for law {entry.name}", allowed)
    if follows and (not np.isfinite(share) or share <= 0.0):
        raise InputError(scenario.where, key, "no torque left about some axis", 'action = "none"')
    spec = entry.spec._replace(torque=entry.spec.torque * min(1.0, share)) if follows else entry.spec
    try:
        return entry.law.design(known, spec)
    except ValueError as error:
        raise InputError(scenario.where, f"fault[{place}]", "", f"no gains for law {entry.name}: {error}") from None
