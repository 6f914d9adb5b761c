"""Light in bakes: what is known of it beside the colours, or in them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from baking_cases import billboards, leafy, plain, quads, texture

from vegtool.arrays import FloatArray
from vegtool.baking.bake import (
    WHITE,
    BakeOptions,
    bake,
    has_light,
    transmission_tint,
)
from vegtool.gl.pictures import BakedLight
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.plant import Material, Plant
from vegtool.srgb import linear_from_srgb

pytestmark = pytest.mark.gl
ZERO = np.zeros(2, dtype=np.int32)
BOARD = billboards([[0, 0, 0]], 1.0)
SIDES = np.tile([0.25, 0.75], (4, 1))
"""Exposure of the front and the back of a square."""
BEFORE = np.array([0.0, 0, 1])
OF_ONE_SUN = Light(BEFORE, sun=0.5, sky_above=0.3, sky_below=0.1)
"""Upon the front of a square; its sky is 0.2 on either side."""


def leaf(**values: object) -> Material:
    return plain((188, 188, 188, 255), role="leaf", **values)  # half of the light


def light_of(level: Level, index: int = 0, which: str = "front") -> np.ndarray:
    """A picture's, (h, w, 4)."""
    atlas = level.atlas
    assert atlas is not None and atlas.light is not None
    x, y, w, h = getattr(atlas, which)[index]
    return atlas.light[y : y + h, x : x + w].astype(int)


@contextmanager
def sunlit(plant: Plant, light: Light = OF_ONE_SUN) -> Iterator[tuple[PlantBuffers, BakedLight]]:
    with PlantBuffers(plant) as buffers, SunMaps([buffers], light.direction) as maps:
        yield buffers, BakedLight(light, maps)


def color_of(level: Level, which: str = "front") -> FloatArray:
    """(3,) mean linear colour of what the first picture covers."""
    atlas = level.atlas
    assert atlas is not None
    x, y, w, h = getattr(atlas, which)[0]
    texels = atlas.color[y : y + h, x : x + w]
    covered = texels[texels[..., 3] > 0][:, :3]
    return np.asarray(linear_from_srgb(covered / 255).mean(axis=0))


def test_there_is_none_where_nothing_is_known_of_it() -> None:
    level = bake(quads([[0, 0, 0]], materials=(leaf(),)), ZERO, BOARD, 4.0)
    assert level.atlas is not None
    assert level.atlas.light is None and level.atlas.images == 2
    np.testing.assert_array_equal(level.atlas.transmission_tint, np.ones(3))
    assert not level.unlit


@pytest.mark.parametrize("share", [0.0, 0.4])
@pytest.mark.parametrize("exposed", [False, True])
def test_exposure_and_what_passes_through_are_baked_where_there_is_either(
    share: float, exposed: bool
) -> None:
    plant = quads([[0, 0, 0]], materials=(leaf(transmission=share),))
    plant = replace(plant, exposure=SIDES if exposed else None)
    assert has_light(plant) == (exposed or share > 0)
    level = bake(plant, ZERO, BOARD, 4.0)
    assert level.atlas is not None
    if not has_light(plant):
        assert level.atlas.light is None
        return
    red, green = (0.25, 0.75) if exposed else (1.0, 1.0)
    expected = np.rint(np.array([red, green, 0, share]) * 255)
    assert np.abs(light_of(level) - expected).max() <= 1
    assert level.atlas.images == 3 and level.texels == 3 * level.atlas.texels


def test_the_side_that_the_picture_shows_comes_first() -> None:
    """Whichever way the billboard faces; behind, the sides change places."""
    plant = quads([[0, 0, 0]], normal=(0.6, 0, 0.8), materials=(leaf(),))
    plant = replace(plant, exposure=SIDES)
    there = billboards([[0, 0, 0]], 1.0, u=(-1.0, 0, 0))
    for board, (front, back) in ((BOARD, (64, 191)), (there, (191, 64))):
        level = bake(plant, ZERO, board, 4.0, BakeOptions(sides="opposite"))
        assert level.atlas is not None
        assert (level.atlas.front != level.atlas.back).any(), "its normal leans"
        assert np.abs(light_of(level)[..., :2] - [front, back]).max() <= 1
        assert np.abs(light_of(level, 0, "back")[..., :2] - [back, front]).max() <= 1


def test_texels_have_the_mean_of_what_they_cover() -> None:
    """From 0 on the left to 1 on the right, eight texels across."""
    exposure = np.array([[0.0, 1], [1, 1], [1, 1], [0, 1]])
    plant = replace(quads([[0, 0, 0]], materials=(leaf(),)), exposure=exposure)
    found = light_of(bake(plant, ZERO, BOARD, 4.0))
    expected = 255 * (np.arange(8) + 0.5) / 8
    assert np.abs(found[..., 0] - expected).max() <= 1
    assert (found[..., 1] == 255).all() and (found[..., 2] == 0).all()


def test_what_was_baked_before_is_baked_again() -> None:
    """A plant may be a level of another: its texture of light counts too."""
    before = texture([[(51, 102, 0, 204)]])  # 0.2, 0.4, 0.8
    plant = quads([[0, 0, 0]], materials=(leaf(transmission=0.5, light_texture=before),))
    found = light_of(bake(replace(plant, exposure=SIDES), ZERO, BOARD, 4.0))
    assert np.abs(found - 255 * np.array([0.2 * 0.25, 0.4 * 0.75, 0, 0.4])).max() <= 1


def test_light_is_carried_on_where_nothing_is_covered() -> None:
    """As colour is: the nearest texel's, over the picture and its gutter."""
    square = quads([[0, 0, 0]], half=0.5, materials=(leaf(transmission=0.4),))
    level = bake(replace(square, exposure=SIDES), ZERO, BOARD, 8.0)
    assert level.atlas is not None and level.atlas.light is not None
    x, y, w, h = level.atlas.front[0]
    around = np.s_[y - 2 : y + h + 2, x - 2 : x + w + 2]
    assert (level.atlas.color[around][..., 3] == 0).mean() > 0.5
    assert np.abs(level.atlas.light[around].astype(int) - [64, 191, 0, 102]).max() <= 1


@pytest.mark.parametrize("transmission", [0.0, 0.4])
def test_the_white_block_has_all_of_the_sky_and_lets_nothing_through(transmission: float) -> None:
    plant = quads([[0, 0, 0]], materials=(leaf(transmission=transmission),))
    atlas = bake(replace(plant, exposure=SIDES), ZERO, BOARD, 8.0, white=True).atlas
    assert atlas is not None and atlas.light is not None and atlas.white is not None
    x, y, w, h = atlas.white
    assert w == h == WHITE
    assert (atlas.light[y - 2 : y + h + 2, x - 2 : x + w + 2] == [255, 255, 0, 0]).all()
    px, py, pw, ph = atlas.front[0]
    inside = atlas.light[py : py + ph, px : px + pw].astype(int)
    assert np.abs(inside - [64, 191, 0, round(255 * transmission)]).max() <= 1


def test_the_white_block_has_the_exposure_of_what_no_billboard_shows() -> None:
    """The wood, which is a mesh beside the billboards and shows the block all over."""
    plant = quads([[0, 0, 0], [0, 0, 5]], materials=(leaf(), leaf()))
    exposure = np.repeat([[1.0, 1.0], [0.2, 0.6]], 4, axis=0)
    labels = np.array([0, 0, -1, -1], dtype=np.int32)
    atlas = bake(replace(plant, exposure=exposure), labels, BOARD, 8.0, white=True).atlas
    assert atlas is not None and atlas.light is not None and atlas.white is not None
    x, y, _, _ = atlas.white
    assert atlas.light[y, x].tolist() == [51, 153, 0, 0]


def test_the_tint_is_that_of_most_of_the_light_that_passes() -> None:
    """Twice the area with half the share counts as much; what lets nothing through counts not."""
    tints = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    shares = (0.4, 0.2, 0.0)
    materials = tuple(
        leaf(transmission=s, transmission_tint=t) for s, t in zip(shares, tints, strict=True)
    )
    plant = quads(
        [[0, 0, 0], [5, 0, 0], [9, 0, 0]],
        half=[1.0, 2**0.5, 1.0],
        materials=materials,
        face_material=[0, 1, 2],
    )
    np.testing.assert_allclose(transmission_tint(plant), [0.5, 0.5, 0])
    labels = np.zeros(6, dtype=np.int32)
    level = bake(plant, labels, billboards([[4, 0, 0]], (6.0, 1.5)), 4.0)
    assert level.atlas is not None
    np.testing.assert_allclose(level.atlas.transmission_tint, [0.5, 0.5, 0])


def test_the_tint_is_that_of_what_is_seen_to_pass_and_a_file_can_hold_it() -> None:
    """Leaves of a quarter of the luminance count a quarter; a tint beyond 1 is no factor of a
    texture; black leaves show none."""
    green = [0, 1.0, 0, 1]
    dim = [0, 0.25, 0, 1]
    pair = (
        leaf(base_color=green, transmission=0.4, transmission_tint=[1.0, 0.5, 0]),
        leaf(base_color=dim, transmission=0.4, transmission_tint=[0, 1.0, 4.0]),
    )
    plant = quads([[0, 0, 0], [5, 0, 0]], materials=pair, face_material=[0, 1])
    np.testing.assert_allclose(transmission_tint(plant), [0.8, 0.6, 0.8])
    bright = tuple(replace(m, transmission_tint=[3.0, 1.0, 0.5]) for m in pair)
    np.testing.assert_allclose(transmission_tint(replace(plant, materials=bright)), [1, 1, 0.5])
    black = tuple(replace(m, base_color=[0, 0, 0, 1]) for m in bright)
    np.testing.assert_array_equal(transmission_tint(replace(plant, materials=black)), np.ones(3))


def test_light_changes_nothing_else_of_a_bake() -> None:
    plant = leafy(np.random.default_rng(4), 50)
    labels = (np.arange(50) % 5).astype(np.int32)
    board = billboards(np.zeros((5, 3)), 1.5, 1.5)
    random = np.random.default_rng(5)
    exposed = replace(plant, exposure=random.random((len(plant.positions), 2)))
    a, b = (bake(p, labels, board, 10.0).atlas for p in (plant, exposed))
    assert a is not None and b is not None
    assert b.light is not None and np.ptp(b.light[..., 0].astype(int)) > 200
    assert a.normal is not None and b.normal is not None
    np.testing.assert_array_equal(a.color, b.color)
    np.testing.assert_array_equal(a.normal, b.normal)
    np.testing.assert_array_equal(a.depth, b.depth)


def test_a_lit_bake_has_its_light_in_the_colours_and_no_normals() -> None:
    plant = quads([[0, 0, 0]], materials=(leaf(double_sided=True, transmission=0.5),))
    with sunlit(replace(plant, exposure=SIDES)) as (buffers, baked):
        level = bake(buffers, ZERO, BOARD, 4.0, white=True, lit=baked)
    atlas = level.atlas
    assert atlas is not None
    assert level.unlit and atlas.normal is None and atlas.light is None
    assert atlas.images == 1 and level.texels == atlas.texels
    assert atlas.white is not None
    x, y, w, h = atlas.white
    assert (atlas.color[y - 2 : y + h + 2, x - 2 : x + w + 2] == 255).all()


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_one_picture_for_both_sides_has_the_mean_of_their_light(share: float) -> None:
    """Of 0.5 + 0.2 before and 0.2 behind, times a colour of one half; what passes through from
    one side is what the other has more."""
    plant = quads([[0, 0, 0]], materials=(leaf(transmission=share),))
    with sunlit(plant) as (buffers, baked):
        level = bake(buffers, ZERO, BOARD, 4.0, BakeOptions(sides="double"), lit=baked)
    assert level.double_sided
    np.testing.assert_allclose(color_of(level), 0.5 * 0.45, atol=0.003)


def test_opposite_sides_have_their_own_light() -> None:
    """Before 0.7, behind 0.2."""
    plant = quads([[0, 0, 0]], materials=(leaf(),))
    with sunlit(plant) as (buffers, baked):
        level = bake(buffers, ZERO, BOARD, 4.0, BakeOptions(sides="opposite"), lit=baked)
    assert not level.double_sided and level.atlas is not None
    np.testing.assert_allclose(color_of(level), 0.5 * 0.7, atol=0.003)
    np.testing.assert_allclose(color_of(level, "back"), 0.5 * 0.2, atol=0.003)


def test_opposite_sides_of_other_colours_have_their_own_light() -> None:
    """A square before and one behind, which the first hides from the sun."""
    plant = quads(
        [[0, 0, 0.2], [0, 0, -0.2]],
        materials=(leaf(), plain((255, 0, 0, 255))),
        face_material=[0, 1],
    )
    labels = np.zeros(4, dtype=np.int32)
    with sunlit(plant) as (buffers, baked):
        level = bake(buffers, labels, BOARD, 4.0, BakeOptions(sides="opposite"), lit=baked)
    np.testing.assert_allclose(color_of(level), 0.5 * 0.7, atol=0.003)
    np.testing.assert_allclose(color_of(level, "back"), [0.2, 0, 0], atol=0.003)


def test_shadows_are_in_the_colours() -> None:
    """A smaller square before a larger one: a quarter of it lies in the shadow, and is hidden from
    the front; seen from behind, light that passes through misses it."""
    plant = quads(
        [[0, 0, 0], [0, 0, 0.5]],
        half=[1.0, 0.5],
        materials=(leaf(transmission=1.0),),
        face_material=[0, 0],
    )
    plant = replace(plant, face_material=np.zeros(4, np.int32))
    behind = billboards([[0, 0, 0]], 1.0, u=(-1.0, 0, 0))
    labels = np.array([0, 0, -1, -1], dtype=np.int32)
    with sunlit(plant) as (buffers, baked):
        level = bake(
            buffers, labels, behind, 16.0, BakeOptions(sides="opposite"),
            lit=replace(baked, both_sides=False),
        )  # fmt: skip
    assert level.atlas is not None
    x, y, w, h = level.atlas.front[0]
    found = linear_from_srgb(level.atlas.color[y : y + h, x : x + w, :3] / 255)[..., 0]
    np.testing.assert_allclose(found[10:-10, 10:-10], 0.5 * 0.2, atol=0.003)
    np.testing.assert_allclose(found[:6], 0.5 * 0.7, atol=0.003)


def test_light_that_is_more_than_white_is_white() -> None:
    plant = quads([[0, 0, 0]], materials=(plain((255, 255, 255, 255)),))
    with sunlit(plant, replace(OF_ONE_SUN, sun=3.0)) as (buffers, baked):
        level = bake(buffers, ZERO, BOARD, 4.0, BakeOptions(sides="opposite"), lit=baked)
    np.testing.assert_allclose(color_of(level), 1.0)
