"""From a plant to its surfels in progressive order.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import Picture, unit
from vegtool.baking.bake import transmission_tint
from vegtool.gl.upload import PlantBuffers
from vegtool.measure.pictures import truth
from vegtool.measure.views import Camera
from vegtool.progress import Progress, silent
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.averaged import averaged
from vegtool.surfels.blue.candidates import RESOLUTION, Candidates, enough
from vegtool.surfels.blue.covering import sizes
from vegtool.surfels.blue.distances import spacing
from vegtool.surfels.blue.farthest import farthest_order

NORMALS = 2.0
"""What a unit of difference of normals counts as where values are means, in distances between
points: opposite sides, and leaves that cross, are not mixed."""
SUPERSAMPLE = 4
"""Samples per axis and pixel of what coverage is compared with."""
SEEN = 0.4
ORDERED = 0.6
"""Shares of the progress that candidates and their order are done at."""


def surfels_of(
    buffers: PlantBuffers,
    count: int,
    *,
    seed: int = 0,
    resolution: int = RESOLUTION,
    progress: Progress = silent,
) -> SurfelSet:
    """At most `count` surfels of a plant; fewer where no more places of it are seen from outside.

    buffers: without mipmaps. resolution: pixels along the diagonal of the plant's bounds at which
    it is looked at, at least. Raises UsageError for a negative count, CapabilityError where nothing
    can draw.
    """
    found = enough(buffers, count, resolution, lambda stage, f: progress(stage, SEEN * f))
    progress("order", SEEN)
    materials = buffers.plant.materials
    surfels = ordered(
        found, count, seed=seed, unlit=all(material.unlit for material in materials),
        double_sided=any(material.double_sided for material in materials),
        tint=transmission_tint(buffers.plant),
    )  # fmt: skip
    progress("sizes", ORDERED)
    return sized(surfels, buffers)


def sized(surfels: SurfelSet, buffers: PlantBuffers) -> SurfelSet:
    """Surfels of a plant with the sizes that cover as much as it does."""

    def seen(camera: Camera) -> Picture:
        return truth(buffers, camera, supersample=SUPERSAMPLE)

    return replace(surfels, size=sizes(surfels, seen))


def ordered(
    found: Candidates, count: int, *, seed: int = 0, unlit: bool = False,
    double_sided: bool = True, tint: npt.ArrayLike = (1.0, 1.0, 1.0),
) -> SurfelSet:  # fmt: skip
    """The same of candidates, all of size 1. tint: (3,) of light that passes through."""
    order = farthest_order(found.position, count, seed=seed)
    light = None if unlit else found.light
    values = np.hstack([found.color, found.normal, *(() if light is None else (light,))])
    mean = averaged(found.position, values, order, normals=found.normal, normal_weight=NORMALS)
    normal = unit(mean[:, 3:6])
    flat = (normal == 0).all(axis=1)  # of opposite sides alike
    normal[flat] = found.normal[order][flat]
    position = found.position[order]
    return SurfelSet(
        position, normal, mean[:, :3], spacing(position), unlit=unlit, double_sided=double_sided,
        light=None if light is None else mean[:, 6:], transmission_tint=np.asarray(tint),
    )  # fmt: skip
