"""How long tiles take, how much memory, how many bytes: of the command, and of parts of it.

The command runs as users run it; its memory is that of all its processes together, looked at every
tenth of a second. Parts of it run in processes of their own, which begin and end with them.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from time import perf_counter
from typing import Any

import psutil

from landscape.scenes import library, scene
from vegtool.formats.tileset_check import check_tileset
from vegtool.tiles.jobs import Inputs, world_of
from vegtool.tiles.journal import write_file
from vegtool.tiles.make import chosen, instanced_tile, merged_tile
from vegtool.tiles.options import TileOptions
from vegtool.tiles.placement import placement_of
from vegtool.tiles.quadtree import Node, quadtree_of
from vegtool.tiles.terrain import terrain_of

EVERY_S = 0.1


@dataclass(frozen=True)
class Made:
    """What the command made. peak_mb: of all its processes together. wrong: of its tileset."""

    plants: int
    processes: int
    seconds: float
    peak_mb: int
    facts: dict[str, Any]
    wrong: list[str]


def command(cache: Path, plants: int, processes: int, keep: bool = False) -> Made:
    """`vegtool tiles` of a landscape of the scenes, from nothing."""
    out = cache / f"tiles_{plants}"
    made = tiles(scene(cache, plants), library(cache, print), out, processes)
    if not keep:
        shutil.rmtree(out)
    return made


def tiles(scene: Path, library: Path, out: Path, processes: int, *more: str) -> Made:
    """`vegtool tiles` of a scene file, with further words, from nothing."""
    shutil.rmtree(out, ignore_errors=True)
    words = [
        sys.executable, "-m", "vegtool", "tiles", str(scene), "--species", str(library),
        "-o", str(out), "-j", str(processes), "--json", *more,
    ]  # fmt: skip
    started = perf_counter()
    process = subprocess.Popen(words, stdout=subprocess.PIPE)
    peak, ended = [0], Event()
    watching = Thread(target=_watch, args=(process.pid, peak, ended))
    watching.start()
    text, _ = process.communicate()
    seconds = perf_counter() - started
    ended.set()
    watching.join()
    if process.returncode:
        raise SystemExit(process.returncode)
    wrong = check_tileset(out / "tileset.json")
    facts = json.loads(text)
    return Made(facts["plants"], processes, seconds, peak[0], facts, wrong)


def _watch(pid: int, peak: list[int], ended: Event) -> None:
    """Keep the most megabytes that a process and all it started hold together."""
    while not ended.wait(EVERY_S):
        held = 0
        try:
            whole = psutil.Process(pid)
            for one in (whole, *whole.children(recursive=True)):
                # what is shared with other processes counts once, by its share of it
                held += one.memory_full_info().pss
        except (psutil.NoSuchProcess, psutil.AccessDenied):
            continue
        peak[0] = max(peak[0], held // 10**6)


@dataclass(frozen=True)
class Merged:
    """Merging and writing alone: plants were placed, and the sheet was made, before it began."""

    tiles: int
    plants: int
    triangles: int
    bytes: int
    seconds: float
    peak_mb: int


def merging(cache: Path, plants: int) -> Merged:
    """All merged tiles of the lowest height, whose plants are placed, whose billboards baked."""
    out = cache / "merged"
    shutil.rmtree(out, ignore_errors=True)
    world = world_of(Inputs(scene(cache, plants), library(cache, print), out, TileOptions()))
    pyramid, height = world.pyramid, world.pyramid.options.near
    nodes = pyramid.tree.nodes(pyramid.tree.depth - height)
    stands = [pyramid.stand(node) for node in nodes]
    world.shared.sheet(height)
    begun = perf_counter()
    triangles = size = 0
    for node, stand in zip(nodes, stands, strict=True):
        if len(stand):
            level = chosen(pyramid, world.shared, node, stand).level
            tile = merged_tile(pyramid, world.shared, node, stand, level)
            write_file(out / f"{node.column}_{node.row}.glb", tile.data)
            triangles, size = triangles + tile.triangles, size + len(tile.data)
    seconds = perf_counter() - begun
    shutil.rmtree(out)
    return Merged(
        len(nodes), sum(map(len, stands)), triangles, size, seconds,
        psutil.Process().memory_info().rss // 10**6 if sys.platform == "win32" else _peak_mb(),
    )  # fmt: skip


def _peak_mb() -> int:
    import resource

    status = Path("/proc/self/status")
    if status.exists():  # Linux counts the parent's memory in ru_maxrss
        return int(status.read_text().split("VmHWM:")[1].split()[0]) // 1000
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 10**6


@dataclass(frozen=True)
class Single:
    """One of the smallest tiles of a landscape of so many plants and tiles. opened_s: of opening it
    with a library that is read. tile_s: of the tile itself. command_s: of the whole command."""

    plants: int
    tiles: int
    opened_s: float
    tile_s: float
    command_s: float


def single(cache: Path, plants: int, side_m: float) -> Single:
    """A tile in the middle of a landscape, of which nothing else is made."""
    out = cache / "single"
    shutil.rmtree(out, ignore_errors=True)
    path = scene(cache, plants, side_m)
    inputs = Inputs(path, library(cache, print), out, TileOptions())
    world = world_of(inputs)
    name = "/".join(
        map(str, (world.pyramid.tree.depth, *(world.pyramid.tree.cell.max(axis=0) // 2)))
    )
    words = [
        sys.executable, "-m", "vegtool", "tiles", str(path), "--species", str(inputs.library), "-o",
        str(out), "--only", name, "-q",
    ]  # fmt: skip
    started = perf_counter()
    subprocess.run(words, check=True)
    commanded = perf_counter()
    from vegtool.scene import read_scene

    found = read_scene(path)
    placement = placement_of(found, terrain_of(found), inputs.options.tile)
    tree = quadtree_of(placement.tiles, placement.tile_m)
    opened = perf_counter()
    node = Node(*map(int, name.split("/")))
    stand = world.pyramid.stand(node)
    level = chosen(world.pyramid, world.shared, node, stand).level
    tile = instanced_tile(world.pyramid, world.shared, node, stand, level)
    write_file(out / "tile.glb", tile.data)
    ended = perf_counter()
    shutil.rmtree(out)
    count = int(placement.tiles.count.sum())
    return Single(count, len(tree.cell), opened - commanded, ended - opened, commanded - started)
