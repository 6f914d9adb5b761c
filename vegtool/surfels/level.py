"""Levels of detail out of a hierarchy: what is drawn where the same error is allowed all over.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007). A file
of billboards and triangles that stay cannot choose for each eye: of the hierarchy it has those that
displace nothing by more than so many metres from any direction (eq. 8), and of the triangles those
of the same error (eq. 10), in the colours of their vertices. Its atlas has a texel to the pixel, as
those of other levels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import IntArray
from vegtool.baking.bake import bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import geometric_error
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Billboards, Level
from vegtool.measure.scores import scores
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.refine.color import unbiased_color
from vegtool.refine.face_texels import face_colors
from vegtool.refine.level import Source, Wanted, as_measured
from vegtool.refine.mesh import ColoredMesh, joined
from vegtool.surfels.box import SurfelBoxes, boxes_of
from vegtool.surfels.cuts import by_error, coarsest, drawn
from vegtool.surfels.margin import MARGIN, going_on, with_margin
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.select import shown_below
from vegtool.surfels.validity import spread
from vegtool.timing import timed

Bools = npt.NDArray[np.bool_]
ONE_SIDED, TWO_SIDED = 2, 4
"""Triangles of a billboard, as they stand in a file."""


@dataclass(frozen=True, eq=False)
class Cut:
    """What a level draws of a model of b billboards, p patches and a arcs.

    by: (p,) int32 the billboard that shows each patch, -1 where none does. alone: (k,) int32
    patches that a billboard of their own shows, since alpha cuts something out of them. arcs: (a,)
    bool, whose triangles are drawn. error: metres that no triangle is off by more, of these or of
    those that billboards show.
    """

    by: IntArray
    alone: IntArray
    arcs: Bools
    error: float

    def triangles(self, sizes: IntArray, per_billboard: int) -> int:
        """How many there are. sizes: (a,) of the arcs' patches."""
        billboards = len(np.unique(self.by[self.by >= 0])) + len(self.alone)
        return per_billboard * billboards + int(sizes[self.arcs].sum())


def cut(model: SurfelModel, delta: float) -> Cut:
    """What is drawn where delta metres of error are allowed all over, from any direction."""
    mt, one = model.triangles, model.hierarchy
    by = shown_below(one, one.error <= delta * spread(one.theta))
    source = coarsest(mt)
    masked = np.array([m.alpha_mode == "mask" for m in mt.plant.materials])[mt.material]
    arcs = by_error(mt, delta) & ~masked
    arcs[np.flatnonzero(source)[by >= 0]] = False
    alone = np.flatnonzero(masked[source] & (by < 0)).astype(np.int32)
    applied = mt.error[mt.error <= delta], mt.error[mt.end[source]][alone]
    return Cut(by, alone, arcs, max(float(error.max(initial=0.0)) for error in applied))


def least_error(model: SurfelModel, most: int, per_billboard: int = ONE_SIDED) -> float:
    """Metres: the least error, or nearly so, of which a cut has no more than so many triangles; the
    largest that is of use, where none has."""
    mt, one = model.triangles, model.hierarchy
    errors = np.unique([*mt.error[:-1], *(one.error / spread(one.theta))])
    low, high = 0, len(errors) - 1
    while low < high:
        middle = (low + high) // 2
        if cut(model, errors[middle]).triangles(mt.sizes, per_billboard) <= most:
            high = middle
        else:
            low = middle + 1
    return float(errors[low])


@dataclass(frozen=True, eq=False)
class SurfelSource:
    """What all levels of surfel billboards of a plant are made from."""

    source: Source
    model: SurfelModel

    def nearest_m(self, most: int) -> float:
        """Metres from the plant's center, from which a level of so many triangles keeps to the
        model's epsilon."""
        display, epsilon = self.model.display, self.model.options.epsilon
        away = least_error(self.model, most) * display.pixels_per_metre(1.0) / epsilon
        return away + self.model.plant.radius

    def allowed_m(self, near_m: float) -> float:
        """Metres of error that are epsilon pixels from so far away from the plant's center, of what
        is nearest there."""
        display, epsilon = self.model.display, self.model.options.epsilon
        return max(near_m - self.model.plant.radius, 0.0) * epsilon / display.pixels_per_metre(1.0)


def surfel_level(made_from: SurfelSource, wanted: Wanted, progress: Progress = silent) -> Level:
    """A level that displaces nothing by more than the model's epsilon at `wanted.near_m`: more
    where it would have more triangles than are wanted, and where alpha cuts something out of what
    no billboard may show from there.

    Raises UsageError where pictures do not fit into `max_texture` texels, CapabilityError where
    nothing can draw.
    """
    source, seconds = made_from.source, dict[str, float]()
    model = made_from.model
    for per_billboard in (ONE_SIDED, TWO_SIDED):
        with timed(seconds, "cut"):
            error = max(
                made_from.allowed_m(wanted.near_m),
                least_error(model, wanted.triangles, per_billboard),
            )
            chosen = cut(model, error)
        level, geometric = _baked(source, model, chosen, wanted, seconds, progress)
        if level.triangles <= wanted.triangles:
            break
    truth = source.truth_at(wanted.near_m)
    plain = unbiased_color(level, truth)
    if level.kind != "mesh":
        level = as_measured(source, wanted, level, seconds, progress)
        # of whole surfaces, alpha for what lacks at the silhouette opens them elsewhere
        errs = [float(scores(truth, each).values["flip"].mean()) for each in (level, plain)]
        plain = plain if errs[1] < errs[0] else level
    level = plain
    seconds |= {key: value for key, value in level.seconds.items() if key not in seconds}
    return replace(
        level, near_distance_m=wanted.near_m, geometric_error_m=geometric, seconds=seconds
    )


def _baked(
    source: Source, model: SurfelModel, chosen: Cut, wanted: Wanted, seconds: dict[str, float],
    progress: Progress,
) -> tuple[Level, tuple[float, float]]:  # fmt: skip
    """A level whose alpha is the mean coverage of each texel, and its geometric error."""
    mt = model.triangles
    mesh = _mesh(source, model, chosen)
    low = drawn(mt, coarsest(mt))
    shown = np.unique(chosen.by[chosen.by >= 0])
    cluster = np.searchsorted(shown, chosen.by).astype(np.int32)
    cluster[chosen.by < 0] = -1
    cluster[chosen.alone] = len(shown) + np.arange(len(chosen.alone), dtype=np.int32)
    labels = np.repeat(cluster, mt.sizes[coarsest(mt)])
    density = source.truth_at.display.pixels_per_metre(wanted.near_m)
    billboards = _billboards(model, low, shown, labels, MARGIN / density)
    level = Level("mesh", mesh=mesh, unlit=source.lit is not None) if mesh is not None else None
    if len(billboards):
        with timed(seconds, "margin"):
            own = np.flatnonzero(labels >= 0).astype(np.int32)
            more, over = going_on(low, own, labels[own], billboards, billboards.half_depth)
            face = np.concatenate([own, more])
            wide = replace(low, faces=low.faces[face], face_material=low.face_material[face])
        with timed(seconds, "bake"), PlantBuffers(wide) as buffers:
            level = bake(
                buffers, np.concatenate([labels[own], over]), billboards, density,
                BakeOptions(max_texture=wanted.max_texture, fit_alpha=False),
                lambda stage, fraction: progress(stage, 0.3 + 0.3 * fraction),
                white=mesh is not None, lit=source.lit,
            )  # fmt: skip
        billboards = level.billboards or billboards
        if mesh is not None:
            level = replace(level, kind="hybrid", mesh=mesh)
    assert level is not None, "a cut draws something"
    with timed(seconds, "error"):
        off = geometric_error(low, labels, billboards, mesh, labels < 0)
    return level, (off[0] + chosen.error, off[1] + chosen.error)


def _billboards(
    model: SurfelModel, low: Plant, shown: IntArray, labels: IntArray, margin_m: float
) -> Billboards:
    """Those of the hierarchy, then those of patches that have one of their own."""
    boxes = model.hierarchy.boxes
    some = SurfelBoxes(boxes.center[shown], boxes.axes[shown], boxes.half[shown])
    own = labels >= len(shown)
    if own.any():  # patch by patch already
        first = np.flatnonzero(np.diff(labels[own], prepend=-1))
        alone = boxes_of(low.corners[own], first)
        both = [(getattr(some, name), getattr(alone, name)) for name in ("center", "axes", "half")]
        some = SurfelBoxes(*(np.concatenate(pair) for pair in both))
    return with_margin(some, np.full(len(some), margin_m))


def _mesh(source: Source, model: SurfelModel, chosen: Cut) -> Plant | None:
    """The triangles of a cut, coloured by their vertices; None where there are none."""
    mt = model.triangles
    if not chosen.arcs.any():
        return None
    # vertices are the original's, and so is the light on them
    lit = replace(mt, plant=replace(mt.plant, colors=source.colored.colors))
    plant = drawn(lit, chosen.arcs)
    color = face_colors(plant, np.arange(len(plant.faces), dtype=np.int32))
    area = np.repeat(np.maximum(plant.face_areas, np.finfo(float).tiny), 3)
    vertex, index = np.unique(plant.faces, return_inverse=True)
    index = index.ravel()
    light = [np.bincount(index, area * np.repeat(c, 3), len(vertex)) for c in color.T]
    mean = np.stack(light, axis=1) / np.bincount(index, area, len(vertex))[:, None]
    colored = ColoredMesh(
        plant.positions[vertex], plant.normals[vertex], mean,
        index.reshape(-1, 3).astype(np.int32),
    )  # fmt: skip
    double = any(plant.materials[number].double_sided for number in np.unique(plant.face_material))
    return joined([colored], plant.name, [replace(source.scattering[0], double_sided=double)])
