"""What `vegtool preview` does: a window, or what is written without one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vegtool.errors import UsageError
from vegtool.formats import ReadOptions
from vegtool.formats.atomic import FileSet, check_free
from vegtool.preview.options import PreviewOptions
from vegtool.progress import Progress


@dataclass(frozen=True)
class Wanted:
    """What the user named: what is shown, and what is to be written; None for nothing."""

    path: Path
    scene: Path | None = None
    camera: Path | None = None
    out: Path | None = None
    screenshot: Path | None = None
    frames: int | None = None
    stats: Path | None = None
    html: Path | None = None
    force: bool = False


@dataclass(frozen=True)
class Result:
    """facts: for machines. text: for people."""

    facts: dict[str, Any]
    text: str


def run_preview(
    wanted: Wanted,
    options: PreviewOptions,
    read: ReadOptions,
    progress: Progress,
    say: Callable[[str], None],
) -> Result:
    """Show or write what is wanted.

    Raises UsageError for what contradicts each other, InputError for what is missing or broken,
    OutputError where nothing can be written, CapabilityError where nothing can be drawn or shown.
    """
    _check(wanted)
    if wanted.html is not None:
        return _write_page(wanted)
    from vegtool.preview.world import read_world

    world = read_world(wanted.path, wanted.scene, read, progress)
    for note in world.notes:
        say(note)
    from vegtool.preview.drawn import drawn_without_window, shown_in_window

    if wanted.screenshot or wanted.frames or wanted.out:
        return drawn_without_window(wanted, world, options, progress)
    return shown_in_window(wanted, world, options, say)


def _check(wanted: Wanted) -> None:
    if wanted.out is not None and wanted.camera is None:
        raise UsageError("--out: writes a walk; add the way, --path PATH.toml")
    if wanted.stats is not None and wanted.frames is None:
        raise UsageError("--stats: writes what frames took; add how many, --frames N")
    others = (wanted.scene, wanted.camera, wanted.out, wanted.screenshot, wanted.frames)
    if wanted.html is not None and any(other is not None for other in others):
        raise UsageError("--html: shows converted plants by themselves; leave out the rest")
    for file, ending in ((wanted.screenshot, ".png"), (wanted.html, ".html")):
        if file is not None and file.suffix.lower() != ending:
            raise UsageError(f"{file}: expected a name that ends in {ending}")
    for file in (wanted.screenshot, wanted.stats, wanted.html):
        if file is not None:
            check_free(file.parent, [file.name], wanted.force)


def _write_page(wanted: Wanted) -> Result:
    from vegtool.preview.web import web_page

    assert wanted.html is not None
    page = web_page(wanted.path)
    with FileSet(wanted.html.parent, wanted.force) as files:
        files.add(wanted.html.name, page)
    facts = {"file": str(wanted.html), "bytes": len(page)}
    return Result(facts, f"{wanted.html}: {len(page) / 1e6:.1f} MB")


def as_json(values: Any) -> bytes:
    """Figures as the bytes of a file."""
    return (json.dumps(values, indent=2, allow_nan=False) + "\n").encode()
