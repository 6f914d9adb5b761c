"""A small tree as it is lit: geometry, billboards, a hybrid; what the tests of light draw."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache

from vegtool.convert import ConvertOptions, convert
from vegtool.gl.draw import Shot
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.leaves import translucent
from vegtool.lighting.light import Light, Sun
from vegtool.lod import Display, Level, LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, shot_of
from vegtool.measure.views import around, direction
from vegtool.plant import Plant

PIXELS = 120.0
SUN = Sun(60.0, 40.0)
"""From the right, as the camera sees it."""
BEHIND = Sun(205.0, 30.0)
"""The camera stands at 25 degrees."""
PLAIN = ConvertOptions(billboards=200, levels=1, refine="none")


@dataclass(frozen=True, eq=False)
class Scene:
    """What is drawn, by a camera, under a light, with shadows or without."""

    buffers: PlantBuffers
    shot: Shot
    light: Light
    shadows: SunMaps | None = None


@cache
def tree() -> Plant:
    return sample("broadleaf", 2000)


@cache
def chain_of(options: ConvertOptions) -> LodChain:
    return convert(tree(), options, MeasureOptions(measure="off"))


def billboards() -> Level:
    return chain_of(PLAIN).levels[1]


def prelit() -> Level:
    options = ConvertOptions(billboards=200, levels=1, refine="none", prelit=True, sun="60,40")
    return chain_of(options).levels[1]


def hybrid() -> Level:
    options = ConvertOptions(billboards=200, levels=1, pixels=240, occlusion=1.0, translucency=0.4)
    return chain_of(options).levels[1]


def camera_shot(azimuth: float = 25.0, elevation: float = 8.0) -> Shot:
    plant, display = tree(), Display()
    distance = display.distance_m(PIXELS / plant.extent)
    view = direction(azimuth, elevation)
    return shot_of(around(plant.positions, view, distance, display))


SCENES = {
    "lit_geometry": (tree, SUN.light, False),
    "lit_shadows": (tree, SUN.light, True),
    "lit_translucent": (lambda: translucent(tree(), 0.5), BEHIND.light, True),
    "lit_billboards": (billboards, SUN.light, False),
    "prelit_billboards": (prelit, SUN.light, False),
    "lit_hybrid": (hybrid, BEHIND.light, False),
    "lit_billboards_shadows": (billboards, SUN.light, True),
    "lit_hybrid_shadows": (hybrid, SUN.light, True),
}
"""By name: the plant or level, the light, and whether the plant throws shadows."""


@contextmanager
def scene(name: str, shot: Shot | None = None) -> Iterator[Scene]:
    made, light, shadowed = SCENES[name]
    shown = made()
    plant = client_plant(shown) if isinstance(shown, Level) else shown
    with ExitStack() as stack:
        buffers = stack.enter_context(PlantBuffers(plant, mipmaps=isinstance(shown, Level)))
        shadows = None
        if shadowed:
            casters = buffers
            if isinstance(shown, Level):
                casters = stack.enter_context(PlantBuffers(tree()))
            shadows = stack.enter_context(SunMaps([casters], light.direction))
        yield Scene(buffers, shot or camera_shot(), light, shadows)
