"""Gain, phase and delay margins of a linear loop about each body axis, from its sampled frequency response."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from starhold.analysis.linear import AXES, Linear

POINTS = 600
"""The number of frequencies of a response."""
BELOW = 1e-2
"""The lowest frequency, as a fraction of that of the slowest closed-loop pole."""


UNITS = {"gain": "1", "less": "1", "phase": "rad", "delay": "s", "crossover": "rad/s", "sensitivity": "1"}


class Margins(NamedTuple):
    """The margins of the loop about one axis, with the others closed. gain: the least factor above 1 on the command that
    loses stability (inf for none); less: the largest factor below 1 that does (0 for none); phase (rad) and delay (s): the
    least additional lag that does (inf for none); crossover: the highest frequency (rad/s) at which the loop gain is 1, its
    bandwidth (NaN for none); sensitivity: the peak of |1/(1 + L)|, whose inverse is the least distance of L from -1. All
    except the crossover are NaN if the loop is not stable."""

    axis: str
    gain: float
    less: float
    phase: float
    delay: float
    crossover: float
    sensitivity: float

    @property
    def units(self) -> dict[str, str]:
        """The units of the numbers, "1" for none."""
        return UNITS


class Response(NamedTuple):
    """The loop opened about each axis: frequencies (n,) in rad/s, up to half the sampling frequency, and L (3, n)."""

    frequencies: NDArray[np.float64]
    loops: NDArray[np.complex128]


def response(linear: Linear) -> Response:
    """Return the frequency response of the loop opened about one axis, with the others closed."""
    # A pole z is exp(s period); some poles of a loop with delay are zero.
    turns = [abs(np.log(pole)) / linear.period for pole in linear.poles.astype(complex) if abs(pole) > 1e-9]
    highest = math.pi / linear.period
    slowest = min((turn for turn in turns if turn > 0.0), default=highest)
    frequencies = np.geomspace(BELOW * min(slowest, highest), highest, POINTS)
    return Response(frequencies, _cut(linear, frequencies, range(3)))


def _cut(linear: Linear, frequencies: Any, axes: Iterable[int]) -> NDArray[np.complex128]:
    """Return L (axes, n) about some of the axes."""
    whole = linear.stepped_loop.at(np.exp(1j * np.asarray(frequencies) * linear.period))
    cut: list[Any] = []
    for i in axes:
        others = [k for k in range(3) if k != i]
        across = whole[:, others, i]
        if across.any() and whole[:, i, others].any():
            inner = np.eye(2) + whole[:, others][:, :, others]
            across = np.linalg.solve(inner, across[:, :, None])[:, :, 0]
        cut.append(whole[:, i, i] - np.sum(whole[:, i, others] * across, axis=1))
    return np.array(cut)


def margins(linear: Linear, shown: Response | None = None) -> list[Margins]:
    """Return the margins about the three body axes; shown: the response, if it is already known."""
    measured = response(linear) if shown is None else shown
    return [_about(linear, k, measured) for k in range(3)]


def _about(linear: Linear, k: int, measured: Response) -> Margins:
    w, L = measured.frequencies, measured.loops[k]

    def along(frequencies: Any) -> Any:
        return _cut(linear, frequencies, [k])[0]

    def at(frequency: float) -> complex:
        return complex(along([frequency])[0])

    crossings = _roots(w, _log_size(L), lambda f: _log_size(along(f)))
    crossover = max(crossings, default=math.nan)
    if not linear.is_stable:
        return Margins(AXES[k], math.nan, math.nan, math.nan, math.nan, crossover, math.nan)
    # Frequencies at which L is real and negative; at half the sampling frequency it is always real.
    reals = [at(f) for f in _roots(w, L.imag, lambda f: along(f).imag)] + [complex(L[-1])]
    gains = [-1.0 / value.real for value in reals if value.real < 0.0]
    lags = [((math.pi + np.angle(at(f))) % (2.0 * math.pi), f) for f in crossings]
    return Margins(
        AXES[k],
        min((g for g in gains if g > 1.0), default=math.inf),
        max((g for g in gains if g < 1.0), default=0.0),
        float(min((lag for lag, _ in lags), default=math.inf)),
        float(min((lag / f for lag, f in lags), default=math.inf)),
        crossover,
        float(np.max(1.0 / np.abs(1.0 + L))),
    )


def _log_size(values: Any) -> Any:
    """Return the logarithm of the modulus of numbers, which may be 0, because a law need not act about every axis."""
    return np.log(np.maximum(np.abs(values), np.finfo(float).tiny))


def _roots(w: Any, values: Any, function: Callable[[Any], Any]) -> list[float]:
    """Return the frequencies between neighbours in w at which a vectorised function changes sign, except at jumps, as
    across an undamped resonance."""
    roots: list[float] = []
    for p in np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0)):
        low, high = w[p], w[p + 1]
        while high - low > 1e-12 * high:
            # Evaluating many frequencies is as fast as one.
            inner = np.linspace(low, high, 65)
            place = int(np.argmax((function(inner[1:]) < 0.0) != (values[p] < 0.0)))
            low, high = inner[place : place + 2]
        root = float(0.5 * (low + high))
        if abs(float(function([root])[0])) <= max(abs(values[p]), abs(values[p + 1])):
            roots.append(root)
    return roots
