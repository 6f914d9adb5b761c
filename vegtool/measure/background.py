"""What pictures are looked at over: one colour behind them, mixed in linear light."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, Picture, SingleArray
from vegtool.srgb import linear_from_srgb, srgb_from_linear

BACKGROUND = linear_from_srgb(np.array([0.47, 0.55, 0.63], np.float32))
"""(3,) linear: a dull sky, behind which neither light nor dark leaves vanish."""
BACKGROUND.flags.writeable = False


def over(picture: Picture, background: npt.ArrayLike = BACKGROUND) -> SingleArray:
    """A picture (h, w, 4) over a linear colour (3,): (h, w, 3) linear, 0 to 1."""
    behind = (1 - picture[..., 3:]) * np.asarray(background, np.float32)
    return np.asarray(np.clip(picture[..., :3] + behind, 0, 1))


def bytes_over(picture: Picture, background: npt.ArrayLike = BACKGROUND) -> ByteArray:
    """The same as an image (h, w, 3) uint8, sRGB."""
    return np.asarray((srgb_from_linear(over(picture, background)) * 255 + 0.5).astype(np.uint8))
