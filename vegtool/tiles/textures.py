"""Models with smaller textures.

Clients keep the textures of a model that tiles share once for every tile. What smaller ones save,
and what pictures lose by them, is in docs/tile_clients.md.

What a picture shows of a texture: L. Williams, "Pyramidal parametrics" (1983): the mip at which a
texel is as large as a pixel, and the next coarser one. Clients that filter anisotropically take the
mip by the footprint's narrow side, which a face seen from the front has to all sides: so all faces
are counted as seen from the front.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, log2

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.mipmaps import mip_levels
from vegtool.plant import Plant, Texture

WIDELY_SPREAD = 0.001
"""Of the area that shows a texture, the part on which texels may be larger than they are taken to
be: slivers, whose texels are as large as one likes."""
LEAST_PIXELS = 1e-6
"""To a metre: less is seen of nothing."""
ROUNDING = 1e-6
"""Of halvings."""
FEWEST = 4
"""Texels on a side, below which no texture is made smaller."""


def limited(plant: Plant, most: int) -> Plant:
    """A plant whose colour textures have no side above `most` texels, and whose normal textures
    none above half of that: those that have are halved until they have none, by plain averages, of
    colours in linear light, as a client makes its mips.

    Averages that keep as much above the alpha cutoff gave worse pictures: levels are baked such
    that what clients make of them by plain ones is right.
    """

    def of(texture: Texture | None, side: int, srgb: bool) -> Texture | None:
        if texture is None or max(texture.pixels.shape[:2]) <= side:
            return texture
        small = (p for p in mip_levels(texture.pixels, srgb) if max(p.shape[:2]) <= side)
        return Texture(texture.name, next(small))

    materials = tuple(
        replace(
            one,
            color_texture=of(one.color_texture, most, True),
            normal_texture=of(one.normal_texture, most // 2, False),
        )
        for one in plant.materials
    )
    return replace(plant, materials=materials)


def resolved(plant: Plant, per_metre: float) -> Plant:
    """A plant whose textures have no texels that are too small to be seen, where no metre of it is
    more than so many pixels: they are halved, as a client makes its mips, as long as a texel stays
    no larger than a pixel."""
    if per_metre == inf:
        return plant

    def of(texture: Texture | None, faces: np.ndarray, srgb: bool) -> Texture | None:
        if texture is None:
            return None
        high, wide = texture.pixels.shape[:2]
        density = texels_per_metre(plant, faces, wide, high)
        if density <= per_metre or min(wide, high) <= FEWEST:
            return texture
        fine, least = density / max(per_metre, LEAST_PIXELS), min(wide, high) / FEWEST
        halvings = int(log2(min(fine, least)) + ROUNDING)
        if not halvings:
            return texture
        mips = mip_levels(texture.pixels, srgb)
        return Texture(texture.name, [next(mips) for _ in range(halvings)][-1])

    materials = []
    for index, one in enumerate(plant.materials):
        faces = plant.faces[plant.face_material == index]
        materials.append(
            replace(
                one,
                color_texture=of(one.color_texture, faces, True),
                normal_texture=of(one.normal_texture, faces, False),
            )
        )
    return replace(plant, materials=tuple(materials))


def texels_per_metre(plant: Plant, faces: np.ndarray, wide: int, high: int) -> float:
    """Of a texture of that size on faces (f, 3) in the direction in which it is stretched most: no
    more than on all but WIDELY_SPREAD of their area; 0 where they have none."""
    if not len(faces):
        return 0.0
    edges, spans = (
        np.stack([at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]], axis=1)
        for at in (plant.positions[faces], plant.uvs[faces] * [wide, high])
    )
    metric = edges @ edges.transpose(0, 2, 1)
    area = np.sqrt(np.maximum(np.linalg.det(metric), 0.0))
    there = area > 0
    if not there.any():
        return 0.0
    least = _least_stretch(metric[there], spans[there])
    order = np.argsort(least)
    share = np.cumsum(area[there][order]) / area[there].sum()
    return float(least[order][np.searchsorted(share, WIDELY_SPREAD)])


def _least_stretch(metric: FloatArray, spans: FloatArray) -> FloatArray:
    """(f,) the smaller singular value of the maps from places to texels, of faces whose edges have
    dot products (f, 2, 2) and span (f, 2, 2) texels."""
    square = spans @ spans.transpose(0, 2, 1)
    (a, b), (c, d) = metric[:, 0].T, square[:, 0].T
    size = np.linalg.det(metric)
    trace = (metric[:, 1, 1] * c + a * square[:, 1, 1] - 2 * b * d) / size
    product = np.maximum(np.linalg.det(square) / size, 0.0)
    root = np.sqrt(np.maximum(trace * trace / 4 - product, 0.0))
    return np.asarray(np.sqrt(np.maximum(trace / 2 - root, 0.0)))
