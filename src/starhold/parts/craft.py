"""The mass properties of a spacecraft, for laws and equations of motion."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quantity import Quantity
from starhold.algebra.vector import Matrix, Vector, principal_moments
from starhold.algebra.vector import inverse as inverse_matrix

EARTH = 3.986e14
"""Gravitational parameter of the Earth, m3/s2, as the published experiment uses it."""

DENSEST = 22_600.0
"""The density of osmium, rounded up, kg/m3."""


class Craft(NamedTuple):
    """A rigid spacecraft. The inertia, about the centre of mass in body axes, is three moments where these are principal,
    else a matrix: `apply` and `gyroscopic_torque` take both."""

    inertia: Annotated[Matrix | Vector, Quantity("kg m^2", "of a craft with wheels without their rotors' about their axes")]
    inverse_inertia: Annotated[Matrix | Vector, Quantity("1/(kg m^2)", "its inverse")]
    torque_limit: Annotated[
        float,
        Quantity("N m", "available to a law, per axis or in norm; infinite for none; with wheels at most their torque"),
    ]
    gravity: Annotated[float, Quantity("m^3/s^2", "gravitational parameter of the body that it orbits")]
    with_rotors: Annotated[
        Matrix | Vector | tuple[()], Quantity("kg m^2", "inertia with the rotors; () without wheels")
    ] = ()


def total_inertia(craft: Craft) -> Matrix | Vector:
    """Return the inertia of the whole craft, on which gravity acts (kg m2)."""
    return craft.with_rotors or craft.inertia


def make_craft(inertia: Any, torque_limit: float = math.inf, gravity: float = EARTH) -> Craft:
    """Return a validated craft from three principal moments or a 3x3 tensor (kg m2).

    Raises ValueError when the tensor is not symmetric, not positive definite, breaks the triangle inequality
    J1 + J2 >= J3, which every real mass distribution obeys, or when the limit is not positive."""
    full = check_inertia(inertia)
    if not torque_limit > 0.0:
        raise ValueError(f"the torque limit must be positive, not {torque_limit:g}")
    moments = compact(full)
    return Craft(moments, inverse(moments), float(torque_limit), float(gravity))


def inverse(inertia: Matrix | Vector) -> Matrix | Vector:
    """Return the inverse of an inertia in the same form. As an equation it gives the same bits everywhere."""
    rows: Any = inertia
    return inverse_matrix(rows) if isinstance(rows[0], tuple) else (1.0 / rows[0], 1.0 / rows[1], 1.0 / rows[2])


def tensor(inertia: Matrix | Vector) -> NDArray[np.float64]:
    """Return an inertia as a 3x3 array."""
    array = np.array(inertia)
    return np.diag(array) if array.ndim == 1 else array


def check_inertia(inertia: Any) -> NDArray[np.float64]:
    """Return the 3x3 tensor of three principal moments or a 3x3 array. Raise ValueError if no rigid body can have it."""
    tensor = np.asarray(inertia, dtype=float)
    if tensor.shape == (3,):
        tensor = np.diag(tensor)
    if tensor.shape != (3, 3):
        raise ValueError(f"inertia must be three moments or a 3x3 matrix, not an array of shape {tensor.shape}")
    if not np.isfinite(tensor).all():
        raise ValueError("inertia must be finite")
    # Relative to the largest entry: a rotated tensor has rounding errors in its small products of inertia.
    if np.abs(tensor - tensor.T).max() > 1e-9 * np.abs(tensor).max():
        raise ValueError("inertia must be symmetric")
    tensor = 0.5 * (tensor + tensor.T)
    check_moments(compact(tensor))
    return tensor


def heaviest(inertia: Any) -> float:
    """Return the largest mass (kg) of a body with this inertia (kg m2): that of a ball of the densest metal, the most
    compact body of its mass."""
    moments = 0.5 * float(np.trace(tensor(inertia)))
    return (moments / 0.6 * (4.0 / 3.0 * math.pi * DENSEST) ** (2.0 / 3.0)) ** 0.6


def check_moments(inertia: Matrix | Vector) -> None:
    """Raise ValueError if no rigid body has this inertia, for recorded numbers too."""
    moments = principal_moments(inertia)
    shown = ", ".join(f"{m:g}" for m in moments)
    if moments[0] <= 0.0:
        raise ValueError(f"inertia must be positive definite; its principal moments are {shown}")
    if moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        raise ValueError(f"no body has these principal moments ({shown}): the largest exceeds the sum of the others")


def bare_inertia(inertia_total: Any, axial: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return J' = J - sum J_i a_i a_i^T (3, 3; kg m2) of a craft whose total inertia, including rotors at rest, is J (three
    principal moments or 3x3); axial: the sum.

    J' is not the inertia of a body: it need not obey the triangle inequality. Raise ValueError if J is not an inertia or J'
    is not positive definite."""
    rest = check_inertia(inertia_total) - axial
    # With symmetric layouts the products of inertia are only rounding errors, which would make a diagonal inertia full.
    rest[np.abs(rest) < 1e-15 * check_rest(compact(rest))] = 0.0
    return rest


def check_rest(rest: Matrix | Vector) -> float:
    """Return the largest principal moment of a craft without its rotors' axial inertia (kg m2). Raise ValueError if a
    moment is not positive, for recorded numbers too."""
    moments = principal_moments(rest)
    if moments[0] <= 0.0:
        shown = ", ".join(f"{m:g}" for m in moments)
        raise ValueError(f"the rotors have more inertia than the craft: without them its principal moments are {shown}")
    return moments[2]


def compact(array: Any) -> Matrix | Vector:
    """Return a 3x3 array as a matrix, or as the vector of its diagonal if all other entries are zero."""
    full = np.asarray(array, dtype=float)
    diagonal = np.diagonal(full)
    return matrix(full) if np.count_nonzero(full - np.diag(diagonal)) else vector(diagonal)


def vector(array: Any) -> Vector:
    """Return three numbers as a tuple of floats."""
    a: list[float] = np.asarray(array, dtype=float).tolist()
    return (a[0], a[1], a[2])


def matrix(array: Any) -> Matrix:
    """Return a 3x3 array as a tuple of rows of floats."""
    a: list[list[float]] = np.asarray(array, dtype=float).tolist()
    return ((a[0][0], a[0][1], a[0][2]), (a[1][0], a[1][1], a[1][2]), (a[2][0], a[2][1], a[2][2]))
