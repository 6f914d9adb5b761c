"""A square with fewer triangles: the group of its quarters clustered anew.

Colditz, Coconu, Deussen, Hege: Real-time rendering of complex photorealistic landscapes using
hybrid level-of-detail approaches (2005), introduction: "representing models and parts of the scene
by dynamically changing sets of billboards". The group of a square's quarters is to a tile what a
plant is to a level: leaves are put into groups (leaf_groups.py), and each group is drawn as one
opaque triangle (refine/foliage.py), or many of them on a plane with a picture (far_planes.py).
What that costs and what it looks like is on docs/methods/reclustering.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.baking.bake import bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import geometric_error
from vegtool.clustering.features import quads
from vegtool.formats.gltf_tile import OwnPictures
from vegtool.gl.pictures import BakedLight
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded, turned
from vegtool.lod import Display, Level, Triangles, level_triangles
from vegtool.measure.metrics import LUMINANCE, reference
from vegtool.measure.pictures import truth
from vegtool.measure.scores import Truths
from vegtool.measure.views import CLOSEST, View, around, direction
from vegtool.plant import Material, Plant
from vegtool.refine.color import LEAST_GAIN, MOST_GAIN, scaled, unbiased_color
from vegtool.refine.coverage import solve_coverage, with_alpha
from vegtool.refine.foliage import Leaves, foliage_of, leaves_of
from vegtool.refine.foliage_groups import Ints
from vegtool.refine.hits import Hits, Rays, hits, nearest
from vegtool.refine.level import REACH
from vegtool.refine.mesh import Scattering, joined
from vegtool.tiles.far_planes import far_planes
from vegtool.tiles.leaf_groups import leaf_groups
from vegtool.timing import timed

SMALL = 5.0
"""Pixels: side of a square as large as what is seen of the leaves for each triangle, up to which
they are opaque. On a square of 205 m, 65,536 triangles (2.9) err by 0.099 (FLIP) and 32,768 (4.2)
by 0.129, in 4 s, as 4 and 2 MB. 16,384 (5.9) err by 0.169, and with pictures by 0.116, in 13 s, as
8 MB; 4,096 (12) by 0.225, and with pictures by 0.161, in 9 s, as 5 MB."""
DENSITY = 0.42
"""Texels per pixel, where a square is seen from nearest. With 1 it errs by 1 % less (FLIP), and has
five times the texels."""
SUPERSAMPLE = 2
"""Samples per axis and texel."""
ORIENTATION = 4.0
"""What it counts in a group that is to be one triangle that leaves look one way
(refine/foliage_groups.py): more than in a plant, since they are large triangles themselves. Of 1,
2, 3, 4 and 6, 3 and 4 gave the least FLIP of a square of squares of triangles."""
LEAST_PIECES, MOST_PIECES, PER_PLANE = 32768, 65536, 32
"""Groups of leaves that planes are fitted to: so many for each plane, within these bounds."""
SUN = direction(135.0, 45.0)
VIEWS = tuple(
    View(direction(azimuth, elevation), SUN)
    for azimuth, elevation in ((20.0, 6.0), (200.0, 15.0), (290.0, 30.0), (110.0, 55.0))
)
"""From where squares are looked at: mostly by walkers, who see them from the side."""
CELLS = 256
"""Rays of each view along the longest extent. Of 160, 256 and 400, a square of squares of triangles
errs by 0.129, 0.124 and 0.116 (FLIP), in 3.7, 4.1 and 5.6 s."""
DRAWN = VIEWS[:2]
"""Those from which pictures are drawn: from opposite sides, since one is in the shade. From above a
square covers what it covers, and fills ten times the pixels."""
OUTSIDE = 1.001
"""Times the nearest distance that a view of all of a group may have."""
PER_BILLBOARD = 2
"""Triangles."""


def group_of(quarters: Sequence[Plant], places: Sequence[FloatArray], name: str) -> Plant:
    """Quarters as one plant, each moved by (3,) metres, with the materials of each."""
    materials: list[Material] = []
    arrays: dict[str, list[np.ndarray]] = {
        key: [] for key in ("positions", "normals", "uvs", "faces", "face_material", "colors")
    }
    first = 0
    for quarter, place in zip(quarters, places, strict=True):
        start = len(materials)
        materials += [replace(m, role="leaf") for m in quarter.materials]
        colors = np.ones((len(quarter.positions), 4)) if quarter.colors is None else quarter.colors
        arrays["positions"].append(quarter.positions + place)
        arrays["normals"].append(quarter.normals)
        arrays["uvs"].append(quarter.uvs)
        arrays["faces"].append(quarter.faces + first)
        arrays["face_material"].append(quarter.face_material + start)
        arrays["colors"].append(colors)
        first += len(quarter.positions)
    joined_up = {key: np.concatenate(parts) for key, parts in arrays.items()}
    return Plant(
        name, joined_up["positions"], joined_up["normals"], joined_up["uvs"],
        joined_up["faces"].astype(np.int32), joined_up["face_material"].astype(np.int32),
        tuple(materials), joined_up["colors"],
    )  # fmt: skip


def reclustered(
    group: Plant, triangles: int, near_m: float, display: Display, max_texture: int
) -> Level:
    """A level of at most so many triangles, for distances from `near_m` metres to its middle on.

    Of kind mesh, opaque and coloured by its vertices; or of kind billboards, where triangles would
    look too large. A group without textures that has no more triangles is a level as it is. Light
    is in its colours where it is in those of all materials. Nothing is random. Raises ValueError
    for a group that covers nothing and for less than one triangle, CapabilityError where pictures
    are wanted and nothing can draw, UsageError where they do not fit into `max_texture` texels.
    """
    if triangles < 1:
        raise ValueError(f"reclustered: expected at least one triangle, got {triangles}")
    seconds: dict[str, float] = {}
    pixel_m = 1 / display.pixels_per_metre(near_m)
    unlit = all(material.unlit for material in group.materials)
    if len(group.faces) <= triangles and opaque(group):
        level = Level("mesh", mesh=group, unlit=unlit, geometric_error_m=(0.0, 0.0))
        return replace(level, near_distance_m=near_m)
    with timed(seconds, "leaves"):
        every = np.arange(len(group.faces), dtype=np.int32)
        eyes = np.stack([view.direction for view in VIEWS])
        leaves = leaves_of(group, every, eyes, CELLS)
        if leaves is None:
            raise ValueError(f"reclustered: expected a group that covers something: {group.name}")
    if seen_pixels(leaves, triangles, pixel_m) > SMALL and triangles >= PER_BILLBOARD:
        level = as_billboards(
            group, leaves, triangles, near_m, display, max_texture, unlit, seconds
        )
    else:
        level = as_triangles(group, leaves, triangles, pixel_m, unlit, seconds)
    return replace(level, near_distance_m=near_m, seconds={**seconds, **level.seconds})


def opaque(group: Plant) -> bool:
    """Whether a group is as `as_triangles` makes them: opaque, without textures, seen from both
    sides."""
    return all(
        m.color_texture is None and m.normal_texture is None and m.alpha_mode == "opaque"
        and m.double_sided for m in group.materials
    )  # fmt: skip


def drawing(level: Level) -> tuple[Triangles, OwnPictures | None]:
    """A reclustered level as `far_glb` writes it: its triangles, with the colours of their vertices
    where there are no pictures."""
    if level.atlas is not None:
        return level_triangles(level), OwnPictures(level.atlas.color, level.atlas.normal)
    mesh = level.mesh
    assert mesh is not None
    count = len(mesh.positions)
    colors = np.ones((count, 4)) if mesh.colors is None else mesh.colors.copy()
    own = np.stack([material.base_color for material in mesh.materials])
    factor = np.ones((count, 4))
    factor[mesh.faces] = own[mesh.face_material][:, None]
    none = np.zeros((count, 4))
    positions, normals = mesh.positions, mesh.normals
    return Triangles(
        positions, normals, none, none[:, :2], mesh.faces.ravel(), colors * factor
    ), None


def seen_pixels(leaves: Leaves, triangles: int, pixel_m: float) -> float:
    """Side, in pixels, of a square as large as what is seen of the leaves for each triangle."""
    area = float(leaves.area @ leaves.seen) * leaves.radius**2
    return float(np.sqrt(area / triangles)) / pixel_m


def as_triangles(
    group: Plant, leaves: Leaves, triangles: int, pixel_m: float, unlit: bool,
    seconds: dict[str, float],
) -> Level:  # fmt: skip
    """Each group of leaves as a triangle, all of them as bright as the leaves."""
    with timed(seconds, "groups"):
        label = leaf_groups(leaves, triangles, pixel_m / leaves.radius, ORIENTATION)
    with timed(seconds, "triangles"):
        # what is left of bias in what they cover is 1 %: less than a round would cost is gained
        foliage = foliage_of(leaves, label, rounds=0)
        mesh = joined([foliage], group.name, [Scattering(unlit)])
        assert mesh is not None
    with timed(seconds, "color"):
        met = hits(leaves.rays, (mesh.corners - leaves.center) / leaves.radius)
        true = luminances(leaves.rays, leaves.found, leaves.color, leaves.shading, unlit)
        shown = luminances(leaves.rays, met, foliage.colors[::3], foliage.normals[::3], unlit)
        known = (true > 0) & (shown > 0)
        gain = 1 / float((shown[known] / true[known]).mean()) if known.any() else 1.0
        level = Level("mesh", mesh=mesh, unlit=unlit)
        level = scaled(level, 1.0, min(max(gain, LEAST_GAIN), MOST_GAIN))
    with timed(seconds, "error"):
        none = np.full(len(group.faces), -1, dtype=np.int32)
        error = geometric_error(group, none, None, level.mesh, none < 0)
    return replace(level, geometric_error_m=error)


def luminances(
    rays: Rays, found: Hits, color: FloatArray, normal: FloatArray, unlit: bool
) -> FloatArray:
    """(d,) mean linear luminance of what the rays of each view meet first, of n faces with those
    colours and normals, (n, 3); 0 where they meet nothing."""
    first = found.of(nearest(found))
    shown = color[first.face]
    if not unlit:
        shown = shaded(shown, turned(normal[first.face], first.front), Light(direction=SUN))
    view = first.ray // rays.cells**2
    count = np.bincount(view, minlength=len(rays.views))
    total = np.bincount(view, shown @ LUMINANCE, len(rays.views))
    return np.asarray(total / np.maximum(count, 1))


def as_billboards(
    group: Plant, leaves: Leaves, triangles: int, near_m: float, display: Display,
    max_texture: int, unlit: bool, seconds: dict[str, float],
) -> Level:  # fmt: skip
    """Groups of leaves on planes, which cover as much as the leaves, and as brightly."""
    density = display.pixels_per_metre(near_m)
    pixel = 1 / density / leaves.radius
    count = triangles // PER_BILLBOARD
    with timed(seconds, "groups"):
        label = piece_labels(group, leaves, count, pixel)
    with timed(seconds, "planes"):
        labels, billboards = far_planes(group, leaves, label, count, pixel)
    options = BakeOptions(
        supersample=SUPERSAMPLE, max_texture=max_texture, sides="double", fit_alpha=False
    )
    with PlantBuffers(group) as buffers:
        lit = BakedLight(Light(direction=SUN)) if unlit else None
        level = bake(buffers, labels, billboards, DENSITY * density, options, lit=lit)
        with timed(seconds, "truth"):
            truths = looks(buffers, REACH * near_m, display)
    with timed(seconds, "coverage"):
        level = covering(level, truths, options.gutter)
    with timed(seconds, "color"):
        level = unbiased_color(level, truths)
    with timed(seconds, "error"):
        error = geometric_error(group, labels, level.billboards)
    return replace(level, geometric_error_m=error)


def piece_labels(group: Plant, leaves: Leaves, planes: int, pixel: float) -> Ints:
    """(n,) pieces of the leaves that planes are fitted to: groups, or where there are few leaves,
    the cards that they are halves of."""
    most = max(min(max(PER_PLANE * planes, LEAST_PIECES), MOST_PIECES), planes)
    if len(leaves) > most:
        return leaf_groups(leaves, most, pixel)
    return np.unique(quads(group)[leaves.face], return_inverse=True)[1]


def covering(level: Level, truths: Truths, gutter: int) -> Level:
    """The level with alpha such that it covers what the truth does; its normals do not matter."""
    assert level.atlas is not None
    bare = replace(level, atlas=replace(level.atlas, normal=None))
    solved = solve_coverage(bare, [truths], gutter, DENSITY, REACH).level
    assert solved.atlas is not None
    return with_alpha(level, solved.atlas.color[..., 3])


def looks(buffers: PlantBuffers, distance_m: float, display: Display) -> Truths:
    """How a group looks from afar, with a sample to the pixel: of thousands of pixels only the
    means count, which are right within 0.1 %. A square on a cliff is looked at from where all of it
    is before the eye."""
    plant = buffers.plant
    radius = float(np.linalg.norm(np.ptp(plant.bounds, axis=0))) / 2
    distance_m = max(distance_m, OUTSIDE * CLOSEST * radius)
    light = Light(direction=SUN)
    box = np.stack(np.meshgrid(*plant.bounds.T), axis=-1).reshape(-1, 3)
    cameras = tuple(around(box, view.direction, distance_m, display) for view in DRAWN)
    found = tuple(reference(truth(buffers, camera, light, supersample=1)) for camera in cameras)
    pixels = plant.extent * display.pixels_per_metre(distance_m)
    return Truths(
        plant, display, DRAWN, np.array([pixels]), np.array([distance_m]), (cameras,), (found,)
    )  # fmt: skip
