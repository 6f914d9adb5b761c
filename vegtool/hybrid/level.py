"""A hybrid as a level: billboards of what is left on planes, and a mesh of what has left them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.baking.bake import PlantBuffers, bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import geometric_error
from vegtool.hybrid.budget import within
from vegtool.hybrid.cloud import Cloud, cloud_of
from vegtool.hybrid.cost import PER_BILLBOARD
from vegtool.hybrid.greedy import Descent, descent
from vegtool.hybrid.mesh import colored
from vegtool.hybrid.options import Budget, Weights
from vegtool.lod import Level
from vegtool.meshes.pieces import all_welded
from vegtool.progress import Progress, silent
from vegtool.refine.level import Source, Wanted, as_measured
from vegtool.refine.mesh import joined
from vegtool.refine.planes import billboards_about
from vegtool.timing import timed

STARTS_WITH = 0.5
"""Of the triangles that a budget allows: billboards. What they leave is for the mesh."""


def begun(cloud: Cloud, weights: Weights) -> Descent:
    """A hybrid that is all billboards."""
    plant = cloud.plant
    about = billboards_about(cloud.shown, cloud.plane, cloud.normal)
    corners = (cloud.shown.corners - plant.center) / (plant.radius or 1.0)
    sides = [np.einsum("qci,qi->qc", corners, side[cloud.plane]) for side in (about.u, about.v)]
    ends = [end for side in sides for end in (side.min(axis=1), side.max(axis=1))]
    return Descent(cloud, all_welded(plant), np.stack(ends, axis=1), weights)


def hybrid_level(
    source: Source, wanted: Wanted, aim: Weights | Budget, cheap: bool = False,
    progress: Progress = silent,
) -> Level:  # fmt: skip
    """A level of a plant that starts as billboards of half of the triangles that are wanted, or all
    of them where weights are the aim. cheap: as the poster (greedy.py)."""
    seconds: dict[str, float] = {}
    share = 1.0 if isinstance(aim, Weights) else STARTS_WITH
    count = max(1, int(share * wanted.triangles / PER_BILLBOARD))
    with timed(seconds, "cloud"):
        cloud = cloud_of(source.plant, count, lambda stage, f: progress(stage, 0.3 * f))
    with timed(seconds, "descent"):
        found = begun(cloud, aim if isinstance(aim, Weights) else Weights())
        report = _part_of(progress, 0.3, 0.2)
        if isinstance(aim, Budget):
            found = within(found, aim, cheap, report)
        else:
            for _ in descent(found, cheap, report):
                pass
    level = drawn_as(source, wanted, found, _part_of(progress, 0.5, 0.5))
    return replace(level, seconds={**seconds, **level.seconds})


def _part_of(progress: Progress, before: float, share: float) -> Progress:
    return lambda stage, fraction: progress(stage, before + share * fraction)


def drawn_as(source: Source, wanted: Wanted, found: Descent, progress: Progress = silent) -> Level:
    """What a descent has come to, for distances from `wanted.near_m` metres on."""
    seconds: dict[str, float] = {}
    plant, cloud = source.plant, found.cloud
    density = source.truth_at.display.pixels_per_metre(wanted.near_m)
    with timed(seconds, "mesh"):
        own = colored(source.colored, found.parts.values())
        materials = np.unique(plant.face_material[found.in_mesh])
        both_sides = any(plant.materials[index].double_sided for index in materials)
        scattering = replace(source.scattering[0], double_sided=both_sides)
        mesh = joined([own], plant.name, [scattering])
    left = np.sort(np.concatenate(found.pairs))
    labels = np.full(len(plant.faces), -1, dtype=np.int32)
    if len(left):
        with timed(seconds, "planes"):
            rest = cloud.of(left)
            labels[rest.face] = rest.plane
            billboards = billboards_about(rest.shown, rest.plane, rest.normal)
        options = BakeOptions(max_texture=wanted.max_texture, fit_alpha=False)
        progress("bake", 0.1)
        with PlantBuffers(rest.shown) as buffers:
            white = mesh is not None
            level = bake(
                buffers, rest.plane, billboards, density, options, white=white, lit=source.lit
            )
        seconds |= level.seconds
        if mesh is not None:
            level = replace(level, kind="hybrid", mesh=mesh)
        level = as_measured(source, wanted, level, seconds, progress)
    else:
        level = Level("mesh", mesh=mesh, unlit=source.lit is not None)
    with timed(seconds, "error"):
        error = geometric_error(plant, labels, level.billboards, level.mesh, found.in_mesh)
    return replace(level, near_distance_m=wanted.near_m, geometric_error_m=error, seconds=seconds)
