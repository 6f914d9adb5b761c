"""One pass of edges that collapse, everywhere at once.

A vertex moves into a neighbour, and never elsewhere, so that all that is left are vertices of the
plant with their attributes. Its error is the mean squared distance from where it goes to the planes
of the triangles about it, by area (Garland, Heckbert: Surface simplification using quadric error
metrics, 1997); or how far the surface moves there, which is more at the end of a twig or where it
bends, as all planes run along it. What stays: what another group has too, what is held (sheets.py),
and where seams of the texture meet; a vertex on a seam moves along it. Every vertex asks for its
best edge, and those go whom no neighbour underbids.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.meshes.distance import to_triangles
from vegtool.surfels.faces import Faces
from vegtool.surfels.sheets import Flags, Labels, Sheets, Triangles, edge_keys, following, runs

TURN = 0.4
"""Cosine of the angle by which a triangle turns at most."""

SLIVER = 1e-3
"""Least height of a triangle, of its longest edge."""

TANGENTIAL = 1e-4
"""What moving along the surface counts, of what moving across it does, as squares: in planes the
shortest edges go first."""

EDGES = 3
"""Of each vertex that are tried, from the cheapest on, until one may collapse."""

CALLS = 2
"""How often those ask again who are not beside one that goes."""


@dataclass(frozen=True, eq=False)
class Asks:
    """Edges that may collapse, m of them.

    start, end: (m,) int64 vertices: which goes, and where. group: (m,) of the triangles about it.
    gone, kept: (2, m) int64 their corners in the edge's two triangles, either side of a seam.
    moves: (m,) how far the surface moves. error: (m,) squared, no less. cost: (m,) the least goes
    first.
    """

    start: Labels
    end: Labels
    group: Labels
    gone: Labels
    kept: Labels
    moves: FloatArray
    error: FloatArray
    cost: FloatArray

    def of(self, rows: Labels | Flags) -> Asks:
        """Some of them."""
        return Asks(
            self.start[rows], self.end[rows], self.group[rows], self.gone[:, rows],
            self.kept[:, rows], self.moves[rows], self.error[rows], self.cost[rows],
        )  # fmt: skip


class Pass:
    """Triangles before and after one pass. Vertices are those in use, v of them.

    own: (v,) group of each vertex that may go, and one of its groups else.
    """

    def __init__(self, triangles: Triangles, sheets: Sheets) -> None:
        self.triangles, self.normals = triangles, sheets.normals
        self.used, faces = np.unique(triangles.faces, return_inverse=True)
        self.faces, self.positions = faces.reshape(-1, 3), sheets.positions[self.used]
        self.corner = self.faces.ravel()
        self.count = len(self.used)
        a, b, c = (self.positions[self.faces[:, i]] for i in range(3))
        cross = np.cross(b - a, c - a)
        self.area, self.normal = np.linalg.norm(cross, axis=1), unit(cross)
        self.ground = Faces(self.positions[self.faces], triangles.group)
        self.own = np.zeros(self.count, np.int64)
        self.own[self.corner] = np.repeat(triangles.group, 3)
        self.slots = np.argsort(self.corner, kind="stable")
        self.first_slot = np.searchsorted(self.corner[self.slots], np.arange(self.count + 1))

        key = edge_keys(self.corner, self.corner[following(np.arange(len(self.corner)))])
        order = np.argsort(key, kind="stable")
        start = runs(key[order])
        two = start[np.diff(start, append=len(key)) == 2]
        one, other = order[two], order[two + 1]
        inside = triangles.group[one // 3] == triangles.group[other // 3]
        self.edges, self.inner = key[order[start]], np.stack([one[inside], other[inside]])
        outside = np.ones(len(key), bool)
        outside[self.inner] = False
        self.stays = sheets.held[self.used]
        self.stays[self.corner[outside]] = True
        self.stays[self.corner[following(np.flatnonzero(outside))]] = True

    def asks(self) -> Asks:
        """The best edge of each vertex that may go, where that may collapse."""
        start, end, gone, kept = self._along_seams()
        total = np.bincount(self.corner, np.repeat(self.area, 3), self.count)[start]
        way = self.positions[end] - self.positions[start]
        error = np.zeros(len(start))
        for i, j, times in ((0, 0, 1), (1, 1, 1), (2, 2, 1), (0, 1, 2), (0, 2, 2), (1, 2, 2)):
            part = np.repeat(self.area * self.normal[:, i] * self.normal[:, j], 3)
            tensor = np.bincount(self.corner, part, self.count)
            error += times * tensor[start] * way[:, i] * way[:, j]
        error = np.divide(np.maximum(error, 0), total, out=np.zeros(len(total)), where=total > 0)
        cost = error + TANGENTIAL * np.einsum("ni,ni->n", way, way)
        order = np.lexsort((cost, start))
        first = runs(start[order])
        many = np.diff(first, append=len(order))
        best, asking, moves = [], np.zeros(self.count, bool), np.zeros(len(start))
        for nth in range(EDGES):
            rows = order[first[many > nth] + nth]
            rows = rows[~asking[start[rows]]]
            away = self._away(start[rows], end[rows])
            rows, away = rows[away < np.inf], away[away < np.inf]
            moves[rows], error[rows] = away, np.maximum(error[rows], away**2)
            cost[rows] = np.maximum(cost[rows], away**2)
            asking[start[rows]] = True
            best.append(rows)
        edges = Asks(start, end, self.own[start], gone, kept, moves, error, cost)
        return edges.of(np.sort(np.concatenate(best)))

    def _along_seams(self) -> tuple[Labels, Labels, Labels, Labels]:
        """(m,), (m,) both ends of the edges along which vertices may go; (2, m), (2, m) their
        corners in the edge's two triangles, on either side of a seam."""
        one, other = self.inner
        ends = following(one), following(other)
        along = self.corner[one] == self.corner[other]
        near, far = np.where(along, other, ends[1]), np.where(along, ends[1], other)
        gone = np.concatenate([np.stack([one, near]), np.stack([ends[0], far])], axis=1)
        kept = np.concatenate([np.stack([ends[0], far]), np.stack([one, near])], axis=1)
        seam = self.triangles.seam.ravel()
        least, most = np.full(self.count, np.iinfo(np.int64).max), np.full(self.count, -1)
        np.minimum.at(least, self.corner, seam)
        np.maximum.at(most, self.corner, seam)
        between = (seam != least[self.corner]) & (seam != most[self.corner])
        stays = self.stays.copy()
        stays[self.corner[between]] = True
        start = self.corner[gone[0]]
        apart = seam[gone[0]] != seam[gone[1]]
        fits = np.where(least[start] == most[start], seam[kept[0]] == seam[kept[1]], apart)
        rows = np.flatnonzero(fits & ~stays[start])
        return start[rows], self.corner[kept[0, rows]], gone[:, rows], kept[:, rows]

    def _around(self, vertices: Labels) -> tuple[Labels, Labels]:
        """(k,), (k,) the corners at vertices (m,), and which of the vertices they are at."""
        first = self.first_slot[vertices]
        count = self.first_slot[vertices + 1] - first
        which = np.repeat(np.arange(len(vertices)), count)
        nth = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        return self.slots[first[which] + nth], which

    def _away(self, start: Labels, end: Labels) -> FloatArray:
        """(m,) how far vertices would be from what is left around them, or the middles of its new
        edges from what was; infinite where the surface would not stay one, or a triangle turn or
        thin too much."""
        at, which = self._around(start)
        after = following(at)
        left, right, goal = self.corner[after], self.corner[following(after)], end[which]
        key = edge_keys(left, goal)
        found = np.minimum(np.searchsorted(self.edges, key), len(self.edges) - 1)
        shared = (self.edges[found] == key) & (left != goal)
        stay = (left != goal) & (right != goal)
        fine = np.bincount(which, shared, len(start)) == 2
        a, b, c = (self.positions[v[stay]] for v in (goal, left, right))
        which, face = which[stay], at[stay] // 3
        cross = np.cross(b - a, c - a)
        twice = np.linalg.norm(cross, axis=1)
        longest = np.max([np.einsum("ni,ni->n", s, s) for s in (b - a, c - a, c - b)], axis=0)
        turned = np.einsum("ni,ni->n", cross, self.normal[face]) <= TURN * twice
        fine &= np.bincount(which, turned | (twice < SLIVER * longest), len(start)) == 0
        result = np.full(len(start), np.inf)
        rows = np.flatnonzero(fine[which])
        corners = np.stack([a[rows], b[rows], c[rows]], axis=1)
        off = to_triangles(self.positions[start[which[rows]]], corners)
        np.minimum.at(result, which[rows], off)

        edge = np.flatnonzero(fine[which] & ~shared[stay])
        was, of = self._around(start[which[edge]])
        back = self.ground.least((a[edge] + b[edge]) / 2, of, was // 3)
        np.maximum.at(result, which[edge], back)
        return result

    def winners(self, asks: Asks, most: Labels) -> Asks:
        """Those that collapse: no two start side by side, nor more in a group than `most` (g,)."""
        rank = np.full(self.count, self.count)
        rank[asks.start[np.argsort(asks.cost, kind="stable")]] = np.arange(len(asks.start))
        bid, goes = rank.copy(), np.zeros(self.count, bool)
        one, other = self.corner[self.inner[0]], self.corner[following(self.inner[0])]
        for _ in range(CALLS):
            least = np.full(self.count, self.count)
            np.minimum.at(least, one, bid[other])
            np.minimum.at(least, other, bid[one])
            goes |= bid < least
            bid[goes] = self.count
            bid[one[goes[other]]] = bid[other[goes[one]]] = self.count
        asks = asks.of(goes[asks.start])
        asks = asks.of(np.lexsort((rank[asks.start], asks.group)))
        first = runs(asks.group)
        nth = np.arange(len(asks.group)) - np.repeat(first, np.diff(first, append=len(asks.group)))
        return asks.of(nth < most[asks.group])

    def without(self, asks: Asks) -> Triangles:
        """The triangles after the edges have collapsed."""
        at, which = self._around(asks.start)
        goal = asks.end[which]
        falls = (self.faces[at // 3] == goal[:, None]).any(axis=1)
        left = np.ones(len(self.faces), bool)
        left[at[falls] // 3] = False
        at, which, goal = at[~falls], which[~falls], goal[~falls]
        corners, seam = (a.ravel().copy() for a in (self.triangles.corners, self.triangles.seam))
        gone, kept = asks.gone[:, which], asks.kept[:, which]
        # on the corner's side of a seam; if both are, with the normal that is most like its own
        own = self.normals[corners[at]]
        alike = [np.einsum("ni,ni->n", own, self.normals[corners[to]]) for to in kept]
        second = seam[at] == seam[gone[1]]
        second &= (seam[at] != seam[gone[0]]) | (alike[1] > alike[0])
        to = np.where(second, kept[1], kept[0])
        corners[at], seam[at] = corners[to], seam[to]
        faces = self.corner.copy()
        faces[at] = goal
        return Triangles(
            self.used[faces].reshape(-1, 3), corners.reshape(-1, 3), seam.reshape(-1, 3),
            self.triangles.group,
        ).of(left)  # fmt: skip
