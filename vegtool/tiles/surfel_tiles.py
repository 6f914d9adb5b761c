"""The surfel billboards of one plant as tiles: what `vegtool tiles NAME.surfels` does."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import fields
from pathlib import Path
from time import perf_counter
from typing import Any

from vegtool.console import human_bytes, table
from vegtool.errors import UsageError
from vegtool.formats.atomic import FileSet, check_free
from vegtool.formats.tileset import TILESET
from vegtool.options import default_of, flag_of
from vegtool.progress import part_of
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.store import read_surfels
from vegtool.surfels.tileset import surfel_tileset
from vegtool.surfels.tiling import SurfelTile, tiles_of
from vegtool.tiles.command import Bar, Result
from vegtool.tiles.options import RunOptions, TileOptions


def run_surfel_tiles(
    source: Path, library: Path | None, out: Path, options: TileOptions, run: RunOptions, bar: Bar
) -> Result:
    """Write the tileset of a plant, all of it or nothing; or, in a dry run, say what it would be.

    Raises UsageError for options of landscapes, InputError for a file that is missing or broken,
    OutputError where nothing can be written.
    """
    _check_options(source, library, options, run)
    if not run.dry_run:
        check_free(out, [TILESET], run.force, [source])
    started = perf_counter()
    with bar("tiles") as progress:
        progress("reading", 0.0)
        model = read_surfels(source)
        root = tiles_of(model)
        written: dict[str, int] = {}
        with nullcontext() if run.dry_run else FileSet(out, run.force, [source]) as files:
            report = part_of(progress, 0.2, 0.8)
            for name, data in surfel_tileset(model, root, source.stem, report):
                written[name] = len(data)
                if files is not None:
                    files.add(name, data)
    facts = _facts(model, root, written, out, perf_counter() - started)
    return Result(facts, _text(facts, run.dry_run))


def _check_options(
    source: Path, library: Path | None, options: TileOptions, run: RunOptions
) -> None:
    """Raise UsageError for what has no meaning for one plant."""
    given = [
        flag_of(item) for item in fields(options) if getattr(options, item.name) != default_of(item)
    ]
    for flag, value in (
        ("--species", library), ("--jobs", run.jobs), ("--dask", run.dask), ("--only", run.only),
    ):  # fmt: skip
        if value:
            given.append(flag)
    if given:
        raise UsageError(
            f"{source}: is one plant; for landscapes alone there is {', '.join(given)}. Leave that "
            "out, or name a scene or an inventory"
        )


def _facts(
    model: SurfelModel, root: SurfelTile, written: dict[str, int], out: Path, seconds: float
) -> dict[str, Any]:
    levels: list[list[SurfelTile]] = []
    front = [root]
    while front:
        levels.append(front)
        front = [child for tile in front for child in tile.children]
    return {
        "tileset": str(out / TILESET),
        "tiles": sum(map(len, levels)),
        "bytes": sum(written.values()),
        "shared_bytes": sum(size for name, size in written.items() if name.endswith(".png")),
        "seen_px": model.options.epsilon,
        "seconds": round(seconds, 2),
        "levels": [
            {
                "tiles": len(level),
                "billboards": sum(len(tile.billboards) for tile in level),
                "triangles": sum(len(tile.triangles) for tile in level),
                "error_m": max(tile.error for tile in level),
            }
            for level in levels
        ],
        "files": written,
    }


def _text(facts: dict[str, Any], dry: bool) -> str:
    """The same, in few words."""
    rows = [
        [f"{one['tiles']:,}", f"{one['billboards']:,}", f"{one['triangles']:,}",
         f"{1000 * one['error_m']:,.3g} mm"]
        for one in facts["levels"]
    ]  # fmt: skip
    size = f"{facts['tiles']:,} tiles, {human_bytes(facts['bytes'])}"
    head = f"{facts['tileset']}: {'would be ' if dry else ''}{size}"
    return (
        f"{head}\n{table(('tiles', 'billboards', 'triangles', 'error'), rows)}\n"
        f"for clients whose screen-space error is set to {facts['seen_px']:g}, in pixels"
    )
