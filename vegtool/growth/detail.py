"""How many triangles go where: one skeleton, drawn at any detail.

The skeleton does not depend on the number of triangles, so that the same tree is seen at every
detail. Of its stems the longest are drawn, their rings and sides grow slowly with detail, and the
leaves take what is left of the budget.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.growth.mesh import grid_triangles
from vegtool.growth.species import Foliage, Species
from vegtool.growth.stems import Stems

FEWEST_SIDES, FEWEST_SEGMENTS = 3, 2


@dataclass(frozen=True)
class WoodDetail:
    """Of one level: drawn (n,) bool, sides and segments (n,) int64."""

    drawn: np.ndarray
    sides: IntArray
    segments: IntArray

    def triangles(self) -> int:
        each = self.sides * (2 * self.segments - 1)
        return int(each[self.drawn].sum())


def wood_detail(
    species: Species, skeleton: Sequence[Stems], budget: float, rng: np.random.Generator
) -> list[WoodDetail]:
    """The finest wood of at most `budget` triangles (or the coarsest there is)."""
    ranks = _ranks(skeleton)
    dither = [rng.uniform(0, 1, (2, len(stems))) for stems in skeleton]

    def at(scale: float) -> list[WoodDetail]:
        total = sum(len(stems) for stems in skeleton)
        return [
            WoodDetail(
                rank < (max(1, total * scale**0.75) if level.sides else 0),
                _steps(level.sides * scale**0.2 + spread[0], FEWEST_SIDES),
                _steps(
                    level.segments
                    * scale**0.2
                    * np.sqrt(stems.length / max(stems.length.mean(), 1e-9))
                    + spread[1],
                    FEWEST_SEGMENTS,
                ),
            )
            for level, stems, rank, spread in zip(
                species.stems, skeleton, ranks, dither, strict=True
            )
        ]

    low, high = 1e-6, 1e6
    for _ in range(60):
        middle = np.sqrt(low * high)
        if sum(wood.triangles() for wood in at(middle)) <= budget:
            low = middle
        else:
            high = middle
    return at(low)


def _steps(value: FloatArray, least: int) -> IntArray:
    return np.asarray(np.maximum(np.floor(value), least).astype(np.int64))


def _ranks(skeleton: Sequence[Stems]) -> list[IntArray]:
    """Per level (n,): place of each stem when the longest come first and parents before them."""
    weights: list[FloatArray] = []
    for level, stems in enumerate(skeleton):
        weight = stems.length.copy()
        if level:
            weight = np.minimum(weight, weights[-1][stems.parent])
        weights.append(weight)
    order = np.argsort(-np.concatenate(weights), kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return list(np.split(rank, np.cumsum([len(w) for w in weights])[:-1]))


def leaf_detail(species: Species, kind: Foliage, triangles: int, left: int) -> tuple[int, int]:
    """Number and segments of the leaves of one kind, when `left` triangles are for all leaves."""
    shares = [k.count * grid_triangles(k.segments, 1, k.pointed) for k in species.foliage]
    share = kind.count * grid_triangles(kind.segments, 1, kind.pointed) / sum(shares)
    scale = triangles / species.triangles
    segments = int(np.clip(np.rint(kind.segments * scale**0.25), 1, 8))
    return round(left * share / grid_triangles(segments, 1, kind.pointed)), segments
