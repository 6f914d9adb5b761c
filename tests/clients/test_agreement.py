"""Our own live pictures against three.js's, of the same files, views and light.

What we measure is only worth something if the renderer that measures shows what a client shows.
Both draw with 4x multisampling resolved in linear light, mips and 4x anisotropy; three.js in
Chromium's software rasteriser, ours in whatever OpenGL is here. Two things remain that are neither
renderer's doing. Chromium's rasteriser puts vertices on a grid of 1/16 pixel (Mesa's: 1/256), which
moves the edges of leaves thinner than a pixel; so ours are put on the same grid first, except in
the largest pictures, which must agree as they are. And it takes logarithms for the choice of mips
from a straight line, up to 0.04 of a level.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hybrids import hybrid_of
from programs import MARKS, MODELS, node

from vegtool.arrays import Picture
from vegtool.convert import ConvertOptions, convert
from vegtool.formats import read_plant
from vegtool.formats.gltf import level_glb, plant_glb
from vegtool.gl.upload import PlantBuffers, vertex_data
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Display
from vegtool.measure.metrics import reference, score
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, live
from vegtool.measure.views import Camera, View, around, views
from vegtool.plant import Plant

pytestmark = MARKS

AGREES = 0.02  # FLIP, mean over the views of a size
COVERS = 0.03  # of three's coverage, mean over all pictures: half of what mips may take away
SIZES = (200, 100, 50)  # pixels of the plant's longest extent
VIEWS = views("all", 4, 0.3)
GRID = 16  # steps of a pixel on which Chromium's rasteriser puts vertices
DISPLAY = Display()
LIGHT = Light()
DENSITY = 200.0  # texels along the longest extent, of a hybrid's atlas
REAL = (
    "eztree_ash_small/eztree_ash_small.glb",
    "eztree_pine_medium/eztree_pine_medium.glb",
    "sapling_birch_lv2/sapling_birch_lv2.glb",
    "sapling_callistemon_bush/sapling_callistemon_bush.glb",
    "arbaro_palm/arbaro_palm.obj",
)
SAMPLES = ("broadleaf", "conifer", "palm")
PLANTS = [name for name in REAL if (MODELS / name).exists()] or [f"sample {n}" for n in SAMPLES]
HYBRIDS = PLANTS[:2]
CASES = [
    *(f"{name} {kind}" for name in PLANTS for kind in ("original", "level")),
    *(f"{name} hybrid" for name in HYBRIDS),
]


@dataclass(frozen=True, eq=False)
class Case:
    """Something drawn by three.js from one view: the file's content as ours, and the picture."""

    drawn: Plant
    size: int
    view: View
    camera: Camera
    picture: Path


@pytest.fixture(scope="session")
def cases(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Case]]:
    """All plants, their first levels and some hybrids, photographed by one browser."""
    folder = tmp_path_factory.mktemp("agreement")
    found: dict[str, list[Case]] = {}
    jobs = []
    for number, name in enumerate(PLANTS):
        real = not name.startswith("sample ")
        plant = read_plant(MODELS / name) if real else sample(name.removeprefix("sample "))
        chain = convert(plant, ConvertOptions(billboards=256, levels=1), MeasureOptions("off"))
        levels = {"level": chain.levels[1]}
        if name in HYBRIDS:
            levels["hybrid"] = hybrid_of(plant, 256, DENSITY / plant.extent)
        for kind, drawn, content in (
            ("original", plant, plant_glb(plant)),
            *((k, client_plant(v), level_glb(v, plant.name)) for k, v in levels.items()),
        ):
            file = folder / f"{number}_{kind}.glb"
            file.write_bytes(content)
            made = [
                Case(drawn, size, view, camera, folder / f"{file.stem}_{size}_{i}")
                for size, i, view, camera in cameras(plant)
            ]
            found[f"{name} {kind}"] = made
            jobs.append({"file": str(file), "views": [as_three(case) for case in made]})
    light = {"sun": LIGHT.sun, "above": LIGHT.sky_above, "below": LIGHT.sky_below}
    for answer in node("draw_in_three.mjs", {"light": light, "jobs": jobs}):
        assert answer["complaints"] == []
    return found


def cameras(plant: Plant) -> Iterator[tuple[int, int, View, Camera]]:
    low, high = plant.bounds
    for size in SIZES:
        distance = DISPLAY.distance_m(size / float((high - low).max()))
        for i, view in enumerate(VIEWS):
            yield size, i, view, around(plant.positions, view.direction, distance, DISPLAY)


def as_three(case: Case) -> dict[str, Any]:
    """The view in three's own terms: a crop of the display's image, looked at from the eye."""
    camera, full = case.camera, (1920, DISPLAY.image_height_px)
    x, y = (side / 2 - middle for side, middle in zip(full, camera.center_px, strict=True))
    return {
        "eye": camera.eye.tolist(), "target": camera.target.tolist(), "up": [0, 1, 0],
        "fov": DISPLAY.fov_y_deg, "full": full, "crop": [x, y, camera.width, camera.height],
        "near": camera.distance_m - camera.depth_m, "far": camera.distance_m + camera.depth_m,
        "sun": case.view.sun.tolist(), "out": str(case.picture),
    }  # fmt: skip


def three(case: Case) -> Picture:
    camera = case.camera
    half = np.frombuffer(case.picture.read_bytes(), np.float16)
    return half.reshape(camera.height, camera.width, 4)[::-1].astype(np.float32)


def on_grid(plant: Plant, camera: Camera) -> Plant:
    """The plant with every vertex moved, across the view, to where Chromium draws it."""
    pixels = camera.pixels(plant.positions) * [1, -1] + [0, camera.height]  # from the lower left
    step = (np.floor(pixels * GRID + 0.5) / GRID - pixels) / camera.focal_px
    depth = camera.distance_m - (plant.positions - camera.target) @ camera.axes[2]
    return replace(plant, positions=plant.positions + depth[:, None] * (step @ camera.axes[:2]))


def put(plant: Plant, buffers: PlantBuffers) -> None:
    """Draw these vertices from here on."""
    buffers.vertices.write(vertex_data(plant, buffers.origin, buffers.scale).tobytes())


@pytest.mark.parametrize("name", CASES)
def test_three_shows_what_we_show(name: str, cases: dict[str, list[Case]]) -> None:
    flip: dict[str, list[float]] = {}
    bias = []
    with PlantBuffers(cases[name][0].drawn, mipmaps=True) as buffers:
        for case in cases[name]:
            truth, light = reference(three(case)), replace(LIGHT, direction=case.view.sun)
            if case.size == max(SIZES):
                put(case.drawn, buffers)
                found = score(truth, live(buffers, case.camera, light))
                flip.setdefault(f"{case.size} px, as it is", []).append(found["flip"])
            put(on_grid(case.drawn, case.camera), buffers)
            found = score(truth, live(buffers, case.camera, light))
            flip.setdefault(f"{case.size} px", []).append(found["flip"])
            bias.append(found["coverage_bias"])
    means = {size: float(np.mean(values)) for size, values in flip.items()}
    assert max(means.values()) <= AGREES, means
    assert abs(np.mean(bias)) <= COVERS, bias
