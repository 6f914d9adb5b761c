"""Surfel billboards and the triangles below them, drawn: many instances of a model in a frame."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.draw import ANISOTROPY, Shot, pictured, set_footprint, set_light
from vegtool.gl.instances import OVERDRAW_STEP, View
from vegtool.gl.program import program
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_choice import SurfelFrame
from vegtool.gl.upload import MaterialGroup
from vegtool.lighting.light import Light


@dataclass(frozen=True)
class Parts:
    """What is drawn of a model, to look at the one without the other."""

    billboards: bool = True
    triangles: bool = True


BOTH = Parts()


def draw_surfels(
    model: SurfelBuffers,
    frame: SurfelFrame,
    shot: Shot,
    light: Light,
    view: View = "lit",
    *,
    samples: int = 0,
    footprint: float = 1.0,
    palette: FloatArray | None = None,
    parts: Parts = BOTH,
) -> tuple[int, int]:
    """Draw into the framebuffer in use, which has depth; returns the calls, and how many triangles
    they send.

    shot: its target is the eye, relative to which the rows are. samples: of multisampling, by which
    alpha is tested. footprint: samples per pixel and axis. palette: (n, 3) linear colours, where
    they are painted: of triangles, then of billboards from the lowest up.
    """
    model.write(frame.rows)
    calls = sent = 0
    if parts.triangles:
        for group in model.buffers.groups:
            shader = triangle_program(model, group, view, samples, palette)
            _tell(shader, model, frame, shot, light, footprint, palette)
            model.buffers.use(group, shader)
            if group.material.double_sided:
                model.ctx.disable(moderngl.CULL_FACE)
            else:
                model.ctx.enable(moderngl.CULL_FACE)
            drawn = model.draw_patches(shader, frame, group)
            calls, sent = calls + drawn[0], sent + drawn[1]
        model.ctx.disable(moderngl.CULL_FACE)
    if parts.billboards and len(model.data.billboards):
        shader = billboard_program(model, view, samples, palette)
        _tell(shader, model, frame, shot, light, footprint, palette)
        for name, value in (("transmission", 0.0), ("transmission_tint", (1.0, 1.0, 1.0))):
            if name in shader:
                shader[name] = value
        drawn = model.draw_billboards(shader, frame)
        calls, sent = calls + drawn[0], sent + drawn[1]
    return calls, sent


def picture_of_surfels(
    model: SurfelBuffers,
    frame: SurfelFrame,
    shot: Shot,
    light: Light,
    supersample: int = 1,
    samples: int = 0,
    parts: Parts = BOTH,
) -> Picture:
    """A frame as light and coverage, as `gl.draw.draw` gives them of a plant."""

    def render(part: Shot) -> None:
        draw_surfels(model, frame, part, light, samples=samples, footprint=supersample, parts=parts)

    return pictured(model.ctx, shot, render, supersample, samples)


def billboard_program(
    model: SurfelBuffers, view: View, samples: int, palette: FloatArray | None, read: bool = False
) -> moderngl.Program:
    """The program that draws billboards. read: which they are, and where."""
    unlit = all(material.unlit for material in model.data.plant.materials)
    defines = {
        "UNLIT": unlit or read,
        "SOFT_EDGES": samples > 0 and not read,
        "READ": read,
        **_seen_as(view, palette),
    }
    told = [name for name, wanted in defines.items() if wanted]
    return program(model.ctx, "surfel_billboard.vert", "surfel_billboard.frag", *told)


def triangle_program(
    model: SurfelBuffers, group: MaterialGroup, view: View, samples: int,
    palette: FloatArray | None, read: bool = False,
) -> moderngl.Program:  # fmt: skip
    """The program that draws the triangles of one material."""
    material, mipmaps = group.material, model.buffers.mipmaps
    lit = not material.unlit and not read
    defines = {
        "MIPMAPPED": mipmaps,
        f"ANISOTROPY {ANISOTROPY}.0": mipmaps,
        "NO_COLOR_MAP": material.color_texture is None,
        "UNLIT": not lit,
        "NORMAL_MAP": group.normal_map is not None and lit,
        "LIGHT_MAP": group.light_map is not None and lit,
        "SOFT_EDGES": samples > 0 and material.alpha_mode == "mask" and not read,
        "EXPOSURE": model.data.plant.exposure is not None,
        "READ": read,
        **_seen_as(view, palette),
    }
    told = [name for name, wanted in defines.items() if wanted]
    fragment = "surfel_triangle_read.frag" if read else "instance.frag"
    return program(model.ctx, "surfel_triangle.vert", fragment, *told)


def _seen_as(view: View, palette: FloatArray | None) -> dict[str, bool]:
    count = 0 if palette is None else len(palette)
    return {
        f"PAINTED {count}": view == "painted",
        f"OVERDRAW {OVERDRAW_STEP}": view == "overdraw",
    }


def _tell(
    shader: moderngl.Program, model: SurfelBuffers, frame: SurfelFrame, shot: Shot, light: Light,
    footprint: float, palette: FloatArray | None,
) -> None:  # fmt: skip
    """Set the uniforms that all programs of surfels have."""
    model.use(shader, frame.pixels)
    shader["view_projection"] = tuple(shot.view_projection.T.ravel())
    set_footprint(shader, footprint)
    set_light(shader, model.buffers, light)
    if palette is not None and "palette" in shader:
        shader["palette"] = [tuple(color) for color in palette.tolist()]
    if palette is not None and "paint" in shader:
        shader["paint"] = tuple(palette[0].tolist())
