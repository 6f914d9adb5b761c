"""From a plant to its surfels in progressive order.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 3.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import unit
from vegtool.gl.upload import PlantBuffers
from vegtool.progress import Progress, silent
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.averaged import averaged
from vegtool.surfels.blue.candidates import RESOLUTION, Candidates, candidates
from vegtool.surfels.blue.distances import spacing
from vegtool.surfels.blue.farthest import farthest_order

SEEN = 0.7
"""Share of the progress that goes into candidates."""


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
    it is looked at. Raises UsageError for a negative count, CapabilityError where nothing can draw.
    """
    found = candidates(buffers, resolution, lambda stage, f: progress(stage, SEEN * f))
    progress("order", SEEN)
    unlit = all(material.unlit for material in buffers.plant.materials)
    return ordered(found, count, seed=seed, unlit=unlit)


def ordered(found: Candidates, count: int, *, seed: int = 0, unlit: bool = False) -> SurfelSet:
    """The same of candidates."""
    order = farthest_order(found.position, count, seed=seed)
    values = np.hstack([found.color, found.normal])
    mean = averaged(found.position, values, order)
    normal = unit(mean[:, 3:])
    flat = (normal == 0).all(axis=1)  # of opposite sides alike
    normal[flat] = found.normal[order][flat]
    position = found.position[order]
    return SurfelSet(position, normal, mean[:, :3], spacing(position), unlit=unlit)
