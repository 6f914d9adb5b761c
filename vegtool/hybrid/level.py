"""A hybrid as a level: billboards of what is left on planes, and a mesh of what has left them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.baking.bake import PlantBuffers, bake
from vegtool.baking.options import BakeOptions
from vegtool.clustering.partition import compacted
from vegtool.hybrid.cloud import Cloud
from vegtool.hybrid.cost import Weights
from vegtool.hybrid.greedy import Descent
from vegtool.hybrid.mesh import colored
from vegtool.lod import Level
from vegtool.meshes.pieces import all_welded
from vegtool.progress import Progress, silent
from vegtool.refine.level import Source, Wanted, as_measured
from vegtool.refine.mesh import joined
from vegtool.refine.planes import billboards_about
from vegtool.timing import timed


def begun(cloud: Cloud, weights: Weights) -> Descent:
    """A hybrid that is all billboards."""
    plant = cloud.plant
    about = billboards_about(cloud.shown, cloud.plane, cloud.normal)
    corners = (cloud.shown.corners - plant.center) / (plant.radius or 1.0)
    sides = [np.einsum("qci,qi->qc", corners, side[cloud.plane]) for side in (about.u, about.v)]
    ends = [end for side in sides for end in (side.min(axis=1), side.max(axis=1))]
    return Descent(cloud, all_welded(plant), np.stack(ends, axis=1), weights)


def hybrid_level(
    source: Source, wanted: Wanted, found: Descent, progress: Progress = silent
) -> Level:
    """What a descent has come to, for distances from `wanted.near_m` metres on."""
    seconds: dict[str, float] = {}
    plant, cloud = source.plant, found.cloud
    density = source.truth_at.display.pixels_per_metre(wanted.near_m)
    mesh = None
    with timed(seconds, "mesh"):
        own = colored(source.colored, found.parts.values())
        materials = np.unique(plant.face_material[found.in_mesh])
        both_sides = any(plant.materials[index].double_sided for index in materials)
        scattering = replace(source.scattering[0], double_sided=both_sides)
        mesh = joined([own], plant.name, [scattering])
    left = np.sort(np.concatenate(found.pairs))
    if not len(left):
        level = Level("mesh", mesh=mesh)
    else:
        with timed(seconds, "planes"):
            rest = replace(
                cloud,
                face=cloud.face[left],
                plane=compacted(cloud.plane[left].astype(np.int64)).astype(np.int32),
                normal=cloud.normal[np.unique(cloud.plane[left])],
            )
            shown, label = rest.shown, rest.plane.astype(np.int32)
            billboards = billboards_about(shown, label, rest.normal)
        options = BakeOptions(max_texture=wanted.max_texture, fit_alpha=False)
        with PlantBuffers(shown) as buffers:
            level = bake(
                buffers, label, billboards, density, options, white=mesh is not None, lit=source.lit
            )
        if mesh is not None:
            level = replace(level, kind="hybrid", mesh=mesh)
        level = as_measured(source, wanted, level, seconds, progress)
    return replace(level, near_distance_m=wanted.near_m)
