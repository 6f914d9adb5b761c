"""How bright a plant is from all around, under suns all around: what levels are balanced by.

Drawn without light, from many views: then light is arithmetic (lighting/shading.py), for all suns
at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.surface import Seen, surface
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.lod import Display
from vegtool.measure.metrics import LUMINANCE
from vegtool.measure.pictures import shot_of
from vegtool.measure.views import Camera, around, views

VIEWS, LOW_VIEWS, SUNS = 64, 32, 16
"""From all around, from where a walker looks, and how many suns shine on each. With a quarter of
the views a level of 128 triangles followed those and no others; with half of the suns it erred a
fifth more under others; without views of their own, walkers saw a birch 1 % too bright."""
PIXELS = 120.0
"""Size of the plant in the pictures by which brightness is found."""
SUPERSAMPLE = 2
"""Of the plant itself."""


@dataclass(frozen=True, eq=False)
class Brightness:
    """Mean linear luminance of what a plant covers, (v, s), from each view under each light.

    cameras: (v,) of the views, from where the plant is PIXELS large on the usual display.
    display: for whom levels are.
    """

    display: Display
    cameras: tuple[Camera, ...]
    lights: tuple[Light, ...]
    values: FloatArray


def brightness_of(buffers: PlantBuffers, display: Display) -> Brightness:
    """Of a plant, from VIEWS all around and LOW_VIEWS of a walker, under SUNS.

    buffers: without mipmaps. Raises CapabilityError where OpenGL cannot draw.
    """
    plant, seen_from = buffers.plant, (*views("all", VIEWS), *views("ground", LOW_VIEWS))
    usual = Display()  # another's view may be too wide for a camera outside of the plant
    distance = usual.distance_m(PIXELS / plant.extent)
    cameras = tuple(around(plant.positions, view.direction, distance, usual) for view in seen_from)
    lights = tuple(Light(direction=view.sun) for view in views("all", SUNS))
    found = [surface(buffers, shot_of(camera), SUPERSAMPLE, places=False) for camera in cameras]
    means = [
        [light_of(seen, light).sum() / max(len(seen.face), 1) for light in lights] for seen in found
    ]
    return Brightness(display, cameras, lights, np.array(means))


def light_of(seen: Seen, light: Light) -> FloatArray:
    """(n,) linear luminance of samples under a light, without shadows."""
    albedo = seen.color.astype(np.float64)
    normal, exposure = seen.normal.astype(np.float64), seen.exposure.astype(np.float64)
    tint, through = seen.tint.astype(np.float64), exposure[:, 1]
    lit = shaded(albedo, normal, light, exposure, seen.transmission, tint, 1.0, through)
    return np.asarray(lit @ LUMINANCE)
