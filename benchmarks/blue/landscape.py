"""A landscape of the paper's table 3: 30,000 trees of six kinds, drawn whole and by level.

Trees stand on flat ground of 5 x 3 km, one in each square of a grid, somewhere in it. They are seen
from 200 m above, over a corner, and by a walker. What is drawn is compared with the trees whole,
16 samples to the pixel: the picture as it is, and parts of it that hold one tree each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path
from time import perf_counter

import numpy as np
from walk.scenes import Say, first_levels, key_of
from walk.truth import Whole

from blue.similarity import hierarchical
from vegtool.arrays import Picture, SingleArray
from vegtool.batch import Job, Task, convert_file
from vegtool.convert import ConvertOptions
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.gl.context import context, framebuffer_kept
from vegtool.gl.screen import Screen
from vegtool.growth import sample
from vegtool.measure.background import over
from vegtool.measure.metrics import LUMINANCE, reference, score
from vegtool.preview.eye import Eye
from vegtool.preview.forest import Forest
from vegtool.preview.scenery import IN_FULL, Look
from vegtool.preview.world import World, read_world
from vegtool.seeding import generator
from vegtool.srgb import srgb_from_linear
from vegtool.tiles.library import Species

TREES = 30_000
EXTENT_M = (5_000.0, 3_000.0)
KINDS = {
    "broadleaf": ("broadleaf", 50_000, 0, (9.0, 16.0)),
    "oak": ("broadleaf", 70_000, 1, (8.0, 14.0)),
    "cherry": ("cherry", 45_000, 0, (6.0, 10.0)),
    "conifer": ("conifer", 60_000, 0, (12.0, 22.0)),
    "fir": ("conifer", 40_000, 1, (10.0, 18.0)),
    "palm": ("palm", 40_000, 0, (7.0, 12.0)),
}
"""By name: the sample, its triangles and seed, and heights, metres."""
SIZES = ((1920, 1080), (960, 540))
"""Pixels of pictures; the first is compared."""
FRAMES = 5
"""Timed, of which the median counts; of trees that are whole, one."""
CROPS, CROP_PX = 60, (24, 400)
"""Trees that are looked at by themselves, at most, and heights of theirs in pixels."""
AHEAD_M = 1.5
"""A walker's eye is no nearer to a crown."""

SURFELS = ConvertOptions(method="surfels", levels=1)
BILLBOARDS = ConvertOptions(levels=8, billboards=1024)


@dataclass(frozen=True)
class Row:
    """A view drawn in one way. hierarchical, ssim, flip: of the whole picture. crops: mean
    hierarchical similarity of parts with one tree."""

    view: str
    drawn: str
    width: int
    milliseconds: float
    draws: int
    triangles: int
    surfels: int
    hierarchical: float | None = None
    ssim: float | None = None
    flip: float | None = None
    crops: float | None = None


def eyes(world: World) -> dict[str, Eye]:
    """The overview, from above a corner to the middle, and the walker's."""
    half = np.array([EXTENT_M[0] / 2, EXTENT_M[1] / 2])
    across = float(np.degrees(np.arctan2(half[0], half[1])))
    above = Eye(np.array([-half[0], 200.0, half[1]]), -across, -10.0)
    return {"overview": above, "ground": replace(world.start, far_m=above.far_m)}


def inventory() -> str:
    """A tree in each square of a grid, a CSV."""
    random = generator(0, "blue landscape")
    side = (EXTENT_M[0] * EXTENT_M[1] / TREES) ** 0.5
    columns = round(EXTENT_M[0] / side)
    rows = ceil(TREES / columns)
    square = np.array([EXTENT_M[0] / columns, EXTENT_M[1] / rows])
    index = np.arange(TREES)
    place = np.stack([index % columns, index // columns], axis=1) + random.random((TREES, 2))
    x, y = (place * square - np.array(EXTENT_M) / 2).T
    kind = random.integers(0, len(KINDS), TREES)
    names, heights = list(KINDS), np.array([one[3] for one in KINDS.values()])
    height = heights[kind, 0] + random.random(TREES) * (heights[kind, 1] - heights[kind, 0])
    lines = [
        f"{a:.3f},{b:.3f},{names[k]},{h:.2f}" for a, b, k, h in zip(x, y, kind, height, strict=True)
    ]
    return "\n".join(["x,y,species,height", *lines]) + "\n"


def scene(folder: Path) -> Path:
    """The scene file, and its inventory."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "trees.csv").write_text(inventory(), encoding="utf-8")
    lines = [
        "[camera]", "height_m = [2, 2]", "[terrain]", 'kind = "plane"',
        f"extent_m = [{EXTENT_M[0]:g}, {EXTENT_M[1]:g}]", "[placement]", 'inventory = "trees.csv"',
    ]  # fmt: skip
    for name in KINDS:
        lines += ["[[species]]", f'name = "{name}"']
    path = folder / "scene.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def library(cache: Path, options: ConvertOptions) -> Path:
    """The folder of the six, converted where that was not done before."""
    folder = cache / f"trees_{key_of(KINDS, options)}"
    folder.mkdir(parents=True, exist_ok=True)
    for name in KINDS:
        if not (folder / f"{name}.lod.json").exists():
            convert_file(Job(models(cache) / f"{name}.glb", name), Task(folder, convert=options))
    return folder


def models(cache: Path) -> Path:
    """The folder of the six as they are."""
    folder = cache / f"models_{key_of(KINDS)}"
    folder.mkdir(parents=True, exist_ok=True)
    for name, (of, triangles, seed, _) in KINDS.items():
        if not (folder / f"{name}.glb").exists():
            (folder / f"{name}.glb").write_bytes(plant_glb(sample(of, triangles, seed)))
    return folder


def worlds(cache: Path) -> dict[str, World]:
    """By what is drawn: nothing but whole trees, surfels alone, billboards alone, both."""
    file = scene(cache / "scene")
    whole = read_world(models(cache), file, ReadOptions())
    surfels = read_world(library(cache, SURFELS), file, ReadOptions())
    billboards = read_world(library(cache, BILLBOARDS), file, ReadOptions())
    both = tuple(
        _with_surfels(one, other)
        for one, other in zip(billboards.species, surfels.species, strict=True)
    )
    return {
        "whole": whole,
        "surfels": surfels,
        "billboards": billboards,
        "both": replace(billboards, species=both),
    }


def _with_surfels(one: Species, other: Species) -> Species:
    """Billboards as far as the surfels' distance, and those from there on."""
    assert other.surfels is not None
    count = int((one.switch_m < other.surfels.switch_m).sum())
    return replace(first_levels(one, count), surfels=other.surfels)


@contextmanager
def loaded(world: World) -> Iterator[Forest]:
    forest = Forest(world.species, world.placement, world.ground)
    for _ in forest.load(context()):
        pass
    try:
        yield forest
    finally:
        forest.release()


def truths(cache: Path, world: World) -> dict[str, Picture]:
    """What is compared with, drawn once and kept: minutes each."""
    folder, found = cache / "truths", {}
    folder.mkdir(parents=True, exist_ok=True)
    whole: Whole | None = None
    for name, eye in eyes(world).items():
        where = (*eye.position.tolist(), eye.yaw_deg, eye.pitch_deg)
        file = folder / f"{name}_{key_of(KINDS, TREES, EXTENT_M, SIZES[0], where)}.npy"
        if not file.exists():
            if whole is None:
                whole = Whole(world)
                for _ in whole.load(context()):
                    pass
            np.save(file, whole.truth(eye, SIZES[0]).astype(np.float16))
        found[name] = np.load(file).astype(np.float32)
    if whole is not None:
        whole.release()
    return found


def measured(cache: Path, say: Say) -> tuple[list[Row], dict[tuple[str, str], Picture]]:
    """Rows, and pictures by view and what is drawn; the truth among them, as "truth"."""
    there = worlds(cache)
    look_at = truths(cache, there["whole"])
    rows: list[Row] = []
    pictures = {(view, "truth"): picture for view, picture in look_at.items()}
    for drawn, world in there.items():
        with loaded(world) as forest:
            for view, eye in eyes(world).items():
                look = Look(detail=IN_FULL, level=0) if drawn == "whole" else Look()
                say(f"{view}, {drawn}")
                times = 1 if drawn == "whole" else FRAMES
                for size in SIZES:
                    row, picture = timed(forest, eye, size, look, times)
                    row = replace(row, view=view, drawn=drawn)
                    if size == SIZES[0]:
                        row = compared(row, look_at[view], picture, crops_of(forest, eye, size))
                        pictures[view, drawn] = picture
                    rows.append(row)
    return rows, pictures


def timed(
    forest: Forest, eye: Eye, size: tuple[int, int], look: Look, times: int
) -> tuple[Row, Picture]:
    """Median time of so many frames, after one that is not counted where there are several."""
    ctx = context()
    with framebuffer_kept(ctx), Screen(ctx) as screen:
        seconds = []
        for number in range(times + (times > 1)):
            since = perf_counter()
            screen.begin(size, (0.0, 0.0, 0.0))
            stats = forest.draw(eye, size, look)
            screen.resolve()
            screen.ctx.finish()
            if number or times == 1:
                seconds.append(perf_counter() - since)
    picture = forest.picture(eye, size, look)
    surfels = int(stats.said[0].split()[0].replace(",", "")) if stats.said else 0
    median = 1e3 * float(np.median(seconds))
    return Row("", "", size[0], median, stats.draws, stats.triangles, surfels), picture


def compared(
    row: Row, truth: Picture, picture: Picture, crops: Sequence[tuple[slice, slice]]
) -> Row:
    whole = score(reference(truth), picture)
    one, other = luma(truth), luma(picture)
    parts = [hierarchical(one[part], other[part]) for part in crops]
    return replace(
        row,
        hierarchical=hierarchical(one, other),
        ssim=float(whole["ssim"]),
        flip=float(whole["flip"]),
        crops=float(np.mean(parts)) if parts else None,
    )


def luma(picture: Picture) -> SingleArray:
    """(h, w) of the picture over the usual background."""
    return np.asarray(srgb_from_linear(over(picture)) @ LUMINANCE)


def crops_of(forest: Forest, eye: Eye, size: tuple[int, int]) -> list[tuple[slice, slice]]:
    """Parts of a picture that hold a tree each, of those that are large enough, spread evenly over
    distances."""
    found, _, _ = forest.choose(eye, size, Look(detail=IN_FULL, level=0))
    kinds = forest._kinds_for(eye.focal_px(size[1]))
    kind, scale = found.rows["species"], found.rows["scale"]
    middle = found.place.astype(np.float64)
    middle[:, 1] += scale * kinds.center[kind]
    right, up, back = (middle @ eye.axes.T).T
    focal, ahead = eye.focal_px(size[1]), back < 0
    depth = np.where(ahead, -back, 1.0)
    half = scale * kinds.radius[kind] * focal / depth
    x, y = size[0] / 2 + right * focal / depth, size[1] / 2 - up * focal / depth
    inside = ahead & (x > half) & (x < size[0] - half) & (y > half) & (y < size[1] - half)
    inside &= (2 * half >= CROP_PX[0]) & (2 * half <= CROP_PX[1])
    rows = np.flatnonzero(inside)
    rows = rows[np.argsort(depth[rows], kind="stable")]
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, CROPS).astype(int))] if len(rows) else rows

    def around(middle: float, half: float) -> slice:
        return slice(int(middle - half), ceil(middle + half))

    return [(around(y[i], half[i]), around(x[i], half[i])) for i in rows]
