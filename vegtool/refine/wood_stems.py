"""Wood as stems: tapered lines with surface and colour, whatever the level that draws them.

Rings and tubes are those of the branches room (branches/skeleton.py, tubes.py, join.py). A stem is
a tube's longest chain of rings; between two rings stands the surface of the faces there, so that
any part of a stem knows how much of it there is to draw. Where the lines bend is found once, for
every tolerance: Douglas and Peucker, "Algorithms for the reduction of the number of points required
to represent a digitized line" (1973), followed to the end, as a binary tree of spans.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.branches.axes import axes_of
from vegtool.branches.join import join_tubes
from vegtool.branches.parts import connected_parts
from vegtool.branches.skeleton import Skeleton, skeleton
from vegtool.branches.tubes import Tubes, cut_tubes
from vegtool.plant import Plant
from vegtool.refine.wood_color import face_colors

Ints = npt.NDArray[np.int64]

LEAST_RATIO, MOST_RATIO = 0.1, 10.0
"""Of a stretch's surface to that of a round taper between its rings."""


@dataclass(frozen=True, eq=False)
class Spans:
    """Stretches of stems between two nodes, s of them: whole stems, the two that halving one at its
    farthest node leaves, and so on to the end. What is halved comes before its halves.

    a, b: (s,) first and last node. middle: (s,) the node at which it is halved, -1 where none lies
    between. parent: (s,) what it is half of, -1 for a whole stem. deviation: (s,) how far surface
    between lies from a straight taper at most, in units of the stems.
    """

    a: Ints
    b: Ints
    middle: Ints
    parent: Ints
    deviation: FloatArray


@dataclass(frozen=True, eq=False)
class Stems:
    """The wood of a plant as stems, t of them, with n nodes, one stem's after the other's.

    Lengths are in units of `radius` metres about `center`, (3,) metres. node: (n, 3). girth: (n,)
    perimeter. area: (n,) surface between the node before and this one, 0 at a stem's first. color:
    (n, 4) linear, of that surface. stem: (n,). first, last: (t,) nodes. host: (t,) the stem it
    grows from, -1 for none. host_node, host_part: (t,) where: at that node of the host, or before
    it by (1 - part) of the way from the node before. spans: where the stems bend.
    """

    center: FloatArray
    radius: float
    node: FloatArray
    girth: FloatArray
    area: FloatArray
    color: FloatArray
    stem: Ints
    first: Ints
    last: Ints
    host: Ints
    host_node: Ints
    host_part: FloatArray
    spans: Spans

    def __len__(self) -> int:
        return len(self.first)


def stems_of(plant: Plant, faces: IntArray) -> Stems | None:
    """The stems of some faces of a plant, (k,) indices; None where they have no area."""
    faces = faces[plant.face_areas[faces] > 0]
    if not len(faces):
        return None
    used = plant.corners[faces].reshape(-1, 3)
    low, high = used.min(axis=0), used.max(axis=0)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2)
    vertices, corner = np.unique(plant.faces[faces], return_inverse=True)
    local = (plant.positions[vertices] - center) / radius
    parts = connected_parts(np.clip(local, -1, 1), corner.reshape(-1, 3).astype(np.int64))
    rings = skeleton(parts)
    tubes = cut_tubes(rings)
    ring, stem, place = chains(rings, tubes)
    node, girth = rings.center[ring], 2 * np.pi * rings.radius[ring]
    first, last = ends(stem)
    lonely = first == last
    if lonely.any():
        ring, stem, place, node, girth = stretched(
            rings, parts.positions, ring, stem, place, node, girth, first[lonely]
        )
        first, last = ends(stem)
    forked = np.flatnonzero(tubes.fork >= 0)
    girth[first[forked]] = girth[first[forked] + 1]

    owner = rings.vertex_ring[parts.faces]
    owner = place[owner[np.arange(len(faces)), rings.hop[owner].argmax(axis=1)]]
    owner = np.where(owner == first[stem[owner]], owner + 1, owner)
    face_area = plant.face_areas[faces] / radius**2
    area = np.bincount(owner, face_area, len(node))
    shown = face_colors(plant, faces)
    color = np.stack(
        [np.bincount(owner, face_area * shown[:, i], len(node)) for i in range(shown.shape[1])], 1
    )
    girth = true_girth(node, girth, area, stem)
    host, host_node, host_part = hosts(rings, tubes, place, node, stem, first, last)
    spans = halved(node, girth, first, last)
    return Stems(
        center, radius, node, girth, area, color, stem, first, last, host, host_node, host_part,
        spans,
    )  # fmt: skip


def ends(stem: Ints) -> tuple[Ints, Ints]:
    """First and last place of each of the stems that (n,) ordered labels tell."""
    count = np.bincount(stem)
    last = np.cumsum(count) - 1
    return last - count + 1, last


def chains(rings: Skeleton, tubes: Tubes) -> tuple[Ints, Ints, Ints]:
    """The longest chain of rings in each tube: (n,) rings and (n,) their tubes, tube by tube from
    its start on, after the ring of another that it forks from; and (r,) on which of these n each
    ring of the wood hangs."""
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
    ring = np.append(own, tubes.fork[forked])
    tube = np.append(tubes.ring_tube[own], forked)
    order = np.lexsort((rings.hop[ring], tube))
    ring, tube, is_own = ring[order], tube[order], order < len(own)
    place = np.full(len(rings.parent), -1)
    place[ring[is_own]] = np.flatnonzero(is_own)
    hangs = np.where(on_chain, np.arange(len(on_chain)), rings.parent)
    while not on_chain[hangs].all():
        hangs = np.where(on_chain[hangs], hangs, rings.parent[hangs])
    return ring, tube, place[hangs]


def stretched(
    rings: Skeleton,
    positions: FloatArray,
    ring: Ints,
    stem: Ints,
    place: Ints,
    node: FloatArray,
    girth: FloatArray,
    lonely: Ints,
) -> tuple[Ints, Ints, Ints, FloatArray, FloatArray]:
    """The chains, where those of one node, at places `lonely`, are given a second one: they reach
    from their farthest vertex through their middle and as far again."""
    away = np.linalg.norm(positions - rings.center[rings.vertex_ring], axis=1)
    order = np.lexsort((away, rings.vertex_ring))
    farthest = order[np.cumsum(np.bincount(rings.vertex_ring)) - 1]
    tip = positions[farthest[ring[lonely]]]
    node = node.copy()
    node[lonely] = 2 * node[lonely] - tip
    order = np.argsort(np.append(stem, stem[lonely]), kind="stable")
    new_place = np.empty(len(order), dtype=np.int64)
    new_place[order] = np.arange(len(order))
    return (
        np.append(ring, ring[lonely])[order],
        np.append(stem, stem[lonely])[order],
        new_place[place],
        np.concatenate([node, tip])[order],
        np.append(girth, girth[lonely])[order],
    )


def true_girth(node: FloatArray, girth: FloatArray, area: FloatArray, stem: Ints) -> FloatArray:
    """Girths (n,) that give the tapers between nodes the surface that stands there."""
    inner = stem[1:] == stem[:-1]
    length = np.linalg.norm(np.diff(node, axis=0), axis=1)
    taper = np.where(inner, (girth[1:] + girth[:-1]) / 2 * length, 0.0)
    before, after = np.append(0.0, taper), np.append(taper, 0.0)
    there = area + np.append(np.where(inner, area[1:], 0.0), 0.0)
    ratio = np.divide(there, before + after, out=np.ones_like(girth), where=before + after > 0)
    return np.asarray(girth * np.clip(ratio, LEAST_RATIO, MOST_RATIO))


def hosts(
    rings: Skeleton, tubes: Tubes, place: Ints, node: FloatArray, stem: Ints, first: Ints,
    last: Ints,
) -> tuple[Ints, Ints, FloatArray]:  # fmt: skip
    """(t,) each: the stem that a stem grows from, and where on it."""
    host = join_tubes(rings, tubes, axes_of(rings, tubes))
    host_node, host_part = np.full(len(host), -1), np.ones(len(host))
    forked = tubes.fork >= 0
    host_node[forked] = place[tubes.fork[forked]]
    joined = np.flatnonzero((host >= 0) & ~forked)
    size = (last - first)[host[joined]]
    child = np.repeat(joined, size)
    end = np.arange(len(child)) - np.repeat(np.cumsum(size) - size, size)
    end += first[host[child]] + 1
    line = node[end] - node[end - 1]
    square = np.maximum((line**2).sum(axis=1), np.finfo(float).tiny)
    part = ((node[first[child]] - node[end - 1]) * line).sum(axis=1) / square
    part = np.clip(part, 0, 1)
    gap = np.linalg.norm(node[end - 1] + part[:, None] * line - node[first[child]], axis=1)
    order = np.lexsort((gap, child))
    best = order[np.searchsorted(child[order], joined)]
    host_node[joined], host_part[joined] = end[best], part[best]
    return host, host_node, host_part


def halved(node: FloatArray, girth: FloatArray, first: Ints, last: Ints) -> Spans:
    """The spans of stems between their first and last nodes."""
    a, b, parent = first, last, np.full(len(first), -1)
    found = []
    count = 0
    while len(a):
        middle, deviation = farthest_between(node, girth, a, b)
        found.append((a, b, middle, parent, deviation))
        here = np.flatnonzero(middle >= 0)
        parent = np.repeat(here + count, 2)
        count += len(a)
        a, b = (
            np.stack([a[here], middle[here]], axis=1).ravel(),
            np.stack([middle[here], b[here]], axis=1).ravel(),
        )
    return Spans(*(np.concatenate(column) for column in zip(*found, strict=True)))


def farthest_between(
    node: FloatArray, girth: FloatArray, a: Ints, b: Ints
) -> tuple[Ints, FloatArray]:
    """(s,) the node between a and b whose surface is farthest from the straight taper between
    them, -1 where there is none, and how far, (s,)."""
    size = b - a - 1
    span = np.repeat(np.arange(len(a)), size)
    inner = np.arange(len(span)) - np.repeat(np.cumsum(size) - size, size) + a[span] + 1
    start, line = node[a][span], (node[b] - node[a])[span]
    square = np.maximum((line**2).sum(axis=1), np.finfo(float).tiny)
    part = np.clip(((node[inner] - start) * line).sum(axis=1) / square, 0, 1)
    bent = np.linalg.norm(node[inner] - start - part[:, None] * line, axis=1)
    taper = girth[a][span] * (1 - part) + girth[b][span] * part
    away = bent + np.abs(girth[inner] - taper) / (2 * np.pi)
    middle, deviation = np.full(len(a), -1), np.zeros(len(a))
    some = np.flatnonzero(size > 0)
    order = np.lexsort((away, span))
    best = order[np.cumsum(size[some]) - 1]
    middle[some], deviation[some] = inner[best], away[best]
    return middle, deviation
