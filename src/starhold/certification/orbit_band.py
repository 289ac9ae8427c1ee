"""How far forces other than that of a point mass move an orbit, and what that does to a frame that turns with it.

In the orbital frame, radial r, along the motion t and normal n, a force f per mass gives h' = r f_t and turns the frame
about the radial direction by r f_n/h, beside h/r2 about the normal. A target that knows two-body motion alone gives h/r2
and -2 h r'/r3: its rate is off by r f_n/h, and the derivative of that by f_t/r and (r f_n/h)'.
"""

from __future__ import annotations

from math import hypot, isfinite
from typing import Any, NamedTuple

import numpy as np

from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.orbit import angular_momentum, highest, highest_speed, lowest
from starhold.parts.part import Fitted

ROOM = 1.4
"""Forces move an orbit by this multiple of their share of the point mass's force: flights with oblateness reach 1.34."""
MORE = 1.0 + 1e-9


class Band(NamedTuple):
    """An orbit stays within `share` of the distances, speeds and angular momentum of two-body motion: `change` is the most
    that the speed away from the centre differs (m/s). `rate` (rad/s) and `acceleration` (rad/s2): how far the orbital
    frame's motion is from that of two-body motion. `force`: the largest that moves it, per mass (m/s2)."""

    share: float = 0.0
    change: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0
    force: float = 0.0


def movers(loop: ClosedLoop) -> list[Fitted]:
    """Return the parts that move the orbit besides the point mass, and declare by how much."""
    return [f for f in loop.used("environment") if f.part.hook("perturbation") is not None]


def band_of(loop: ClosedLoop) -> Band:
    """Return the band that claims assume; an empty one where no part moves the orbit, or where it has no bounds."""
    if not movers(loop) or not loop.has("two-body"):
        return Band()
    (low, high, fast), gravity = extremes(loop), loop.craft.gravity
    share = ROOM * _forces(loop, low)[0] / (gravity / low**2) * MORE
    if share >= 1.0 or not isfinite(high):
        return Band()
    low, high, fast = low * (1.0 - share), high * (1.0 + share), fast * (1.0 + share)
    force, gradient = _forces(loop, low)
    momentum = angular_momentum(loop.start.position, loop.start.velocity) * (1.0 - share)
    rate = high * force / momentum
    # f_n changes as the craft moves and the normal turns; r and h change too.
    turned = (gradient * fast + force * rate) * high / momentum + force * fast / momentum + rate**2
    return Band(share, share * fast, rate * MORE, hypot(force / low, turned) * MORE, force * MORE)


def extremes(loop: ClosedLoop) -> tuple[float, float, float]:
    """Return the least and the largest distance (m) and the largest speed (m/s) of two-body motion."""
    begun = loop.start.position, loop.start.velocity, loop.craft.gravity
    return lowest(*begun), highest(*begun), highest_speed(*begun)


def _forces(loop: ClosedLoop, distance: float) -> tuple[float, float]:
    """Return the sums of the largest accelerations (m/s2) and of their largest gradients (1/s2) beyond a distance."""
    tell: Any = [(f.part.hook("perturbation"), f.params) for f in movers(loop)]
    accelerations = [perturbation(params, loop.craft, distance) for perturbation, params in tell]
    force, gradient = (sum(x) for x in zip(*accelerations, strict=True))
    return force, gradient


def strays(loop: ClosedLoop, position: Any, velocity: Any) -> Any:
    """Tell at which positions (n, 3) and velocities (n, 3) a flight is outside the band of its loop's orbit."""
    share, (low, high, fast) = band_of(loop).share, extremes(loop)
    distance, speed = np.linalg.norm(position, axis=1), np.linalg.norm(velocity, axis=1)
    begun = angular_momentum(loop.start.position, loop.start.velocity)
    momentum = np.linalg.norm(np.cross(position, velocity), axis=1) / begun
    off = (distance < low * (1.0 - share)) | (distance > high * (1.0 + share)) | (speed > fast * (1.0 + share))
    return off | (abs(momentum - 1.0) > share)
