"""A column of numbers or words becomes ranks and bins, which is all that tests without assumptions ask of it."""

import numpy as np
from numpy.typing import NDArray

ALMOST = 0.9
"""A bin has at least this part of the share asked for; runs do not divide evenly."""


class Column:
    """An input: the order of its values, and for each value the number of the group of equal values it is in."""

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
        # Half the memory of the usual whole numbers: columns of a million runs are held all at once.
        self.order = np.argsort(self.values).astype(np.int32)
        rising = self.values[self.order]
        self.steps = np.concatenate([[False], rising[1:] != rising[:-1]]).cumsum(dtype=np.int32)
        """Group of each value, in rising order."""

    def ranks(self, there: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the ranks of the runs that are `there`, less their mean; equal values share theirs."""
        rows = self.order[there[self.order]]
        groups = self.steps[there[self.order]]
        sizes = np.bincount(groups)
        ranks = np.empty(len(there))
        ranks[rows] = (sizes.cumsum() - 0.5 * sizes)[groups]
        return ranks[there] - 0.5 * len(rows)

    def grid(self, bins: int, least: float) -> tuple[NDArray[np.int32], list[str]]:
        """Put each run into a bin with about the share `least` of all or more; return numbers of bins and what they hold."""
        ranks = self.ranks(np.ones(len(self.values), bool))
        codes = np.minimum((ranks / len(ranks) + 0.5) * bins, bins - 1).astype(np.int32)
        # Many equal values leave bins uneven: neighbours are joined until each has its share.
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
        """Number the words, those rarer than `least` together as one."""
        shares = np.bincount(self.group) / len(self.group)
        common = np.flatnonzero(shares >= ALMOST * least)
        if len(common) < len(shares) and 1.0 - shares[common].sum() < ALMOST * least:
            common = np.delete(common, np.argmin(shares[common]) if len(common) else [])
        number = np.full(len(shares), len(common), dtype=np.int32)
        number[common] = np.arange(len(common))
        labels = [f"{self.name} is {self.labels[word]}" for word in common]
        return number[self.group], labels if len(common) == len(shares) else [*labels, f"{self.name} is another"]
