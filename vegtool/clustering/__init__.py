"""Plant -> one label per face: which faces share a billboard.

A method is one line in `METHODS`: module, function, and the sentence that `--method --help` shows.
Its function takes (plant, count, options, seed, progress) and returns labels that `cluster` checks.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from vegtool.errors import UsageError
from vegtool.progress import Progress, silent

if TYPE_CHECKING:
    from vegtool.arrays import IntArray
    from vegtool.plant import Plant

METHODS: dict[str, tuple[str, str]] = {
    "branches": ("branches:branches", "along the branches, so that trunks stay whole"),
    "isodata": ("isodata:isodata", "long and thin, split and merged by size"),
    "kmeans": ("kmeans:kmeans", "compact"),
    "planes": ("plane_space:planes", "near one plane each, wherever on it"),
}
"""Name -> (module:function within this room, what its clusters are like)."""


@dataclass(frozen=True)
class ClusterOptions:
    """What shapes a clustering, besides method, count and seed.

    orientation_weight: length, in plant radii, of one unit of face orientation (Frobenius distance
    of the tensors n n^T; two faces at right angles are sqrt 2 apart) in a clustering of 500. It
    grows and shrinks with the clusters, as the cube root of 500 / count. 0, the default, is the
    paper: positions alone; docs/methods/kmeans.md has the measurement.
    elongation: how many times as long as wide the clusters of `isodata` and `branches` shall be; 1
    is compact.
    strict_level: `branches` stops at the branching level, as in the paper, and leaves the rest of
    the count unused.
    """

    orientation_weight: float = 0.0
    elongation: float = 2.0
    strict_level: bool = False

    def orientation_scale(self, count: int) -> float:
        """Plant radii per unit of face orientation, for that many clusters."""
        return float(self.orientation_weight * (500 / count) ** (1 / 3))

    def line_scale(self, count: int) -> float:
        """The same where clusters are lines: their length counts for less, hence positions on the
        whole, and orientation with them."""
        return self.orientation_scale(count) / float(self.elongation ** (1 / 3))

    def __post_init__(self) -> None:
        if not 0 <= self.orientation_weight <= 1e3:
            raise UsageError(
                f"orientation weight: expected 0 to 1000 plant radii, got {self.orientation_weight}"
                "; 0, the default, clusters by position alone, 0.12 by orientation too"
            )
        if not 1 <= self.elongation <= 1e3:
            raise UsageError(
                f"elongation: expected 1 to 1000, got {self.elongation}"
                "; 1 makes compact clusters, 2 is the default"
            )


def cluster(
    plant: Plant,
    method: str,
    count: int,
    options: ClusterOptions = ClusterOptions(),
    seed: int = 0,
    progress: Progress = silent,
) -> IntArray:
    """Label every face with the cluster that it belongs to: (f,) int32, 0..k-1, every label used.

    k = `count`, or less where the plant has fewer distinct faces (so ten million is allowed and
    means one cluster per distinct face).
    Raises UsageError for an unknown method, a count below one or a negative seed.
    """
    if method not in METHODS:
        raise UsageError(
            f"method: expected one of {', '.join(METHODS)}; got {method!r}. Choose one of these."
        )
    if count < 1:
        raise UsageError(
            f"billboards: expected at least 1, got {count}. Ask for one or more; "
            "a few hundred suit a tree."
        )
    module, function = METHODS[method][0].split(":")
    run = getattr(import_module(f"{__name__}.{module}"), function)
    progress(method, 0.0)
    labels = run(plant, min(count, len(plant.faces)), options, seed, progress)
    progress(method, 1.0)
    return compact(labels)


def compact(labels: IntArray) -> IntArray:
    """The same partition with labels 0..k-1, numbered in order of their first face."""
    import numpy as np

    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int32)
    rank[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
    return np.asarray(rank[inverse])
