"""What a preview of one plant loads and compiles: no more than it draws with."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample

pytestmark = pytest.mark.gl

TOLD = """
import json, sys
import moderngl
made, drawn = {}, set()
compile_, render = moderngl.Context.program, moderngl.VertexArray.render
def compiled(self, **shaders):
    program = compile_(self, **shaders)
    made[program.glo] = shaders["vertex_shader"][:200]
    return program
def rendered(self, *given, **named):
    drawn.add(self.program.glo)
    return render(self, *given, **named)
moderngl.Context.program, moderngl.VertexArray.render = compiled, rendered
from vegtool.cli import run
code = run(sys.argv[1:])
idle = [made[number] for number in made.keys() - drawn]
told = {"code": code, "made": len(made), "idle": idle, "modules": sorted(sys.modules)}
print("TOLD" + json.dumps(told))
"""

UNUSED = {
    "trimesh", "skimage", "matplotlib", "fast_simplification", "numba", "pyrender", "pyglet",
    "OpenGL", "av", "distributed", "rasterio",
}  # fmt: skip
"""Packages of other commands, of the window and of films."""
ROOMS = {
    "vegtool.preview.tile_world", "vegtool.preview.surfel_world", "vegtool.preview.movie",
    "vegtool.gl.window", "vegtool.gl.surfel_scene", "vegtool.gl.pictures", "vegtool.convert.chain",
    "vegtool.baking.bake", "vegtool.refine.level",
}  # fmt: skip


def test_a_picture_of_one_plant_takes_no_more_than_it_is_drawn_with(tmp_path: Path) -> None:
    """No tiles, surfels, wireframe, overdraw, shadows, window or film are in it."""
    (tmp_path / "bush.glb").write_bytes(plant_glb(sample("bush", 300)))
    wanted = ["preview", "bush.glb", "--screenshot", "shot.png", "--size", "64x48"]
    done = subprocess.run(
        [sys.executable, "-c", TOLD, *wanted],
        capture_output=True, text=True, check=True, cwd=tmp_path,
    )  # fmt: skip
    told = json.loads(done.stdout.split("TOLD")[1])
    assert told["code"] == 0 and (tmp_path / "shot.png").exists()
    assert told["made"] and not told["idle"], "programs that nothing was drawn with"
    loaded = set(told["modules"])
    assert not {name.split(".")[0] for name in loaded} & UNUSED
    assert not loaded & ROOMS
