"""Depth maps from the sun, on squares whose shadow is known, and against the same in arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.context import describe
from vegtool.gl.draw import Shot, draw
from vegtool.gl.sun import SunMaps
from vegtool.gl.surface import Seen, surface
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light, Sun
from vegtool.lighting.shadow import sun_visible
from vegtool.measure.pictures import shot_of
from vegtool.measure.views import Camera, direction
from vegtool.plant import Material, Plant, Texture

pytestmark = pytest.mark.gl
UP = np.array([0.0, 1, 0])
WHITE = Material("white", double_sided=True)
SUN_ALONE = Light(UP, sun=1.0, sky_above=0.0, sky_below=0.0)


def level_square(
    height: float, half: float, material: Material = WHITE, down: bool = False
) -> Plant:
    """Level, facing up or down, its texture seen upright from above with the eye's up at -z."""
    x = half * np.array([-1.0, 1, 1, -1])
    z = half * np.array([1.0, 1, -1, -1])
    uvs = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Plant(
        "square",
        np.stack([x, np.full(4, height), z], axis=1),
        np.tile(-UP if down else UP, (4, 1)),
        uvs,
        faces[:, ::-1] if down else faces,
        np.zeros(2, np.int32),
        (material,),
    )


def both(*plants: Plant) -> Plant:
    """All as one, with a material each."""
    first = np.cumsum([0, *(len(p.positions) for p in plants)])
    return replace(
        plants[0],
        positions=np.concatenate([p.positions for p in plants]),
        normals=np.concatenate([p.normals for p in plants]),
        uvs=np.concatenate([p.uvs for p in plants]),
        faces=np.concatenate([p.faces + n for p, n in zip(plants, first[:-1], strict=True)]),
        face_material=np.repeat(np.arange(len(plants)), [len(p.faces) for p in plants]),
        materials=tuple(p.materials[0] for p in plants),
    )


def from_below(azimuth: float = 30.0, elevation: float = -35.0, scale: float = 1.0) -> Shot:
    """Six metres at 96 pixels: the ground is looked at from where nothing stands before it."""
    view = direction(azimuth, elevation)
    camera = Camera(np.zeros(3), view, 20 * scale, 320.0, 96, 96, (48.0, 48.0), 8 * scale)
    return shot_of(camera)


def from_above() -> Shot:
    """The same from straight above, up being -z: a metre is 16 pixels."""
    return from_below(0.0, 90.0)


def in_arrays(seen: Seen, light: Light, maps: SunMaps) -> Picture:
    """The sun alone on white surfaces, by numpy."""
    visible = sun_visible(seen.position, seen.side.astype(np.float64), maps.read())
    toward = np.maximum(seen.normal.astype(np.float64) @ maps.direction, 0)
    lit = light.sun * visible * toward
    return seen.picture(np.repeat(lit[:, None], 3, axis=1))


def depths(casters: Sequence[Plant], sun: FloatArray, **how: int) -> FloatArray:
    buffers = [PlantBuffers(caster) for caster in casters]
    with SunMaps(buffers, sun, **how) as maps:
        found = maps.read().depth.astype(np.float64)
    for each in buffers:
        each.release()
    return found


@pytest.mark.parametrize("sun", [Sun(0, 90), Sun(20, 50), Sun(200, 25)])
@pytest.mark.parametrize("suns", [1, 8])
def test_the_gpu_and_numpy_see_the_same_shadow(sun: Sun, suns: int) -> None:
    """On every pixel, of ground and square, seen from above and from below."""
    plant = both(level_square(0.0, 2.0), level_square(0.6, 0.5))
    with PlantBuffers(plant) as buffers, SunMaps([buffers], sun.direction, suns) as maps:
        for shot in (from_below(30, 40), from_below(140, 70), from_below(30, -35)):
            drawn = draw(buffers, shot, SUN_ALONE, shadows=maps)
            expected = in_arrays(surface(buffers, shot), SUN_ALONE, maps)
            assert drawn[..., 3].sum() > 500
            assert np.abs(drawn - expected).max() < 1 / 255
            if shot.view_projection[3, 1] < 0:  # from above
                lit = drawn[..., 0][drawn[..., 3] > 0]
                assert lit.min() == pytest.approx(0, abs=1e-3)
                assert lit.max() == pytest.approx(sun.direction[1], abs=1e-3)


def test_shadows_lie_where_the_sun_throws_them_and_are_as_large_as_what_throws_them() -> None:
    """A metre up, the sun at 45 degrees from +x: a metre towards -x."""
    plant = both(level_square(0.0, 2.5), level_square(1.0, 0.5))
    with PlantBuffers(plant) as buffers, SunMaps([buffers], Sun(90, 45).direction) as maps:
        ground = replace(plant, faces=plant.faces[:2], face_material=plant.face_material[:2])
        with PlantBuffers(ground) as alone:  # as from above the square would hide it
            drawn = draw(alone, from_above(), SUN_ALONE, shadows=maps)
    dark = np.argwhere((drawn[..., 3] > 0) & (drawn[..., 0] < 0.1))
    assert dark.min(axis=0) == pytest.approx([40, 24], abs=1)
    assert dark.max(axis=0) == pytest.approx([55, 39], abs=1)
    assert len(dark) == pytest.approx(16 * 16, rel=0.1)


def test_depth_is_what_arithmetic_says() -> None:
    """The sun overhead, the ball's radius known: the map's texel is as far along the sun's ray as
    the square is below the ball's top; and nothing is at 1."""
    plant = both(level_square(0.0, 2.0), level_square(1.5, 0.5))
    with PlantBuffers(plant) as buffers, SunMaps([buffers], UP, suns=1, side=256) as maps:
        found = maps.read()
    half = maps.texel_m * 256 / 2
    x = (np.arange(256) + 0.5) * maps.texel_m - half
    inner = np.maximum(*np.abs(np.meshgrid(x, x)))
    expected = np.where(inner < 2.0, 0.5 + 0.75 / (2 * half), 1.0)
    expected[inner < 0.5] = 0.5 - 0.75 / (2 * half)
    clear = (np.abs(inner - 0.5) > maps.texel_m) & (np.abs(inner - 2.0) > maps.texel_m)
    np.testing.assert_allclose(found.depth[0][clear], expected[clear], atol=1e-6)
    np.testing.assert_allclose(found.center, [0, 0.75, 0])
    assert half > maps.radius == pytest.approx(np.hypot(2 * 2**0.5, 0.75))


@pytest.mark.parametrize("suns", [1, 2, 4, 5, 8])
def test_maps_lie_side_by_side_each_with_a_free_edge(suns: int) -> None:
    """So that what lies outside is lit: even a ball's corner stays a texel within."""
    plant = level_square(0.0, 1.0)
    found = depths([plant], np.array([1.0, 0, 1]) + 2 * UP, suns=suns, side=64)
    assert found.shape == (suns, 64, 64)
    for edge in (found[:, 0], found[:, -1], found[:, :, 0], found[:, :, -1]):
        assert (edge == 1).all()
    assert (found < 1).any(axis=(1, 2)).all()
    shares = (found < 1).mean(axis=(1, 2))
    assert np.ptp(shares) < 0.02, "all points of the sun see the square about the same"


@pytest.mark.parametrize("down", [False, True])
def test_what_is_seen_from_one_side_throws_shadows_from_both(down: bool) -> None:
    single = level_square(0.0, 1.0, Material("m"), down)
    assert (depths([single], UP, suns=1, side=32) < 1).mean() > 0.3


def test_leaves_throw_the_shadow_of_what_is_not_cut_away() -> None:
    """The texture's left half alone; opaque materials ignore alpha."""
    pixels = np.zeros((8, 8, 4), np.uint8)
    pixels[:, :4] = 255
    leaf = Material("leaf", color_texture=Texture("half", pixels), alpha_mode="mask")
    shares = [
        (depths([level_square(0.0, 1.0, material)], UP, suns=1, side=128) < 1).mean()
        for material in (leaf, replace(leaf, alpha_mode="opaque"))
    ]
    assert shares[0] == pytest.approx(shares[1] / 2, rel=0.05)


def test_of_several_casters_the_nearest_to_the_sun_counts() -> None:
    """Wherever each was uploaded from: as if they were one plant."""
    low, high = level_square(0.0, 2.0), level_square(1.5, 0.5)
    together = depths([both(low, high)], Sun(30, 60).direction, suns=3, side=128)
    np.testing.assert_allclose(
        depths([low, high], Sun(30, 60).direction, suns=3, side=128), together, atol=1e-6
    )
    np.testing.assert_allclose(
        depths([high, low], Sun(30, 60).direction, suns=3, side=128), together, atol=1e-6
    )


def test_shadows_fall_on_another_plant() -> None:
    """Ground of another place and size than what throws them: positions are not those of the
    caster's buffers."""
    ground, square = level_square(0.0, 3.0), level_square(1.0, 0.5)
    with (
        PlantBuffers(ground) as receiver,
        PlantBuffers(square) as caster,
        SunMaps([caster], UP) as maps,
    ):
        drawn = draw(receiver, from_above(), SUN_ALONE, shadows=maps)
        expected = in_arrays(surface(receiver, from_above()), SUN_ALONE, maps)
    assert np.abs(drawn - expected).max() < 1 / 255
    dark = (drawn[..., 3] > 0) & (drawn[..., 0] < 0.5)
    assert dark.sum() == pytest.approx(16 * 16, rel=0.1)
    assert dark[41:55, 41:55].all()


@pytest.mark.parametrize(("scale", "move"), [(1e-3, 0.0), (1e4, 0.0), (1.0, 5e6)])
def test_it_does_not_matter_where_a_plant_stands_and_how_large_it_is(
    scale: float, move: float
) -> None:
    plant = both(level_square(0.0, 2.0), level_square(1.5, 0.5))
    there = replace(plant, positions=plant.positions * scale + move)
    one, two = (depths([p], Sun(30, 60).direction, suns=2, side=128) for p in (plant, there))
    assert np.mean(np.abs(one - two) > 1e-5) < 1e-3, "a texel on an edge may fall to either side"


def test_what_is_unlit_shows_no_shadow() -> None:
    unlit = replace(WHITE, unlit=True, base_color=[0.25, 0.5, 0.75, 1])
    with PlantBuffers(level_square(0.0, 1.0, unlit)) as buffers:
        with PlantBuffers(level_square(1.0, 5.0)) as above, SunMaps([above], UP) as maps:
            shaded = draw(buffers, from_above(), SUN_ALONE, shadows=maps)
        np.testing.assert_array_equal(draw(buffers, from_above(), SUN_ALONE), shaded)
    np.testing.assert_allclose(shaded[48, 48], [0.25, 0.5, 0.75, 1], atol=1e-3)


def test_light_comes_from_where_the_shadows_do() -> None:
    """Whatever else was said of its direction."""
    with PlantBuffers(level_square(0.0, 1.0)) as buffers, SunMaps([buffers], 3 * UP) as maps:
        other = replace(SUN_ALONE, direction=np.array([1.0, 0.1, 0.0]))
        drawn = draw(buffers, from_above(), other, shadows=maps)
    assert drawn[48, 48, 0] == pytest.approx(1, abs=1e-3)


def test_a_driver_with_narrow_textures_has_smaller_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = replace(describe(), max_texture=200)
    monkeypatch.setattr("vegtool.gl.sun.describe", lambda _: limits)
    with PlantBuffers(level_square(0.0, 1.0)) as buffers, SunMaps([buffers], UP) as maps:
        assert maps.texture.size == (200, 100)
        assert maps.read().depth.shape == (8, 50, 50)
        assert maps.texel_m == pytest.approx(2 * 2**0.5 / 48)


def test_nothing_of_the_state_of_drawing_is_left_behind() -> None:
    with PlantBuffers(both(level_square(0.0, 2.0), level_square(1.5, 0.5))) as buffers:
        before = draw(buffers, from_above(), Light())
        SunMaps([buffers], UP).release()
        np.testing.assert_array_equal(draw(buffers, from_above(), Light()), before)
        assert buffers.ctx.error == "GL_NO_ERROR"


def test_a_plant_that_is_a_point_has_maps_too() -> None:
    plant = level_square(0.0, 0.0)
    with PlantBuffers(plant) as buffers, SunMaps([buffers], UP, side=16) as maps:
        assert (maps.read().depth == 1).all()
        assert np.isfinite(maps.projection).all()
