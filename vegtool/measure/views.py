"""Cameras and sets of views: where pictures are taken from, and under which sun, as plain numbers.

Views are Fibonacci directions: evenly spread over the sphere, or over the band of elevations that
a scene can see. Each has a sun of its own, so that a mean over views is one over light as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sin

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.lod import Display
from vegtool.measure.options import ELEVATIONS
from vegtool.plant import Plant

SUN_ELEVATIONS = (15.0, 75.0)
"""Degrees above the horizon of the suns of a set of views."""
MARGIN = 4
"""Pixels left free around a plant."""
CLOSEST = 1.1
"""Bounding radii: a camera that is to show the whole plant stays that far from its middle."""
_GOLDEN = (5**0.5 - 1) / 2
_PLASTIC = 1.32471795724474602596  # the real root of x^3 = x + 1; Roberts' R2 sequence (2018)


@dataclass(frozen=True, eq=False)
class View:
    """direction, sun: (3,) unit vectors from the plant, to the eye and to the sun."""

    direction: FloatArray
    sun: FloatArray


@dataclass(frozen=True, eq=False)
class Camera:
    """A perspective camera whose picture may be any part of the image plane.

    target: (3,) metres, the point looked at. direction: (3,) unit, from the target to the eye.
    distance_m: eye to target. focal_px: pixels that one metre covers at a distance of one metre.
    width, height: pixels. center_px: where the target lies in the picture, pixels right and down
    from its upper left corner. depth_m: half the depth in front of and behind the target that must
    be seen, which sets the clipping planes.
    """

    target: FloatArray
    direction: FloatArray
    distance_m: float
    focal_px: float
    width: int
    height: int
    center_px: tuple[float, float]
    depth_m: float

    @property
    def eye(self) -> FloatArray:
        """(3,) metres."""
        return np.asarray(self.target + self.distance_m * self.direction)

    @property
    def axes(self) -> FloatArray:
        """(3, 3) rows: right, up, and back towards the eye."""
        return np.stack([*upright(self.direction), self.direction])

    def pixels(self, points: FloatArray) -> FloatArray:
        """(n, 2) where points (n, 3), metres, lie in the picture: right and down, in pixels."""
        x, y, z = self.axes @ (points - self.target).T
        scale = self.focal_px / (self.distance_m - z)
        return np.stack([self.center_px[0] + x * scale, self.center_px[1] - y * scale], axis=1)

    def view_projection(self) -> FloatArray:
        """(4, 4) float64, from positions relative to `target` to OpenGL's clip space.

        Relative to the target, so that float32 on the GPU loses nothing of a plant far from the
        origin.
        """
        view = np.eye(4)
        view[:3, :3] = self.axes
        view[2, 3] = -self.distance_m
        far = self.distance_m + self.depth_m
        near = max(self.distance_m - self.depth_m, 1e-3 * far)
        x, y = self.center_px
        projection = np.zeros((4, 4))
        projection[0, 0] = 2 * self.focal_px / self.width
        projection[1, 1] = 2 * self.focal_px / self.height
        projection[0, 2] = 1 - 2 * x / self.width
        projection[1, 2] = 2 * y / self.height - 1
        projection[2, 2:] = [(far + near) / (near - far), 2 * far * near / (near - far)]
        projection[3, 2] = -1
        return projection @ view


def upright(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,) right and up of a picture seen from a direction, (3,) unit, up as near +y
    as can be; of one from straight above or below, up is -z."""
    up = np.array([0.0, 0.0, -1.0]) if abs(direction[1]) > 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, direction)
    right /= np.linalg.norm(right)
    return right, np.cross(direction, right)


def framed(
    center: FloatArray, radius: float, direction: FloatArray, distance_m: float, display: Display
) -> Camera:
    """The camera that sees what a display shows of a sphere that far away, cropped around it."""
    focal = display.pixels_per_metre(1.0)
    # a near sphere looks larger than its diameter at the centre's distance
    apparent = radius / max(1 - (radius / distance_m) ** 2, 0.05) ** 0.5
    side = max(2 * int(np.ceil(apparent * focal / distance_m)) + MARGIN, 8)
    middle = (side / 2, side / 2)
    return Camera(center, direction, distance_m, focal, side, side, middle, 1.5 * radius)


def around(
    points: FloatArray, direction: FloatArray, distance_m: float, display: Display
) -> Camera:
    """The camera that sees what a display shows of points (n, 3), metres, cropped around them.

    It looks at the middle of the points' bounds. Raises UsageError where the eye is so near that
    points may lie behind it.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    target = (low + high) / 2
    radius = float(np.linalg.norm(high - low) / 2)
    if not distance_m > CLOSEST * radius:
        raise UsageError(
            f"a view from {distance_m:.4g} m: expected an eye outside the plant, whose radius is "
            f"{radius:.4g} m; use a narrower field of view (--fov) or fewer pixels"
        )
    focal = display.pixels_per_metre(1.0)
    whole = Camera(target, direction, distance_m, focal, 1, 1, (0.0, 0.0), 1.5 * radius)
    pixels = whole.pixels(points)
    first = np.floor(pixels.min(axis=0)) - MARGIN
    width, height = (np.ceil(pixels.max(axis=0)) + MARGIN - first).astype(int)
    middle = (float(-first[0]), float(-first[1]))
    return Camera(
        target, direction, distance_m, focal, int(width), int(height), middle, 1.5 * radius
    )


def views(kind: str, count: int, phase: float = 0.0) -> tuple[View, ...]:
    """`count` directions over the band of elevations of `kind`, each with a sun of its own.

    kind: a key of ELEVATIONS. phase: another number below 1 gives other directions and suns,
    equally well spread, for checking what was chosen with the first.
    Raises UsageError for a kind that is unknown, and for less than one view.
    """
    if kind not in ELEVATIONS:
        raise UsageError(f"--views: expected one of {', '.join(ELEVATIONS)}; got {kind}")
    if count < 1:
        raise UsageError(f"--view-count: expected at least one view; got {count}")
    i = np.arange(count, dtype=np.float64)
    low, high = (sin(radians(e)) for e in ELEVATIONS[kind])
    y = low + (high - low) * (i + (0.5 + phase) % 1) / count
    directions = _unit(y, i * _GOLDEN + phase)
    low, high = (sin(radians(e)) for e in SUN_ELEVATIONS)
    rise = low + (high - low) * (((i + 1) / _PLASTIC**2 + phase) % 1)
    suns = _unit(rise, (i + 1) / _PLASTIC + 2 * phase)
    return tuple(View(d, s) for d, s in zip(directions, suns, strict=True))


def distance_of(plant: Plant, display: Display, pixels: float) -> float:
    """Metres from which the plant's longest side covers that many pixels.

    Raises UsageError for a plant without extent.
    """
    if not plant.extent > 0:
        raise UsageError(
            f"{plant.source or plant.name}: expected a plant with an extent, found none"
        )
    return display.distance_m(pixels / plant.extent)


def direction(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """(3,) unit vector: azimuth from +z towards +x, elevation above the horizon, in degrees."""
    return np.asarray(_unit(np.array([sin(radians(elevation_deg))]), azimuth_deg / 360)[0])


def _unit(y: FloatArray, turns: FloatArray | float) -> FloatArray:
    """(n, 3) unit vectors of height y, turned about it from +z towards +x by so many turns."""
    around = 2 * np.pi * turns
    r = np.sqrt(np.maximum(1 - y * y, 0.0))
    return np.stack([r * np.sin(around), y, r * np.cos(around)], axis=1)
