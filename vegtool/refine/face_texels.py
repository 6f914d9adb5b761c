"""What textures show on faces: their mean colour, and how much of them alpha leaves."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray, IntArray
from vegtool.plant import Plant
from vegtool.srgb import linear_from_srgb

MOST_TEXELS = 256
"""A side: textures are averaged down to this before any texel is taken for its colour."""
WITHIN = np.array(
    [[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2], [1, 2.5, 2.5], [2.5, 1, 2.5], [2.5, 2.5, 1]]
) / 6  # fmt: skip
"""(7, 3) barycentric: where on a face texels are taken."""


def texels(image: npt.NDArray[Any], uv: FloatArray) -> npt.NDArray[Any]:
    """(..., c) the nearest texels of an image (h, w, c) at places (..., 2), which repeats."""
    height, width = image.shape[:2]
    uv = uv - np.floor(uv)
    x = np.minimum((uv[..., 0] * width).astype(np.int64), width - 1)
    y = np.minimum((uv[..., 1] * height).astype(np.int64), height - 1)
    return np.asarray(image[y, x])


def face_colors(plant: Plant, faces: IntArray) -> FloatArray:
    """(k, 3) linear mean colours of faces (k,), texture x factor x vertex colour, as if all of each
    were opaque."""
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
            uv = np.einsum("pc,fci->fpi", WITHIN, plant.uvs[corners[own]])
            result[own] *= texels(smaller(texture.pixels), uv).mean(axis=1)
    return result


def opacities(plant: Plant, faces: IntArray) -> FloatArray:
    """(k,) how much of each of the faces (k,) their materials do not cut away."""
    result = np.ones(len(faces))
    material = plant.face_material[faces]
    for number in np.unique(material):
        surface = plant.materials[number]
        if surface.alpha_mode != "mask":
            continue
        own = np.flatnonzero(material == number)
        alpha: npt.NDArray[Any] = np.ones((len(own), 1))
        if surface.color_texture is not None:
            uv = np.einsum("pc,fci->fpi", WITHIN, plant.uvs[plant.faces[faces[own]]])
            alpha = texels(surface.color_texture.pixels[..., 3], uv) / 255
        result[own] = (alpha * surface.base_color[3] >= surface.alpha_cutoff).mean(axis=1)
    return result


def smaller(pixels: ByteArray) -> FloatArray:
    """(h, w, 3) linear light of an image, averaged in blocks to at most MOST_TEXELS a side."""
    light = linear_from_srgb(np.arange(256) / 255)
    height, width = pixels.shape[:2]
    down, across = -(-height // MOST_TEXELS), -(-width // MOST_TEXELS)
    rows, columns = height // down, width // across
    kept = light[pixels[: rows * down, : columns * across, :3]]
    return np.asarray(kept.reshape(rows, down, columns, across, 3).mean(axis=(1, 3)))
