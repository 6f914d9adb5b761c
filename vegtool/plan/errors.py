"""How wrong each level of a species is at each distance: what a budget weighs."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display, Level
from vegtool.measure.pictures import uploaded
from vegtool.measure.scores import scores, truths
from vegtool.measure.views import views
from vegtool.progress import Progress, silent
from vegtool.tiles.library import Species

VIEWS = 4
"""Of each level at each size; a budget is spent by ratios of errors, not by their last digit."""
LARGEST, SMALLEST = 400.0, 6.0
"""Pixels of a plant's longest side: of larger ones the error is that of the largest, which is all
that pictures of one plant tell; of smaller ones that of the smallest."""


def level_errors(
    species: Species, at_m: FloatArray, display: Display, kind: str, progress: Progress = silent
) -> FloatArray:
    """(n, k) FLIP of each level, surfels last, as a client draws it at distances (k,) metres,
    ascending, beside the original: means of VIEWS views. kind: of views, of ELEVATIONS.

    The original's own is what clients' filtering makes of it. Raises InputError for a file that is
    missing or broken, CapabilityError where nothing can draw.
    """
    original = species.levels[0]
    sizes = original.extent * display.pixels_per_metre(1.0) / at_m
    asked, back = np.unique(np.clip(sizes, SMALLEST, LARGEST), return_inverse=True)
    found = []
    with PlantBuffers(original) as buffers:
        truth = truths(original, views(kind, VIEWS), asked.tolist(), display, buffers=buffers)
    known = [int(np.abs(truth.pixels - size).argmin()) for size in asked]
    levels = [Level("mesh", mesh=plant) for plant in species.levels]
    if species.surfels is not None:
        levels.append(Level("surfels", surfels=species.surfels.read()))
    for index, shown in enumerate(levels):
        progress(f"{species.name}: errors", index / len(levels))
        with uploaded(shown) as drawn:
            flip = scores(truth, drawn).values["flip"].mean(axis=1)
        found.append(flip[known][back])
    return np.array(found)
