"""Oriented boxes, one per cluster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, checked

MIN_EXTENT = 1e-3
"""Least extent of a side, as a fraction of the diagonal, where volumes are compared."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Oriented boxes, k of them.

    center: (k, 3) metres. axes: (k, 3, 3), rows are unit vectors, right-handed. half: (k, 3)
    metres, half extent along each axis; 0 for flat clusters. The axes run from the longest to the
    shortest; in boxes about a given plane the third is the plane's normal instead.
    """

    center: FloatArray
    axes: FloatArray
    half: FloatArray

    def __post_init__(self) -> None:
        center = checked("Boxes.center", self.center, (None, 3), np.float64)
        values = {
            "center": center,
            "axes": checked("Boxes.axes", self.axes, (len(center), 3, 3), np.float64),
            "half": checked("Boxes.half", self.half, (len(center), 3), np.float64),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.center)

    def volume(self, floor: FloatArray | float = 0.0) -> FloatArray:
        """(k,) cubic metres, no side taken shorter than `floor` metres (a scalar or (k,))."""
        return np.asarray(np.maximum(2 * self.half, np.reshape(floor, (-1, 1))).prod(axis=1))
