"""What the viewers of a scene can see of a landscape's squares: how `vegtool tiles --scene` asks.

Source: OGC 22-025r4, 3D Tiles 1.1, section 6.3: a client goes on to a tile's quarters where the
tile's error, seen from the point of its box that is nearest, is more than some pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.formats.tileset import CLIENT_PX
from vegtool.lod import Display
from vegtool.needs.hidden import hidden
from vegtool.needs.planar import BoolArray
from vegtool.needs.tiles import refined
from vegtool.needs.viewers import PAIRS, Viewers, display_of, viewers_of
from vegtool.scene import read_scene
from vegtool.tiles.journal import key_of
from vegtool.tiles.placement import Placement
from vegtool.tiles.terrain import terrain_of

WIDE = 16 / 9
"""Times their height, how wide pictures are taken to be."""
SLACK = 1e-6
"""Of errors: clients' numbers are rounded otherwise than ours."""


@dataclass(frozen=True, eq=False)
class SceneView:
    """See tiles/view.py. scene: its file."""

    scene: Path
    viewers: Viewers
    display: Display

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user."""
        return self.viewers.notes

    @property
    def digest(self) -> str:
        """Of all that is asked of it."""
        one, cells = self.viewers, self.viewers.cells
        return key_of(
            cells.start, cells.end, cells.radius, cells.low, cells.high, one.outline, one.reach,
            one.course is not None, repr(self.display),
        )  # fmt: skip

    @property
    def told(self) -> dict[str, Any]:
        """Of the eyes' columns together: bounds_m, least and greatest corner, of which what has no
        limit is null; corners_m of an area, or of the line of a path, and how far from it an eye
        may be."""
        cells, reach = self.viewers.cells, self.viewers.reach
        flat = np.stack([cells.start, cells.end])
        low = (flat - cells.radius[:, None]).min(axis=(0, 1))
        high = (flat + cells.radius[:, None]).max(axis=(0, 1))
        outline = self.viewers.outline
        low = np.maximum(low, outline.min(axis=0) - reach)
        high = np.minimum(high, outline.max(axis=0) + reach)
        top = float(cells.high.max())
        return {
            "file": self.scene.name,
            "digest": self.digest,
            "bounds_m": [
                [float(low[0]), float(cells.low.min()), float(low[1])],
                [float(high[0]), top if np.isfinite(top) else None, float(high[1])],
            ],
            "corners_m": outline.tolist(),
            "along": self.viewers.course is not None,
            "reach_m": float(reach),
            "fov_y_deg": self.display.fov_y_deg,
            "image_height_px": self.display.image_height_px,
        }

    def refined(self, boxes: FloatArray, error_m: FloatArray, seen_px: FloatArray) -> BoolArray:
        """(n,) whether an eye may see errors (n,), metres, as more than (n,) pixels."""
        return refined(boxes, (1 + SLACK) * error_m, self.viewers, self.display, seen_px)

    def passed(self, boxes: FloatArray, error_m: FloatArray) -> BoolArray:
        """(n,) whether every eye sees errors (n,), metres, as more pixels than clients let be."""
        far = farthest_from_boxes(self.viewers, boxes)
        seen = (1 - SLACK) * error_m * self.display.pixels_per_metre(1.0)
        return np.asarray(seen > CLIENT_PX * far)

    @property
    def hills(self) -> bool:
        """Whether there is anything that hides."""
        return self.viewers.floor.terrain.grid is not None

    def hidden(self, boxes: FloatArray) -> BoolArray:
        """(n,) whether the ground is before all of a box, for every eye."""
        return hidden(boxes, self.viewers)

    def pixels_per_metre(self, boxes: FloatArray) -> FloatArray:
        """(n,) pixels that no metre in a box is more than, in the corners of pictures that are
        WIDE; infinite where an eye may be in it."""
        near = self.viewers.nearest_to_boxes(boxes)
        found = np.full(len(near), np.inf)
        # off the axis by an angle, a metre across the line of sight is 1 / cos^2 times as large
        corner = tan(radians(self.display.fov_y_deg) / 2) ** 2 * (1 + WIDE**2)
        largest = (1 + corner) * self.display.pixels_per_metre(1.0)
        np.divide(largest, near, out=found, where=near > 0)
        return found


def farthest_from_boxes(viewers: Viewers, boxes: FloatArray) -> FloatArray:
    """(n,) metres: every eye is at least as near to boxes (n, 2, 3), least and greatest corners in
    metres; may be infinite.

    The distance from a box is convex: of a segment it is greatest at an end, of an area at a
    corner, and within a radius it grows by no more than that.
    """
    cells, found = viewers.cells, np.empty(len(boxes))
    corners = viewers.outline
    count = max(PAIRS // (4 * max(len(cells), len(corners))), 1)
    for first in range(0, len(boxes), count):
        low, high = (boxes[first : first + count, k, None] for k in (0, 1))
        flat_low, flat_high = low[..., [0, 2]], high[..., [0, 2]]

        def beside(points: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
            away = np.maximum(np.maximum(low - points, points - high), 0.0)
            return np.hypot(away[..., 0], away[..., 1])

        whole = beside(corners, flat_low, flat_high).max(axis=1, keepdims=True) + viewers.reach
        ends = [beside(end, flat_low, flat_high) for end in (cells.start, cells.end)]
        flat = np.minimum(np.maximum(*ends) + cells.radius, whole)
        up = np.maximum(np.maximum(low[..., 1] - cells.low, cells.high - high[..., 1]), 0.0)
        found[first : first + count] = np.hypot(flat, up).max(axis=1)
    return found


def view_of(path: Path, placement: Placement) -> SceneView:
    """What a scene file's viewers see of plants that are placed, in the frame of these.

    Raises UsageError, with file and line, for a scene that cannot be read or contradicts itself
    (`viewers_of`), and where it lies elsewhere on the map than the plants.
    """
    scene = read_scene(path)
    ground = terrain_of(scene)
    if ground.origin is not None and not np.array_equal(ground.origin[:2], placement.origin[:2]):
        here, there = (
            ", ".join(f"{value:.10g}" for value in at[:2])
            for at in (ground.origin, placement.origin)
        )
        raise UsageError(
            f"{scene.at('terrain', 'origin')}: origin is {here} on the map, and the plants' is "
            f"{there}: where eyes are would be unknown. Give the scene itself as what is to be "
            "made into tiles, with the inventory in its [placement]"
        )
    viewers = viewers_of(scene, ground, placement)
    return SceneView(path, viewers, display_of(scene, viewers))
