"""A model of surfel billboards as a camera sees it, as measure/pictures.py has it of plants."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import Picture
from vegtool.gl.draw import MSAA, Shot
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_choice import SurfelFrame, frame_of, instances
from vegtool.gl.surfel_data import SurfelData
from vegtool.gl.surfel_draw import picture_of_surfels
from vegtool.lighting.light import Light
from vegtool.measure.views import Camera
from vegtool.surfels.model import SurfelModel


def framed(data: SurfelData, model: SurfelModel, camera: Camera) -> tuple[SurfelFrame, Shot]:
    """What is drawn of the plant where it stands, and of it what a camera sees."""
    pixels = camera.focal_px / model.options.epsilon
    rows = instances(data, camera.eye, np.zeros((1, 3)), np.zeros(1), np.ones(1))
    from_eye = np.eye(4)
    from_eye[:3, 3] = camera.eye - camera.target
    matrix = camera.view_projection() @ from_eye
    return frame_of(data, rows, pixels), Shot(matrix, camera.eye, camera.width, camera.height)


def pictured(
    buffers: SurfelBuffers, model: SurfelModel, camera: Camera, light: Light | None = None
) -> Picture:
    """As it is drawn live."""
    frame, shot = framed(buffers.data, model, camera)
    return picture_of_surfels(buffers, frame, shot, light or Light(), samples=MSAA)
