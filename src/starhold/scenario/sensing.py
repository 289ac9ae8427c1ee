"""Checks of what estimators are given: readings of one sensor or several, and the estimate of one that starts them."""

from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.catalogue import parts
from starhold.parts.part import Fitted
from starhold.parts.stated_attitude import IS_VALID
from starhold.scenario.checking import nearest, show


def check_starts(loop: ClosedLoop, where: str) -> None:
    """Raise InputError where an estimator cannot be started by the one that it names."""
    there = {fitted.called: fitted for fitted in loop.estimating}
    for one in loop.estimating:
        if not one.started_by:
            continue
        key = f"part {one.called}: started_by"
        others = [name for name in there if name != one.called]
        if not one.part.flag("STARTABLE"):
            known = [name for name, part in parts("estimator").items() if part.flag("STARTABLE")]
            raise InputError(where, key, f"{one.part.name}, which no other starts", f"a {' or '.join(known)}")
        if one.started_by not in others:
            allowed = nearest(one.started_by, others) if others else "the name of another estimator, which watches"
            raise InputError(where, key, show(one.started_by), allowed)
        lacking = [name for name in ("attitude", IS_VALID) if name not in there[one.started_by].part.module.Estimate._fields]
        if lacking:
            raise InputError(where, key, f"{one.started_by}, which gives no {lacking[0]}", "an estimator that gives it")
        seen, then = [one.called], one.started_by
        while then and then not in seen:
            seen, then = [*seen, then], there[then].started_by if then in there else ""
        if then:
            raise InputError(where, key, f"{' started by '.join([*seen, then])}", "an estimator that begins by itself")


def check_sensors(loop: ClosedLoop, where: str) -> set[str]:
    """Return the names of what the sensors read. InputError where two read what is taken of one only."""
    single = {*loop.law.reads} - {*getattr(loop.law.module, "SEVERAL", ())}
    single |= {name for fitted in loop.parts for name in fitted.part.reads}
    for estimator in loop.estimating:
        single |= {name for name in estimator.needs if name not in _several(estimator)}
    single |= set() if loop.used("estimator") else set(loop.body.module.State._fields)
    sensors: dict[str, list[str]] = {}
    for sensor in loop.used("sensor"):
        for name in sensor.part.module.Reading._fields:
            if name in sensors and name in single:
                given = f"a second sensor of {name}, beside {sensors[name][0]}"
                raise InputError(where, f"part {sensor.called}", given, "one of each, or an estimator that fuses them all")
            sensors.setdefault(name, []).append(sensor.called)
    for estimator in loop.estimating:
        for name, key in _several(estimator).items():
            others = sensors.get(name, [])[1:]
            rows = len(getattr(estimator.params, key)) if key else len(others)
            if rows != len(others):
                given = f"{key} of length {rows} for {', '.join(others) or 'no second sensor'}"
                allowed = f"a row for each sensor of {name} after the first, in the order of the file"
                raise InputError(where, f"part {estimator.called}", given, allowed)
    return set(sensors)


def _several(estimator: Fitted) -> dict[str, str]:
    return getattr(estimator.part.module, "SEVERAL", {})
