"""The lines that wood follows, and which of its surface stands on which stretch of them.

A tube of the branches room is one line, through the middles of its rings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.branches.parts import Parts
from vegtool.branches.skeleton import Skeleton
from vegtool.branches.tubes import Tubes

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Lines:
    """t lines with n nodes, one's after the other's, each with two or more.

    node: (n, 3). girth: (n,) perimeter. line: (n,) of each node. owner: (f,) of each face, the
    node that ends the stretch on which it stands; never a line's first.
    """

    node: FloatArray
    girth: FloatArray
    line: Ints
    owner: Ints

    def ends(self) -> tuple[Ints, Ints]:
        """(t,) the first and the last node of each line."""
        return ends(self.line)


def ends(line: Ints) -> tuple[Ints, Ints]:
    """First and last place of each of the lines that ordered labels (n,) tell, dense from 0."""
    count = np.bincount(line)
    last = np.cumsum(count) - 1
    return last - count + 1, last


def taper_areas(girth: FloatArray, length: FloatArray) -> FloatArray:
    """(n - 1,) surfaces of round tapers between girths (n,), each as long as `length`, (n - 1,)."""
    slant = np.hypot(length, np.diff(girth) / (2 * np.pi))
    return np.asarray((girth[1:] + girth[:-1]) / 2 * np.where(length > 0, slant, 0.0))


def lines_of(parts: Parts, rings: Skeleton, tubes: Tubes) -> Lines:
    """One line for each tube: the longest chain of its rings, after the ring of another that it
    forks from; where it has but one ring, from that ring's farthest vertex to the other side."""
    order = np.lexsort((tubes.along, tubes.ring_tube))
    walk = order[np.cumsum(np.bincount(tubes.ring_tube, minlength=len(tubes))) - 1]
    starts = np.zeros(len(rings.parent), dtype=bool)
    starts[tubes.start] = True
    on_chain = starts.copy()
    while len(walk):
        on_chain[walk] = True
        walk = rings.parent[walk[~starts[walk]]]
    own = np.flatnonzero(on_chain)
    forked = np.flatnonzero(tubes.fork >= 0)
    alone = np.flatnonzero(
        (np.bincount(tubes.ring_tube[own], minlength=len(tubes)) == 1) & (tubes.fork < 0)
    )
    tip = parts.positions[_farthest(parts, rings)[tubes.start[alone]]]
    node = np.concatenate([rings.center[own], rings.center[tubes.fork[forked]], tip])
    like = np.concatenate([own, tubes.start[forked], tubes.start[alone]])
    hop = np.concatenate([rings.hop[own], np.full(len(forked), -1), rings.hop[tubes.start[alone]]])
    middle = np.searchsorted(own, tubes.start[alone])
    node[middle] = 2 * node[middle] - tip

    line = tubes.ring_tube[like]
    order = np.lexsort((hop, line))
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    hangs = np.where(on_chain, np.arange(len(on_chain)), rings.parent)
    while not on_chain[hangs].all():
        hangs = np.where(on_chain[hangs], hangs, rings.parent[hangs])
    corner = rings.vertex_ring[parts.faces]
    outermost = corner[np.arange(len(corner)), rings.hop[corner].argmax(axis=1)]
    owner = place[np.searchsorted(own, hangs[outermost])]
    line = line[order]
    first, _ = ends(line)
    owner = np.where(owner == first[line[owner]], owner + 1, owner)
    return Lines(node[order], 2 * np.pi * rings.radius[like][order], line, owner)


def _farthest(parts: Parts, rings: Skeleton) -> Ints:
    """(r,) each ring's vertex that is farthest from its middle."""
    away = np.linalg.norm(parts.positions - rings.center[rings.vertex_ring], axis=1)
    order = np.lexsort((away, rings.vertex_ring))
    return np.asarray(order[np.cumsum(np.bincount(rings.vertex_ring)) - 1])


def uneven(parts: Parts, rings: Skeleton, tubes: Tubes) -> FloatArray:
    """(t,) how much the vertices of a tube's rings differ in their distance from the middle, in the
    mean; of a generator's tube nothing."""
    away = np.linalg.norm(parts.positions - rings.center[rings.vertex_ring], axis=1)
    differ = np.abs(away - rings.radius[rings.vertex_ring])
    tube = tubes.ring_tube[rings.vertex_ring]
    return np.asarray(np.bincount(tube, differ) / np.bincount(tube))
