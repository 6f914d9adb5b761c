"""Groups of triangles made of about half as many, all at once (collapses.py).

So that one vertex does not spoil what its whole group is good for, none goes that costs much more
than the group's median one.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.surfels.collapses import Asks, Pass
from vegtool.surfels.sheets import Sheets, Triangles, runs, together

PASSES = 8
"""Most passes in which a group is halved."""

SPREAD = 1.5
"""Times the median: the displacement of the vertex that costs most in a group."""

LEAST = 2.0**-23
"""Plant radii: a displacement that is none, as float32 does not tell it."""


def halved(triangles: Triangles, sheets: Sheets, limit: FloatArray) -> tuple[Triangles, FloatArray]:
    """What is left of the triangles, sorted by group; and (g,) the most that one edge that has
    collapsed moved a group's surface.

    limit: (g,) plant radii, how far the vertices of each group may be displaced.
    """
    surplus = -(-np.bincount(triangles.group, minlength=len(limit)) // 4)  # each takes two along
    done, moves = [], np.zeros(len(limit))
    for nth in range(PASSES):
        if not len(triangles):
            break
        one = Pass(triangles, sheets)
        asks = one.asks()
        if nth == 0:
            limit = np.minimum(limit, _usual(asks, len(limit)))
        asks = one.winners(asks.of(asks.error <= limit[asks.group] ** 2), surplus)
        np.maximum.at(moves, asks.group, asks.moves)
        went = np.bincount(asks.group, minlength=len(limit))
        surplus = surplus - went
        more = (went > 0) & (surplus > 0)
        triangles = one.without(asks)
        done.append(triangles.of(~more[triangles.group]))
        triangles = triangles.of(more[triangles.group])
    left = together([*done, triangles])
    return left.of(np.argsort(left.group, kind="stable")), moves


def _usual(asks: Asks, groups: int) -> FloatArray:
    """(g,) the displacement of the vertex that costs most, by that of the median one."""
    order = np.lexsort((asks.error, asks.group))
    start = runs(asks.group[order])
    middle = start + np.diff(start, append=len(order)) // 2
    usual = np.zeros(groups)
    usual[asks.group[order[start]]] = SPREAD * np.sqrt(asks.error[order[middle]])
    return np.maximum(usual, LEAST)
