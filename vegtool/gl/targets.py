"""What the camera draws into, kept from picture to picture.

Making a target costs more than drawing a small plant into it, so every context keeps one of each
kind. It grows with the largest picture asked for, up to SIDE; larger pictures are drawn in tiles.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import moderngl

from vegtool.errors import CapabilityError
from vegtool.gl.context import describe

SIDE = 2048
"""Samples along a side of the largest target: 50 MB without multisampling."""
STEP = 128
"""Samples: sides are multiples of it, so that pictures of about a size share a target."""


@dataclass(frozen=True, eq=False)
class Target:
    """A framebuffer of half-float colour and depth, or of float colour alone."""

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


def side(ctx: moderngl.Context) -> int:
    """Samples along a side that a target can have."""
    return min(SIDE, describe(ctx).max_texture)


def drawing_target(ctx: moderngl.Context, size: tuple[int, int], samples: int) -> Target:
    """What is drawn into: at least `size` samples, `samples` of multisampling (0: none).

    Raises CapabilityError where the driver cannot multisample so.
    """
    if samples > ctx.max_samples:
        raise CapabilityError(
            f"pictures as a client shows them need {samples}x multisampling; "
            f"{describe(ctx).renderer} does {ctx.max_samples}x. Use a driver that can, such as "
            "Mesa 20.2 or newer."
        )
    return _target(ctx, size, samples)


def pixel_target(ctx: moderngl.Context, size: tuple[int, int]) -> Target:
    """What samples are averaged into: float colour of at least `size` pixels."""
    return _target(ctx, size, None)


def _target(ctx: moderngl.Context, size: tuple[int, int], samples: int | None) -> Target:
    kept = _kept.setdefault(ctx, {})
    target = kept.get(samples)
    if target is not None:
        held = target.color.size
        if held[0] >= size[0] and held[1] >= size[1]:
            return target
        size = max(held[0], size[0]), max(held[1], size[1])
        kept.pop(samples).release()
    width, height = (min(-(-n // STEP) * STEP, side(ctx)) for n in size)
    kept[samples] = _made(ctx, (width, height), samples)
    return kept[samples]


def _made(ctx: moderngl.Context, size: tuple[int, int], samples: int | None) -> Target:
    if samples is None:
        color = ctx.texture(size, 4, dtype="f4")
        return Target(ctx.framebuffer([color]), color, None)
    try:
        color = ctx.texture(size, 4, dtype="f2", samples=samples)
        depth = ctx.depth_renderbuffer(size, samples=samples)
        frame = ctx.framebuffer([color], depth)
    except moderngl.Error as error:
        raise CapabilityError(
            f"{describe(ctx).renderer} cannot draw half-float pictures with {samples} samples a "
            f"pixel ({error}). Update the graphics driver, or use Mesa's."
        ) from error
    if not samples:
        color.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return Target(frame, color, depth)
