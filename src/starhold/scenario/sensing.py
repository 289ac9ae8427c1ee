"""Checks whether a loop's parts take each reading from one sensor or from several."""

from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.contract import IS_VALID
from starhold.parts.part import Fitted


def check_sensors(loop: ClosedLoop, where: str) -> set[str]:
    """Return the names of the sensors' readings. InputError where two sensors give a reading that is taken from one only."""
    single = {*loop.law.reads} - {*getattr(loop.law.module, "SEVERAL", ())}
    single |= {name for fitted in loop.parts for name in fitted.part.reads}
    for estimator in loop.estimating:
        single |= {name for name in estimator.needs if name not in _several(estimator)}
    single |= set() if loop.used("estimator") else set(loop.body.module.State._fields)
    sensors: dict[str, list[str]] = {}
    for sensor in loop.used("sensor"):
        for name in sensor.part.module.Reading._fields:
            if name == IS_VALID:
                raise InputError(where, f"part {sensor.called}", f"a reading {name}", "another name: estimators state it")
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
