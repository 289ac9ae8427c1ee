"""The Earth's magnetic field along an orbit: how weak it becomes, and how fast it changes."""

from __future__ import annotations

from math import tau
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.vector import Vector
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.epoch import DAY, Date, spun, turned
from starhold.parts.magnetic_field import earth_fixed, prepared
from starhold.trace.straight_line import evaluated, straight_line

EVERY = 10.0
"""The time (s) between the places at which the field is measured, in a day."""
ROOM = 1.05
"""The margin for other days, and for an orbit that is not exactly one of two bodies."""
STEPS = 12
"""Steps of Newton's method for Kepler's equation."""

Array = NDArray[np.float64]


def field_along(loop: ClosedLoop, epoch: Date) -> tuple[float, float]:
    """Return the least strength (T) of the field on a loop's orbit within a day from an epoch, and its largest relative
    change per second from one control instant to the next, with a margin. ValueError for an orbit that is not closed."""
    times = np.arange(0.0, DAY, EVERY)
    first, second = (_field(loop, epoch, times + later) for later in (0.0, loop.period))
    size, after = (np.linalg.norm(B, axis=0) for B in (first, second))
    change = np.linalg.norm(second - first, axis=0) / np.minimum(size, after)
    return float(size.min()) / ROOM, float(change.max()) / loop.period * ROOM


def _field(loop: ClosedLoop, epoch: Date, times: Array) -> Array:
    """Return the field (3, n) at times, T, in inertial axes."""
    params = prepared(epoch)

    def equation(position: Vector, cosine: Any, sine: Any) -> Vector:
        return spun(earth_fixed(spun(position, cosine, -sine), params), cosine, sine)

    program = straight_line(equation, position=(0.0, 0.0, 0.0), cosine=1.0, sine=0.0)
    passed: Any = times
    angle = tau * np.asarray(turned(float(params.turn), passed))
    place: Any = tuple(positions(loop, times))
    return np.array(evaluated(program, position=place, cosine=np.cos(angle), sine=np.sin(angle)))


def positions(loop: ClosedLoop, times: Array) -> Array:
    """Return the positions (3, n) of two-body motion at times, m, inertial axes. ValueError for an orbit that is open."""
    r, v, gravity = np.array(loop.start.position), np.array(loop.start.velocity), loop.craft.gravity
    distance = float(np.linalg.norm(r))
    inverse = 2.0 / distance - float(v @ v) / gravity
    if inverse <= 0.0:
        raise ValueError("the orbit does not come back")
    a = 1.0 / inverse
    motion, radial = np.sqrt(gravity / a**3), float(r @ v) / np.sqrt(gravity * a)
    x = motion * times
    # The difference of the eccentric anomalies.
    for _ in range(STEPS):
        slope = 1.0 - (1.0 - distance / a) * np.cos(x) + radial * np.sin(x)
        x = x - (x - (1.0 - distance / a) * np.sin(x) + radial * (1.0 - np.cos(x)) - motion * times) / slope
    ahead, along = 1.0 - a / distance * (1.0 - np.cos(x)), times - (x - np.sin(x)) / motion
    return r[:, None] * ahead + v[:, None] * along
