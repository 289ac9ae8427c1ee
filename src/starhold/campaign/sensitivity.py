"""Morris's screening and Sobol's indices measure how much each input changes a metric, in campaigns sampled for them.

Both need special designs, which `sampling` lays out in the unit cube: "morris" changes one input per step (M. D. Morris,
Technometrics 33, 1991; mu* of F. Campolongo et al., Environ. Model. Softw. 22, 2007), "saltelli" has two samples and their
crossings (A. Saltelli et al., Comput. Phys. Commun. 181, 2010), in both directions. A failed run leaves a gap: a Morris
design loses only one trajectory, but Sobol's estimators fail, because a filled-in value would be arbitrary.

Points of one Sobol sequence are far from independent: indices from them are much better than a bootstrap over the points
suggests. Therefore a design consists of `SCRAMBLINGS` independently scrambled sequences, and the changes of the indices when
one of them is left out give the half-widths (the jackknife over groups; A. B. Owen, Monte Carlo theory, 2013, chapter 17).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array: TypeAlias = NDArray[np.float64]
SCRAMBLINGS = 8
"""The number of Sobol sequences in a Saltelli design; one per point where there are fewer points."""
CONFIDENCE = 0.95
"""That of the intervals of all indices."""
NO_SALTELLI = "the runs are not a Saltelli design of two samples and their crossings"
STEP_ERROR = 0.05
"""The share by which a step of a Morris design may differ from the grid's, because ends of the unit interval may be moved
inward."""


@dataclass(frozen=True)
class Refused:
    """The reason why there are no indices."""

    reason: str


@dataclass(frozen=True)
class Morris:
    """Elementary effects of each input, in the metric's unit per range of the input from the lowest to the highest level of
    the design (the quantiles 1/8 and 7/8, see `sampling.LEVELS`): the mean `mu`, the mean magnitude `mu_star` with the
    half-width of its confidence interval, and the standard deviation `sigma`, which is not small compared with mu_star where
    an input acts nonlinearly or together with others. All (inputs,).

    Of the `trajectories` flown, `dropped` had a run without a value."""

    names: tuple[str, ...]
    mu: Array
    mu_star: Array
    mu_star_width: Array
    sigma: Array
    trajectories: int
    dropped: int
    confidence: ClassVar[float] = CONFIDENCE


@dataclass(frozen=True)
class Sobol:
    """The shares of a metric's variance that each input causes alone (`first`) and with all others (`total`), with the
    half-widths of their confidence intervals; all (inputs,)."""

    names: tuple[str, ...]
    first: Array
    first_width: Array
    total: Array
    total_width: Array
    confidence: ClassVar[float] = CONFIDENCE


def morris(names: Sequence[str], unit: Array, values: Array) -> Morris | Refused:
    """Return the elementary effects from points of the unit cube (runs, inputs) and the metric's values (runs,), NaN where a
    run has none; runs in the order of the design."""
    unit, values, size = np.asarray(unit, float), np.asarray(values, float), len(names) + 1
    if not names or unit.shape != (len(values), len(names)) or not len(values) or len(values) % size:
        return Refused(f"{len(values)} runs are not a whole number of trajectories of {size} runs")
    steps = np.diff(unit.reshape(-1, size, len(names)), axis=1)
    step = float(np.abs(steps).max())
    moved = np.abs(steps) > 0.5 * step
    # A step is p / (2 (p - 1)) for a grid of p levels, an even number.
    levels = 2 * round(step / (2.0 * step - 1.0)) if step > 0.5 else 0
    grid = levels / (2.0 * (levels - 1))
    one_each = bool((moved.sum(1) == 1).all() and (moved.sum(2) == 1).all())
    if not (step > 0.5 and one_each and np.abs(np.abs(steps) - grid * moved).max() <= STEP_ERROR * grid):
        return Refused("the runs are not a Morris design, in which each step changes one input and each input changes once")
    there = np.isfinite(values.reshape(-1, size)).all(axis=1)
    flown, kept = there.size, int(there.sum())
    if kept < 2:
        return Refused(f"{kept} of {flown} trajectories have all their values; at least two are needed")
    changes = np.diff(values.reshape(-1, size)[there], axis=1)
    effects = (changes[:, :, None] * (np.sign(steps) * moved)[there]).sum(1) / grid
    magnitudes = np.abs(effects)
    width = special.stdtrit(kept - 1, 0.5 + 0.5 * CONFIDENCE) * magnitudes.std(0, ddof=1) / math.sqrt(kept)
    return Morris(tuple(names), effects.mean(0), magnitudes.mean(0), width, effects.std(0, ddof=1), flown, flown - kept)


def points_of(kind: str, dims: int, generator: np.random.Generator) -> Any:
    """Return SciPy's generator of points (n, dims): "Sobol", which is scrambled, or "LatinHypercube"."""
    from scipy.stats import qmc

    # Newer versions have the keyword `seed` only at run time, and older ones only that.
    return getattr(qmc, kind)(dims, seed=generator)


def saltelli_design(dims: int, size: int, generator: np.random.Generator) -> Array:
    """Return `size` pairs of points, a power of 2, with the crossings of each pair, (size (2 dims + 2), dims)."""
    groups = min(size, SCRAMBLINGS)
    pairs = np.vstack([points_of("Sobol", 2 * dims, generator).random(size // groups) for _ in range(groups)])
    return _cross(pairs[:, None, :dims], pairs[:, None, dims:]).reshape(-1, dims)


def sobol(names: Sequence[str], unit: Array, values: Array) -> Sobol | Refused:
    """Return Sobol's indices from points of `saltelli_design` (runs, inputs) and the metric's values (runs,), NaN where a
    run has none; runs in the order of the design."""
    unit, values, count = np.asarray(unit, float), np.asarray(values, float), len(names)
    if not count or unit.shape != (len(values), count) or not _crossed(unit):
        return Refused(NO_SALTELLI)
    missing = int((~np.isfinite(values)).sum())
    if missing:
        have = "1 run has" if missing == 1 else f"{missing} runs have"
        return Refused(f"{have} no value, and Sobol's estimators need all {len(values)}; Morris designs and drivers do not")
    if np.ptp(values) == 0.0:
        return Refused("all runs have the same value")
    size = len(values) // (2 * count + 2)
    groups = min(size, SCRAMBLINGS)
    if groups < 2:
        return Refused(f"{size} pair of points; at least two are needed")
    blocks = values.reshape(size, -1)
    first, total = _estimates(blocks)
    group_of = np.arange(size) // (size // groups)
    less = np.array([_estimates(blocks[group_of != left]) for left in range(groups)])
    if not np.isfinite(less).all():
        return Refused("too few runs have another value than the rest")
    spread = np.sqrt((groups - 1) * less.var(0))
    width = special.stdtrit(groups - 1, 0.5 + 0.5 * CONFIDENCE) * spread
    return Sobol(tuple(names), first, width[0], total, width[1])


def _estimates(blocks: Array) -> tuple[Array, Array]:
    """Return the first-order and total indices, both (inputs,), from blocks (points, 2 inputs + 2) of values: the means of
    the estimators of Saltelli (2010) and of Jansen (Comput. Phys. Commun. 117, 1999) over both ways to cross two points."""
    count = blocks.shape[1] // 2 - 1
    ends = blocks[:, [0, -1]]
    blocks = blocks - blocks.mean()
    one, other = blocks[:, :1], blocks[:, -1:]
    there, back = blocks[:, 1 : count + 1] - one, blocks[:, count + 1 : -1] - other
    variance = ends.var()
    with np.errstate(invalid="ignore", divide="ignore"):
        first = 0.5 * (other * there + one * back).mean(0) / variance
        return first, 0.25 * (there**2 + back**2).mean(0) / variance


def _crossed(unit: Array) -> bool:
    """Return whether the runs form blocks of: one point, this point with each coordinate in turn from a second point, the
    second point with each coordinate from the first, and the second point."""
    count = unit.shape[1]
    if not len(unit) or len(unit) % (2 * count + 2):
        return False
    blocks = unit.reshape(-1, 2 * count + 2, count)
    return np.array_equal(blocks, _cross(blocks[:, :1], blocks[:, -1:]))


def _cross(one: Array, other: Array) -> Array:
    """Return the blocks (pairs, 2 inputs + 2, inputs) of crossed pairs of points, each (pairs, 1, inputs)."""
    swap = np.eye(one.shape[2], dtype=bool)
    return np.concatenate([one, np.where(swap, other, one), np.where(swap, one, other), other], axis=1)
