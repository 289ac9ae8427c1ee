"""Commercial reaction wheels, from CubeSats to large platforms, with numbers from their makers' public data sheets.

The makers publish no friction, and most no top speed; without a top speed the rotor inertia is not known. The masses of
RW-0.003 and the RW4 wheels are upper limits from their data sheets.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class WheelUnit:
    """One product: largest motor torque (N m), nominal momentum (N m s), top speed (rad/s) and mass (kg), None where they
    are not known, and the data sheet."""

    name: str
    maker: str
    torque_limit: float
    momentum_limit: float
    top_speed: float | None
    mass: float | None
    source: str

    @property
    def inertia(self) -> float | None:
        """Rotor inertia about the spin axis (kg m2): momentum over top speed, None if that is not known."""
        return None if self.top_speed is None else self.momentum_limit / self.top_speed


def _per_minute(turns: float) -> float:
    return turns * 2.0 * math.pi / 60.0


_ROCKET_LAB = "Rocket Lab (Sinclair Interplanetary)"
_HONEYWELL_SHEET = "Constellation Series Reaction Wheels"

WHEEL_UNITS: dict[str, WheelUnit] = {
    unit.name: unit
    for unit in (
        WheelUnit("RW-0.003", _ROCKET_LAB, 0.001, 0.003, None, 0.050, "RW-0.003 Datasheet v3.0"),
        WheelUnit("RW-0.01", _ROCKET_LAB, 0.001, 0.01, None, 0.122, "RW-0.01 Datasheet v3.0"),
        WheelUnit(
            "RWP015", "Blue Canyon Technologies", 0.004, 0.015, None, 0.130, "BCT Data Sheet, Components, Reaction Wheels"
        ),
        WheelUnit(
            "RW0",
            "NanoAvionics",
            0.0032,
            0.020,
            _per_minute(6500.0),
            0.137,
            "CubeSat Reaction Wheels Control System SatBus 4RW",
        ),
        WheelUnit("RW-0.06", _ROCKET_LAB, 0.020, 0.06, None, 0.233, "RW-0.06 Datasheet v3.0"),
        WheelUnit("RW4-0.4", _ROCKET_LAB, 0.100, 0.4, None, 0.75, "RW4-0.4 Datasheet v3.0"),
        WheelUnit("RW4-5.0", _ROCKET_LAB, 0.150, 5.0, None, 3.0, "RW4-5.0 Datasheet v2"),
        WheelUnit("HR12-12", "Honeywell", 0.200, 12.0, _per_minute(6000.0), 6.0, _HONEYWELL_SHEET),
        WheelUnit("HR12-50", "Honeywell", 0.200, 50.0, _per_minute(6000.0), 9.5, _HONEYWELL_SHEET),
        WheelUnit("HR16-100", "Honeywell", 0.200, 100.0, _per_minute(6000.0), 12.0, _HONEYWELL_SHEET),
    )
}
"""Wheels by name, in order of momentum."""
