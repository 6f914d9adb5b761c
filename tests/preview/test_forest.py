"""A landscape from many eyes: what is asked for, kept and drawn of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cards import arrays_of
from golden_pictures import assert_golden
from instanced import AMBIENT, by_itself
from walk_cases import (
    OPAQUE,
    Garden,
    bush,
    crown,
    garden,
    herb,
    plants,
    species_of,
    tree,
    wood,
)

from vegtool.arrays import ByteArray
from vegtool.gl.context import context, framebuffer_kept
from vegtool.gl.draw import MSAA
from vegtool.gl.instances import WHOLE
from vegtool.gl.landscape import GroundMesh
from vegtool.gl.screen import Screen
from vegtool.preview import forest as module
from vegtool.preview.eye import Eye
from vegtool.preview.forest import Forest
from vegtool.preview.options import FadeMode
from vegtool.preview.palette import PALETTE, Color
from vegtool.preview.scenery import IN_FULL, FrameStats, Look
from vegtool.srgb import srgb_from_linear
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Placement

pytestmark = pytest.mark.gl

SIZE = (96, 72)
SKY = (0.4, 0.6, 0.9)
EYE = Eye(np.array([1.0, 1.7, 14.0]), 5.0, -3.0)
AS_IT_IS = Look()


def ground() -> GroundMesh:
    corners = 40 * np.array([[-1.0, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]])
    up = np.tile([0.0, 1, 0], (4, 1))
    return GroundMesh(np.zeros(3), corners, up, np.array([[0, 1, 2], [0, 2, 3]]))


def made(
    species: Sequence[Species],
    placement: Placement,
    fade: FadeMode = "alpha-test",
    **more: GroundMesh,
) -> Forest:
    """Loaded, without the comparison with plants in full, which takes its time."""
    forest = Forest(species, placement, more.get("ground"), fade, sharp=True)
    for _ in forest.load(context()):
        pass
    return forest


def shown(
    forest: Forest, eye: Eye, look: Look = AS_IT_IS, size: tuple[int, int] = SIZE
) -> tuple[FrameStats, ByteArray]:
    """A frame as a window has it."""
    ctx = context()
    with framebuffer_kept(ctx), Screen(ctx) as screen:
        screen.begin(size, (0.0, 0.0, 0.0) if look.color == "by overdraw" else SKY)
        stats = forest.draw(eye, size, look)
        screen.resolve()
        return stats, screen.read()


def encoded_sky() -> np.ndarray:
    return np.asarray(255 * srgb_from_linear(np.array(SKY)))


@pytest.fixture(scope="module")
def walked() -> Iterator[Forest]:
    """A wood as it is walked through, compared with the plants in full."""
    with Forest(garden(), wood(), ground()) as forest:
        told = list(forest.load(context()))
        assert told == sorted(told) and told[0] > 0 and told[-1] == 1
        yield forest


def test_a_landscape_is_what_it_was(walked: Forest) -> None:
    assert_golden("walk", shown(walked, EYE, size=(240, 180))[1])
    assert_golden("walk_by_level", shown(walked, EYE, Look(color="by level"), (240, 180))[1])


def test_the_same_eye_sees_the_same_to_the_bit(walked: Forest) -> None:
    first = shown(walked, EYE)
    shown(walked, replace(EYE, yaw_deg=100.0), Look(detail=0.5))
    shown(walked, EYE, size=(40, 90))
    again = shown(walked, EYE)
    assert first[1].tobytes() == again[1].tobytes()
    assert replace(first[0], seconds={}) == replace(again[0], seconds={})


def test_what_is_drawn_is_the_picture(walked: Forest) -> None:
    """The one into a window, the other as light and coverage; over the ground, which has no sky."""
    down = replace(EYE, pitch_deg=-50.0)
    _, frame = shown(walked, down)
    light = walked.picture(down, SIZE)
    assert (light[..., 3] == 1).mean() > 0.9
    covered = light[..., 3] == 1
    encoded = 255 * srgb_from_linear(np.clip(light[..., :3], 0, 1))
    assert np.abs(frame[covered] - encoded[covered]).max() <= 1


def test_figures_are_what_was_drawn(walked: Forest) -> None:
    stats, frame = shown(walked, EYE)
    found, what, tiles = walked.choose(EYE, SIZE, Look())
    assert (stats.plants, stats.rows, stats.tiles) == (len(found.rows), len(what.of), len(tiles))
    assert stats.total == 16 * 12 and 0 < stats.plants < stats.total
    assert stats.detail == 1 and stats.triangles > stats.rows
    assert set(stats.seconds) == {"choose", "draw"} and min(stats.seconds.values()) > 0
    # what is not sky was drawn once at least
    covered = (np.abs(frame - encoded_sky()).max(axis=-1) > 2).sum()
    assert stats.fragments >= 0.9 * covered
    none, _ = shown(walked, Eye(np.array([0.0, 200.0, 0.0]), pitch_deg=80.0))
    assert (none.plants, none.rows, none.tiles, none.fragments) == (0, 0, 0, 0)


def test_less_detail_is_fewer_triangles(walked: Forest) -> None:
    triangles = [shown(walked, EYE, Look(detail=d))[0].triangles for d in (0.5, 1.0, 4.0)]
    assert triangles == sorted(triangles) and triangles[0] < triangles[-1]


def test_a_level_is_held_of_all(walked: Forest) -> None:
    for level in (0, 1, 9):
        _, what, _ = walked.choose(EYE, SIZE, Look(level=level))
        counts = np.array([4, 2, 1])
        found, _, _ = walked.choose(EYE, SIZE, Look())
        kind = found.rows["species"]
        assert what.level.tolist() == np.minimum(level, counts[kind] - 1).tolist()


# -- colours ---------------------------------------------------------------------------------------


def painted(frame: np.ndarray, number: int) -> bool:
    """Whether any pixel is of a colour of the palette under white light."""
    wanted = np.minimum(255 * srgb_from_linear(PALETTE[number, :3] / 127.5), 255)
    return bool((np.abs(frame - wanted).max(axis=-1) <= 1.5).any())


def test_colours_tell_levels_kinds_and_how_often_a_pixel_is_drawn() -> None:
    """One plant near and left, one far and right, before nothing: colours of the palette under
    white light. Each is of the other's number by level, so that the two cannot be mistaken."""
    place = Garden([plants([[-0.9, 0, 0], [1.5, 0, -15]], [1, 0])])
    eye = Eye(np.array([0.0, 1.0, 5.0]), fov_y_deg=15.0)
    with made((bush(), tree()), place) as forest:
        found, what, _ = forest.choose(eye, SIZE, Look())
        levels = dict(zip(found.rows["species"], what.level[: len(found.rows)], strict=True))
        assert (levels[1], levels[0]) == (0, 1)
        numbers: dict[Color, tuple[int, int]] = {"by level": (0, 1), "by species": (1, 0)}
        for color, (left, right) in numbers.items():
            _, frame = shown(forest, eye, Look(AMBIENT, color=color))
            halves = frame[:, :30], frame[:, -30:]
            for half, number, other in ((halves[0], left, right), (halves[1], right, left)):
                assert painted(half, number) and not painted(half, other), color
        _, frame = shown(forest, eye, Look(AMBIENT, color="by overdraw"))
        steps = {int(v) for v in np.unique(frame[..., 0])}
        assert 0 in steps and len(steps) > 3, "some places are drawn several times"
        assert (frame.max(axis=-1) == frame.min(axis=-1)).all()


def test_wireframe_shows_edges_alone() -> None:
    """Of a tree that is near, through whose leaves the sky is seen then."""
    with made((tree(),), Garden([plants([[0, 0, 0]])])) as forest:
        whole, filled = shown(forest, eye_at(1.5), Look(level=3))
        edges, lines = shown(forest, eye_at(1.5), Look(level=3, wireframe=True))
        assert edges.triangles == whole.triangles and 0 < edges.fragments < whole.fragments / 2
        np.testing.assert_array_equal(shown(forest, eye_at(1.5), Look(level=3))[1], filled)
    sky = [(np.abs(one - encoded_sky()).max(axis=-1) <= 1).sum() for one in (filled, lines)]
    assert sky[0] < sky[1] < lines[..., 0].size


# -- what is asked for and kept --------------------------------------------------------------------


def test_tiles_out_of_view_are_never_asked_for_their_plants() -> None:
    """Before the eye, which looks along -z from the middle, and not behind or beside it."""
    place = wood(8, 6, 16.0)
    eye = Eye(np.array([0.0, 1.7, 0.0]), fov_y_deg=40.0)
    with made(garden(), place) as forest:
        assert place.asked == [], "nothing before there is a frame"
        found, _, tiles = forest.choose(eye, SIZE, Look())
    assert sorted(place.asked) == sorted(tiles) and len(set(place.asked)) == len(place.asked)
    margin = 6.0
    low, high = place.tiles.low, place.tiles.high
    behind = low[:, 2] > margin
    beside = np.abs((low + high)[:, 0] / 2) > 8 + margin + np.abs(low[:, 2] - 16) * np.tan(
        np.radians(26)
    )
    assert not set(np.flatnonzero(behind | beside)) & set(place.asked)
    assert behind.sum() > 20 and len(place.asked) < 40
    # and all that is seen of all plants is in them
    everything = Garden([plants(np.concatenate([t.origin + t.offset for t in place.given]),
                                np.concatenate([t.species for t in place.given]))])  # fmt: skip
    with made(garden(), everything) as forest:
        seen, _, _ = forest.choose(eye, SIZE, Look(detail=1.0))
    assert {tuple(np.round(p, 3)) for p in found.place.tolist()} <= {
        tuple(np.round(p, 3)) for p in seen.place.tolist()
    }


def test_a_tile_is_asked_once_while_it_is_kept() -> None:
    place = wood()
    with made(garden(), place) as forest:
        for yaw in (0.0, 10.0, 20.0, 10.0, 0.0):
            shown(forest, replace(EYE, yaw_deg=yaw))
    assert len(place.asked) == len(set(place.asked))


def test_plants_that_are_kept_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer than a frame needs, so that tiles are given up and asked for again; what is seen is the
    same."""
    views = [replace(EYE, yaw_deg=float(yaw)) for yaw in range(0, 360, 45)]
    with made(garden(), wood()) as forest:
        wanted = [shown(forest, eye)[1] for eye in views]
    place = wood()
    monkeypatch.setattr(module, "MOST_PLANTS", 30)
    with made(garden(), place) as forest:
        for eye, picture in zip(views, wanted, strict=True):
            np.testing.assert_array_equal(shown(forest, eye)[1], picture)
            assert sum(len(stock.rows) for stock in forest._stocks.values()) <= 30
    assert len(place.asked) > 16, "more often than there are tiles"


def test_a_tile_of_too_many_is_kept_while_it_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_PLANTS", 5)
    place = wood(1, 40)
    with made(garden(), place) as forest:
        for _ in range(3):
            shown(forest, EYE)
    assert place.asked == [0]


def test_other_sizes_of_pictures_have_their_own_distances(walked: Forest) -> None:
    """Twice the pixels are as many levels at twice the distances; and back again."""
    small, _ = shown(walked, EYE)
    large, _ = shown(walked, EYE, size=(192, 144))
    assert large.triangles > small.triangles and large.plants >= small.plants
    again, _ = shown(walked, EYE)
    assert replace(small, seconds={}) == replace(again, seconds={})


# -- where it is -----------------------------------------------------------------------------------


def test_a_landscape_far_from_the_origin_is_drawn_as_one_near_it() -> None:
    """Scene and eye 5,000 km away: a metre's 2^-30th is what coordinates know there."""
    far = np.array([5e6, 300.0, -5e6])
    frames = []
    for away in (np.zeros(3), far):
        mesh = replace(ground(), origin=away)
        with made(garden(), wood(origin=away), ground=mesh) as forest:
            frames.append(shown(forest, replace(EYE, position=EYE.position + away))[1])
    off = np.abs(frames[0].astype(int) - frames[1])
    assert (off > 0).mean() < 0.002 and frames[0].std() > 10


UPWARDS = Eye(np.array([0.0, 0.5, 0.0]), pitch_deg=60.0, fov_y_deg=30.0)
"""What it sees of a plant a few metres ahead is its top."""


def test_a_tall_plant_is_seen_though_its_foot_is_not() -> None:
    """Eight times as tall as its model."""
    place = Garden([plants([[0, 0, -8]], height=16.0), plants([[60, 0, 90]], height=1.0)])
    with made((tree(),), place) as forest:
        found, _, tiles = forest.choose(UPWARDS, SIZE, Look())
        assert tiles.tolist() == [0] and len(found.rows) == 1


def test_plants_without_a_height_are_as_tall_as_their_model() -> None:
    """A tree of 2 m whose top is seen, and another one, elsewhere, that is said to be of 0.1 m."""
    for heights in ((np.nan, np.nan), (np.nan, 0.1)):
        tiles = [
            plants([[x, 0, -0.9]], height=height)
            for x, height in zip((0, 50), heights, strict=True)
        ]
        with made((tree(),), Garden(tiles)) as forest:
            found, _, _ = forest.choose(UPWARDS, SIZE, Look())
            assert len(found.rows) == 1, heights


# -- without fades ---------------------------------------------------------------------------------


def eye_at(distance: float) -> Eye:
    """So far before the middle of a tree at the origin."""
    low, high = tree().levels[0].bounds
    return Eye(np.array([0.0, (low[1] + high[1]) / 2, distance]), fov_y_deg=40.0)


def test_without_fades_a_plant_keeps_its_level_to_and_fro() -> None:
    """Also where it was not in view in between, and whatever the others do."""
    focal = eye_at(1.0).focal_px(SIZE[1])
    switch = 8.0 * focal / 300.0
    place = Garden([plants([[0, 0, 0]]), plants([[3, 0, -30]])])
    with made((tree(),), place, "none") as forest:

        def level(distance: float, **turned: float) -> int:
            eye = replace(eye_at(distance), **turned)
            found, what, _ = forest.choose(eye, SIZE, Look())
            assert len(what.of) == len(found.rows)
            near = np.argmin(found.distance) if len(found.rows) else -1
            return int(what.level[near]) if near >= 0 else -1

        ways = (0.8, 1.05, 1.1, 1.02, 1.2, 1.1, 1.02, 0.95, 1.05)
        assert [level(switch * way) for way in ways] == [0, 0, 0, 0, 1, 1, 1, 0, 0]
        assert level(switch * 1.05) == 0
        look_up = replace(eye_at(switch * 1.05), yaw_deg=40.0)
        forest.choose(look_up, SIZE, Look())
        assert level(switch * 1.05) == 0
        # a level that is held is not remembered
        forest.choose(eye_at(switch * 1.05), SIZE, Look(level=2))
        assert level(switch * 1.05) == 0


def test_without_fades_nothing_is_in_view() -> None:
    with made((tree(),), Garden([plants([[0, 0, 0]])]), "none") as forest:
        stats, _ = shown(forest, Eye(np.array([0.0, 1.0, 50.0]), yaw_deg=180.0))
    assert stats.plants == 0


def test_without_fades_more_plants_are_in_view_than_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "MOST_PLANTS", 30)
    with made(garden(), wood(), "none") as forest:
        assert shown(forest, EYE)[0].plants > 30


# -- in full ---------------------------------------------------------------------------------------


def test_in_full_every_plant_is_its_original_and_whole() -> None:
    place = Garden([plants([[0, 0, 0], [2, 0, -60], [-9, 0, -200]], [0, 1, 2])])
    with made(garden(), place) as forest:
        found, what, _ = forest.choose(EYE, SIZE, Look(detail=IN_FULL, level=0))
        assert len(found.rows) == 3 and (what.level == 0).all()
        np.testing.assert_allclose(what.kept, WHOLE)
        np.testing.assert_allclose(what.length, 1)


def test_sharp_forests_are_of_the_plants_own_texels() -> None:
    """Supersampled, in full, near: what gl.draw draws of the plant."""
    place = Garden([plants([[0, 0, 0]], yaw=0.6)])
    eye = eye_at(2.2)
    with made((tree(),), place) as forest:
        found = forest.picture(eye, SIZE, Look(level=0), supersample=4, samples=0)
    wanted = by_itself(tree().levels[0], eye, SIZE, 0.6, supersample=4)
    off = np.abs(found - wanted * (128 / 127.5, 128 / 127.5, 128 / 127.5, 1)).max(axis=-1)
    assert (off > 1 / 255).mean() < 0.005 and (wanted[..., 3] > 0).mean() > 0.05


# -- its life --------------------------------------------------------------------------------------


def test_nothing_is_drawn_before_it_is_loaded_nor_after() -> None:
    forest = Forest(garden(), wood())
    for use in (forest.draw, forest.picture):
        with pytest.raises(ValueError, match="load it first"):
            use(EYE, SIZE)
    assert forest.texture_bytes == 0
    with made((herb(),), Garden([plants([[0, 0, 0]])])) as loaded:
        shown(loaded, EYE)
    with pytest.raises(ValueError, match="load it first"):
        loaded.draw(EYE, SIZE)
    loaded.release()
    assert context().error == "GL_NO_ERROR"


def test_nothing_grows_there() -> None:
    with made(garden(), Garden([]), ground=ground()) as forest:
        stats, frame = shown(forest, EYE)
    assert (stats.total, stats.plants, stats.draws, stats.triangles) == (0, 0, 1, 2)
    assert len(np.unique(frame.reshape(-1, 3), axis=0)) > 1


def test_what_was_given_stays(walked: Forest) -> None:
    species, place = garden(), wood()
    kept = [arrays_of(level) for one in species for level in one.levels]
    feet = [t.offset.tobytes() + t.tint.tobytes() + t.height.tobytes() for t in place.given]
    with made(species, place, ground=ground()) as forest:
        for fade_look in (
            Look(),
            Look(detail=0.6),
            Look(color="by overdraw"),
            Look(level=1, wireframe=True),
        ):
            shown(forest, EYE, fade_look)
    assert kept == [arrays_of(level) for one in species for level in one.levels]
    assert feet == [t.offset.tobytes() + t.tint.tobytes() + t.height.tobytes() for t in place.given]


def test_fragments_are_of_pixels() -> None:
    """A wall of 2 m that fills the picture but for its stem: its samples, divided by MSAA."""
    wall = species_of("wall", crown(1, 6.0, OPAQUE))
    with made((wall,), Garden([plants([[0, 0, 0]])])) as forest:
        stats, frame = shown(forest, Eye(np.array([0.0, 1.0, 3.0])))
    covered = (np.abs(frame - encoded_sky()).max(axis=-1) > 2).sum()
    assert covered * 0.95 <= stats.fragments <= 2.1 * covered and MSAA == 4


def test_files_of_species_are_of_no_matter(tmp_path: Path) -> None:
    """They are read before; a forest opens none."""
    species = replace(herb(), files=(tmp_path / "gone.glb",))
    with made((species,), Garden([plants([[0, 0, 0]])])) as forest:
        assert shown(forest, Eye(np.array([0.0, 0.3, 2.0])))[0].plants == 1
