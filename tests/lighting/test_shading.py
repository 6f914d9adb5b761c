"""The shading model in arrays: values that can be worked out, and what must hold for all."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.arrays import FloatArray, unit
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded, sky_light, turned, turned_to
from vegtool.seeding import generator

OVERHEAD = Light(np.array([0.0, 2.0, 0.0]), sun=0.7, sky_above=0.4, sky_below=0.2)
UP, DOWN, ASIDE, NONE = np.array([[0.0, 1, 0], [0, -1, 0], [1, 0, 0], [0, 0, 0]])
WHITE = np.ones(3)


def random_surfaces(seed: int, count: int = 500) -> dict[str, FloatArray]:
    random = generator(seed, "surfaces")
    return {
        "color": random.uniform(0, 1, (count, 3)),
        "normal": unit(random.normal(size=(count, 3))),
        "exposure": random.uniform(0, 1, (count, 2)),
        "transmission": random.uniform(0, 1, count),
        "tint": random.uniform(0, 1, (count, 3)),
        "visible": random.uniform(0, 1, count),
        "through": random.uniform(0, 1, count),
    }


def random_light(seed: int) -> Light:
    random = generator(seed, "light")
    sun, above, below = random.uniform(0, 1, 3)
    return Light(random.normal(size=3), sun, above, below)


@pytest.mark.parametrize(
    ("normal", "transmission", "expected"),
    [
        (UP, 0.0, 0.7 + 0.4),  # all of the sun, all of the sky
        (DOWN, 0.0, 0.2),  # the ground alone
        (ASIDE, 0.0, 0.3),  # the sun grazes; half of what is above and half of what is below
        ([0.0, 0.6, 0.8], 0.0, 0.7 * 0.6 + 0.2 + 0.2 * 0.8),  # 0.8 of the way up from below
        (UP, 1.0, 0.2),  # all that falls on the other side, and none of what falls on this
        (DOWN, 1.0, 0.7 + 0.4),
        (DOWN, 0.25, 0.75 * 0.2 + 0.25 * 1.1),
        (NONE, 0.0, 0.3),  # no direction: the mean of the skies, whatever passes
        (NONE, 0.6, 0.3),
    ],
)
def test_a_sun_overhead(normal: FloatArray, transmission: float, expected: float) -> None:
    found = shaded(WHITE, np.asarray(normal), OVERHEAD, transmission=transmission)
    np.testing.assert_allclose(found, expected)


def test_a_tint_colours_what_passes_through_and_nothing_else() -> None:
    tint, color = np.array([1.0, 0.5, 0.0]), np.array([0.5, 0.5, 0.25])
    found = shaded(color, DOWN, OVERHEAD, transmission=0.5, tint=tint)
    np.testing.assert_allclose(found, color * (0.5 * 0.2 + 0.5 * 1.1 * tint))
    np.testing.assert_allclose(
        shaded(color, UP, OVERHEAD, transmission=0.0, tint=tint), color * (0.7 + 0.4)
    )


def test_each_side_has_its_own_exposure_and_the_sun_is_none_of_its_business() -> None:
    """Exposure is of the sky; from the other side the two change places."""
    exposure = np.array([0.25, 0.75])
    assert shaded(WHITE, UP, OVERHEAD, exposure)[0] == pytest.approx(0.7 + 0.25 * 0.4)
    assert shaded(WHITE, DOWN, OVERHEAD, exposure[::-1])[0] == pytest.approx(0.75 * 0.2)
    assert shaded(WHITE, UP, OVERHEAD, exposure, 1.0)[0] == pytest.approx(0.75 * 0.2)
    below = shaded(WHITE, DOWN, OVERHEAD, exposure[::-1], 1.0)
    assert below[0] == pytest.approx(0.7 + 0.25 * 0.4)


def test_of_the_sun_what_is_visible_falls_here_and_what_comes_through_there() -> None:
    half = shaded(WHITE, UP, OVERHEAD, visible=0.5, through=0.0)
    np.testing.assert_allclose(half, 0.35 + 0.4)
    behind = shaded(WHITE, DOWN, OVERHEAD, None, 1.0, visible=0.0, through=0.5)
    np.testing.assert_allclose(behind, 0.35 + 0.4)


@pytest.mark.parametrize("seed", range(5))
def test_both_sides_together_send_out_what_falls_on_both_and_no_more(seed: int) -> None:
    """With a white surface all of it, as nothing is absorbed; with colours less."""
    given, light = random_surfaces(seed), random_light(seed)
    color, normal, exposure = given["color"], given["normal"], given["exposure"]
    visible, through, share = given["visible"], given["through"], given["transmission"]
    toward = normal @ light.unit
    falls = light.sun * (visible * np.maximum(toward, 0) + through * np.maximum(-toward, 0))
    falls += sky_light(normal, light) * exposure[:, 0] + sky_light(-normal, light) * exposure[:, 1]

    def leaves(color: FloatArray, tint: FloatArray) -> FloatArray:
        front = shaded(color, normal, light, exposure, share, tint, visible, through)
        back = shaded(color, -normal, light, exposure[:, ::-1], share, tint, through, visible)
        assert (front >= 0).all() and (back >= 0).all()
        return front + back

    white = np.ones_like(color)
    np.testing.assert_allclose(leaves(white, white), np.repeat(falls[:, None], 3, axis=1))
    assert (leaves(color, given["tint"]) <= falls[:, None] * color + 1e-12).all()


@pytest.mark.parametrize("angle", [0.3, 2.0, 4.5])
def test_a_scene_turned_about_the_vertical_is_as_bright(angle: float) -> None:
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    given, light = random_surfaces(3), random_light(3)
    there = Light(turn @ light.direction, light.sun, light.sky_above, light.sky_below)
    moved = given | {"normal": given["normal"] @ turn.T}
    np.testing.assert_allclose(shaded(light=there, **moved), shaded(light=light, **given))


def test_light_adds_up_and_scales_with_colour() -> None:
    """A sun and a sky are the sum of both alone; half the colour is half the light."""
    given, light = random_surfaces(4), random_light(4)
    sun = Light(light.direction, light.sun, 0.0, 0.0)
    sky = Light(light.direction, 0.0, light.sky_above, light.sky_below)
    whole = shaded(light=light, **given)
    np.testing.assert_allclose(shaded(light=sun, **given) + shaded(light=sky, **given), whole)
    half = given | {"color": given["color"] / 2}
    np.testing.assert_allclose(shaded(light=light, **half), whole / 2)


def test_what_is_seen_from_behind_turns_round() -> None:
    """By the side of the face: a normal that leans over its edge stays so."""
    normal = np.array([[0.6, 0.0, -0.8], [0.6, 0.0, -0.8]])
    front = np.array([True, False])
    np.testing.assert_array_equal(turned(normal, front), [[0.6, 0, -0.8], [-0.6, 0, 0.8]])


def test_without_faces_a_normal_turns_to_the_viewer() -> None:
    """Whatever the length of the way there; one that is seen edge on stays."""
    normal = np.array([[0.6, 0.0, -0.8], [0.6, 0.0, -0.8], [0.0, 1.0, 0.0]])
    viewer = np.array([[0.0, 0, 50.0], [0, 0, -0.1], [1, 0, 0]])
    np.testing.assert_array_equal(
        turned_to(normal, viewer), [[-0.6, 0, 0.8], [0.6, 0, -0.8], [0, 1, 0]]
    )
    given = unit(generator(1, "normals").normal(size=(200, 3)))
    to_viewer = generator(2, "viewers").normal(size=(200, 3))
    assert ((turned_to(given, to_viewer) * to_viewer).sum(axis=1) >= 0).all()
