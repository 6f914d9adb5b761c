"""Cameras: where a picture is taken from, as plain numbers."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.lod import Display


@dataclass(frozen=True, eq=False)
class Camera:
    """A perspective camera.

    target: (3,) metres, at the middle of the image. direction: (3,) unit, from the target to the
    eye. distance_m: eye to target. fov_y_deg: vertical. width, height: pixels. depth_m: half the
    depth in front of and behind the target that must be seen, which sets the clipping planes.
    """

    target: FloatArray
    direction: FloatArray
    distance_m: float
    fov_y_deg: float
    width: int
    height: int
    depth_m: float

    @property
    def eye(self) -> FloatArray:
        """(3,) metres."""
        return np.asarray(self.target + self.distance_m * self.direction)

    def view_projection(self) -> FloatArray:
        """(4, 4) float64, from positions relative to `target` to OpenGL's clip space.

        Relative to the target, so that float32 on the GPU loses nothing of a plant far from the
        origin.
        """
        back = self.direction
        up = np.array([0.0, 0.0, -1.0]) if abs(back[1]) > 0.999 else np.array([0.0, 1.0, 0.0])
        right = np.cross(up, back)
        right /= np.linalg.norm(right)
        view = np.eye(4)
        view[:3, :3] = np.stack([right, np.cross(back, right), back])
        view[2, 3] = -self.distance_m
        far = self.distance_m + self.depth_m
        near = max(self.distance_m - self.depth_m, 1e-3 * far)
        f = 1 / tan(radians(self.fov_y_deg) / 2)
        projection = np.zeros((4, 4))
        projection[0, 0] = f * self.height / self.width
        projection[1, 1] = f
        projection[2, 2:] = [(far + near) / (near - far), 2 * far * near / (near - far)]
        projection[3, 2] = -1
        return projection @ view


def framed(
    center: FloatArray, radius: float, direction: FloatArray, distance_m: float, display: Display
) -> Camera:
    """The camera that sees what a display shows of a sphere that far away, cropped around it."""
    scale = display.pixels_per_metre(distance_m)
    # a near sphere looks larger than its diameter at the centre's distance
    apparent = radius / max(1 - (radius / distance_m) ** 2, 0.05) ** 0.5
    side = max(2 * int(np.ceil(apparent * scale)) + 4, 8)
    fov = 2 * np.degrees(np.arctan(side / (2 * scale * distance_m)))
    return Camera(center, direction, distance_m, float(fov), side, side, 1.5 * radius)


def direction(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """(3,) unit vector: azimuth from +z towards +x, elevation above the horizon, in degrees."""
    a, e = radians(azimuth_deg), radians(elevation_deg)
    return np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
