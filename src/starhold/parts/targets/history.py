"""An attitude over time, on a smooth curve through given attitudes."""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.structured import Buffer
from starhold.parts.contract import Card
from starhold.parts.roles import Goal

CARD = Card(
    title="Attitude history",
    summary="q_RN(t): a twice differentiable rotation spline through given attitudes",
    sources=("Computation of smooth orientation interpolants with angular-velocity control (2002)",),
    assumptions=("rows at control steps are exact on the spline",),
)
ROLE = "target"
TABLE = "target"

HALF_TURN, SWING = 1e-6, 10.0
"""The least cosine of half the turn between neighbours in a history, which excludes half turns, and the largest swing (rad)
of the spline between them."""


class Knots(NamedTuple):
    """The numbers of a rotation spline: times (n,) in s, attitudes (n, 4) and rates (n, 3; rad/s, target axes) at them.
    Between knots the rotation vector is the cubic in time that matches the attitudes and rates of both."""

    times: NDArray[np.float64]
    attitudes: NDArray[np.float64]
    rates: NDArray[np.float64]


class Params(NamedTuple):
    """A table of `tabulate` with a row for each control step and one more, and the knots of its spline (() if not known)."""

    table: NDArray[np.float64]
    knots: Knots | tuple[()] = ()


def prepare(params: Params, period: float) -> Buffer:
    """Return the table as kernels read it."""
    return Buffer(params.table.ravel().tolist())


def goal(params: Buffer, state: Any, step: int, before: Any) -> Goal:
    """Return the row of this control step."""
    row: Any = params.row(step, 10)
    return Goal(row[:4], row[4:7], row[7:])


def examples() -> list[Params]:
    """Return a slow rotation about an inclined axis."""
    times = np.linspace(0.0, 100.0, 11)
    half = 0.01 * times
    attitudes = np.stack([np.cos(half), 0.6 * np.sin(half), 0.0 * half, 0.8 * np.sin(half)], axis=1)
    return [Params(tabulate(times, attitudes, np.arange(101) * 0.5), knots_of(times, attitudes, 50.0))]


def tabulate(times: Any, attitudes: Any, sample_times: Any) -> NDArray[np.float64]:
    """Return rows (attitude, rate, acceleration) at the sample times, from a twice differentiable rotation spline.

    times: (n,) s, increasing; attitudes: (n, 4) quaternions, scalar first; sample times within [times[0], times[-1]]. Raise
    ValueError if they are not, if the direction of the turn between neighbours is ambiguous, or if the spline swings far
    off between them. Target axes are the desired body axes."""
    times, samples = np.asarray(times, dtype=float), np.asarray(sample_times, dtype=float)
    first, last = samples.min(), samples.max()
    if not (times[0] <= first and last <= times[-1]):
        raise ValueError(f"the target history covers {times[0]:g} to {times[-1]:g} s, the run needs {first:g} to {last:g} s")
    spline = _spline(times, np.asarray(attitudes, dtype=float))
    q: NDArray[np.float64] = spline(samples).as_quat(scalar_first=True)
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    # The spline's rates are in the moving axes, which is the convention of this module.
    return np.ascontiguousarray(np.hstack([q, spline(samples, 1), spline(samples, 2)]))


def knots_of(times: Any, attitudes: Any, last: float) -> Knots:
    """Return the knots of the spline of `tabulate` that a run from 0 to `last` (s) needs. Errors as in `tabulate`."""
    times, attitudes = np.asarray(times, dtype=float), np.asarray(attitudes, dtype=float)
    rates: NDArray[np.float64] = _spline(times, attitudes)(times, 1)
    first, end = np.searchsorted(times, 0.0, "right") - 1, np.searchsorted(times, last, "left") + 1
    return Knots(*(array[max(first, 0) : end] for array in (times, attitudes, rates)))


def _spline(times: NDArray[np.float64], attitudes: NDArray[np.float64]) -> Any:
    """Return the spline. Raise ValueError if the turn between neighbours is ambiguous, or the spline swings far off."""
    # Loaded here because few runs need it, and by name because its types are too loose for a strict checker.
    transform: Any = import_module("scipy.spatial.transform")
    unclear = np.abs(np.sum(attitudes[1:] * attitudes[:-1], axis=1)) < HALF_TURN
    # Its iteration may fail for large turns at very uneven times.
    with np.errstate(all="ignore"):
        spline = transform.RotationSpline(times, transform.Rotation.from_quat(attitudes, scalar_first=True))
        speeds = np.linalg.norm(spline(times, 1), axis=1)
        far = ~(np.maximum(speeds[1:], speeds[:-1]) * np.diff(times) <= 3.0 * SWING)
    for k in np.flatnonzero(unclear | far):
        why = "a half turn, which could go either way" if unclear[k] else "the spline between them swings far off"
        raise ValueError(f"from {times[k]:g} to {times[k + 1]:g} s {why}")
    return spline
