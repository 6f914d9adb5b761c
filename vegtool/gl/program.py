"""Shader programs, made once per context from the files in `shaders/` and in lighting/.

A line `#include "name.glsl"` is replaced by that file. Names given as `defines` follow `#version`.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from weakref import WeakKeyDictionary

import moderngl

HEADER = "#version 330 core\n#extension GL_ARB_sample_shading : enable\n"
"""The extension lets a shader say which samples it covers; all that is not told so needs none."""
_programs: WeakKeyDictionary[moderngl.Context, dict[tuple[str, ...], moderngl.Program]] = (
    WeakKeyDictionary()
)


def program(ctx: moderngl.Context, vertex: str, fragment: str, *defines: str) -> moderngl.Program:
    """The program of two shader files, compiled for `ctx` on the first call.

    vertex, fragment: file names in `vegtool/gl/shaders`. defines: names, or "NAME value".
    """
    made = _programs.setdefault(ctx, {})
    key = (vertex, fragment, *defines)
    if key not in made:
        head = (
            HEADER
            + "#extension GL_ARB_sample_shading : enable\n"
            + "".join(f"#define {name}\n" for name in defines)
        )
        made[key] = ctx.program(
            vertex_shader=head + source(vertex), fragment_shader=head + source(fragment)
        )
    return made[key]


def captured(
    ctx: moderngl.Context, vertex: str, varyings: tuple[str, ...], *defines: str
) -> moderngl.Program:
    """The program of a vertex shader alone, of whose outputs some are kept in a buffer."""
    made = _programs.setdefault(ctx, {})
    key = (vertex, "", *varyings, *defines)
    if key not in made:
        head = HEADER + "".join(f"#define {name}\n" for name in defines)
        made[key] = ctx.program(vertex_shader=head + source(vertex), varyings=varyings)
    return made[key]


@cache
def source(name: str) -> str:
    """The text of a shader file, its includes put in."""
    found = (place / name for place in (files("vegtool.gl") / "shaders", files("vegtool.lighting")))
    text = next(file for file in found if file.is_file()).read_text(encoding="utf-8")
    lines = []
    for line in text.splitlines():
        included = line.partition('#include "')[2]
        lines.append(source(included.rstrip('"')) if included else line)
    return "\n".join(lines) + "\n"
