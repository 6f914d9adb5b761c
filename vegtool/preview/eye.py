"""The eye that walks through a scene: where it is, where it looks, and what of the world it sees.

All that a GPU is told of the world is relative to the eye: what is near is known best, wherever in
the world the eye is.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, degrees, fmod, hypot, inf, isfinite, radians, sin, tan

import numpy as np

from vegtool.arrays import FloatArray, checked
from vegtool.gl.draw import Shot
from vegtool.lod import Display

FOV_Y_DEG = 60.0
"""Vertical field of view where nobody asks for another one, as `Display`."""
NEAR_M = 0.1
"""Nothing nearer is drawn."""
FAR_M = 10_000.0
"""Nothing farther is drawn. What a depth buffer tells apart goes by the near plane alone: at a
kilometre, 24 bits tell 0.6 m."""


@dataclass(frozen=True, eq=False)
class Eye:
    """A perspective camera in a scene, y up.

    position: (3,) metres. yaw_deg: 0 looks along -z, and grows to the left, counter-clockwise as
    seen from above. pitch_deg: above the horizon, -90 to 90. fov_y_deg: more than 0, less than 180.
    near_m: more than 0. far_m: more than that; may be infinite.
    Raises ValueError for anything else.
    """

    position: FloatArray
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    fov_y_deg: float = FOV_Y_DEG
    near_m: float = NEAR_M
    far_m: float = FAR_M

    def __post_init__(self) -> None:
        position = checked("Eye.position", self.position, (3,), np.float64)
        object.__setattr__(self, "position", position)
        rules = (
            ("yaw_deg", "a finite number", isfinite(self.yaw_deg)),
            ("pitch_deg", "-90 to 90", -90 <= self.pitch_deg <= 90),
            ("fov_y_deg", "more than 0 and less than 180", 0 < self.fov_y_deg < 180),
            ("near_m", "more than 0 and finite", 0 < self.near_m < inf),
            ("far_m", f"more than near_m, {self.near_m}", self.far_m > self.near_m),
        )
        for name, expected, holds in rules:
            if not holds:
                raise ValueError(f"Eye.{name}: expected {expected}; got {getattr(self, name)}")

    @property
    def axes(self) -> FloatArray:
        """(3, 3) rows: unit vectors right, up, and back, away from what is looked at.

        Built from the angles, so that they are known straight up and down too.
        """
        # whole turns are taken away exactly; a sine would lose what is left of a large angle
        yaw, pitch = radians(fmod(self.yaw_deg, 360.0)), radians(self.pitch_deg)
        s, c, rise, run = sin(yaw), cos(yaw), sin(pitch), cos(pitch)
        return np.array([[c, 0.0, -s], [s * rise, run, c * rise], [s * run, -rise, c * run]])

    @property
    def forward(self) -> FloatArray:
        """(3,) unit vector, towards what is looked at."""
        return np.asarray(-self.axes[2])

    def shot(self, width: int, height: int) -> Shot:
        """The picture of so many pixels, whose target is the eye itself.

        What is asked of a shot at its target, such as pixels of a metre, has no answer there.
        Raises ValueError for a picture without pixels.
        """
        across, up = self._tangents(width, height)
        projection = np.zeros((4, 4))
        projection[0, 0], projection[1, 1] = 1 / across, 1 / up
        near, far = self.near_m, self.far_m
        if isfinite(far):
            projection[2, 2:] = (far + near) / (near - far), 2 * near * (far / (near - far))
        else:  # the limit of the above
            projection[2, 2:] = -1.0, -2 * near
        projection[3, 2] = -1.0
        view = np.eye(4)
        view[:3, :3] = self.axes
        return Shot(projection @ view, self.position, width, height)

    def planes(self, width: int, height: int) -> FloatArray:
        """(6, 4) planes a, b, c, d around what is seen: left, right, bottom, top, near and far.

        (a, b, c) is of unit length and points inwards: a x + b y + c z + d is at least 0 within,
        for x, y, z in metres relative to the eye. (5, 4) where the far plane is infinitely far.
        Raises ValueError for a picture without pixels.
        """
        across, up = self._tangents(width, height)
        right, above, back = self.axes
        sides = np.stack([right, -right, above, -above])
        tangents = np.array([[across], [across], [up], [up]])
        normals = (sides - tangents * back) / np.hypot(1.0, tangents)
        planes = np.zeros((6 if isfinite(self.far_m) else 5, 4))
        planes[:4, :3] = normals
        planes[4] = *-back, -self.near_m
        if isfinite(self.far_m):
            planes[5] = *back, self.far_m
        return planes

    def focal_px(self, height_px: int) -> float:
        """Pixels that one metre at a distance of one metre covers in a picture of that height."""
        return Display(self.fov_y_deg, height_px).pixels_per_metre(1.0)

    def pixels_per_metre(self, distance_m: float, height_px: int) -> float:
        """Pixels that one metre covers in the middle of a picture of that height, that far away;
        nearer than `near_m`, as many as there."""
        return Display(self.fov_y_deg, height_px).pixels_per_metre(max(distance_m, self.near_m))

    def _tangents(self, width: int, height: int) -> tuple[float, float]:
        """Of half the angles of view across and up."""
        if width < 1 or height < 1:
            raise ValueError(
                f"Eye: expected a picture of 1 x 1 pixels or more; got {width, height}"
            )
        up = tan(radians(self.fov_y_deg) / 2)
        return up * width / height, up


def towards(direction: FloatArray, yaw_deg: float = 0.0) -> tuple[float, float]:
    """Yaw and pitch, degrees, with which an eye looks along a direction (3,) of any length.

    yaw_deg: of one that is straight up or down, where every yaw looks alike.
    Raises ValueError for a direction of no length.
    """
    longest = float(np.abs(direction).max())
    if not 0 < longest < inf:
        raise ValueError(f"towards: expected a direction with a length; got {direction}")
    x, y, z = (float(v) for v in np.asarray(direction, np.float64) / longest)
    level = hypot(x, z)
    pitch_deg = degrees(atan2(y, level))
    return (degrees(atan2(-x, -z)) if level > 0 else yaw_deg), pitch_deg
