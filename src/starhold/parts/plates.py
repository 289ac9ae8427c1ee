"""A spacecraft as flat plates, for the torques of drag and sunlight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import combinations
from math import hypot
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.scalar import Scalar, maximum, plus
from starhold.algebra.vector import Vector, scale

COLUMNS = ("area", "normal_x", "normal_y", "normal_z", "x", "y", "z")
"""The columns of a table of plates: area (m2), outward normal, and centre from the centre of mass (m), body axes."""
TEXT = "areas, outward normals and centres from the centre of mass, body axes; no plate shades another"
TOLERANCE = 1e-9
"""The sine below which a plate counts as seen edge-on."""
BOX = (
    (0.06, 1.0, 0.0, 0.0, 0.052, -0.01, 0.02),
    (0.06, -1.0, 0.0, 0.0, -0.048, -0.01, 0.02),
    (0.03, 0.0, 1.0, 0.0, 0.002, 0.09, 0.02),
    (0.03, 0.0, -1.0, 0.0, 0.002, -0.11, 0.02),
    (0.02, 0.0, 0.0, 1.0, 0.002, -0.01, 0.17),
    (0.02, 0.0, 0.0, -1.0, 0.002, -0.01, -0.13),
)
"""The six sides of a 6U CubeSat, 0.1 by 0.2 by 0.3 m, with its centre of mass off the middle: an example."""


class Plates(NamedTuple):
    """Areas (m2), unit normals, in which 0, 1 and -1 are constants, and centres (m)."""

    areas: tuple[Scalar, ...]
    normals: tuple[Vector, ...]
    centres: tuple[Vector, ...]


def plates_of(rows: Any) -> Plates:
    """Return the plates of a table. Raise ValueError for no rows, a negative area or a normal without direction."""
    if not rows:
        raise ValueError("the table of plates needs a row")
    normals: list[Vector] = []
    for number, (area, x, y, z, *_) in enumerate(rows, 1):
        size = hypot(x, y, z)
        if not (area >= 0.0 and size > 0.0):
            raise ValueError(f"plate {number} needs an area of at least 0 and a normal with a direction")
        normals.append(constant(scale(1.0 / size, (x, y, z))))
    return Plates(tuple(row[0] for row in rows), tuple(normals), tuple((row[4], row[5], row[6]) for row in rows))


def constant(vector: Vector) -> Vector:
    """Return a vector with components 0, 1 and -1 as integers, which are constants of a kernel: most plates lie along the
    axes, and `cosines` and `total` do no arithmetic with such components."""
    x, y, z = (int(number) if number in (-1.0, 0.0, 1.0) else number for number in vector)
    return (x, y, z)


def cosines(normals: Sequence[Vector], direction: Vector) -> tuple[Scalar, ...]:
    """Return the cosines of the angles between normals and a direction, 0 for plates facing away."""
    along, seen = [_sum(normal, direction) for normal in normals], list[Scalar]()
    for number, normal in enumerate(normals):
        # Of the two sides of a box at most one is seen: max(-x, 0) is max(x, 0) - x, without rounding.
        other = next((k for k in range(number) if _opposite(normals[k], normal)), None)
        seen.append(maximum(along[number], 0.0) if other is None else seen[other] - along[other])
    return tuple(seen)


def _opposite(one: Vector, other: Vector) -> bool:
    """Return whether two constant normals are opposite; those that are numbers of a flight are not compared."""
    return all(isinstance(a, int) and isinstance(b, int) and a == -b for a, b in zip(one, other, strict=True))


def total(weights: Sequence[Scalar], arms: Sequence[Vector], normals: Sequence[Vector]) -> Vector:
    """Return the sum of weights[i] * arms[i], from the first to the last; the weights are cosines of the normals, or their
    squares."""
    x, y, z = (_sum(*_joined(column, weights, normals)) for column in zip(*arms, strict=True))
    return (x, y, z)


def _joined(
    column: Sequence[Scalar], weights: Sequence[Scalar], normals: Sequence[Vector]
) -> tuple[list[Scalar], list[Scalar]]:
    """Return factors and weights, joined for two sides of a box in a row whose factors are equal or opposite: one of their
    weights is zero, so one product is the sum of both, without rounding."""
    factors, numbers, place = list[Scalar](), list[Scalar](), 0
    while place < len(column):
        factor, number = column[place], weights[place]
        place += 1
        if place < len(column) and _opposite(normals[place - 1], normals[place]):
            sign = _ratio(factor, column[place])
            if sign:
                number = number + weights[place] if sign > 0 else number - weights[place]
                place += 1
        factors.append(factor)
        numbers.append(number)
    return factors, numbers


def _ratio(one: Any, other: Any) -> int:
    """Return 1 for equal numbers, -1 for opposite ones, 0 if they are neither, or not known to be, or constants."""
    if isinstance(one, int) or isinstance(other, int):
        return 0
    for sign, like in ((1, other), (-1, -other)):
        # Numbers of a kernel cannot be compared: it has made those that are alike one.
        if one is like or (isinstance(one, float) and isinstance(like, float) and one == like):
            return sign
    return 0


def _sum(factors: Sequence[Scalar], numbers: Sequence[Scalar]) -> Scalar:
    terms = [_product(*pair) for pair in zip(factors, numbers, strict=True) if not _is_zero(pair[0])]
    return reduce(plus, terms) if terms else 0.0


def _is_zero(factor: Scalar) -> bool:
    return isinstance(factor, int) and factor == 0


def _product(factor: Scalar, number: Scalar) -> Scalar:
    if isinstance(factor, int):
        return number if factor > 0 else -number
    return factor * number


def largest_torque(
    normals: Sequence[Vector], taken: Sequence[Vector], mirrored: Sequence[Vector] = (), scattered: Sequence[Vector] = ()
) -> float:
    """Return a bound (m3) on |s x sum c_i taken_i - sum c_i^2 mirrored_i - sum c_i scattered_i| over all unit vectors s,
    with c_i = max(n_i.s, 0).

    For a fixed set of visible plates the first sum is Ms, and |s x Ms| = |s x (M - x)s| is at most |M - x| for any number
    x. The others are linear in s and in the products of its components.
    """
    n = np.array(normals)
    first, second, third = (np.array(arms if len(arms) else np.zeros_like(n)) for arms in (taken, mirrored, scattered))
    squares = np.einsum("ij,ik->ijk", n, n).reshape(-1, 9)
    largest = 0.0
    for seen in sights(n):
        faces = n[seen]
        M = first[seen].T @ faces
        low, _, high = np.linalg.eigvalsh(M + M.T) / 2.0
        shifts = low + (high - low) * np.arange(33) / 32.0
        arms = np.linalg.norm(M - shifts[:, None, None] * np.eye(3), 2, axis=(1, 2))
        others = np.linalg.norm(third[seen].T @ faces, 2) + np.linalg.norm(second[seen].T @ squares[seen], 2)
        largest = max(largest, float(arms.min() + others))
    # Slightly more, because plates seen nearly edge-on may count as hidden.
    return largest + TOLERANCE * float(sum(np.linalg.norm(arms, axis=1).sum() for arms in (first, second, third)))


def sights(normals: NDArray[np.float64]) -> Iterator[NDArray[np.bool_]]:
    """Yield the sets of plates visible at once, as (n,) of bool, for all directions: the cells into which the planes normal
    to the plates' normals divide space, each of which has an edge where two planes meet, or is a half-space."""
    across = [np.cross(*pair) for pair in combinations(normals, 2)]
    edges = [unit / size for unit in across if (size := np.linalg.norm(unit)) > TOLERANCE]
    patterns = {tuple(normals @ side > 0.0) for side in (normals[0], -normals[0])} if not edges else set[tuple[bool, ...]]()
    for edge in [e * sign for e in edges for sign in (1.0, -1.0)]:
        height = normals @ edge
        flat = np.abs(height) <= TOLERANCE
        # Around the edge: half-way between the planes that meet there.
        lines = np.cross(edge, normals[flat])
        first = lines[0] / np.linalg.norm(lines[0])
        second = np.cross(edge, first)
        angles = np.arctan2(lines @ second, lines @ first) % np.pi
        angles = np.sort(np.concatenate([angles, angles + np.pi]))
        for half in (angles + np.append(angles[1:], angles[0] + 2.0 * np.pi)) / 2.0:
            aside = np.cos(half) * first + np.sin(half) * second
            patterns.add(tuple(np.where(flat, normals @ aside, height) > 0.0))
    yield from (np.array(one) for one in sorted(patterns))
