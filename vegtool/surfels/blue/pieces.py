"""What is long, in pieces: near ones need many surfels, far ones few.

Brandt et al.: Rendering of complex heterogenous scenes using progressive blue surfels (2019),
section 4.1, have as many surfels of an object as its nearest point asks for. Of a hedge, a wall or
a fence that goes on into the distance that is too many. Each piece is in progressive order as the
whole is: a part of space holds a part of every prefix.
"""

from __future__ import annotations

import numpy as np

from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.distances import spacing

LONGEST = 3.0
"""Times its second longest side, that the longest of a piece's bounds is at most, nearly."""
FEWEST = 1_000
"""Surfels of a piece: what would have fewer is not cut any further."""


def pieces(surfels: SurfelSet) -> tuple[SurfelSet, ...]:
    """The surfels, in parts that are not long; the set itself, where it is not."""
    size = np.diff(surfels.bounds, axis=0)[0]
    axis = int(size.argmax())
    _, second, longest = np.sort(size)
    if len(surfels) < 2 * FEWEST or longest <= LONGEST * second:
        return (surfels,)
    along = surfels.position[:, axis]
    beyond = along > surfels.bounds[:, axis].mean()
    halves = [np.flatnonzero(~beyond), np.flatnonzero(beyond)]
    if min(len(rows) for rows in halves) < FEWEST:
        return (surfels,)
    return tuple(
        piece
        for rows in halves
        for piece in pieces(surfels.of(rows, spacing(surfels.position[rows])))
    )
