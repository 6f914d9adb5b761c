"""The mean colour of faces: texture x factor x vertex colour, in linear light."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray
from vegtool.plant import Plant
from vegtool.srgb import linear_from_srgb

MOST_TEXELS = 256
"""A side: textures are averaged down to this before any texel is taken."""
WITHIN = np.array(
    [[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2], [1, 2.5, 2.5], [2.5, 1, 2.5], [2.5, 2.5, 1]]
) / 6  # fmt: skip
"""(7, 3) barycentric: where on a face texels are taken."""


def face_colors(plant: Plant, faces: IntArray) -> FloatArray:
    """(k, 3) linear mean colours of faces (k,), as if all of each were opaque."""
    corners = plant.faces[faces]
    result = np.ones((len(faces), 3))
    if plant.colors is not None:
        result *= plant.colors[corners, :3].mean(axis=1)
    material = plant.face_material[faces]
    for number in np.unique(material):
        own = np.flatnonzero(material == number)
        result[own] *= plant.materials[number].base_color[:3]
        texture = plant.materials[number].color_texture
        if texture is not None:
            image = smaller(texture.pixels)
            uv = np.einsum("pc,fci->fpi", WITHIN, plant.uvs[corners[own]])
            height, width = image.shape[:2]
            uv -= np.floor(uv)
            x = np.minimum((uv[..., 0] * width).astype(np.int64), width - 1)
            y = np.minimum((uv[..., 1] * height).astype(np.int64), height - 1)
            result[own] *= image[y, x].mean(axis=1)
    return result


def smaller(pixels: ByteArray) -> FloatArray:
    """(h, w, 3) linear light of an image, averaged in blocks to at most MOST_TEXELS a side."""
    light = linear_from_srgb(np.arange(256) / 255)
    height, width = pixels.shape[:2]
    down, across = -(-height // MOST_TEXELS), -(-width // MOST_TEXELS)
    rows, columns = height // down, width // across
    kept = light[pixels[: rows * down, : columns * across, :3]]
    return np.asarray(kept.reshape(rows, down, columns, across, 3).mean(axis=(1, 3)))
