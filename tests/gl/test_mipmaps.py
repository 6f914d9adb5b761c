"""Mip levels against plain averages, and the filter that reads them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.gl.draw import Light, Shot, draw
from vegtool.gl.mipmaps import mip_levels
from vegtool.gl.upload import PlantBuffers
from vegtool.measure.views import Camera, direction
from vegtool.plant import Material, Plant, Texture
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
