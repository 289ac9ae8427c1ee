"""Distributions by their inverse distribution functions: uniform numbers in, values out, so that random, Sobol and Latin
hypercube samples serve all of them alike.

Every `draw` takes uniforms u (dims, n) strictly between 0 and 1 and returns values (width, n), each a function of its own
column of u alone, to the last bit: so a campaign may be cut into chunks anywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

Array: TypeAlias = NDArray[np.float64]
Numbers: TypeAlias = tuple[float, ...]


class Distribution(Protocol):
    """A distribution of one number or of several."""

    @property
    def dims(self) -> int:
        """Uniforms that a draw takes."""
        ...

    def draw(self, u: Array) -> NDArray[Any]:
        """Values (width, n) for uniforms (dims, n)."""
        ...


def _column(numbers: Numbers) -> Array:
    return np.array(numbers, dtype=np.float64)[:, None]


@dataclass(frozen=True)
class Uniform:
    """Independent numbers between `low` and `high` (each (width,)); whole ones from both ends inclusive. One uniform moves
    all where they are drawn together."""

    low: Numbers
    high: Numbers
    dims: int
    whole: bool = False

    def draw(self, u: Array) -> Array:
        """Numbers in proportion to the uniforms."""
        low, high = _column(self.low), _column(self.high)
        if self.whole:
            return np.minimum(low + np.floor((high - low + 1.0) * u), high)
        # Rounding may lead beyond an end, which the key may refuse.
        return np.clip(low + (high - low) * u, low, high)


@dataclass(frozen=True)
class Normal:
    """Independent numbers of these means and standard deviations (each (width,))."""

    mean: Numbers
    sigma: Numbers
    dims: int

    def draw(self, u: Array) -> Array:
        """mean + sigma z."""
        return _column(self.mean) + _column(self.sigma) * ndtri(u)


@dataclass(frozen=True)
class TruncatedNormal:
    """Numbers of a normal distribution, given that they are between `low` and `high` (each (width,), perhaps infinite)."""

    mean: Numbers
    sigma: Numbers
    low: Numbers
    high: Numbers
    dims: int

    @cached_property
    def _tails(self) -> tuple[NDArray[np.bool_], Array, Array]:
        """Whether each is turned about its mean, and the probabilities below its ends when it is. The upper tail's are too
        near one to be told apart, so an interval there is turned into the lower."""
        mean, sigma, low, high = (_column(numbers) for numbers in (self.mean, self.sigma, self.low, self.high))
        with np.errstate(divide="ignore", invalid="ignore"):
            first, last = (low - mean) / sigma, (high - mean) / sigma
        turned = first > 0.0
        return turned, ndtr(np.where(turned, -last, first)), ndtr(np.where(turned, -first, last))

    @property
    def reached(self) -> bool:
        """Whether each interval has a probability that floats can hold."""
        _, below, above = self._tails
        return bool((above - below > 0.0).all())

    def draw(self, u: Array) -> Array:
        """Quantiles of the cut distribution."""
        turned, below, above = self._tails
        z = ndtri(below + np.where(turned, 1.0 - u, u) * (above - below))
        found = _column(self.mean) + _column(self.sigma) * np.where(turned, -z, z)
        return np.clip(found, _column(self.low), _column(self.high))


@dataclass(frozen=True)
class LogNormal:
    """Independent numbers of these medians, whose natural logarithms have these standard deviations (each (width,))."""

    median: Numbers
    sigma: Numbers
    dims: int

    def draw(self, u: Array) -> Array:
        """median exp(sigma z)."""
        return _column(self.median) * np.exp(_column(self.sigma) * ndtri(u))


@dataclass(frozen=True)
class Choice:
    """One of several values, each a tuple of numbers or a single word, by weights."""

    values: tuple[tuple[Any, ...], ...]
    weights: Numbers
    dims: int = 1

    def draw(self, u: Array) -> NDArray[Any]:
        """The value in whose part of the line from 0 to 1 the uniform falls."""
        ends = np.cumsum(self.weights)
        return np.array(self.values).T[:, np.searchsorted(ends[:-1] / ends[-1], u[0], side="right")]


@dataclass(frozen=True)
class CorrelatedNormal:
    """Numbers of these means, (width,), and of the covariance L L^T; `factor`: the rows of L, lower triangular."""

    mean: Numbers
    factor: tuple[Numbers, ...]

    @property
    def dims(self) -> int:
        """One for each number."""
        return len(self.mean)

    def draw(self, u: Array) -> Array:
        """mean + L z."""
        z, found = ndtri(u), np.empty_like(u)
        # Term by term: how a matrix product adds depends on its width.
        for place, (mean, row) in enumerate(zip(self.mean, self.factor, strict=True)):
            total = np.full(u.shape[1], mean)
            for other in range(place + 1):
                total += row[other] * z[other]
            found[place] = total
        return found


@dataclass(frozen=True)
class Rotations:
    """Unit quaternions, scalar first, uniform on the sphere of four dimensions and so on the rotation group; both signs of
    each are as likely, for laws may tell them apart.

    Source: K. Shoemake, Uniform random rotations, Graphics Gems III (1992): the subgroup algorithm.
    """

    dims: int = 3

    def draw(self, u: Array) -> Array:
        """A turn about an axis, and a point of the sphere where that is turned to."""
        near, far = np.sqrt(1.0 - u[0]), np.sqrt(u[0])
        first, second = math.tau * u[1], math.tau * u[2]
        return np.stack([far * np.cos(second), near * np.sin(first), near * np.cos(first), far * np.sin(second)])


@dataclass(frozen=True)
class Shell:
    """Vectors of any direction, uniform in the volume between two norms."""

    low: float
    high: float
    dims: int = 3

    def draw(self, u: Array) -> Array:
        """A radius by its cube, a height on the unit sphere (Archimedes) and a longitude."""
        hollow = (self.low / self.high) ** 3
        radius = np.clip(self.high * np.cbrt(hollow + u[0] * (1.0 - hollow)), self.low, self.high)
        height, longitude = 2.0 * u[1] - 1.0, math.tau * u[2]
        level = np.sqrt(4.0 * u[1] * (1.0 - u[1]))
        return radius * np.stack([level * np.cos(longitude), level * np.sin(longitude), height])
