"""Finds when a law is told more wrongly than a claim assumes: before an estimate has settled, or after a faster motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import relative
from starhold.analysis.rigid_body import error_angle
from starhold.certification.certificate import Claim
from starhold.certification.measured import shown
from starhold.loop.closed_loop import ClosedLoop, is_recorded

Array = NDArray[np.float64]
NEAR = 1e-9
"""Errors (rad, rad/s) that rounding and the steps of a flight may make of none."""


def misreadings(claim: Claim, loop: ClosedLoop, span: Any) -> list[NDArray[np.bool_]]:
    """Return for each estimate that a claim is about, and without one for readings that are off in proportion to the motion,
    masks (n,) of the samples of a `Span` at which the error exceeds the claimed bound, but for NEAR."""
    measured = [
        (fitted, ("attitude", "rate")) for fitted in loop.used("estimator") if "settled-estimate" in claim.assumptions
    ]
    if not loop.used("estimator") and "told_growth" in claim.numbers:
        measured = [(f, tuple(shown(f) & {"attitude", "rate"})) for f in loop.used("sensor") if is_recorded(f.part)]
    if not any(names for _, names in measured):
        return []
    attitude, rate = _largest(claim, span)

    def exceeds(name: str, seen: Any) -> NDArray[np.bool_]:
        if name == "rate":
            return np.linalg.norm(seen - span["rate"], axis=1) > rate
        turned: Any = relative(tuple(span["attitude"].T), tuple(seen.T))
        return error_angle(np.transpose(turned)) > attitude

    return [exceeds(x, span[f"{f.prefix}{x}"]) for f, names in measured for x in names]


def _largest(claim: Claim, span: Any) -> Array:
    """Return how far off attitude and rate may be told at each sample (2, n), if the body moved before the first as it does
    then: a claim's steady errors, what grew with the motion of the last `ago` seconds, and a share of what was more before.
    """
    n, time = claim.numbers, span["time"] * span.unit
    most = np.full((len(time), 2), [n["attitude_error"] + NEAR, n["rate_error"] + NEAR]).T
    if "told_growth" not in n or len(time) < 2:
        return most
    *growth, ago, kept = n["told_growth"]
    step, changes = float(time[1] - time[0]), np.linalg.norm(np.diff(span["rate"], axis=0), axis=1)
    faster = np.maximum(np.append(changes, 0.0), np.append(0.0, changes)) / step
    # A body turns no faster between samples than at these and by half of the change.
    moved = np.array([np.linalg.norm(span["rate"], axis=1) + 0.5 * step * faster, faster])
    window, share, before = max(1, math.ceil(ago / step * (1.0 - 1e-9))), 1.0, np.zeros_like(moved)
    grown = np.array(growth).reshape(2, 2) @ _latest(moved, window)
    while share > NEAR:
        most += share * (grown - before)
        share, before = share * kept, grown
        grown = before.copy()
        grown[:, window:] = np.maximum(before[:, window:], before[:, :-window])
    return most


def _latest(values: Array, count: int) -> Array:
    """Return the largest of each value and of so many before it, row by row."""
    most, done = values.copy(), 0
    while done < min(count, values.shape[1] - 1):
        step = min(done + 1, count - done)
        most[:, step:] = np.maximum(most[:, step:], most[:, :-step])
        done += step
    return most
