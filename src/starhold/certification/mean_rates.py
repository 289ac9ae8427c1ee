"""How far an estimate is off that is propagated at the mean of two readings of a gyro, because the body's rate does not
change in proportion to time between them.

Let a body turn at a rate w with the acceleration a as a period h begins, and a' = da/dt. The integral of its rate is off h
times the mean of the rates at both ends by h^3 a' / 12, and its rotation vector off that integral by half the integral of
(turned so far) x (rate), h^3 w x a / 12. Under a held torque u J a = u - w x H, with the momentum H of body and wheels, so
J a' = H x a - w x H', and H' is H x w, and u more where that is not of wheels. What is of higher order is smaller by the
turn in a period; torques from outside hardly change in one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.certification.certificate import EVEN
from starhold.certification.measured import measured, strayed
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.craft import tensor

Array = NDArray[np.float64]
SHARE = 0.1
"""How far off an estimate may be because of this, as a share of the claimed angle to the target."""


def evenness(loop: ClosedLoop, angle: float | None) -> list[str]:
    """Return the assumption that the body turns between two readings as at their mean, in a claim with this ultimate bound
    (rad); none where no estimate is propagated so."""
    return [] if angle is None or _responses(loop) is None else [f"{EVEN}{SHARE * angle!r}"]


def misled(span: Any) -> Array:
    """Return how far off the attitude is told at most because of this at each sample of a `Span` of analysis (n,; rad), as
    if it were not before the first."""
    loop, wide, time = span.loop, _responses(span.loop), span["time"] * span.unit
    if wide is None or len(time) < 2:
        return np.zeros(len(time))
    stored = None if loop.wheels is None else span["wheel_momentum"] @ np.array(loop.wheels.axes)
    turns = strays(loop, span["rate"], span["torque"], stored)
    # So many periods from each sample to the next turn alike.
    every = max(1, round(float(time[1] - time[0]) / loop.period))
    added = np.append(wide[:1], [wide[k : k + every].sum() for k in range(1, len(wide), every)])
    return np.convolve(turns, added)[: len(time)]


def strays(loop: ClosedLoop, rate: Any, torque: Any, stored: Any) -> Array:
    """Return, to the lowest order, the turns of a body in a period beside those at the mean of its rates at both ends (n,;
    rad). rate, torque, stored: the rates (n, 3; rad/s), the torques that are held (N m) and the wheels' momentum (N m s) as
    the period begins, body axes; None without wheels."""
    J, half = tensor(loop.craft.inertia), 0.5 * loop.period
    inverse: Any = np.linalg.inv(J)
    momentum, external = (rate @ J, torque) if stored is None else (rate @ J + stored, 0.0)

    def accelerated(rate: Any, momentum: Any) -> tuple[Any, Any]:
        turning = np.cross(momentum, rate)
        return (torque + turning) @ inverse, turning + external

    # In the middle of the period.
    acceleration, carried = accelerated(rate, momentum)
    rate, momentum = rate + half * acceleration, momentum + half * carried
    acceleration, carried = accelerated(rate, momentum)
    change = (np.cross(momentum, acceleration) - np.cross(rate, carried)) @ inverse
    return loop.period**3 / 12.0 * np.linalg.norm(np.cross(rate, acceleration) - change, axis=1)


def _responses(loop: ClosedLoop) -> Array | None:
    result = measured(loop) if loop.used("estimator") else None
    return None if result is None else strayed(result.recursion)
