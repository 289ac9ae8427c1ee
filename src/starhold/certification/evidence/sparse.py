"""Sparse matrices in the form of an interior point. Loading `scipy.sparse` takes longer than finding most proofs, so only
the multiplication of matrices loads it."""

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Compressed(NamedTuple):
    """A matrix in compressed columns, rows sorted, with the fields of a `scipy.sparse.csc_matrix` that Clarabel reads."""

    data: NDArray[np.float64]
    indices: NDArray[np.int64]
    indptr: NDArray[np.int64]
    shape: tuple[int, int]
    has_canonical_format: bool = True

    def key(self) -> tuple[Any, ...]:
        """Return a key that two matrices share only if they are equal."""
        return self.data.tobytes(), self.indices.tobytes(), self.indptr.tobytes(), self.shape


class Entries(NamedTuple):
    """A matrix by the rows, columns and values of its entries, without duplicates."""

    rows: Sequence[int] | NDArray[np.integer]
    columns: Sequence[int] | NDArray[np.integer]
    values: Sequence[float] | NDArray[np.float64]
    shape: tuple[int, int]

    def compressed(self) -> Compressed:
        """Return the matrix as an interior point takes it."""
        rows, columns = np.asarray(self.rows, dtype=np.int64), np.asarray(self.columns, dtype=np.int64)
        order = np.lexsort((rows, columns))
        ends = np.searchsorted(columns[order], np.arange(self.shape[1] + 1))
        return Compressed(np.asarray(self.values, dtype=float)[order], rows[order], ends, self.shape)

    def above(self, below: "Entries") -> "Entries":
        """Return the matrix with another one stacked below it."""
        rows = np.concatenate(
            [np.asarray(self.rows, dtype=np.int64), np.asarray(below.rows, dtype=np.int64) + self.shape[0]]
        )
        columns, values = (np.concatenate([one, two]) for one, two in zip(self[1:3], below[1:3], strict=True))
        return Entries(rows, columns, values, (self.shape[0] + below.shape[0], self.shape[1]))

    def dense(self) -> NDArray[np.float64]:
        """Return the whole matrix."""
        whole = np.zeros(self.shape)
        whole[self.rows, self.columns] = self.values
        return whole

    def scipy(self) -> Any:
        """Return the matrix as a `scipy.sparse.csc_matrix`."""
        matrix: Any = import_module("scipy.sparse").csc_matrix
        return matrix((self.values, (self.rows, self.columns)), self.shape)


def entries_of(matrix: NDArray[np.float64]) -> Entries:
    """Return the nonzero entries of a dense matrix."""
    rows, columns = matrix.nonzero()
    return Entries(rows, columns, matrix[rows, columns], (matrix.shape[0], matrix.shape[1]))
