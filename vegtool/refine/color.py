"""Colours of a level such that what it covers is as bright as the truth.

What a level shows is its colours times light, so its mean brightness is linear in a factor of its
billboards and one of its mesh. Of all pairs of factors that bring it to that of the truth, on
average over views, the nearest to 1 is taken: the part that makes up most of the picture changes
most. Hues stay: where one is wrong on average, more of the wood or of the leaves is seen than
should be, and a tinted trunk would be no remedy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray, Picture
from vegtool.baking.options import BakeOptions
from vegtool.lod import Level
from vegtool.measure.metrics import LUMINANCE
from vegtool.measure.scores import Truths
from vegtool.refine.drawn import drawn
from vegtool.srgb import linear_from_srgb, srgb_from_linear

BRIGHTER = 1.01
"""Than the truth, in linear light. Clients that average the samples of a pixel as encoded, as a
stock three.js does, show edges too dark, and a level is edges more than its plant: by 2 % on
average of five plants, which leaves them as much too dark as those that average light show it too
bright."""
LEAST_GAIN, MOST_GAIN = 0.5, 2.0
"""Farther off, it is not colour that is wrong."""


@dataclass(frozen=True)
class Shares:
    """Of the truth's mean luminance, what billboards and mesh show: means over views, together 1
    where nothing is wrong."""

    billboards: float
    mesh: float


def unbiased_color(level: Level, truths: Truths) -> Level:
    """The level with the colours of its atlas and of its mesh's vertices scaled, by a factor each.

    What is compared is the mean linear luminance of what is covered, over all views and distances
    of the truths, drawn as by a client without anisotropic filtering. A mesh without colours of its
    own stays as it is. Raises CapabilityError where OpenGL cannot draw.
    """
    return scaled(level, *gains(shares(level, truths)))


def shares(level: Level, truths: Truths) -> Shares:
    """Draw the level, then its billboards beside a black mesh, and compare both with the truth."""
    cameras = [camera for row in truths.cameras for camera in row]
    lights = [truths.light(view) for _ in truths.cameras for view in truths.views]
    true = np.array([reference.luminance for row in truths.references for reference in row])
    whole = luminances(drawn(level, cameras, lights))
    known = (true > 0) & (whole > 0)
    if not known.any():
        return Shares(1.0, 0.0)
    total = float((whole[known] / true[known]).mean())
    if level.mesh is None:
        return Shares(total, 0.0)
    if level.atlas is None:
        return Shares(0.0, total)
    part = luminances(drawn(scaled(level, 1.0, 0.0), cameras, lights))
    billboards = float((part[known] / true[known]).mean())
    return Shares(billboards, max(total - billboards, 0.0))


def gains(shown: Shares) -> tuple[float, float]:
    """Factors of billboards and mesh, the nearest to 1 with which the shares sum to BRIGHTER."""
    size = shown.billboards**2 + shown.mesh**2
    step = (BRIGHTER - shown.billboards - shown.mesh) / size if size > 0 else 0.0
    billboards, mesh = (1 + step * part for part in (shown.billboards, shown.mesh))
    return (
        min(max(billboards, LEAST_GAIN), MOST_GAIN),
        min(max(mesh, LEAST_GAIN), MOST_GAIN),
    )


def scaled(level: Level, billboards: float, mesh: float) -> Level:
    """The level with linear colours times these factors; no channel gets brighter than 1."""
    if level.atlas is not None:
        color = level.atlas.color.copy()
        color[..., :3] = factor_table(billboards)[color[..., :3]]
        if level.atlas.white is not None:
            x, y, w, h = level.atlas.white.tolist()
            color[y : y + h, x : x + w] = 255
        if level.atlas.charts is not None:
            of_mesh = factor_table(mesh)
            for x, y, w, h in grown(level.atlas.charts, color.shape).tolist():
                there = np.s_[y : y + h, x : x + w, :3]
                color[there] = of_mesh[level.atlas.color[there]]
        level = replace(level, atlas=replace(level.atlas, color=color))
    if level.mesh is not None and level.mesh.colors is not None:
        colors = level.mesh.colors.copy()
        own = np.ones(len(colors), dtype=bool)  # those of charts are white
        if level.charts is not None:
            own[level.mesh.faces[level.charts.of_face >= 0]] = False
        colors[own, :3] = np.clip(colors[own, :3] * mesh, 0.0, 1.0)
        level = replace(level, mesh=replace(level.mesh, colors=colors))
    return level


def grown(rects: IntArray, shape: tuple[int, ...]) -> IntArray:
    """Rectangles (n, 4) with their gutters, within a picture."""
    gutter = BakeOptions().gutter
    low = np.maximum(rects[:, :2] - gutter, 0)
    high = np.minimum(rects[:, :2] + rects[:, 2:] + gutter, [shape[1], shape[0]])
    return np.concatenate([low, high - low], axis=1)


def factor_table(factor: float) -> ByteArray:
    """(256,) uint8: the sRGB bytes of linear light times a factor."""
    light = np.minimum(linear_from_srgb(np.arange(256) / 255) * factor, 1.0)
    return np.asarray(np.rint(255 * srgb_from_linear(light)), dtype=np.uint8)


def luminances(pictures: Sequence[Picture]) -> FloatArray:
    """(n,) mean linear luminance of what each picture covers; 0 of nothing."""
    sums = np.stack([picture.sum(axis=(0, 1), dtype=np.float64) for picture in pictures])
    return np.asarray(sums[:, :3] @ LUMINANCE / np.maximum(sums[:, 3], 1e-9))
