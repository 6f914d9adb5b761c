"""A sun and a sky: all the light there is."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, isfinite, radians, sin
from typing import TYPE_CHECKING

from vegtool.errors import UsageError

if TYPE_CHECKING:
    from vegtool.arrays import FloatArray

SUN_DEG = 0.53
"""Degrees: diameter of the sun's disc, seen from the earth (31.6 to 32.7 minutes of arc)."""


def _from(x: float, y: float, z: float) -> FloatArray:
    import numpy as np  # not where options are read, which have a sun

    return np.array([x, y, z])


@dataclass(frozen=True, eq=False)
class Light:
    """direction: (3,) towards the sun, of any length. sun: what it adds, as a factor of the albedo,
    to what faces it. sky_above, sky_below: what the sky and the ground add to what faces them."""

    direction: FloatArray = field(default_factory=lambda: _from(0.5, 1.0, 0.7))
    sun: float = 0.70
    sky_above: float = 0.38
    sky_below: float = 0.20

    @property
    def unit(self) -> FloatArray:
        """(3,) unit vector towards the sun."""
        import numpy as np

        return np.asarray(self.direction / np.linalg.norm(self.direction))


@dataclass(frozen=True)
class Sun:
    """Where the sun stands. azimuth_deg: from +z towards +x. elevation_deg: above the horizon."""

    azimuth_deg: float
    elevation_deg: float

    @property
    def direction(self) -> FloatArray:
        """(3,) unit vector towards the sun."""
        azimuth, elevation = radians(self.azimuth_deg), radians(self.elevation_deg)
        flat = cos(elevation)
        return _from(flat * sin(azimuth), sin(elevation), flat * cos(azimuth))

    @property
    def light(self) -> Light:
        """Its light beside that of the sky; none from below the horizon."""
        usual = Light()
        return Light(self.direction, usual.sun if self.elevation_deg >= 0 else 0.0)

    def as_dict(self) -> dict[str, float]:
        """As manifests state it, with the strengths of its light."""
        light = self.light
        return {
            "azimuth_deg": self.azimuth_deg,
            "elevation_deg": self.elevation_deg,
            "sun": light.sun,
            "sky_above": light.sky_above,
            "sky_below": light.sky_below,
        }

    @classmethod
    def read(cls, text: str, flag: str = "--sun") -> Sun:
        """From "AZIMUTH,ELEVATION" in degrees. Raises UsageError where it is something else."""
        parts = text.split(",")
        try:
            azimuth, elevation = (float(part) for part in parts)
        except ValueError:
            raise UsageError(
                f"{flag}: expected azimuth and elevation in degrees, such as 135,40; got {text!r}"
            ) from None
        if not (isfinite(azimuth) and -90 <= elevation <= 90):
            raise UsageError(
                f"{flag}: expected an azimuth and an elevation from -90 to 90 degrees; got {text}"
            )
        return cls(azimuth % 360.0, elevation)
