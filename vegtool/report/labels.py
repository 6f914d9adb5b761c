"""Words beside points of a plot, where they cover the least.

Greedy, after Christensen, Marks and Shieber: An empirical study of algorithms for point-feature
label placement (1995): eight places around each point, the cheapest first come first served.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from vegtool.arrays import FloatArray

SIDES = ((1, 0), (1, 1), (1, -1), (0, 1), (0, -1), (-1, 0), (-1, 1), (-1, -1))
"""Right and up of the point, as the eye prefers them."""
LEFT = ((-1, 0),)
GAP = 6.0
"""Points (1/72 inch) from a point's middle to its words."""
LETTER = 0.6
"""Width of a letter over the font's size, about."""
DENSE = 4.0
"""Points between the places along a line that words should not cover."""

FREE = 0.9
"""Price below which a place covers nothing."""

Side = tuple[int, int]
Line = FloatArray
"""(n, 2) points of a line, in the data of the axes."""


class Labels:
    """The words of one panel, once its limits and its place on the figure are settled.

    lines: what words should leave free.
    """

    def __init__(self, axes: Axes, lines: Sequence[Line]) -> None:
        self._axes = axes
        self._taken = np.concatenate([_along(self._places(line)) for line in lines])
        low, high = axes.transAxes.transform([(0, 0), (1, 1)]) * 72 / axes.figure.dpi
        self._inside = np.array([low, high])
        self._boxes: list[FloatArray] = []

    def write(self, text: str, line: Line, size: float, color: str) -> None:
        """Write beside whichever point of a line has the most room."""
        self._write(text, line, size, color, SIDES, float("inf"))

    def write_if_free(
        self, text: str, line: Line, size: float, color: str, sides: Sequence[Side] = SIDES
    ) -> None:
        """The same, on some sides alone, and not over anything."""
        self._write(text, line, size, color, sides, FREE)

    def _write(
        self, text: str, line: Line, size: float, color: str, sides: Sequence[Side], most: float
    ) -> None:
        extent = np.array([LETTER * size * len(text), 1.1 * size])
        best = None
        for number, place in enumerate(self._places(line)):
            for rank, side in enumerate(sides):
                middle = place + np.array(side) * (GAP + extent / 2) * (0.85 if all(side) else 1.0)
                box = np.array([middle - extent / 2, middle + extent / 2])
                price = self._price(box) + 0.01 * rank
                if best is None or price < best[0]:
                    best = price, number, middle - place, box
        if best is None or best[0] > most:
            return
        _, number, offset, box = best
        self._boxes.append(box)
        self._axes.annotate(
            text,
            tuple(line[number]),
            tuple(offset),
            textcoords="offset points",
            ha="center",
            va="center_baseline",
            fontsize=size,
            color=color,
            zorder=5,
        )

    def _price(self, box: FloatArray) -> float:
        """How much of what is drawn lies under a box, and how much of it is outside the panel."""
        low, high = box
        covered = ((self._taken > low - 2) & (self._taken < high + 2)).all(axis=1).sum()
        over = sum(
            bool((np.minimum(high, other[1]) > np.maximum(low, other[0])).all())
            for other in self._boxes
        )
        outside = (low < self._inside[0]).any() or (high > self._inside[1]).any()
        return float(covered + 20 * over + 50 * outside)

    def _places(self, line: Line) -> FloatArray:
        """(n, 2) in points of the figure."""
        return np.asarray(self._axes.transData.transform(line) * 72 / self._axes.figure.dpi)


def _along(places: FloatArray) -> FloatArray:
    """(m, 2) points every few along a line (n, 2), its own among them."""
    found = [places]
    for a, b in pairwise(places):
        steps = max(int(np.linalg.norm(b - a) / DENSE), 1)
        found.append(a + (b - a) * (np.arange(steps)[:, None] / steps))
    return np.concatenate(found)
