"""The error of the integration, as far as a run can tell it: half the integration step changes so much."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from starhold.analysis.rigid_body import error_angle

if TYPE_CHECKING:
    from starhold.simulation.lane import Recording

Loop = TypeVar("Loop")


def halved(loop: Loop) -> Loop:
    """The loop with twice as many integration steps, each half as long; its control steps and random numbers stay."""
    known: Any = loop
    return replace(known, substeps=2 * known.substeps)


def step_error(run: Recording, finer: Recording, names: Iterable[str]) -> dict[str, float | None]:
    """Largest differences of some quantities between a run and the one of the `halved` loop: of quaternions the angle
    between them (rad), else norms in the units of the recording. All are None if one of the two diverged before the
    other, for from then on there is nothing to compare."""
    same = len(run["time"]) == len(finer["time"])
    return {name: _difference(run, finer, name) if same else None for name in names}


def _difference(run: Recording, finer: Recording, name: str) -> float:
    ours, theirs = run[name], finer[name]
    if run.columns[name].dimension == "quaternion":
        # The vector part of conj(p) q, in which small angles keep their digits.
        p0, p, q0, q = ours[:, :1], ours[:, 1:], theirs[:, :1], theirs[:, 1:]
        scalar = np.sum(ours * theirs, axis=1, keepdims=True)
        return float(error_angle(np.hstack([scalar, p0 * q - q0 * p - np.cross(p, q)])).max())
    return float(np.linalg.norm(np.reshape(ours - theirs, (len(ours), -1)), axis=1).max())
