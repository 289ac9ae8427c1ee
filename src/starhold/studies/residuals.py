"""Residuals of readings, in standard deviations of the noise that their sensors state, and a test of their whiteness."""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from starhold.algebra.dual import Dual, variables
from starhold.algebra.quaternion import conjugate, multiply
from starhold.algebra.structure import flatten
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.random import RANGE, Dice
from starhold.studies.fitting import Array, Prediction, Reading

SINGULAR = 1e-9
"""Eigenvalues of a noise covariance below this share of the largest count as 0, as along the direction of a unit vector."""
LAGS = 20
"""The number of lags in the test of Ljung and Box."""
TURNS = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.6, 0.8, 0.0, 0.0), (0.6, 0.0, 0.8, 0.0))
"""The attitudes in which a sensor without a valid reading at the start is tried."""


class Noise(NamedTuple):
    """The noise of a reading: the matrix that scales residuals to unit variance, the degrees of freedom of a row, and
    whether further noise accumulates in the sensor's memory."""

    whiten: Array
    degrees: int
    accumulates: bool


class Weighed(NamedTuple):
    """The recorded rows (n, size) of a reading, their times (n,) in control periods, the instants and weights (n, k) with
    which predictions are interpolated to these times, and the matrix that scales residuals to unit variance; degrees: the
    degrees of freedom of a row."""

    reading: Reading
    rows: Array
    times: Array
    instants: Any
    weights: Array
    whiten: Array
    degrees: int

    @classmethod
    def of(cls, reading: Reading, rows: Array, times: Array, steps: int, noise: Noise) -> Weighed:
        """Return a reading at times within `steps` control steps; predictions between instants are interpolated by a cubic
        through four of them."""
        count = 1 if (times == np.round(times)).all() else min(4, steps + 1)
        first = np.clip(np.floor(times).astype(int) - (count - 1) // 2, 0, steps + 1 - count)
        off = times - first
        ways = [[(off - m) / (j - m) for m in range(count) if m != j] for j in range(count)]
        weights = np.array([np.prod(way, axis=0) if way else np.ones(len(times)) for way in ways]).T
        return cls(reading, rows, times, first[:, None] + np.arange(count), weights, noise.whiten, noise.degrees)

    def at(self, rows: Array) -> Array:
        """Return the rows (n, ...) interpolated to the times, from the rows at all instants."""
        return np.einsum("nk,nk...->n...", self.weights, rows[self.instants])

    def residuals(self, given: Prediction) -> tuple[Array, Array]:
        """Return residuals (n, size) in standard deviations and their slopes (n, size, free + 1); 0 where the predicted
        flight has no new reading."""
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
    """Return the p-value of the hypothesis that a series (n,) is uncorrelated (G. M. Ljung and G. E. P. Box, Biometrika 65,
    1978); 1 for too few numbers."""
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


class _Varied(Dice):
    """Random numbers with the value 0 and a derivative, to determine how noise enters a reading."""

    def __init__(self) -> None:
        super().__init__((0, 0), 0, 0)

    def normals(self, place: int, count: int) -> tuple[Any, ...]:
        return tuple(variables([0.0] * count, place, RANGE))


def noise_of(loop: ClosedLoop, reading: Reading) -> Noise | None:
    """Return the noise that the sensor of a reading states, or None."""
    setup, carry = loop.setup(), loop.carry()
    # A sensor without a valid reading shows no noise: it is tried in other attitudes, and on the other side.
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
