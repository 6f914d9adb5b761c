"""Time of the bake's stages for 256 billboards, beside the bare draw calls.

    python benchmarks/bake.py MODEL... [--billboards 256] [--side 128] [--row]

Bare: the least that draws the same pictures: per billboard one viewport, one matrix and one call
per material, plain vertex attributes in buffers made beforehand, colour and depth alone into a
target of the same samples. Ours: the bake's draw stage, which draws normals as well, and makes
and uploads its stream of vertices.
Both run by turns in one process; seconds are the least of the rounds, of wall-clock and of
processor time (all threads); `ratio` is draw over bare in processor time, which does not depend
on what else the machine does. Pictures have about `--side` texels a side, 4 x 4 samples each.
`--row` appends the rows to benchmarks/results/bake.csv.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
from recorded import record

from vegtool import __version__
from vegtool.arrays import IntArray
from vegtool.baking import bake as room
from vegtool.boxes import BoxOptions, make_billboards
from vegtool.clustering import ClusterOptions, cluster
from vegtool.formats import read_plant
from vegtool.gl import pictures
from vegtool.gl.context import describe, framebuffer_kept
from vegtool.gl.program import source
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Billboards

SAMPLES = 4
VERTEX = """#version 330 core
uniform mat4 matrix;
in vec4 in_position_u, in_normal_v, in_color;
out vec2 uv; out vec4 tint;
void main() {
    gl_Position = matrix * vec4(in_position_u.xyz, 1.0);
    uv = vec2(in_position_u.w, in_normal_v.w);
    tint = in_color;
}"""
FRAGMENT = f"""#version 330 core
{source("material.glsl")}
in vec2 uv; in vec4 tint; out vec4 color;
void main() {{ color = vec4(surface_color(uv, tint), 1.0); }}"""


def bare_calls(
    buffers: PlantBuffers, labels: IntArray, boards: Billboards, rect: IntArray, height: int
) -> Callable[[], None]:
    """Everything prepared; calling the result makes the draw calls alone, band by band."""
    ctx, plant = buffers.ctx, buffers.plant
    shader = ctx.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    runs = []
    normal = np.cross(boards.u, boards.v)
    for i in range(len(boards)):
        half = np.append(boards.half_size[i], max(boards.half_depth[i], 1e-6 * plant.radius))
        rows = np.stack([boards.u[i], -boards.v[i], -0.999 * normal[i]]) / half[:, None]
        matrix = np.eye(4, dtype=np.float32)
        matrix[:3, :3] = rows
        matrix[:3, 3] = -rows @ (boards.center[i] - buffers.origin)
        for group in buffers.groups:
            here = (labels == boards.cluster[i]) & (plant.face_material == group.number)
            if here.any():
                index = ctx.buffer(plant.faces[here].astype(np.uint32))
                layout = [(buffers.vertices, "4f 4f 4f", *ATTRIBUTES)]
                array = ctx.vertex_array(shader, layout, index, skip_errors=True)
                x, y, w, h = (int(v) * SAMPLES for v in rect[i])
                runs.append((group, array, matrix.T.tobytes(), (x, y, w, h)))
    runs.sort(key=lambda run: run[0].number)
    width = int((rect[:, 0] + rect[:, 2]).max()) * SAMPLES
    rows = pictures.SAMPLE_LIMIT // width
    size = (width, rows)
    frame = ctx.framebuffer([ctx.texture(size, 4)], ctx.depth_texture(size))

    per_metre = SAMPLES * float(np.median(rect[:, 2] / (2 * boards.half_size[:, 0])))
    coarse = buffers.texels_per_metre > pictures.MINIFIED * per_metre  # sampled as the bake does

    def calls() -> None:
        with framebuffer_kept(ctx):
            draw()

    def draw() -> None:
        frame.use()
        ctx.front_face = "cw"
        for first in range(0, height * SAMPLES, rows):
            frame.viewport = (0, 0, *size)
            frame.clear()
            for group, array, matrix, (x, y, w, h) in runs:
                if y + h <= first or y >= first + rows:
                    continue
                culling = 0 if group.material.double_sided else moderngl.CULL_FACE
                ctx.enable_only(moderngl.DEPTH_TEST | culling)
                buffers.use(group, shader, point_sampled=bool(coarse[group.number]))
                frame.viewport = (x, y - first, w, h)
                shader["matrix"].write(matrix)
                array.render(moderngl.TRIANGLES)
            ctx.finish()
        ctx.front_face = "ccw"
        ctx.enable_only(moderngl.NOTHING)

    return calls


ATTRIBUTES = ("in_position_u", "in_normal_v", "in_color")


def measure(path: Path, count: int, side: int, rounds: int = 5) -> dict[str, object]:
    plant = read_plant(path)
    labels = cluster(plant, "kmeans", count, ClusterOptions())
    boards = make_billboards(plant, labels, BoxOptions(shape="single"))
    density = side / float(2 * np.sqrt(boards.half_size.prod(axis=1).mean()))
    options = room.BakeOptions(sides="double", max_texture=16_384)
    wall: dict[str, float] = {}
    processor: dict[str, float] = {}
    clocks = ((wall, time.perf_counter), (processor, time.process_time))
    with PlantBuffers(plant) as buffers:
        baked = room.bake(buffers, labels, boards, density, options)
        boards = baked.billboards
        calls = bare_calls(buffers, labels, boards, baked.atlas.front, baked.atlas.color.shape[0])
        calls()
        for _ in range(rounds):
            for least, clock in clocks:
                pictures.perf_counter = clock
                start = clock()
                calls()
                buffers.ctx.finish()
                least["bare"] = min(least.get("bare", np.inf), clock() - start)
                seconds = room.bake(buffers, labels, boards, density, options).seconds
                for stage, value in seconds.items():
                    least[stage] = min(least.get(stage, np.inf), value)
    stages = ("bare", "stream", "draw", "resolve", "read")
    return {
        "version": __version__,
        "renderer": describe().renderer,
        "model": path.stem,
        "billboards": len(boards),
        "texels": baked.atlas.texels,
        **{f"{s}_s": round(wall[s], 4) for s in (*stages, "sides", "pack", "dilate")},
        **{f"{s}_cpu_s": round(processor[s], 4) for s in stages},
        "ratio": round((processor["draw"] + processor["stream"]) / processor["bare"], 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("models", nargs="+", type=Path)
    parser.add_argument("--billboards", type=int, default=256)
    parser.add_argument("--side", type=int, default=128)
    parser.add_argument("--row", action="store_true")
    args = parser.parse_args()
    rows = [measure(path, args.billboards, args.side) for path in args.models]
    for row in rows:
        print("  ".join(f"{k} {v}" for k, v in row.items()))
    if args.row:
        record("bake", rows)


if __name__ == "__main__":
    main()
