"""A level drawn as the plainest client draws it: what coverage and colour are measured by.

No anisotropic filtering: three.js and most others come without, and mips lose most there.
"""

from __future__ import annotations

from collections.abc import Sequence

from vegtool.arrays import Picture
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.measure.pictures import live, uploaded
from vegtool.measure.views import Camera


def drawn(level: Level, cameras: Sequence[Camera], lights: Sequence[Light]) -> tuple[Picture, ...]:
    """The level from each camera under the light of the same index, as `measure.pictures.live`
    draws it; linear, premultiplied by coverage.

    Raises ValueError for another number of lights than of cameras, and CapabilityError where
    OpenGL cannot draw.
    """
    with uploaded(level) as buffers:
        return tuple(
            live(buffers, camera, light, anisotropy=1)
            for camera, light in zip(cameras, lights, strict=True)
        )
