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

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.branches.axes import axes_of
from vegtool.branches.join import join_tubes
from vegtool.branches.parts import Parts, connected_parts, weld
from vegtool.branches.skeleton import skeleton
from vegtool.branches.tubes import cut_tubes
from vegtool.plant import Plant
from vegtool.refine.face_texels import face_colors
from vegtool.refine.wood_ends import flat_ends
from vegtool.refine.wood_lines import Ints, Lines, lines_of, taper_areas, uneven
from vegtool.refine.wood_lumps import Lump, Surface, lumps
from vegtool.refine.wood_seen import seen_through

LEAST_RATIO, MOST_RATIO = 0.1, 10.0
"""Of a stretch's surface to that of a round taper between its rings."""
ROUGH = 0.05
"""Of the radius: parts of the wood that are rougher are no stems,"""
MATTERS = 0.02
"""if they are so much of all wood's surface at least."""
FLAT = 0.6
"""Length of the sum of a stem's area vectors over the sum of their lengths: of a tube next to
nothing, of a sheet nearly one, of half a tube 0.64."""
FACES_PER_PART = 6
"""The least of a tube. Where parts have fewer on average, faces were parted from each other."""


@dataclass(frozen=True, eq=False)
class Spans:
    """Stretches of stems between two nodes, s of them: whole stems, the two that halving one at its
    farthest node leaves, and so on to the end. What is halved comes before its halves.

    a, b: (s,) first and last node. middle: (s,) the node at which it is halved, -1 where none lies
    between. parent: (s,) what it is half of, -1 for a whole stem. deviation: (s,) how far surface
    between lies from a straight taper at most, in units of the stems. rounds: where among the spans
    halves begin, halves of halves, and so on, and their end.
    """

    a: Ints
    b: Ints
    middle: Ints
    parent: Ints
    deviation: FloatArray
    rounds: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Solid:
    """Wood that is not round. stems: (m,) those of it. lumps: its surface with ever less
    triangles."""

    stems: Ints
    lumps: tuple[Lump, ...]


@dataclass(frozen=True, eq=False)
class Stems:
    """The wood of a plant as stems, t of them, with n nodes, one stem's after the other's.

    Lengths are in units of `radius` metres about `center`, (3,) metres.

    node: (n, 3). girth: (n,) perimeter. stem: (n,). first, last: (t,) nodes. Between the node
    before and this one, 0 at a stem's first:
    area: (n,) the surface, both sides of what is flat and seen from both. seen: (n,) as much of it
    as is not hidden. color: (n, 3) linear, times the surface. swing: (n, 3, 3) that times the side
    of the stem that it is on, unit vectors from the axis, the last index.

    host: (t,) the stem it grows from, -1 for none. host_node, host_part: (t,) where: at that part
    of the way to that node from the node before. rough: (t,) how far the wood lies from any taper,
    in the mean. facing: (t, 3) unit normal of what is flat, else 0. solids: what is not round.
    covered: what the whole plant covers, in the mean over all views.
    """

    center: FloatArray
    radius: float
    node: FloatArray
    girth: FloatArray
    stem: Ints
    first: Ints
    last: Ints
    area: FloatArray
    seen: FloatArray
    color: FloatArray
    swing: FloatArray
    host: Ints
    host_node: Ints
    host_part: FloatArray
    rough: FloatArray
    facing: FloatArray
    spans: Spans
    solids: tuple[Solid, ...]
    covered: float

    def __len__(self) -> int:
        return len(self.first)

    @property
    def flat(self) -> npt.NDArray[np.bool_]:
        """(t,)"""
        return np.asarray(self.facing.any(axis=1))


def stems_of(plant: Plant, faces: IntArray) -> Stems | None:
    """The stems of some faces of a plant, (k,) indices; None where they have no area."""
    others = np.setdiff1d(np.arange(len(plant.faces), dtype=np.int32), faces)
    faces = faces[plant.face_areas[faces] > 0]
    if not len(faces):
        return None
    used = plant.corners[faces].reshape(-1, 3)
    low, high = used.min(axis=0), used.max(axis=0)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2)
    parts = parts_of(plant, faces, center, radius)
    ends = flat_ends(parts)
    if ends.any():
        faces = faces[~ends]
        parts = parts_of(plant, faces, center, radius)
    rings = skeleton(parts)
    tubes = cut_tubes(rings)
    lines = lines_of(parts, rings, tubes)
    corners, color = parts.positions[parts.faces], face_colors(plant, faces)
    area, vector = plant.face_areas[faces] / radius**2, plant.face_area_vectors[faces] / radius**2
    rough, line = uneven(parts, rings, tubes), lines.line[lines.owner]

    surface = Surface(parts.positions, parts.faces, color, lines.node)
    solids, area = solids_of(surface, lines, parts.face_part, rings.part[tubes.start], area, rough)
    facing = facing_of(line, vector, len(rough))
    for solid in solids:
        facing[solid.stems] = 0.0
    two_sided = np.array([m.double_sided for m in plant.materials])[plant.face_material[faces]]
    area = np.where(np.asarray(facing.any(axis=1))[line] & two_sided, 2 * area, area)

    surfaces = np.bincount(lines.owner, area, len(lines.node)).astype(np.float64)
    light, swing = colors(lines, corners.mean(axis=1), color * area[:, None])
    girth = true_girth(lines, surfaces)
    share, covered_m2 = seen_through(plant, others, lines.node * radius + center)
    covered = covered_m2 / radius**2 + float(share @ surfaces) / 4
    first, last = lines.ends()
    return Stems(
        center, radius, lines.node, girth, lines.line, first, last,
        surfaces, share * surfaces, light, swing,
        *hosts(lines, join_tubes(rings, tubes, axes_of(rings, tubes))),
        rough, facing, halved(lines.node, girth, first, last), solids, covered,
    )  # fmt: skip


def solids_of(
    surface: Surface,
    lines: Lines,
    face_part: Ints,
    line_part: Ints,
    area: FloatArray,
    rough: FloatArray,
) -> tuple[tuple[Solid, ...], FloatArray]:
    """What is not round, and areas (f,) of all faces, where its are such that it covers a quarter
    of them, as what is round does."""
    solids = []
    for part in rough_parts(lines, area, rough, line_part):
        own = face_part == part
        covered, found = lumps(surface.of(own))
        if found:
            area = np.where(own, area * 4 * covered / area[own].sum(), area)
            solids.append(Solid(np.flatnonzero(line_part == part), found))
    return tuple(solids), area


def facing_of(line: Ints, vector: FloatArray, count: int) -> FloatArray:
    """(t, 3) mean normals of lines whose faces, with area vectors (f, 3), nearly all face one way;
    0 of others."""
    total = np.stack([np.bincount(line, v, count) for v in vector.T], axis=1)
    whole = np.bincount(line, np.linalg.norm(vector, axis=1), count)
    return unit(np.where((np.linalg.norm(total, axis=1) > FLAT * whole)[:, None], total, 0.0))


def parts_of(plant: Plant, faces: IntArray, center: FloatArray, radius: float) -> Parts:
    """The connected parts of faces, in units of the stems; of flat-shaded models, whose faces share
    no vertices, by position."""
    vertices, corner = np.unique(plant.faces[faces], return_inverse=True)
    local = np.clip((plant.positions[vertices] - center) / radius, -1, 1)
    corner = corner.reshape(-1, 3).astype(np.int64)
    parts = connected_parts(local, corner)
    if len(faces) < FACES_PER_PART * parts.count:
        parts = connected_parts(local, first_alike(weld(local))[corner])
    return parts


def first_alike(labels: Ints) -> Ints:
    """(n,) for each label the first place that has it."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.asarray(first[inverse])


def rough_parts(lines: Lines, area: FloatArray, rough: FloatArray, part: Ints) -> Ints:
    """Parts of the wood that are one tube, not round, and large enough to matter."""
    on_line = np.bincount(lines.line[lines.owner], area, len(rough))
    thick = np.bincount(lines.line, lines.girth) / np.bincount(lines.line) / (2 * np.pi)
    part_area = np.bincount(part, on_line)
    not_round = np.bincount(part, on_line * rough) > ROUGH * np.bincount(part, on_line * thick)
    alone = np.bincount(part) == 1  # what forks would have its thin arms collapsed first
    return np.flatnonzero(alone & not_round & (part_area > MATTERS * part_area.sum()))


def colors(lines: Lines, middle: FloatArray, color: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, 3) sums of colours (f, 3) of faces with their middles (f, 3), and (n, 3, 3) sums of each
    times the side of the line that it is on."""
    node, owner = lines.node, lines.owner
    axis = unit(node[owner] - node[owner - 1])
    away = middle - node[owner]
    side = unit(away - (away * axis).sum(axis=1)[:, None] * axis)
    total = np.stack([np.bincount(owner, c, len(node)) for c in color.T], axis=1).astype(float)
    swing = [[np.bincount(owner, c * d, len(node)) for d in side.T] for c in color.T]
    return total, np.moveaxis(np.array(swing), 2, 0)


def true_girth(lines: Lines, area: FloatArray) -> FloatArray:
    """Girths (n,) that give the tapers between nodes the surface that stands there, area (n,)."""
    girth, inner = lines.girth, lines.line[1:] == lines.line[:-1]
    length = np.where(inner, np.linalg.norm(np.diff(lines.node, axis=0), axis=1), 0.0)
    taper = taper_areas(girth, length)
    around = np.append(0.0, taper) + np.append(taper, 0.0)
    there = area + np.append(np.where(inner, area[1:], 0.0), 0.0)
    ratio = np.divide(there, around, out=np.ones_like(girth), where=around > 0)
    return np.asarray(girth * np.clip(ratio, LEAST_RATIO, MOST_RATIO))


def hosts(lines: Lines, host: Ints) -> tuple[Ints, Ints, FloatArray]:
    """(t,) each: the stem that a stem grows from, and where on it, nearest to its start."""
    node = lines.node
    first, last = lines.ends()
    host_node, host_part = np.full(len(host), -1), np.ones(len(host))
    joined = np.flatnonzero(host >= 0)
    size = (last - first)[host[joined]]
    child = np.repeat(joined, size)
    end = np.arange(len(child)) - np.repeat(np.cumsum(size) - size, size)
    end += first[host[child]] + 1
    step = node[end] - node[end - 1]
    square = np.maximum((step**2).sum(axis=1), np.finfo(float).tiny)
    part = np.clip(((node[first[child]] - node[end - 1]) * step).sum(axis=1) / square, 0, 1)
    gap = np.linalg.norm(node[end - 1] + part[:, None] * step - node[first[child]], axis=1)
    order = np.lexsort((gap, child))
    best = order[np.searchsorted(child[order], joined)]
    host_node[joined], host_part[joined] = end[best], part[best]
    return host, host_node, host_part


def halved(node: FloatArray, girth: FloatArray, first: Ints, last: Ints) -> Spans:
    """The spans of stems between their first and last nodes."""
    a, b, parent = first, last, np.full(len(first), -1)
    found, rounds = [], [0]
    while len(a):
        middle, deviation = farthest_between(node, girth, a, b)
        found.append((a, b, middle, parent, deviation))
        here = np.flatnonzero(middle >= 0)
        parent = np.repeat(here + rounds[-1], 2)
        rounds.append(rounds[-1] + len(a))
        a, b = (
            np.stack([a[here], middle[here]], axis=1).ravel(),
            np.stack([middle[here], b[here]], axis=1).ravel(),
        )
    a, b, middle, parent, deviation = (np.concatenate(c) for c in zip(*found, strict=True))
    return Spans(a, b, middle, parent, deviation, tuple(rounds[1:]))


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
