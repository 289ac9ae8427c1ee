"""Residuals of readings in deviations of the noise that their sensors state, and whether they are white."""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from starhold.algebra.dual import Dual, variables
from starhold.algebra.quaternion import conjugate, multiply
from starhold.algebra.structure import flatten
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.random import RANGE, Silent
from starhold.studies.fitting import Array, Prediction, Reading

SINGULAR = 1e-9
"""Eigenvalues of a noise's covariance below this share of the largest are 0, as along a direction that is a unit vector."""
LAGS = 20
"""Lags of the test of Ljung and Box."""
TURNS = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.6, 0.8, 0.0, 0.0), (0.6, 0.0, 0.8, 0.0))
"""The attitudes in which a sensor is tried that sees nothing at the start."""


class Noise(NamedTuple):
    """The noise of a reading: the matrix that makes residuals of unit variance, the degrees of freedom that a row has, and
    whether more noise accumulates in the sensor's memory."""

    whiten: Array
    degrees: int
    accumulates: bool


class Weighed(NamedTuple):
    """A reading with what it was at some times: its rows, (n, size), the times in control periods, (n,), the instants that a
    prediction there is made of with their weights, (n, k), and the matrix that makes residuals of unit variance; degrees:
    those that a row has of freedom."""

    reading: Reading
    rows: Array
    times: Array
    instants: Any
    weights: Array
    whiten: Array
    degrees: int

    @classmethod
    def of(cls, reading: Reading, rows: Array, times: Array, steps: int, noise: Noise) -> Weighed:
        """A reading at times within `steps` control steps: predictions between instants are those of a cubic through
        four."""
        count = 1 if (times == np.round(times)).all() else min(4, steps + 1)
        first = np.clip(np.floor(times).astype(int) - (count - 1) // 2, 0, steps + 1 - count)
        off = times - first
        ways = [[(off - m) / (j - m) for m in range(count) if m != j] for j in range(count)]
        weights = np.array([np.prod(way, axis=0) if way else np.ones(len(times)) for way in ways]).T
        return cls(reading, rows, times, first[:, None] + np.arange(count), weights, noise.whiten, noise.degrees)

    def at(self, rows: Array) -> Array:
        """Rows at the times, (n, ...), of those at all instants."""
        return np.einsum("nk,nk...->n...", self.weights, rows[self.instants])

    def residuals(self, given: Prediction) -> tuple[Array, Array]:
        """Residuals (n, size) in deviations, and their slopes (n, size, free + 1); 0 where the flight reads nothing new."""
        values, slopes = self._residuals(given)
        for _, gate in self.reading.gates:
            seen = ((given.values[self.instants, gate] > 0.5) | (self.weights == 0.0)).all(axis=1)
            values, slopes = values * seen[:, None], slopes * seen[:, None, None]
        return values, slopes

    def _residuals(self, given: Prediction) -> tuple[Array, Array]:
        values, slopes = self.at(given.values[:, self.reading.rows]), self.at(given.slopes[:, self.reading.rows])
        if self.reading.size != 4:
            return (values - self.rows) @ self.whiten.T, np.einsum("ij,njk->nik", self.whiten, slopes)
        off = conjugates(self.rows)
        error = np.einsum("nij,nj->ni", off, values)
        side = np.where(error[:, :1] < 0.0, -2.0, 2.0)
        turn = np.einsum("nij,njk->nik", off, slopes)[:, 1:] * side[..., None]
        return (error[:, 1:] * side) @ self.whiten.T, np.einsum("ij,njk->nik", self.whiten, turn)


def ljung_box(values: Array) -> float:
    """The p-value of the hypothesis that numbers (n,) in order are not correlated, by G. M. Ljung and G. E. P. Box,
    Biometrika 65 (1978); 1 for too few."""
    count = len(values)
    lags = min(LAGS, count // 5)
    spread = values - values.mean() if count else values
    total = float(spread @ spread)
    if not lags or total == 0.0:
        return 1.0
    shares = [float(spread[k:] @ spread[:-k]) / total for k in range(1, lags + 1)]
    return float(stats.chi2.sf(count * (count + 2) * sum(r * r / (count - k) for k, r in enumerate(shares, 1)), lags))


def conjugates(quaternions: Array) -> Array:
    """Return the matrices (n, 4, 4) that multiply from the left by the conjugates of quaternions (n, 4)."""
    units = [tuple(row) for row in np.eye(4)]
    return np.array([[multiply(conjugate(tuple(q)), unit) for unit in units] for q in quaternions]).swapaxes(1, 2)


class _Varied(Silent):
    """Random numbers that are 0 and vary, to see how noise enters a reading."""

    def vector(self, place: int, deviation: Any) -> Any:
        x, y, z = self.normals(place, 3)
        return (deviation * x, deviation * y, deviation * z)

    def normals(self, place: int, count: int) -> tuple[Any, ...]:
        return tuple(variables([0.0] * count, place, RANGE))


def noise_of(loop: ClosedLoop, reading: Reading) -> Noise | None:
    """The noise that the sensor of a reading states; None for none."""
    setup, carry = loop.setup(), loop.carry()
    # A sensor that sees nothing there shows no noise: it is tried in other attitudes, and on the other side.
    for turn, side in product(TURNS, (1.0, -1.0)):
        attitude = multiply(carry.state.attitude, turn)
        state = carry.state._replace(attitude=attitude, position=tuple(side * x for x in carry.state.position))
        first = 0
        for fitted, memory, params in zip(loop.used("sensor"), carry.memories.sensors, setup.sensors, strict=True):
            shown, kept = fitted.part.module.measure(state, memory, params, _Varied(), 0)
            rows = flatten((shown,))
            if first <= reading.first < first + len(rows):
                part = rows[reading.first - first : reading.first - first + reading.size]
                slopes, values = _slopes(part), [getattr(x, "value", x) for x in part]
                if slopes.any():
                    memories = _slopes(flatten((kept,))).any(axis=0) & ~slopes.any(axis=0)
                    return _noise(slopes if reading.size != 4 else 2.0 * (conjugates(np.array([values]))[0] @ slopes)[1:],
                                  bool(memories.any()))  # fmt: skip
            first += len(rows)
    return None


def _slopes(numbers: Any) -> Array:
    return np.array([x.slopes if isinstance(x, Dual) else np.zeros(RANGE) for x in numbers]).reshape(-1, RANGE)


def _noise(slopes: Array, accumulates: bool) -> Noise:
    sizes, axes = np.linalg.eigh(slopes @ slopes.T)
    known = sizes > SINGULAR * sizes[-1]
    return Noise((axes / np.sqrt(np.where(known, sizes, sizes[-1]))).T, int(known.sum()), accumulates)
