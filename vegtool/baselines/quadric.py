"""Quadric edge collapse to a number of triangles, as artists' tools reduce meshes.

Garland, Heckbert: Surface simplification using quadric error metrics (1997), as in
`meshes/collapse.py`. It is given what it can do well:

- Seams of the texture are welded, and attributes carried.
- Wood: a branch of three sides cannot lose one, so that collapsing a whole crown stops far above a
  small target, after the trunk has been eaten. The largest branches are kept, as many as it takes
  to the target while nothing moves far.
- Leaf cards have no edges to collapse but their own: it would delete them, half a card at a time,
  in the order of the file. They are thinned instead (thinning.py).

docs/methods/baselines.md has what each of these does to the error.
"""

from __future__ import annotations

import numpy as np

from vegtool.baselines.thinning import thinned
from vegtool.lod import Level
from vegtool.meshes.collapse import assembled, carried, edges_collapsed
from vegtool.meshes.pieces import Surface, pieces, welded
from vegtool.plant import Plant
from vegtool.timing import timed

GENTLE, ANY = 2.5, 7.0
"""Aggressiveness: edges collapse up to a squared distance of 1e-9 * 103^this plant radii, which is
a hundredth of the radius, or more than anything."""


def quadric(plant: Plant, triangles: int) -> Level:
    """The plant as a mesh of at most that many triangles, where its pieces allow it.

    They are shared among the materials in proportion to their faces. Each keeps one piece at least,
    and a piece the triangles that do not collapse, so a very small target may be exceeded.
    """
    seconds: dict[str, float] = {}
    reduced = []
    for material, share in enumerate(shares(plant, triangles)):
        with timed(seconds, "weld"):
            surface = welded(plant, material)
        if not len(surface.faces):
            continue
        if plant.materials[material].role == "leaf":
            with timed(seconds, "thin"):
                surface = thinned(surface, share)
        with timed(seconds, "collapse"):
            reduced.append((material, collapsed(surface, share)))
    with timed(seconds, "assemble"):
        mesh = assembled(plant, reduced) if reduced else plant
    return Level("mesh", mesh=mesh, seconds=seconds)


def shares(plant: Plant, triangles: int) -> list[int]:
    """Triangles of each material, in proportion to its faces; at least one."""
    counts = np.bincount(plant.face_material, minlength=len(plant.materials))
    return [max(1, int(count) * triangles // len(plant.faces)) for count in counts]


def collapsed(surface: Surface, target: int) -> Surface:
    """The surface with its edges collapsed until at most `target` triangles are left.

    It keeps as many of its largest pieces as can be collapsed to that gently, at least one.
    """
    if len(surface.faces) <= target:
        return surface
    count, piece = pieces(surface.faces)
    rank = np.empty(count, np.int32)
    rank[np.argsort(-np.bincount(piece, surface.areas), kind="stable")] = np.arange(count)
    size = rank[piece]

    most, too_many, best = 0, count + 1, None
    while too_many - most > 1:  # twice as many until that fails, then by bisection
        number = min(max(1, 2 * most), (most + too_many) // 2)
        part = surface.of(size < number)
        made = edges_collapsed(part, target, GENTLE)
        if 0 < len(made.faces) <= target:
            most, best = number, carried(part, made)
        else:
            too_many = number
    if best is not None:
        return best
    part = surface.of(size < 1)
    made = edges_collapsed(part, target, ANY)
    if not len(made.faces):  # the last collapse takes two at once
        return part.of(np.arange(len(part.faces)) == part.areas.argmax())
    return carried(part, made)
