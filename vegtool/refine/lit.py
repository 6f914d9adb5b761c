"""A plant with its light in the colours of its vertices: what levels without textures are made of.

Pictures have their light baked fragment by fragment (baking/bake.py); triangles that stand for many
leaves take the mean of theirs. It is found at a few places of each face by the numpy references of
what the GPU does (lighting/), from the same depth maps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.lighting.shadow import SunDepths, sun_visible
from vegtool.plant import Plant
from vegtool.refine.face_texels import WITHIN
from vegtool.refine.occlusion import at_vertices

MOST_PLACES = 150_000
"""Of all faces; on each there is one at least, and no more than of WITHIN."""


def lit_plant(plant: Plant, light: Light, depths: SunDepths) -> Plant:
    """The plant with vertex colours times the light that falls on it, and nothing left to light.

    A face that is seen from both sides has the mean of their light; colours stay at 1 at most.
    """
    factor = at_vertices(plant, face_light(plant, light, depths))
    colors = np.ones((len(plant.positions), 4)) if plant.colors is None else plant.colors.copy()
    colors[:, :3] = np.clip(colors[:, :3] * factor, 0.0, 1.0)
    materials = tuple(replace(m, unlit=True, transmission=0.0) for m in plant.materials)
    return replace(plant, colors=colors, exposure=None, materials=materials)


def face_light(plant: Plant, light: Light, depths: SunDepths) -> FloatArray:
    """(f, 3) mean light on each face, as a factor of its albedo; 1 where it is unlit."""
    count = int(np.clip(MOST_PLACES // len(plant.faces), 1, len(WITHIN)))
    side = unit(plant.face_area_vectors / (plant.radius or 1.0) ** 2)
    both = np.array([m.double_sided for m in plant.materials])[plant.face_material]
    share = np.array([m.transmission for m in plant.materials])[plant.face_material]
    tint = np.array([m.transmission_tint for m in plant.materials])[plant.face_material]
    white = np.ones((len(plant.faces), 3))
    total = np.zeros((len(plant.faces), 3))
    for place in WITHIN[:count] if count > 1 else np.full((1, 3), 1 / 3):
        position = np.einsum("c,fci->fi", place, plant.corners)
        normal = unit(np.einsum("c,fci->fi", place, plant.normals[plant.faces]))
        exposure = None
        if plant.exposure is not None:
            exposure = np.einsum("c,fci->fi", place, plant.exposure[plant.faces])
        seen = sun_visible(position, side, depths)
        front = shaded(white, normal, light, exposure, share, tint, seen, seen)
        other = None if exposure is None else exposure[:, ::-1]
        back = shaded(white, -normal, light, other, share, tint, seen, seen)
        total += np.where(both[:, None], (front + back) / 2, front)
    unlit = np.array([m.unlit for m in plant.materials])[plant.face_material]
    return np.where(unlit[:, None], 1.0, total / count)
