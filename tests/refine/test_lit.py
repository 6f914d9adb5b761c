"""Light in the colours of vertices, on squares for which it can be worked out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.arrays import FloatArray
from vegtool.baking.bake import bake
from vegtool.gl.pictures import BakedLight
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light, Sun
from vegtool.lighting.shadow import SunDepths, projections
from vegtool.lod import Billboards
from vegtool.plant import Material, Plant
from vegtool.refine.lit import MOST_PLACES, face_light, lit_plant
from vegtool.srgb import linear_from_srgb

UP = np.array([0.0, 1, 0])
OVERHEAD = Light(UP, sun=0.5, sky_above=0.4, sky_below=0.2)
ABOVE, BELOW = 0.5 + 0.4, 0.2
"""What falls on either side of a level square."""


def square(**material: object) -> Plant:
    """Level, facing up, of a grey."""
    return Plant(
        "square",
        np.array([[-1.0, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]),
        np.tile(UP, (4, 1)),
        np.zeros((4, 2)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.zeros(2, np.int32),
        (Material("m", **({"role": "leaf"} | material)),),  # type: ignore[arg-type]
        np.tile([0.5, 0.25, 0.1, 1.0], (4, 1)),
    )


def depths(hidden: bool = False) -> SunDepths:
    """A map in which nothing hides anything, or all does."""
    depth = np.full((1, 8, 8), float(not hidden), np.float32)
    return SunDepths(depth, projections(UP[None], 2.0), np.zeros(3), UP, 0.5)


def factors(plant: Plant, light: Light = OVERHEAD, hidden: bool = False) -> FloatArray:
    """(3,) of its light, which is the same all over."""
    found = face_light(plant, light, depths(hidden))
    np.testing.assert_allclose(found, np.tile(found[0], (len(found), 1)))
    return np.asarray(found[0])


def test_one_side_is_what_is_seen_and_of_two_the_mean() -> None:
    np.testing.assert_allclose(factors(square()), ABOVE)
    np.testing.assert_allclose(factors(square(double_sided=True)), (ABOVE + BELOW) / 2)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_what_passes_through_is_seen_on_the_other_side(share: float) -> None:
    """So that the mean of both sides stays, but for the tint."""
    one, both = square(transmission=share), square(transmission=share, double_sided=True)
    np.testing.assert_allclose(factors(one), (1 - share) * ABOVE + share * BELOW)
    np.testing.assert_allclose(factors(both), (ABOVE + BELOW) / 2)
    tint = np.array([1.0, 0.5, 0.0])
    tinted = square(transmission=share, double_sided=True, transmission_tint=tint)
    expected = ((1 - share) + share * tint) * (ABOVE + BELOW) / 2
    np.testing.assert_allclose(factors(tinted), expected)


def test_in_the_shadow_there_is_the_sky_alone() -> None:
    np.testing.assert_allclose(factors(square(), hidden=True), ABOVE - 0.5)
    both = square(double_sided=True, transmission=0.5)
    np.testing.assert_allclose(factors(both, hidden=True), (ABOVE - 0.5 + BELOW) / 2)


def test_each_side_has_its_own_exposure_and_the_sun_none() -> None:
    exposure = np.tile([0.25, 0.5], (4, 1))
    one, both = (replace(square(double_sided=two), exposure=exposure) for two in (False, True))
    above, below = 0.5 + 0.4 * 0.25, 0.2 * 0.5
    np.testing.assert_allclose(factors(one), above)
    np.testing.assert_allclose(factors(both), (above + below) / 2)
    through = replace(square(transmission=1.0), exposure=exposure)
    np.testing.assert_allclose(factors(through), below)


def test_colours_have_the_light_and_nothing_is_left_to_light() -> None:
    plant = replace(square(transmission=0.2), exposure=np.ones((4, 2)))
    found = lit_plant(plant, OVERHEAD, depths())
    assert found.colors is not None and plant.colors is not None
    light = 0.8 * ABOVE + 0.2 * BELOW
    np.testing.assert_allclose(found.colors, plant.colors * [light, light, light, 1])
    assert found.exposure is None
    assert all(m.unlit and m.transmission == 0 for m in found.materials)
    assert plant.exposure is not None and not plant.materials[0].unlit, "inputs stay"
    assert found.positions is plant.positions


def test_colours_stay_at_one_at_most_and_white_where_there_were_none() -> None:
    white = replace(square(), colors=None)
    bright = lit_plant(white, Light(UP, sun=2.0), depths())
    np.testing.assert_array_equal(np.asarray(bright.colors), np.ones((4, 4)))
    found = lit_plant(white, OVERHEAD, depths())
    np.testing.assert_allclose(np.asarray(found.colors)[:, :3], ABOVE)


def test_a_vertex_has_the_mean_of_its_faces_by_area() -> None:
    """Two triangles along an edge, the sun upon one alone, which is three times as large."""
    plant = Plant(
        "roof",
        np.array([[0.0, 0, 0], [0, 0, -1], [3, 0, 0], [0, -1, 0]]),
        np.array([UP, UP, UP, -np.eye(3)[0]]),
        np.zeros((4, 2)),
        np.array([[0, 2, 1], [0, 1, 3]]),
        np.zeros(2, np.int32),
        (Material("m"),),
    )
    light = Light(UP, 0.5, 0.0, 0.0)
    of_face = face_light(plant, light, depths())
    found = np.asarray(lit_plant(plant, light, depths()).colors)
    np.testing.assert_allclose(found[2, :3], of_face[0])
    np.testing.assert_allclose(found[3, :3], of_face[1])
    np.testing.assert_allclose(found[:2, :3], np.tile((3 * of_face[0] + of_face[1]) / 4, (2, 1)))


def test_of_many_faces_one_place_each_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the middle: the light of a flat square is the same there."""
    many = factors(square())
    monkeypatch.setattr("vegtool.refine.lit.MOST_PLACES", 1)
    np.testing.assert_allclose(factors(square()), many)
    assert MOST_PLACES > 10_000


def test_faces_without_area_or_normal_have_some_light() -> None:
    plant = square()
    plant = replace(plant, positions=np.zeros((4, 3)), normals=np.zeros((4, 3)))
    assert np.isfinite(face_light(plant, OVERHEAD, depths())).all()


@pytest.mark.gl
@pytest.mark.parametrize("double_sided", [False, True])
@pytest.mark.parametrize("azimuth", [0.0, 215.0])
def test_it_is_what_is_baked_into_pictures(double_sided: bool, azimuth: float) -> None:
    """One square, leaning, half open to the sky: the colour of its picture and of its vertices."""
    turn = np.array([[1, 0, 0], [0, 0.8, 0.6], [0, -0.6, 0.8]])
    plant = square(double_sided=double_sided, transmission=0.3)
    plant = replace(
        plant,
        positions=plant.positions @ turn.T,
        normals=plant.normals @ turn.T,
        exposure=np.tile([0.5, 0.75], (4, 1)),
    )
    x, y = turn @ np.eye(3)[0], turn @ -np.eye(3)[2]
    board = Billboards(np.zeros((1, 3)), x[None], y[None], [[1.0, 1.0]], [0.1], [0])
    light = Sun(azimuth, 40.0).light
    with PlantBuffers(plant) as buffers, SunMaps([buffers], light.direction) as maps:
        baked = BakedLight(light, maps)
        level = bake(buffers, np.zeros(2, np.int32), board, 8.0, lit=baked)
        vertices = lit_plant(plant, light, maps.read()).colors
    assert level.atlas is not None and vertices is not None
    px, py, w, h = level.atlas.front[0]
    texels = linear_from_srgb(level.atlas.color[py : py + h, px : px + w, :3] / 255)
    np.testing.assert_allclose(texels.mean(axis=(0, 1)), vertices[0, :3], atol=0.004)
    assert np.ptp(texels, axis=(0, 1)).max() < 0.02


@pytest.mark.gl
def test_a_whole_tree_in_the_sun_is_between_its_shadow_and_its_noon() -> None:
    plant = sample("broadleaf", 2000)
    light = Sun(60, 40).light
    with PlantBuffers(plant) as buffers, SunMaps([buffers], light.direction) as maps:
        found = face_light(plant, light, maps.read())
    none, all_of_it = (face_light(plant, one, depths()) for one in (replace(light, sun=0), light))
    assert (found >= none - 1e-9).all() and (found <= all_of_it + 1e-9).all()
    assert none.mean() + 0.02 < found.mean() < all_of_it.mean() - 0.02
