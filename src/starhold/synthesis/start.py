"""A scenario gives designs the start and the available torque and momentum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.vector import Vector


@dataclass(frozen=True)
class Start:
    """A scenario gives a design the rotation from the target axes to the body axes, the rate relative to the target
    (rad/s) and the wheel momentum (N m s, body axes; None for a craft without) at the start; the torque (N m) and, of
    wheels, the angular momentum (N m s) available about every axis, infinite for no limit; and the angle (rad) and rate
    (rad/s) at which the target counts as reached."""

    attitude: Quaternion
    rate: Vector
    wheel_momentum: Vector | None
    torque: float
    momentum: float
    attitude_tolerance: float
    rate_tolerance: float

    @property
    def angle(self) -> float:
        """The error angle (rad, 0..pi)."""
        return 2.0 * float(np.arctan2(np.linalg.norm(self.attitude[1:]), abs(self.attitude[0])))
