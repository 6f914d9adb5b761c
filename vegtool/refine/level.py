"""A level closer to the truth: wood as a mesh, leaves on planes, coverage and colour as measured.

The operations are in files of their own; here is their order. Wood is drawn as geometry (wood.py),
leaves on the planes that displace and flatten them least (planes.py). Alpha is solved until as much
is covered as should be (coverage.py), colour until what is covered is as bright (color.py). Where
leaves are only a few pixels large, opaque triangles may show them better than pictures do
(foliage.py): then both are drawn, and the one that errs less is the level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from vegtool.arrays import IntArray
from vegtool.baking.bake import bake, transmission_tint
from vegtool.baking.options import BakeOptions
from vegtool.boxes import geometric_error
from vegtool.gl.pictures import BakedLight
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Level
from vegtool.measure.distances import rounded_up
from vegtool.measure.scores import TruthsAt, scores
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.refine.balance import balanced
from vegtool.refine.brightness import Brightness, brightness_of
from vegtool.refine.color import unbiased_color
from vegtool.refine.coverage import solve_coverage
from vegtool.refine.foliage import Leaves, leaves_of, reduced_leaves
from vegtool.refine.lit import lit_plant
from vegtool.refine.mesh import Scattering, joined
from vegtool.refine.occlusion import exposed_like
from vegtool.refine.planes import planes
from vegtool.refine.wood import Wood, reduced_wood, wood_triangles
from vegtool.refine.wood_stems import Stems, stems_of
from vegtool.timing import timed

REACH = 2.0
"""A level is made for distances up to so many times its nearest: there the next one begins."""
PER_BILLBOARD = 2
"""Triangles."""
SMALL = 12.0
"""Pixels: side of a square as large as what one triangle of leaves covers, up to which triangles
are tried. On five plants they erred less than pictures up to 8, and more from 14 on."""


TINY = float(np.finfo(float).tiny)
TEXTURED = 0.95
"""Of what a level without textures errs: no more than that may one with them, or it is not worth
its texels."""


@dataclass(frozen=True, eq=False)
class Source:
    """What all levels of a plant are made from.

    buffers: the plant's, without mipmaps. truth_at: what it looks like. wood, leaf: (k,) int32, the
    faces of either role; wood alone counts as leaves, since nothing else shows it. lit: light that
    goes into the colours, or None for levels that clients light.
    """

    buffers: PlantBuffers
    truth_at: TruthsAt
    wood: IntArray
    leaf: IntArray
    lit: BakedLight | None = None

    @property
    def plant(self) -> Plant:
        return self.buffers.plant

    @cached_property
    def colored(self) -> Plant:
        """The plant with the colours that triangles take."""
        if self.lit is None or self.lit.shadows is None:
            return self.plant
        return lit_plant(self.plant, self.lit.light, self.lit.shadows.read())

    @cached_property
    def scattering(self) -> tuple[Scattering, Scattering]:
        """Of wood and of leaves, where they are triangles."""
        if self.lit is not None:
            return Scattering(unlit=True), Scattering(unlit=True)
        materials, leaf = self.plant.materials, self.plant.face_material[self.leaf]
        area = np.bincount(leaf, self.plant.face_areas[self.leaf], len(materials))
        share = area @ np.array([m.transmission for m in materials]) / max(area.sum(), TINY)
        return Scattering(), Scattering(False, float(share), transmission_tint(self.plant))

    @cached_property
    def brightness(self) -> Brightness:
        """What the plant's is from all around."""
        return brightness_of(self.truth_at.buffers, self.truth_at.display)

    @cached_property
    def stems(self) -> Stems | None:
        """The wood as stems; None where there is none."""
        return stems_of(self.colored, self.wood) if len(self.wood) else None

    @cached_property
    def leaves(self) -> Leaves | None:
        """The leaves as what they cover; None where there are none."""
        return leaves_of(self.colored, self.leaf) if len(self.leaf) else None


@dataclass(frozen=True)
class Wanted:
    """A level to be: at most so many triangles, for distances from `near_m` metres on, and textures
    of at most `max_texture` texels a side. balance: whether its light is to be the plant's from all
    around. textured: leaves may be pictures; else they are triangles whatever their size."""

    triangles: int
    near_m: float
    max_texture: int = BakeOptions().max_texture
    seed: int = 0
    balance: bool = True
    textured: bool = True

    @property
    def far_m(self) -> float:
        """Metres to which the level is made for."""
        return rounded_up(REACH * self.near_m)


@dataclass(frozen=True, eq=False)
class Made:
    """A level, and what shows which of the f faces: labels (f,) int32 clusters on billboards, -1 of
    none; by_mesh (f,) bool."""

    level: Level
    labels: IntArray
    by_mesh: npt.NDArray[np.bool_]


def source_of(buffers: PlantBuffers, truth_at: TruthsAt, lit: BakedLight | None = None) -> Source:
    """What is known of a plant before its first level."""
    plant = buffers.plant
    wood = np.array([m.role == "wood" for m in plant.materials], dtype=bool)[plant.face_material]
    if wood.all():
        wood = ~wood
    faces = np.arange(len(plant.faces), dtype=np.int32)
    return Source(buffers, truth_at, faces[wood], faces[~wood], lit)


def refined_level(source: Source, wanted: Wanted, progress: Progress = silent) -> Level:
    """A level of a plant; its atlas, if it has one, has a texel to the pixel at `near_m`.

    Raises UsageError where pictures do not fit into `max_texture` texels, CapabilityError where
    nothing can draw.
    """
    seconds: dict[str, float] = {}
    pixel_m = 1 / source.truth_at.display.pixels_per_metre(wanted.near_m)
    progress("wood", 0.0)
    with timed(seconds, "wood"):
        wood = wood_of(source, wanted, pixel_m)
    left = wanted.triangles - (0 if wood is None else len(wood.faces))
    progress("planes", 0.1)
    made = on_planes(source, wanted, wood, left, seconds, progress) if wanted.textured else None
    if made is None or leaf_pixels(source, left, pixel_m) <= SMALL:
        progress("foliage", 0.8)
        with timed(seconds, "foliage"):
            plain = as_triangles(source, wanted, wood, left)
            made = plain if made is None else better(source, wanted, made, plain)
    level = replace(made.level, near_distance_m=wanted.near_m)
    if wanted.balance and not level.unlit:
        progress("balance", 0.9)
        with timed(seconds, "balance"):
            level = balanced(level, source.plant, source.brightness)
    with timed(seconds, "error"):
        error = geometric_error(
            source.plant, made.labels, level.billboards, level.mesh, made.by_mesh
        )
    return replace(
        level,
        geometric_error_m=error,
        seconds={**seconds, **level.seconds},
    )


def wood_of(source: Source, wanted: Wanted, pixel_m: float) -> Wood | None:
    """The wood that a level shows as a mesh; what else there is has a billboard at least."""
    if source.stems is None:
        return None
    count = wood_triangles(source.stems, wanted.triangles, pixel_m)
    if len(source.leaf):
        count = min(count, wanted.triangles - PER_BILLBOARD)
    return reduced_wood(source.stems, count, pixel_m)


def on_planes(
    source: Source,
    wanted: Wanted,
    wood: Wood | None,
    triangles: int,
    seconds: dict[str, float],
    progress: Progress,
) -> Made:
    """Wood as it is given, the rest on billboards of so many triangles."""
    plant = source.plant
    by_mesh: npt.NDArray[np.bool_] = np.zeros(len(plant.faces), dtype=bool)
    by_mesh[source.wood] = wood is not None
    level, labels = baked(source, wanted, wood, triangles, by_mesh, seconds, progress)
    if level.triangles > wanted.triangles and not level.double_sided:
        # all of it stands in the file twice, once for each side
        once = wanted.triangles // 2 - (wanted.triangles - triangles)
        level, labels = baked(source, wanted, wood, once, by_mesh, seconds, progress)
    return Made(as_measured(source, wanted, level, seconds, progress), labels, by_mesh)


def as_measured(
    source: Source, wanted: Wanted, level: Level, seconds: dict[str, float], progress: Progress
) -> Level:
    """A level whose alpha is mean coverage, with coverage and colour as the plant's."""
    if level.billboards is not None and len(level.billboards):
        progress("coverage", 0.6)
        with timed(seconds, "coverage"):
            truths = [source.truth_at(metres) for metres in (wanted.near_m, wanted.far_m)]
            level = solve_coverage(level, truths, BakeOptions().gutter, reach=REACH).level
    progress("color", 0.7)
    with timed(seconds, "color"):
        return unbiased_color(level, source.truth_at(wanted.near_m))


def baked(
    source: Source,
    wanted: Wanted,
    wood: Wood | None,
    triangles: int,
    by_mesh: npt.NDArray[np.bool_],
    seconds: dict[str, float],
    progress: Progress,
) -> tuple[Level, IntArray]:
    """A level whose alpha is the mean coverage of each texel, and the (f,) clusters of all faces;
    -1 of those that the mesh shows, (f,) bool."""
    density = source.truth_at.display.pixels_per_metre(wanted.near_m)
    with timed(seconds, "planes"):
        shown = np.flatnonzero(~by_mesh).astype(np.int32)
        count = max(triangles // PER_BILLBOARD, 1)
        labels, billboards = planes(source.plant, shown, count, 1 / density, seed=wanted.seed)
        labels = np.where(by_mesh, -1, labels).astype(np.int32)
    level = bake(
        source.buffers,
        labels,
        billboards,
        density,
        BakeOptions(max_texture=wanted.max_texture, fit_alpha=False),
        lambda stage, fraction: progress(stage, 0.3 + 0.3 * fraction),
        white=wood is not None,
        lit=source.lit,
    )
    mesh = joined([wood], "wood", source.scattering[:1])
    return (level if mesh is None else replace(level, kind="hybrid", mesh=mesh)), labels


def leaf_pixels(source: Source, triangles: int, pixel_m: float) -> float:
    """Side, in pixels, of a square as large as what each of so many triangles of leaves covers."""
    leaves = source.leaves
    if leaves is None or triangles < 1:
        return np.inf
    covered = float(leaves.area.sum()) * leaves.radius**2
    return float(np.sqrt(covered / triangles)) / pixel_m


def as_triangles(source: Source, wanted: Wanted, wood: Wood | None, triangles: int) -> Made:
    """Wood as it is given, leaves as so many triangles."""
    assert source.leaves is not None
    pixel_m = 1 / source.truth_at.display.pixels_per_metre(wanted.near_m)
    leaves = reduced_leaves(source.leaves, triangles, pixel_m)
    mesh = joined([wood, leaves], source.plant.name, source.scattering)
    assert mesh is not None
    mesh = exposed_like(mesh, source.colored)
    none = np.full(len(source.plant.faces), -1, dtype=np.int32)
    made = Level("mesh", mesh=mesh, unlit=source.lit is not None)
    level = unbiased_color(made, source.truth_at(wanted.near_m))
    return Made(level, none, none < 0)


def better(source: Source, wanted: Wanted, textured: Made, plain: Made) -> Made:
    """The textured level where it errs so much less (FLIP) at the nearest distance as its textures
    ask for, else the plain one."""
    truth = source.truth_at(wanted.near_m)
    errs = [float(scores(truth, made.level).values["flip"].mean()) for made in (textured, plain)]
    return textured if errs[0] < TEXTURED * errs[1] else plain
