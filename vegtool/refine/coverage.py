"""Alpha of a level's pictures such that a stock client covers as much as the truth does.

A client averages alpha into mips, interpolates it between texels and mips, and tests the result
once per pixel. It takes the mip by the longer side of the pixel's footprint, so a billboard seen
obliquely is sampled from mips far coarser than its distance asks for, and loses most of what is
finer than a few texels. After Castano, "Computing alpha mipmaps" (2010), but over all views and
distances at which a level is seen rather than mip by mip: each picture gets one threshold, such
that the area which passes, expected over directions (by the area that they see) and over
distances, is what the picture covers.

Alpha as baked, the mean coverage of a texel, ranks texels: what is covered most passes first.
Where nothing is covered the nearer to the shape, and where all is covered the farther from its
edge, so that shapes grow and shrink by their outline and holes stay holes. What is averaged are
exponentials of the ranks, as exponential shadow maps do (Annen, Mertens, Seidel, Flerackers, Kautz
2008): a mean of exponentials lies near the greatest of them, so that the mips of thin and sparse
things still pass. Alpha is linear in them, which interpolation and averaging keep: so all that a
client will ever sample can be ranked as it would be, and a histogram gives every threshold at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from vegtool.arrays import ByteArray, FloatArray, IntArray, SingleArray
from vegtool.baking.coverage import owners
from vegtool.lod import Atlas, Level
from vegtool.measure.scores import Truths
from vegtool.refine.drawn import drawn

PASS = 127.5
"""Alpha of 255 at the client's cutoff."""
EXPONENT = 5.0
"""How much more a texel weighs that is covered than one that is not, as a logarithm. With 0, the
coverage of a leaf's billboard falls to two thirds two mips down; with 5 to nine tenths, and with 10
it rises."""
STEP = 1.0
"""Ranks, of 255, per texel of distance from the outline of a shape."""
TIES = 4.0
"""Ranks by which those of equally covered texels differ: what one sample of 64 covers."""
PLASTIC = 1.32471795724474602596
"""The real root of x^3 = x + 1."""
FARTHEST = 4
"""Texels by which a shape may grow or shrink."""
MIPS = np.arange(0.0, 5.01, 0.5)
"""Between which a client's are interpolated here."""
SAMPLES = 1_500_000
"""That rank all that a client samples of an atlas, as near as whole samples per texel allow."""
MOST_SAMPLES = 4
"""Per axis and texel."""
LEAST_SHARE = 1e-3
"""Mips that are sampled less do not count."""
LEAST_LEVELS = 8.0
"""Of alpha, below the cutoff: fewer would not tell apart how near texels are to a shape."""
LEAST_SPAN = 1e-3
"""Of a threshold's weight: keeps the slope finite where a picture has one rank only."""
SURPLUS = 0.02
"""By which a level covers more than the truth. FLIP falls with a little too much, since what a
pixel lacks is a hole that is seen, and what it has too much lies on more of the same: an ash from
0.079 at 0 to 0.072 at 0.04."""
ROUNDS = 3
"""In which a level's coverage is measured."""
ENOUGH = 0.005
"""Of bias, either way: less does not show."""
FACTORS = (0.25, 4.0)
"""Of what pictures cover: farther off, it is not their alpha that is wrong."""
POWER, POWERS = 0.8, (0.3, 1.5)
"""Coverage on the screen grows as that power of what pictures cover: leaves hide leaves."""
NOTHING = 1e-3
"""Of the truth's coverage, or of a factor."""
ANGLES, TURNS, DISTANCES = 64, 8, 9
"""Samples of the directions and distances from which a billboard is seen."""


@dataclass(frozen=True, eq=False)
class Solved:
    """A level whose coverage has been measured.

    factor: by how much the coverage of its pictures was scaled. bias: of the level's coverage, as a
    share of the truth's. rounds: how often it was drawn.
    """

    level: Level
    factor: float
    bias: float
    rounds: int


@dataclass(frozen=True, eq=False)
class Ranks:
    """Ranks of the texels of p pictures, 0 to 255 and beyond.

    weight: (h, w) exponentials of the ranks, gutters included. owner: (h, w) int32 picture of each
    texel, and `grown` the same with gutters; -1 for none. covered, area: (p,) texels.
    """

    weight: SingleArray
    owner: IntArray
    grown: IntArray
    covered: FloatArray
    area: FloatArray

    def target(self, factor: npt.ArrayLike) -> FloatArray:
        """(p,) texels that are to pass: what is covered times a factor, (p,) or one for all."""
        return np.asarray(np.minimum(self.covered * np.asarray(factor, np.float64), self.area))


@dataclass(frozen=True, eq=False)
class Passing:
    """texels: (p, b) how many of each picture a client shows, expected over all directions and
    distances, if those pass whose rank is `low` + b or more."""

    texels: FloatArray
    low: float


def unbiased_alpha(
    alpha: ByteArray,
    rects: IntArray,
    gutter: int,
    density: float = 1.0,
    reach: float = 2.0,
    factor: npt.ArrayLike = 1.0,
) -> ByteArray:
    """(h, w) uint8: alpha of an atlas of which as much passes a client's test as is covered.

    alpha: (h, w) uint8, mean coverage of each texel, as baked with `fit_alpha=False`. rects: (p, 4)
    int32 x0, y0, width, height of the pictures, each once; `gutter` texels around each are its own.
    density: texels per pixel, seen from in front at the near end. reach: the far end over the near
    one. factor: (p,) or one for all, how many times its own coverage a picture is to show. Pictures
    that are all empty or all covered stay as they are, and so does what lies outside them.
    """
    ranks = ranked(alpha, rects, gutter)
    passing = expected(ranks, seen_at(density, reach))
    return mapped(alpha, ranks, thresholds(passing, ranks.target(factor)))


def solve_coverage(
    level: Level,
    truths: Sequence[Truths],
    gutter: int,
    density: float = 1.0,
    reach: float = 2.0,
) -> Solved:
    """The level with unbiased alpha, whose targets are scaled until it covers what the truth does,
    and SURPLUS more.

    level: with an atlas whose alpha is the mean coverage of each texel (`fit_alpha=False`). truths:
    what is compared, drawn as by a client without anisotropic filtering, over all of their views
    and distances. gutter, density, reach: as in `unbiased_alpha`. At most ROUNDS are drawn, and the
    best of them is kept; where the truth covers nothing, nothing is scaled. Raises ValueError for a
    level without an atlas, CapabilityError where OpenGL cannot draw.
    """
    if level.atlas is None:
        raise ValueError("solve_coverage: needs a level with an atlas")
    alpha, rects = level.atlas.color[..., 3], pictures(level.atlas)
    ranks = ranked(alpha, rects, gutter)
    passing = expected(ranks, seen_at(density, reach))
    factor, tried = 1.0, list[Solved]()
    for _ in range(ROUNDS):
        made = with_alpha(level, mapped(alpha, ranks, thresholds(passing, ranks.target(factor))))
        bias = measured_bias(made, truths)
        tried.append(Solved(made, factor, bias or 0.0, len(tried) + 1))
        if bias is None or abs(bias - SURPLUS) <= ENOUGH:
            break
        factor = next_factor(tried)
    best = min(tried, key=lambda solved: abs(solved.bias - SURPLUS))
    return replace(best, rounds=len(tried))


def measured_bias(level: Level, truths: Sequence[Truths]) -> float | None:
    """How much more than the truth a level covers, as a share of that: mean over views and
    distances. None where the truth covers nothing."""
    cameras = [camera for t in truths for row in t.cameras for camera in row]
    lights = [t.light(view) for t in truths for _ in t.cameras for view in t.views]
    true = np.array([r.covered for t in truths for row in t.references for r in row])
    if not (true > 0).any():
        return None
    shown = np.array([p[..., 3].sum(dtype=np.float64) for p in drawn(level, cameras, lights)])
    return float((shown[true > 0] / true[true > 0]).mean()) - 1


def next_factor(tried: Sequence[Solved]) -> float:
    """By how much to scale next: coverage grows as a power of the factor, that of the last two."""
    last = tried[-1]
    power = POWER
    if len(tried) > 1:
        before = tried[-2]
        step = np.log(last.factor / before.factor)
        grown = np.log(max(1 + last.bias, NOTHING) / max(1 + before.bias, NOTHING))
        power = float(np.clip(grown / step, *POWERS)) if abs(step) > NOTHING else POWER
    excess = max(1 + last.bias, NOTHING) / (1 + SURPLUS)
    wanted = last.factor * excess ** (-1 / power)
    return float(np.clip(wanted, *FACTORS))


def with_alpha(level: Level, alpha: ByteArray) -> Level:
    """The level with that alpha, (h, w) uint8, in its atlas."""
    assert level.atlas is not None
    color = np.concatenate([level.atlas.color[..., :3], alpha[..., None]], axis=2)
    return replace(level, atlas=replace(level.atlas, color=color))


def pictures(atlas: Atlas) -> IntArray:
    """(p, 4) int32 all rectangles with pictures, each once."""
    return np.unique(np.concatenate([atlas.front, atlas.back]), axis=0).astype(np.int32)


def ranked(alpha: ByteArray, rects: IntArray, gutter: int) -> Ranks:
    """Texels ranked by how much of them is covered, then by their distance from the outline."""
    owner = owners(alpha.shape, rects)
    inside = owner >= 0
    coverage = np.where(inside, alpha, 0).astype(np.float32)
    rank = np.where((alpha > 0) & (alpha < 255), untied(coverage), coverage)
    # pictures lie apart by their gutters: no nearer than FARTHEST texels does another one count
    empty, full = inside & (alpha == 0), inside & (alpha == 255)
    far = np.float32(FARTHEST + 1)
    if empty.any():
        rank -= STEP * np.minimum(_distance(coverage == 0), far) * empty
    if full.any():
        rank += STEP * np.minimum(_distance(~inside | full), far) * full
    grown = owner.copy()
    for index, (x, y, w, h) in enumerate(rects.tolist()):
        around = np.s_[y - gutter : y + h + gutter, x - gutter : x + w + gutter]
        rank[around] = np.pad(rank[y : y + h, x : x + w], gutter, mode="edge")
        grown[around] = index
    count = len(rects)
    return Ranks(
        weight_of(rank),
        owner,
        grown,
        np.bincount(owner[inside], coverage[inside] / 255, count).astype(np.float64),
        np.bincount(owner[inside], minlength=count).astype(np.float64),
    )


def untied(coverage: SingleArray) -> SingleArray:
    """Ranks of which hardly any are equal: else a straight twig would show all over or nowhere.

    Spread evenly by Roberts' R2 sequence (2018).
    """
    height, width = coverage.shape
    part = np.modf(np.arange(width) / PLASTIC + np.arange(height)[:, None] / PLASTIC**2)[0]
    return np.asarray(coverage + TIES * (part - coverage / 255), dtype=np.float32)


def weight_of(rank: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The exponential of ranks."""
    return np.asarray(np.exp(rank * np.float32(EXPONENT / 255)))


def rank_of(weight: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The rank whose exponential that is."""
    return np.asarray(np.log(weight) * np.float32(255 / EXPONENT))


def _distance(within: npt.NDArray[np.bool_]) -> SingleArray:
    """(h, w) texels from the nearest texel that is not within; far where all are."""
    if within.all():
        return np.full(within.shape, np.inf, np.float32)
    return np.asarray(distance_transform_edt(within), dtype=np.float32)


def seen_at(density: float, reach: float) -> FloatArray:
    """(m,) how much of a billboard's pixels is sampled at each of MIPS, over all directions and
    distances; they sum to 1.

    All directions are as likely, but what is seen from in front covers more pixels: both together
    weigh by the cosine. The mip is that of the longer of the footprint's derivatives along the
    screen's axes, to which the billboard may be tilted in any direction.
    """
    cosine = ((np.arange(ANGLES) + 0.5) / ANGLES)[:, None]
    turn = (np.arange(TURNS) + 0.5) / TURNS * np.pi / 4
    longer = np.sqrt(1 + (1 / cosine**2 - 1) * np.cos(turn) ** 2)
    away = np.geomspace(1.0, max(reach, 1.0), DISTANCES if reach > 1 else 1)
    mip = np.log2(np.maximum(density * away[:, None, None] * longer, 1e-9))
    place = np.clip(mip / (MIPS[1] - MIPS[0]), 0, len(MIPS) - 1)
    lower = np.minimum(place.astype(int), len(MIPS) - 2)
    weight = np.broadcast_to(cosine, place.shape)
    share = np.bincount(lower.ravel(), (weight * (lower + 1 - place)).ravel(), len(MIPS))
    share += np.bincount(lower.ravel() + 1, (weight * (place - lower)).ravel(), len(MIPS))
    return np.asarray(share / share.sum())


def expected(ranks: Ranks, seen: FloatArray) -> Passing:
    """What passes at any threshold. seen: (m,) shares of MIPS."""
    count = len(ranks.area)
    low, high = rank_of(ranks.weight.min(initial=1.0)), rank_of(ranks.weight.max(initial=1.0))
    bins = int(np.ceil(high - low)) + 2
    found = np.zeros((count, bins))
    for owner, weight, share in sampled(ranks.weight, ranks.owner, seen):
        place = owner * bins + (rank_of(weight) - (low - 0.5)).astype(np.int64)
        found += share * np.bincount(place, minlength=count * bins).reshape(count, bins)
    share_of = found / np.maximum(found.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    texels = np.cumsum(share_of[:, ::-1], axis=1)[:, ::-1] * ranks.area[:, None]
    return Passing(texels, float(low) - 0.5)


def thresholds(passing: Passing, target: FloatArray) -> FloatArray:
    """(p,) the rank from which on as many texels pass as `target`, (p,), says, as nearly as can
    be."""
    best = np.abs(passing.texels - target[:, None]).argmin(axis=1)
    return np.asarray(best + passing.low, dtype=np.float64)


def sampled(
    values: SingleArray, owner: IntArray, seen: FloatArray
) -> Iterator[tuple[IntArray, SingleArray, float]]:
    """What a client samples of an image (h, w) in pictures: their numbers, the values, and the
    share of those; mip after mip, for shares (m,) of MIPS."""
    height, width = values.shape
    per_texel = np.sqrt(SAMPLES / max(height * width * np.count_nonzero(seen > LEAST_SHARE), 1))
    n = int(np.clip(per_texel, 1, MOST_SAMPLES))
    # in the middle of texels nothing is interpolated: one sample stands between middle and corner
    shift = 0.25 if n == 1 else 0.0
    y, x = ((np.arange(size * n) + 0.5) / n + shift for size in (height, width))
    owner = np.repeat(np.repeat(owner, n, axis=0), n, axis=1)
    inside = owner >= 0
    owner = owner[inside]
    mips = [values]
    images: list[SingleArray] = []
    for mip, share in zip(MIPS, seen, strict=True):
        if share <= LEAST_SHARE:
            continue
        lower, part = int(mip), np.float32(mip % 1)
        for scale in range(len(images), lower + 2):
            images.append(interpolated(mips[scale], y / 2**scale, x / 2**scale)[inside])
            mips.append(halved(mips[scale]))
        image = images[lower]
        yield owner, (image + part * (images[lower + 1] - image) if part else image), share


def halved(values: SingleArray) -> SingleArray:
    """The next mip, (h, w) to ((h + 1) // 2, (w + 1) // 2): means of four, edges repeated."""
    padded = np.pad(values, [(0, n % 2) for n in values.shape], mode="edge")
    rows = padded[::2] + padded[1::2]
    return np.asarray((rows[:, ::2] + rows[:, 1::2]) * np.float32(0.25))


def interpolated(values: SingleArray, y: FloatArray, x: FloatArray) -> SingleArray:
    """(len(y), len(x)) bilinear: texels' middles lie at halves, edges are repeated."""
    for axis, at in ((0, y), (1, x)):
        last = values.shape[axis] - 1
        place = np.clip(at - 0.5, 0, last)
        first = place.astype(np.int64)
        part = np.expand_dims((place - first).astype(np.float32), 1 - axis)
        low = values.take(first, axis=axis)
        values = low + part * (values.take(np.minimum(first + 1, last), axis=axis) - low)
    return values


def mapped(alpha: ByteArray, ranks: Ranks, threshold: FloatArray) -> ByteArray:
    """Alpha linear in weight, PASS at the threshold, as steep as 0 to 255 allow in each picture, or
    steeper where too little of that were left below."""
    inside = ranks.owner >= 0
    owner, weight = ranks.owner[inside], ranks.weight[inside].astype(np.float64)
    low, high = np.full(len(threshold), np.inf), np.zeros(len(threshold))
    np.minimum.at(low, owner, weight)
    np.maximum.at(high, owner, weight)
    middle = weight_of(threshold)
    span = np.maximum(np.maximum(middle - low, high - middle), LEAST_SPAN * middle)
    some = (ranks.covered > 0) & (ranks.covered < ranks.area)
    steps = np.maximum(PASS / span, LEAST_LEVELS / np.maximum(middle - low, LEAST_SPAN * middle))
    slope = np.where(some, steps, 0.0)
    grown = ranks.grown
    value = PASS + slope[grown] * (ranks.weight - middle[grown])
    fitted = np.clip(np.round(value), 0, 255).astype(np.uint8)
    return np.where((grown >= 0) & some[grown], fitted, alpha)
