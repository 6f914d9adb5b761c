"""A camera that turns about a plant by 360 degrees while the sun stands still.

Brightness is the mean linear luminance of what is covered. The plainest client draws (no
anisotropic filtering); as many samples of each pixel are taken as make a picture of 800 pixels,
since four of a plant 25 pixels high are noise: what is measured is the mean of pictures moved by
parts of a pixel, and single pictures of coarse levels vary by per cents around it. The plant itself
is seen from where the first level is; how far away it is changes its brightness by half a per cent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.draw import draw
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Sun
from vegtool.lod import LodChain
from vegtool.measure.metrics import LUMINANCE
from vegtool.measure.pictures import client_plant, shot_of
from vegtool.measure.views import around, direction

ELEVATION_DEG, SUN = 10.0, Sun(40.0, 35.0)
SAMPLES = 800
"""Along a plant, at least."""
BIAS, JUMP = 0.03, 0.01
"""Of brightness, asked."""


@dataclass(frozen=True)
class Turned:
    """One level. mean: by how much it is brighter than the plant, in the mean. worst, jump:
    greatest difference at a step, and greatest change between two steps that the plant does not
    have. kept: shares of steps within BIAS, and of changes within JUMP."""

    level: int
    kind: str
    triangles: int
    mean: float
    worst: float
    jump: float
    kept: float
    kept_jump: float
    curve: tuple[float, ...]


def turned(chain: LodChain, steps: int = 360) -> tuple[FloatArray, list[Turned]]:
    """(steps,) brightness of the plant, and every level beside it."""
    plant = chain.levels[0].mesh
    assert plant is not None
    angles = 360.0 / steps * np.arange(steps)
    with PlantBuffers(plant) as original:
        near = chain.levels[1].near_distance_m
        truth = np.array(list(_curve(chain, original, near, angles, anisotropy=1)))
    found = []
    for number, level in enumerate(chain.levels[1:], start=1):
        with PlantBuffers(client_plant(level), mipmaps=True) as buffers:
            shown = np.array(list(_curve(chain, buffers, level.near_distance_m, angles, 1)))
        bias = shown / truth - 1
        log = np.log(shown / truth)
        jump = np.abs(np.diff(log, append=log[:1]))
        found.append(
            Turned(
                number,
                level.kind,
                level.triangles,
                float(bias.mean()),
                float(np.abs(bias).max()),
                float(jump.max()),
                float((np.abs(bias) <= BIAS).mean()),
                float((jump <= JUMP).mean()),
                tuple(bias),
            )
        )
    return truth, found


def _curve(
    chain: LodChain,
    buffers: PlantBuffers,
    distance_m: float,
    angles: FloatArray,
    anisotropy: int,
) -> Iterator[float]:
    plant = chain.levels[0].mesh
    assert plant is not None
    pixels = plant.extent * chain.display.pixels_per_metre(distance_m)
    supersample = max(2, round(SAMPLES / pixels))
    for angle in angles:
        seen_from = direction(float(angle), ELEVATION_DEG)
        camera = around(plant.positions, seen_from, distance_m, chain.display)
        light = SUN.light
        picture = draw(buffers, shot_of(camera), light, supersample, anisotropy=anisotropy)
        total = picture.sum(axis=(0, 1), dtype=np.float64)
        yield float(total[:3] @ LUMINANCE / total[3])


def rows(plant: str, method: str, found: Sequence[Turned]) -> list[dict[str, object]]:
    """For results/lighting_turned.csv."""
    return [
        {
            "plant": plant,
            "method": method,
            "level": t.level,
            "kind": t.kind,
            "triangles": t.triangles,
            "mean": f"{t.mean:+.4f}",
            "worst": f"{t.worst:.4f}",
            "within_3_percent": f"{t.kept:.3f}",
            "worst_jump": f"{t.jump:.4f}",
            "jumps_within_1_percent": f"{t.kept_jump:.3f}",
        }
        for t in found
    ]
