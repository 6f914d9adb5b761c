"""Light of surfels: kept as it is seen of a plant, averaged as colours are, or baked into them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from surfel_cases import surface
from surfel_sets import ball

from vegtool.arrays import FloatArray
from vegtool.convert import ConvertOptions, convert
from vegtool.gl.pictures import BakedLight
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.lod import Level
from vegtool.measure.options import MeasureOptions
from vegtool.plant import Material, Plant
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.candidates import candidates, seen_from
from vegtool.surfels.blue.group import discs_of, grouped, together
from vegtool.surfels.blue.level import sampled
from vegtool.surfels.blue.make import ordered, surfels_of

pytestmark = pytest.mark.gl
UP = np.array([0.0, 1.0, 0.0])
ASIDE = np.array([0.6, 0.8, 0.0])
TINT = np.array([1.0, 0.8, 0.1])
LEAF = Material(
    "leaf", base_color=[0.2, 0.4, 0.1, 1], double_sided=True, transmission=0.4,
    transmission_tint=TINT,
)  # fmt: skip
HALF = 1e-3
"""Exposures and normals are drawn as half floats."""


def plane(material: Material = LEAF, normal: FloatArray = UP) -> Plant:
    """A square of two metres that looks up, of whose sky a quarter is hidden from above and three
    quarters from below."""
    corners = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    plant = surface(corners, [[0, 2, 1], [0, 3, 2]], normals=np.tile(normal, (4, 1)))
    exposure = np.tile([0.75, 0.25], (4, 1))
    return replace(plant, materials=(material, Material("other")), exposure=exposure)


def made(plant: Plant, lit: BakedLight | None = None) -> SurfelSet:
    with PlantBuffers(plant) as buffers:
        return sampled(buffers, 100, lit).surfels


def test_each_side_has_its_own() -> None:
    """Normals are to the side that is seen, and exposures go with them; so do they where shading
    normals point away from whoever looks, as of a crown's leaves."""
    for normal in (UP, -UP):
        with PlantBuffers(plane(normal=normal)) as buffers:
            found = candidates(buffers, 128)
        assert found.light is not None
        above = found.normal[:, 1] > 0
        assert above.any() and not above.all()
        for rows, expected in ((above, [0.75, 0.25, 0.4]), (~above, [0.25, 0.75, 0.4])):
            assert np.abs(found.light[rows] - expected).max() < HALF


def test_a_solid_has_the_light_of_the_side_that_is_seen() -> None:
    """Though its normals, smooth ones at a silhouette say, lean away from the eye."""
    solid = replace(LEAF, double_sided=False)
    away = np.array([0.8, -0.6, 0.0])
    plant = replace(plane(normal=away), materials=(solid, replace(solid, name="other")))
    with PlantBuffers(plant) as buffers:
        found = seen_from(buffers, UP, 64)
    assert found.light is not None and np.abs(found.light - [0.75, 0.25, 0.4]).max() < HALF


def test_surfels_have_means_of_what_they_stand_for() -> None:
    """Of a plane, its own; of candidates of which every second one is dark, some of it in early
    surfels. The tint is that of the leaves."""
    kept = made(plane())
    assert kept.light is not None and not kept.unlit
    assert np.allclose(kept.transmission_tint, TINT)
    assert np.abs(kept.exposure.sum(axis=1) - 1).max() < HALF, "of one side, never of both mixed"
    assert np.abs(kept.transmission - 0.4).max() < HALF
    with PlantBuffers(plane()) as buffers:
        found = seen_from(buffers, UP, 128)
    mixed = np.tile(np.arange(len(found))[:, None] % 2, (1, 3)).astype(float)
    early = ordered(replace(found, light=mixed), 100).light
    assert early is not None and ((early[:4] > 0) & (early[:4] < 1)).all()


def test_without_light_nothing_is_kept() -> None:
    """Nor of what is unlit, whatever else is known of it."""
    plain = replace(plane(replace(LEAF, transmission=0.0)), exposure=None)
    unlit = replace(LEAF, unlit=True)
    bare = replace(plane(), materials=(unlit, replace(unlit, name="other")))
    for plant in (plain, bare):
        with PlantBuffers(plant) as buffers:
            assert surfels_of(buffers, 50, resolution=64).light is None
    with pytest.raises(ValueError, match=r"SurfelSet\.light"):
        replace(ball(10), light=np.ones((10, 3)), unlit=True)
    with pytest.raises(ValueError, match=r"SurfelSet\.light"):
        replace(ball(10), light=np.full((10, 3), 1.1))


def test_a_part_has_its_part_of_the_light() -> None:
    told = replace(ball(20), light=np.linspace(0, 1, 60).reshape(20, 3))
    assert told.light is not None
    for part, rows in ((told.first(7), slice(7)), (told.moved(UP), slice(None))):
        assert part.light is not None and np.array_equal(part.light, told.light[rows])
    assert np.array_equal(told.exposure, told.light[:, :2])


def test_a_group_keeps_the_light_of_its_parts() -> None:
    """Beside what has none of its own, and so all of it; what passes has the mean of their tints,
    by how much that is."""
    dark = replace(
        ball(500), light=np.tile([0.25, 0.5, 1.0], (500, 1)), transmission_tint=np.array([1, 1, 0])
    )
    far = np.array([9.0, 0.0, 0.0])
    group = grouped(together([discs_of(dark), discs_of(ball(500, 1.0, far))]), 300).surfels
    assert group.light is not None and np.allclose(group.transmission_tint, [1, 1, 0])
    is_far = group.position[:, 0] > 4
    late = np.arange(300) > 4  # those that stand for one of the two alone
    assert np.allclose(group.light[is_far & late], [1, 1, 0])
    assert np.allclose(group.light[~is_far & late], [0.25, 0.5, 1.0])
    other = replace(dark.moved(far), transmission_tint=np.array([1, 0, 1]))
    both = together([discs_of(dark), discs_of(other)])
    assert np.allclose(both.transmission_tint, [1, 0.5, 0.5])
    assert together([discs_of(ball(9)), discs_of(ball(9))]).light is None


def prelit(plant: Plant, light: Light, count: int = 100) -> SurfelSet:
    with PlantBuffers(plant) as buffers, SunMaps([buffers], light.direction) as maps:
        return sampled(buffers, count, BakedLight(light, maps)).surfels


def test_baked_light_is_that_of_the_reference() -> None:
    """On a plane, which hides the sun from nothing: each surfel has the light of its side, but for
    the first ones, which are means of both."""
    light = Light(ASIDE)
    found = prelit(plane(), light)
    assert found.unlit and found.light is None
    color = np.array([LEAF.base_color[:3]])
    for side, exposure in ((UP, [0.75, 0.25]), (-UP, [0.25, 0.75])):
        rows = (found.normal @ side > 0.9) & (np.arange(100) >= 32)
        expected = shaded(color, side[None], light, np.array([exposure]), 0.4, TINT)
        assert rows.any() and np.abs(found.color[rows] - expected).max() < HALF


def test_shadows_are_baked_too() -> None:
    """Of a small plane above a large one, seen from above, with the sun overhead: what lies under
    it has the sky alone."""
    grey = Material("grey", base_color=[0.5, 0.5, 0.5, 1])
    small = np.array([[-0.5, 1, -0.5], [0.5, 1, -0.5], [0.5, 1, 0.5], [-0.5, 1, 0.5]])
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    corners = np.concatenate([small * [4, 0, 4], small])
    plant = surface(corners, np.concatenate([faces, faces + 4]))
    light = Light(UP)
    found = prelit(replace(plant, materials=(grey, grey)), light, 600)
    away = np.abs(found.position[:, [0, 2]]).max(axis=1)
    low = (found.position[:, 1] < 0.5) & (np.arange(600) >= 100)
    below, beside = low & (away < 0.3), low & (away > 0.8)
    assert below.any() and beside.any()
    assert np.abs(found.color[below] - 0.5 * light.sky_above).max() < HALF
    assert np.abs(found.color[beside] - 0.5 * (light.sky_above + light.sun)).max() < HALF


def test_what_is_unlit_keeps_its_colours() -> None:
    """With no light at all, and beside a sun."""
    unlit = replace(LEAF, unlit=True)
    bare = replace(plane(), materials=(unlit, replace(unlit, name="other")))
    for found in (made(bare, BakedLight(Light())), prelit(bare, Light(ASIDE))):
        assert found.unlit and np.allclose(found.color, LEAF.base_color[:3], atol=1e-6)


@pytest.mark.parametrize(
    "options", [{"occlusion": 1.0, "translucency": 0.6}, {"prelit": True, "sun": "60,40"}]
)
def test_a_chain_with_light(options: dict[str, object]) -> None:
    """Levels are prefixes, with their light, or lit."""
    leaf = replace(LEAF, role="leaf")
    told = ConvertOptions(method="surfels", points=200, levels=2, **options)  # type: ignore[arg-type]
    plant = replace(plane(), materials=(leaf, replace(leaf, name="other")), exposure=None)
    chain = convert(plant, told, MeasureOptions(measure="off"))
    assert not any("light" in note for note in chain.notes)

    def surfels(level: Level) -> SurfelSet:
        assert level.surfels is not None and level.unlit == level.surfels.unlit == told.prelit
        return level.surfels

    first, second = map(surfels, chain.levels[1:])
    if told.prelit:
        assert first.light is None and chain.baked["azimuth_deg"] == 60
    else:
        assert first.light is not None and second.light is not None
        assert np.abs(first.transmission - 0.6).max() < HALF
        assert np.array_equal(second.light, first.light[: len(second)])
