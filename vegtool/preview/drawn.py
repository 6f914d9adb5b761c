"""A world drawn: in a window, or into files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from vegtool.formats.atomic import FileSet
from vegtool.formats.png import encode
from vegtool.lighting.light import Sun
from vegtool.preview.command import Result, Wanted, as_json
from vegtool.preview.controls import Fly, Orbit, orbiting
from vegtool.preview.eye import Eye
from vegtool.preview.governor import Governor
from vegtool.preview.options import FadeMode, PreviewOptions
from vegtool.preview.path import CameraPath, eyes, read_path
from vegtool.preview.run import frames, loaded, summary, timed_frames
from vegtool.preview.show import Show
from vegtool.preview.state import FIRST_DETAIL, LEAST_DETAIL, State
from vegtool.preview.world import Row, World
from vegtool.progress import Progress

FPS = 30.0
"""Of frames that no path gives a time."""


def show_of(world: World, options: PreviewOptions) -> Show:
    """What is shown of a world at first: plants in a row are orbited, landscapes walked."""
    camera: Fly | Orbit
    if isinstance(world.placement, Row):
        camera = orbiting(world.start, world.target)
    else:
        camera = Fly(world.start, ground=world.height_at)
    sun = None if options.sun is None else Sun.read(options.sun)
    governor = (
        None if not options.fps else Governor(1e3 / options.fps, LEAST_DETAIL, detail=FIRST_DETAIL)
    )
    state = State(camera, world.target, sun=sun, governor=governor)
    return Show(world, state, cast(FadeMode, options.fade))


def drawn_without_window(
    wanted: Wanted, world: World, options: PreviewOptions, progress: Progress
) -> Result:
    """Write pictures, a film or figures."""
    path = None if wanted.camera is None else read_path(wanted.camera)
    show = show_of(world, options)
    size = options.pixels
    facts: dict[str, Any] = {}
    lines: list[str] = []
    with loaded(show, progress) as screen:
        seen = _eyes(world, path)
        rate = FPS if path is None else path.fps
        if wanted.screenshot is not None:
            (picture,) = frames(show, screen, size, seen[:1], rate)
            with FileSet(wanted.screenshot.parent, wanted.force) as files:
                files.add(wanted.screenshot.name, encode(picture))
            facts["screenshot"] = str(wanted.screenshot)
            lines.append(f"{wanted.screenshot}: {size[0]} x {size[1]} pixels")
        if wanted.frames is not None:
            several = [seen[i % len(seen)] for i in range(wanted.frames)]
            figures = summary(show, timed_frames(show, screen, size, several, rate, progress), size)
            if wanted.stats is not None:
                with FileSet(wanted.stats.parent, wanted.force) as files:
                    files.add(wanted.stats.name, as_json(figures))
            facts["stats"] = {k: v for k, v in figures.items() if k != "rows"}
            lines.append(
                f"{figures['frames']} frames: median {figures['median_ms']:.1f} ms "
                f"({figures['median_fps']:.1f} fps), worst {figures['worst_ms']:.1f} ms; "
                f"{figures['median_plants']:,} of {figures['plants_total']:,} plants, "
                f"{figures['median_triangles']:,} triangles"
            )
        if wanted.out is not None:
            from vegtool.preview.movie import write_frames

            film = write_frames(
                frames(show, screen, size, seen, rate), wanted.out, rate, wanted.force,
                progress, len(seen),
            )  # fmt: skip
            facts["film"] = [str(p) for p in film.paths]
            lines += [f"{wanted.out}: {film.frames} frames", *film.notes]
    return Result(facts, "\n".join(lines))


def _eyes(world: World, path: CameraPath | None) -> list[Eye]:
    if path is None:
        return [world.start]
    return eyes(path, ground=world.height_at, near_m=world.start.near_m)


def shown_in_window(
    wanted: Wanted, world: World, options: PreviewOptions, say: Callable[[str], None]
) -> Result:
    """Open a window and wait until it is closed."""
    from vegtool.gl.window import open_window

    show = show_of(world, options)
    if wanted.camera is not None:
        show.follow(_eyes(world, read_path(wanted.camera)), read_path(wanted.camera).fps)
    window = open_window(show, f"vegtool preview: {wanted.path}", options.pixels)
    window.run()
    return Result({}, "")
