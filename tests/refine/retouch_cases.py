"""Levels of random pictures and triangles, made by hand: nothing is drawn."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray, unit
from vegtool.lod import Atlas, Billboards, Level
from vegtool.plant import Material, Plant
from vegtool.refine.retouch import normal_bytes
from vegtool.seeding import generator

SIZE = (32, 64)
RECTS = np.array([[2, 2, 8, 6], [14, 2, 5, 9], [24, 3, 7, 7], [2, 18, 6, 8], [14, 18, 9, 4]])
WHITE = np.array([50, 20, 4, 4])
COUNT = 3


def random_level(
    seed: int = 0, opposite: bool = False, mesh: bool = True, unlit: bool = False
) -> Level:
    """Three billboards, at random; opposite: the last two have pictures of their own behind. The
    mesh has a material that is seen from both sides and one that is not."""
    random = generator(seed, "level")
    color = random.integers(40, 200, (*SIZE, 4)).astype(np.uint8)
    normal = normal_bytes(random.normal(size=(*SIZE, 3)) * [0.5, 0.5, 0] + [0, 0, 1])
    if mesh:
        x, y, w, h = WHITE
        block = np.s_[y - 2 : y + h + 2, x - 2 : x + w + 2]
        color[block], normal[block] = 255, (128, 128, 255)
    front = RECTS[:COUNT]
    back = np.concatenate([RECTS[:1], RECTS[COUNT:]]) if opposite else front
    frames = [np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(COUNT)]
    boards = Billboards(
        random.uniform(-2, 2, (COUNT, 3)),
        np.array([frame[0] for frame in frames]),
        np.array([frame[1] for frame in frames]),
        random.uniform(0.3, 1, (COUNT, 2)),
        np.zeros(COUNT),
        np.arange(COUNT),
    )
    atlas = Atlas(
        color, None if unlit else normal, np.zeros(SIZE), front, back, WHITE if mesh else None
    )
    return Level(
        "hybrid" if mesh else "billboards",
        random_mesh(seed) if mesh else None,
        boards,
        atlas,
        double_sided=not opposite,
        unlit=unlit,
    )


def random_mesh(seed: int = 0) -> Plant:
    """Eight triangles of two materials, in no order, that share some of their vertices."""
    random = generator(seed, "mesh")
    count = 12
    colors = np.ones((count, 4))
    colors[:, :3] = random.uniform(0.1, 0.5, (count, 3))
    return Plant(
        "mesh",
        random.uniform(-2, 2, (count, 3)),
        unit(random.normal(size=(count, 3))),
        np.zeros((count, 2)),
        np.array([random.choice(count, 3, replace=False) for _ in range(8)]),
        np.array([0, 1, 1, 0, 1, 0, 1, 1]),
        (Material("one"), Material("both", double_sided=True)),
        colors,
    )


def within(rect: IntArray, gutter: int = 0) -> tuple[slice, slice]:
    x, y, w, h = rect.tolist()
    return np.s_[y - gutter : y + h + gutter, x - gutter : x + w + gutter]


def in_space(normal: ByteArray, boards: Billboards, number: int, side: float) -> FloatArray:
    """(n, 3) unit normals of texels (..., 3) of a billboard's picture, as seen from a side."""
    frame = np.stack([boards.u[number], boards.v[number], side * boards.normal[number]])
    return np.asarray(unit((normal.reshape(-1, 3) / 127.5 - 1) @ frame))


def pictures(level: Level) -> list[tuple[int, float, IntArray]]:
    """Billboard, side and rectangle of each picture that belongs to one side, or to both."""
    atlas = level.atlas
    assert atlas is not None
    shown = [(i, 1.0, rect) for i, rect in enumerate(atlas.front)]
    for i, rect in enumerate(atlas.back):
        if (rect != atlas.front[i]).any():
            shown.append((i, -1.0, rect))
    return shown
