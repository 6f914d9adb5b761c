"""How many vertices a frame's triangles have: those that a GPU has to place once each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vegtool.elements import Elements, ordered
from vegtool.gl.landscape import Frame
from vegtool.tiles.library import Species


@dataclass(frozen=True, eq=False)
class Counts:
    """Of one level. begun: (f + 1,) distinct vertices of the faces before each. ends: of each
    material's faces, the last one's too. rank: (f,) of the faces."""

    begun: np.ndarray
    ends: np.ndarray
    rank: np.ndarray

    def up_to(self, share: float) -> int:
        """Distinct vertices of an instance that keeps a share of its elements."""
        total = 0
        for first, end in zip(self.ends[:-1], self.ends[1:], strict=True):
            kept = int(np.searchsorted(self.rank[first:end], share))
            total += int(self.begun[first + kept] - self.begun[first])
        return total


def counts_of(species: Sequence[Species]) -> list[Counts]:
    """Of all levels, in the order in which a landscape numbers them."""
    return [_counts(ordered(level)) for one in species for level in one.levels]


def vertices_in(frame: Frame, counts: Sequence[Counts]) -> int:
    """Of all plants of a frame."""
    return sum(batch.count * counts[batch.plant].up_to(batch.share) for batch in frame.batches)


def _counts(elements: Elements) -> Counts:
    faces = elements.faces
    first = np.full(len(elements.vertex), len(faces))
    np.minimum.at(first, faces.ravel(), np.repeat(np.arange(len(faces)), 3))
    fresh = np.bincount(first, minlength=len(faces) + 1)[: len(faces)]
    materials = int(elements.face_material.max()) + 2
    return Counts(
        np.concatenate([[0], np.cumsum(fresh)]),
        np.searchsorted(elements.face_material, np.arange(materials)),
        elements.face_rank,
    )
