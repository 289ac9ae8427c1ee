"""Identifies the inputs that, alone or in pairs, make runs fail or drive their metrics; lost runs count as failed.

Every test uses only ranks or counts, so nothing is assumed about distributions, and a run without a metric is left out of
the tests of that metric:

* an input and a metric: Spearman's rank correlation; of a choice between words the correlation ratio of the ranks
  (Kruskal and Wallis, 1952), which for two words is the same up to its sign;
* an input and failure: the difference between failed and passed runs in this input, by the Kolmogorov-Smirnov distance and
  by the Mann-Whitney statistic as the probability that a failed run has the greater value (the area under the ROC curve);
  for a choice between words the total variation distance, with the likelihood ratio (G) test;
* two inputs and failure: whether they fail a run *together*, beyond the effect of each alone. Runs survive two independent
  causes independently, so the probability of passing is a product, 1 - p(x, y) = A(x) B(y) (the noisy-or of J. Pearl,
  "Probabilistic reasoning in intelligent systems", 1988; for rare failures the additive risks of K. J. Rothman, Am. J.
  Epidemiol. 99, 1974). The product is fitted to the failures on a grid of quantile bins by maximum likelihood, and the
  likelihood ratio against a probability for each cell measures the misfit. A single cause, or two independent ones, fit
  exactly, whatever their shape; failure only where both are high, or only where just one is, does not.

All p-values are corrected together (S. Holm, Scand. J. Statist. 6, 1979): for inputs that are drawn independently, the
probability that any of the tests wrongly finds a significant dependence is at most `RISK`. Where two inputs are drawn
together, each shows the effects of the other; such pairs are marked.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import special

ALMOST = 0.9
"""The least content of a bin as a part of the requested share, because runs do not divide evenly."""


class Column:
    """An input: the order of its values, and for each value the index of its group of ties."""

    def __init__(self, name: str, values: NDArray) -> None:
        self.name, self.words = name, values.dtype.kind not in "fiub"
        if self.words:
            self.labels, self.group = np.unique(values.astype(str), return_inverse=True)
            self.values, self.empty = values, len(self.labels) < 2
            return
        self.values = np.asarray(values, dtype=np.float64)
        self.empty = bool(np.isnan(self.values).any() or not len(values) or self.values.min() == self.values.max())
        if self.empty:
            return
        # Half the memory of the usual integers: columns of a million runs are in memory at once.
        self.order = np.argsort(self.values).astype(np.int32)
        rising = self.values[self.order]
        self.steps = np.concatenate([[False], rising[1:] != rising[:-1]]).cumsum(dtype=np.int32)
        """The group of ties of each value, in increasing order of values."""

    def ranks(self, there: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the ranks of the runs in the mask `there`, minus their mean; tied values share a rank."""
        rows = self.order[there[self.order]]
        groups = self.steps[there[self.order]]
        sizes = np.bincount(groups)
        ranks = np.empty(len(there))
        ranks[rows] = (sizes.cumsum() - 0.5 * sizes)[groups]
        return ranks[there] - 0.5 * len(rows)

    def grid(self, bins: int, least: float) -> tuple[NDArray[np.int32], list[str]]:
        """Return the index of each run's bin, and descriptions of the bins; each holds about the share `least` or more."""
        ranks = self.ranks(np.ones(len(self.values), bool))
        codes = np.minimum((ranks / len(ranks) + 0.5) * bins, bins - 1).astype(np.int32)
        # Ties leave bins uneven: neighbouring bins are joined until each has its share.
        joined, filled, shares = [], 0.0, np.bincount(codes, minlength=bins) / len(codes)
        for share in shares:
            joined.append(joined[-1] + (filled >= ALMOST * least) if joined else 0)
            filled = share if filled >= ALMOST * least else filled + share
        codes = np.array(joined, dtype=np.int32)[codes]
        if filled < ALMOST * least:
            codes = np.minimum(codes, max(0, joined[-1] - 1))
        last = int(codes.max())
        ends = [(self.values[codes == code].min(), self.values[codes == code].max()) for code in range(last + 1)]
        labels = [f"{self.name} is from {low:.4g} to {high:.4g}" for low, high in ends]
        labels[0], labels[last] = f"{self.name} is at most {ends[0][1]:.4g}", f"{self.name} is at least {ends[last][0]:.4g}"
        return codes, labels

    def words_grid(self, least: float) -> tuple[NDArray[np.int32], list[str]]:
        """Return the index of each run's word, and the words; those rarer than `least` are counted as one."""
        shares = np.bincount(self.group) / len(self.group)
        common = np.flatnonzero(shares >= ALMOST * least)
        if len(common) < len(shares) and 1.0 - shares[common].sum() < ALMOST * least:
            common = np.delete(common, np.argmin(shares[common]) if len(common) else [])
        number = np.full(len(shares), len(common), dtype=np.int32)
        number[common] = np.arange(len(common))
        labels = [f"{self.name} is {self.labels[word]}" for word in common]
        return number[self.group], labels if len(common) == len(shares) else [*labels, f"{self.name} is another"]


Array: TypeAlias = NDArray[np.float64]
RISK = 0.05
LEAST = 5
"""The least number of failed and of passed runs for a statement about failure; also the least expected number of failures
in a cell of a pair's grid."""
BINS = 4
"""The most bins of a numerical input in a pair's grid."""
RAREST = 0.05
"""Values of a choice rarer than this share are counted together in a pair's grid."""
TOGETHER = 1e-3
"""Two inputs count as drawn together if the corrected p-value of their cells' counts is below this."""
FEWEST_RUNS = 10
"""The least number of runs with a metric for a statement about it."""
ROUNDS = 300
"""The number of iterations of the fit of independent causes; each increases the likelihood, and stopping early overstates a
pair only slightly."""


@dataclass(frozen=True)
class _Driver:
    """A tested dependence: `p` is its p-value alone, `corrected` its p-value among all tests."""

    p: float
    corrected: float

    @property
    def significant(self) -> bool:
        """Whether chance is ruled out as an explanation, given the number of tests."""
        return self.corrected <= RISK


@dataclass(frozen=True)
class MetricDriver(_Driver):
    """The strength with which an input drives a metric over the `runs` that have it: rank correlation, or for a choice of
    words the correlation ratio."""

    input: str
    metric: str
    correlation: float
    runs: int
    words: bool


@dataclass(frozen=True)
class FailureDriver(_Driver):
    """The difference between failed and passed runs in an input: `distance` between the distributions, from 0 to 1, and
    `above`, the probability that a failed run has the greater value, ties split evenly (None for words). `range` (low, high)
    contains nine in ten failed runs; for words it names those with which runs fail most often. `p`: numbers are tested
    twice, so it is twice the smaller of the two p-values (Bonferroni)."""

    input: str
    distance: float
    above: float | None
    range: tuple[float, float] | str


@dataclass(frozen=True)
class PairDriver(_Driver):
    """The joint effect of two inputs on failure: twice the logarithm of the likelihood ratio against independent causes,
    which by chance is chi-square with `degrees` of freedom; in the cell `where` of their grid the share `failed` of the runs
    fails. `drawn_together`: whether the draws of the two are dependent, so that one may stand for the other."""

    inputs: tuple[str, str]
    statistic: float
    degrees: int
    where: str
    failed: float
    drawn_together: bool


@dataclass(frozen=True)
class Drivers:
    """Drivers of failures and metrics, strongest first in each list, including all that were tested. `skipped` names inputs
    that are constant or lack values, `remark` the tests left out because of too few runs."""

    runs: int
    failures: int
    inputs: tuple[FailureDriver, ...]
    pairs: tuple[PairDriver, ...]
    metrics: tuple[MetricDriver, ...]
    skipped: tuple[str, ...]
    remark: str


def find_drivers(inputs: Mapping[str, NDArray], failed: NDArray[np.bool_], metrics: Mapping[str, NDArray]) -> Drivers:
    """Return the drivers of failures and metrics. inputs: columns (n,) with a number or a word per run, one column for each
    component of a vector; failed: a mask (n,); metrics: columns (n,), NaN where a run does not have the metric."""
    failed = np.asarray(failed, dtype=bool)
    failures, passed = int(failed.sum()), int((~failed).sum())
    columns = {name: Column(name, np.asarray(values)) for name, values in inputs.items()}
    skipped = tuple(name for name, column in columns.items() if column.empty)
    used = [column for column in columns.values() if not column.empty]
    fewer = min(failures, passed)
    singles = [_between(column, failed) for column in used] if fewer >= LEAST else []
    bins = min(BINS, math.isqrt(fewer // LEAST))
    pairs = _pairs(used, failed, bins) if bins > 1 else []
    moved = _moved(used, metrics)
    corrected = iter(_holm(np.array([driver.p for driver in (*singles, *pairs, *moved)])).tolist())
    singles = [replace(driver, corrected=next(corrected)) for driver in singles]
    pairs = [replace(driver, corrected=next(corrected)) for driver in pairs]
    moved = [replace(driver, corrected=next(corrected)) for driver in moved]
    return Drivers(
        runs=len(failed),
        failures=failures,
        inputs=tuple(sorted(singles, key=lambda driver: (not driver.significant, -driver.distance))),
        pairs=tuple(sorted(pairs, key=lambda driver: (not driver.significant, driver.drawn_together, -driver.statistic))),
        metrics=tuple(sorted(moved, key=lambda driver: (not driver.significant, -abs(driver.correlation)))),
        skipped=skipped,
        remark=_remark(failures, passed, bins),
    )


def _between(column: Column, failed: NDArray[np.bool_]) -> FailureDriver:
    """Compare failed with passed runs in a column, by two tests, for words by one; the p-value is not yet corrected."""
    total, bad = len(failed), int(failed.sum())
    good = total - bad
    if column.words:
        codes, labels = column.words_grid(LEAST / min(bad, good))
        table = np.stack([np.bincount(codes[rows], minlength=len(labels)) for rows in (failed, ~failed)])
        expected = table.sum(1, keepdims=True) * table.sum(0) / total
        p = float(special.chdtrc(max(1, len(labels) - 1), _misfit(table, expected, (0, 1))))
        gap = 0.5 * float(np.abs(table[0] / bad - table[1] / good).sum())
        return FailureDriver(p, p, column.name, gap, None, labels[np.argmax(table[0] / table.sum(0))])
    last = np.append(np.flatnonzero(np.diff(column.steps)), total - 1)
    low = failed[column.order].cumsum()[last]
    distance = float(np.abs(low / bad - (last + 1 - low) / good).max())
    ranks = column.ranks(np.ones(total, bool))
    above = 0.5 + float(ranks[failed].sum()) / (bad * good)
    # The variance of the mean of `bad` ranks drawn out of all: equal values lessen that of the ranks themselves.
    spread = math.sqrt(_product(ranks, ranks) / (total - 1) / (bad * good * total))
    by_distance = float(special.kolmogorov(distance * math.sqrt(bad * good / total)))
    by_order = float(2.0 * special.ndtr(-abs(above - 0.5) / spread))
    # Either test may have succeeded by chance.
    p = min(1.0, 2.0 * by_distance, 2.0 * by_order)
    low_end, high_end = np.quantile(column.values[failed], (0.05, 0.95))
    return FailureDriver(p, p, column.name, distance, above, (float(low_end), float(high_end)))


def _pairs(used: list[Column], failed: NDArray[np.bool_], bins: int) -> list[PairDriver]:
    """Return each pair of inputs tested for joint failures; p-values are not yet corrected."""
    least = max(RAREST, LEAST / min(failed.sum(), (~failed).sum()))
    grids = [(column.name, *(column.words_grid(least) if column.words else column.grid(bins, least))) for column in used]
    grids = [grid for grid in grids if len(grid[2]) > 1]
    pairs = list(combinations(range(len(grids)), 2))
    if not pairs:
        return []
    runs, failures = _tables([(codes, len(labels)) for _, codes, labels in grids], failed, pairs)
    fitted = independent_causes(failures, runs)
    statistics = _misfit(np.stack([failures, runs - failures]), np.stack([runs * fitted, runs * (1.0 - fitted)]), (0, 2, 3))
    expected = runs.sum(2, keepdims=True) * runs.sum(1, keepdims=True) / len(failed)
    entangled = _misfit(runs, expected, (1, 2))
    with np.errstate(invalid="ignore"):
        shares = failures / runs
    excess = np.where(runs >= LEAST, shares - fitted, -1.0).reshape(len(pairs), -1).argmax(1)
    drivers = []
    for at, (i, j) in enumerate(pairs):
        (first, _, rows), (second, _, columns) = grids[i], grids[j]
        free = (len(rows) - 1) * (len(columns) - 1)
        empty = int((runs[at, : len(rows), : len(columns)] == 0).sum())
        row, column = divmod(int(excess[at]), runs.shape[2])
        degrees = max(1, free - empty)
        p = float(special.chdtrc(degrees, statistics[at]))
        drivers.append(
            PairDriver(
                inputs=(first, second),
                statistic=float(statistics[at]),
                degrees=degrees,
                where=f"{rows[row]} and {columns[column]}",
                failed=float(shares[at, row, column]),
                drawn_together=bool(special.chdtrc(free, entangled[at]) < TOGETHER / len(pairs)),
                p=p,
                corrected=p,
            )
        )
    return drivers


def _misfit(counts: NDArray, expected: Array, axes: tuple[int, ...]) -> Array:
    """Return the deviation of counts from the expected ones, chi-square distributed by chance: the smaller of the likelihood
    ratio and Pearson's statistic. They agree for many runs; for few, either may exaggerate."""
    ratio = 2.0 * special.rel_entr(counts, expected).sum(axes)
    deviation = np.divide((counts - expected) ** 2, expected, out=np.zeros_like(expected), where=expected > 0.0)
    return np.minimum(ratio, deviation.sum(axes))


def _tables(
    grids: list[tuple[NDArray[np.int32], int]], failed: NDArray[np.bool_], pairs: list[tuple[int, int]]
) -> tuple[Array, Array]:
    """Return the counts of runs and of failed runs in the cells of each pair's grid, both (pairs, bins, bins), padded with
    zeros."""
    widest = max(size for _, size in grids)
    rows = [codes * np.int32(2 * widest) for codes, _ in grids]
    columns = [codes * np.int32(2) + failed for codes, _ in grids]
    counts = [np.bincount(rows[i] + columns[j], minlength=2 * widest**2) for i, j in pairs]
    tables = np.array(counts, dtype=np.float64).reshape(len(pairs), widest, widest, 2)
    return tables.sum(3), tables[..., 1]


def independent_causes(failures: Array, runs: Array) -> Array:
    """Fit the failure probability 1 - (1 - a_i)(1 - b_j), by maximum likelihood, to counts on grids (grids, rows, columns).

    Returns the probabilities in the same shape. The method is expectation-maximization: each failure is attributed to the
    causes in proportion to their probabilities, and each probability becomes the share of runs attributed to it. Every
    iteration increases the likelihood."""
    rows, columns = (runs.sum(axis, keepdims=True).clip(1.0) for axis in (2, 1))
    a = 0.5 * failures.sum(2, keepdims=True) / rows
    b = 0.5 * failures.sum(1, keepdims=True) / columns
    fail = a + b - a * b
    for _ in range(ROUNDS):
        weight = np.divide(failures, fail, out=np.zeros_like(failures), where=fail > 0.0)
        a, b = a * weight.sum(2, keepdims=True) / rows, b * weight.sum(1, keepdims=True) / columns
        fail = a + b - a * b
    return fail


def _moved(used: list[Column], metrics: Mapping[str, NDArray]) -> list[MetricDriver]:
    """Return the correlation of each input with each metric; p-values are not yet corrected."""
    groups: dict[bytes, list[tuple[str, Array]]] = {}
    for name, values in metrics.items():
        values = np.asarray(values, dtype=np.float64)
        there = ~np.isnan(values)
        metric = Column(name, values[there])
        if there.sum() >= FEWEST_RUNS and not metric.empty:
            # Runs that lack one metric mostly lack others too, so inputs are ranked once for all of these.
            groups.setdefault(there.tobytes(), []).append((name, metric.ranks(np.ones(len(metric.values), bool))))
    drivers = []
    for mask, ranked in groups.items():
        there = np.frombuffer(mask, dtype=bool)
        for column in used:
            correlate = _word_correlation(column.group[there]) if column.words else _rank_correlation(column.ranks(there))
            if correlate is None:
                continue
            for name, ranks in ranked:
                strength, p = correlate(ranks)
                drivers.append(MetricDriver(p, p, column.name, name, strength, len(ranks), column.words))
    return drivers


Correlate: TypeAlias = Callable[[Array], tuple[float, float]]
"""Returns the strength of a dependence and its p-value for the ranks (n,) of a metric, minus their mean."""


def _rank_correlation(values: Array) -> Correlate | None:
    """Return the function for Spearman's correlation with an input's ranks (n,); None where these are all equal."""
    n, norm = len(values), _product(values, values)

    def correlate(ranks: Array) -> tuple[float, float]:
        strength = max(-1.0, min(1.0, _product(values, ranks) / math.sqrt(norm * _product(ranks, ranks))))
        return strength, float(special.betainc(0.5 * n - 1.0, 0.5, 1.0 - strength**2))

    return correlate if norm > 0.0 else None


def _word_correlation(group: NDArray[np.intp]) -> Correlate | None:
    """Return the function for the correlation ratio with an input's words, given by index (n,); None for a single word."""
    n, sizes = len(group), np.bincount(group)
    kinds = int((sizes > 0).sum())

    def correlate(ranks: Array) -> tuple[float, float]:
        between = float((np.bincount(group, ranks) ** 2 / sizes.clip(1)).sum()) / _product(ranks, ranks)
        return math.sqrt(between), float(special.chdtrc(kinds - 1, (n - 1) * between))

    return correlate if kinds > 1 else None


def _product(one: Array, other: Array) -> float:
    """Return the inner product, without BLAS, which would start threads and sum in an order that depends on their number."""
    return float(np.einsum("i,i", one, other))


def _holm(chances: Array) -> Array:
    """Return p-values corrected for their number, so that each bounds the risk that any test gives one as small by
    chance."""
    order = np.argsort(chances, kind="stable")
    corrected = np.empty(len(chances))
    corrected[order] = np.maximum.accumulate(np.minimum(1.0, chances[order] * np.arange(len(chances), 0, -1)))
    return corrected


def _remark(failures: int, passed: int, bins: int) -> str:
    """Return a sentence about the tests left out because of too few runs, or ""."""
    if failures < LEAST:
        return f"too few failures to find their drivers: {failures}; at least {LEAST} are needed"
    if passed < LEAST:
        return f"too few passed runs to compare failed ones with: {passed}; at least {LEAST} are needed"
    if bins < 2:
        fewer = "failures" if failures < passed else "passed runs"
        return f"too few {fewer} to test pairs of inputs: {min(failures, passed)}; at least {4 * LEAST} are needed"
    return ""
