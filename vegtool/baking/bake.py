"""Billboards baked into an atlas: colour with coverage, normals and depth in one pass.

Colditz et al. 2005, section 3 (textures of billboard clouds), with DESIGN section 4: sources are
supersampled without mips, averages are taken in linear light, alpha is coverage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import sqrt
from time import perf_counter
from typing import Literal

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.baking.dilate import nearest_covered
from vegtool.baking.pack import Packing, pack
from vegtool.errors import UsageError
from vegtool.gl.pictures import Drawn, Pictures, draw_pictures
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Atlas, Billboards
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

Sides = Literal["auto", "double", "opposite"]

MOST_SAMPLES = 8
"""Samples per axis that small atlases are raised to; alpha then has 64 steps."""
CHEAP_SAMPLES = 2_000_000
"""Samples of an atlas up to which more of them per texel cost little."""


@dataclass(frozen=True)
class BakeOptions:
    """How a level is baked.

    supersample: samples per axis and texel; small atlases take up to 8, where it costs little.
    gutter: texels around each picture; two on each side keep neighbours apart for two mips.
    max_texture: texels, the longest side of an atlas; the density is lowered to fit.
    sides: one picture per billboard for both sides ("double"), one for each ("opposite"), or
    whichever the plant needs ("auto", by measuring how much front and back differ).
    """

    supersample: int = 4
    gutter: int = 2
    max_texture: int = 2048
    sides: Sides = "auto"


@dataclass(frozen=True, eq=False)
class Baked:
    """A level's textures.

    texels_per_metre: the density used, lower than asked for where max_texture forbade it.
    fill: share of the atlas taken by pictures and their gutters. seconds: by stage.
    """

    billboards: Billboards
    atlas: Atlas
    double_sided: bool
    texels_per_metre: float
    supersample: int
    fill: float
    seconds: Mapping[str, float] = field(default_factory=dict)


def bake(
    plant: Plant | PlantBuffers,
    labels: IntArray,
    billboards: Billboards,
    texels_per_metre: float,
    options: BakeOptions | None = None,
    progress: Progress = silent,
) -> Baked:
    """Bake the faces of each cluster into the pictures of the billboards that show it.

    plant: give PlantBuffers to bake several levels from one upload. labels: (f,) int32 cluster of
    each face, matching `billboards.cluster`; faces of clusters that no billboard shows are left
    out. Raises UsageError where the pictures cannot fit into max_texture at any density, and
    CapabilityError where there is no OpenGL.
    """
    options = options or BakeOptions()
    if isinstance(plant, Plant):
        with PlantBuffers(plant) as buffers:
            return bake(buffers, labels, billboards, texels_per_metre, options, progress)
    seconds: dict[str, float] = {}
    progress("bake", 0.0)
    started = perf_counter()
    face, shown_by = pairs(labels, billboards.cluster)
    seconds["pairs"] = perf_counter() - started

    started = perf_counter()
    packing, density = fit(billboards.half_size, texels_per_metre, options)
    seconds["pack"] = perf_counter() - started

    samples = supersample(packing, options)
    pictures = Pictures(
        billboards.center,
        billboards.u,
        billboards.v,
        billboards.half_size,
        billboards.half_depth,
        np.ones(len(billboards), dtype=np.int32),
        packing.rect,
    )
    size = (packing.width, packing.height)
    drawn = draw_pictures(plant, pictures, face, shown_by, size, samples)
    seconds |= drawn.seconds
    progress("bake", 0.8)

    started = perf_counter()
    atlas = dilated(drawn, packing)
    seconds["dilate"] = perf_counter() - started
    progress("bake", 1.0)
    return Baked(billboards, atlas, True, density, samples, packing.fill, seconds)


def pairs(labels: IntArray, cluster: IntArray) -> tuple[IntArray, IntArray]:
    """(m,), (m,) int32: every face with every billboard that shows its cluster."""
    count = max(int(labels.max(initial=-1)), int(cluster.max(initial=-1))) + 1
    order = np.argsort(cluster, kind="stable").astype(np.int32)
    shown = np.bincount(cluster, minlength=count)
    first = np.cumsum(shown) - shown
    times = shown[labels]
    face = np.repeat(np.arange(len(labels), dtype=np.int32), times)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(times) - times, times)
    return face, order[np.repeat(first[labels], times) + nth]


def fit(
    half_size: FloatArray, texels_per_metre: float, options: BakeOptions
) -> tuple[Packing, float]:
    """Pictures in whole texels, packed; the density is lowered until max_texture holds them."""
    density = texels_per_metre
    while True:
        sizes = np.maximum(1, np.rint(2 * density * half_size)).astype(np.int32)
        area = float(np.prod(sizes.astype(np.float64) + 2 * options.gutter, axis=1).sum())
        excess = area / options.max_texture**2
        if excess <= 1 and int(sizes.max()) + 2 * options.gutter <= options.max_texture:
            packing = pack(sizes, options.gutter, options.max_texture)
            excess = packing.height / options.max_texture
            if excess <= 1:
                return packing, density
        if sizes.max() == 1:
            raise UsageError(
                f"{len(half_size)} billboards do not fit into a texture of {options.max_texture} x "
                f"{options.max_texture} texels, even with one texel each. Ask for fewer "
                f"billboards (--billboards) or allow a larger texture (--max-texture)."
            )
        density *= min(0.95, 1 / sqrt(excess))


def supersample(packing: Packing, options: BakeOptions) -> int:
    """Samples per axis: what was asked for, and more where the whole atlas stays cheap."""
    cheap = int(sqrt(CHEAP_SAMPLES / (packing.width * packing.height)))
    return max(options.supersample, min(MOST_SAMPLES, cheap))


def dilated(drawn: Drawn, packing: Packing) -> Atlas:
    """The atlas with colour and normals carried under alpha 0; alpha and depth as they are."""
    covered = drawn.color[..., 3] > 0
    nearest = nearest_covered(covered, packing.rect, packing.gutter)
    color = drawn.color.reshape(-1, 4)[nearest]
    color[..., 3] = drawn.color[..., 3]
    normal = drawn.normal.reshape(-1, 3)[nearest]
    return Atlas(color, normal, drawn.depth, packing.rect, packing.rect)
