"""What the eye compares: the truth and what is shown in its place, at two sizes, and where they
differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from math import log

import numpy as np
from matplotlib import colormaps
from PIL import Image

from vegtool.arrays import Picture, SingleArray
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Display, Level
from vegtool.measure.background import bytes_over, over
from vegtool.measure.flip import difference, perceived
from vegtool.measure.pictures import live, truth, uploaded
from vegtool.measure.views import CLOSEST, Camera, View, around, direction, distance_of
from vegtool.report.entries import Entry, Shown
from vegtool.report.rows import Pictures

SIZES = (200, 75)
"""Pixels, the plant's longest extent."""
VIEW = View(direction(25.0, 8.0), direction(65.0, 40.0))
"""A walker's, with the sun behind his shoulder."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Cameras and truths by size, of one plant."""

    cameras: Mapping[int, Camera]
    truths: Mapping[int, Picture]


def scene(buffers: PlantBuffers, display: Display) -> Scene:
    """The truths of a plant, at those sizes that are seen from outside it. buffers: without
    mipmaps."""
    plant = buffers.plant
    distances = {size: distance_of(plant, display, size) for size in SIZES}
    cameras = {
        size: around(plant.positions, VIEW.direction, distance, display)
        for size, distance in distances.items()
        if distance > CLOSEST * plant.radius
    }
    light = Light(direction=VIEW.sun)
    return Scene(cameras, {s: truth(buffers, camera, light) for s, camera in cameras.items()})


def sizes_of(entry: Entry, among: Sequence[Entry]) -> list[int]:
    """The sizes at which an entry stands for its family: where its budget is made for a size nearer
    to them than the family's other budgets."""
    return [size for size in SIZES if entry is _nearest(size, entry.family, among)]


def _nearest(size: int, family: str, among: Sequence[Entry]) -> Entry:
    own = [entry for entry in among if entry.family == family]
    return min(own, key=lambda e: abs(log(e.made_for_pixels / size)) if e.made_for_pixels else 0.0)


def of_truth(scene: Scene) -> Pictures:
    """The truth, as PNGs by size."""
    return {size: (_png(Image.fromarray(bytes_over(t))),) for size, t in scene.truths.items()}


def of_shown(shown: Shown, scene: Scene, sizes: Sequence[int]) -> Pictures:
    """What is shown, and its difference from the truth by FLIP, as PNGs by size."""
    level = shown if isinstance(shown, Level) else shown(VIEW)
    found = {}
    with uploaded(level) as buffers:
        for size in (s for s in sizes if s in scene.cameras):
            picture = live(buffers, scene.cameras[size], Light(direction=VIEW.sun))
            error = difference(*(perceived(over(p)) for p in (scene.truths[size], picture)))
            shown_over = Image.fromarray(bytes_over(picture))
            found[size] = (_png(shown_over), _png(_error_map(error)))
    return found


def _error_map(error: SingleArray) -> Image.Image:
    """Errors (h, w), 0 to 1, from black to yellow."""
    image = Image.fromarray((255 * error + 0.5).astype(np.uint8), "P")
    palette = colormaps["magma"](np.arange(256), bytes=True)[:, :3]
    image.putpalette(palette.tobytes())
    return image


def _png(image: Image.Image) -> bytes:
    stream = BytesIO()
    image.save(stream, "PNG", compress_level=9)
    return stream.getvalue()
