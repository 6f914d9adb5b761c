"""Shading pixel by pixel, from samples drawn without light: then any sun is arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, SingleArray
from vegtool.gl.surface import Seen, surface
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.measure.pictures import shot_of
from vegtool.measure.views import Camera

SUPERSAMPLE = 4
"""Samples per axis and pixel."""


@dataclass(frozen=True, eq=False)
class Shading:
    """Of a picture of p pixels. covered: (p,) share. light: (p, s) mean light under each of s suns
    on what is covered, as a factor of the albedo; 0 where nothing is."""

    covered: SingleArray
    light: SingleArray


def samples_of(buffers: PlantBuffers, camera: Camera) -> Seen:
    """What a camera sees; of levels, as the mean of pictures moved by parts of a pixel."""
    return surface(buffers, shot_of(camera), SUPERSAMPLE, anisotropy=1)


def shading_of(
    seen: Seen, suns: Sequence[Light], normal: npt.NDArray[np.floating] | None = None
) -> Shading:
    """Pixel by pixel, under each sun. normal: (n, 3) of the samples, in place of their own."""
    width, height = (n // SUPERSAMPLE for n in seen.size)
    pixel = (seen.at[:, 1] // SUPERSAMPLE) * width + seen.at[:, 0] // SUPERSAMPLE
    count = np.bincount(pixel, minlength=width * height)
    white = np.ones((len(pixel), 1))
    normals = (seen.normal if normal is None else normal).astype(np.float64)
    columns = []
    for sun in suns:
        light = shaded(white, normals, sun, tint=1.0)[:, 0]
        columns.append(np.bincount(pixel, light, width * height) / np.maximum(count, 1))
    light = np.stack(columns, axis=1).astype(np.float32)
    return Shading((count / SUPERSAMPLE**2).astype(np.float32), light)


@dataclass
class Error:
    """Sums over pictures: squared differences of shading where both cover, weighted by how much
    both do; and, picture by picture, differences of the mean over all that each covers."""

    squares: float = 0.0
    weight: float = 0.0
    means: list[FloatArray] | None = None

    def add(self, truth: Shading, level: Shading) -> None:
        common = np.minimum(truth.covered, level.covered)
        difference = level.light - truth.light
        self.squares += float((common[:, None] * difference**2).sum(dtype=np.float64))
        self.weight += float(common.sum(dtype=np.float64)) * difference.shape[1]
        mean = [s.covered @ s.light / max(float(s.covered.sum()), 1e-9) for s in (truth, level)]
        self.means = [*(self.means or []), (mean[1] - mean[0]).astype(np.float64)]

    @property
    def rmse(self) -> float:
        """Of pixels."""
        return float(np.sqrt(self.squares / max(self.weight, 1e-9)))

    @property
    def whole(self) -> float:
        """Root mean square difference of whole plants."""
        return float(np.sqrt(np.mean(np.square(self.means)))) if self.means else 0.0
