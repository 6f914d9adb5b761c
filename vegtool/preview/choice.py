"""What is drawn of a landscape from one eye: which plants, which of their levels, how much of each.

Colditz, Coconu, Deussen, Hege: Real-time rendering of complex photorealistic landscapes using
hybrid level-of-detail approaches (2005), section 4. Near, a plant is its full geometry; far, its
billboards; between, geometry is reduced as distance grows while billboards appear. The same holds
for later levels among themselves. Cook, Halstead, Planck, Ryu (2007): of the geometry that is left,
what remains is enlarged.

Levels are used from the distances that their manifest states, or nearer, where time is short: then
every plant has as many triangles as its picture has room for. Where the error of a pixel depends on
how many triangles show it, and all are seen, no way to spend so many triangles has less error than
the same number to each pixel (Lagrange's condition: the gain of one more is the same everywhere).
But of what is far, most is hidden behind what is near; so smaller pictures have fewer to the pixel.

Tiles are culled first and plants second, both in arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.elements import Elements
from vegtool.gl.instances import INSTANCE, WHOLE
from vegtool.gl.landscape import Batch, Frame
from vegtool.preview.correction import Correction, sides_of
from vegtool.preview.options import FadeMode
from vegtool.preview.reveal import threshold_of
from vegtool.preview.stock import STOCK, Stock
from vegtool.tiles.library import Species

GROWTH = 0.4
"""Lengths of elements grow with this power of how many fewer there are (docs/methods/baselines.md:
0.5 keeps the area, of which more is seen as there is less overlap)."""
NEAR_SPARE = 2.0
"""Of the original where its first level takes over: triangles times those of the level. Leaves that
were left out at random serve worse than triangles that were chosen."""
HIDDEN = 0.4
"""The square around a plant has room for a triangle to the pixel at detail 1, times its pixels to
this power. Of 0, 0.2, 0.4 and 0.8, FLIP at frames of a quarter second was least with 0.4
(docs/methods/crossfade.md)."""
TEXTURED = 0.5
"""Where a level without textures follows one with them, it does at this share of the distance: what
is cut out by alpha takes a processor six times as long as plain triangles of the same pixels."""
LEAST_TRIANGLES = 2.0
"""Of a plant that is drawn."""
THINNED_PX = 0.5
"""Size of plants in the picture, at detail 1, from which on some of their kind are left out."""
WIDEST = 3.0
"""Factor of the width of plants that stand for others."""
APPEARING = 0.15
"""Of the distance at which a plant vanishes: along it, its width grows from nothing."""
SHARES = 2.0**0.5
"""Ratio of the shares of elements that are drawn by one call."""
OVERLAP = 0.85
"""Two levels that fade into each other cover some places both: each shows its share to this power,
which is more than its share."""
BEYOND = 4.0
"""Times the distance of the last level: along it, stages go on (`Switches.stage`)."""
NO_LEVEL = 255
"""Of a plant that was not drawn yet."""


@dataclass(frozen=True, eq=False)
class Kinds:
    """Levels of all species in one picture's terms; s species, l levels at most.

    switch_m: (s, l) metres at which each level may be used, of plants of scale 1; infinite where
    there is none. room_m: (s, l) metres at which there is room for no more triangles than it has.
    fade: (s, l). model: (s, l) int32, index in the landscape. triangles: (s, l). count: (s,)
    levels. opaque: (s, l) bool, fades by elements; else by texels. center: (s,) metres above the
    foot, and radius: (s,), of what a plant fills. thinned_m: (s,), up to which all plants are
    drawn. surfels: (s,) int32 the level that is surfels, -1 where there is none. corrections: of
    each kind.
    """

    switch_m: FloatArray
    room_m: FloatArray
    fade: FloatArray
    model: IntArray
    triangles: FloatArray
    count: IntArray
    opaque: np.ndarray
    center: FloatArray
    radius: FloatArray
    thinned_m: FloatArray
    surfels: IntArray
    corrections: tuple[Correction, ...] = ()


def kinds_of(
    species: Sequence[Species],
    elements: Sequence[Sequence[Elements]],
    model: Sequence[Sequence[int]],
    focal_px: float,
) -> Kinds:
    """The species for pictures in which a metre at a distance of one is `focal_px` pixels.

    elements, model: of each level of each species; model of its surfels, too, if it has some.
    """
    most = max(len(one.levels) + (one.surfels is not None) for one in species)
    shape = (len(species), most)
    switch, room, fade = np.full(shape, np.inf), np.full(shape, np.inf), np.zeros(shape)
    index, opaque, triangles = np.zeros(shape, np.int32), np.zeros(shape, bool), np.ones(shape)
    count = np.array([len(one) for one in model], np.int32)
    surfels = np.full(len(species), -1, np.int32)
    center, radius, thinned = (np.zeros(len(species)) for _ in range(3))
    for i, one in enumerate(species):
        n = len(one.levels)
        reach = one.extent * focal_px
        triangles[i, :n] = [len(e.faces) for e in elements[i]]
        switch[i, :n] = one.switch_m * focal_px / one.focal_px
        room[i, :n] = reach / side_of(triangles[i, :n])
        textured = np.array([any(m.textures for m in level.materials) for level in one.levels])
        room[i, 1:n] *= np.where(textured[: n - 1] & ~textured[1:], TEXTURED, 1.0)
        fade[i, :n] = one.fade
        index[i, : len(model[i])] = model[i]
        opaque[i, :n] = [
            all(m.alpha_mode == "opaque" for m in level.materials) for level in one.levels
        ]
        opaque[i, 0] |= one.whole  # of the original, elements are leaves
        if one.surfels is not None:
            surfels[i], triangles[i, n] = n, triangles[i, 0]
            # discs of twice the size are for half the distance
            room[i, n] = switch[i, n] = one.surfels.switch_m * focal_px / one.focal_px
            fade[i, n], opaque[i, n] = one.surfels.fade, True
        low, high = one.original_bounds
        center[i] = (low[1] + high[1]) / 2
        side = np.abs(np.stack([low, high])).max(axis=0)
        radius[i] = float(np.hypot(np.hypot(side[0], side[2]), (high[1] - low[1]) / 2))
        thinned[i] = reach / THINNED_PX
    return Kinds(
        switch, room, fade, index, triangles, count, opaque, center, radius, thinned, surfels
    )  # fmt: skip


def side_of(triangles: FloatArray) -> FloatArray:
    """(n,) pixels: side of the square around a plant that has room for so many triangles."""
    return np.asarray(triangles ** (0.5 / (1 + HIDDEN)))


@dataclass(frozen=True, eq=False)
class Switches:
    """Where levels follow each other at a detail, float32, of plants of scale 1.

    start, end: (s, l) metres, of each level's fade; ascending, a level that is left out begins
    where the next one does. before: (s, l) the level that each one follows. whole_m: (s,) metres,
    up to which the original is drawn whole. coarse_m: (s,) metres, up to which the last level is.
    count: (s,) levels. fewest: (s,) triangles of the last.
    """

    start: np.ndarray
    end: np.ndarray
    before: np.ndarray
    whole_m: np.ndarray
    coarse_m: np.ndarray
    count: np.ndarray
    fewest: np.ndarray

    def stage(self, kind: np.ndarray, away: np.ndarray) -> np.ndarray:
        """(n,) how far on its way through its levels a plant is, whatever the detail: l to l + 0.5
        while level l fades in, l + 0.5 to l + 1 until the next one does."""
        level = (away[:, None] >= self.start[kind]).sum(axis=1) - 1
        each = np.arange(len(kind))
        start, end = self.start[kind], self.end[kind]
        last = level == self.count[kind] - 1
        here, ended = start[each, level], end[each, level]
        nothing = level == 0
        ended = np.where(nothing, self.whole_m[kind], ended)
        following = start[each, np.minimum(level + 1, start.shape[1] - 1)]
        following = np.where(last, BEYOND * ended, following)
        with np.errstate(divide="ignore", invalid="ignore"):
            fading = np.where(nothing, 1.0, (away - here) / (ended - here))
            between = np.log(away / ended) / np.log(following / ended)
        between = np.where(np.isfinite(between), between, 0.0)
        return np.asarray(level + 0.5 * (np.clip(fading, 0, 1) + np.clip(between, 0, 1)))


def switches(kinds: Kinds, detail: float) -> Switches:
    """Where levels follow each other: from the stated distances on, or from where there is no room
    for more triangles. detail: factor of the distances at which there is room."""
    start = np.minimum(kinds.switch_m, detail * kinds.room_m)
    start[:, 0] = 0.0
    start = np.minimum.accumulate(start[:, ::-1], axis=1)[:, ::-1].astype(np.float32)
    end = (start * (1 + kinds.fade)).astype(np.float32)
    following = np.where(start[:, 1:] > start[:, :-1], start[:, 1:], np.inf)
    end[:, :-1] = np.minimum(end[:, :-1], following)
    end = np.minimum.accumulate(end[:, ::-1], axis=1)[:, ::-1]
    level = np.arange(start.shape[1])
    earlier = start[:, None, :] < start[:, :, None]  # level, earlier level
    before = np.where(earlier, level, 0).max(axis=2)
    last = kinds.count - 1
    each = np.arange(len(last))
    coarse = (detail * kinds.room_m[each, last]).astype(np.float32)
    whole = coarse.copy()
    if start.shape[1] > 1:
        second = (start <= start[:, 1:2]).sum(axis=1) - 1  # what is drawn after the original
        second = np.minimum(second, last)
        spare = NEAR_SPARE * kinds.triangles[each, second] / kinds.triangles[:, 0]
        whole = np.where(last > 0, start[:, 1] * np.minimum(spare, 1.0) ** 0.5, whole)
    fewest = kinds.triangles[each, last]
    return Switches(start, end, before, whole.astype(np.float32), coarse, kinds.count, fewest)


@dataclass(frozen=True, eq=False)
class Seen:
    """Plants of several tiles that an eye sees. rows: (n,) STOCK. place: (n, 3) float32 metres from
    the eye. distance: (n,) float32 metres, to the middle of the plant. spare: (n,) float32, times
    that distance that the plant vanishes. index: (n,) where they are among the plants that were
    looked at: of each tile the first `counts`, (t,)."""

    rows: np.ndarray
    place: np.ndarray
    distance: np.ndarray
    spare: np.ndarray
    index: np.ndarray
    counts: np.ndarray


def seen(
    stocks: Sequence[Stock],
    near_m: FloatArray,
    eye: FloatArray,
    planes: FloatArray,
    kinds: Kinds,
    detail: float,
) -> Seen:
    """The plants of tiles that reach into the view and are not too far away to be drawn.

    near_m: (t,) metres from the eye to the nearest point of each tile. planes: (p, 4), as of
    Eye.planes. detail: factor of all distances.
    """
    counts = np.array(
        [
            len(stock.reach) - np.searchsorted(stock.reach[::-1], near / detail)
            for stock, near in zip(stocks, near_m, strict=True)
        ],
        np.int64,
    )
    parts, places = [np.zeros(0, STOCK)], [np.zeros((0, 3), np.float32)]
    for stock, count in zip(stocks, counts, strict=True):
        parts.append(stock.rows[:count])
        places.append(stock.rows["offset"][:count] + (stock.origin - eye).astype(np.float32))
    rows, place = np.concatenate(parts), np.concatenate(places)
    kind, scale = rows["species"], rows["scale"]
    x, y, z = place.T.copy()
    y += scale * kinds.center.astype(np.float32)[kind]
    distance = np.sqrt(x * x + y * y + z * z)
    within = -scale * kinds.radius.astype(np.float32)[kind]
    inside = np.ones(len(rows), bool)
    for a, b, c, d in planes.astype(np.float32):
        inside &= a * x + b * y + c * z + d > within
    vanish = scale * rows["vanish"] * (detail * kinds.thinned_m).astype(np.float32)[kind]
    keep = np.flatnonzero(inside & (distance < vanish))
    distance = np.maximum(distance[keep], np.float32(1e-3))
    return Seen(rows[keep], place[keep], distance, vanish[keep] / distance, keep, counts)


@dataclass(frozen=True, eq=False)
class Chosen:
    """Levels to draw, m of them; a plant that fades is among them twice.

    of: (m,) which of the plants, all of them first. level: (m,) of its species. model: (m,) in the
    landscape. kept: (m,) share of its elements.
    length: (m,) of those that are enlarged. shown: (m,) as `reveal.glsl` reads it. solid: (m,)
    share of what has no texels that is shown where texels fade. fading: (m,) bool. points: (m,)
    bool, whether the level is surfels: their discs are as much larger as `length` says.
    """

    of: np.ndarray
    level: np.ndarray
    model: np.ndarray
    kept: np.ndarray
    length: np.ndarray
    shown: np.ndarray
    solid: np.ndarray
    fading: np.ndarray
    points: np.ndarray

    def only(self, which: np.ndarray) -> Chosen:
        """Those of a mask (m,), or of indices."""
        values = (getattr(self, item.name)[which] for item in fields(self))
        return Chosen(*values)


def chosen(
    found: Seen,
    kinds: Kinds,
    detail: float,
    mode: FadeMode,
    held: int | None = None,
    before: np.ndarray | None = None,
) -> Chosen:
    """The levels of the plants. held: the one that all are to have, or the last before it. before:
    (n,) uint8 the levels that they had, NO_LEVEL for none, which those that do not fade keep as
    long as they may."""
    kind, at = found.rows["species"], switches(kinds, detail)
    away = found.distance / found.rows["scale"]
    start, end = at.start[kind], at.end[kind]
    level = ((away[:, None] >= start).sum(axis=1) - 1).astype(np.int64)
    each = np.arange(len(kind))
    share = np.ones(len(kind), np.float32)
    if held is not None:
        level = np.minimum(held, kinds.count[kind] - 1).astype(np.int64)
    elif mode == "none":
        if before is not None:
            left = ((away[:, None] >= end).sum(axis=1) - 1).astype(np.int64)
            level = np.where(before == NO_LEVEL, level, np.clip(before, left, level))
    else:
        first, length = start[each, level], end[each, level] - start[each, level]
        np.divide(away - first, length, out=share, where=length > 0)
        share = np.minimum(share, 1)
    fades = np.flatnonzero(share < 1)
    of = np.concatenate([each, fades])
    drawn = np.concatenate([level, at.before[kind[fades], level[fades]]])
    comes = np.concatenate([share, share[fades]])
    leaves = np.arange(len(of)) >= len(each)
    points = kinds.surfels[kind[of]] == drawn
    whole = np.ones(len(of))
    if held is None:  # of surfels, a prefix is drawn anyway
        whole = np.where(points, 1.0, _share_whole(at, kind[of], drawn, away[of]))
    kept, enlarged = whole * WHOLE, whole**-GROWTH
    if held is None:
        side = sides_of(found.place, found.rows["turn"])
        enlarged *= _lengths(kinds, kind, at.stage(kind, away), side)[of]
    shown, solid = np.full(len(of), 2.0), np.ones(len(of))
    by_elements = kinds.opaque[kind[of], drawn]
    fading = np.concatenate([share < 1, np.ones(len(fades), bool)])
    if mode == "dither":
        shown = np.where(fading, np.where(leaves, -comes - 1e-6, comes), shown)
    else:
        visible = np.where(leaves, 1 - comes, comes) ** OVERLAP
        elements = fading & by_elements
        kept[elements] *= visible[elements]
        fading &= ~by_elements
        shown = np.where(fading, threshold_of(visible), shown)
        solid = np.where(fading, visible, solid)
    model = kinds.model[kind[of], drawn]
    return Chosen(of, drawn.astype(np.uint8), model, kept, enlarged, shown, solid, fading, points)


def _share_whole(at: Switches, kind: np.ndarray, level: np.ndarray, away: np.ndarray) -> np.ndarray:
    """(m,) of a level's elements, how many are drawn that far away where nothing fades."""
    first, last = level == 0, level == at.count[kind] - 1
    until = np.where(first, at.whole_m[kind], np.where(last, at.coarse_m[kind], np.inf))
    fewest = np.where(last, np.minimum(LEAST_TRIANGLES / at.fewest[kind], 1.0), 0.0)
    return np.asarray(np.clip((until / away) ** 2, fewest, 1.0))


def _lengths(kinds: Kinds, kind: np.ndarray, stage: np.ndarray, side: np.ndarray) -> np.ndarray:
    """(n,) factor of the lengths of elements."""
    result = np.ones(len(kind))
    for index, correction in enumerate(kinds.corrections):
        here = np.flatnonzero(kind == index)
        result[here] = correction.at(stage[here], side[here])
    return result


def frame(found: Seen, what: Chosen, paint: np.ndarray | None = None) -> Frame:
    """The rows and batches of what was chosen that is triangles, nearest first. paint: (m, 4) uint8
    in place of the plants' own tints."""
    if what.points.any():
        paint = None if paint is None else paint[~what.points]
        what = what.only(~what.points)
    rows = np.zeros(len(what.of), INSTANCE)
    stock = found.rows[what.of]
    rows["place"][:, :3] = found.place[what.of]
    rows["place"][:, 3] = stock["scale"]
    rows["turn"][:, :2] = stock["turn"]
    rows["turn"][:, 2], rows["turn"][:, 3] = what.kept, what.length
    rows["shown"][:, 0], rows["shown"][:, 2] = what.shown, what.solid
    rows["shown"][:, 1] = width(stock["vanish"], found.spare[what.of])
    rows["tint"] = stock["tint"] if paint is None else paint
    steps = np.floor(-np.log(np.clip(what.kept, 1e-6, 1)) / np.log(SHARES)).astype(np.int64)
    key = (what.model * 64 + steps) * 2 + what.fading
    if not len(key) or key.max() < 2**16:  # 16 bits: a radix sort
        key = key.astype(np.uint16)
    order = np.argsort(key, kind="stable")
    key, rows = key[order], rows[order]
    if not len(rows):
        return Frame(rows, ())
    first = np.concatenate([[0], np.flatnonzero(np.diff(key)) + 1])
    count = np.diff(np.concatenate([first, [len(rows)]]))
    share = np.maximum.reduceat(what.kept[order], first)
    near = np.minimum.reduceat(found.distance[what.of][order], first)
    model, fading = what.model[order][first], what.fading[order][first]
    batches = tuple(
        Batch(int(model[i]), int(first[i]), int(count[i]), float(share[i]), bool(fading[i]))
        for i in np.argsort(near, kind="stable")
    )
    return Frame(rows, batches)


def width(vanish: np.ndarray, spare: np.ndarray) -> np.ndarray:
    """(m,) factor of the width of plants, for those that are left out around them, and of those
    that are about to be. spare: as of Seen."""
    fewer = np.minimum((spare / vanish) ** 2, 1.0)  # the share of its kind that is still drawn
    appearing = np.clip((spare - 1) / APPEARING, 0, 1)
    return np.asarray(np.minimum(fewer**-GROWTH, WIDEST) * appearing)
