"""Matrices of reaction wheels with NumPy, for one craft or for many (lanes first), with the same bits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST = 24
"""The most wheels that a craft has: the work of allocating the least peak grows with their cube."""


def unit_axes(axes: Array) -> Array:
    """Return the axes (..., N, 3) scaled to unit length."""
    return axes / np.linalg.norm(axes, axis=-1)[..., None]


def least_squares(axes: Array, working: Sequence[int]) -> Array:
    """Return the allocation (..., N, 3) of least squares over the working wheels; zero for the others."""
    rows = np.zeros_like(axes)
    rows[..., working, :] = -np.linalg.pinv(np.take(axes, working, axis=-2).swapaxes(-1, -2))
    return rows


def axial(axes: Array, inertia: Array) -> Array:
    """Return the inertia (..., 3, 3; kg m2) of rotors (..., N) about their axes (..., N, 3), symmetric to the last bit."""
    made = (axes.swapaxes(-1, -2) * inertia[..., None, :]) @ axes
    return 0.5 * (made + made.swapaxes(-1, -2))


def most_of_each(rows: Array, kind: str) -> Array:
    """Return the maximum (..., N) of each row (..., N, 3) times a vector in the unit ball, or in the unit box ("axis")."""
    return np.linalg.norm(rows, axis=-1, ord=1 if kind == "axis" else 2)


def checked_axes(axes: Sequence[Sequence[float]]) -> Array:
    """Return the unit axes (N, 3) of wheels. Raise ValueError for axes without direction, or too many."""
    matrix = np.asarray(axes, dtype=float)
    if matrix.ndim != 2 or matrix.shape[1] != 3:
        raise ValueError(f"wheel axes must be vectors of three numbers, not an array of shape {matrix.shape}")
    if len(matrix) > MOST:
        raise ValueError(f"at most {MOST} wheels are taken, not {len(matrix)}")
    lengths = np.linalg.norm(matrix, axis=1)
    for i, length in enumerate(lengths.tolist()):
        if not 0.0 < length < math.inf:
            raise ValueError(f"the axis of wheel {i + 1} must have a finite length above zero, not {length:g}")
    return unit_axes(matrix)


def checked_column(name: str, value: Any, count: int, least: float | None, infinite: bool = False) -> tuple[float, ...]:
    """Return a number for each wheel, from one for each or one for all; `least` None requires positive numbers. Raise Raise
    ValueError if one is out of range."""
    given = np.asarray(value, dtype=float)
    if given.shape not in ((), (count,)):
        raise ValueError(f"{name}: one number or {count} are needed, not an array of shape {given.shape}")
    column: list[float] = np.broadcast_to(given, (count,)).tolist()
    for i, number in enumerate(column):
        sound = number > 0.0 if least is None else number >= least
        if not sound or (math.isinf(number) and not infinite):
            range_ = "positive" if least is None else "zero or more"
            raise ValueError(
                f"the {name} of wheel {i + 1} must be {range_}{'' if infinite else ' and finite'}, not {number:g}"
            )
    return tuple(column)
