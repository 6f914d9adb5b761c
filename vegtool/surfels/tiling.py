"""Parts of a model of surfel billboards that replace each other: a tree of tiles.

After Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007),
whose cuts (section 4.5) choose single billboards; a client of 3D Tiles chooses whole files, each
drawn by one call or two. So a tile is a cut of a part of the hierarchy at one error: billboards of
no greater one, and triangles where there are none. Its children are cuts of the same part at a
smaller error, divided by where things lie where they are many: together they show what the tile
does, once. Errors fall on the way down, to that of the original, which is none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.surfels.base import base_of
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.patches import gathered
from vegtool.surfels.regions import beneath
from vegtool.surfels.sheets import Labels

FINER = 0.7
"""Of a tile's error: that of its children, at most. At 0.5 files of a rabbit and a tree were a
quarter smaller, and up to three times as many triangles were drawn."""
MOST = 4096
"""Triangles of a tile, about; two or four to a billboard."""
WORTH = 1.5
"""Times the triangles of what is shown: where something finer has no more, it is shown instead."""


@dataclass(frozen=True, eq=False)
class _Shown:
    """What a tile shows: as of SurfelTile."""

    billboards: IntArray
    patches: IntArray
    triangles: Labels
    error: float


@dataclass(frozen=True, eq=False)
class SurfelTile:
    """A part of a model. billboards: (m,) int32 that are drawn. patches: (q,) int32 of the coarsest
    level that are drawn as triangles. triangles: (k,) int64 rows of the multi-triangulation's
    faces, those over these patches, at one level; some over others too, along the border. error:
    metres. children: none at an error of 0."""

    billboards: IntArray
    patches: IntArray
    triangles: Labels
    error: float
    children: tuple[SurfelTile, ...] = ()

    def all(self) -> Iterator[SurfelTile]:
        """The tile and all below, each before its children."""
        yield self
        for child in self.children:
            yield from child.all()


def tiles_of(model: SurfelModel, most: int = MOST) -> SurfelTile:
    """The tree of a model: its root shows all of it."""
    one = model.hierarchy
    roots = np.flatnonzero(one.father < 0).astype(np.int32)
    alone = np.flatnonzero(one.above < 0).astype(np.int32)
    tiling = _Tiling(model, most)
    coarsest = float(model.triangles.error[:-1].max())
    return tiling.tile(tiling.shown(roots, alone, coarsest))


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of numbers, by what they belong to: those of `i` are order[first[i] : first[i + 1]]."""

    first: Labels
    order: Labels

    def of(self, which: npt.NDArray[np.integer]) -> Labels:
        """(r,) those of all of these."""
        begin, count = self.first[which], self.first[which + 1] - self.first[which]
        start = np.repeat(begin - np.cumsum(count) + count, count)
        return np.asarray(self.order[start + np.arange(int(count.sum()))])


def _rows(owner: npt.NDArray[np.integer], owners: int, rows: Labels | None = None) -> _Rows:
    """owner: (r,) of each row, -1 for none. rows: (r,) their numbers, if not 0, 1, ..."""
    order = np.argsort(owner, kind="stable")[int((owner < 0).sum()) :]
    count = np.bincount(owner[order], minlength=owners)
    return _Rows(np.append(0, np.cumsum(count)), order if rows is None else rows[order])


class _Tiling:
    """What tiles are made of."""

    def __init__(self, model: SurfelModel, most: int) -> None:
        mt, one = model.triangles, model.hierarchy
        self.error, self.most = one.error, most
        count, patches = len(one), len(one.above)
        self.patches = patches
        self.below, self.directly = _rows(one.father, count), _rows(one.above, count)

        arc = np.repeat(np.arange(len(mt.start)), mt.sizes)
        self.made, self.gone = mt.error[mt.end][arc], mt.error[mt.start][arc]
        on = beneath(mt)
        pair = np.unique(on.astype(np.int64) * len(on) + np.arange(len(on))[:, None])
        self.over = _rows(pair // len(on), patches, pair % len(on))
        self.middle_on = on[:, -1]

        base = base_of(mt)
        self.places = np.concatenate([one.boxes.center, _means(base.corners, base.first)])
        self.sides = np.where(model.textures.behind, 2, 1)

    def tile(self, shown: _Shown) -> SurfelTile:
        """Of what is shown at some error, or at a smaller one where that takes hardly more."""
        most = WORTH * self.count(shown)
        while shown.error > 0:
            finer = self.finer(shown.billboards, shown.patches, FINER * shown.error)
            if self.count(finer) > most:
                break
            shown = finer
        else:
            return SurfelTile(**vars(shown))
        children = tuple(self.tile(part) for part in self.parts(finer, FINER * shown.error))
        return SurfelTile(**vars(shown), children=children)

    def shown(self, billboards: IntArray, patches: IntArray, target: float) -> _Shown:
        """Billboards, and patches as triangles of no greater error."""
        rows = np.unique(self.over.of(patches))
        cut = rows[(self.made[rows] <= target) & (target < self.gone[rows])]
        original = rows[self.made[rows] == 0]
        triangles = original if len(original) <= WORTH * len(cut) else cut
        errors = self.error[billboards], self.made[triangles]
        return _Shown(billboards, patches, triangles, max(float(e.max(initial=0)) for e in errors))

    def count(self, shown: _Shown) -> int:
        """Triangles to draw."""
        return int(2 * self.sides[shown.billboards].sum()) + len(shown.triangles)

    def finer(self, billboards: IntArray, patches: IntArray, target: float) -> _Shown:
        """The same as billboards of no greater error, and what is below all of these."""
        none = np.empty(0, np.int32)
        kept, over = [none], [patches]
        while len(billboards):
            coarse = self.error[billboards] > target
            kept.append(billboards[~coarse])
            over.append(self.directly.of(billboards[coarse]).astype(np.int32))
            billboards = self.below.of(billboards[coarse]).astype(np.int32)
        return self.shown(np.sort(np.concatenate(kept)), np.sort(np.concatenate(over)), target)

    def parts(self, shown: _Shown, target: float) -> list[_Shown]:
        """What lies together, of about so many triangles at most."""
        billboards, patches = shown.billboards, shown.patches
        of_patch = np.bincount(self.middle_on[shown.triangles], minlength=self.patches)[patches]
        size = np.concatenate([2 * self.sides[billboards], of_patch])
        places = self.places[np.concatenate([billboards, len(self.error) + patches])]
        part = gathered(places, size, np.zeros(len(size), np.int64), self.most)
        first, second = part[: len(billboards)], part[len(billboards) :]
        return [
            self.shown(billboards[first == number], patches[second == number], target)
            for number in range(int(part.max()) + 1)
        ]


def _means(corners: FloatArray, first: npt.NDArray[np.integer]) -> FloatArray:
    """(p, 3) middles of sets of triangles (t, 3, 3), which begin at `first`, (p,)."""
    count = np.diff(np.append(first, len(corners)))
    return np.asarray(np.add.reduceat(corners.mean(axis=1), first) / count[:, None])
