"""What the fitting of boxes and the choice of shapes can be told, with defaults and units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Shape = Literal["auto", "single", "crossed"]
PlaneFit = Literal["volume", "orientation"]


@dataclass(frozen=True)
class BoxOptions:
    """Options of the room.

    shape: "single" shows every cluster on one billboard, "crossed" on two or three crossed ones,
    "auto" decides by the form of its box: flat one, long and thin two, compact three. About planes
    that suit the faces' directions ("orientation") a compact one takes one as well: its faces look
    one way, and for the same number of planes more clusters lie closer to the truth (measured in
    docs/methods/boxes.md).
    plane: "volume" fits the box of least volume (the paper's form); "orientation" takes the plane
    that suits the directions of the faces too (see oriented_planes).
    flat_ratio: a box is flat where its least extent is below this fraction of its middle one. A
    plane through a box of that form errs by at most an eighth of the picture's shorter side.
    long_ratio: a box is long and thin where its middle extent is below this fraction of its
    longest. A third plane, across the axis, would be seen well from its two ends alone.
    edge_on: a plane is not drawn (one of three crossed ones, or that of a flat box) if it would
    show less than this share of the cluster's area, |n . axis| on average: faces of all directions
    show a half, the sides of a tapering or bent tube a tenth or two.
    steps_deg: angles, in degrees, of the rotations tried, coarse to fine. The paper turns in steps
    of one degree; the coarse ones leave the local minima in which those stick. The last is halved
    on for boxes that it is too coarse for: one degree makes a box 40 times as long as thick by
    two thirds thicker.
    """

    shape: Shape = "auto"
    plane: PlaneFit = "volume"
    flat_ratio: float = 0.25
    long_ratio: float = 0.35
    edge_on: float = 0.25
    steps_deg: tuple[float, ...] = (16.0, 8.0, 4.0, 2.0, 1.0)
