"""What is drawn of the stems, and how: all that is worth its triangles at a price of a triangle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.refine.wood_lines import Ints
from vegtool.refine.wood_lumps import Lump
from vegtool.refine.wood_stems import Solid, Stems

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Section:
    """What a stem is across. points: of its outline. sides: how many of them are drawn.

    wrong: share of what it covers that is drawn wrongly, where it is much thinner than a pixel, and
    where it is a pixel thick or more.
    """

    points: int
    sides: int
    wrong: tuple[float, float]


SECTIONS = (
    Section(2, 1, (0.3, 0.8)),
    Section(3, 2, (0.06, 0.12)),
    Section(3, 3, (0.06, 0.07)),
    Section(5, 5, (0.02, 0.02)),
    Section(7, 7, (0.005, 0.005)),
)
"""Outlines alone would make 0.42, 0.04, 0.04, 0.013 and 0.007 of it; these, which count what is lit
wrongly too, gave the least FLIP of the wood of four plants. Odd numbers of sides, for then a prism
is nearly as wide from everywhere."""
BENT = 0.4
"""Share of what a straight taper covers that is wrong, over its greatest deviation in diameters, or
in pixels where it is thinner: a picture shows a part of the mean. From the same pictures."""
DISPLACED = 2.0
"""The most of it: all is missing in its place, and as much is too much elsewhere."""
TIP = 0.5
"""Of the girth at the last ring but one: a stem whose end is thinner ends in a point. So does one
that grows from another and ends thinner than a pixel; a trunk's last ring may be its foot."""
THICKEST = 1.0
"""Pixels: stems that stand for others are made no thicker than this, if they are not themselves.
Surface that is lost so is worth less than the sight of a club."""
HIDDEN = 0.05
"""The least that a stem counts which nobody sees."""


@dataclass(frozen=True, eq=False)
class Choice:
    """What is drawn of t stems with s spans.

    wider: (t,) how many times its own surface a stem shows, 0 where it is not drawn. section: (t,)
    index into SECTIONS. halved: (s,) spans that are. pointed: (t,) stems that end in a point.
    lumps: what is drawn in place of solids' stems. triangles: of all. wrong: pixels, by estimate.
    """

    wider: FloatArray
    section: Ints
    halved: Bools
    pointed: Bools
    lumps: tuple[tuple[Solid, Lump], ...]
    triangles: int
    wrong: float


@dataclass(frozen=True, eq=False)
class Screen:
    """The stems in pixels, of which one is `pixel` long in their units.

    covered: (t,) by each stem, in the mean over all views. counts: (t,) share of it that is seen.
    thick: (t,) mean diameter. rough: (t,) pixels that are wrong in any taper. pointed: (t,) ends
    in a point. bent: (s,) how many of a span's pixels are wrong where it is straight. worth: (s,)
    the price of a segment up to which it is halved.
    """

    stems: Stems
    pixel: float
    covered: FloatArray
    counts: FloatArray
    thick: FloatArray
    rough: FloatArray
    pointed: Bools
    bent: FloatArray
    worth: FloatArray

    @staticmethod
    def of(stems: Stems, pixel_m: float) -> Screen:
        """Raises ValueError where `pixel_m`, metres that a pixel covers, is not a length."""
        if not (np.isfinite(pixel_m) and pixel_m > 0):
            raise ValueError(f"pixel_m: expected a length, found {pixel_m}")
        pixel, spans = pixel_m / stems.radius, stems.spans
        step = np.linalg.norm(np.diff(stems.node, axis=0, prepend=0.0), axis=1)
        step[stems.first] = 0.0
        surface, seen, along = (
            _between(values, spans.a, spans.b) for values in (stems.area, stems.seen, step)
        )
        thick = surface / (np.pi * np.maximum(along, np.finfo(float).tiny)) / pixel
        beside = spans.deviation / pixel / np.maximum(thick, 1.0)
        counts = np.maximum(_ratio(seen, surface), HIDDEN)
        bent = counts * surface / 4 / pixel**2 * np.minimum(BENT * beside, DISPLACED)
        worth = np.where(spans.middle >= 0, bent, 0.0)
        for begin, end in pairwise(spans.rounds):
            worth[begin:end] = np.minimum(worth[begin:end], worth[spans.parent[begin:end]])
        whole = slice(0, len(stems))
        before, tip = stems.girth[stems.last - 1], stems.girth[stems.last]
        pointed = (tip < TIP * before) | ((tip / np.pi < pixel) & (stems.host >= 0))
        covered = surface[whole] / 4 / pixel**2
        rough = np.minimum(2 * along[whole] * stems.rough / pixel**2, covered)
        return Screen(
            stems, pixel, covered, counts[whole], thick[whole], rough, pointed, bent, worth
        )

    def choice(self, price: float) -> Choice:
        """What is worth its triangles at that price, in pixels."""
        _, _, wrong, triangles = self._sections(np.ones(len(self.stems)), price)
        value = wrong + price * triangles
        seen = self.counts * self.covered
        value = np.where(seen < price, np.minimum(value, 2 * seen), value)
        lumps, free = [], np.ones(len(self.stems), dtype=bool)
        for solid in self.stems.solids:
            offers = [self._of_lump(solid, one) + price * len(one.faces) for one in solid.lumps]
            best = int(np.argmin(offers))
            if offers[best] < value[solid.stems].sum():
                lumps.append((solid, solid.lumps[best]))
                free[solid.stems] = False
        wider = self._grouped(free, price)
        section, halved, wrong, triangles = self._sections(wider, price)
        drawn = wider > 0
        return Choice(
            wider,
            section,
            halved & drawn[self._stem_of_span],
            self.pointed,
            tuple(lumps),
            int(triangles[drawn].sum()) + sum(len(lump.faces) for _, lump in lumps),
            float(wrong[drawn].sum())
            + float(seen[free & ~drawn].sum())
            + sum(self._of_lump(*pair) for pair in lumps),
        )

    def _sections(self, wider: FloatArray, price: float) -> tuple[Ints, Bools, FloatArray, Ints]:
        """For each stem its best section, which of its spans are halved, how many pixels are wrong
        and how many triangles it takes."""
        stem, count = self._stem_of_span, len(self.stems)
        thick = np.clip(self.thick * wider, 0.0, 1.0)
        best = np.full(count, np.inf)
        section, triangles = np.zeros((2, count), dtype=np.int64)
        wrong = np.zeros(count)
        for index, option in enumerate(SECTIONS):
            each = 2 * option.sides
            halved = self.worth >= price * each
            segments = 1 + np.bincount(stem, halved, count).astype(np.int64)
            left = np.where(halved, 0.0, self.bent) * self._is_leaf(halved)
            across = option.wrong[0] * (1 - thick) + option.wrong[1] * thick
            across = np.where(self.stems.flat, 0.0 if option.points == 2 else 1.0, across)
            off = self.counts * (across * self.covered + self.rough)
            off = off + np.bincount(stem, left, count)
            takes = each * segments - option.sides * self.pointed
            value = off * wider + price * takes
            better = value < best
            best = np.where(better, value, best)
            section = np.where(better, index, section)
            triangles = np.where(better, takes, triangles)
            wrong = np.where(better, off * wider, wrong)
        sides = np.array([option.sides for option in SECTIONS])[section]
        return section, self.worth >= price * 2 * sides[stem], wrong, triangles

    def _is_leaf(self, halved: Bools) -> Bools:
        """(s,) spans that are drawn, where those are halved: whole stems, and halves of others."""
        parent = self.stems.spans.parent
        return np.asarray((parent < 0) | halved[parent])

    def _of_lump(self, solid: Solid, lump: Lump) -> float:
        """Pixels wrong where a lump is drawn."""
        covered = self.covered[solid.stems]
        counts = (self.counts[solid.stems] * covered).sum() / max(covered.sum(), 1e-300)
        return float(lump.wrong / self.pixel**2 * counts)

    def _grouped(self, free: Bools, price: float) -> FloatArray:
        """(t,) how many times its own surface each of the free stems shows: neighbours that are
        together worth no more than a triangle are shown by the largest of them, as far as
        THICKEST allows."""
        order = self._side_by_side
        seen = self.counts * self.covered
        small = order[(free & (seen < price))[order]]
        wider = free.astype(np.float64)
        if len(small):
            worth = np.cumsum(seen[small]) - seen[small] / 2
            group = np.unique(np.floor(worth / price), return_inverse=True)[1]
            last = np.cumsum(np.bincount(group)) - 1
            largest = small[np.lexsort((self.covered[small], group))[last]]
            wider[small] = 0.0
            together = np.bincount(group, self.covered[small]) / self.covered[largest]
            widest = np.maximum(1.0, THICKEST / np.maximum(self.thick[largest], 1e-9))
            wider[largest] = np.minimum(together, widest)
        return wider

    @cached_property
    def _stem_of_span(self) -> Ints:
        """(s,)"""
        return self.stems.stem[self.stems.spans.b]

    @cached_property
    def _side_by_side(self) -> Ints:
        """(t,) the stems along a curve that passes neighbours one by one (Morton, 1966)."""
        middle = (self.stems.node[self.stems.first] + self.stems.node[self.stems.last]) / 2
        cell = np.clip((middle + 1) * 512, 0, 1023).astype(np.int64)
        key = np.zeros(len(cell), dtype=np.int64)
        for bit in range(10):
            for axis in range(3):
                key |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
        return np.argsort(key, kind="stable")


def _between(values: FloatArray, a: Ints, b: Ints) -> FloatArray:
    """Sums of what stands at the nodes after a and up to b."""
    total = np.cumsum(values)
    return np.asarray(total[b] - total[a])


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
