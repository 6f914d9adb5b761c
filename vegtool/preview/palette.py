"""What plants are coloured by, and colours that are told apart."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from vegtool.srgb import linear_from_srgb

Color = Literal["as it is", "by level", "by species", "by overdraw"]
"""What plants are coloured by."""
COLORS: tuple[Color, ...] = get_args(Color)

_SRGB = np.array(
    [
        [230, 230, 230, 255], [204, 60, 40, 255], [222, 160, 24, 255], [60, 150, 60, 255],
        [50, 110, 200, 255], [140, 70, 170, 255], [40, 160, 160, 255], [200, 90, 140, 255],
        [120, 90, 50, 255], [90, 90, 110, 255],
    ],
    np.uint8,
)  # fmt: skip
PALETTE = np.concatenate(
    [np.rint(127.5 * linear_from_srgb(_SRGB[:, :3] / 255)), _SRGB[:, 3:]], axis=1
).astype(np.uint8)
"""(10, 4) tints, as gl.instances.INSTANCE has them."""
