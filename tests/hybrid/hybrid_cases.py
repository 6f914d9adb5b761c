"""Small plants for hybrids, and what a descent costs, counted anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from surfaces import grid_faces

from vegtool.hybrid.cost import PER_BILLBOARD, Terms
from vegtool.hybrid.greedy import Descent
from vegtool.plant import Material, Plant

BARK = Material("bark")
LEAF = Material("leaf", alpha_mode="mask", double_sided=True, role="leaf")


def mesh(positions: npt.ArrayLike, faces: npt.ArrayLike, material: Material = BARK) -> Plant:
    """A plant of one material, all of its normals up."""
    points = np.asarray(positions, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int32).reshape(-1, 3)
    return Plant(
        "test",
        points,
        np.tile([0.0, 1.0, 0.0], (len(points), 1)),
        np.zeros((len(points), 2)),
        faces,
        np.zeros(len(faces), dtype=np.int32),
        (material,),
    )


def together(*plants: Plant) -> Plant:
    """One plant of several; bark is material 0, leaves 1."""
    first = np.cumsum([0, *(len(p.positions) for p in plants)])
    whole = mesh(
        np.concatenate([p.positions for p in plants]),
        np.concatenate([p.faces + at for p, at in zip(plants, first, strict=False)]),
    )
    material = [np.full(len(p.faces), int(p.materials[0] is LEAF)) for p in plants]
    return replace(whole, face_material=np.concatenate(material), materials=(BARK, LEAF))


def ball(center: npt.ArrayLike = (0.0, 0.0, 0.0), rows: int = 6, columns: int = 9) -> Plant:
    """A unit sphere with a seam and a vertex for each triangle at its poles, which are welded."""
    down, around = np.mgrid[: rows + 1, : columns + 1]
    theta, phi = np.pi * down.ravel() / rows, 2 * np.pi * (around.ravel() % columns) / columns
    out = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], 1)
    return mesh(out + np.asarray(center), grid_faces(rows, columns)[:, ::-1])


def tube(foot: npt.ArrayLike, radius: float, height: float, sides: int, rings: int) -> Plant:
    """An open upright tube."""
    up, around = np.mgrid[: rings + 1, : sides + 1]
    phi = 2 * np.pi * (around.ravel() % sides) / sides
    out = np.stack([np.sin(phi), np.zeros_like(phi), np.cos(phi)], axis=1)
    points = radius * out + np.asarray(foot, float)
    points[:, 1] += height * up.ravel() / rings
    return mesh(points, grid_faces(rings, sides))


def leaves(count: int, seed: int = 0, size: float = 0.1) -> Plant:
    """Square cards, turned at random, in a unit cube about (0, 2, 0)."""
    random = np.random.default_rng(seed)
    middle = random.uniform(-0.5, 0.5, (count, 1, 3)) + np.array([0.0, 2.0, 0.0])
    frame = np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
    u, v = size * frame[:, :1], size * frame[:, 1:2]
    corners = np.concatenate(
        [middle - u - v, middle + u - v, middle + u + v, middle - u + v], axis=1
    )
    faces = 4 * np.arange(count)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return mesh(corners.reshape(-1, 3), faces.reshape(-1, 3), LEAF)


def tree() -> Plant:
    """A trunk of 280 triangles, a branch of 48, and 60 leaf cards."""
    return together(
        tube((0, 0, 0), 0.15, 2.0, 14, 10), tube((0.4, 1.2, 0), 0.03, 0.6, 6, 4), leaves(60)
    )


def book() -> Plant:
    """Five squares of 18 triangles that share an edge of three: not a manifold."""
    angle = np.arange(5) * 1.1
    pages = []
    for turn in angle:
        out, up = (a.ravel() for a in np.mgrid[:4, :4].astype(float))
        points = np.stack([out * np.cos(turn), up, out * np.sin(turn)], axis=1)
        pages.append(mesh(points, grid_faces(3, 3)))
    return together(*pages)


def counted(now: Descent) -> Terms:
    """The terms of a hybrid, from its faces, boards and parts alone."""
    cloud, in_mesh = now.cloud, now.in_mesh
    boards = [pairs for pairs in now.pairs if len(pairs)]
    corners = [now.extents[pairs] for pairs in boards]
    sides = [(e[:, 1::2].max(axis=0) - e[:, 0::2].min(axis=0)) for e in corners]
    parts = now.parts.values()
    faces = len(cloud.plant.faces)
    areas = sum(float(part.surface.areas.sum()) for part in parts)
    triangles = sum(len(part.surface.faces) for part in parts)
    return Terms(
        float(now.wrong[~in_mesh].sum()) + sum(part.terms.error for part in parts),
        (PER_BILLBOARD * len(boards) + triangles) / faces,
        (sum(float(np.prod(side)) for side in sides) + areas) / now.total,
    )


def shown_once(now: Descent) -> bool:
    """Whether each face is either shown by a billboard or in the mesh, and in one part of that."""
    on_boards = np.zeros(len(now.part_of), dtype=np.int64)
    for pairs in now.pairs:
        on_boards[now.cloud.face[pairs]] = 1
    in_parts = np.zeros(len(now.part_of), dtype=np.int64)
    for part in now.parts.values():
        in_parts[part.faces] += 1
    return bool((on_boards + in_parts == 1).all() and (in_parts == now.in_mesh).all())
