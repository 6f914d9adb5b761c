"""A broadleaf tree all of geometry: wood as tubes, leaves of two triangles each, no alpha."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solids.shapes import linear
from vegtool.arrays import unit
from vegtool.growth import sample
from vegtool.growth.solids import vertex_normals
from vegtool.plant import Material, Plant
from vegtool.seeding import generator

WIDE = 0.7
"""Width of a leaf, as a share of that of the card whose place it takes."""
WIDEST = 0.42
"""Where it is that wide, as a share of its length."""
FOLD = 0.12
"""How far its sides are raised above the midrib, as a share of the card's width."""
GREENS = ("#33501d", "#7d9a3f")
"""Between them are the leaves' colours."""


def tree(triangles: int = 50_200) -> Plant:
    """Of exactly so many triangles, 10 m tall: the broadleaf sample with one leaf in the place of
    each card, which shows a twig of them there. The last may be half a leaf."""
    grown = sample("broadleaf", triangles + 1)  # it comes within one of what it is asked for
    assert grown.branches is not None
    leaves = np.flatnonzero(grown.face_is_leaf)
    card = grown.faces[leaves].reshape(-1, 6)[:, [0, 1, 2, 5]]
    positions, colors = grown.positions.copy(), np.ones((len(grown.positions), 4))
    positions[card] = _leaf(positions[card])
    dark, bright = (np.array(linear(color)) for color in GREENS)
    share = generator(0, "tree", "greens").uniform(size=(len(card), 1, 1))
    colors[card] = dark + share * (bright - dark)

    kept = np.ones(len(grown.faces), dtype=bool)
    kept[leaves[len(leaves) - (len(grown.faces) - triangles) :]] = False
    used, faces = np.unique(grown.faces[kept], return_inverse=True)
    faces = faces.reshape(-1, 3)
    normals = np.where(
        np.isin(used, card)[:, None],
        vertex_normals(positions[used], faces),
        grown.normals[used],
    )
    bark, _ = grown.materials
    return replace(
        grown,
        name="tree",
        positions=positions[used],
        normals=normals,
        uvs=grown.uvs[used],
        colors=colors[used],
        faces=faces,
        face_material=grown.face_material[kept],
        materials=(bark, Material("leaf", double_sided=True, roughness=0.7, role="leaf")),
        branches=replace(grown.branches, face_branch=grown.branches.face_branch[kept]),
        source="benchmarks/solids, tree",
    )


def _leaf(card: np.ndarray) -> np.ndarray:
    """(n, 4, 3) foot, right side, tip, left side of leaves, folded along the midrib, on cards of
    corners (n, 4, 3): foot left and right, tip right and left."""
    foot, tip = card[:, :2].mean(axis=1), card[:, 2:].mean(axis=1)
    across = card[:, 1] - card[:, 0]
    up = FOLD * np.linalg.norm(across, axis=1, keepdims=True) * unit(np.cross(across, tip - foot))
    middle = foot + WIDEST * (tip - foot) + up
    return np.stack([foot, middle + WIDE / 2 * across, tip, middle - WIDE / 2 * across], axis=1)
