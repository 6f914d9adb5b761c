"""Pictures of plants and levels: the truth, and what a client shows live."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.context import context, describe
from vegtool.gl.count import count_fragments, count_rendered
from vegtool.gl.draw import ANISOTROPY, MSAA, Shot, draw, drawn_part, pictured
from vegtool.gl.points import SurfelSetBuffers
from vegtool.gl.sun import SunMaps
from vegtool.gl.targets import drawing_target
from vegtool.gl.timing import time_frames, time_rendered
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


Uploaded = PlantBuffers | SurfelSetBuffers
"""A level on the GPU, as a client draws it."""


def uploaded(level: Level) -> Uploaded:
    """A level as a client has it, textures with mipmaps; surfels as our own viewer draws them. A
    context manager: leaving releases."""
    if level.surfels is not None:
        return SurfelSetBuffers(level.surfels)
    return PlantBuffers(client_plant(level), mipmaps=True)


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
    buffers: Uploaded,
    camera: Camera,
    light: Light | None = None,
    anisotropy: int = ANISOTROPY,
    shadows: SunMaps | None = None,
) -> Picture:
    """What a client shows: mip-mapped textures, alpha tested once per pixel, 4x multisampling
    resolved in linear light. buffers: as `uploaded`. anisotropy: of textures; 1, trilinear
    filtering, is how three.js comes. shadows: what throws some. Raises CapabilityError where OpenGL
    cannot.
    """
    if isinstance(buffers, SurfelSetBuffers):
        return live_surfels(buffers, camera, light)
    shot, light = shot_of(camera), light or Light()
    return draw(buffers, shot, light, samples=MSAA, anisotropy=anisotropy, shadows=shadows)


def live_surfels(
    buffers: SurfelSetBuffers, camera: Camera, light: Light | None = None, size_px: float = 1.0
) -> Picture:
    """What our own viewer shows of surfels: discs of a diameter, in pixels, where there are as many
    as that takes; 4x multisampling."""
    return live_prefix(buffers, camera, *_discs(buffers, camera, size_px), light)


def live_prefix(
    buffers: SurfelSetBuffers, camera: Camera, prefix: int, radius_m: float,
    light: Light | None = None,
) -> Picture:  # fmt: skip
    """The same of so many surfels, for discs of a radius, metres."""
    shot, render = _rendering(buffers, camera, prefix, radius_m, light or Light())
    return pictured(buffers.ctx, shot, render, 1, MSAA)


def _discs(buffers: SurfelSetBuffers, camera: Camera, size_px: float = 1.0) -> tuple[int, float]:
    """How many surfels a camera is to see, and the radius of their discs, metres."""
    one = np.ones(1)
    pixel = buffers.pixels(camera.eye, np.zeros((1, 3)), 0 * one, one, camera.focal_px)
    prefix, radius = buffers.surfels.discs(size_px * pixel / 2)
    return int(prefix[0]), float(radius[0])


def _rendering(
    buffers: SurfelSetBuffers, camera: Camera, prefix: int, radius_m: float, light: Light
) -> tuple[Shot, Callable[[Shot], None]]:
    """A camera as a shot whose target is the eye, and what draws surfels into parts of it."""
    shot, one, eye = shot_of(camera), np.ones(1), camera.eye
    rows = buffers.instances(eye, np.zeros((1, 3)), 0 * one, one, radius_m * one)
    moved = np.eye(4)
    moved[:3, 3] = eye - camera.target

    def render(part: Shot) -> None:
        buffers.draw(rows, np.array([prefix]), part, light)

    return Shot(shot.view_projection @ moved, eye, shot.width, shot.height), render


def fragments(buffers: Uploaded, camera: Camera) -> int:
    """Fragments that a client shades where nothing hides anything: overdraw, alpha or not."""
    if isinstance(buffers, SurfelSetBuffers):
        return count_rendered(
            buffers.ctx, *_rendering(buffers, camera, *_discs(buffers, camera), Light())
        )
    return count_fragments(buffers, shot_of(camera))


def frame_seconds(
    buffers: Uploaded, camera: Camera, light: Light | None = None, repeats: int = 30
) -> FloatArray:
    """(repeats,) seconds of frames as `live` draws them, finished one by one and not read back.

    Raises CapabilityError as `live` does.
    """
    light = light or Light()
    if isinstance(buffers, SurfelSetBuffers):
        shot, render = _rendering(buffers, camera, *_discs(buffers, camera), light)
        ctx = buffers.ctx
        return time_rendered(
            ctx, shot, lambda part: drawn_part(ctx, part, render, 1, MSAA), repeats
        )
    return time_frames(buffers, shot_of(camera), light, MSAA, repeats)


def shot_of(camera: Camera) -> Shot:
    """A camera in OpenGL's terms."""
    return Shot(camera.view_projection(), camera.target, camera.width, camera.height)
