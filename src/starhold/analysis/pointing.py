"""Pointing errors over windows of time, by the indices of ECSS-E-ST-60-10C (2008, control performance).

Errors are rotation vectors (rad, body axes), small enough to add: arrays (runs, instants, 3).
"""

import math
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Interpretation: TypeAlias = Literal["mixed", "temporal", "ensemble"]

PERFORMANCE = {
    "APE": "absolute error: at an instant",
    "MPE": "mean error: over a window",
    "RPE": "relative error: at an instant, less the mean over its window",
    "PDE": "drift error: between the means over two windows",
}
KNOWLEDGE = {"AKE": "APE", "MKE": "MPE", "RKE": "RPE", "KDE": "PDE"}
"""Knowledge error indices, each with the performance error index that is computed in the same way."""
MEANINGS = PERFORMANCE | {
    name: PERFORMANCE[like].replace(" error", " error of the estimate") for name, like in KNOWLEDGE.items()
}
ANGLE, LINE = "angle", "line of sight"
OVERLAP, MOST = 4, 2**22
"""Windows of relative errors begin at each instant or, if that gives more than MOST errors, as often as possible, but at
least OVERLAP times per window."""


class Figures(NamedTuple):
    """The figures of an index about an axis: the level that the share `confidence` of the errors does not exceed (rad), the
    mean of the index, signed if it has a sign, and its standard deviation (rad). None if unknown for combined errors."""

    level: float
    mean: float | None
    deviation: float


def indices(errors: Array, length: int, apart: int) -> dict[str, Array]:
    """Return the vectors of each index of PERFORMANCE, (runs, number, 3). errors: (runs, instants, 3); length: instants of
    a window; apart: instants between the starts of the two windows of drift. Raise ValueError if they do not fit."""
    instants = errors.shape[1]
    if min(length, apart) < 1 or length + apart > instants:
        raise ValueError(f"windows of {length} instants, {apart} apart, among {instants}")
    sums = np.cumsum(errors, axis=1)
    sums = np.concatenate([np.zeros_like(sums[:, :1]), sums], axis=1)
    means = (sums[:, length:] - sums[:, :-length]) / length
    starts = np.unique(np.append(np.arange(0, means.shape[1], spacing(len(errors), instants, length)), means.shape[1] - 1))
    windows = sliding_window_view(errors, length, axis=1)[:, starts]
    relative = np.moveaxis(windows - means[:, starts, :, None], -1, 2)
    return {
        "APE": errors,
        "MPE": means,
        "RPE": relative.reshape(len(errors), -1, 3),
        "PDE": means[:, apart:] - means[:, :-apart],
    }


def spacing(runs: int, instants: int, length: int) -> int:
    """Return the number of instants between the starts of the windows of relative errors."""
    wanted = -(-runs * (instants - length + 1) * length // MOST)
    return min(wanted, max(1, length // OVERLAP))


def shortfall(apart: int, length: int) -> float:
    """Return a bound on the share by which the largest relative error is underestimated if windows begin `apart` instants
    apart. Any window and the nearest one used that contains the same instant differ by k < apart instants at either end.
    With M the largest relative error of all windows, their means differ by at most 2 k M / (length - k)."""
    return min(1.0, 2.0 * (apart - 1) / (length - apart + 1))


def about_axes(vectors: Array, boresight: Any = None) -> dict[str, Array]:
    """Return the signed errors (runs, number) about each body axis, and the rotation angle; with a boresight (any length,
    body axes) also its tilt, the angle between its true and its wanted direction."""
    components = {axis: vectors[..., place] for place, axis in enumerate("xyz")}
    components[ANGLE] = np.linalg.norm(vectors, axis=-1)
    if boresight is not None:
        components[LINE] = np.linalg.norm(np.cross(vectors, np.asarray(boresight) / math.hypot(*boresight)), axis=-1)
    return components


def level(values: Array, confidence: float, interpretation: Interpretation) -> float:
    """Return the least bound that the share `confidence` of errors (runs, number) keeps. mixed: of all errors; temporal: of
    the errors of each run, the largest over the runs; ensemble: of the runs, each represented by its largest error."""
    sizes = np.abs(values)
    if interpretation == "mixed":
        return float(np.quantile(sizes, confidence, method="inverted_cdf"))
    if interpretation == "temporal":
        return float(np.quantile(sizes, confidence, axis=1, method="inverted_cdf").max())
    return float(np.quantile(sizes.max(axis=1), confidence, method="inverted_cdf"))


def figures(values: Array, confidence: float, interpretation: Interpretation) -> Figures:
    """Return the figures of errors (runs, number)."""
    return Figures(level(values, confidence, interpretation), float(values.mean()), float(values.std()))


def root_sum_square(sources: list[Figures]) -> Figures:
    """Return the figures of the sum of independent errors: levels and standard deviations as root sum squares."""
    return Figures(math.hypot(*(one.level for one in sources)), None, math.hypot(*(one.deviation for one in sources)))
