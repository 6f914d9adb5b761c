"""Larger surfels where a headset's lenses show less: zones around the middle of an eye's picture.

Brandt et al.: Rendering of complex heterogenous scenes using progressive blue surfels (2019),
section 4.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.preview.eye import Eye

RADIUS = (0.25, 1.0)
"""Where nobody asks for other zones: of half the shorter side of an eye's picture, so that the last
is the circle that a lens shows."""
FACTOR = (1.0, 2.0)
"""Of the size of surfels there. A picture for a headset is pressed together towards its border, by
lenses such as the first Rift's (r + 0.22 r^3 + 0.24 r^5, r 1 at the border) to 2.04 pixels for one
of its middle, 1.07 at a quarter; in between, the straight line is within 7 % of it. So surfels are
shown about alike, in the middle and at the border."""


@dataclass(frozen=True)
class Fovea:
    """Zones: circles around the middle of an eye's picture, and what surfels are drawn like there.

    radius: of each zone, ascending, in halves of the picture's shorter side. factor: of the size of
    surfels, 1 or more; within the first circle and outside the last it stays, between two of them
    it goes from one to the other in a straight line.
    Raises ValueError for anything else.
    """

    radius: tuple[float, ...] = RADIUS
    factor: tuple[float, ...] = FACTOR

    def __post_init__(self) -> None:
        if not self.radius or len(self.radius) != len(self.factor):
            raise ValueError(
                "Fovea: expected a factor for each radius, one at least; got "
                f"{self.radius}, {self.factor}"
            )
        if not (self.radius[0] >= 0 and bool((np.diff(self.radius) > 0).all())):
            raise ValueError(f"Fovea.radius: expected them ascending from 0; got {self.radius}")
        if not all(1 <= factor < np.inf for factor in self.factor):
            raise ValueError(f"Fovea.factor: expected 1 or more; got {self.factor}")


def factors(
    fovea: Fovea, place: FloatArray, reach: FloatArray, eye: Eye, size: tuple[int, int]
) -> FloatArray:
    """(n,) factors of the size of surfels of n objects, each by what is nearest to the middle of
    the picture of the sphere around it; so one that reaches into the middle is as fine as what is
    there.

    place: (n, 3) metres from the eye to their middles. reach: (n,) metres, radii of the spheres.
    size: pixels of the eye's picture.
    """
    right, up, back = (np.asarray(place, np.float64) @ eye.axes.T).T
    away = np.sqrt(right * right + up * up + back * back)
    ratio = np.divide(reach, away, out=np.ones(len(away)), where=away > reach)
    within = np.where(ratio < 1, np.arcsin(np.minimum(ratio, 1.0)), np.pi)  # an eye in it sees all
    angle = np.maximum(np.arctan2(np.hypot(right, up), -back) - within, 0.0)
    ahead = angle < np.pi / 2
    tangent = np.where(ahead, np.tan(np.where(ahead, angle, 0.0)), np.inf)
    shorter = tan(radians(eye.fov_y_deg) / 2) * min(size[0] / size[1], 1.0)
    return np.interp(tangent / shorter, fovea.radius, fovea.factor)
