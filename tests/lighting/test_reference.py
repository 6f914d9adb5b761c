"""What is drawn, pixel by pixel against the same in arrays, and against pictures that were looked
at.

The reference takes what the camera sees before any light falls on it (gl/surface.py), and does all
of the light in numpy, in doubles: lighting/shading.py and lighting/shadow.py.
"""

from __future__ import annotations

import numpy as np
import pytest
from golden_pictures import assert_golden
from lit_scenes import SCENES, Scene, camera_shot, hybrid, prelit, scene

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.draw import draw
from vegtool.gl.surface import Seen, surface
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.lighting.shadow import sun_visible
from vegtool.measure.background import bytes_over

pytestmark = pytest.mark.gl
STEP = 1 / 255
GOLDEN = list(SCENES)[:6]


def reference(given: Scene, seen: Seen) -> FloatArray:
    """(n, 3) linear light of what is seen."""
    color, normal = seen.color.astype(np.float64), seen.normal.astype(np.float64)
    material = given.buffers.plant.face_material[seen.face]
    unlit = np.array([m.unlit for m in given.buffers.plant.materials])[material]
    exposure = seen.exposure.astype(np.float64)
    light, visible, through = given.light, np.ones(len(color)), exposure[:, 1]
    if given.shadows is not None:
        maps = given.shadows.read()
        light = Light(maps.direction, light.sun, light.sky_above, light.sky_below)
        visible = through = sun_visible(seen.position, seen.side.astype(np.float64), maps)
    lit = shaded(color, normal, light, exposure, seen.transmission, seen.tint, visible, through)
    return np.where(unlit[:, None], color, lit)


def both(given: Scene) -> tuple[Picture, Picture, Seen]:
    drawn = draw(given.buffers, given.shot, given.light, shadows=given.shadows)
    seen = surface(given.buffers, given.shot)
    return drawn, seen.picture(reference(given, seen)), seen


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("azimuth", [25.0, 140.0])
def test_every_pixel_is_what_the_reference_says(name: str, azimuth: float) -> None:
    with scene(name, camera_shot(azimuth)) as given:
        drawn, expected, seen = both(given)
    assert len(seen.face) > 1000
    np.testing.assert_array_equal(drawn[..., 3], expected[..., 3])
    assert np.abs(drawn - expected).max() < STEP


@pytest.mark.parametrize("name", GOLDEN)
def test_it_is_what_was_looked_at(name: str) -> None:
    with scene(name) as given:
        picture = draw(given.buffers, given.shot, given.light, 4, shadows=given.shadows)
    assert_golden(name, bytes_over(picture))


def test_the_scenes_have_what_they_are_to_show() -> None:
    """Or agreement would say nothing of it."""
    assert hybrid().kind == "hybrid"
    atlas = hybrid().atlas
    assert atlas is not None and atlas.light is not None
    shown = atlas.color[..., 3] > 0
    assert np.ptp(atlas.light[shown][:, :2].astype(int)) > 100, "some of it lies deep in the crown"
    assert atlas.light[shown][:, 3].max() > 50
    assert prelit().unlit and prelit().atlas is not None
    with scene("lit_shadows") as given:
        shadowed, _, seen = both(given)
        assert given.shadows is not None
        visible = sun_visible(seen.position, seen.side.astype(np.float64), given.shadows.read())
        assert 0.2 < (visible == 0).mean() < 0.8
        assert ((visible > 0.05) & (visible < 0.95)).mean() > 0.05
        plain = draw(given.buffers, given.shot, given.light)
    assert shadowed[..., :3].sum() < 0.95 * plain[..., :3].sum()


def test_light_comes_through_leaves_from_behind_the_tree() -> None:
    with scene("lit_translucent") as given:
        through, _, seen = both(given)
    leaf = seen.transmission > 0
    assert leaf.any() and (~leaf).any()
    opaque = shaded(seen.color, seen.normal, given.light, seen.exposure, visible=0.0)
    x, y = seen.at[leaf].T
    assert through[y, x, :3].sum() > 1.1 * opaque[leaf].sum()
