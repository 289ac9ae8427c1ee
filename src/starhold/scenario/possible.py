"""Refuses conditions of modes that cannot hold in any flight."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from starhold.algebra.vector import cross, norm
from starhold.errors import InputError
from starhold.laws.conditions import station_at
from starhold.laws.modes import Modes
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.orbit import highest
from starhold.parts.part import Fitted
from starhold.parts.pushes import moves

FULL = 1.01
"""The factor by which a level or an orbit must exceed a bound on momentum or distance to count as unreachable."""
APART, UPRIGHT = math.radians(1.0), math.radians(0.3)
"""Allowance by which the ground track may come closer to a station than the inclination implies, and a bound on the angle
between the station's vertical and the direction from the Earth's centre."""
ENOUGH = 12
"""The largest number of wheels for which the bound is exact; for more it is the sum of their largest momenta."""


class Most(NamedTuple):
    """A level (SI) that the quantity of a test never reaches; unit and text of the error."""

    test: str
    level: float
    unit: str
    allowed: str


def check_possible(loop: ClosedLoop, where: str, law: str) -> None:
    """Raise InputError for the first condition of a law's modes that can never hold, and where more wheels have to be lost
    than exist; law: its name in errors."""
    module: Any = loop.law.module
    if not isinstance(module, Modes):
        return
    for mode, _, switches in module.parts(loop.gains):
        for switch, (after, dwell, *levels) in switches:
            key, numbers = f"{law}, mode {mode.name}: {switch.key}", dict(zip(switch.keys, levels, strict=True))
            begun, ends = max(after, numbers.get("not_before", 0.0)) + dwell, numbers.get("not_after", math.inf)
            if begun > ends + loop.period:
                allowed = f"a time from {begun:g} s on, when after, dwell and not_before have passed"
                raise InputError(where, f"{key}.not_after", f"{ends:g} s", allowed)
            for most in _bounds(loop, numbers):
                if numbers[most.test] >= most.level:
                    level = math.degrees(numbers[most.test]) if most.unit == "deg" else numbers[most.test]
                    raise InputError(where, f"{key}.{most.test}", f"{level:.4g} {most.unit}", most.allowed)
    if module.on_loss is not None:
        count = sum(len(fitted.params.axes) for fitted in _wheels(loop.parts))
        if loop.gains.wheels_lost > max(1, count):
            allowed = f"at most the number of wheels, {count}"
            raise InputError(where, f"{law}: wheels_lost", f"{loop.gains.wheels_lost:g}", allowed)


def _bounds(loop: ClosedLoop, numbers: Mapping[str, float]) -> Iterable[Most]:
    """Yield the bounds on the quantities that a condition tests; numbers: the levels of its tests."""
    if "wheel_momentum_above" in numbers:
        stored = max(_stored(parts) for parts in (loop.parts, *(event.parts for event in loop.events)))
        allowed = f"less than {stored:.4g} N m s, the most that the wheels store" if stored else "a loop with wheels"
        yield Most("wheel_momentum_above", FULL * stored, "N m s", allowed)
    for test in ("angle_above", "sun_angle_above"):
        if test in numbers:
            yield Most(test, math.pi, "deg", "less than 180 deg, because no angle is larger")
    if "elevation_above" in numbers:
        inclination, most = _highest_seen(loop, numbers)
        allowed = f"less than {math.degrees(most):.4g} deg"
        if most < 0.5 * math.pi:
            inclined = f"at {math.degrees(numbers['latitude']):.4g} deg of latitude ever sees this orbit"
            allowed += f", the highest that a station {inclined}, inclined by {math.degrees(inclination):.4g} deg"
        yield Most("elevation_above", most, "deg", allowed)


def _wheels(parts: Iterable[Fitted]) -> list[Fitted]:
    return [fitted for fitted in parts if fitted.part.name == "wheels" and fitted.part.file is None]


def _stored(parts: Iterable[Fitted]) -> float:
    """Return the largest norm of the momentum (N m s) that the effectors for the command can store, as laws know it, with
    every wheel at its limit in either direction; infinity where another effector may store an unknown momentum."""
    acting = [fitted for fitted in parts if fitted.part.role == "effector" and fitted.part.flag("ACTS")]
    wheels = _wheels(acting)
    if any(not fitted.part.flag("OUTSIDE") or fitted.part.file is not None for fitted in acting if fitted not in wheels):
        return math.inf
    return sum(_full(np.array(one.params.axes), np.array(one.params.momentum_limit)) for one in wheels)


def _full(axes: Any, limits: Any) -> float:
    if not np.isfinite(limits).all() or len(limits) > ENOUGH:
        return float(limits.sum())
    signs = np.array([(1.0, *rest) for rest in itertools.product((1.0, -1.0), repeat=len(limits) - 1)])
    return float(np.linalg.norm((signs * limits) @ axes, axis=1).max())


def _highest_seen(loop: ClosedLoop, numbers: Mapping[str, float]) -> tuple[float, float]:
    """Return the inclination of the orbit (rad) and a bound on the elevation (rad) of the craft above a station's horizon;
    90 deg where a force may change the orbit."""
    position, velocity = loop.start.position, loop.start.velocity
    normal, far = cross(position, velocity), highest(position, velocity, loop.craft.gravity)
    inclination = math.acos(max(-1.0, min(1.0, normal[2] / norm(normal))))
    pushed = any(fitted.part.file is not None and fitted.part.hook("acceleration") is not None for fitted in loop.parts)
    if pushed or any(moves(fitted.params) for fitted in loop.parts):
        return inclination, 0.5 * math.pi
    place = station_at(numbers).place
    high = abs(math.asin(place[2] / norm(place)))
    apart = high - min(inclination, math.pi - inclination) - APART
    if apart <= 0.0:
        return inclination, 0.5 * math.pi
    if math.isinf(far):
        return inclination, min(0.5 * math.pi, 0.5 * math.pi - apart + UPRIGHT)
    seen = math.atan2(FULL * far * math.cos(apart) - norm(place), FULL * far * math.sin(apart))
    return inclination, min(0.5 * math.pi, seen + UPRIGHT)
