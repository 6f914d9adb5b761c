"""What the camera draws into, kept from picture to picture.

Making a target costs more than drawing a small plant into it, so every context keeps one of each
kind, which grows when a larger picture is asked for and never holds more than SAMPLE_LIMIT.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl

from vegtool.errors import CapabilityError
from vegtool.gl.context import describe

SAMPLE_LIMIT = 4_000_000
"""Samples of a target, 12 bytes each; larger pictures are drawn tile by tile."""
STEP = 128
"""Samples: sides are multiples of it, so that pictures of about a size share a target."""


@dataclass(frozen=True, eq=False)
class Target:
    """A framebuffer of half-float colour and depth, or of float colour alone (`kind` "pixels")."""

    frame: moderngl.Framebuffer
    color: moderngl.Texture
    depth: moderngl.Renderbuffer | None

    def release(self) -> None:
        """Free it on the GPU."""
        self.frame.release()
        self.color.release()
        if self.depth is not None:
            self.depth.release()


_kept: WeakKeyDictionary[moderngl.Context, dict[int | None, Target]] = WeakKeyDictionary()


def drawing_target(ctx: moderngl.Context, size: tuple[int, int], samples: int) -> Target:
    """What is drawn into: at least `size` samples, `samples` of multisampling (0: none).

    Raises CapabilityError where the driver cannot multisample so.
    """
    if samples > ctx.max_samples:
        raise CapabilityError(
            f"pictures as a client shows them need {samples}x multisampling; "
            f"{describe(ctx).renderer} does {ctx.max_samples}x. Use a driver that can, such as "
            "Mesa 20.1 or newer."
        )
    return _target(ctx, size, samples)


def pixel_target(ctx: moderngl.Context, size: tuple[int, int]) -> Target:
    """What samples are averaged into: float colour of at least `size` pixels."""
    return _target(ctx, size, None)


def _target(ctx: moderngl.Context, size: tuple[int, int], samples: int | None) -> Target:
    kept = _kept.setdefault(ctx, {})
    target = kept.get(samples)
    if target is not None:
        width, height = target.color.size
        if width >= size[0] and height >= size[1]:
            return target
        both = max(width, size[0]), max(height, size[1])
        size = both if both[0] * both[1] <= SAMPLE_LIMIT else size
        kept.pop(samples).release()
    kept[samples] = _made(ctx, _rounded(size, describe(ctx).max_texture), samples)
    return kept[samples]


def _rounded(size: tuple[int, int], limit: int) -> tuple[int, int]:
    width, height = (min(-(-n // STEP) * STEP, limit) for n in size)
    return width, height


def _made(ctx: moderngl.Context, size: tuple[int, int], samples: int | None) -> Target:
    if samples is None:
        color = ctx.texture(size, 4, dtype="f4")
        return Target(ctx.framebuffer([color]), color, None)
    color = ctx.texture(size, 4, dtype="f2", samples=samples)
    if not samples:
        color.filter = (moderngl.NEAREST, moderngl.NEAREST)
    depth = ctx.depth_renderbuffer(size, samples=samples)
    return Target(ctx.framebuffer([color], depth), color, depth)
