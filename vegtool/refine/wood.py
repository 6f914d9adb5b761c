"""Wood reduced to a small mesh that covers as many pixels as the wood does, whatever the view.

    stems = stems_of(plant, faces)                    # once for a plant
    count = wood_triangles(stems, triangles, pixel_m) # for each level, of all its triangles
    wood = reduced_wood(stems, count, pixel_m)

By Cauchy's formula the mean shadow of a convex body is a quarter of its surface, that of a sheet
seen from both sides half of its area. So every stem is drawn as a straight taper whose surface is
that of its faces: as a prism of a few sides where it is thick on the screen, as two sides of a
triangular prism (whose outline is that of all three) or as a ribbon where it is thin, and of stems
much smaller than a pixel one for several, as much wider (Cook, Halstead, Planck, Ryu: Stochastic
simplification of aggregate detail, 2007). Wood that is not round is collapsed (wood_lumps.py).

Which stem gets how many triangles follows from one price of a triangle, in pixels drawn wrongly:
the one at which the triangles are spent (Everett: Generalized Lagrange multiplier method, 1963).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from vegtool.refine.mesh import ColoredMesh
from vegtool.refine.wood_choice import Choice, Screen
from vegtool.refine.wood_mesh import mesh_of
from vegtool.refine.wood_stems import Stems, stems_of

__all__ = ["Stems", "Wood", "reduced_wood", "stems_of", "wood_triangles"]

RANGE = 1e-9
"""The least price over the greatest, at which no more than one triangle is worth it."""
WRONG = 0.04
"""Wood that wrong made a FLIP of 0.016, 0.014 and 0.011 of pictures of 121, 61 and 30 pixels per
radius of five plants, with all of their leaves; 0.06 made 0.019, 0.016 and 0.013 with half as many
triangles, but a trunk lost the flare of its foot."""
LEAST, MOST = 0.03, 0.5
"""Of a level's triangles. The least is for the look of a trunk that covers next to nothing."""
ROUNDS = 48
"""Of the bisection for the price."""
CLOSE = 1e-3
"""Prices whose logarithms differ by less are one."""


@dataclass(frozen=True, eq=False)
class Wood(ColoredMesh):
    """A mesh of wood, its triangles counter-clockwise from outside.

    stems: how many there are. drawn: how many of them are drawn, for themselves or for others too.
    wrong_m2: square metres drawn wrongly, by estimate, in the mean over all views.
    """

    stems: int
    drawn: int
    wrong_m2: float


def reduced_wood(stems: Stems, triangles: int, pixel_m: float) -> Wood | None:
    """The stems as a mesh of at most that many triangles; None where no stem can be drawn with
    them, which is so for one or none.

    pixel_m: metres that a pixel covers, where the mesh is seen from nearest; what is smaller needs
    no shape. Raises ValueError where that is not a length.
    """
    screen = Screen.of(stems, pixel_m)
    choice = _last(screen, lambda choice: choice.triangles <= triangles)
    if choice.triangles > triangles:
        return None
    mesh = mesh_of(stems, choice)
    lumps = sum(len(solid.stems) for solid, _ in choice.lumps)
    return Wood(
        mesh.positions * stems.radius + stems.center,
        mesh.normals,
        mesh.colors,
        mesh.faces.astype(np.int32),
        len(stems),
        int((choice.wider > 0).sum()) + lumps,
        choice.wrong * pixel_m**2,
    )


def wood_triangles(stems: Stems, triangles: int, pixel_m: float) -> int:
    """How many of a level's triangles its wood deserves: as many as it takes until no more of it is
    drawn wrongly than WRONG of what the plant covers; at least LEAST and at most MOST of all.

    pixel_m: metres that a pixel covers, where the level is seen from nearest. Raises ValueError
    where that is not a length.
    """
    screen = Screen.of(stems, pixel_m)
    wrong = WRONG * stems.covered / screen.pixel**2
    enough = _last(screen, lambda choice: choice.wrong > wrong).triangles
    return min(max(enough, int(LEAST * triangles)), int(MOST * triangles))


def _last(screen: Screen, holds: Callable[[Choice], bool]) -> Choice:
    """The choice at the lowest price at which what holds at high ones still does; at the highest,
    where that does not."""
    high = 4 * float(screen.covered.sum())
    low, best = RANGE * high, screen.choice(high)
    for _ in range(ROUNDS):
        price = sqrt(low * high)
        choice = screen.choice(price)
        if holds(choice):
            best, high = choice, price
        else:
            low = price
        if high < low * (1 + CLOSE):
            break
    return best
