"""What comes in: a plant as flat arrays, in metres, y up, right-handed, as glTF.

Reading (formats/) makes one of these from any file; every operation takes it and none changes it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray, checked

AlphaMode = Literal["opaque", "mask"]
Role = Literal["wood", "leaf"]


@dataclass(frozen=True, eq=False)
class Texture:
    """A decoded image.

    pixels: (height, width, 4) uint8, straight alpha; sRGB for colour, linear for normals; the
    first row is the top one, where v = 0.
    encoded, mime_type: the file's own bytes where pixels are exactly what they decode to, so that
    a writer may pass them on without encoding again; else None.
    """

    name: str
    pixels: ByteArray
    encoded: bytes | None = None
    mime_type: Literal["image/png", "image/jpeg", "image/webp"] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "pixels", checked(f"Texture {self.name}", self.pixels, (None, None, 4), np.uint8)
        )


@dataclass(frozen=True, eq=False)
class Material:
    """A surface, in glTF's terms.

    base_color: (4,) linear factor that multiplies the colour texture; its alpha too.
    color_texture: sRGB RGBA, or None for white. normal_texture: tangent space, or None.
    alpha_mode: "mask" discards where alpha < alpha_cutoff; "opaque" ignores alpha. (A file's BLEND
    is read as mask: leaves are cut out, not glass.)
    role: wood or leaf, which branches, hybrids and lighting ask.
    transmission: share, 0 to 1, of the light on one side that leaves by the other, scattered, as
    through a leaf; its colour is the surface's own times transmission_tint, (3,) linear.
    unlit: colours are what is seen, whatever light there is, as where light is baked into them.
    light_texture: what is baked of light beside colour: red and green times `Plant.exposure`, alpha
    times transmission; or None for white.
    """

    name: str
    base_color: FloatArray = field(default_factory=lambda: np.ones(4))
    color_texture: Texture | None = None
    normal_texture: Texture | None = None
    normal_scale: float = 1.0
    alpha_mode: AlphaMode = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    metallic: float = 0.0
    roughness: float = 0.9
    role: Role = "wood"
    transmission: float = 0.0
    transmission_tint: FloatArray = field(default_factory=lambda: np.ones(3))
    unlit: bool = False
    light_texture: Texture | None = None

    def __post_init__(self) -> None:
        factor = checked(f"Material {self.name}: base_color", self.base_color, (4,), np.float64)
        object.__setattr__(self, "base_color", factor)
        what = f"Material {self.name}: transmission_tint"
        object.__setattr__(
            self, "transmission_tint", checked(what, self.transmission_tint, (3,), np.float64)
        )
        if not 0 <= self.transmission <= 1:
            raise ValueError(f"Material {self.name}: transmission must lie in 0..1")

    @property
    def textures(self) -> tuple[Texture, ...]:
        """Those that it has."""
        three = self.color_texture, self.normal_texture, self.light_texture
        return tuple(texture for texture in three if texture is not None)


@dataclass(frozen=True, eq=False)
class Branches:
    """Which branch every face belongs to, and how the branches hang together.

    face_branch: (f,) int32 index of the face's branch, leaves included.
    parent: (b,) int32 index of the branch it grows from, -1 for a trunk.
    level: (b,) int32, 0 for a trunk, one more for each fork (parent's level + 1).
    source: where the knowledge comes from.
    """

    face_branch: IntArray
    parent: IntArray
    level: IntArray
    source: Literal["nodes", "groups", "skeleton", "attribute", "generator", "recovered"]

    def __post_init__(self) -> None:
        parent = checked("Branches.parent", self.parent, (None,), np.int32)
        count = len(parent)
        level = checked("Branches.level", self.level, (count,), np.int32)
        face_branch = checked("Branches.face_branch", self.face_branch, (None,), np.int32, count)
        if count and (parent.max() >= count or parent.min() < -1):
            raise ValueError("Branches.parent: indices must lie in -1..b-1")
        expected = np.where(parent < 0, 0, level[parent] + 1)
        if not np.array_equal(level, expected):
            raise ValueError("Branches.level: must be 0 for trunks and the parent's plus one else")
        for name, value in (("parent", parent), ("level", level), ("face_branch", face_branch)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.parent)

    def ancestor_at(self, level: int) -> IntArray:
        """(b,) int32: for each branch its ancestor at `level`; a branch above it is its own."""
        ancestor = np.arange(len(self), dtype=np.int32)
        for current in range(int(self.level.max(initial=0)), level, -1):
            here = self.level[ancestor] == current
            ancestor[here] = self.parent[ancestor[here]]
        return ancestor


@dataclass(frozen=True, eq=False)
class Plant:
    """A plant model.

    positions: (v, 3) float64 metres, y up. normals: (v, 3) float64 unit vectors.
    uvs: (v, 2) float64, glTF's convention: (0, 0) is the texture's top left corner.
    colors: (v, 4) float64 linear factors, or None.
    exposure: (v, 2) float64, 0 to 1, how much of the sky's light the plant itself lets through to
    the vertex, from the side of its normal and from the other side; or None for all of it.
    faces: (f, 3) int32 vertex indices, counter-clockwise from outside.
    face_material: (f,) int32 index into materials.
    branches: what the file itself says of its branches, or None.
    notes: sentences on what the reader repaired, dropped or guessed; shown to the user.
    source: path or name of where it came from, for messages.
    """

    name: str
    positions: FloatArray
    normals: FloatArray
    uvs: FloatArray
    faces: IntArray
    face_material: IntArray
    materials: tuple[Material, ...]
    colors: FloatArray | None = None
    exposure: FloatArray | None = None
    branches: Branches | None = None
    notes: tuple[str, ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        positions = checked("Plant.positions", self.positions, (None, 3), np.float64)
        count = len(positions)
        normals = checked("Plant.normals", self.normals, (count, 3), np.float64)
        uvs = checked("Plant.uvs", self.uvs, (count, 2), np.float64)
        faces = checked("Plant.faces", self.faces, (None, 3), np.int32, count)
        if not len(faces):
            raise ValueError("Plant.faces: a plant needs at least one face")
        face_material = checked(
            "Plant.face_material", self.face_material, (len(faces),), np.int32, len(self.materials)
        )
        if self.colors is not None:
            colors = checked("Plant.colors", self.colors, (count, 4), np.float64)
            object.__setattr__(self, "colors", colors)
        if self.exposure is not None:
            exposure = checked("Plant.exposure", self.exposure, (count, 2), np.float64)
            object.__setattr__(self, "exposure", exposure)
        if self.branches is not None and len(self.branches.face_branch) != len(faces):
            raise ValueError("Plant.branches: one branch per face expected")
        for name, value in (
            ("positions", positions),
            ("normals", normals),
            ("uvs", uvs),
            ("faces", faces),
            ("face_material", face_material),
        ):
            object.__setattr__(self, name, value)

    @cached_property
    def corners(self) -> FloatArray:
        """(f, 3, 3) metres: the three corner positions of every face."""
        return np.asarray(self.positions[self.faces])

    @cached_property
    def face_area_vectors(self) -> FloatArray:
        """(f, 3) square metres: half the cross product of two edges, along the face's normal."""
        c = self.corners
        return np.asarray(0.5 * np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]))

    @cached_property
    def face_areas(self) -> FloatArray:
        """(f,) square metres."""
        return np.asarray(np.linalg.norm(self.face_area_vectors, axis=1))

    @cached_property
    def face_centroids(self) -> FloatArray:
        """(f, 3) metres."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) metres: least and greatest corner of the vertices that faces use."""
        used = np.zeros(len(self.positions), dtype=bool)
        used[self.faces] = True
        corners = self.positions[used]
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def center(self) -> FloatArray:
        """(3,) metres: middle of the bounds."""
        return np.asarray(self.bounds.mean(axis=0))

    @property
    def height(self) -> float:
        """Metres, along y."""
        return float(self.bounds[1, 1] - self.bounds[0, 1])

    @property
    def extent(self) -> float:
        """Metres: the longest side of the bounds, which of a tree is its height."""
        return float((self.bounds[1] - self.bounds[0]).max())

    @property
    def radius(self) -> float:
        """Metres: half the diagonal of the bounds; the plant lies within this of its center."""
        return float(0.5 * np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def face_is_leaf(self) -> np.ndarray:
        """(f,) bool: faces whose material is a leaf's."""
        is_leaf = np.array([m.role == "leaf" for m in self.materials])
        return np.asarray(is_leaf[self.face_material])
