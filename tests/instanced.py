"""Plants drawn many times at once, seen by a plain camera: what several tests share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
from cards import turned

from vegtool.arrays import FloatArray, Picture
from vegtool.elements import ordered
from vegtool.gl.draw import Shot, draw
from vegtool.gl.instances import INSTANCE, WHOLE
from vegtool.gl.landscape import Batch, Frame, Landscape, picture
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.measure.views import Camera, direction
from vegtool.plant import Plant
from vegtool.preview.eye import Eye

AMBIENT = Light(sun=0.0, sky_above=1.0, sky_below=1.0)
"""Colours as they are, whatever they face."""
WHITE = np.full((8, 8), 0, np.uint8)
"""A noise that hides nothing."""


def instance(place: npt.ArrayLike = (0, 0, 0), **given: Any) -> np.ndarray:
    """(1,) INSTANCE: a whole plant at metres from the eye. yaw, scale, kept, length, shown, width,
    solid: numbers. tint: three bytes; the least of what is no darker, 128, where none are given."""
    row = np.zeros(1, INSTANCE)
    yaw = given.get("yaw", 0.0)
    row["place"] = *np.asarray(place, np.float64), given.get("scale", 1.0)
    row["turn"] = np.cos(yaw), np.sin(yaw), given.get("kept", WHOLE), given.get("length", 1.0)
    row["shown"] = given.get("shown", 2.0), given.get("width", 1.0), given.get("solid", 1.0)
    row["tint"] = *given.get("tint", (128, 128, 128)), 255
    return row


def frame_of(*rows: np.ndarray, plant: int = 0, fading: bool = False) -> Frame:
    """Instances of one plant, by one call."""
    one = np.concatenate(rows)
    share = float(one["turn"][:, 2].max())
    return Frame(one, (Batch(plant, 0, len(one), share, fading),))


@contextmanager
def landscape_of(
    *plants: Plant, noise: Sequence[np.ndarray] = (WHITE,), mipmaps: bool = True, **more: Any
) -> Iterator[Landscape]:
    """Plants on the GPU."""
    with Landscape(noise, **more) as landscape:
        for plant in plants:
            landscape.add(plant, ordered(plant), mipmaps=mipmaps)
        yield landscape


def facing(
    pixels: int | tuple[int, int],
    side_m: float,
    azimuth: float = 0.0,
    elevation: float = 0.0,
    distance_m: float = 10.0,
) -> Shot:
    """A camera that sees a square of so many metres about the origin on a picture's height of
    pixels. What its shot is relative to is the origin, and not the eye."""
    width, height = (pixels, pixels) if isinstance(pixels, int) else pixels
    focal = height * distance_m / side_m
    middle = width / 2, height / 2
    camera = Camera(
        np.zeros(3), direction(azimuth, elevation), distance_m, focal, width, height, middle, side_m
    )
    return Shot(camera.view_projection(), camera.target, width, height)


def shifted(shot: Shot, right: float, down: float) -> Shot:
    """The same picture moved by pixels."""
    moved = np.eye(4)
    moved[0, 3], moved[1, 3] = 2 * right / shot.width, -2 * down / shot.height
    return Shot(moved @ shot.view_projection, shot.target, shot.width, shot.height)


def seen_from(shot: Shot, target: FloatArray) -> Shot:
    """The same picture for positions relative to another point."""
    there = np.eye(4)
    there[:3, 3] = target - shot.target
    return Shot(shot.view_projection @ there, target, shot.width, shot.height)


def coverage(
    landscape: Landscape, frame: Frame, shot: Shot, samples: int = 4, supersample: int = 1
) -> np.ndarray:
    """(h, w) share of each pixel that is covered."""
    drawn: Picture = picture(landscape, frame, shot, AMBIENT, supersample, samples, ground=False)
    return np.asarray(drawn[..., 3])


def by_itself(
    plant: Plant,
    eye: Eye,
    size: tuple[int, int],
    yaw: float,
    light: Light | None = None,
    **how: int,
) -> Picture:
    """What gl.draw draws of a plant at the origin, turned by radians."""
    seen = seen_from(eye.shot(*size), plant.center)
    with PlantBuffers(turned(plant, yaw, 1.0, (0, 0, 0))) as buffers:
        return draw(buffers, seen, light or Light(), **how)
