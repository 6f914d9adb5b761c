"""Pictures averaged and tiled on the GPU, against the plain mean of what was drawn."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from vegtool.errors import CapabilityError
from vegtool.gl import targets
from vegtool.gl.context import context, framebuffer_kept
from vegtool.gl.count import count_fragments
from vegtool.gl.draw import MSAA, Shot, begin, draw, render
from vegtool.gl.targets import drawing_target
from vegtool.gl.timing import time_frames
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Display
from vegtool.measure.views import Camera, around, direction
from vegtool.plant import Material, Plant

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def tree():
    with PlantBuffers(sample("broadleaf", 2000)) as buffers:
        yield buffers


def camera_of(buffers, pixels=40):
    """The whole plant about so many pixels high, in a picture of odd sides."""
    display, plant = Display(), buffers.plant
    extent = float(np.ptp(plant.positions, axis=0).max())
    return around(plant.positions, direction(25, 8), display.distance_m(pixels / extent), display)


def shot_of(camera):
    return Shot(camera.view_projection(), camera.target, camera.width, camera.height)


def picture_of(buffers, camera, **how):
    return draw(buffers, shot_of(camera), Light(), **how)


@pytest.mark.parametrize("k", [1, 3, 8])
def test_supersampling_is_the_mean_of_the_samples(tree, k):
    """The same drawing, read back whole and averaged by numpy; half floats in both."""
    camera = camera_of(tree)
    size = k * camera.width, k * camera.height
    large = drawing_target(tree.ctx, size, 0)
    with framebuffer_kept(tree.ctx):
        begin(large, size)
        render(tree, shot_of(camera), Light(), k)
        data = large.frame.read((0, 0, *size), components=4, dtype="f2")
    samples = np.frombuffer(data, np.float16).reshape(size[1], size[0], 4)[::-1].astype(np.float64)
    mean = samples.reshape(camera.height, k, camera.width, k, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(picture_of(tree, camera, supersample=k), mean, atol=1e-6)
    assert mean[..., 3].any()


@pytest.mark.parametrize("how", [{"supersample": 4}, {"samples": 4}], ids=["truth", "live"])
def test_a_picture_in_tiles_is_the_picture(tree, how, monkeypatch):
    """Where a target holds few samples, and where a driver's textures are narrow."""
    camera = camera_of(tree)
    whole = picture_of(tree, camera, **how)
    monkeypatch.setattr(targets, "SIDE", 20)
    tiled = picture_of(tree, camera, **how)
    # a tile's matrix is another one: a sample on an edge may fall to the other side
    assert np.mean(np.abs(tiled - whole).max(axis=2) > 1e-3) < 0.02


def test_targets_are_kept_and_grow(monkeypatch):
    monkeypatch.setattr(targets, "_kept", {})
    ctx = context()
    first = drawing_target(ctx, (100, 100), 0)
    assert drawing_target(ctx, (90, 40), 0) is first
    grown = drawing_target(ctx, (100, 300), 0)
    assert grown.color.size == (first.color.width, 384)
    assert type(first.color.mglo).__name__ == "InvalidObject", "the smaller one is freed"


def test_a_larger_picture_before_leaves_nothing_in_a_smaller_one(tree):
    small = camera_of(tree, 20)
    before = picture_of(tree, small, supersample=2)
    picture_of(tree, camera_of(tree, 60), supersample=2)
    np.testing.assert_array_equal(picture_of(tree, small, supersample=2), before)


def test_a_driver_that_cannot_multisample_is_named(tree, monkeypatch):
    monkeypatch.setattr(moderngl.Context, "max_samples", 1)
    with pytest.raises(CapabilityError, match="4x multisampling") as caught:
        picture_of(tree, camera_of(tree), samples=4)
    assert caught.value.exit_code == 5
    assert picture_of(tree, camera_of(tree), supersample=2).any(), "the truth needs none"


def test_a_driver_without_half_float_targets_is_named(tree, monkeypatch):
    def refuse(*_):
        raise moderngl.Error("the framebuffer is not complete")

    monkeypatch.setattr(targets, "_kept", {})
    monkeypatch.setattr(moderngl.Context, "framebuffer", refuse)
    with pytest.raises(CapabilityError, match="half-float"):
        picture_of(tree, camera_of(tree))


def test_a_normal_without_direction_is_lit_by_the_sky_alone():
    """Halfway between opposite normals there is none, of vertices or of a normal texture."""
    white = Material("white", base_color=[1.0, 1, 1, 1], double_sided=True)
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    faces = [[0, 1, 2], [0, 2, 3]]
    plate = Plant("plate", corners, np.zeros((4, 3)), np.zeros((4, 2)), faces, [0, 0], (white,))
    with PlantBuffers(plate) as buffers:
        light = Light(sun=1.0, sky_above=0.5, sky_below=0.25)
        picture = draw(buffers, shot_of(camera_of(buffers)), light)
    color = picture[..., :3][picture[..., 3] == 1]
    assert color.size
    np.testing.assert_allclose(color, (0.5 + 0.25) / 2, atol=1e-3)


def test_fragments_are_counted_whatever_hides_or_cuts_out(tree):
    """Two squares of 32 x 32 pixels, one behind the other, cut out everywhere; half seen, one."""
    leaf = Material("leaf", base_color=[1, 1, 1, 0.0], alpha_mode="mask", double_sided=True)
    both = Material("leaf", base_color=[1, 1, 1, 0.0], alpha_mode="mask")
    corner = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])  # the second faces away
    for material, counted in ((leaf, 2 * 32 * 32), (both, 32 * 32)):
        positions = np.concatenate([corner, corner])
        normals, uvs = np.tile([0.0, 0, 1], (8, 1)), np.zeros((8, 2))
        plant = Plant("squares", positions, normals, uvs, faces, [0] * 4, (material,))
        with PlantBuffers(plant) as buffers:
            camera = Camera(np.zeros(3), direction(0, 0), 10, 320, 64, 48, (32.0, 24.0), 2.0)
            assert count_fragments(buffers, shot_of(camera)) == counted


def test_frames_are_timed_as_often_as_asked(tree):
    seconds = time_frames(tree, shot_of(camera_of(tree)), Light(), MSAA, 5)
    assert seconds.shape == (5,) and (seconds > 0).all()
