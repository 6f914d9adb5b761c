"""Surfel billboards of a plant: all steps in their order.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4. Textures keep to a limit of memory by beginning farther away: the finest billboards have most of
the texels, and triangles show the same without any. No error in the picture grows by that.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np

from vegtool.baking.options import BakeOptions
from vegtool.gl.context import describe
from vegtool.gl.surfel_data import TEXEL_BYTES
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display
from vegtool.measure.views import distance_of
from vegtool.options import check_limits
from vegtool.plant import Plant
from vegtool.progress import Progress, part_of, silent
from vegtool.surfels.bake import Planned, baked, planned
from vegtool.surfels.base import Base, base_of
from vegtool.surfels.coverage import covered_alike
from vegtool.surfels.cuts import by_error, coarsest, drawn, triangles
from vegtool.surfels.hierarchy import SurfelHierarchy, whole
from vegtool.surfels.merging import merged
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.multi_triangulation import REACH, MultiTriangulation, multi_triangulation
from vegtool.surfels.options import MEGABYTE, SurfelOptions
from vegtool.surfels.reduce import reduced
from vegtool.timing import timed

STEP = 1.1
"""Times the distance at which billboards begin, at least, where textures are too large."""
NEIGHBOURS = 8
"""Of each billboard, that are looked at as its other half (k, section 4.3)."""
DEPTH = 5
"""Steps down to the billboards that a pair's box is around (l, section 4.3)."""


def surfel_model(
    plant: Plant,
    options: SurfelOptions | None = None,
    display: Display | None = None,
    max_texture: int = BakeOptions().max_texture,
    progress: Progress = silent,
    neighbours: int = NEIGHBOURS,
    depth: int = DEPTH,
) -> SurfelModel:
    """A plant as surfel billboards over triangles.

    max_texture: texels along a side of the atlas. Raises UsageError for options out of range and
    for a plant without extent, CapabilityError where nothing can draw.
    """
    options, display = options or SurfelOptions(), display or Display()
    check_limits(options)
    distance_of(plant, display, 1.0)  # refuses a plant without extent
    seconds: dict[str, float] = {}
    with timed(seconds, "triangles"):
        mt = multi_triangulation(plant, display, options.epsilon, part_of(progress, 0.0, 0.5))
    base = base_of(mt)
    with timed(seconds, "merging"):
        corners = (base.corners - plant.center) / (plant.radius or 1.0)
        report = part_of(progress, 0.5, 0.25)
        children = merged(corners, base.first, neighbours, depth, report)
    side_m = float((plant.bounds[1] - plant.bounds[0]).mean())
    m_per_pixel = options.epsilon / display.pixels_per_metre(1.0)
    asked = least = REACH * side_m * m_per_pixel
    with PlantBuffers(drawn(mt, coarsest(mt))) as buffers:
        limit = min(max_texture, describe(buffers.ctx).max_texture)
        while True:
            with timed(seconds, "reduction"):
                made = whole(base, children, options.theta, least)
                one = reduced(base, made, options.ds_max)
            with timed(seconds, "textures"):
                plan, excess = _planned(buffers, base, one, limit, options)
            if plan is not None:
                break
            least *= max(STEP, sqrt(excess))
        progress("textures", 0.8)
        with timed(seconds, "textures"):
            textures = baked(buffers, plan)
    found = SurfelModel(mt, one, textures, display, options)
    with timed(seconds, "coverage"):
        found = covered_alike(found, part_of(progress, 0.85, 0.15))
    notes: tuple[str, ...] = ()
    if least > asked:
        notes = (_begins_farther(mt, options, asked, least, m_per_pixel, limit),)
    progress("surfel billboards", 1.0)
    return replace(found, notes=notes, seconds=seconds)


def _planned(
    buffers: PlantBuffers, base: Base, one: SurfelHierarchy, limit: int, options: SurfelOptions
) -> tuple[Planned | None, float]:
    """The pictures of a hierarchy, or None where memory or the atlas cannot hold them; and how many
    times too large they are."""
    plan = planned(buffers, base.first.astype(np.int32), one, limit)
    packing = plan.packing
    excess = max(
        plan.texture_bytes / (options.max_texture_memory * MEGABYTE),
        packing.width / limit,
        packing.height / limit,
    )
    tiniest = packing.rect[:, 2:].max() == 1 and len(packing.rect) == 1
    return (plan if excess <= 1 or tiniest else None), excess


def _begins_farther(
    mt: MultiTriangulation, options: SurfelOptions, asked: float, least: float, m_per_pixel: float,
    limit: int,
) -> str:  # fmt: skip
    count = len(triangles(mt, by_error(mt, asked)))
    begins, wanted = least / m_per_pixel, asked / m_per_pixel
    side_mb = TEXEL_BYTES * limit**2 / MEGABYTE
    by_side = side_mb < options.max_texture_memory
    return (
        f"textures of {min(side_mb, options.max_texture_memory):.3g} MB are too small: billboards "
        f"begin {begins:.3g} m away in place of {wanted:.3g}; nearer, triangles are drawn, up to "
        f"{count:,}. Allow more with {'--max-texture' if by_side else '--max-texture-memory'}"
    )
