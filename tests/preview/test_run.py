"""What is drawn without a window, and what a window keeps: piece by piece."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from vegtool.camera_path.file import read_path
from vegtool.gl.screen import Screen
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.preview.command import part
from vegtool.preview.drawn import BEHIND_M, Keeper, _backdrop, show_of
from vegtool.preview.eye import Eye
from vegtool.preview.options import PreviewOptions
from vegtool.preview.run import frames, loaded, settle, summary, timed_frames
from vegtool.preview.show import Show
from vegtool.preview.world import World, _row
from vegtool.tiles.library import Species

pytestmark = pytest.mark.gl
SIZE = (60, 40)


@pytest.fixture(scope="module")
def world() -> World:
    """A herb."""
    plant = sample("herb", 120)
    return _row([Species("herb", (plant,), np.zeros(1), np.zeros(1), 900.0, (Path("herb.glb"),))])


@pytest.fixture(scope="module")
def drawing(world: World) -> Iterator[tuple[Show, Screen]]:
    show = show_of(world, PreviewOptions())
    with loaded(show) as screen:
        yield show, screen


def test_frames_come_in_order_and_each_from_its_eye(
    world: World, drawing: tuple[Show, Screen]
) -> None:
    """What is seen from the back, after what is seen from the front; both are found again."""
    around = world.target + (world.start.position - world.target) * [-1, 1, -1]
    back = Eye(around, world.start.yaw_deg + 180, world.start.pitch_deg)
    seen = [world.start, back, world.start]
    told: list[float] = []
    one, other, again = frames(*drawing, SIZE, seen, 30.0, lambda _, done: told.append(done))
    assert np.array_equal(one, again) and not np.array_equal(one, other)
    assert one.shape == (40, 60, 3) and one.dtype == np.uint8
    assert told == [1 / 3, 2 / 3, 1.0]


def test_what_loads_tells_how_far_it_is(world: World) -> None:
    told: list[float] = []
    with loaded(show_of(world, PreviewOptions()), lambda _, done: told.append(done)):
        pass
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)


def test_a_part_of_the_progress_lies_between_its_ends() -> None:
    told: list[tuple[str, float]] = []
    within = part(lambda stage, done: told.append((stage, done)), 0.2, 0.6)
    for fraction in (0.0, 0.5, 1.0):
        within("half", fraction)
    assert told == [("half", pytest.approx(f)) for f in (0.2, 0.4, 0.6)]


def test_figures_are_medians_and_the_worst(drawing: tuple[Show, Screen]) -> None:
    show, screen = drawing
    row = timed_frames(show, screen, SIZE, [show.world.start], 30.0)[0]
    rows = [{**row, "ms": ms} for ms in (10.0, 40.0, 20.0)]
    told = summary(show, rows, SIZE)
    assert (told["median_ms"], told["worst_ms"]) == (20.0, 40.0)
    assert (told["median_fps"], told["worst_fps"]) == (50.0, 25.0)
    assert told["frames"] == 3 and told["rows"] == rows
    assert (told["median_plants"], told["plants_total"]) == (1, 1)


def test_nothing_is_drawn_to_settle_where_no_rate_is_held(drawing: tuple[Show, Screen]) -> None:
    show, screen = drawing
    before = show.stats
    settle(show, screen, SIZE, show.world.start)
    assert show.stats is before


def test_the_sun_of_the_options_wins(world: World) -> None:
    from dataclasses import replace

    from vegtool.lighting.light import Sun

    lit = replace(world, sun=Sun(10.0, 20.0))
    assert show_of(lit, PreviewOptions()).state.sun == Sun(10.0, 20.0)
    assert show_of(lit, PreviewOptions(sun="30,40")).state.sun == Sun(30.0, 40.0)


def test_a_backdrop_is_the_ground_around_the_eye(world: World) -> None:
    """No farther than its camera sees, whatever the ground; and from where the eye is."""
    from dataclasses import replace

    from vegtool.gl.landscape import GroundMesh

    assert _backdrop(replace(world, ground=None), Light()) is None
    x, z = np.meshgrid(np.linspace(-5000, 5000, 51), np.linspace(-5000, 5000, 51))
    flat = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    first = (np.arange(50)[:, None] * 51 + np.arange(50)).ravel()
    faces = np.stack([first, first + 51, first + 1], axis=1).astype(np.int32)
    up = np.tile([0.0, 1.0, 0.0], (len(flat), 1))
    found = _backdrop(replace(world, ground=GroundMesh(np.zeros(3), flat, up, faces)), Light())
    assert found is not None
    assert 4 <= len(found.faces) < 20, "of 2,500 faces of 200 m"
    seen = found.positions[found.faces]
    assert (np.abs(seen - world.start.position)[..., [0, 2]] <= BEHIND_M + 1e-9).all()
    assert np.allclose(found.eye @ [0, 0, -1, 0], [*world.start.forward, 0])
    assert np.allclose(found.eye[:3, 3], world.start.position)


def test_a_way_of_one_frame_or_with_frames_at_one_time_is_kept(tmp_path: Path) -> None:
    """Two frames at one time are one: a way's times ascend."""
    said: list[str] = []
    keeper = Keeper(tmp_path, lambda text, at=0: said.append(text))
    eyes = [Eye(np.array([0.0, 1.7, -z])) for z in range(4)]
    keeper.way([])
    assert not said, "nothing was walked"
    keeper.way([(eyes[0], 5.0)])
    keeper.way([(eyes[0], 5.0), (eyes[1], 5.0), (eyes[2], 6.0), (eyes[3], 7.0)])
    assert [Path(name).name for name in keeper.ways] == ["way_0001.toml", "way_0002.toml"]
    assert len(read_path(tmp_path / "way_0001.toml").stations) == 1
    stations = read_path(tmp_path / "way_0002.toml").stations
    assert [(s.position[2], s.time_s) for s in stations] == [(0.0, 0.0), (-2.0, 1.0), (-3.0, 2.0)]
    assert len(said) == 2 and "2.0 s" in said[1]


def test_the_first_number_that_is_free_is_taken(tmp_path: Path) -> None:
    for number in (1, 2, 4):
        (tmp_path / f"way_{number:04d}.toml").touch()
    keeper = Keeper(tmp_path, lambda text, at=0: None)
    for _ in range(2):
        keeper.way([(Eye(np.zeros(3)), 0.0)])
    assert [Path(name).name for name in keeper.ways] == ["way_0003.toml", "way_0005.toml"]
