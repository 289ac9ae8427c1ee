"""Block covariances of the errors of an attitude and of three numbers on which its rate depends, for filters, and the gyro
noise that filters assume."""

from __future__ import annotations

from starhold.algebra.scalar import Scalar, sqrt
from starhold.algebra.vector import Matrix, Vector, combine, multiply, transpose
from starhold.parts.contract import Parameter

GYRO_NOISE = Parameter("rad/s", also="rad/sqrt(s)", at_least=0.0, text="gyro: standard deviation of the mean over 1 s")
GYRO_WALK = Parameter("rad/s", also="rad/s/sqrt(h)", at_least=0.0, text="gyro: standard deviation of the bias change in 1 h")
GYRO_BIAS = Parameter("rad/s", above=0.0, text="gyro: standard deviation of the bias at the start")


def carried(turn: Matrix, mixed: Matrix, walk: Matrix, axes: Matrix, drift: Matrix) -> tuple[Matrix, Matrix]:
    """Return the covariance of the attitude's error and its cross-covariance with the three numbers, after the attitude's
    error is multiplied by `axes` and `drift` times the numbers' error is added to it."""
    after = summed(multiply(axes, mixed), multiply(drift, walk))
    spread = summed(
        multiply(summed(multiply(axes, turn), multiply(drift, transpose(mixed))), transpose(axes)),
        multiply(after, transpose(drift)),
    )
    return spread, after


def along_diagonal(a: Matrix, number: Scalar) -> Matrix:
    """Return a + number times the identity."""
    return ((a[0][0] + number, a[0][1], a[0][2]), (a[1][0], a[1][1] + number, a[1][2]), (a[2][0], a[2][1], a[2][2] + number))


def summed(a: Matrix, b: Matrix) -> Matrix:
    """Return a + b."""
    return combine(1.0, a, 1.0, b)


def symmetric(a: Matrix) -> Matrix:
    """Return the mean of a matrix and its transpose, which differ by rounding."""
    x, y, z = 0.5 * (a[0][1] + a[1][0]), 0.5 * (a[0][2] + a[2][0]), 0.5 * (a[1][2] + a[2][1])
    return ((a[0][0], x, y), (x, a[1][1], z), (y, z, a[2][2]))


def deviations(a: Matrix) -> Vector:
    """Return the square roots of the diagonal."""
    return (sqrt(a[0][0]), sqrt(a[1][1]), sqrt(a[2][2]))
