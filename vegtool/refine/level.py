"""A level closer to the truth: wood as a mesh, leaves on planes, coverage and colour as measured.

The operations are in files of their own; here is their order. Wood is drawn as geometry (wood.py),
leaves on the planes that displace and flatten them least (planes.py). Alpha is solved until as much
is covered as should be (coverage.py), colour until what is covered is as bright (color.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import IntArray
from vegtool.baking.bake import bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import geometric_error
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Level
from vegtool.measure.scores import TruthsAt
from vegtool.plant import Material, Plant
from vegtool.progress import Progress, silent
from vegtool.refine.coverage import pictures, unbiased_alpha, with_alpha
from vegtool.refine.planes import planes
from vegtool.refine.wood import Wood, reduced_wood
from vegtool.refine.wood_stems import Stems, stems_of
from vegtool.timing import timed

WOOD_SHARE = 0.25
"""Of a level's triangles, at most."""
REACH = 2.0
"""A level is made for distances up to so many times its nearest: there the next one begins."""


@dataclass(frozen=True, eq=False)
class Source:
    """What all levels of a plant are made from.

    buffers: the plant's, without mipmaps. truth_at: what it looks like. by_mesh: (f,) bool, the
    faces that a mesh shows, as `stems`; None where there are none.
    """

    buffers: PlantBuffers
    truth_at: TruthsAt
    by_mesh: np.ndarray
    stems: Stems | None

    @property
    def plant(self) -> Plant:
        return self.buffers.plant


def source_of(buffers: PlantBuffers, truth_at: TruthsAt) -> Source:
    """What is known of a plant before its first level."""
    plant = buffers.plant
    wood = np.array([m.role == "wood" for m in plant.materials])[plant.face_material]
    stems = None if wood.all() else stems_of(plant, np.flatnonzero(wood).astype(np.int32))
    return Source(buffers, truth_at, wood & (stems is not None), stems)


def refined_level(
    source: Source,
    triangles: int,
    near_m: float,
    max_texture: int = BakeOptions().max_texture,
    seed: int = 0,
    progress: Progress = silent,
) -> Level:
    """A level of at most that many triangles, for distances from `near_m` metres on.

    Its atlas has one texel per pixel there. Raises UsageError where pictures do not fit into
    `max_texture` texels, CapabilityError where nothing can draw.
    """
    plant, display = source.plant, source.truth_at.display
    density = display.pixels_per_metre(near_m)
    seconds: dict[str, float] = {}
    with timed(seconds, "wood"):
        wood = None
        if source.stems is not None:
            wood = reduced_wood(source.stems, max(int(WOOD_SHARE * triangles), 1), 1 / density)
    drawn_as_mesh = source.by_mesh & (wood is not None)
    progress("planes", 0.0)
    with timed(seconds, "planes"):
        left = triangles - (0 if wood is None else len(wood.faces))
        shown = np.flatnonzero(~drawn_as_mesh).astype(np.int32)
        labels, billboards = planes(plant, shown, max(left // 2, 1), 1 / density, seed=seed)
        labels = np.where(drawn_as_mesh, -1, labels).astype(np.int32)
    how = BakeOptions(max_texture=max_texture, fit_alpha=False)
    level = bake(
        source.buffers,
        labels,
        billboards,
        density,
        how,
        lambda stage, fraction: progress(stage, 0.3 + 0.4 * fraction),
        white=wood is not None,
    )
    mesh = None
    if wood is not None:
        mesh = mesh_of(wood)
        level = replace(level, kind="hybrid", mesh=mesh)
    with timed(seconds, "coverage"):
        level = covering(level, near_m, how.gutter)
    with timed(seconds, "error"):
        error = geometric_error(plant, labels, level.billboards, mesh, drawn_as_mesh)
    return replace(
        level,
        near_distance_m=near_m,
        geometric_error_m=error,
        seconds={**seconds, **level.seconds},
    )


def covering(level: Level, near_m: float, gutter: int) -> Level:
    """The level with alpha of which as much passes as is covered."""
    assert level.atlas is not None
    atlas = level.atlas
    alpha = atlas.color[..., 3]
    return with_alpha(level, unbiased_alpha(alpha, pictures(atlas), gutter, reach=REACH))


def mesh_of(wood: Wood) -> Plant:
    """Wood as the mesh of a hybrid level."""
    count = len(wood.positions)
    return Plant(
        "wood",
        wood.positions,
        wood.normals,
        np.zeros((count, 2)),
        wood.faces,
        np.zeros(len(wood.faces), np.int32),
        (Material("wood", double_sided=True),),
        colors=np.concatenate([wood.colors, np.ones((count, 1))], axis=1),
    )
