"""Epsilon, from one end to the other: what a pixel shows is near it, whatever lies between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_draw import picture_of_surfels
from vegtool.gl.surfel_read import surfels_seen
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.measure.views import around, views
from vegtool.surfels.drawn import drawn_data
from vegtool.surfels.make import surfel_model
from vegtool.surfels.pictures import framed

pytestmark = pytest.mark.gl
WINDOW = 0.25
"""Of the longest side, that colours tell of: so that steps of eight bits are a part of a pixel."""
KEPT = 0.95
"""Of pixels that billboards draw."""


def test_pixels_show_what_is_within_epsilon_of_them() -> None:
    """Colours say where on the plant a point is, along x, y and z, within a cube about a point of
    its surface. What is read of a picture, projected, must be where it was read."""
    plant = sample("statue", 5000)
    middle, wide = plant.face_centroids[700], WINDOW * plant.extent
    place = (plant.positions - middle) / wide + 0.5  # beyond, colours are cut off in pictures
    plant = replace(
        plant,
        colors=np.column_stack([place, np.ones(len(place))]),
        materials=tuple(
            replace(one, unlit=True, color_texture=None, base_color=np.ones(4))
            for one in plant.materials
        ),
    )
    model = surfel_model(plant)
    data, side = drawn_data(model), float(np.ptp(plant.bounds, axis=0).mean())
    off: list[float] = []
    with SurfelBuffers(data) as buffers:
        for sides in (2.5, 4.0, 8.0):
            for view in views("all", 6):
                camera = around(plant.positions, view.direction, sides * side, model.display)
                frame, shot = framed(data, model, camera)
                drawn = picture_of_surfels(buffers, frame, shot, Light())
                told = (drawn[..., :3] > 0.1).all(axis=2) & (drawn[..., :3] < 0.9).all(axis=2)
                by = surfels_seen(buffers, frame, shot).billboard >= 0
                y, x = np.nonzero(told & by & (drawn[..., 3] > 0.999))
                at = camera.pixels((drawn[y, x, :3].astype(float) - 0.5) * wide + middle)
                off += np.linalg.norm(at - np.column_stack([x, y]) - 0.5, axis=1).tolist()
    assert len(off) > 2000
    assert np.mean(np.array(off) <= model.options.epsilon) > KEPT
