"""Whom a tileset is made for, where it is for the viewers of a scene, and whether others look."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.lod import Display
from vegtool.needs.planar import gaps, within
from vegtool.preview.eye import Eye

ROUNDING = 1e-4
"""Metres, and of a picture's pixels, that an eye may be off."""


@dataclass(frozen=True, eq=False)
class MadeFor:
    """file: name of the scene. low, high: (3,) metres, of its eyes; may be infinite. corners:
    (v, 2) metres x and z, of the area that they are in or, `along`, of the line of a path, and
    reach_m how far from it they may be. display: of their pictures."""

    file: str
    low: FloatArray
    high: FloatArray
    corners: FloatArray
    along: bool
    reach_m: float
    display: Display

    def outside_m(self, position: FloatArray) -> FloatArray:
        """(n,) metres, about, that eyes at (n, 3) are outside."""
        above = np.maximum(np.maximum(self.low - position, position - self.high), 0.0).max(axis=1)
        flat, start = np.ascontiguousarray(position[:, [0, 2]]), self.corners
        end = np.roll(start, -1, axis=0)
        if self.along and len(start) > 1:
            start, end = start[:-1], start[1:]
        beside = gaps(flat, flat, start, end).min(axis=1) - self.reach_m
        if not self.along:
            beside = np.where(within(flat, self.corners), 0.0, beside)
        return np.asarray(np.maximum(above, beside))

    def is_outside(self, eye: Eye, height_px: int) -> bool:
        """Whether an eye of pictures of that height is elsewhere, or sees more than it may."""
        away = float(self.outside_m(eye.position[None])[0])
        return away > ROUNDING or self.times(eye, height_px) > 1 + ROUNDING

    def times(self, eye: Eye, height_px: int) -> float:
        """How many times larger than those of the scene an eye's pictures show what there is."""
        return eye.focal_px(height_px) / self.display.pixels_per_metre(1.0)


def made_for(told: Mapping[str, Any]) -> MadeFor:
    """What the root of a tileset says. Raises ValueError, KeyError and TypeError for others'."""
    low, high = (
        np.array([np.inf if value is None else value for value in corner], np.float64)
        for corner in told["bounds_m"]
    )
    corners = np.array(told["corners_m"], np.float64)
    if low.shape != (3,) or high.shape != (3,) or corners.ndim != 2 or corners.shape[1] != 2:
        raise ValueError("eyes that are nowhere")
    display = Display(float(told["fov_y_deg"]), int(told["image_height_px"]))
    return MadeFor(
        str(told["file"]), low, high, corners, bool(told["along"]), float(told["reach_m"]), display
    )


def beyond(tileset: Path, made: MadeFor, eyes: Sequence[Eye], height_px: int) -> tuple[str, ...]:
    """A sentence where any of the eyes, of pictures of that height, is none that it is made for."""
    others = [eye for eye in eyes if made.is_outside(eye, height_px)]
    if not others:
        return ()
    away = float(made.outside_m(np.stack([eye.position for eye in others])).max())
    times = max(made.times(eye, height_px) for eye in others)
    reasons = []
    if away > ROUNDING:
        reasons.append(f"up to {away:.3g} m outside of where its eyes are")
    if times > 1 + ROUNDING:
        seen = f"{made.display.image_height_px:,} pixels and {made.display.fov_y_deg:g} degrees"
        reasons.append(f"with pictures {times:.3g} times as fine as its own, of {seen}")
    return (
        f"{tileset}: was made for the viewers of {made.file}, and of {len(eyes):,} eyes "
        f"{len(others):,} are {' and '.join(reasons)}: tiles that they would be shown are missing, "
        "and coarser or finer ones are in their place. Make all with: vegtool tiles SOURCE "
        f"--species LIBRARY -o {tileset.parent}, without --scene, or with another [camera]",
    )
