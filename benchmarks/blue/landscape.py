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
from time import process_time

import numpy as np
from landscape.making import tiles
from walk.scenes import Say, first_levels, key_of
from walk.truth import SUPERSAMPLE, Whole

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
from vegtool.preview.scenery import IN_FULL, Look, Scenery
from vegtool.preview.tile_forest import TileForest
from vegtool.preview.tile_world import read_tile_world
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
PROCESSES, TILE_M = 2, 128
"""That make tiles; metres, side of the smallest, so that there are not thousands."""
FRAMES = 5
"""Timed, of which the median counts; of trees that are whole, one."""
CROPS, CROP_PX = 60, (24, 400)
"""Trees that are looked at by themselves, at most, and heights of theirs in pixels."""
SHOWN_PX = (640, 360)
"""Of the middle of a picture, shown on the page."""
HIDDEN = 0.25
"""Of such a part, at most, is hidden by the parts of trees that are nearer."""

SURFELS = ConvertOptions(method="surfels", levels=1)
BILLBOARDS = ConvertOptions(levels=8, billboards=1024)

LANDSCAPE_ASKED = {"overview": 0.85, "ground": 0.95}
"""Of hierarchical similarity, at least; the paper's are 0.68 and 0.9."""
Part = tuple[slice, slice]
"""Rows and columns of a picture."""


@dataclass(frozen=True)
class Row:
    """A view drawn in one way. milliseconds: of the processor. hierarchical, ssim, flip: of the
    whole picture, four samples a pixel as the preview has. crops: mean hierarchical similarity of
    parts with one tree. fine: the same of a picture that has as many samples as the truth."""

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
    fine: float | None = None


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
def loaded(forest: Scenery) -> Iterator[None]:
    for _ in forest.load(context()):
        pass
    try:
        yield
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
    seen_by, look_at = eyes(there["whole"]), truths(cache, there["whole"])
    rows: list[Row] = []
    pictures = {(view, "truth"): picture for view, picture in look_at.items()}
    parts: dict[str, list[Part]] = {}

    def drawn(what: str, forest: Scenery, look: Look) -> None:
        for view, eye in seen_by.items():
            say(f"{view}, {what}")
            for size in SIZES:
                row = replace(timed(forest, eye, size, look), view=view, drawn=what)
                if size == SIZES[0]:
                    truth, picture = look_at[view], forest.picture(eye, size, look)
                    row = compared(row, truth, picture, parts[view])
                    if look.level is None:  # else it would be the truth
                        finer = forest.picture(eye, size, look, SUPERSAMPLE, samples=0)
                        row = replace(row, fine=alike(truth, finer, parts[view]))
                    pictures[view, what] = picture
                rows.append(row)

    for what, world in there.items():
        forest = Forest(world.species, world.placement, world.ground)
        with loaded(forest):
            parts = parts or {
                view: crops_of(forest, eye, SIZES[0]) for view, eye in seen_by.items()
            }
            drawn(what, forest, Look(detail=IN_FULL, level=0) if what == "whole" else Look())
    squares = tiled(cache, say)
    with loaded(squares):
        drawn("tiles", squares, Look())
    return rows, pictures


def tiled(cache: Path, say: Say) -> TileForest:
    """The landscape as tiles of surfels, which are made where they were not before."""
    out = cache / f"tiles_{key_of(KINDS, TREES, EXTENT_M)}"
    if not (out / "tileset.json").exists():
        words = "--surfels", "--tile", str(TILE_M)
        made = tiles(scene(cache / "scene"), library(cache, SURFELS), out, PROCESSES, *words)
        size = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
        say(f"tiles: {made.seconds:.0f} s, {made.peak_mb:,} MB peak, {size / 1e6:.0f} MB")
    place = read_tile_world(out / "tileset.json")
    return TileForest(place.tileset, place.ground)


def timed(forest: Scenery, eye: Eye, size: tuple[int, int], look: Look) -> Row:
    """Median time of the processor, of all threads, of FRAMES frames after one that is not counted;
    of a single one of trees that are whole, which takes minutes."""
    ctx, once = context(), look.level is not None
    with framebuffer_kept(ctx), Screen(ctx) as screen:
        seconds = []
        for _ in range(1 if once else FRAMES + 1):
            since = process_time()
            screen.begin(size, (0.0, 0.0, 0.0))
            stats = forest.draw(eye, size, look)
            screen.resolve()
            screen.ctx.finish()
            seconds.append(process_time() - since)
    surfels = int(stats.said[0].split()[0].replace(",", "")) if stats.said else 0
    median = 1e3 * float(np.median(seconds if once else seconds[1:]))
    return Row("", "", size[0], median, stats.draws, stats.triangles, surfels)


def compared(row: Row, truth: Picture, picture: Picture, parts: Sequence[Part]) -> Row:
    """The row, and how far a picture is from the truth."""
    whole = score(reference(truth), picture)
    return replace(
        row,
        hierarchical=hierarchical(luma(truth), luma(picture)),
        ssim=float(whole["ssim"]),
        flip=float(whole["flip"]),
        crops=alike(truth, picture, parts),
    )


def alike(truth: Picture, picture: Picture, parts: Sequence[Part]) -> float:
    """Mean hierarchical similarity of parts."""
    one, other = luma(truth), luma(picture)
    return float(np.mean([hierarchical(one[part], other[part]) for part in parts]))


def luma(picture: Picture) -> SingleArray:
    """(h, w) of the picture over the usual background."""
    return np.asarray(srgb_from_linear(over(picture)) @ LUMINANCE)


def crops_of(forest: Forest, eye: Eye, size: tuple[int, int]) -> list[Part]:
    """Parts of a picture that hold a tree each, of those that are large enough and that nearer ones
    leave in sight, spread evenly over distances."""
    found, _, _ = forest.choose(eye, size, Look(detail=IN_FULL, level=0))
    kind, scale = found.rows["species"], found.rows["scale"]
    low, high = np.stack([one.levels[0].bounds for one in forest.species], axis=1)
    middle = found.place.astype(np.float64)
    middle[:, 1] += scale * (low + high)[kind, 1] / 2
    wide = np.abs(np.stack([low, high]))[..., ::2].max(axis=(0, 2))[kind]
    right, up, back = (middle @ eye.axes.T).T
    focal, ahead = eye.focal_px(size[1]), back < 0
    depth = np.where(ahead, -back, 1.0)
    half = (scale * focal / depth)[:, None] * np.stack([(high - low)[kind, 1] / 2, wide], axis=1)
    at = np.array(size[::-1]) / 2 + focal * np.stack([-up, right], axis=1) / depth[:, None]
    inside = ((at > half) & (at < np.array(size[::-1]) - half)).all(axis=1)
    inside &= (2 * half[:, 0] >= CROP_PX[0]) & (2 * half[:, 0] <= CROP_PX[1])
    hidden, parts = np.zeros(size[::-1], bool), []
    for row in np.flatnonzero(ahead)[np.argsort(depth[ahead], kind="stable")]:
        part = _around(at[row, 0], half[row, 0]), _around(at[row, 1], half[row, 1])
        if inside[row] and hidden[part].mean() <= HIDDEN:
            parts.append(part)
        hidden[part] = True
    spread = np.linspace(0, len(parts) - 1, CROPS if parts else 0)
    return [parts[i] for i in np.unique(spread.astype(int))]


def _around(middle: float, half: float) -> slice:
    return slice(max(int(middle - half), 0), max(ceil(middle + half), 0))
