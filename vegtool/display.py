"""For whom distances are stated."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan


@dataclass(frozen=True)
class Display:
    """For whom distances are stated: vertical field of view (degrees) and image height (pixels)."""

    fov_y_deg: float = 60.0
    image_height_px: int = 1080

    def __post_init__(self) -> None:
        if not (0 < self.fov_y_deg < 180 and self.image_height_px > 0):
            raise ValueError(f"Display: expected an angle below 180 degrees and pixels; got {self}")

    def pixels_per_metre(self, distance_m: float) -> float:
        """Pixels that one metre covers at the centre of the image, that far from the viewer."""
        return self.image_height_px / (2 * tan(radians(self.fov_y_deg) / 2) * distance_m)

    def distance_m(self, pixels_per_metre: float) -> float:
        """The distance at which one metre covers that many pixels."""
        return self.image_height_px / (2 * tan(radians(self.fov_y_deg) / 2) * pixels_per_metre)
