"""What goes out: levels of detail, each a mesh, billboards, both or surfels, and their chain.

Field terms: a *billboard* is one textured rectangle fixed in the plant's space; a *cluster* is the
set of faces that it shows; a *shape* is how many billboards show one cluster (1, 2 or 3 crossed).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray, checked, unit
from vegtool.display import Display as Display  # which all that states distances imports
from vegtool.plant import Plant
from vegtool.surfel_set import SurfelSet

if TYPE_CHECKING:
    from vegtool.limits import Limits, Omitted

Kind = Literal["mesh", "billboards", "hybrid", "surfels"]

FADE_FRACTION = 0.15
"""Of its switch distance: beyond it the level before is still drawn, fading out or, for a viewer
that does not fade, until the eye has surely come to stay."""


@dataclass(frozen=True, eq=False)
class Billboards:
    """The planes of a level, p of them.

    center: (p, 3) metres, centre of the rectangle. u, v: (p, 3) unit vectors in the plane, right
    and up as seen from the front; the front's normal is u x v. half_size: (p, 2) metres along u, v.
    half_depth: (p,) metres, half extent of the cluster across the plane; may be 0.
    cluster: (p,) int32, the cluster that the plane shows; crossed planes share theirs.
    """

    center: FloatArray
    u: FloatArray
    v: FloatArray
    half_size: FloatArray
    half_depth: FloatArray
    cluster: IntArray

    def __post_init__(self) -> None:
        center = checked("Billboards.center", self.center, (None, 3), np.float64)
        n = len(center)
        values = {
            "center": center,
            "u": checked("Billboards.u", self.u, (n, 3), np.float64),
            "v": checked("Billboards.v", self.v, (n, 3), np.float64),
            "half_size": checked("Billboards.half_size", self.half_size, (n, 2), np.float64),
            "half_depth": checked("Billboards.half_depth", self.half_depth, (n,), np.float64),
            "cluster": checked("Billboards.cluster", self.cluster, (n,), np.int32),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def normal(self) -> FloatArray:
        """(p, 3) unit vectors: the side from which the front texture is seen."""
        return np.asarray(np.cross(self.u, self.v))


@dataclass(frozen=True, eq=False)
class Atlas:
    """The textures of a level, and where in them each billboard's picture lies.

    color: (h, w, 4) uint8, sRGB, straight alpha, such that as much passes a test at 128 as is
    covered: in each picture (baking/coverage.py), or seen from all sides (refine/coverage.py).
    Colour is carried on where nothing is covered.
    normal: (h, w, 3) uint8, tangent space of the billboard (x along u, y along v); blue is above
    one half but where the source's own shading normals point away from the side that is seen. None
    where light is in the colours.
    depth: (h, w) uint16, signed depth along the side's own normal over the billboard's half_depth:
    32768 is the plane, 65535 half_depth towards the viewer, 1 half_depth behind, 0 nothing.
    front, back: (p, 4) int32 texels x0, y0, width, height (y down from the top row), gutter not
    included. Both pictures have their left edge at -u and their top edge at +v, so the back's is
    the mirror image of what one sees from behind; a back normal's z points along -(u x v).
    back equals front where one picture serves both sides.
    white: (4,) int32 texels, as front: a block of opaque white with a flat normal, for a mesh in
    the same draw call to show all over; or None.
    charts: (c, 4) int32 texels, as front: opaque pictures for that mesh (`Charts`); or None.
    light: (h, w, 4) uint8, linear, what `Material.light_texture` holds: how much of the sky's light
    reaches the side that the picture shows (red) and the other side (green), and how much light
    passes through (alpha), in the colour times transmission_tint, (3,); blue is 0. Or None where
    all does and none passes.
    """

    color: ByteArray
    normal: ByteArray | None
    depth: np.ndarray
    front: IntArray
    back: IntArray
    white: IntArray | None = None
    charts: IntArray | None = None
    light: ByteArray | None = None
    transmission_tint: FloatArray = field(default_factory=lambda: np.ones(3))

    def __post_init__(self) -> None:
        color = checked("Atlas.color", self.color, (None, None, 4), np.uint8)
        height, width = color.shape[:2]
        front = checked("Atlas.front", self.front, (None, 4), np.int32)
        values = {
            "color": color,
            "depth": checked("Atlas.depth", self.depth, (height, width), np.uint16),
            "front": front,
            "back": checked("Atlas.back", self.back, (len(front), 4), np.int32),
        }
        tint = checked("Atlas.transmission_tint", self.transmission_tint, (3,), np.float64)
        values["transmission_tint"] = tint
        if self.normal is not None:
            values["normal"] = checked("Atlas.normal", self.normal, (height, width, 3), np.uint8)
        if self.white is not None:
            values["white"] = checked("Atlas.white", self.white, (4,), np.int32)
        if self.charts is not None:
            values["charts"] = checked("Atlas.charts", self.charts, (None, 4), np.int32)
        if self.light is not None:
            values["light"] = checked("Atlas.light", self.light, (height, width, 4), np.uint8)
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def texels(self) -> int:
        """Texels of one channel set: width times height."""
        return int(self.color.shape[0] * self.color.shape[1])

    @property
    def images(self) -> int:
        """How many images a client loads: colour, and normals and light where there are any."""
        return 1 + (self.normal is not None) + (self.light is not None)


@dataclass(frozen=True, eq=False)
class Charts:
    """What a level's mesh shows of its atlas, where that is more than white.

    planes: (c,) of which each picture is, seen from the front: a point of the mesh shows what lies
    beneath it on the plane of its face. of_face: (t,) int32 the plane of each of the mesh's faces,
    -1 for those that are white and coloured by their vertices. No vertex is of two.
    """

    planes: Billboards
    of_face: IntArray

    def __post_init__(self) -> None:
        of_face = checked("Charts.of_face", self.of_face, (None,), np.int32)
        object.__setattr__(self, "of_face", of_face)


@dataclass(frozen=True)
class Spread:
    """A figure over several views: its mean, standard deviation, least and greatest value."""

    mean: float
    sd: float
    low: float
    high: float


@dataclass(frozen=True)
class Measured:
    """How wrong a level is from where it may be used on, over a set of views.

    pixels: size of the plant's longest extent there. kind, count: the views (measure/views.py).
    errors: by metric (measure/metrics.py). live: the same of the original as a client draws it.
    held_out: FLIP from as many views, under suns, that were not used to choose the distance; or
    None where that was not asked for.
    """

    pixels: float
    kind: str
    count: int
    errors: dict[str, Spread]
    live: dict[str, Spread]
    held_out: Spread | None = None


@dataclass(frozen=True, eq=False)
class Level:
    """One level of detail: a mesh (a Plant), billboards with their atlas, both, or surfels.

    kind: a hybrid level is billboards, of which there may be none, and an opaque mesh without
    textures of its own, coloured by its vertices or by the atlas (`charts`), which are drawn as one
    (`level_triangles`): the atlas has a white block.
    double_sided: one quad per billboard, drawn from both sides with one picture (the client flips
    the normal on the back). Else two opposite single-sided quads, each with its own picture; a
    hybrid's mesh then has its double-sided faces twice.
    texels_per_metre: density of the atlas. near_distance_m: from here on the level may be used.
    geometric_error_m: (maximum, 95th percentile) of DESIGN section 7, or None if not computed.
    measured: its errors at near_distance_m, or None where they were not measured.
    unlit: light is in the colours already, of one sun and its shadows; clients add none.
    seconds: how long each stage of making it took.
    """

    kind: Kind
    mesh: Plant | None = None
    billboards: Billboards | None = None
    atlas: Atlas | None = None
    double_sided: bool = True
    texels_per_metre: float = 0.0
    near_distance_m: float = 0.0
    geometric_error_m: tuple[float, float] | None = None
    measured: Measured | None = None
    unlit: bool = False
    seconds: dict[str, float] = field(default_factory=dict)
    charts: Charts | None = None
    surfels: SurfelSet | None = None

    def __post_init__(self) -> None:
        if self.kind == "mesh" and self.mesh is None:
            raise ValueError("Level: a mesh level needs its mesh")
        if self.kind == "surfels" and not self.surfels:
            raise ValueError("Level: a level of surfels needs one at least")
        if self.kind in ("billboards", "hybrid") and (
            self.billboards is None or self.atlas is None
        ):
            raise ValueError("Level: a billboard level needs billboards and an atlas")
        if self.kind == "hybrid":
            self._check_hybrid()
        pair = self.billboards, self.atlas
        if pair[0] is not None and pair[1] is not None and len(pair[1].front) != len(pair[0]):
            raise ValueError("Level: the atlas needs one rectangle per billboard")

    def _check_hybrid(self) -> None:
        if self.mesh is None or self.mesh.colors is None:
            raise ValueError("Level: a hybrid level needs a mesh with colours")
        if self.atlas is None or self.atlas.white is None:
            raise ValueError("Level: a hybrid level needs an atlas with a white block")
        if self.charts is not None and (
            self.atlas.charts is None
            or len(self.atlas.charts) != len(self.charts.planes)
            or len(self.charts.of_face) != len(self.mesh.faces)
        ):
            raise ValueError("Level: charts need a picture each, and to be of the mesh's faces")
        for m in self.mesh.materials:
            if m.color_texture or m.normal_texture or m.alpha_mode != "opaque":
                raise ValueError(f"Level: material {m.name} of a hybrid must be opaque and plain")

    @property
    def triangles(self) -> int:
        """Triangles as they stand in the file."""
        quads = 0 if self.billboards is None else len(self.billboards)
        return self.mesh_triangles + quads * (2 if self.double_sided else 4)

    @property
    def mesh_triangles(self) -> int:
        """Those of them that are the mesh's."""
        if self.mesh is None:
            return 0
        if self.kind == "mesh" or self.double_sided:
            return len(self.mesh.faces)
        twice = np.array([m.double_sided for m in self.mesh.materials])
        return len(self.mesh.faces) + int(twice[self.mesh.face_material].sum())

    @property
    def texels(self) -> int:
        """Texels of all the level's textures (colour, normal and light counted each)."""
        if self.atlas is not None:
            return self.atlas.images * self.atlas.texels
        if self.mesh is None:
            return 0
        textures = [
            (m.color_texture, m.normal_texture, m.light_texture) for m in self.mesh.materials
        ]
        images = [texture for three in textures for texture in three if texture]
        unique = {id(t): t.pixels.shape[0] * t.pixels.shape[1] for t in images}
        return int(sum(unique.values()))


@dataclass(frozen=True, eq=False)
class ShadowProxy:
    """What throws a plant's shadow with few triangles (refine/shadow_proxy.py).

    level: white, unlit and without normal texture. errors: by metric, coverage_bias and silhouette,
    of how it looks from `suns` suns, the plant's longest extent `pixels` large. live: the same of
    the original as a client draws it.
    """

    level: Level
    pixels: float
    suns: int
    errors: dict[str, Spread]
    live: dict[str, Spread]


@dataclass(frozen=True, eq=False)
class LodChain:
    """All levels of a plant: levels[0] is the original, then coarser and coarser; of a chain that
    is for the eyes of a scene, the finest that is of use there.

    options: everything that shaped the result, as plain values, for the manifest.
    notes: sentences for the user: levels that were left out, and why.
    baked: the light in the levels' colours, as plain values for the manifest; empty where clients
    light them.
    shadow: what throws the plant's shadow in place of its levels, or None.
    misses: sentences on limits that were asked for, and could not be kept.
    beside: further files of it, by the ending of their names.
    limits: the eyes that it is for, or None for any; omitted: what it does without for that.
    plant: the original, where that is no level of it; else None.
    """

    name: str
    levels: tuple[Level, ...]
    display: Display
    seed: int
    options: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    baked: dict[str, float] = field(default_factory=dict)
    shadow: ShadowProxy | None = None
    misses: tuple[str, ...] = ()
    beside: Mapping[str, bytes] = field(default_factory=dict)
    limits: Limits | None = None
    omitted: tuple[Omitted, ...] = ()
    plant: Plant | None = None

    @property
    def original(self) -> Plant:
        """What the levels stand for. Raises ValueError for a chain that does not know."""
        found = self.levels[0].mesh if self.plant is None else self.plant
        if found is None:
            raise ValueError("LodChain: level 0 must be a mesh, or the original be given")
        return found

    @property
    def coarser(self) -> dict[int, Level]:
        """The levels that stand for the original, by their index."""
        first = 1 if self.plant is None else 0
        return dict(list(enumerate(self.levels))[first:])


@dataclass(frozen=True, eq=False)
class Triangles:
    """A level with an atlas as the triangles that a client draws, v vertices and f faces.

    positions (v, 3), normals (v, 3), tangents (v, 4; w is the bitangent's sign) and uvs (v, 2)
    float64; indices (3f,) int32. colors: (v, 4) linear factors of the texture, or None.
    """

    positions: FloatArray
    normals: FloatArray
    tangents: FloatArray
    uvs: FloatArray
    indices: IntArray
    colors: FloatArray | None = None


def level_triangles(level: Level) -> Triangles:
    """What a client draws of a level with an atlas, in one call: its quads, then its mesh.

    Vertices of a hybrid's mesh that are on no chart show the middle of the white block: their
    texture coordinates stand still over every face, so that clients sample it at full size,
    whatever the distance. Their normals are the vertices' own (the block's normal is flat), so that
    any tangent will do.
    """
    quads = billboard_quads(level)
    if level.kind != "hybrid":
        return quads
    mesh, atlas = level.mesh, level.atlas
    assert mesh is not None and mesh.colors is not None
    assert atlas is not None and atlas.white is not None
    height, width = atlas.color.shape[:2]
    x0, y0, w, h = atlas.white.astype(np.float64)
    white = (x0 + w / 2) / width, (y0 + h / 2) / height
    parts = [replace(quads, colors=np.ones((len(quads.positions), 4)))]
    for index in np.unique(mesh.face_material):
        material = mesh.materials[index]
        own = mesh.face_material == index
        vertices, corners = np.unique(mesh.faces[own], return_inverse=True)
        count = len(vertices)
        colors = np.clip(mesh.colors[vertices] * material.base_color, 0.0, 1.0)
        colors[:, 3] = 1.0
        normals = mesh.normals[vertices]
        front = Triangles(
            mesh.positions[vertices],
            normals,
            np.concatenate([_perpendicular(normals), np.ones((count, 1))], axis=1),
            np.tile(white, (count, 1)),
            corners.ravel().astype(np.int32),
            colors,
        )
        if level.charts is not None:
            chart = np.empty(count, dtype=np.int32)
            chart[corners.reshape(-1, 3)] = level.charts.of_face[own][:, None]
            front = _pictured(front, chart, level.charts.planes, atlas)
        parts.append(front)
        if material.double_sided and not level.double_sided:
            back = replace(front, normals=-front.normals, indices=front.indices[::-1])
            if level.charts is not None:  # pictures are mirrored, as those of billboards are
                back = replace(back, tangents=back.tangents * [1, 1, 1, -1])
            parts.append(back)
    return _joined(parts)


def _pictured(drawn: Triangles, chart: IntArray, planes: Billboards, atlas: Atlas) -> Triangles:
    """The same with pictures: chart (v,), -1 for none. Normals and tangents are the planes'."""
    assert atlas.charts is not None
    shown = np.flatnonzero(chart >= 0)
    plane = chart[shown]
    height, width = atlas.color.shape[:2]
    offset = drawn.positions[shown] - planes.center[plane]
    half = np.maximum(planes.half_size[plane], np.finfo(float).tiny)
    across = np.einsum("vi,vi->v", offset, planes.u[plane]) / half[:, 0]
    up = np.einsum("vi,vi->v", offset, planes.v[plane]) / half[:, 1]
    x0, y0, w, h = atlas.charts[plane].astype(np.float64).T
    uvs, normals, tangents = drawn.uvs.copy(), drawn.normals.copy(), drawn.tangents.copy()
    uvs[shown, 0] = (x0 + w * (np.clip(across, -1, 1) + 1) / 2) / width
    uvs[shown, 1] = (y0 + h * (1 - np.clip(up, -1, 1)) / 2) / height
    normals[shown] = planes.normal[plane]
    tangents[shown, :3], tangents[shown, 3] = planes.u[plane], 1.0
    return replace(drawn, uvs=uvs, normals=normals, tangents=tangents)


def _perpendicular(normals: FloatArray) -> FloatArray:
    """(n, 3) unit vectors, some direction perpendicular to each."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    across = np.cross(normals, axis)
    return np.asarray(np.where(across.any(axis=1, keepdims=True), unit(across), axis))


def _joined(parts: list[Triangles]) -> Triangles:
    """All parts as one, in order."""
    first = np.cumsum([0, *(len(part.positions) for part in parts)])
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in (f.name for f in fields(Triangles) if f.name != "indices")
    }
    indices = [part.indices + start for part, start in zip(parts, first, strict=False)]
    return Triangles(**arrays, indices=np.concatenate(indices).astype(np.int32))


def billboard_quads(level: Level) -> Triangles:
    """The quads of a level: one per billboard if double-sided, else front and back; 4 vertices
    each, lower left, lower right, upper right and upper left as seen from the front.

    Both quads of a pair keep the corner positions' texture coordinates (Atlas.back is stored
    mirrored), so the back's tangent runs along u like the front's: its normal turns, its tangent
    frame is mirrored, hence w = -1.
    """
    b, atlas = level.billboards, level.atlas
    if b is None or atlas is None:
        raise ValueError("billboard_quads: needs a level with billboards")
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float64)
    steps = signs[None] * b.half_size[:, None]  # (p, 4, 2)
    corners = b.center[:, None] + steps[..., :1] * b.u[:, None] + steps[..., 1:] * b.v[:, None]
    height, width = atlas.color.shape[:2]

    def uvs(rect: IntArray) -> FloatArray:
        x0, y0, w, h = rect.astype(np.float64).T
        left, right, top, bottom = x0 / width, (x0 + w) / width, y0 / height, (y0 + h) / height
        return np.stack(
            [
                np.stack([left, bottom], 1),
                np.stack([right, bottom], 1),
                np.stack([right, top], 1),
                np.stack([left, top], 1),
            ],
            axis=1,
        )

    def tangents(w: float) -> FloatArray:
        rows = np.concatenate([b.u, np.full((len(b), 1), w)], axis=1)
        return np.repeat(rows, 4, axis=0)

    triangle = np.array([0, 1, 2, 0, 2, 3], dtype=np.int32)
    base = 4 * np.arange(len(b), dtype=np.int32)[:, None]
    front = Triangles(
        corners.reshape(-1, 3),
        np.repeat(b.normal, 4, axis=0),
        tangents(1.0),
        uvs(atlas.front).reshape(-1, 2),
        (base + triangle).ravel(),
    )
    if level.double_sided:
        return front
    return Triangles(
        np.concatenate([front.positions, front.positions]),
        np.concatenate([front.normals, -front.normals]),
        np.concatenate([front.tangents, tangents(-1.0)]),
        np.concatenate([front.uvs, uvs(atlas.back).reshape(-1, 2)]),
        np.concatenate([front.indices, (4 * len(b) + base + triangle[::-1]).ravel()]),
    )
