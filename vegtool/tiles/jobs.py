"""The work that a tileset is made of, in parts that any process can do which sees the same files.

A model or a sheet that tiles share; a block, which is a merged square with all squares on it, whose
plants are placed once; and a far square, which is made of its quarters. A part whose key the
journal has, with its files there, is not made again.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import file_digest
from math import inf, isfinite
from pathlib import Path
from typing import Any

from vegtool.errors import (
    CapabilityError,
    InputError,
    OutputError,
    UsageError,
    VegtoolError,
    unknown,
)
from vegtool.formats import read_plant
from vegtool.formats.gltf_tile import read_surfels_tile
from vegtool.progress import Progress, silent
from vegtool.scene import Scene
from vegtool.tiles.journal import Entry, Hashed, key_of, write_file
from vegtool.tiles.make import (
    Chosen,
    Tile,
    chosen,
    error_of,
    instanced_tile,
    merged_tile,
    reclustered_tile,
)
from vegtool.tiles.options import TileOptions
from vegtool.tiles.pyramid import Pyramid, pyramid_of
from vegtool.tiles.quadtree import Node, nodes_of
from vegtool.tiles.shared import FOLDER, Shared
from vegtool.tiles.source import scene_at
from vegtool.tiles.stand import Stand
from vegtool.timing import timed
from vegtool.workers import check_stop

TILES = "tiles"
"""Folder of the tiles, in that of the tileset."""
SURFELS = "surfels"
INSTANCES = "instances"
"""Kinds of squares."""

FATAL = (OutputError, UsageError, CapabilityError)
"""Errors that other parts would meet with, too: they end the run, which can go on later."""


def file_of(node: Node) -> str:
    """Of a tile, relative to the output folder."""
    return f"{TILES}/{node.level}_{node.column}_{node.row}.glb"


@dataclass(frozen=True)
class Inputs:
    """What tiles are made of, and where they go, by path. digest: of what is there, or None where
    that is not known yet."""

    scene: Path
    library: Path
    out: Path
    options: TileOptions
    digest: str | None = None


@dataclass(frozen=True, eq=False)
class World:
    """The same, read. digest: of all files that were."""

    pyramid: Pyramid
    shared: Shared
    out: Path
    digest: str = ""


@dataclass(frozen=True)
class Job:
    """A part to make. known: what the journal has of what it makes. facts: whether it is enough to
    know what was made once, where the files are gone."""

    known: dict[str, Entry] = field(default_factory=dict, compare=False)
    facts: bool = False

    def entry(self, name: str, key: str, out: Path) -> Entry | None:
        """What is made already."""
        entry = self.known.get(name)
        return entry if entry and entry.key == key and (self.facts or entry.there(out)) else None


@dataclass(frozen=True)
class ModelJob(Job):
    """A level of a species, for instances. per_metre: pixels that no metre of it is seen as more
    than."""

    kind: int = 0
    level: int = 0
    per_metre: float = inf


@dataclass(frozen=True)
class SheetJob(Job):
    """The sheet of a height."""

    height: int = 0


@dataclass(frozen=True)
class BlockJob(Job):
    """A square, and all on it: those of `made` are made, and those of `surveyed` looked at; all are
    made if None."""

    node: Node = field(default=Node(0, 0, 0))
    made: tuple[Node, ...] | None = None
    surveyed: tuple[Node, ...] = ()


@dataclass(frozen=True)
class TileJob(Job):
    """A square of a block alone, with the models that it draws."""

    node: Node = field(default=Node(0, 0, 0))


@dataclass(frozen=True)
class FarJob(Job):
    """A square above the blocks. quarters: as they were made; None where that failed."""

    node: Node = field(default=Node(0, 0, 0))
    quarters: tuple[tuple[Node, Entry | None], ...] = ()


@dataclass(frozen=True)
class Made:
    """A part that is there. again: whether it was made now. seconds: by step, if so."""

    entry: Entry
    again: bool = True
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Surveyed:
    """A square of instances that is not made yet: what would be told of it, and of each species and
    level that it draws the largest scale."""

    entry: Entry
    scale: dict[tuple[int, int], float] = field(default_factory=dict)


@dataclass(frozen=True)
class Lacking:
    """A part that would have to be made of others whose files are gone."""

    node: Node
    quarters: tuple[Node, ...]


@dataclass(frozen=True)
class Failed:
    """A part that is not. trace: where an error that vegtool does not know came from."""

    name: str
    message: str
    exit_code: int = 1
    trace: str = ""


Outcome = Made | Failed | Surveyed | Lacking


def world_of(inputs: Inputs, progress: Progress = silent, workers: int = 1) -> World:
    """All that jobs need. What species lack is made first, in so many processes.

    Raises UsageError and InputError for what is missing or broken, InputError for what is not as
    the digest says.
    """
    scene = scene_at(inputs.scene, inputs.library)
    pyramid = pyramid_of(scene, inputs.library, inputs.options, progress, workers)
    digest = _digest(scene, pyramid)
    if inputs.digest not in (None, digest):
        raise InputError(
            f"{inputs.scene}, {inputs.library}: are not the same, here, as where the run was "
            "started; all who work on it are to see the same files"
        )
    return World(pyramid, Shared(pyramid, inputs.out / TILES), inputs.out, digest)


_world = lru_cache(maxsize=1)(world_of)


def do_at(inputs: Inputs, job: Job) -> list[Outcome]:
    """`do`, by another process, which reads the inputs once."""
    return do(_world(inputs), job)


def _digest(scene: Scene, pyramid: Pyramid) -> str:
    """Of the scene's own files, and of the species that it names."""
    named = [scene.placement.inventory, scene.terrain.heightmap]
    named += [table.density for table in scene.species]
    files = [scene.path, *(scene.path.parent / name for name in named if name is not None)]
    levels = [
        pyramid.digest(kind, level)
        for kind, one in enumerate(pyramid.species)
        for level in range(len(one.levels))
    ]
    return key_of(*map(_contents, files), *levels, *(one.digest for one in pyramid.samples))


def _contents(path: Path) -> str:
    """A hash of a file, which may be larger than memory."""
    with path.open("rb") as file:
        return file_digest(file, "blake2b").hexdigest()


def do(world: World, job: Job) -> list[Outcome]:
    """Make a part; of a block, all of its tiles. An error becomes part of the outcome, unless it is
    one of FATAL, which are raised."""
    done: list[Outcome] = []
    try:
        for outcome in _DO[type(job)](world, job):
            done.append(outcome)
    except FATAL:
        raise
    except Exception as error:
        done.append(_failed(name_of(job), error))
    return done


def name_of(job: Job) -> str:
    """What the journal calls it."""
    if isinstance(job, ModelJob):
        return f"model {job.kind}/{job.level}"
    if isinstance(job, SheetJob):
        return f"sheet {job.height}"
    assert isinstance(job, BlockJob | TileJob | FarJob)
    return str(job.node)


def called(name: str) -> str:
    """A part in a sentence for the user: tile 3/0/1, model 0/2, sheet 2."""
    return f"tile {name}" if name[0].isdigit() else name


def _failed(name: str, error: Exception) -> Failed:
    what = called(name)
    if isinstance(error, VegtoolError):
        return Failed(name, f"{what}: {error}", error.exit_code)
    if isinstance(error, MemoryError):
        return Failed(name, f"{what}: not enough memory; fewer processes (-j) need less")
    return Failed(name, f"{what}: {unknown(error)}", trace=traceback.format_exc())


def _model(world: World, job: ModelJob) -> Iterator[Outcome]:
    name, shared = name_of(job), world.shared
    seen = [job.per_metre] if isfinite(job.per_metre) else []
    key = key_of(
        shared.model_name(job.kind, job.level), world.pyramid.digest(job.kind, job.level),
        world.pyramid.options.near_texture, *seen,
    )  # fmt: skip

    def files() -> dict[str, bytes]:
        return shared.model_files(job.kind, job.level, job.per_metre)

    yield _shared(world, job, name, key, files)


def _sheet(world: World, job: SheetJob) -> Iterator[Outcome]:
    key = _sheet_key(world, job.height)
    yield _shared(world, job, name_of(job), key, lambda: world.shared.sheet_files(job.height))


def _shared(world: World, job: Job, name: str, key: str, make: Any) -> Outcome:
    """What tiles share, made unless it is there."""
    there = job.entry(name, key, world.out)
    if there is not None:
        return Made(there, again=False)
    seconds: dict[str, float] = {}
    with timed(seconds, "shared"):
        files = {f"{TILES}/{FOLDER}/{file}": data for file, data in make().items()}
        for file, data in files.items():
            write_file(world.out / file, data)
    return Made(Entry(name, key, {file: len(data) for file, data in files.items()}), True, seconds)


def _block(world: World, job: BlockJob) -> Iterator[Outcome]:
    tree, seconds = world.pyramid.tree, dict[str, float]()
    with timed(seconds, "placement"):
        stand = world.pyramid.stand(job.node)
    squares = nodes_of(tree, job.node) if job.made is None else job.made
    surveyed = set(job.surveyed)
    for node in (*squares, *job.surveyed):
        check_stop()
        try:
            own = stand if node == job.node else stand.on(tree.tiles_of(node))
            if node in surveyed:
                yield _surveyed(world, node, own)
                continue
            made = _placed(world, job, node, own)
        except FATAL:
            raise
        except Exception as error:
            yield _failed(str(node), error)
            continue
        if node == squares[0]:
            made = replace(made, seconds={**seconds, **made.seconds})
        yield made


def _surveyed(world: World, node: Node, stand: Stand) -> Surveyed:
    """What would be told of a square of instances."""
    if not len(stand):
        return Surveyed(_nothing(node))
    how = chosen(world.pyramid, world.shared, node, stand)
    scale: dict[tuple[int, int], float] = {}
    for pair in _drawn(stand, how):
        on = (stand.species == pair[0]) & (how.level == pair[1])
        scale[pair] = float(stand.scale[on].max())
    facts = {
        "kind": INSTANCES,
        "plants": len(stand),
        "error_m": error_of(world.pyramid, stand, how.level),
        "bounds": None,
    }
    return Surveyed(Entry(str(node), "", {}, facts), scale)


def _nothing(node: Node) -> Entry:
    """A square on which no plants turned out to stand."""
    return Entry(str(node), key_of("none"), {}, {"plants": 0})


def _placed(world: World, job: Job, node: Node, stand: Stand) -> Made:
    """A tile of the plants that stand on it."""
    pyramid, name = world.pyramid, str(node)
    if not len(stand):
        return Made(_nothing(node), again=False)
    near = pyramid.instanced(pyramid.tree.height(node.level))
    if pyramid.options.surfels and not near:
        return _sampled(world, job, node, stand)
    how = chosen(pyramid, world.shared, node, stand)
    key = _stand_key(world, node, stand, how)
    there = job.entry(name, key, world.out)
    if there is not None:
        return Made(there, again=False)
    make = instanced_tile if near else merged_tile
    return _written(world, make(pyramid, world.shared, node, stand, how.level), key)


def _sampled(world: World, job: Job, node: Node, stand: Stand) -> Made:
    """Surfels of the plants that stand on it, one at least."""
    from vegtool.tiles.surfel_squares import plants_tile, standing

    pyramid, own = world.pyramid, len(stand)
    every, beside = standing(pyramid, node, stand)
    key = key_of(
        SURFELS, pyramid.options.plain, own,
        *(pyramid.samples[kind].digest for kind in sorted(set(every.species.tolist()))),
        *(repr(pyramid.of_level[kind, 0]) for kind in sorted(set(every.species.tolist()))),
        every.foot - pyramid.origin(node), every.species, every.scale, every.yaw, every.tint,
        beside,
    )  # fmt: skip
    there = job.entry(str(node), key, world.out)
    if there is not None:
        return Made(there, again=False)
    return _written(world, plants_tile(pyramid, world.shared, node, every, own), key)


def _of_quarters(
    world: World, job: FarJob, quarters: Sequence[tuple[Node, Entry]]
) -> Made | Lacking:
    """Surfels of what its quarters' files hold."""
    from vegtool.tiles.surfel_squares import quarters_tile

    pyramid, node = world.pyramid, job.node
    if not quarters:
        return Made(_nothing(node), again=False)
    key = key_of(
        SURFELS, pyramid.options.plain, *(entry.key for _, entry in quarters),
        *(pyramid.origin(one) - pyramid.origin(node) for one, _ in quarters),
    )  # fmt: skip
    there = job.entry(str(node), key, world.out)
    if there is not None:
        return Made(there, again=False)
    gone = _gone(world, quarters) if job.facts else ()
    if gone:
        return Lacking(node, gone)
    seconds: dict[str, float] = {}
    with timed(seconds, "quarters"):
        read = [(one, read_surfels_tile(world.out / file_of(one))) for one, _ in quarters]
    plants, full = (sum(e.facts[what] for _, e in quarters) for what in ("plants", "full"))
    below_m = max(entry.facts["error_m"] for _, entry in quarters)
    tile = quarters_tile(pyramid, node, read, plants, full, below_m)
    return _written(world, replace(tile, seconds={**seconds, **tile.seconds}), key)


def _tile(world: World, job: TileJob) -> Iterator[Outcome]:
    pyramid, seconds = world.pyramid, dict[str, float]()
    with timed(seconds, "placement"):
        stand = pyramid.stand(job.node)
    if len(stand) and pyramid.instanced(pyramid.tree.height(job.node.level)):
        how = chosen(pyramid, world.shared, job.node, stand)
        for kind, level in _drawn(stand, how):
            yield from _model(world, ModelJob(job.known, kind=kind, level=level))
    made = _placed(world, job, job.node, stand)
    yield replace(made, seconds={**seconds, **made.seconds})


def _far(world: World, job: FarJob) -> Iterator[Outcome]:
    check_stop()
    pyramid, node, seconds = world.pyramid, job.node, dict[str, float]()
    lost = [str(one) for one, entry in job.quarters if entry is None]
    if lost:
        raise InputError(f"is made of its quarters, of which {', '.join(lost)} failed")
    quarters = [(one, entry) for one, entry in job.quarters if entry and entry.facts["plants"]]
    if pyramid.options.surfels:
        yield _of_quarters(world, job, quarters)
        return
    if all(entry.facts["kind"] != "reclustered" for _, entry in quarters):
        with timed(seconds, "placement"):
            stand = pyramid.stand(node)
        if not len(stand) or not chosen(pyramid, world.shared, node, stand).too_coarse:
            yield _placed(world, job, node, stand)
            return
    key = key_of(
        "reclustered", pyramid.budget(node), pyramid.from_m(pyramid.tree.height(node.level)),
        pyramid.options.max_texture, repr(pyramid.display),
        *(entry.key for _, entry in quarters),
        *(pyramid.origin(one) - pyramid.origin(node) for one, _ in quarters),
    )  # fmt: skip
    there = job.entry(str(node), key, world.out)
    if there is not None:
        yield Made(there, again=False)
        return
    gone = _gone(world, quarters) if job.facts else ()
    if gone:
        yield Lacking(node, gone)
        return
    with timed(seconds, "quarters"):
        read = [(one, read_plant(world.out / file_of(one))) for one, _ in quarters]
    plants = sum(entry.facts["plants"] for _, entry in quarters)
    below_m = max(entry.facts["error_m"] or 0.0 for _, entry in quarters)
    tile = reclustered_tile(pyramid, node, read, plants, below_m)
    yield _written(world, replace(tile, seconds={**seconds, **tile.seconds}), key)


def _gone(world: World, quarters: Sequence[tuple[Node, Entry]]) -> tuple[Node, ...]:
    """Those whose files are not there."""
    return tuple(one for one, entry in quarters if not entry.there(world.out))


_DO: dict[type[Job], Any] = {
    ModelJob: _model,
    SheetJob: _sheet,
    BlockJob: _block,
    TileJob: _tile,
    FarJob: _far,
}


def _written(world: World, tile: Tile, key: str) -> Made:
    file, origin = file_of(tile.node), world.pyramid.origin(tile.node)
    write_file(world.out / file, tile.data)
    facts = {
        "kind": tile.kind,
        "plants": tile.plants,
        "triangles": tile.triangles,
        "draws": tile.draws,
        "error_m": tile.error_m,
        "bounds": None if tile.bounds is None else (tile.bounds - origin).tolist(),
    }
    if tile.kind == SURFELS:
        facts |= {"surfels": tile.surfels, "full": tile.full}
    return Made(Entry(str(tile.node), key, {file: len(tile.data)}, facts), True, tile.seconds)


def _stand_key(world: World, node: Node, stand: Stand, how: Chosen) -> str:
    """Of the plants on a square, and of what they are drawn as."""
    pyramid, height = world.pyramid, world.pyramid.tree.height(node.level)
    near = pyramid.instanced(height)
    drawn: Sequence[str] = (
        [
            f"{world.shared.model_name(kind, level)} {pyramid.digest(kind, level)}"
            for kind, level in _drawn(stand, how)
        ]
        if near
        else [_sheet_key(world, height), repr(pyramid.options.plain)]
    )
    names = [one.name for one in pyramid.species]
    told: list[Hashed] = [stand.row, *names] if pyramid.options.attributes else []
    return key_of(
        *drawn, stand.foot - pyramid.origin(node), stand.species, stand.scale, stand.yaw,
        stand.tint, how.level, *told,
    )  # fmt: skip


def _drawn(stand: Stand, how: Chosen) -> list[tuple[int, int]]:
    """Species and levels that are drawn, in order."""
    return sorted(set(zip(stand.species.tolist(), how.level.tolist(), strict=True)))


def _sheet_key(world: World, height: int) -> str:
    levels = world.shared.levels(height)
    digests = [world.pyramid.digest(kind, level) for kind, level in levels]
    return key_of(height, world.pyramid.options.max_texture, repr(levels), *digests)
