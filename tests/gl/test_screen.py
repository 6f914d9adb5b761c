"""What frames are drawn into, and pictures side by side."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from vegtool.arrays import ByteArray
from vegtool.errors import CapabilityError
from vegtool.gl.context import context, framebuffer_kept
from vegtool.gl.draw import MSAA
from vegtool.gl.panels import Panels
from vegtool.gl.screen import Screen
from vegtool.srgb import srgb_from_linear

pytestmark = pytest.mark.gl

VERTEX = """
#version 330 core
void main() {
    vec2 at[3] = vec2[](vec2(-0.9, -0.8), vec2(0.95, -0.3), vec2(-0.2, 0.9));
    gl_Position = vec4(at[gl_VertexID], 0.5, 1.0);
}
"""
FRAGMENT = """
#version 330 core
out vec4 pixel;
void main() { pixel = vec4(1.0, 0.25, 4.0, 1.0); }
"""
COLOR = np.array([1.0, 0.25, 4.0])
"""Of the triangle."""
BEHIND = (0.5, 0.1, 0.02)


def encoded(linear: np.ndarray) -> np.ndarray:
    return np.asarray(255 * srgb_from_linear(np.clip(linear, 0, 1)))


def triangle(screen: Screen, size: tuple[int, int]) -> ByteArray:
    """A frame of a triangle, read."""
    ctx = screen.ctx
    shader = ctx.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    array = ctx.vertex_array(shader, [])
    with framebuffer_kept(ctx):
        screen.begin(size, BEHIND)
        array.render(vertices=3)
        screen.resolve()
        found = screen.read()
    array.release()
    shader.release()
    return found


def covered(size: tuple[int, int], samples: int = 32) -> np.ndarray:
    """(h, w) share of each pixel, the top row first, in the triangle: counted at many places."""
    width, height = size
    x = (np.arange(width * samples) + 0.5) / (width * samples) * 2 - 1
    y = 1 - (np.arange(height * samples) + 0.5) / (height * samples) * 2
    corners = np.array([[-0.9, -0.8], [0.95, -0.3], [-0.2, 0.9]])
    inside = np.ones((len(y), len(x)), bool)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (bx - ax) * (y[:, None] - ay) - (by - ay) * (x - ax) > 0
    return inside.reshape(height, samples, width, samples).mean(axis=(1, 3))


def test_a_pixel_is_the_mean_of_its_samples_in_linear_light() -> None:
    """Inside and outside it is what was drawn; along an edge one of the five mixtures that four
    samples make, that of a share nearby. What is brighter than white is cut off after the mean."""
    size = (60, 40)
    with Screen(context()) as screen:
        found = triangle(screen, size)
    share = covered(size)
    assert np.abs(found[share == 1] - encoded(COLOR)).max() <= 1
    assert np.abs(found[share == 0] - encoded(np.array(BEHIND))).max() <= 1
    mixtures = [encoded(n / 4 * COLOR + (1 - n / 4) * np.array(BEHIND)) for n in range(5)]
    edge = (share > 0) & (share < 1)
    off = np.abs(found[edge][:, None] - np.array(mixtures)).max(axis=-1)
    assert off.min(axis=1).max() <= 1, "nothing but these"
    assert np.abs(off.argmin(axis=1) / 4 - share[edge]).max() < 0.4
    assert len({*off.argmin(axis=1).tolist()}) == 5


def test_samples_are_those_of_live_pictures() -> None:
    with framebuffer_kept(context()), Screen(context()) as screen:
        assert screen.samples == MSAA
        screen.begin((8, 8), BEHIND)
        assert screen.ctx.fbo.samples == MSAA


def test_any_size_one_after_another() -> None:
    """Down to a pixel, and sizes without pixels are one; the same size is the same picture."""
    with Screen(context()) as screen:
        first = triangle(screen, (33, 20))
        for size in ((1, 1), (1, 300), (300, 1), (0, 0), (64, 64)):
            shape = triangle(screen, size).shape
            assert shape == (max(size[1], 1), max(size[0], 1), 3)
            assert screen.size == (max(size[0], 1), max(size[1], 1))
        np.testing.assert_array_equal(triangle(screen, (33, 20)), first)


def test_another_size_while_it_is_in_use_is_no_error() -> None:
    with framebuffer_kept(context()), Screen(context()) as screen:
        for size in ((8, 8), (16, 8)):
            screen.begin(size, BEHIND)
            screen.resolve()
        assert screen.ctx.error == "GL_NO_ERROR"


def test_the_picture_is_what_is_read() -> None:
    """Lowest row first."""
    with Screen(context()) as screen:
        read = triangle(screen, (16, 9))
        held = np.frombuffer(screen.picture.read(), np.uint8).reshape(9, 16, 4)
    np.testing.assert_array_equal(held[::-1, :, :3], read)


def test_a_new_frame_has_nothing_of_the_last() -> None:
    with Screen(context()) as screen:
        triangle(screen, (16, 16))
        with framebuffer_kept(screen.ctx):
            screen.begin((16, 16), (0.0, 1.0, 0.0))
            screen.resolve()
            assert (screen.read() == [0, 255, 0]).all()


def test_what_a_driver_cannot_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    ctx = context()
    with pytest.raises(CapabilityError, match="64x multisampling"):
        Screen(ctx, samples=64)

    def refuse(*_: object) -> None:
        raise moderngl.Error("too large")

    with Screen(ctx) as screen, monkeypatch.context() as broken:
        broken.setattr(moderngl.Context, "framebuffer", refuse)
        with pytest.raises(CapabilityError, match="9 x 7 pixels"):
            screen.begin((9, 7), BEHIND)
    with Screen(ctx) as screen:
        assert triangle(screen, (9, 7)).any(), "afterwards too"


def test_releasing_frees() -> None:
    with Screen(context()) as screen:
        triangle(screen, (16, 16))
        held = screen.picture
    assert type(held.mglo).__name__ == "InvalidObject"
    assert screen.ctx.error == "GL_NO_ERROR"
    screen.release()


# -- panels ----------------------------------------------------------------------------------------


def panels_of(
    first: tuple[float, ...], second: tuple[float, ...], size: tuple[int, int]
) -> ByteArray:
    """Two colours and their difference."""
    ctx = context()
    part = (max(size[0] // 3, 1), size[1])
    with framebuffer_kept(ctx), Screen(ctx) as screen, Panels(ctx) as panels:
        for index, color in enumerate((first, second)):
            panels.begin(index, part, (color[0], color[1], color[2]))
            panels.end(index)
        screen.begin(size, (0.0, 0.0, 0.0))
        panels.show(size)
        screen.resolve()
        return screen.read()


@pytest.mark.parametrize("width", [60, 61, 62])
def test_two_pictures_and_their_difference_in_what_is_seen(width: int) -> None:
    """The difference is of sRGB, as an eye has it, and not of light."""
    one, other = np.array([0.5, 0.1, 0.02]), np.array([0.25, 0.2, 0.02])
    found = panels_of(tuple(one), tuple(other), (width, 10)).astype(int)
    parts = found[:, :20], found[:, 20:40], found[:, 40:60]
    shown = np.rint(encoded(one)), np.rint(encoded(other))
    for part, wanted in zip(parts, (*shown, np.abs(shown[0] - shown[1])), strict=True):
        assert np.abs(part - wanted).max() <= 1


def test_what_is_the_same_differs_by_nothing() -> None:
    found = panels_of(BEHIND, BEHIND, (30, 6))
    assert (found[:, 20:30] == 0).all()
    np.testing.assert_array_equal(found[:, :10], found[:, 10:20])


def test_panels_of_a_pixel() -> None:
    for size in ((1, 1), (2, 1), (3, 1), (1, 5)):
        assert panels_of(BEHIND, BEHIND, size).shape == (size[1], size[0], 3)
