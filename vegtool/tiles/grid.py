"""Samples on a regular grid over a rectangle, and what lies between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, SingleArray, checked


@dataclass(frozen=True, eq=False)
class Grid:
    """A function over a rectangle about the scene's origin, bilinear between samples.

    values: (rows, columns) float32, at least 2 x 2; rows run along +z, so that the first is the
    northern one, columns along +x. The outermost samples lie on the border of the rectangle.
    extent: (2,) float64 metres along x and z.
    Beyond the border, values are those of the border.
    """

    values: SingleArray
    extent: FloatArray

    def __post_init__(self) -> None:
        values = checked("Grid.values", self.values, (None, None), np.float32)
        if min(values.shape) < 2:
            raise ValueError(f"Grid.values: expected at least 2 x 2 samples, got {values.shape}")
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "extent", checked("Grid.extent", self.extent, (2,), np.float64))

    @property
    def step(self) -> FloatArray:
        """(2,) metres between samples along x and z."""
        rows, columns = self.values.shape
        return np.asarray(self.extent / (columns - 1, rows - 1))

    def at(self, xz: FloatArray) -> FloatArray:
        """(n,) values at points (n, 2)."""
        (u, v), (a, b, c, d) = self._cells(xz)
        above = a + u * (b - a)
        return np.asarray(above + v * (c + u * (d - c) - above))

    def gradient(self, xz: FloatArray) -> FloatArray:
        """(n, 2) change of the value per metre along x and z, of the cell that a point lies in."""
        (u, v), (a, b, c, d) = self._cells(xz)
        along_x, along_z = b - a + v * (d - c - b + a), c - a + u * (d - c - b + a)
        return np.stack([along_x, along_z], axis=-1) / self.step

    def extremes(self, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds, (b, a) each, of the values within x[i] and z[j]; x: (a, 2), z: (b, 2) metres.

        A bilinear cell is least and greatest at its corners, so those of all cells that a
        rectangle touches hold for it.
        """
        rows, columns = self.values.shape
        across = _spans(x / self.step[0] + (columns - 1) / 2, columns)
        along = _spans(z / self.step[1] + (rows - 1) / 2, rows)
        found = []
        for least in (np.minimum, np.maximum):
            part = least.reduceat(_padded(self.values, 1), across, axis=1)[:, ::2]
            part = least.reduceat(_padded(part, 0), along, axis=0)[::2]
            found.append(part.astype(np.float64))
        return found[0], found[1]

    def _cells(self, xz: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        """Where in its cell a point lies, (2, n), and the values (n,) at the cell's corners."""
        rows, columns = self.values.shape
        most = np.array([columns - 1, rows - 1], dtype=np.float64)
        place = np.clip(np.asarray(xz) / self.step + most / 2, 0.0, most).T
        cell = np.minimum(place.astype(np.int64), (most - 1).astype(np.int64)[:, None])
        flat = self.values.ravel()
        first = cell[1] * columns + cell[0]
        corners = tuple(flat[first + k].astype(np.float64) for k in (0, 1, columns, columns + 1))
        return place - cell, corners


def _spans(place: FloatArray, count: int) -> np.ndarray:
    """First sample and the one after the last of each interval (a, 2), for reduceat: (2a,)."""
    first = np.clip(np.floor(place[:, 0]), 0, count - 1)
    last = np.clip(np.ceil(place[:, 1]), 0, count - 1)
    return np.stack([first, last + 1], axis=1).astype(np.int64).ravel()


def _padded(values: SingleArray, axis: int) -> SingleArray:
    """One more row or column, the last again: reduceat takes no index past the end."""
    return np.concatenate([values, np.take(values, [-1], axis=axis)], axis=axis)
