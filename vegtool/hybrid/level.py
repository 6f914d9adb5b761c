"""A hybrid as a level: billboards of what is left on planes, and a mesh of what has left them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vegtool.baking.bake import Charted, PlantBuffers, bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import geometric_error
from vegtool.hybrid.budget import within
from vegtool.hybrid.charts import charted
from vegtool.hybrid.cloud import Cloud
from vegtool.hybrid.greedy import Descent, descent
from vegtool.hybrid.mesh import colored
from vegtool.hybrid.options import Budget, Weights
from vegtool.hybrid.patches import patched
from vegtool.hybrid.start import begun, started
from vegtool.lod import Charts, Level
from vegtool.measure.scores import Truths, scores
from vegtool.plant import Plant
from vegtool.progress import Progress, part_of, silent
from vegtool.refine.color import unbiased_color
from vegtool.refine.level import TEXTURED, Source, Wanted, as_measured
from vegtool.refine.mesh import joined
from vegtool.refine.planes import none
from vegtool.timing import timed

TRIES = 4
"""At a level of no more triangles than are allowed."""
FURTHER = 2
"""Planes that patch cracks."""
PATCHED = 0.9
"""Of what a hybrid errs: no more than that may one whose cracks are patched, or it is not worth its
fill."""


def hybrid_level(
    source: Source, wanted: Wanted, aim: Weights | Budget, cheap: bool = False,
    progress: Progress = silent,
) -> Level:  # fmt: skip
    """A level of a plant that starts as billboards of half of the triangles that are wanted, or all
    of them where weights are the aim. cheap: as the poster (greedy.py).

    Where alpha cuts nothing out, another is made of a cloud whose cracks are patched, and taken if
    that errs so much less (FLIP) at the nearest distance as it fills more; and one whose mesh has
    colours alone, taken unless its pictures are worth their texels.
    """
    seconds: dict[str, float] = {}
    with timed(seconds, "cloud"):
        start = started(source, wanted.triangles, aim, part_of(progress, 0.0, 0.3))
    whole = not any(m.alpha_mode == "mask" for m in source.plant.materials)
    report = part_of(progress, 0.3, 0.3 if whole else 0.7)
    made = descended(source, wanted, start, aim, cheap, report)
    if whole and made.billboards:
        with timed(seconds, "patches"):
            more = begun(patched(start.cloud, FURTHER), start.weights, start.per_billboard)
        other = descended(source, wanted, more, aim, cheap, part_of(progress, 0.6, 0.3))
        if keeps(other, made, aim) and other.error < PATCHED * made.error:
            made = other
    if whole and made.level.charts is not None:
        plain = Made(made.found, drawn_as(source, wanted, made.found, pictured=False), made.truth)
        made = made if made.error < TEXTURED * plain.error else plain
    progress("hybrid", 0.95)
    level = made.level
    with timed(seconds, "error"):
        error = error_of(made.found, level)
    return replace(level, geometric_error_m=error, seconds={**seconds, **level.seconds})


@dataclass(frozen=True, eq=False)
class Made:
    """A level, what it shows of a hybrid, and what it is compared with."""

    found: Descent
    level: Level
    truth: Truths

    @property
    def billboards(self) -> int:
        return 0 if self.level.billboards is None else len(self.level.billboards)

    @cached_property
    def error(self) -> float:
        """FLIP."""
        return float(scores(self.truth, self.level).values["flip"].mean())


def keeps(other: Made, made: Made, aim: Weights | Budget) -> bool:
    """Whether another level keeps to a budget, or exceeds it no farther than what is made."""
    if isinstance(aim, Weights):
        return True
    if other.level.triangles > max(aim.triangles, made.level.triangles):
        return False
    return aim.fill is None or other.found.terms.fill <= max(aim.fill, made.found.terms.fill)


def descended(
    source: Source, wanted: Wanted, start: Descent, aim: Weights | Budget, cheap: bool = False,
    progress: Progress = silent,
) -> Made:  # fmt: skip
    """The level that a start comes to. A mesh that is seen from both sides stands in the file twice
    where billboards do: then less is tried, until a budget is kept to."""
    truth = source.truth_at(wanted.near_m)
    if isinstance(aim, Weights):
        for _ in descent(start, cheap, progress):
            pass
        return Made(start, drawn_as(source, wanted, start, progress), truth)
    most = aim.triangles
    for _ in range(TRIES):
        found = within(start, replace(aim, triangles=most), cheap, progress)
        level = drawn_as(source, wanted, found, progress)
        if level.triangles <= aim.triangles:
            break
        most = max(start.per_billboard, most - (level.triangles - aim.triangles))
    return Made(found, level, truth)


def drawn_as(
    source: Source, wanted: Wanted, found: Descent, progress: Progress = silent,
    pictured: bool = True,
) -> Level:  # fmt: skip
    """What a descent has come to, for distances from `wanted.near_m` metres on. pictured: whether
    its mesh has pictures; else it has colours alone."""
    seconds: dict[str, float] = {}
    density = source.truth_at.display.pixels_per_metre(wanted.near_m)
    with timed(seconds, "mesh"):
        mesh, charts, pictures = mesh_of(source, found, density if pictured else 0.0)
    left = np.sort(np.concatenate(found.pairs))
    rest = found.cloud.of(left)
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
    return replace(level, near_distance_m=wanted.near_m, seconds=seconds)


def error_of(found: Descent, level: Level) -> tuple[float, float]:
    """The geometric error of a level that shows a hybrid."""
    plant = found.cloud.plant
    rest = found.cloud.of(np.sort(np.concatenate(found.pairs)))
    labels = np.full(len(plant.faces), -1, dtype=np.int32)
    labels[rest.face] = rest.plane
    return geometric_error(plant, labels, level.billboards, level.mesh, found.in_mesh)


def mesh_of(
    source: Source, found: Descent, density: float
) -> tuple[Plant | None, Charts | None, Charted | None]:
    """The mesh, what its faces show, and what is to be baked for that. density: texels per metre,
    of which 0 are no pictures."""
    mesh, charts, pictures = colored(source.colored, found.parts.values()), None, None
    if mesh is None:
        return None, None, None
    plant = source.plant
    reach_m = found.cloud.reach * plant.radius
    apart = charted(plant, mesh, density, reach_m) if density else None
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
