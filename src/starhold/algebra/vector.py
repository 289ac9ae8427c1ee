"""Vectors and 3x3 matrices are tuples (a matrix is a tuple of rows)."""

from __future__ import annotations

from typing import Any, TypeAlias

from starhold.algebra.scalar import Scalar, Truth, absolute, both, clip, divide, less, maximum, minimum, sign, sqrt, where
from starhold.algebra.several import each

Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
Matrix: TypeAlias = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(c: Scalar, a: Vector) -> Vector:
    """Return c a."""
    return (c * a[0], c * a[1], c * a[2])


def times(a: Vector, b: Vector) -> Vector:
    """Return the product component by component."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


def dot(a: Vector, b: Vector) -> Scalar:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vector) -> Scalar:
    """Return the Euclidean length."""
    return sqrt(dot(a, a))


def most(a: tuple[Scalar, ...]) -> Scalar:
    """Return the largest absolute value of a component."""
    largest = absolute(a[0])
    for component in a[1:]:
        largest = maximum(largest, absolute(component))
    return largest


def unit(a: Vector) -> Vector:
    """Return a / |a|; not defined at zero."""
    return scale(1.0 / norm(a), a)


def signs(a: Vector) -> Vector:
    """Return the sign of each component."""
    return (sign(a[0]), sign(a[1]), sign(a[2]))


def clip_axes(a: Vector, limit: Scalar) -> Vector:
    """Keep each component within [-limit, limit]."""
    return (clip(a[0], limit), clip(a[1], limit), clip(a[2], limit))


def clip_norm(a: Vector, limit: Scalar) -> Vector:
    """Scale a down to length `limit` where it is longer. The limit must be positive; it may be infinite."""
    length = norm(a)
    return scale(where(less(length, limit), 1.0, limit / maximum(limit, length)), a)


def apply(m: Matrix | Vector, a: Vector) -> Vector:
    """Return the matrix-vector product; a vector in place of the matrix stands for a diagonal one."""
    rows: Any = m
    return times(rows, a) if _is_diagonal(m) else (dot(rows[0], a), dot(rows[1], a), dot(rows[2], a))


def gyroscopic_torque(m: Matrix | Vector, a: Vector) -> Vector:
    """Return a x (m a) for a symmetric m: the gyroscopic torque is gyroscopic_torque(J, w). A vector stands for a diagonal
    m."""
    if _is_diagonal(m):
        j: Any = m
        return ((j[2] - j[1]) * (a[1] * a[2]), (j[0] - j[2]) * (a[2] * a[0]), (j[1] - j[0]) * (a[0] * a[1]))
    return cross(a, apply(m, a))


def solve(m: Matrix | Vector, a: Vector) -> Vector:
    """Return the x with m x = a; not defined for a singular matrix. A vector stands for a diagonal matrix."""
    rows: Any = m
    return (a[0] / rows[0], a[1] / rows[1], a[2] / rows[2]) if _is_diagonal(m) else apply(inverse(rows), a)


def _is_diagonal(m: Matrix | Vector) -> bool:
    return not isinstance(m[0], tuple)


def column(m: Matrix, a: Vector) -> Vector:
    """Return the product of the transposed matrix and a vector."""
    return (
        m[0][0] * a[0] + m[1][0] * a[1] + m[2][0] * a[2],
        m[0][1] * a[0] + m[1][1] * a[1] + m[2][1] * a[2],
        m[0][2] * a[0] + m[1][2] * a[1] + m[2][2] * a[2],
    )


def transpose(m: Matrix) -> Matrix:
    """Return the transposed matrix."""
    return ((m[0][0], m[1][0], m[2][0]), (m[0][1], m[1][1], m[2][1]), (m[0][2], m[1][2], m[2][2]))


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """Return the matrix product a b."""
    x, y, z = each(_by_row, (a,), b)
    return (x, y, z)


def _by_row(row: Vector, b: Matrix) -> Vector:
    return column(b, row)


def combine(c: Scalar, a: Matrix, d: Scalar, b: Matrix) -> Matrix:
    """Return the matrix c a + d b."""
    x, y, z = each(_combined, (a, b), c, d)
    return (x, y, z)


def _combined(a: Vector, b: Vector, c: Scalar, d: Scalar) -> Vector:
    return add(scale(c, a), scale(d, b))


def skew(a: Vector) -> Matrix:
    """Return [a]x, the matrix of the vector product: apply(skew(a), b) = a x b."""
    return ((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0))


def diagonal(a: Vector) -> Matrix:
    """Return the diagonal matrix."""
    return ((a[0], 0.0, 0.0), (0.0, a[1], 0.0), (0.0, 0.0, a[2]))


def along_axis(axis: Vector, along: Scalar, across: Scalar) -> Matrix:
    """Return the symmetric matrix that multiplies vectors along a unit vector by `along`, others across it by `across`."""
    more = along - across
    return (
        add((across, 0.0, 0.0), scale(more * axis[0], axis)),
        add((0.0, across, 0.0), scale(more * axis[1], axis)),
        add((0.0, 0.0, across), scale(more * axis[2], axis)),
    )


def determinant(m: Matrix) -> Scalar:
    """Return the determinant."""
    return dot(m[0], cross(m[1], m[2]))


def inverse(m: Matrix) -> Matrix:
    """Return the inverse by the adjugate; not defined for a singular matrix."""
    c = 1.0 / determinant(m)
    return transpose((scale(c, cross(m[1], m[2])), scale(c, cross(m[2], m[0])), scale(c, cross(m[0], m[1]))))


SWEEPS = 6
"""Sweeps of Jacobi's rotations, after which the matrix is diagonal to rounding."""


def principal_moments(m: Matrix | Vector) -> Vector:
    """Return the eigenvalues of a symmetric matrix, or of the diagonal one with these entries, in ascending order."""
    a, b, c = _diagonal_of(m)
    low, high = minimum(minimum(a, b), c), maximum(maximum(a, b), c)
    return low, maximum(minimum(a, b), minimum(maximum(a, b), c)), high


def _diagonal_of(m: Matrix | Vector) -> Vector:
    """Return the diagonal after `SWEEPS` sweeps of Jacobi's rotations."""
    if _is_diagonal(m):
        return m  # pyright: ignore
    a: Any = [list(row) for row in m]  # pyright: ignore
    for p, q in SWEEPS * ((0, 1), (0, 2), (1, 2)):
        r, beside = 3 - p - q, a[p][q]
        theta = divide(a[q][q] - a[p][p], 2.0 * beside)
        t = where(less(theta, 0.0), -1.0, 1.0) / (absolute(theta) + sqrt(theta * theta + 1.0))
        t = where(less(0.0, absolute(beside)), t, 0.0)
        c = 1.0 / sqrt(t * t + 1.0)
        s = t * c
        a[p][p], a[q][q] = a[p][p] - t * beside, a[q][q] + t * beside
        a[p][q] = a[q][p] = 0.0
        x, y = c * a[r][p] - s * a[r][q], s * a[r][p] + c * a[r][q]
        a[r][p] = a[p][r] = x
        a[r][q] = a[q][r] = y
    return (a[0][0], a[1][1], a[2][2])


def decays(m: Matrix | Vector) -> Truth:
    """Tell whether x' = m x is asymptotically stable (all eigenvalues in the left half plane), by Routh's criterion."""
    if _is_diagonal(m):
        return both(both(less(m[0], 0.0), less(m[1], 0.0)), less(m[2], 0.0))  # pyright: ignore
    rows: Any = m
    (a, b, c), (d, e, f), (g, h, i) = rows
    minors = (a * e - b * d) + (a * i - c * g) + (e * i - f * h)
    whole = determinant(rows)
    return both(both(less(a + e + i, 0.0), less(whole, 0.0)), less((a + e + i) * minors, whole))
