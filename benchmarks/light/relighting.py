"""Levels under other suns: how wrong their light is, with normal textures and without.

Linear RMSE of shading over pixels that plant and level both cover, 24 suns x 12 views. `flat`: the
same level with the normals of its rectangles and triangles. `smooth`: the truth's own shading,
averaged over a sixteenth of the plant: the least that a level could err which shows no single leaf.
`whole` is the error of the mean over the plant, picture by picture: there single leaves do not
count.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from light.pixels import Error, Shading, samples_of, shading_of
from vegtool.arrays import unit
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import LodChain
from vegtool.measure.pictures import client_plant
from vegtool.measure.views import around, views

VIEWS, SUNS = 12, 24
SMOOTH = 16
"""The plant's size over the width of the mean."""


@dataclass(frozen=True)
class Relit:
    """One level. mapped, flat, smooth: RMSE of pixels. whole, whole_flat: of plants."""

    level: int
    kind: str
    triangles: int
    mapped: float
    flat: float
    smooth: float
    whole: float
    whole_flat: float

    @property
    def ratio(self) -> float:
        return self.mapped / self.flat


def suns(count: int = SUNS) -> list[Light]:
    """From 15 to 75 degrees above the horizon, all around."""
    return [Light(direction=view.sun) for view in views("all", count)]


def relit(chain: LodChain) -> Iterator[Relit]:
    """Every level of a chain, from where it may be used on."""
    plant = chain.levels[0].mesh
    assert plant is not None
    lights = suns()
    with PlantBuffers(plant) as original:
        for number, level in enumerate(chain.levels[1:], start=1):
            drawn = client_plant(level)
            side = unit(drawn.face_area_vectors / plant.radius**2)
            errors = [Error() for _ in range(3)]
            with PlantBuffers(drawn, mipmaps=True) as buffers:
                for view in views("all", VIEWS):
                    camera = around(
                        plant.positions, view.direction, level.near_distance_m, chain.display
                    )
                    truth = shading_of(samples_of(original, camera), lights)
                    seen = samples_of(buffers, camera)
                    plane = side[seen.face]
                    away = ((camera.eye - seen.position) * plane).sum(axis=1) < 0
                    plane = np.where(away[:, None], -plane, plane)
                    shape = camera.height, camera.width
                    for error, shown in zip(
                        errors,
                        (
                            shading_of(seen, lights),
                            shading_of(seen, lights, plane),
                            _smooth(truth, shape),
                        ),
                        strict=True,
                    ):
                        error.add(truth, shown)
            mapped, flat, smooth = errors
            yield Relit(
                number,
                level.kind,
                level.triangles,
                mapped.rmse,
                flat.rmse,
                smooth.rmse,
                mapped.whole,
                flat.whole,
            )


def _smooth(truth: Shading, shape: tuple[int, int]) -> Shading:
    width = max(shape) / SMOOTH / 2
    covered = truth.covered.reshape(shape)
    weight = gaussian_filter(covered, width)
    columns = [
        gaussian_filter(covered * light.reshape(shape), width) / np.maximum(weight, 1e-6)
        for light in truth.light.T
    ]
    light = np.stack([column.ravel() for column in columns], axis=1)
    return Shading(truth.covered, light.astype(np.float32))


def rows(plant: str, method: str, found: Sequence[Relit]) -> list[dict[str, object]]:
    """For results/lighting_relit.csv."""
    return [
        {
            "plant": plant,
            "method": method,
            "level": r.level,
            "kind": r.kind,
            "triangles": r.triangles,
            "mapped": f"{r.mapped:.4f}",
            "flat": f"{r.flat:.4f}",
            "ratio": f"{r.ratio:.3f}",
            "smooth": f"{r.smooth:.4f}",
            "whole": f"{r.whole:.4f}",
            "whole_flat": f"{r.whole_flat:.4f}",
        }
        for r in found
    ]
