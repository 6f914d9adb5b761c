"""Colour and normals carried out from what is covered, under alpha 0 and into the gutter.

Clients filter straight alpha: a black texel under alpha 0 darkens its neighbours, and more so in
every mip. Each uncovered texel takes the nearest covered one of its own picture, never a
neighbour's. One exact Euclidean distance transform a picture: 27 ms for 600 pictures on 772 x 932
texels, where one transform of the whole atlas takes 24 ms and mixes neighbours, and row and
column passes in numpy take 125 ms.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from vegtool.arrays import IntArray


def nearest_covered(
    covered: npt.NDArray[np.bool_], rect: IntArray, gutter: int
) -> npt.NDArray[np.int64]:
    """(h, w) int64: for each texel the flat index of the nearest covered one of its picture.

    covered: (h, w) bool. rect: (n, 4) texels as in Atlas; `gutter` texels around each belong to
    it. A covered texel, one outside all pictures, and one in an empty picture are their own.
    """
    own = np.arange(covered.size, dtype=np.int64).reshape(covered.shape)
    nearest = own.copy()
    low = np.maximum(rect[:, :2] - gutter, 0).tolist()
    high = (rect[:, :2] + rect[:, 2:] + gutter).tolist()
    for (x0, y0), (x1, y1) in zip(low, high, strict=True):
        part = np.s_[y0:y1, x0:x1]
        if covered[part].any():
            row, column = distance_transform_edt(
                ~covered[part], return_distances=False, return_indices=True
            )
            nearest[part] = own[part][row, column]
    return nearest
