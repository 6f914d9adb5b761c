"""Which squares of a landscape a client can ever refine.

Source: OGC 22-025r4, 3D Tiles 1.1, section 6.3: a tile's geometric error, seen from its box's
nearest point, is compared with a number of pixels; of more, clients go on to its children.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.tileset import CLIENT_PX
from vegtool.lod import Display
from vegtool.needs.planar import BoolArray
from vegtool.needs.viewers import Viewers


def refined(
    boxes: FloatArray,
    error_m: FloatArray,
    viewers: Viewers,
    display: Display,
    seen_px: FloatArray | float = CLIENT_PX,
) -> BoolArray:
    """(n,) whether clients may ever show the quarters of squares in place of them.

    boxes: (n, 2, 3) metres in the scene's frame, least and greatest corners. error_m: (n,) metres,
    geometric error. seen_px: pixels, of all or (n,), that clients take errors of as not seen.
    """
    near = viewers.nearest_to_boxes(np.asarray(boxes, np.float64))
    return np.asarray(error_m * display.pixels_per_metre(1.0) > seen_px * near)
