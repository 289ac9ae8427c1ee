"""The initial state, torque and momentum that a scenario provides to designs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from starhold.algebra.quaternion import Quaternion
from starhold.algebra.vector import Vector


@dataclass(frozen=True)
class Start:
    """Inputs of a design from a scenario: the initial rotation from the target axes to the body axes, rate relative to the
    target (rad/s) and wheel momentum (N m s, body axes; None without wheels); the torque (N m) and, for wheels, the angular
    momentum (N m s) available about every axis, infinite for no limit; and the angle (rad) and rate (rad/s) at which the
    target counts as reached."""

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
