"""What `vegtool tiles` does."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from vegtool.progress import Progress
from vegtool.tiles.options import TileOptions

Bar = Callable[[str], AbstractContextManager[Progress]]
"""What shows progress, under a title, as long as it is open."""


@dataclass(frozen=True)
class Result:
    """facts: for machines. text: for people."""

    facts: dict[str, Any]
    text: str


def run_tiles(
    path: Path, library: Path, folder: Path, options: TileOptions, bar: Bar,
    say: Callable[[str], None],
) -> Result:  # fmt: skip
    """Make the tiles of a scene or an inventory.

    Raises UsageError and InputError for what is missing or broken, OutputError where nothing can be
    written, CapabilityError where nothing can draw.
    """
    from vegtool.tiles.pyramid import pyramid_of
    from vegtool.tiles.run import TILESET, write_tiles
    from vegtool.tiles.source import scene_at

    started = perf_counter()
    with bar("tiles") as progress:
        pyramid = pyramid_of(scene_at(path, library), library, options, progress)
        for note in pyramid.notes:
            say(note)
        rows = [
            {
                "tile": str(tile.node),
                "kind": tile.kind,
                "plants": tile.plants,
                "triangles": tile.triangles,
                "bytes": len(tile.data),
                "draws": tile.draws,
                "error_m": tile.error_m,
                "seconds": {key: round(value, 4) for key, value in tile.seconds.items()},
            }
            for tile in write_tiles(pyramid, folder, progress)
        ]
    seconds = perf_counter() - started
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    facts = {
        "tileset": str(folder / TILESET),
        "plants": rows[-1]["plants"],
        "bytes": size,
        "seconds": round(seconds, 2),
        "tiles": rows,
        "notes": list(pyramid.notes),
    }
    lines = [f"{facts['tileset']}: {len(rows):,} tiles, {size / 1e6:,.1f} MB, {seconds:,.1f} s"]
    return Result(facts, "\n".join(lines))
