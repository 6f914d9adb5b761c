"""Textures of a plant with no more texels than any eye of a scene can tell apart.

A client shows a texture's mip in which a texel is about as large as a pixel, along the side of the
pixel's footprint that is shorter: with anisotropy, and without it a coarser one. So texels that are
smaller than a pixel in every direction on the surface, from as near as any eye is, are never shown,
and the mip without them may stand for the texture: the client's own, plain averages, so that it
shows the same. Of what is cut out, averages lose some in each mip. Viewers that make up for that do
so by what the file has, so such a texture is halved only as long as about as much of it is shown.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.mipmaps import mip_levels, passing
from vegtool.limits import Limits
from vegtool.plant import Material, Plant, Texture

COARSE = 0.01
"""Of a material's area, how much may have texels that end up larger than a pixel: slivers, which
some faces of every model are."""
LEAST = 4
"""Texels of a side."""
SHOWN = 0.02
"""Of what passes the alpha test, by how much a halved texture may differ."""


def seen_textures(plant: Plant, limits: Limits) -> Plant:
    """The plant with each texture halved as often as nobody sees; itself where none is."""
    focal_px = limits.display.pixels_per_metre(1.0)
    pixels = focal_px / np.maximum(nearest_m(plant, limits), 1e-9)  # to the metre
    times = dict[int, int]()
    for index, material in enumerate(plant.materials):
        faces = np.flatnonzero(plant.face_material == index)
        for texture in material.textures:
            most = _halvings(plant, faces, texture, pixels[faces])
            times[id(texture)] = min(times.get(id(texture), most), most)
    made = dict[int, Texture]()
    materials = tuple(_reduced(material, times, made) for material in plant.materials)
    return replace(plant, materials=materials) if made else plant


def nearest_m(plant: Plant, limits: Limits) -> FloatArray:
    """(f,) metres: no eye is nearer to a face, wherever it is within the limits' distances and
    elevations, all around. A point of a face is within its longest edge / sqrt(3) of a corner."""
    offset = plant.corners - np.array(limits.middle_m)
    beside, up = np.hypot(offset[..., 0], offset[..., 2]), offset[..., 1]
    away, angle = np.hypot(beside, up), np.arctan2(up, beside)
    low, high = np.radians(limits.elevation_deg)
    turn = np.abs(angle - np.clip(angle, low, high))
    along = np.maximum(limits.nearest_m, away * np.cos(turn))  # where on the cone, or before it
    there = np.sqrt(np.maximum(away**2 + along**2 - 2 * away * along * np.cos(turn), 0.0))
    inside = (turn == 0) & (away >= limits.nearest_m)
    edge = np.linalg.norm(plant.corners - np.roll(plant.corners, 1, axis=1), axis=2).max(axis=1)
    least = np.where(inside, 0.0, there).min(axis=1) - edge / np.sqrt(3)
    return np.asarray(np.maximum(least, 0.0))


def texels_per_metre(plant: Plant, faces: np.ndarray, texture: Texture) -> FloatArray:
    """(n,) of some faces (n,), in the direction in which there are fewest; 0 where a face shows no
    more than a line of the texture."""
    size = np.array(texture.pixels.shape[1::-1], np.float64)
    corners, uvs = plant.corners[faces], plant.uvs[plant.faces[faces]] * size
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    texels = np.stack([uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]], axis=2)
    frame = np.linalg.qr(edges)[1]  # the edges in the plane of their face
    flat = np.abs(frame[:, 0, 0] * frame[:, 1, 1]) <= 0
    frame[flat] = np.eye(2)
    found = np.linalg.svd(texels @ np.linalg.inv(frame), compute_uv=False)[:, 1]
    return np.where(flat, 0.0, found)


def _halvings(plant: Plant, faces: np.ndarray, texture: Texture, pixels: FloatArray) -> int:
    """How often a texture may be halved for faces (n,), of which a metre is (n,) pixels at most."""
    spare = texels_per_metre(plant, faces, texture) / pixels
    shown = np.flatnonzero(spare > 0)  # what shows one texel shows it whatever its size
    if not len(shown):
        return 0
    order = shown[np.argsort(spare[shown], kind="stable")]
    area = np.cumsum(plant.face_areas[faces][order])
    least = spare[order[np.searchsorted(area, COARSE * area[-1])]]
    return max(0, int(np.floor(np.log2(least))))


def _reduced(material: Material, times: dict[int, int], made: dict[int, Texture]) -> Material:
    """A material with its textures halved so many times, by their id; made: what was."""
    cutoff = None
    if material.alpha_mode == "mask" and material.base_color[3] > 0:
        cutoff = float(material.alpha_cutoff / material.base_color[3])

    def of(texture: Texture | None, srgb: bool, cutoff: float | None = None) -> Texture | None:
        if texture is None or not times[id(texture)]:
            return texture
        if id(texture) not in made:
            smaller = _halved(texture, times[id(texture)], srgb, cutoff)
            if smaller is texture:
                return texture
            made[id(texture)] = smaller
        return made[id(texture)]

    return replace(
        material,
        color_texture=of(material.color_texture, True, cutoff),
        normal_texture=of(material.normal_texture, False),
        light_texture=of(material.light_texture, False),
    )


def _halved(texture: Texture, times: int, srgb: bool, cutoff: float | None) -> Texture:
    """As often as both sides are even and not too small, so that texels meet as they did, and as
    much is cut out."""
    found = texture.pixels
    shown = 0.0 if cutoff is None else passing(found, cutoff)
    levels = pairwise([found, *mip_levels(found, srgb)])
    for (before, after), _ in zip(levels, range(times), strict=False):
        if any(side % 2 or side < 2 * LEAST for side in before.shape[:2]):
            break
        if cutoff is not None and abs(passing(after, cutoff) - shown) > SHOWN * shown:
            break
        found = after
    return texture if found is texture.pixels else Texture(texture.name, found)
