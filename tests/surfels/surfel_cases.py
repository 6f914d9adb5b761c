"""Surfaces for the tests of surfels/, small and stiff, and plain references for what is asked."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.lod import Display
from vegtool.meshes.distance import to_triangles
from vegtool.plant import Material, Plant
from vegtool.surfels.multi_triangulation import MultiTriangulation

COARSE = Display(image_height_px=40)
"""For whom a thousand triangles may be simplified through several rounds."""


def surface(
    positions: npt.ArrayLike, faces: npt.ArrayLike, material: npt.ArrayLike | None = None,
    uvs: npt.ArrayLike | None = None, normals: npt.ArrayLike | None = None,
) -> Plant:  # fmt: skip
    """A plant of these triangles, of two materials; all in the first one if none are given."""
    positions, faces = np.asarray(positions, np.float64), np.asarray(faces, np.int32)
    up = np.tile([0.0, 1.0, 0.0], (len(positions), 1))
    return Plant(
        name="test",
        positions=positions,
        normals=up if normals is None else np.asarray(normals),
        uvs=positions[:, [0, 2]] if uvs is None else np.asarray(uvs),
        faces=faces,
        face_material=np.zeros(len(faces), np.int32) if material is None else np.asarray(material),
        materials=(Material("one"), Material("other")),
    )


def grid(rows: int, columns: int) -> np.ndarray:
    """(2 rows columns, 3) triangles between (rows + 1) (columns + 1) vertices, row by row."""
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])


def hills(rows: int = 40, height: float = 0.05, materials: bool = False) -> Plant:
    """A square of side 1 with waves and bumps, 2 rows^2 triangles, looking up (+y); where asked,
    its left and right halves of two materials."""
    z, x = (a.ravel() / rows for a in np.mgrid[: rows + 1, : rows + 1])
    bumps = np.random.default_rng(0).normal(size=len(x))
    y = height * (np.sin(7 * x) * np.cos(5 * z) + 0.1 * bumps)
    faces = grid(rows, rows)
    right = x[faces].mean(axis=1) > 0.5
    return surface(np.stack([x, y, z], axis=1), faces, right if materials else None)


def ball(steps: int = 4, bumps: float = 0.1, center: npt.ArrayLike = (0, 0, 0)) -> Plant:
    """A closed, bumpy sphere of radius 1 and 8 * 4^steps triangles, looking outward."""
    at = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    )
    for _ in range(steps):
        edges = np.sort(np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
        edge, index = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = len(at) + index.reshape(3, -1)
        middle = at[edge].sum(axis=1)
        at = np.concatenate([at, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        a, b, c = faces.T
        faces = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    x, y, z = at.T
    radius = 1 + bumps * np.sin(5 * x) * np.cos(4 * y + 3 * z)
    return surface(at * radius[:, None] + center, faces, normals=at)


def both(one: Plant, other: Plant) -> Plant:
    """Two surfaces as one plant."""
    return surface(
        np.concatenate([one.positions, other.positions]),
        np.concatenate([one.faces, other.faces + len(one.positions)]),
        np.concatenate([one.face_material, other.face_material]),
        np.concatenate([one.uvs, other.uvs]),
        np.concatenate([one.normals, other.normals]),
    )


class Border:
    """The edges of a plant between places, by which cracks in what is drawn of it are found."""

    def __init__(self, plant: Plant) -> None:
        rows = np.unique(plant.positions + 0.0, axis=0, return_inverse=True)[1]
        self.place = rows.ravel().astype(np.int64)
        self.odd, self.single = self.edges(plant.faces)

    def edges(self, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which edges have an odd number of triangles (n, 3), and which a single one; sorted."""
        start, end = (self.place[faces[:, order]].ravel() for order in ([0, 1, 2], [1, 2, 0]))
        key = np.minimum(start, end) << 32 | np.maximum(start, end)
        edge, count = np.unique(key[start != end], return_counts=True)
        return edge[count % 2 == 1], edge[count == 1]

    def assert_kept(self, faces: np.ndarray) -> None:
        """What is drawn has the border of the original: what edges have an odd number of triangles
        are the same ones, as they are on any surface that is deformed while its border stays; and
        of those with a single triangle, none is new."""
        odd, single = self.edges(faces)
        assert np.array_equal(odd, self.odd)
        assert np.isin(single, self.single).all()


def rounds(mt: MultiTriangulation) -> np.ndarray:
    """(n,) how many nodes at most lie between each and the drain, this and itself counted once."""
    depth = np.zeros(len(mt.error), int)
    for start, end in zip(mt.start.tolist(), mt.end.tolist(), strict=True):
        depth[start] = max(depth[start], depth[end] + 1)  # arcs are sorted by their start
    return depth


def scattered(plant: Plant, faces: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """(count, 3) random points of triangles (n, 3) of a plant, as dense everywhere."""
    random = np.random.default_rng(seed)
    a, b, c = plant.positions[faces].swapaxes(0, 1)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    of = random.choice(len(faces), count, p=area / area.sum())
    share = random.dirichlet([1, 1, 1], count)
    return np.einsum("nc,nci->ni", share, plant.positions[faces[of]])


def distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n,) from points to the nearest of triangles (m, 3, 3): of all that may be it."""
    center = corners.mean(axis=1)
    reach = np.linalg.norm(corners - center[:, None], axis=2).max(axis=1)
    away = np.linalg.norm(points[:, None] - center, axis=2)
    nearest = to_triangles(points, corners[away.argmin(axis=1)])
    point, of = np.nonzero(away - reach <= nearest[:, None])
    np.minimum.at(nearest, point, to_triangles(points[point], corners[of]))
    return nearest
