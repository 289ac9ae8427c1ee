"""The covariance of a fit's free numbers, and the names of the combinations on which no reading depends."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, stats

from starhold.scenario.checking import read_toml
from starhold.scenario.reading import Scenario
from starhold.studies.fitting import Array, Free

UNDETERMINED = 1e-8
"""A combination of free numbers, each scaled by its influence on readings, counts as undetermined if its singular value is
below this share of the largest."""
SHARE = 1e-4
"""Numbers with a smaller share in such a combination are not named."""
ALIKE = 1e-4
"""Vectors count as proportional if the squared sine of the angle between them is below this."""
SIZELESS = 1e4
"""The factor on the uncertainty that readings alone would leave, which gives the scale of a key without a size."""
LEVEL = 0.95
WIDTH = float(stats.norm.ppf(0.5 + 0.5 * LEVEL))
"""The half-width of the confidence interval at `LEVEL`, in standard deviations."""


class Posterior(NamedTuple):
    """The covariance of the free numbers, infinite on the diagonal for undetermined ones; undetermined: directions (m, free)
    along which readings do not change, and sentences that name them; rank: the number of determined combinations, including
    the start's; singular: the singular values of the weighted Jacobian with columns of unit length."""

    covariance: Array
    undetermined: Array
    sentences: tuple[str, ...]
    rank: int
    singular: Array

    def barely(self, free: Free) -> Any:
        """Return a mask of the numbers whose uncertainty is not smaller than the size of their key."""
        return self.is_determined & (free.sizes > 0.0) & (WIDTH * self.deviations > free.sizes)

    @property
    def deviations(self) -> Array:
        """The standard deviations (free,) of the free numbers."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def is_determined(self) -> Any:
        """A mask (free,) of the determined numbers."""
        return np.isfinite(np.diagonal(self.covariance))

    @property
    def correlations(self) -> Array:
        """The correlations (free, free) of the free numbers, NaN for undetermined ones."""
        sizes = np.where(self.is_determined, self.deviations, np.nan)
        return self.covariance / np.outer(sizes, sizes)

    def over(self, scenario: Scenario, free: Free, values: Array) -> Scenario:
        """Return the scenario with a campaign that draws the determined numbers jointly, except whole matrices, which are
        drawn separately."""

        tables = dict[str, Any](read_toml(scenario.text, scenario.where).get("campaign", {}))
        dropped = {place.key for place in free.places}
        over = {
            keys: table
            for keys, table in tables.get("over", {}).items()
            if not any(key.strip().partition("[")[0] in {k.partition("[")[0] for k in dropped} for key in keys.split(","))
        }
        matrix = [any(len(p.shape) == 2 and name.startswith(p.key) for p in free.places) for name in free.names]
        groups = [
            [k for k, name in enumerate(free.names) if name.startswith(p.key)] for p in free.places if len(p.shape) == 2
        ]
        fit = self.is_determined & ~self.barely(free)
        groups.append([k for k, whole in enumerate(matrix) if not whole and fit[k]])
        for group in groups:
            if group and fit[group].all():
                names = [free.names[k] for k in group]
                key = names[0].partition("[")[0] if matrix[group[0]] else ", ".join(names)
                over[key] = _table(self.covariance[np.ix_(group, group)])
        return scenario.with_({"campaign": tables | {"over": over}}) if over else scenario


def _table(covariance: Array) -> dict[str, Any]:
    """Return the table of a joint normal distribution about the file's values."""
    if len(covariance) == 1:
        return {"distribution": "normal", "sigma": float(np.sqrt(covariance[0, 0]))}
    return {"distribution": "correlated-normal", "covariance": (0.5 * (covariance + covariance.T)).tolist()}


def posterior_of(slopes: Array, free: Free, values: Array) -> Posterior:
    """Return the posterior from residuals of unit variance with slopes (n, start + free); the start is estimated too."""
    # Reduced to as many rows as there are numbers, with the same sum of squares.
    few: Any = np.linalg.qr(slopes, mode="r")
    slopes = few
    lengths = np.linalg.norm(slopes, axis=0)
    lengths[lengths == 0.0] = 1.0
    first = slopes.shape[1] - len(free.names)
    _, singular, axes = linalg.svd(slopes / lengths, full_matrices=False)
    kept = singular > UNDETERMINED * singular[0]
    parts = (axes[kept] / singular[kept, None])[:, first:] / lengths[first:]
    covariance = parts.T @ parts
    # Keys without a size are determined unless they have the same effect as another.
    sizes = np.where(free.sizes > 0.0, free.sizes, SIZELESS / lengths[first:])
    _, among, combined = linalg.svd(axes[~kept][:, first:], full_matrices=False)
    undetermined = _reduced(combined[among > SHARE] / lengths[first:] / sizes)
    for k in np.flatnonzero((np.abs(undetermined) > SHARE).any(axis=0)):
        covariance[k, k] = np.inf
    # The slopes of the free numbers after projecting out those of the start.
    few = np.linalg.qr(slopes / np.append(lengths[:first], 1.0 / sizes), mode="r")
    _, known, axes = np.linalg.svd(few[first:, first:])
    hardly = _reduced(axes[: len(axes) - len(undetermined)][known[: len(axes) - len(undetermined)] < WIDTH])
    sentences = [_sentence(row, free, values / sizes, "do not determine") for row in undetermined]
    sentences += [_sentence(row, free, values / sizes, "barely constrain") for row in hardly]
    return Posterior(covariance, undetermined * sizes, tuple(sentences), int(kept.sum()), singular)


def _reduced(rows: Array) -> Array:
    """Return a basis of the row space, reduced so that the pivot of each row, as large as possible, is zero in the
    others."""
    if not len(rows):
        return rows
    basis = linalg.orth(rows.T).T
    order: Any = linalg.qr(basis, pivoting=True)
    pivots = order[2][: len(basis)]
    return linalg.solve(basis[:, pivots], basis)


def _sentence(row: Array, free: Free, values: Array, verb: str) -> str:
    """Return a sentence that names a combination on which readings do not depend, or only within their noise; row, values:
    in units of the numbers' sizes."""
    named = np.flatnonzero(np.abs(row) > SHARE * np.abs(row).max())
    names, shares, known = [free.names[k] for k in named], row[named], values[named]
    why = "no reading depends on it" if verb == "do not determine" else "its standard deviation exceeds its size"
    if len(names) == 1:
        return f"These data {verb} {names[0]}: {why}."
    cosine = abs(shares @ known) / max(1e-300, float(np.linalg.norm(shares) * np.linalg.norm(known)))
    keys = ", ".join(dict.fromkeys(name.partition("[")[0] for name in names))
    if 1.0 - cosine * cosine < ALIKE and free.values[named].all():
        scale = "common scale" if "," in keys else "scale"
        return f"These data {verb} the {scale} of {keys}, only ratios: {why}."
    text = " : ".join(f"{x:.3g}" for x in shares / np.abs(shares).max())
    return f"These data {verb} {', '.join(names)} apart, which may change as {text} in their sizes: {why}."
