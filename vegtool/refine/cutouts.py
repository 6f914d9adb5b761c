"""What of each face its alpha leaves: how much, where on the face, and of which colour.

Leaf cards repeat: faces that show the same three places of one texture are looked up once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.plant import Material, Plant
from vegtool.refine.face_texels import texels
from vegtool.srgb import linear_from_srgb

ROWS = 32
"""Cells along an edge of a face, at most; about half its square are looked up."""
LOOKUPS = 6_000_000
"""At most; faces that are all different get fewer cells each."""


@dataclass(frozen=True, eq=False)
class Cutouts:
    """Of n faces. mask: (m, rows, rows) bool, whether a cell of barycentric coordinates is covered;
    those of the second corner run along the first axis, those of the third along the other.
    which: (n,) the mask of each face. share: (n,) that is covered. color: (n, 3) linear, of what
    is. at: (n, 3) barycentric, its centroid. moment: (n, 3, 3) of the coordinates about it.
    """

    mask: npt.NDArray[np.bool_]
    which: npt.NDArray[np.int64]
    share: FloatArray
    color: FloatArray
    at: FloatArray
    moment: FloatArray

    def covered(self, face: npt.NDArray[np.int64], at: FloatArray) -> npt.NDArray[np.bool_]:
        """(h,) whether faces (h,) are covered at barycentric coordinates (h, 2), those of their
        second and third corners."""
        rows = self.mask.shape[1]
        cell = np.clip((at * rows).astype(np.int64), 0, rows - 1)
        return np.asarray(self.mask[self.which[face], cell[:, 0], cell[:, 1]])


def cutouts(plant: Plant, faces: IntArray) -> Cutouts:
    """Of some faces of a plant, (n,) indices."""
    corners = plant.faces[faces]
    which, example = same_pictures(plant, faces)
    rows = int(np.clip(np.sqrt(2 * LOOKUPS / len(example)), 4, ROWS))
    mask, color, at, moment = _looked_up(plant, faces[example], rows)
    tint = np.ones((len(faces), 3))
    if plant.colors is not None:
        tint = plant.colors[corners, :3].mean(axis=1)
    weight = _cells(rows)[1]
    share = (mask * weight).sum(axis=(1, 2))
    return Cutouts(mask, which, share[which], color[which] * tint, at[which], moment[which])


def same_pictures(
    plant: Plant, faces: IntArray
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(n,) labels of faces (n,), equal where they show the same of one material, and for each
    label the first face that has it."""
    used, corner = np.unique(plant.faces[faces], return_inverse=True)
    u, v = plant.uvs[used].T
    place = np.unique(u + 1j * v, return_inverse=True)[1][corner].reshape(-1, 3)
    key = plant.face_material[faces].astype(np.int64)
    for column in place.T:
        key = np.unique(key * (int(place.max()) + 1) + column, return_inverse=True)[1]
    _, example, which = np.unique(key, return_index=True, return_inverse=True)
    return which, example


def _looked_up(
    plant: Plant, faces: IntArray, rows: int
) -> tuple[npt.NDArray[np.bool_], FloatArray, FloatArray, FloatArray]:
    """Masks, colours, centroids and moments of faces."""
    at, weight = _cells(rows)
    mask = np.zeros((len(faces), rows, rows), dtype=bool)
    color = np.ones((len(faces), 3))
    inside = weight > 0
    where, weight = at[inside], weight[inside]
    material = plant.face_material[faces]
    for number in np.unique(material):
        own = np.flatnonzero(material == number)
        uv = np.einsum("pc,fci->fpi", where, plant.uvs[plant.faces[faces[own]]])
        covered, light = _texels(plant.materials[number], uv)
        part = covered * weight
        color[own] = np.einsum("fp,fpc->fc", part, light) / _positive(part.sum(axis=1))[:, None]
        mask[own[:, None], *np.nonzero(inside)] = covered
    part = mask[:, inside] * weight
    total = _positive(part.sum(axis=1))
    mean = part @ where / total[:, None]
    square = np.einsum("fp,pi,pj->fij", part, where, where, optimize=True)
    return mask, color, mean, square / total[:, None, None] - mean[:, :, None] * mean[:, None]


def _texels(material: Material, uv: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """(f, p) whether places (f, p, 2) are covered, and (f, p, 3) their linear colours."""
    factor = material.base_color
    covered = np.ones(uv.shape[:2], dtype=bool)
    if material.color_texture is None:
        if material.alpha_mode == "mask":
            covered[:] = factor[3] >= material.alpha_cutoff
        return covered, np.broadcast_to(factor[:3], (*uv.shape[:2], 3))
    texel = texels(material.color_texture.pixels, uv)
    if material.alpha_mode == "mask":
        covered = texel[..., 3] * (factor[3] / 255) >= material.alpha_cutoff
    light = linear_from_srgb(np.arange(256) / 255)
    return covered, light[texel[..., :3]] * factor[:3]


def _cells(rows: int) -> tuple[FloatArray, FloatArray]:
    """(rows, rows, 3) barycentric middles of the parts of cells that lie on a face, and (rows,
    rows) their shares of it."""
    i, j = np.meshgrid(np.arange(rows), np.arange(rows), indexing="ij")
    half = i + j == rows - 1
    middle = np.where(half, 1 / 3, 1 / 2)
    second, third = (i + middle) / rows, (j + middle) / rows
    weight = np.where(i + j < rows - 1, 2.0, np.where(half, 1.0, 0.0)) / rows**2
    return np.stack([1 - second - third, second, third], axis=-1), weight


def _positive(values: FloatArray) -> FloatArray:
    return np.where(values > 0, values, 1.0)
