"""Pictures of plants and levels: the truth, and what a client shows live."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.context import context, describe
from vegtool.gl.count import count_fragments
from vegtool.gl.draw import ANISOTROPY, MSAA, Shot, draw, pictured
from vegtool.gl.points import SurfelSetBuffers
from vegtool.gl.sun import SunMaps
from vegtool.gl.targets import drawing_target
from vegtool.gl.timing import time_frames
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
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
    drawn, atlas = level_triangles(level), level.atlas
    opaque = np.full((*atlas.color.shape[:2], 1), 255, np.uint8)
    normal = None if atlas.normal is None else np.concatenate([atlas.normal, opaque], axis=2)
    material = Material(
        "level",
        color_texture=Texture("color", atlas.color),
        normal_texture=None if normal is None else Texture("normal", normal),
        alpha_mode="mask",
        double_sided=level.double_sided,
        unlit=level.unlit,
        light_texture=None if atlas.light is None else Texture("light", atlas.light),
        transmission=0.0 if atlas.light is None else 1.0,
        transmission_tint=atlas.transmission_tint,
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
    shadows: SunMaps | None = None,
) -> Picture:
    """The original as it is: alpha tested per sample, no mips. buffers: without mipmaps. shadows:
    what throws some."""
    return draw(buffers, shot_of(camera), light or Light(), supersample, shadows=shadows)


def live(
    buffers: PlantBuffers,
    camera: Camera,
    light: Light | None = None,
    anisotropy: int = ANISOTROPY,
    shadows: SunMaps | None = None,
) -> Picture:
    """What a client shows: mip-mapped textures, alpha tested once per pixel, 4x multisampling
    resolved in linear light. buffers: with mipmaps. anisotropy: of textures; 1, trilinear
    filtering, is how three.js comes. shadows: what throws some. Raises CapabilityError where OpenGL
    cannot.
    """
    shot, light = shot_of(camera), light or Light()
    return draw(buffers, shot, light, samples=MSAA, anisotropy=anisotropy, shadows=shadows)


def live_surfels(
    buffers: SurfelSetBuffers, camera: Camera, light: Light | None = None, size_px: float = 1.0
) -> Picture:
    """What our own viewer shows of surfels: discs of a diameter, in pixels, where there are as many
    as that takes; 4x multisampling."""
    foot, one = np.zeros((1, 3)), np.ones(1)
    pixel = buffers.pixels(camera.eye, foot, 0 * one, one, camera.focal_px)
    prefix, radius = buffers.surfels.discs(size_px * pixel / 2)
    return live_prefix(buffers, camera, int(prefix[0]), float(radius[0]), light)


def live_prefix(
    buffers: SurfelSetBuffers, camera: Camera, prefix: int, radius_m: float,
    light: Light | None = None,
) -> Picture:  # fmt: skip
    """The same of so many surfels, for discs of a radius, metres."""
    shot, light, one = shot_of(camera), light or Light(), np.ones(1)
    rows = buffers.instances(camera.eye, np.zeros((1, 3)), 0 * one, one, radius_m * one)
    moved = np.eye(4)
    moved[:3, 3] = camera.eye - camera.target
    seen = Shot(shot.view_projection @ moved, camera.eye, shot.width, shot.height)

    def render(part: Shot) -> None:
        buffers.draw(rows, np.array([prefix]), part, light)

    return pictured(buffers.ctx, seen, render, 1, MSAA)


def fragments(buffers: PlantBuffers, camera: Camera) -> int:
    """Fragments that a client shades where nothing hides anything: overdraw, alpha or not."""
    return count_fragments(buffers, shot_of(camera))


def frame_seconds(
    buffers: PlantBuffers, camera: Camera, light: Light | None = None, repeats: int = 30
) -> FloatArray:
    """(repeats,) seconds of frames as `live` draws them, finished one by one and not read back.

    Raises CapabilityError as `live` does.
    """
    return time_frames(buffers, shot_of(camera), light or Light(), MSAA, repeats)


def shot_of(camera: Camera) -> Shot:
    """A camera in OpenGL's terms."""
    return Shot(camera.view_projection(), camera.target, camera.width, camera.height)
