"""What a window puts over a picture, or beside it: the picture itself, text, a bar.

All of it goes into the framebuffer in use, in sRGB as it is shown. Sizes are told by the caller:
moderngl does not see that a window has been resized.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import moderngl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vegtool.arrays import ByteArray
from vegtool.gl.context import OnGpu
from vegtool.gl.program import program

Size = tuple[int, int]
"""Width and height in pixels."""

MARGIN = 4
"""Pixels of the font around the text."""
LETTERS = 200
"""Of a line, and lines, that are shown."""
BAR = 6
"""Pixels from the bar's lower to its upper side."""


def show(picture: moderngl.Texture, onto: moderngl.Framebuffer, size: Size) -> None:
    """Put a picture into a framebuffer of `size` pixels as it is, the mean of its samples where it
    is multisampled."""
    ctx = picture.ctx
    defines = ["MULTISAMPLED"] * bool(picture.samples)
    shader = program(ctx, "screen.vert", "window_show.frag", *defines)
    shader["samples"] = max(picture.samples, 1)
    onto.viewport = (0, 0, *size)
    onto.use()
    ctx.enable_only(moderngl.NOTHING)
    picture.use(0)
    _fill(shader)


def draw_bar(onto: moderngl.Framebuffer, size: Size, fraction: float) -> None:
    """A bar across the middle of a picture of `size` pixels, `fraction` of it full."""
    width, height = size
    left, bottom, across, tall = width // 8, height // 2, max(width * 3 // 4, 1), min(BAR, height)
    done = round(across * min(max(fraction, 0.0), 1.0))
    onto.clear(0.15, 0.15, 0.15, 1.0, viewport=(left, bottom, across, tall))
    if done:
        onto.clear(0.55, 0.75, 0.35, 1.0, viewport=(left, bottom, done, tall))


@dataclass(eq=False)
class Overlay(OnGpu):
    """Lines of text on a dark panel at the upper left of a picture.

    The letters are Pillow's own bitmap font of 6 x 11 pixels, which is monospace and asks for no
    font files: 0.1 ms for 8 lines, when the text changes, where its outline font takes 2 ms.
    """

    ctx: moderngl.Context
    text: str = ""
    _letters: moderngl.Texture | None = field(default=None, init=False)

    def write(self, text: str) -> bool:
        """Draw this text from now on; returns whether it is another than before."""
        if text == self.text:
            return False
        self.release()
        self.text = text
        return True

    def draw(self, onto: moderngl.Framebuffer, size: Size) -> None:
        """Draw over a framebuffer of `size` pixels that is in use."""
        if not self.text.strip():
            return
        if self._letters is None:
            image = letters(self.text)
            self._letters = self.ctx.texture(
                image.shape[::-1], 1, image[::-1].tobytes(), alignment=1
            )
        panel = self._letters.size
        scale = letter_scale(size, panel)
        corner = 0, size[1] - scale * panel[1]
        shader = program(self.ctx, "screen.vert", "window_text.frag")
        shader["scale"] = scale
        shader["corner"] = corner
        onto.viewport = (*corner, scale * panel[0], scale * panel[1])
        self.ctx.enable_only(moderngl.BLEND)
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._letters.use(0)
        _fill(shader)
        self.ctx.enable_only(moderngl.NOTHING)
        onto.viewport = (0, 0, *size)

    def release(self) -> None:
        """Free the letters on the GPU; they are made again when drawn."""
        if self._letters is not None:
            self._letters.release()
        self._letters = None


def letter_scale(size: Size, panel: Size) -> int:
    """Pixels of a picture per pixel of the font: two, more on large screens, fewer where the panel
    does not fit otherwise."""
    fits = min(size[0] // panel[0], size[1] // panel[1])
    return max(min(max(2, size[1] // 540), fits), 1)


def letters(text: str) -> ByteArray:
    """(h, w) uint8: 255 in letters, top row first; a question mark for what the font lacks."""
    font = ImageFont.load_default_imagefont()
    lines = [
        line[:LETTERS].encode("latin-1", "replace").decode("latin-1")
        for line in text.expandtabs(4).splitlines()[:LETTERS]
    ]
    width, height = (int(pixels) for pixels in font.getbbox("M")[2:])
    size = max(map(len, lines)) * width + 2 * MARGIN, len(lines) * height + 2 * MARGIN
    image = Image.new("L", size)
    pen = ImageDraw.Draw(image)
    for row, line in enumerate(lines):
        pen.text((MARGIN, MARGIN + row * height), line, fill=255, font=font)
    return np.asarray(image)


def _fill(shader: moderngl.Program) -> None:
    """Draw every pixel of the viewport."""
    corners = shader.ctx.vertex_array(shader, [])
    corners.render(moderngl.TRIANGLES, vertices=3)
    corners.release()
