"""Surfels drawn as discs: where they are, how large, from which side, and as many as are asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.arrays import unit
from vegtool.gl.draw import Shot, pictured
from vegtool.gl.points import AS_IT_IS, SurfelSetBuffers
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.lod import Display
from vegtool.measure.views import framed
from vegtool.surfel_set import ALL_LIGHT, Spacing, SurfelSet

pytestmark = pytest.mark.gl
Z = np.array([0.0, 0, 1])


def drawn(
    surfels: SurfelSet, radius: float, prefix: int, direction: np.ndarray = Z, turn: float = 0.0,
    samples: int = 0, light: Light | None = None,
) -> np.ndarray:  # fmt: skip
    """From ten metres away, a metre is 93.5 pixels."""
    camera = framed(np.zeros(3), 1.5, direction, 10.0, Display())
    moved = np.eye(4)
    moved[:3, 3] = camera.eye - camera.target
    shot = Shot(camera.view_projection() @ moved, camera.eye, camera.width, camera.height)
    finer = 1 if samples else 4
    with SurfelSetBuffers(surfels) as buffers:
        rows = buffers.instances(
            camera.eye, np.zeros((1, 3)), np.array([turn]), np.ones(1), np.array([radius])
        )
        return pictured(
            buffers.ctx, shot,
            lambda part: buffers.draw(
                rows, np.array([prefix]), part, light or Light(), footprint=finer
            ),
            finer, samples,
        )  # fmt: skip


def of(*rows: tuple[tuple[float, float, float], tuple[float, float, float]]) -> SurfelSet:
    position, normal = (np.array(part, dtype=float) for part in zip(*rows, strict=True))
    return SurfelSet(position, normal, np.ones_like(position), Spacing(1, 0.0, len(position)))


ONE = of(((0, 0, 0), (0, 0, 1)), ((1, 0, 0), (0, 0, 1)))


def test_a_disc_is_as_large_as_its_radius_says() -> None:
    """Seen from its front, a circle; from 60 degrees, half of it; from its edge, nothing."""
    focal = Display().pixels_per_metre(10.0)
    for degrees, share in ((0, 1.0), (60, 0.5), (90, 0.0)):
        turn = np.radians(degrees)
        way = np.array([np.sin(turn), 0, np.cos(turn)])
        area = drawn(ONE, 0.2, 1, way)[..., 3].sum()
        assert area == pytest.approx(share * np.pi * (0.2 * focal) ** 2, rel=0.03, abs=1.0)


def test_both_sides_are_seen_and_only_the_prefix_is_drawn() -> None:
    front = drawn(ONE, 0.2, 1)[..., 3].sum()
    assert drawn(ONE, 0.2, 1, -Z)[..., 3].sum() == pytest.approx(front, rel=0.02)
    assert drawn(ONE, 0.2, 2)[..., 3].sum() == pytest.approx(2 * front, rel=0.03)
    assert drawn(ONE, 0.2, 0)[..., 3].sum() == 0
    assert drawn(ONE, 0.2, 99)[..., 3].sum() == pytest.approx(2 * front, rel=0.03), "all there are"


def test_a_turn_of_the_plant_is_a_turn_of_the_eye() -> None:
    turn = 0.7
    way = np.array([np.sin(turn), 0, np.cos(turn)])
    one, other = drawn(ONE, 0.2, 2, turn=turn), drawn(ONE, 0.2, 2, np.array([-way[0], 0, way[2]]))
    assert np.abs(one[..., 3] - other[..., 3]).mean() < 2e-3


def test_discs_cut_each_other_where_their_planes_meet() -> None:
    """Two crossed discs: from between them, each shows the half that is nearer."""
    crossed = SurfelSet(
        np.array([[0, 0, 0], [0, 0, 0], [1, 1, 1e-9]], dtype=float),
        np.array([[1, 0, 1], [-1, 0, 1], [0, 0, 1]]) / np.array([[2**0.5], [2**0.5], [1]]),
        np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 0]]), Spacing(1, 0.0, 3), unlit=True,
    )  # fmt: skip
    picture = drawn(crossed, 0.3, 2)
    left, right = np.array_split(picture[..., :2].sum(axis=0), 2)
    # a plane of normal (1, 0, 1) rises to the left
    assert left[:, 0].sum() > 50 * left[:, 1].sum() and right[:, 1].sum() > 50 * right[:, 0].sum()


def test_sizes_are_shares_of_the_radius() -> None:
    half = replace(ONE, size=np.array([0.5, 1.0]))
    assert drawn(half, 0.2, 1)[..., 3].sum() == pytest.approx(drawn(ONE, 0.1, 1)[..., 3].sum())
    for size in ([0.5], [1.5, 1.0], [-0.1, 1.0], [1.0, 1.0, 1.0]):
        if len(size) == 1:
            assert np.array_equal(replace(ONE, size=np.array(size)).size, [0.5, 0.5])
        else:
            with pytest.raises(ValueError, match=r"SurfelSet\.size"):
                replace(ONE, size=np.array(size))


def test_multisampling_sees_the_edges_of_discs() -> None:
    """Discs of a third of a pixel's radius cover, in the mean over places, as much as their area;
    tested at the middles of pixels alone they would cover nothing or a whole one."""
    at = np.column_stack([np.mgrid[:20, :20].reshape(2, -1).T * 0.0537, np.zeros(400)])
    many = SurfelSet(at, np.tile(Z, (400, 1)), np.ones((400, 3)), Spacing(1, 0.0, 400))
    focal = Display().pixels_per_metre(10.0)
    picture = drawn(many, 1 / (3 * focal), 400, samples=4)
    assert picture[..., 3].sum() == pytest.approx(400 * np.pi / 9, rel=0.1)
    assert picture[..., 3].max() < 1


def test_what_is_solid_is_mirrored_and_leaves_turn_round() -> None:
    """A disc seen from behind, a little: of a solid, as light as one that looks as far to the eye,
    and to the same side."""
    to_side, to_eye = (1 - 0.2**2) ** 0.5, 0.2
    behind, before, turned = (
        of(((0, 0, 0), normal), ((1, 0, 0), normal))
        for normal in ((to_side, 0, -to_eye), (to_side, 0, to_eye), (-to_side, 0, to_eye))
    )
    solid, leaf, first, second = (
        drawn(surfels, 0.2, 1)[..., :3].max()
        for surfels in (replace(behind, double_sided=False), behind, before, turned)
    )
    assert solid == pytest.approx(first, rel=0.01) and leaf == pytest.approx(second, rel=0.01)
    assert abs(first - second) > 0.1 * first


DARK = Light(sky_above=0.0, sky_below=0.0)
"""A sun alone."""
SKY = Light(sun=0.0)
AS_DRAWN = AS_IT_IS[0] / 127.5
HALF = 1e-3
"""Pictures are half floats."""


def lit(surfels: SurfelSet, *light: float, tint: tuple[float, ...] = (1, 1, 1)) -> SurfelSet:
    return replace(surfels, light=np.tile(light, (len(surfels), 1)), transmission_tint=tint)


def test_all_the_light_there_is_draws_the_same_picture() -> None:
    """To the bit, as none said; a set without has no more of it on the GPU than before."""
    for surfels in (ONE, replace(ONE, double_sided=False)):
        for way in (Z, np.array([0.6, 0, -0.8])):
            said = drawn(lit(surfels, *ALL_LIGHT), 0.2, 2, way)
            assert np.array_equal(said, drawn(surfels, 0.2, 2, way))
    sizes = []
    for surfels in (ONE, lit(ONE, *ALL_LIGHT)):
        with SurfelSetBuffers(surfels) as buffers:
            sizes.append(buffers._vertices.size // len(surfels))
    assert sizes == [40, 44]


def test_the_sky_lights_the_side_that_is_seen_as_far_as_it_reaches_it() -> None:
    """From behind it is the other side's light; something solid has but one. Where none reaches it,
    it is black under the sky, though not under the sun."""
    half = lit(ONE, 0.4, 0.0, 0.0)
    whole = drawn(ONE, 0.2, 1, light=SKY)[..., :3].max()
    assert drawn(half, 0.2, 1, light=SKY)[..., :3].max() == pytest.approx(0.4 * whole, rel=HALF)
    assert drawn(half, 0.2, 1, -Z, light=SKY)[..., :3].max() == 0
    solid = drawn(replace(half, double_sided=False), 0.2, 1, -Z, light=SKY)[..., :3].max()
    assert solid == pytest.approx(0.4 * whole, rel=HALF)
    none = lit(ONE, 0.0, 0.0, 0.0)
    assert drawn(none, 0.2, 1, light=SKY)[..., :3].max() == 0
    toward = Light(Z, sky_above=0.0, sky_below=0.0)
    assert drawn(none, 0.2, 1, light=toward)[..., :3].max() == pytest.approx(
        AS_DRAWN * toward.sun, rel=HALF
    )


def test_what_lets_all_light_through_has_that_of_its_other_side() -> None:
    """With the sun behind it, in its own colour times the tint; with the sun before it, none."""
    tint = (1.0, 0.5, 0.2)
    leaf = lit(replace(ONE, color=np.full((2, 3), 0.5)), 1.0, 1.0, 1.0, tint=tint)
    behind = Light(-Z, sky_above=0.0, sky_below=0.0)
    shown = drawn(leaf, 0.2, 1, light=behind)[..., :3].max(axis=(0, 1))
    assert shown == pytest.approx(AS_DRAWN * behind.sun * 0.5 * np.array(tint), rel=HALF)
    assert drawn(leaf, 0.2, 1, -Z, light=behind)[..., :3].max() == 0


def test_light_is_that_of_the_reference() -> None:
    """Of discs that look in all directions, from before and behind: what lighting/shading.py says
    of their normals turned to the eye, with exposures that change sides with them."""
    rng = np.random.default_rng(0)
    sides = unit(rng.normal(size=(8, 3)) + 0.5 * np.array([Z, -Z] * 4))
    for normal, shares in zip(sides, rng.integers(0, 256, (8, 3)), strict=True):
        surfels = lit(of(((0, 0, 0), normal), ((1, 0, 0), normal)), *(shares / 255), tint=(1, 1, 0))
        turned, (here, there, passing) = normal, shares / 255
        if normal[2] < 0:
            turned, here, there = -normal, there, here
        expected = shaded(
            np.ones((1, 3)), turned[None], DARK if normal[0] > 0 else Light(),
            np.array([[here, there]]), passing, (1, 1, 0), 1.0, there,
        )  # fmt: skip
        shown = drawn(surfels, 0.2, 1, light=DARK if normal[0] > 0 else Light())
        assert shown[..., :3].max(axis=(0, 1)) == pytest.approx(AS_DRAWN * expected[0], rel=HALF)
