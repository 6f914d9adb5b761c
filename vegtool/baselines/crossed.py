"""The classic tree of old games: two crossed upright billboards of the whole plant."""

from __future__ import annotations

import numpy as np

from vegtool.baking.bake import bake
from vegtool.lod import Billboards, Level
from vegtool.plant import Plant

TEXELS = 256
"""Along the plant's longest side. From 200 pixels on it is more than one texel per pixel."""
LEAST_SIDE = 1e-3
"""Of the plant's radius: half a picture's side at least, for plants that are flat."""


def crossed(plant: Plant) -> Level:
    """Two billboards of all faces, one facing z and one facing x, baked as our own levels are.

    They cross in the surface's mean, which is where a plane shows the surface with the least
    displacement, and end at the plant's bounds. Raises CapabilityError where there is no OpenGL.
    """
    low, high = plant.bounds
    half = np.maximum((high - low) / 2, LEAST_SIDE * (plant.radius or 1.0))
    area = plant.face_areas
    weights = area if area.sum() > 0 else np.ones_like(area)
    mean = np.average(plant.face_centroids, axis=0, weights=weights)
    center = np.tile(plant.center, (2, 1))
    center[0, 2], center[1, 0] = mean[2], mean[0]
    depth = half[[2, 0]] + np.abs(mean - plant.center)[[2, 0]]
    billboards = Billboards(
        center=center,
        u=np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
        v=np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]),
        half_size=np.stack([half[[0, 1]], half[[2, 1]]]),
        half_depth=depth,
        cluster=np.zeros(2, np.int32),
    )
    density = TEXELS / (2 * half.max())
    return bake(plant, np.zeros(len(plant.faces), np.int32), billboards, density)
