"""A hybrid as a level: billboards of what is left on planes, and a mesh of what has left them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.baking.bake import Charted, PlantBuffers, bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import geometric_error
from vegtool.hybrid.budget import within
from vegtool.hybrid.charts import charted
from vegtool.hybrid.cloud import Cloud, cloud_of
from vegtool.hybrid.cost import PER_BILLBOARD
from vegtool.hybrid.greedy import Descent, descent
from vegtool.hybrid.mesh import colored
from vegtool.hybrid.options import Budget, Weights
from vegtool.lod import Charts, Level
from vegtool.meshes.pieces import all_welded
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.refine.color import unbiased_color
from vegtool.refine.level import Source, Wanted, as_measured
from vegtool.refine.mesh import joined
from vegtool.refine.planes import none
from vegtool.timing import timed

TRIES = 4
"""At a level of no more triangles than are allowed."""
STARTS_WITH = 0.5
"""Of the triangles that a budget allows: billboards. What they leave is for the mesh."""


def begun(cloud: Cloud, weights: Weights) -> Descent:
    """A hybrid that is all billboards."""
    plant = cloud.plant
    about = cloud.billboards()
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
    start = begun(cloud, aim if isinstance(aim, Weights) else Weights())
    report = _part_of(progress, 0.3, 0.7)
    if isinstance(aim, Budget):
        level = kept_to(source, wanted, start, aim, cheap, report)
    else:
        for _ in descent(start, cheap, report):
            pass
        level = drawn_as(source, wanted, start, report)
    return replace(level, seconds={**seconds, **level.seconds})


def kept_to(
    source: Source, wanted: Wanted, start: Descent, budget: Budget, cheap: bool = False,
    progress: Progress = silent,
) -> Level:  # fmt: skip
    """The level of the least error that a budget allows. Billboards whose sides differ stand in the
    file twice, which is seen when they are drawn: then less is tried."""
    most = budget.triangles
    for _ in range(TRIES):
        found = within(start, replace(budget, triangles=most), cheap, progress)
        level = drawn_as(source, wanted, found, progress)
        if level.triangles <= budget.triangles:
            break
        most = max(PER_BILLBOARD, most - (level.triangles - budget.triangles))
    return level


def _part_of(progress: Progress, before: float, share: float) -> Progress:
    return lambda stage, fraction: progress(stage, before + share * fraction)


def drawn_as(source: Source, wanted: Wanted, found: Descent, progress: Progress = silent) -> Level:
    """What a descent has come to, for distances from `wanted.near_m` metres on."""
    seconds: dict[str, float] = {}
    plant, cloud = source.plant, found.cloud
    density = source.truth_at.display.pixels_per_metre(wanted.near_m)
    with timed(seconds, "mesh"):
        mesh, charts, pictures = mesh_of(source, found, density)
    left = np.sort(np.concatenate(found.pairs))
    labels = np.full(len(plant.faces), -1, dtype=np.int32)
    rest = cloud.of(left)
    labels[rest.face] = rest.plane
    if len(left) or pictures is not None:
        level = baked(source, wanted, rest, density, mesh is not None, pictures, progress)
        seconds |= level.seconds
        if mesh is not None:
            level = replace(level, kind="hybrid", mesh=mesh, charts=charts)
        if mesh is not None and not len(left):
            level = replace(level, double_sided=any(m.double_sided for m in mesh.materials))
        level = as_measured(source, wanted, level, seconds, progress)
    else:
        level = Level("mesh", mesh=mesh, unlit=source.lit is not None)
        level = unbiased_color(level, source.truth_at(wanted.near_m))
    with timed(seconds, "error"):
        error = geometric_error(plant, labels, level.billboards, level.mesh, found.in_mesh)
    return replace(level, near_distance_m=wanted.near_m, geometric_error_m=error, seconds=seconds)


def mesh_of(
    source: Source, found: Descent, density: float
) -> tuple[Plant | None, Charts | None, Charted | None]:
    """The mesh, what its faces show, and what is to be baked for that."""
    mesh, charts, pictures = colored(source.colored, found.parts.values()), None, None
    if mesh is None:
        return None, None, None
    plant = source.plant
    apart = charted(plant, mesh, density, found.cloud.reach * plant.radius)
    if apart is not None:
        mesh, charts, pictures = apart
    materials = np.unique(plant.face_material[found.in_mesh])
    both_sides = any(plant.materials[index].double_sided for index in materials)
    scattering = replace(source.scattering[0], double_sided=both_sides)
    return joined([mesh], plant.name, [scattering]), charts, pictures


def baked(
    source: Source,
    wanted: Wanted,
    rest: Cloud,
    density: float,
    white: bool,
    pictures: Charted | None,
    progress: Progress,
) -> Level:
    """Billboards, and the pictures of a mesh."""
    shown = rest.shown_and(np.empty(0, np.int32) if pictures is None else pictures.face)
    labels = np.full(len(shown.faces), -1, dtype=np.int32)
    labels[: len(rest.face)] = rest.plane
    billboards = rest.billboards() if len(rest.face) else none()
    if pictures is not None:
        nth = len(rest.face) + np.arange(len(pictures.face), dtype=np.int32)
        pictures = replace(pictures, face=nth)
    options = BakeOptions(max_texture=wanted.max_texture, fit_alpha=False)
    with PlantBuffers(shown) as buffers:
        return bake(
            buffers, labels, billboards, density, options, progress, white, source.lit, pictures
        )
