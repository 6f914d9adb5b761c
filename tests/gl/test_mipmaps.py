"""Mip levels against plain averages, and the filter that reads them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.gl.draw import Shot, draw
from vegtool.gl.mipmaps import mip_levels
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.measure.views import Camera, direction
from vegtool.plant import Material, Plant, Texture
from vegtool.preview.reveal import interpolated
from vegtool.srgb import linear_from_srgb, srgb_from_linear


@pytest.mark.parametrize("srgb", [True, False])
def test_each_level_is_the_rounded_mean_of_four_texels(srgb):
    image = np.random.default_rng(1).integers(0, 256, (16, 32, 4), dtype=np.uint8)
    above = image
    levels = list(mip_levels(image, srgb))
    assert [level.shape[:2] for level in levels] == [(8, 16), (4, 8), (2, 4), (1, 2), (1, 1)]
    for level in levels[:4]:
        value = above / 255
        if srgb:
            value[..., :3] = linear_from_srgb(value[..., :3])
        h, w = level.shape[:2]
        value = value.reshape(h, 2, w, 2, 4).mean(axis=(1, 3))
        if srgb:
            value[..., :3] = srgb_from_linear(value[..., :3])
        assert np.abs(level - value * 255).max() <= 0.53  # half a step, and the table's own step
        above = level


def test_odd_sides_keep_the_mean_and_a_ramp_stays_a_ramp():
    ramp = np.zeros((5, 7, 4), np.uint8)
    ramp[...] = (30 * np.arange(7))[:, None]
    first = next(iter(mip_levels(ramp, False)))
    assert first.shape == (2, 3, 4)
    # middles of the new texels lie at 2/3, 3 and 5 1/3 of the old
    np.testing.assert_array_equal(first[0, :, 0], [20, 90, 160])


def test_one_texel_has_no_level_below():
    assert list(mip_levels(np.zeros((1, 1, 4), np.uint8), True)) == []


def test_a_grey_stays_itself_through_all_levels():
    """Rounding upwards at every level, as a driver did, would have made it brighter."""
    for value in (1, 60, 130, 254):
        last = list(mip_levels(np.full((256, 256, 4), value, np.uint8), True))[-1]
        np.testing.assert_array_equal(last, np.full((1, 1, 4), value))


def leaves(size: int = 64) -> np.ndarray:
    """Twelve discs with edges a texel wide, and an image that repeats."""
    across = np.random.default_rng(1).random((12, 2)) * size
    at = np.mgrid[:size, :size] + 0.5
    away = np.abs(at[:, None] - across.T[:, :, None, None])
    nearest = np.hypot(*np.minimum(away, size - away)).min(axis=0)
    return np.clip(size / 9 - nearest + 0.5, 0, 1)


def needles(size: int = 64) -> np.ndarray:
    """Eight lines of single texels."""
    image, rng = np.zeros((size, size)), np.random.default_rng(2)
    for start, angle in zip(rng.random((8, 2)) * size, rng.random(8) * 6, strict=True):
        for step in range(size // 2):
            x, y = (start + step * np.array([np.cos(angle), np.sin(angle)])).astype(int) % size
            image[y, x] = 1
    return image


def cut_out(alpha: np.ndarray) -> np.ndarray:
    image = np.random.default_rng(3).integers(0, 256, (*alpha.shape, 4), dtype=np.uint8)
    image[..., 3] = np.rint(255 * alpha)
    return image


def share_shown(alpha: np.ndarray, cutoff: float) -> float:
    """Of the area between texels, at 64 places to a texel, that passes the test."""
    return float((interpolated(alpha / 255.0, 8) >= cutoff).mean())


@pytest.mark.parametrize(
    ("alpha", "bound"),
    [(leaves(), 0.03), (1 - leaves(), 0.03), (needles(), 0.05)],
    ids=["leaves", "holes", "needles"],
)
@pytest.mark.parametrize("cutoff", [0.4, 0.5, 0.6])
def test_with_a_cutoff_every_level_shows_as_much(alpha, bound, cutoff):
    """Down to 8 x 8 texels, below which a texel is more than a hundredth. Plain averages lose
    needles altogether."""
    image = cut_out(alpha)
    wanted = share_shown(image[..., 3], cutoff)
    for level in [level for level in mip_levels(image, True, cutoff) if len(level) >= 8]:
        assert share_shown(level[..., 3], cutoff) == pytest.approx(wanted, abs=bound)
    plain = list(mip_levels(cut_out(needles()), True))
    assert share_shown(plain[2][..., 3], cutoff) == 0


def test_a_cutoff_changes_nothing_but_alpha_and_nothing_without_edges():
    image = cut_out(leaves())
    before = image.copy()
    for plain, kept in zip(mip_levels(image, True), mip_levels(image, True, 0.5), strict=True):
        np.testing.assert_array_equal(plain[..., :3], kept[..., :3])
    np.testing.assert_array_equal(image, before)
    for value in (0, 90, 255):  # nothing is shown, nor is anything; all is
        even = cut_out(np.full((32, 32), value / 255))
        for level in mip_levels(even, True, 0.5):
            assert ((level[..., 3] >= 128) == (value >= 128)).all()


@pytest.mark.parametrize("shape", [(8, 8), (5, 7), (1, 6), (12, 3)])
@pytest.mark.parametrize("srgb", [True, False])
def test_without_a_cutoff_levels_are_plain_averages_texel_by_texel(shape, srgb):
    """Of odd sides too: each new texel is what lies between the old ones at its middle. To a step,
    for what is nearly halfway between two."""
    above = np.random.default_rng(4).integers(0, 256, (*shape, 4), dtype=np.uint8)
    for level in mip_levels(above, srgb):
        values = above / 255
        if srgb:
            values[..., :3] = linear_from_srgb(values[..., :3])
        for row, column in np.ndindex(level.shape[:2]):
            found = np.zeros(4)
            for y, wy in weights(row, level.shape[0], above.shape[0]):
                for x, wx in weights(column, level.shape[1], above.shape[1]):
                    found += wy * wx * values[y, x]
            if srgb:
                found[:3] = srgb_from_linear(found[:3])
            assert np.abs(255 * found - level[row, column]).max() <= 0.53
        above = level


def weights(index: int, count: int, of: int) -> list[tuple[int, float]]:
    """Which of the texels above a new one is made of, and by how much, along an axis."""
    middle = (index + 0.5) * of / count - 0.5
    first = int(np.floor(middle))
    share = middle - first
    return [(first, 1 - share)] + ([(first + 1, share)] if share else [])


@pytest.mark.gl
def test_four_texels_to_a_pixel_along_one_axis_keep_the_other_sharp():
    """A square of 64 x 256 texels on 64 x 64 pixels: columns of black and white stay what they are
    under 4x anisotropy; without, mips would have made them grey."""
    image = np.full((256, 64, 4), 255, np.uint8)
    image[:, ::2, :3] = 0
    leaf = Material("m", color_texture=Texture("t", image))
    corners = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0.0]])
    faces = [[0, 1, 2], [0, 2, 3]]
    plant = Plant("p", corners, np.tile([0.0, 0, 1], (4, 1)), uvs, faces, [0, 0], (leaf,))
    camera = Camera(np.zeros(3), direction(0, 0), 10.0, 640.0, 64, 64, (32.0, 32.0), 2.0)
    shot = Shot(camera.view_projection(), camera.target, 64, 64)
    ambient = Light(sun=0.0, sky_above=1.0, sky_below=1.0)
    with PlantBuffers(plant, mipmaps=True) as buffers:
        picture = draw(buffers, shot, ambient)
    np.testing.assert_allclose(picture[8:56, 8:56:2, 0], 0, atol=0.02)
    np.testing.assert_allclose(picture[8:56, 9:56:2, 0], 1, atol=0.02)
    with PlantBuffers(replace(plant, uvs=uvs * [4, 1]), mipmaps=True) as buffers:
        grey = draw(buffers, shot, ambient)
    np.testing.assert_allclose(grey[8:56, 8:56, 0], 0.5, atol=0.02)
    with PlantBuffers(plant, mipmaps=True) as buffers:
        trilinear = draw(buffers, shot, ambient, anisotropy=1)
    np.testing.assert_allclose(trilinear[8:56, 8:56, 0], 0.5, atol=0.02)


@pytest.mark.gl
@pytest.mark.parametrize("texels", [1, 2, 4, 6])
def test_one_tap_reads_the_mips_of_the_longer_axis(texels):
    """So many texels to a pixel along one axis, one along the other, each mip of a grey of its
    own: the picture's grey lies between those of the two mips around log2 of the longer axis."""
    image = np.zeros((64 * texels, 64, 4), np.uint8)
    corners = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0.0]])
    leaf = Material("m", color_texture=Texture("t", image))
    faces = [[0, 1, 2], [0, 2, 3]]
    plant = Plant("p", corners, np.tile([0.0, 0, 1], (4, 1)), uvs, faces, [0, 0], (leaf,))
    camera = Camera(np.zeros(3), direction(0, 0), 10.0, 640.0, 64, 64, (32.0, 32.0), 2.0)
    shot = Shot(camera.view_projection(), camera.target, 64, 64)
    grey = srgb_from_linear(np.arange(7) / 8)
    with PlantBuffers(plant, mipmaps=True) as buffers:
        (group,) = buffers.groups
        for level in range(7):
            width, height = max(64 >> level, 1), max(64 * texels >> level, 1)
            made = np.full((height, width, 4), round(255 * grey[level]), np.uint8)
            group.color_map.write(made.tobytes(), level=level)
        light = Light(sun=0.0, sky_above=1.0, sky_below=1.0)
        picture = draw(buffers, shot, light, anisotropy=1)
    np.testing.assert_allclose(picture[8:56, 8:56, 0], np.log2(texels) / 8, atol=0.01)


@pytest.mark.gl
@pytest.mark.parametrize("anisotropy", [1, 4])
def test_a_face_that_shows_one_place_of_a_texture_shows_its_finest_texels(anisotropy):
    """Its texture coordinates stand still: the logarithm of a footprint of 0 must not matter. The
    one white texel among black ones would be grey in every mip."""
    image = np.zeros((64, 64, 4), np.uint8)
    image[..., 3] = 255
    image[20:22, 40:42] = 255
    flat = Texture("n", np.tile(np.array([128, 128, 255, 255], np.uint8), (64, 64, 1)))
    corners = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0.3], [0.5, 0.5, 0], [-0.5, 0.5, -0.3]])
    uvs = np.tile([41 / 64, 21 / 64], (4, 1))
    leaf = Material("m", color_texture=Texture("t", image), normal_texture=flat, alpha_mode="mask")
    faces = [[0, 1, 2], [0, 2, 3]]
    plant = Plant("p", corners, np.tile([0.0, 0, 1], (4, 1)), uvs, faces, [0, 0], (leaf,))
    camera = Camera(np.zeros(3), direction(20, 30), 3.0, 200.0, 64, 64, (32.0, 32.0), 2.0)
    shot = Shot(camera.view_projection(), camera.target, 64, 64)
    light = Light(direction=np.array([0.0, 0.0, 1.0]), sun=1.0, sky_above=0.0, sky_below=0.0)
    with PlantBuffers(plant, mipmaps=True) as buffers:
        picture = draw(buffers, shot, light, samples=4, anisotropy=anisotropy)
    assert np.isfinite(picture).all()
    inside = picture[..., 3] == 1
    assert inside.sum() > 1000
    np.testing.assert_allclose(picture[inside][:, :3], 1, atol=0.01)
