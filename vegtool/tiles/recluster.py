"""A square as fewer billboards: those of its quarters clustered anew, and baked again.

Colditz, Coconu, Deussen, Hege: Real-time rendering of complex photorealistic landscapes using
hybrid level-of-detail approaches (2005), introduction: "representing models and parts of the scene
by dynamically changing sets of billboards". The group of a square's quarters is to a tile what a
plant is to a level: planes are fitted to its billboards, their pictures baked from them, and alpha
and colour solved until as much is covered, and as bright, as of the quarters (refine/level.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display, Level
from vegtool.measure.scores import TruthsAt
from vegtool.measure.views import View, direction
from vegtool.plant import Material, Plant
from vegtool.refine.level import Wanted, leaf_pixels, refined_level, source_of

SMALL = 12.0
"""Pixels: side of a square as large as what one triangle covers, up to which one colour serves
better than a picture (refine/level.py)."""
SUN = direction(135.0, 45.0)
VIEWS = tuple(
    View(direction(azimuth, elevation), SUN)
    for azimuth, elevation in ((20.0, 2.0), (110.0, 10.0), (200.0, 25.0), (290.0, 50.0))
)
"""From where squares are looked at: mostly by walkers, who see them from the side."""


def group_of(quarters: Sequence[Plant], places: Sequence[FloatArray], name: str) -> Plant:
    """Quarters as one plant, each moved by (3,) metres, with the materials of each."""
    materials: list[Material] = []
    arrays: dict[str, list[np.ndarray]] = {
        key: [] for key in ("positions", "normals", "uvs", "faces", "face_material", "colors")
    }
    first = 0
    for quarter, place in zip(quarters, places, strict=True):
        start = len(materials)
        materials += [replace(m, role="leaf") for m in quarter.materials]
        colors = np.ones((len(quarter.positions), 4)) if quarter.colors is None else quarter.colors
        arrays["positions"].append(quarter.positions + place)
        arrays["normals"].append(quarter.normals)
        arrays["uvs"].append(quarter.uvs)
        arrays["faces"].append(quarter.faces + first)
        arrays["face_material"].append(quarter.face_material + start)
        arrays["colors"].append(colors)
        first += len(quarter.positions)
    joined = {key: np.concatenate(parts) for key, parts in arrays.items()}
    return Plant(
        name, joined["positions"], joined["normals"], joined["uvs"],
        joined["faces"].astype(np.int32), joined["face_material"].astype(np.int32),
        tuple(materials), joined["colors"],
    )  # fmt: skip


def reclustered(
    group: Plant, triangles: int, near_m: float, display: Display, max_texture: int
) -> Level:
    """A level of at most so many triangles, for distances from `near_m` metres to its middle on.

    Raises CapabilityError where nothing can draw.
    """
    pixel_m = 1 / display.pixels_per_metre(near_m)
    with PlantBuffers(group) as buffers:
        source = source_of(buffers, TruthsAt(group, VIEWS, display, buffers))
        textured = leaf_pixels(source, triangles, pixel_m) > SMALL
        wanted = Wanted(triangles, near_m, max_texture, balance=False, textured=textured)
        return refined_level(source, wanted)
