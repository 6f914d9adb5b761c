"""Shadows on the ground: of the plant, of its levels, and of casters with few triangles.

12 suns, soft shadows by the maps that pictures have; sun seen by a grid of places on level ground
below the plant. `dark`: how much darker the ground is in all, beside the plant's shadow. `error`:
differences of what is seen of the sun, summed over all places, over the plant's shadow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.convert import ConvertOptions, convert
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.shadow import sun_visible
from vegtool.lod import Level, LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant
from vegtool.measure.views import views
from vegtool.plant import Plant

SUNS = 12
PROXIES = (64, 128, 256, 512)
"""Triangles."""
PLACES = 192
"""Along a side of the ground."""


@dataclass(frozen=True)
class Thrown:
    """What one caster does."""

    caster: str
    triangles: int
    dark: float
    error: float


def thrown(plant: Plant, chain: LodChain) -> Iterator[Thrown]:
    """Of the chain's levels and of proxies."""
    casters = {f"LOD{i}": level for i, level in enumerate(chain.levels[1:], start=1)}
    off = MeasureOptions(measure="off")
    for triangles in PROXIES:
        made = convert(plant, ConvertOptions(levels=1, shadow_proxy=triangles), off)
        assert made.shadow is not None
        casters[f"proxy {triangles}"] = made.shadow.level
    suns = [view.sun for view in views("all", SUNS)]
    with PlantBuffers(plant) as original:
        true = [_ground(plant, original, sun) for sun in suns]
    for name, level in casters.items():
        with PlantBuffers(client_plant(level), mipmaps=True) as buffers:
            found = [_ground(plant, buffers, sun) for sun in suns]
        yield _beside(name, level, true, found)


def _beside(
    name: str, level: Level, true: Sequence[FloatArray], found: Sequence[FloatArray]
) -> Thrown:
    dark = [(1 - b).sum() / (1 - a).sum() - 1 for a, b in zip(true, found, strict=True)]
    error = [np.abs(b - a).sum() / (1 - a).sum() for a, b in zip(true, found, strict=True)]
    return Thrown(name, level.triangles, float(np.mean(dark)), float(np.mean(error)))


def _ground(plant: Plant, caster: PlantBuffers, sun: FloatArray) -> FloatArray:
    """(n,) share of the sun that places on the ground see."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    box = plant.bounds[0] + corners * (plant.bounds[1] - plant.bounds[0])
    ground = plant.bounds[0, 1]
    fallen = box - sun / sun[1] * (box[:, 1:2] - ground)
    low, high = fallen.min(axis=0), fallen.max(axis=0)
    at = (np.arange(PLACES) + 0.5) / PLACES
    sides = (low[i] + at * (high[i] - low[i]) for i in (0, 2))
    x, z = (axis.ravel() for axis in np.meshgrid(*sides))
    places = np.stack([x, np.full_like(x, ground), z], axis=1)
    up = np.tile([0.0, 1.0, 0.0], (len(places), 1))
    with SunMaps([caster], sun) as maps:
        return sun_visible(places, up, maps.read())


def rows(plant: str, found: Sequence[Thrown]) -> list[dict[str, object]]:
    """For results/lighting_shadows.csv."""
    return [
        {
            "plant": plant,
            "method": "full",
            "level": t.caster,
            "triangles": t.triangles,
            "dark": f"{t.dark:+.3f}",
            "error": f"{t.error:.3f}",
        }
        for t in found
    ]
