"""Alpha such that billboards cover as much as the plant does, at every distance.

DESIGN section 4, item 2. Where a texel shows several small things, a test of its coverage at one
half drops them all, and from the side a plane covers less than what it stands for. So the alpha of
billboards that are drawn at about the same distance is multiplied by one factor, until what passes
the test covers as much, seen from all around. It only grows: what covers too much does so at the
silhouette, and less alpha would open seams. Not in Holst and Schumann (2007).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import exp, log

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray, Picture
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Atlas
from vegtool.measure.pictures import truth
from vegtool.measure.views import CLOSEST, Camera, framed, views
from vegtool.progress import Progress, silent
from vegtool.surfels.drawn import drawn_data
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.pictures import pictured

VIEWS = 6
"""From all around."""
SUPERSAMPLE = 4
"""Samples per axis and pixel, of what the plant covers."""
MOST = 8.0
"""Times that alpha may be multiplied. From the side, what is flat covers nothing with any."""
STEPS = 4
"""Halvings of what is between, to a share of 1.14."""
ENOUGH = 0.015
"""Of what is covered: as near is near enough."""
BAND = 2.0
"""Times the error of the finest, that those of a band have at most."""


def covered_alike(model: SurfelModel, progress: Progress = silent) -> SurfelModel:
    """The same model with other alpha. Raises CapabilityError where nothing can draw."""
    error, raw = model.hierarchy.error, model.textures.atlas
    if not len(error):
        return model
    band = np.floor(np.log(error / error.min()) / log(BAND)).astype(int)
    factors = np.ones(int(band.max()) + 1)
    with PlantBuffers(model.plant) as original, SurfelBuffers(drawn_data(model)) as surfels:
        for number in np.unique(band).tolist():
            cameras = _cameras(model, float(error[band == number].max()))
            wanted = _covered(partial(truth, original, supersample=SUPERSAMPLE), cameras)
            low, high = 0.0, log(MOST)
            for step in range(STEPS + 1):
                middle = (low + high) / 2 if step else low
                factors[number] = exp(middle)
                surfels.repaint(_multiplied(raw, factors[band]))
                found = _covered(partial(pictured, surfels, model), cameras)
                if abs(found - wanted) <= ENOUGH * wanted or (found > wanted and not step):
                    break
                low, high = (low, middle) if found > wanted else (middle, high)
            progress("coverage", (number + 1) / len(factors))
    atlas = replace(raw, color=_multiplied(raw, factors[band]))
    return replace(model, textures=replace(model.textures, atlas=atlas))


def _cameras(model: SurfelModel, error: float) -> list[Camera]:
    """From where what has such an error is drawn first."""
    plant = model.plant
    metres = error * model.display.pixels_per_metre(1.0) / model.options.epsilon + plant.radius
    away = max(metres, 1.01 * CLOSEST * plant.radius)
    return [
        framed(plant.center, plant.radius, view.direction, away, model.display)
        for view in views("all", VIEWS)
    ]


def _covered(picture: Callable[[Camera], Picture], cameras: Sequence[Camera]) -> float:
    """Pixels, in all."""
    return float(sum(picture(camera)[..., 3].sum() for camera in cameras))


def _multiplied(atlas: Atlas, factor: FloatArray) -> ByteArray:
    """The colours of an atlas with each billboard's alpha times its factor, (b,)."""
    own = (atlas.back != atlas.front).any(axis=1)
    rects = np.concatenate([atlas.front, atlas.back[own]])
    factors: npt.NDArray[np.float64] = np.concatenate([factor, factor[own]])
    grown = np.flatnonzero(factors > 1)
    color = atlas.color.copy()
    for (x, y, w, h), by in zip(rects[grown].tolist(), factors[grown].tolist(), strict=True):
        alpha = color[y : y + h, x : x + w, 3]
        alpha[:] = np.minimum(np.rint(alpha * by), 255)
    return color
