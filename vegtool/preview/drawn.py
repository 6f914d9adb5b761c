"""A world drawn: in a window, or into files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from vegtool.camera_path.file import CameraPath, written
from vegtool.errors import VegtoolError
from vegtool.formats.atomic import FileSet
from vegtool.formats.png import encode
from vegtool.gl.landscape import GROUND_COLOR
from vegtool.gl.screen import Screen
from vegtool.lighting.light import Light, Sun
from vegtool.preview.command import Result, Say, Wanted, as_json, part
from vegtool.preview.controls import Fly, Orbit, orbiting
from vegtool.preview.eye import Eye
from vegtool.preview.governor import BEGIN, Governor
from vegtool.preview.options import FadeMode, PreviewOptions
from vegtool.preview.path import duration_s, eyes, recorded
from vegtool.preview.run import frames, loaded, settle, summary, timed_frames
from vegtool.preview.scenery import Place
from vegtool.preview.show import SKY, Show
from vegtool.preview.size_control import LARGEST_PX, SizeControl
from vegtool.preview.state import FIRST_DETAIL, LEAST_DETAIL, State
from vegtool.progress import Progress

if TYPE_CHECKING:
    from vegtool.gl.window import Backdrop, Window

FPS = 30.0
"""Of frames that no path gives a time."""
LOADING, SETTLED = 0.4, 0.5
"""Of the progress of what is drawn without a window."""
BEHIND_M = 300.0
"""Of the ground, from the eye on each side: what is seen of it while a window loads."""


def show_of(world: Place, options: PreviewOptions) -> Show:
    """What is shown of a world at first: plants in a row are orbited, landscapes walked."""
    camera: Fly | Orbit
    if world.orbited:
        camera = orbiting(world.start, world.target)
    else:
        camera = Fly(world.start, ground=world.height_at)
    sun = world.sun if options.sun is None else Sun.read(options.sun)
    governor: Governor | SizeControl | None = None
    if options.fps:  # what is within BEGIN of the target is left as it is, and is to be fast enough
        target_ms = 1e3 / options.fps / (1 + BEGIN)
        if world.progressive:
            governor = SizeControl(target_ms, LARGEST_PX)
        else:
            governor = Governor(target_ms, LEAST_DETAIL, detail=FIRST_DETAIL)
    state = State(camera, world.target, sun=sun, governor=governor, stereo=options.stereo)
    return Show(world, state, cast(FadeMode, options.fade))


def drawn_without_window(
    wanted: Wanted,
    world: Place,
    path: CameraPath | None,
    options: PreviewOptions,
    progress: Progress,
) -> Result:
    """Write pictures, a film or figures. path: the way that is walked."""
    show = show_of(world, options)
    seen = eyes_of(world, path)
    rate = FPS if path is None else path.fps
    facts: dict[str, Any] = {}
    lines: list[str] = []
    with loaded(show, part(progress, 0.0, LOADING)) as screen:
        settle(show, screen, options.pixels, seen[0], part(progress, LOADING, SETTLED))
        drawn = part(progress, SETTLED, 1.0)
        if wanted.screenshot is not None:
            lines += _screenshot(wanted, show, screen, options.pixels, seen[0], facts)
        if wanted.frames is not None:
            several = [seen[i % len(seen)] for i in range(wanted.frames)]
            lines += _figures(wanted, show, screen, options.pixels, several, rate, facts, drawn)
        if wanted.out is not None:
            lines += _film(wanted, show, screen, options.pixels, seen, rate, facts, drawn)
    return Result(facts, "\n".join(lines))


def eyes_of(world: Place, path: CameraPath | None) -> list[Eye]:
    """The eye at each frame of a path through a world, or its first one."""
    if path is None:
        return [world.start]
    if ("fov_y_deg",) not in path.lines:  # the file does not say
        path = replace(path, fov_y_deg=world.start.fov_y_deg)
    start = world.start
    return eyes(path, ground=world.height_at, near_m=start.near_m, far_m=start.far_m)


def _screenshot(
    wanted: Wanted, show: Show, screen: Screen, size: tuple[int, int], eye: Eye,
    facts: dict[str, Any],
) -> list[str]:  # fmt: skip
    assert wanted.screenshot is not None
    (picture,) = frames(show, screen, size, [eye], FPS)
    with FileSet(wanted.screenshot.parent, wanted.force) as files:
        files.add(wanted.screenshot.name, encode(picture))
    facts["screenshot"] = str(wanted.screenshot)
    return [f"{wanted.screenshot}: {size[0]} x {size[1]} pixels"]


def _figures(
    wanted: Wanted, show: Show, screen: Screen, size: tuple[int, int], seen: Sequence[Eye],
    rate: float, facts: dict[str, Any], progress: Progress,
) -> list[str]:  # fmt: skip
    figures = summary(show, timed_frames(show, screen, size, seen, rate, progress), size)
    if wanted.stats is not None:
        with FileSet(wanted.stats.parent, wanted.force) as files:
            files.add(wanted.stats.name, as_json(figures))
        facts["stats_file"] = str(wanted.stats)
    facts["stats"] = {k: v for k, v in figures.items() if k != "rows"}
    return [
        f"{figures['frames']} frames: median {figures['median_ms']:.1f} ms "
        f"({figures['median_fps']:.1f} fps), worst {figures['worst_ms']:.1f} ms; "
        f"{figures['median_plants']:,} of {figures['plants_total']:,} plants, "
        f"{figures['median_triangles']:,} triangles"
    ]


def _film(
    wanted: Wanted, show: Show, screen: Screen, size: tuple[int, int], seen: Sequence[Eye],
    rate: float, facts: dict[str, Any], progress: Progress,
) -> list[str]:  # fmt: skip
    from vegtool.preview.movie import write_frames

    assert wanted.out is not None
    pictures = frames(show, screen, size, seen, rate)
    film = write_frames(pictures, wanted.out, rate, wanted.force, progress, len(seen))
    facts["film"] = {"files": [str(p) for p in film.paths], "frames": film.frames, "fps": rate}
    pixels = f"{film.width} x {film.height} pixels"
    told = f"{wanted.out}: {film.frames} frames, {len(seen) / rate:.1f} s, {pixels}"
    return [told, *film.notes]


def shown_in_window(
    name: Path, world: Place, path: CameraPath | None, options: PreviewOptions, say: Say
) -> Result:
    """Open a window and wait until it is closed. path: the way that is walked at first."""
    from vegtool.gl.window import open_window

    show = show_of(world, options)
    keeper = Keeper(Path(), say)
    show.keeper = keeper
    if path is not None:
        show.follow(eyes_of(world, path), path.fps)
    title = f"vegtool preview: {name}"
    window = open_window(show, title, options.pixels, backdrop=_backdrop(world, show.state.light))
    keeper.window = window
    try:
        window.run()
    finally:
        show.keep_way()
    return Result({"pictures": keeper.pictures, "ways": keeper.ways}, "")


class Keeper:
    """Writes what the user of a window keeps, into a folder, under the next free numbers.

    What cannot be written is said, and the walk goes on. pictures, ways: names of what was written.
    """

    def __init__(self, folder: Path, say: Say) -> None:
        self.window: Window | None = None
        self.pictures: list[str] = []
        self.ways: list[str] = []
        self._folder, self._say = folder, say

    def picture(self) -> None:
        """Write what is shown, without its text."""
        if self.window is None:
            return
        with self._told("the picture"):
            path = self._write("vegtool", ".png", encode(self.window.screenshot()))
            self.pictures.append(str(path))
            self._say(f"{path}: saved")

    def way(self, walked: Sequence[tuple[Eye, float]]) -> None:
        """Write a way that was walked: eyes, and when each was there, seconds."""
        if not walked:
            return
        with self._told("the way"):
            last = -inf
            kept = [(eye, last := at) for eye, at in walked if at > last]
            path = recorded([eye for eye, _ in kept], [at for _, at in kept])
            file = self._write("way", ".toml", written(path).encode())
            self.ways.append(str(file))
            seconds = duration_s(path)
            self._say(f"{file}: saved, {seconds:.1f} s; --path {file} walks it again")

    def _write(self, stem: str, ending: str, data: bytes) -> Path:
        number = 1
        while (path := self._folder / f"{stem}_{number:04d}{ending}").exists():
            number += 1
        with FileSet(self._folder) as files:
            files.add(path.name, data)
        return path

    @contextmanager
    def _told(self, what: str) -> Iterator[None]:
        """Say what went wrong, where something did, and go on."""
        try:
            yield
        except VegtoolError as error:
            self._say(f"{what} was not saved: {error}")


def _backdrop(world: Place, light: Light) -> Backdrop | None:
    """The ground around the eye, while the plants are loaded."""
    if world.ground is None:
        return None
    from vegtool.gl.window import Backdrop

    eye, ground = world.start, world.ground
    around = np.array([BEHIND_M, np.inf, BEHIND_M])
    low, high = eye.position - around, eye.position + around
    positions = ground.positions + ground.origin
    corners = positions[ground.faces]
    near = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = eye.axes.T, eye.position
    return Backdrop(
        np.clip(positions, low, high), ground.normals, ground.faces[near], pose,
        np.array(GROUND_COLOR), np.array(SKY), light.unit, eye.fov_y_deg,
    )  # fmt: skip
