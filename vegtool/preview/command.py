"""What `vegtool preview` does: a window, or what is written without one."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from vegtool.errors import OutputError, UsageError
from vegtool.formats import ReadOptions
from vegtool.formats.atomic import FileSet, check_free
from vegtool.formats.tileset import TILESET
from vegtool.preview.options import PreviewOptions
from vegtool.progress import Progress
from vegtool.surfels.options import SUFFIX

if TYPE_CHECKING:
    from vegtool.camera_path.file import CameraPath
    from vegtool.preview.scenery import Place
    from vegtool.scene import Scene

SEVERAL_FILES = (".gltf", ".obj")
"""Extensions of models whose pictures are files of their own."""
READING = 0.2
"""Of the progress of what is written: reading files."""

Bar = Callable[[str], AbstractContextManager[Progress]]
"""What shows progress, under a title, as long as it is open."""


class Say(Protocol):
    """Says a sentence to the user, who wants to hear what is important `at` least."""

    def __call__(self, text: str, at: int = 0) -> None:
        """at: 0 for all, 1 for those who asked for more."""


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

    @property
    def window(self) -> bool:
        """Whether it is a window that is wanted."""
        return all(one is None for one in (self.out, self.screenshot, self.frames, self.html))


@dataclass(frozen=True)
class Result:
    """facts: for machines. text: for people."""

    facts: dict[str, Any]
    text: str


def run_preview(
    wanted: Wanted, options: PreviewOptions, read: ReadOptions, bar: Bar, say: Say
) -> Result:
    """Show or write what is wanted.

    Raises UsageError for what contradicts each other, InputError for what is missing or broken,
    OutputError where nothing can be written, CapabilityError where nothing can be drawn or shown.
    """
    _check(wanted, options, read)
    if wanted.html is not None:
        with bar("preview"):
            return _write_page(wanted)
    from vegtool.preview.world import parts_of, read_world, way_of

    tiles = _tileset_at(wanted.path)
    if tiles is not None:
        _check_alone(wanted, options, read, "a tileset, whose plants stand", "tiles")
    surfels = _is_surfels(wanted.path)
    if surfels:
        _check_alone(wanted, options, read, "surfel billboards, which stand", "surfel billboards")
    folder, file = parts_of(wanted.path, wanted.scene)
    scene, way = None, wanted.camera
    if file is not None:
        from vegtool.scene import read_scene

        scene = read_scene(file)
        way = way or way_of(scene)
    path = None
    if way is not None:
        from vegtool.camera_path.file import read_path

        path = read_path(way)
    _check_written(wanted, path, _inputs(wanted, scene, way))
    if wanted.window and wanted.path.exists():  # what is not there is told first
        from vegtool.gl.window import check_display

        check_display()
    with bar("preview") as progress:
        world: Place
        if tiles is not None:
            from vegtool.preview.drawn import eyes_of
            from vegtool.preview.tile_world import read_tile_world

            squares = read_tile_world(tiles)
            world = squares.told_of(eyes_of(squares, path), options.pixels[1])
        elif surfels:
            from vegtool.preview.surfel_world import read_surfel_world

            world = read_surfel_world(wanted.path, options.pixels[1])
        else:
            from vegtool.preview.lacking import notes_on_limits

            plants = read_world(folder, file, read, part(progress, 0.0, READING))
            fov = min([plants.start.fov_y_deg, *([] if path is None else [path.fov_y_deg])])
            lacks = notes_on_limits(plants, scene, way, options.pixels[1], fov)
            world = replace(plants, notes=(*plants.notes, *lacks))
        from vegtool.preview.drawn import drawn_without_window, shown_in_window

        _tell(world, options, say)
        if not wanted.window:
            drawn = part(progress, READING, 1.0)
            result = drawn_without_window(wanted, world, path, options, drawn)
    if wanted.window:
        result = shown_in_window(wanted.path, world, path, options, say)
    return Result({**result.facts, "notes": list(world.notes)}, result.text)


def part(progress: Progress, start: float, end: float) -> Progress:
    """Progress of what is a part of something else."""
    return lambda stage, fraction: progress(stage, start + (end - start) * fraction)


def as_json(values: Any) -> bytes:
    """Figures as the bytes of a file."""
    return (json.dumps(values, indent=2, allow_nan=False) + "\n").encode()


def _check(wanted: Wanted, options: PreviewOptions, read: ReadOptions) -> None:
    """Raise UsageError for what contradicts each other, whatever is in the files."""
    if wanted.stats is not None and wanted.frames is None:
        raise UsageError("--stats: writes what frames took; add how many, --frames N")
    others = (wanted.scene, wanted.camera, wanted.out, wanted.screenshot, wanted.frames)
    plain = options == PreviewOptions() and read == ReadOptions()
    if wanted.html is not None and _tileset_at(wanted.path) is not None:
        raise UsageError(
            "--html: writes a page of converted plants; a tileset is for viewers of 3D Tiles, and "
            "has none. Leave out --html, or name the folder of the plants"
        )
    if wanted.html is not None and _is_surfels(wanted.path):
        raise UsageError(
            "--html: writes a page of converted plants, whose levels are glTF; surfel billboards "
            "are for this window. Leave out --html, or name a folder of plants"
        )
    if wanted.html is not None and not (plain and all(other is None for other in others)):
        raise UsageError(
            "--html: writes a page that shows converted plants by themselves; leave out all else "
            "but the folder and -f"
        )
    for file, ending in (
        (wanted.screenshot, ".png"), (wanted.stats, ".json"), (wanted.html, ".html"),
    ):  # fmt: skip
        if file is not None and file.suffix.lower() != ending:
            raise UsageError(f"{file}: expected a name that ends in {ending}")
        if file is not None:
            check_free(file.parent, [file.name], wanted.force)


def _check_alone(
    wanted: Wanted, options: PreviewOptions, read: ReadOptions, is_what: str, they: str
) -> None:
    """Raise UsageError for what changes nothing about tiles, or surfel billboards."""
    if wanted.scene is not None or read != ReadOptions():
        raise UsageError(
            f"{wanted.path}: is {is_what} where they do; leave out --scene, "
            "--unit, --up and --leaf-material"
        )
    if options.fade != PreviewOptions().fade:
        raise UsageError(f"--fade: {they} follow each other in their own way; leave it out")


def _tileset_at(path: Path) -> Path | None:
    """The tileset.json that a path is, or that lies in it; None for anything else."""
    file = path / TILESET if path.is_dir() else path
    return file if file.name == TILESET and file.exists() else None


def _is_surfels(path: Path) -> bool:
    return path.suffix.lower() == SUFFIX


def _check_written(wanted: Wanted, path: CameraPath | None, inputs: list[Path]) -> None:
    """Raise UsageError, OutputError and CapabilityError where something may not be written."""
    if wanted.out is not None:
        if path is None:
            raise UsageError("--out: writes a walk; add the way, --path PATH.toml")
        from vegtool.preview.movie import check_output

        check_output(wanted.out, path.fps, wanted.force)
    for file in (wanted.screenshot, wanted.stats):
        if (
            file is not None
            and file.exists()
            and (any(_same(file, one) for one in inputs) or _beside(file, wanted.path))
        ):
            raise OutputError(
                f"{file}: is read by this command, and never overwritten. Name another file."
            )


def _inputs(wanted: Wanted, scene: Scene | None, way: Path | None) -> list[Path]:
    """The files that are read, as far as they are named."""
    named = [wanted.path, wanted.scene, way]
    if scene is not None:
        texts = [scene.terrain.heightmap, scene.placement.inventory]
        texts += [text for one in scene.species for text in (one.model, one.density)]
        named += [scene.path.parent / text for text in texts if text is not None]
    if wanted.path.is_dir():
        named += wanted.path.glob("*.lod.json")
    return [file for file in named if file is not None and file.is_file()]


def _beside(file: Path, read: Path) -> bool:
    """Whether a file may belong to what is read: a picture of a model that is no single file, or
    anything among tiles."""
    tiles = _tileset_at(read)
    if tiles is not None:
        return file.resolve().is_relative_to(tiles.parent.resolve())
    return read.suffix.lower() in SEVERAL_FILES and _same(file.parent, read.parent)


def _same(file: Path, other: Path) -> bool:
    try:
        return file.samefile(other)
    except OSError:
        return False


def _tell(world: Place, options: PreviewOptions, say: Say) -> None:
    """What was guessed or left out; and, to those who ask, what each species' levels are."""
    for note in world.notes:
        say(note)
    for detail in world.details(world.start.focal_px(options.pixels[1])):
        say(detail, at=1)


def _write_page(wanted: Wanted) -> Result:
    from vegtool.preview.web import web_page

    assert wanted.html is not None
    page = web_page(wanted.path)
    with FileSet(wanted.html.parent, wanted.force) as files:
        files.add(wanted.html.name, page)
    facts = {"page": str(wanted.html), "bytes": len(page)}
    return Result(facts, f"{wanted.html}: {len(page) / 1e6:.1f} MB")
