"""Pictures of plants and levels: the truth, and what a client shows live."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.context import context, describe
from vegtool.gl.count import count_fragments
from vegtool.gl.draw import ANISOTROPY, MSAA, Light, Shot, draw
from vegtool.gl.targets import drawing_target
from vegtool.gl.timing import time_frames
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Level, level_triangles
from vegtool.measure.views import Camera
from vegtool.plant import Material, Plant, Texture

TRUTH_SUPERSAMPLE = 8
"""Samples per axis and pixel."""


def client_plant(level: Level) -> Plant:
    """A level as the mesh that a client gets from its file, so that one path draws everything."""
    if level.kind == "mesh":
        assert level.mesh is not None
        return level.mesh
    assert level.atlas is not None
    drawn = level_triangles(level)
    opaque = np.full((*level.atlas.normal.shape[:2], 1), 255, np.uint8)
    material = Material(
        "level",
        color_texture=Texture("color", level.atlas.color),
        normal_texture=Texture("normal", np.concatenate([level.atlas.normal, opaque], axis=2)),
        alpha_mode="mask",
        double_sided=level.double_sided,
    )
    faces = drawn.indices.reshape(-1, 3)
    return Plant(
        "level",
        drawn.positions,
        drawn.normals,
        drawn.uvs,
        faces,
        np.zeros(len(faces), np.int32),
        (material,),
        drawn.colors,
    )


def renderer() -> dict[str, str]:
    """What draws here: vendor, renderer, version, largest texture side, as words.

    Raises CapabilityError where there is no OpenGL.
    """
    about = describe()
    return {
        "vendor": about.vendor,
        "renderer": about.renderer + (" (software)" if about.software else ""),
        "version": about.version,
        "largest texture": f"{about.max_texture} texels a side",
    }


def check_drawing() -> None:
    """Raise CapabilityError where there is no OpenGL, or none that draws what a client shows: to be
    asked before long work."""
    drawing_target(context(), (1, 1), MSAA)


def truth(
    buffers: PlantBuffers,
    camera: Camera,
    light: Light | None = None,
    supersample: int = TRUTH_SUPERSAMPLE,
) -> Picture:
    """The original as it is: alpha tested per sample, no mips. buffers: without mipmaps."""
    return draw(buffers, _shot(camera), light or Light(), supersample)


def live(
    buffers: PlantBuffers,
    camera: Camera,
    light: Light | None = None,
    anisotropy: int = ANISOTROPY,
) -> Picture:
    """What a client shows: mip-mapped textures, alpha tested once per pixel, 4x multisampling
    resolved in linear light. buffers: with mipmaps. anisotropy: of textures; 1, trilinear
    filtering, is how three.js comes. Raises CapabilityError where OpenGL cannot.
    """
    return draw(buffers, _shot(camera), light or Light(), samples=MSAA, anisotropy=anisotropy)


def fragments(buffers: PlantBuffers, camera: Camera) -> int:
    """Fragments that a client shades where nothing hides anything: overdraw, alpha or not."""
    return count_fragments(buffers, _shot(camera))


def frame_seconds(
    buffers: PlantBuffers, camera: Camera, light: Light | None = None, repeats: int = 30
) -> FloatArray:
    """(repeats,) seconds of frames as `live` draws them, finished one by one and not read back.

    Raises CapabilityError as `live` does.
    """
    return time_frames(buffers, _shot(camera), light or Light(), MSAA, repeats)


def _shot(camera: Camera) -> Shot:
    return Shot(camera.view_projection(), camera.target, camera.width, camera.height)
