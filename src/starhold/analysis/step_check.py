"""The error of the integration, as far as a run can tell it: half the integration step changes so much."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from starhold.analysis.metrics import error_angle

if TYPE_CHECKING:
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.simulation.lane import Recording

AnyLoop = TypeVar("AnyLoop", "ClosedLoop", "ClosedLoop")

STATE = ("attitude", "rate", "position", "velocity", "wheel_momentum")
"""What is compared of a recording, where it is there."""


def halved(loop: AnyLoop) -> AnyLoop:
    """The loop with twice as many integration steps, each half as long; its control steps and random numbers stay."""
    return replace(loop, substeps=2 * loop.substeps)


def step_error(run: Recording, finer: Recording) -> dict[str, float | None]:
    """Largest differences between a run and the one of the `halved` loop: the angle between the attitudes (rad), norms of
    the other differences in the units of the recording. All are None where one of the two was lost before the
    other, for from then on there is nothing to compare."""
    if len(run["time"]) != len(finer["time"]):
        return {name: None for name in STATE if name in run.arrays}
    return {name: _difference(run, finer, name) for name in STATE if name in run.arrays}


def _difference(run: Recording, finer: Recording, name: str) -> float:
    ours, theirs = run[name], finer[name]
    if name == "attitude":
        # The vector part of conj(p) q, in which small angles keep their digits.
        p0, p, q0, q = ours[:, :1], ours[:, 1:], theirs[:, :1], theirs[:, 1:]
        scalar = np.sum(ours * theirs, axis=1, keepdims=True)
        return float(error_angle(np.hstack([scalar, p0 * q - q0 * p - np.cross(p, q)])).max())
    return float(np.linalg.norm(ours - theirs, axis=1).max())
