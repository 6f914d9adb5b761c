"""Flat ends of closed stems, as of a cylinder with caps.

Rings are counted from a loop that is open (branches/skeleton.py); from a corner of a cap they run
askew around a tube of few triangles, and its axis with them. Caps show next to nothing.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.branches.parts import Parts

LONG = 2.0
"""Times the spread across: parts that are shorter are no stems, and keep their ends."""
ACROSS = 0.8
"""Cosine, at least, between a cap's normal and the stem."""
NEAR = 0.05
"""Of a stem's length: no farther from its end is a cap."""
MOST = 0.2
"""Of a stem's surface: larger ends stay."""


def flat_ends(parts: Parts) -> npt.NDArray[np.bool_]:
    """(f,) bool: faces that close a part at its ends; parts that are open anywhere have none."""
    faces, owner, count = parts.faces, parts.face_part, parts.count
    ends = np.zeros(len(faces), dtype=bool)
    edge = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, first, uses = np.unique(
        edge[:, 0] * len(parts.positions) + edge[:, 1], return_index=True, return_counts=True
    )
    closed = np.ones(count, dtype=bool)
    closed[owner[first[uses == 1] // 3]] = False
    own = np.flatnonzero(closed[owner])
    if not len(own):
        return ends

    size = np.bincount(parts.vertex_part, minlength=count)
    middle = np.stack([np.bincount(parts.vertex_part, p, count) for p in parts.positions.T], axis=1)
    off = parts.positions - (middle / size[:, None])[parts.vertex_part]
    square = (off[:, :, None] * off[:, None]).reshape(-1, 9)
    spread = np.stack([np.bincount(parts.vertex_part, s, count) for s in square.T], axis=1)
    value, axes = np.linalg.eigh(spread.reshape(-1, 3, 3))
    axis = axes[:, :, 2]
    along = (off * axis[parts.vertex_part]).sum(axis=1)
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, parts.vertex_part, along)
    np.maximum.at(high, parts.vertex_part, along)

    part = owner[own]
    corner = parts.positions[faces[own]]
    vector = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(vector, axis=1)
    facing = np.abs((vector * axis[part]).sum(axis=1)) > ACROSS * area
    at, reach = along[faces[own]], NEAR * (high - low)[part]
    top = (at >= (high[part] - reach)[:, None]).all(axis=1)
    bottom = (at <= (low[part] + reach)[:, None]).all(axis=1)
    cap = facing & (top | bottom)
    share = np.bincount(part, area * cap, count) <= MOST * np.bincount(part, area, count)
    long = value[:, 2] >= LONG**2 * value[:, 1]
    ends[own] = cap & (share & long)[part]
    return ends
