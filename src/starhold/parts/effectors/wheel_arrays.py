"""Matrices of reaction wheels, with NumPy: of one craft or, with lanes first, of many, with the same bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def unit_axes(axes: Array) -> Array:
    """The axes (..., N, 3) with length one."""
    return axes / np.linalg.norm(axes, axis=-1)[..., None]


def least_squares(axes: Array, working: Sequence[int]) -> Array:
    """The allocation (..., N, 3) with the least sum of squares among the working wheels; zero for the others."""
    rows = np.zeros_like(axes)
    rows[..., working, :] = -np.linalg.pinv(np.take(axes, working, axis=-2).swapaxes(-1, -2))
    return rows


def axial(axes: Array, inertia: Array) -> Array:
    """The inertia (..., 3, 3; kg m2) of rotors (..., N) about their own axes (..., N, 3)."""
    return (axes.swapaxes(-1, -2) * inertia[..., None, :]) @ axes


def most_of_each(rows: Array, kind: str) -> Array:
    """The most (..., N) that each row (..., N, 3) gives of a vector within the unit ball, or the unit box ("axis")."""
    return np.linalg.norm(rows, axis=-1, ord=1 if kind == "axis" else 2)
