"""Rows grouped by cluster: sorted once, then summed, bounded and cut per cluster."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray


class Groups:
    """Rows 0..n-1 sorted by cluster, keeping their order within one.

    order: (n,) rows, cluster by cluster. present: (g,) clusters that have rows, ascending.
    starts: (g + 1,) where each begins in `order`. member: (n,) 0..g-1, the group of each sorted
    row. Methods take values already sorted by `order`.
    """

    def __init__(self, cluster: IntArray) -> None:
        self.order = np.argsort(cluster, kind="stable")
        self.present, first, counts = np.unique(
            cluster[self.order], return_index=True, return_counts=True
        )
        self.starts = np.append(first, len(cluster))
        self.member = np.repeat(np.arange(len(self.present)), counts)

    def __len__(self) -> int:
        return len(self.present)

    def slices(self) -> Iterator[slice]:
        """The rows of each group."""
        return (slice(a, b) for a, b in zip(self.starts[:-1], self.starts[1:], strict=True))

    def sum(self, values: FloatArray) -> FloatArray:
        """(g, ...) sums of (n, ...)."""
        return np.asarray(np.add.reduceat(values, self.starts[:-1], axis=0))

    def greatest(self, values: FloatArray) -> FloatArray:
        """(g, ...) greatest of (n, ...)."""
        return np.asarray(np.maximum.reduceat(values, self.starts[:-1], axis=0))

    def spread(self, values: npt.NDArray[np.float64]) -> FloatArray:
        """(n, ...) each row's group value of (g, ...)."""
        return np.asarray(values[self.member])
