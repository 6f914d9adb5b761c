"""What the sun sees of a plant, in arrays: what shadow.glsl does, place by place.

Williams: Casting curved shadows on curved surfaces (1978), for depth maps; Reeves, Salesin, Cook:
Rendering antialiased shadows with depth maps (1987), for comparing before interpolating; one map
from each of several points of the sun's disc (Heckbert, Herf: Simulating soft shadows with graphics
hardware, 1997), whose mean is the soft shadow with no more said.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians, tan

import numpy as np

from vegtool.arrays import FloatArray, SingleArray, unit
from vegtool.lighting.light import SUN_DEG

SUNS = 8
"""Points of the sun's disc."""
BIAS = (1.5, 1.0)
"""Texels by which a place is moved off its surface, along the normal and towards the sun, before
its depth is compared: a map's texel holds one depth for all of a slope."""
GOLDEN_ANGLE = pi * (3 - 5**0.5)


@dataclass(frozen=True, eq=False)
class SunDepths:
    """Depth maps of a plant from n points of the sun.

    depth: (n, side, side) float32, 0 nearest to the sun, 1 where nothing is; lowest row first.
    projection: (n, 4, 4) from positions less `center`, (3,) metres, to a map's 0..1 and its depth.
    direction: (3,) unit, towards the middle of the sun. texel_m: metres, of a map.
    """

    depth: SingleArray
    projection: FloatArray
    center: FloatArray
    direction: FloatArray
    texel_m: float


def disc(direction: FloatArray, count: int = SUNS) -> FloatArray:
    """(count, 3) unit vectors to points spread evenly over the sun's disc about a direction, (3,)
    unit: a sunflower's (Vogel: A better way to construct the sunflower head, 1979)."""
    if count == 1:
        return direction[None]
    i = np.arange(count) + 0.5
    radius = tan(radians(SUN_DEG / 2)) * np.sqrt(i / count)
    across = unit(np.cross(direction, np.eye(3)[np.abs(direction).argmin()])[None])[0]
    up = np.cross(direction, across)
    turn = i * GOLDEN_ANGLE
    off = radius[:, None] * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * up)
    return unit(direction + off)


def projections(directions: FloatArray, radius_m: float) -> FloatArray:
    """(n, 4, 4) from positions less the center of a ball to 0..1 across and in depth, as each of
    the directions (n, 3), unit, towards the sun sees it. radius_m: metres, of the ball."""
    result = np.zeros((len(directions), 4, 4))
    for matrix, toward in zip(result, directions, strict=True):
        across = unit(np.cross(toward, np.eye(3)[np.abs(toward).argmin()])[None])[0]
        rows = np.stack([across, np.cross(toward, across), -toward])
        matrix[:3, :3] = rows / (2 * radius_m)
        matrix[:3, 3] = 0.5
        matrix[3, 3] = 1.0
    return result


def sun_visible(positions: FloatArray, sides: FloatArray, maps: SunDepths) -> FloatArray:
    """(n,) share of the sun's disc that places (n, 3), metres, see; 0 to 1.

    sides: (n, 3) unit normals of the faces that they lie on, either way round.
    """
    side = maps.depth.shape[1]
    off = np.where((sides @ maps.direction < 0)[:, None], -sides, sides)
    moved = maps.texel_m * (BIAS[0] * off + BIAS[1] * maps.direction)
    local = positions - maps.center + moved
    total = np.zeros(len(positions))
    for depth, matrix in zip(maps.depth, maps.projection, strict=True):
        at = local @ matrix[:3, :3].T + matrix[:3, 3]
        texel = at[:, :2] * side - 0.5
        first = np.floor(texel).astype(np.int64)
        share = texel - first
        from_sun = np.minimum(at[:, 2], 1.0)  # what lies behind all that is in the map
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            x, y = first[:, 0] + dx, first[:, 1] + dy
            outside = (x < 0) | (y < 0) | (x >= side) | (y >= side)
            stored = depth[np.clip(y, 0, side - 1), np.clip(x, 0, side - 1)]
            lit = outside | (from_sun <= stored)
            weight = (share[:, 0] if dx else 1 - share[:, 0]) * (
                share[:, 1] if dy else 1 - share[:, 1]
            )
            total += weight * lit
    return total / len(maps.depth)
