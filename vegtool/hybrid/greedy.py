"""Which faces leave their billboards for the mesh: greedy descent of the cost.

"Hybrid billboard clouds" (sketch), section 2: "For each billboard, a hybrid is proposed in which it
is replaced by the model polygons that it covers. The hybrid is then subjected to mesh
simplification. If no proposed hybrid lowers the cost, we stop. Otherwise, we accept the best
proposed hybrid and repeat." Two proposals are made for each: all of its faces; and those connected
parts of them alone that are cheaper as triangles, so that a trunk leaves without the leaves that
lie on the same plane. Planes cut a branch into strips, of which none is worth it alone: so one more
is made for each connected body of the model, of all its faces that billboards show. What alpha
cuts out stays on billboards: its outline is in a texture, which no edge collapse knows of.

The cost is a sum over billboards and over connected parts of the mesh, so that a step changes few
of its terms, and most proposals stay as they are. They wait in order of what they save, and are
looked at again when their turn comes (lazy evaluation; Minoux 1978).

The poster's form looks at the billboard that costs most alone, then, where that saves nothing, at
the next, until none is left.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.clustering.features import Labels
from vegtool.hybrid.cloud import Cloud
from vegtool.hybrid.cost import PER_BILLBOARD, Terms
from vegtool.hybrid.options import Weights
from vegtool.hybrid.reduction import Borders, Reductions, reductions
from vegtool.meshes.pieces import Surface, pieces
from vegtool.progress import Progress, silent

SMALL = 24
"""Faces: what is connected to fewer is no body of its own, but one with all others like it."""
LEAST = 1e-12
"""Of the cost: a step that saves less is none."""


@dataclass(frozen=True)
class Step:
    """After so many steps: billboards, triangles of all, terms, cost, and seconds since the
    start."""

    billboards: int
    triangles: int
    terms: Terms
    cost: float
    seconds: float


@dataclass(frozen=True, eq=False)
class Part:
    """A connected part of the mesh: its faces, (n,), and what is drawn of them: the surface, and
    (n, 3) what has become of their corners."""

    faces: Labels
    surface: Surface
    became: IntArray
    terms: Terms


@dataclass(frozen=True, eq=False)
class Proposal:
    """Faces that leave for the mesh; the parts that they become, with those that they join (by
    number); the terms that change."""

    faces: Labels
    parts: tuple[Part, ...]
    joined: tuple[int, ...]
    change: Terms


class Descent:
    """A hybrid on its way down: which faces are in the mesh, and in which parts of it."""

    def __init__(
        self,
        cloud: Cloud,
        welded: Surface,
        extents: FloatArray,
        weights: Weights,
        per_billboard: int = PER_BILLBOARD,
        known: dict[bytes, Reductions] | None = None,
    ) -> None:
        """welded: all faces, (f, 3), by places that they share. extents: (q, 4) radii, least and
        greatest along the two sides of the billboard, of each pair's face. per_billboard: its
        triangles. known: reductions that were made before, to which others are added."""
        self.cloud, self.welded, self.extents, self.weights = cloud, welded, extents, weights
        self.per_billboard = per_billboard
        count = len(cloud.plant.faces)
        self.total = float(welded.areas.sum()) or 1.0
        self.wrong = cloud.wrong * welded.areas / self.total
        self.part_of = np.full(count, -1, dtype=np.int64)
        self.parts: dict[int, Part] = {}
        self.place_part = np.full(len(welded.positions), -1, dtype=np.int64)
        self._next = 0
        self.known = {} if known is None else known
        ends = np.searchsorted(cloud.plane, np.arange(len(cloud.normal) + 1))
        self.pairs = [np.arange(a, b) for a, b in pairwise(ends)]
        by_face = np.argsort(cloud.face, kind="stable")
        self._planes = cloud.plane[by_face]
        self._first = np.searchsorted(cloud.face[by_face], np.arange(count + 1))
        self.board = [self.billboard(pairs) for pairs in self.pairs]
        cut_out = np.array([m.alpha_mode == "mask" for m in cloud.plant.materials])
        self.solid = ~cut_out[cloud.plant.face_material]
        self.uses = np.bincount(welded.faces.ravel(), minlength=len(welded.positions))
        self.bodies = self.connected(np.flatnonzero(self.solid))
        self.terms = sum(self.board, Terms(float(self.wrong.sum())))

    def again(self, weights: Weights) -> Descent:
        """From the start, with other weights; what is known stays so."""
        return Descent(
            self.cloud, self.welded, self.extents, weights, self.per_billboard, self.known
        )

    def copy(self) -> Descent:
        """As it is now: what further steps change is its own."""
        made = copy(self)
        made.pairs, made.board, made.parts = list(self.pairs), list(self.board), dict(self.parts)
        made.part_of, made.place_part = self.part_of.copy(), self.place_part.copy()
        return made

    @property
    def triangles(self) -> int:
        """Of billboards and mesh."""
        boards = sum(1 for pairs in self.pairs if len(pairs))
        return self.per_billboard * boards + sum(len(p.surface.faces) for p in self.parts.values())

    @property
    def in_mesh(self) -> np.ndarray:
        """(f,) bool."""
        return self.part_of >= 0

    def billboard(self, pairs: Labels) -> Terms:
        """Polygons and fill of a billboard that shows these pairs."""
        if not len(pairs):
            return Terms()
        low = self.extents[pairs, 0::2].min(axis=0)
        high = self.extents[pairs, 1::2].max(axis=0)
        area = float(np.prod(high - low))
        return Terms(0.0, self.per_billboard / len(self.part_of), area / self.total)

    @property
    def sources(self) -> int:
        """How many proposals are made for something: billboards, then bodies."""
        return len(self.pairs) + len(self.bodies)

    def proposals(self, source: int) -> Iterator[Proposal]:
        """All faces of a billboard, and those that are worth it; or what billboards show of a
        body."""
        if source >= len(self.pairs):
            own = self.bodies[source - len(self.pairs)]
            own = own[self.part_of[own] < 0]
            if len(own):
                yield self.proposal(own)
            return
        faces = self.shown_by(source)
        if not len(faces):
            return
        yield self.proposal(faces)
        better = self.better_alone(faces)
        if 0 < len(better) < len(faces):
            yield self.proposal(better)

    def shown_by(self, plane: int) -> Labels:
        """The faces of a billboard that may leave it."""
        faces = self.cloud.face[self.pairs[plane]].astype(np.int64)
        return np.asarray(faces[self.solid[faces]])

    def better_alone(self, faces: Labels) -> Labels:
        """Those in connected parts that cost less as triangles than on billboards, of no thought
        for what these are made of else."""
        kept = []
        for own in self.connected(faces):
            error = float(self.wrong[own].sum())
            if self.part(own).terms.cost(self.weights) < self.weights.error * error:
                kept.append(own)
        return np.sort(np.concatenate(kept)) if kept else faces[:0]

    def proposal(self, faces: Labels) -> Proposal:
        """What becomes of faces that leave for the mesh."""
        touched = np.unique(self.place_part[self.welded.faces[faces]])
        joined = tuple(int(number) for number in touched[touched >= 0])
        together = np.concatenate([faces, *(self.parts[number].faces for number in joined)])
        parts = tuple(self.part(own) for own in self.connected(np.sort(together)))
        change = Terms(-float(self.wrong[faces].sum()))
        change = sum((part.terms for part in parts), change)
        for number in joined:
            change = change - self.parts[number].terms
        for plane, left in self.left(faces):
            change = change + self.billboard(left) - self.board[plane]
        return Proposal(faces, parts, joined, change)

    def refinements(self, number: int) -> Iterator[Proposal]:
        """A part of the mesh with each number of triangles that it may have."""
        old = self.parts[number]
        for part in self.choices(old.faces):
            yield Proposal(part.faces[:0], (part,), (number,), part.terms - old.terms)

    def left(self, faces: Labels) -> Iterator[tuple[int, Labels]]:
        """The billboards that show any of these faces, and the pairs that they are left with."""
        gone = np.zeros(len(self.part_of), dtype=bool)
        gone[faces] = True
        first, count = self._first[faces], self._first[faces + 1] - self._first[faces]
        nth = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
        for plane in np.unique(self._planes[np.repeat(first, count) + nth]):
            pairs = self.pairs[plane]
            yield int(plane), pairs[~gone[self.cloud.face[pairs]]]

    def connected(self, faces: Labels) -> list[Labels]:
        """Faces, (n,) in order, in parts that share places; all that are SMALL as one part."""
        if not len(faces):
            return []
        count, piece = pieces(self.welded.faces[faces])
        size = np.bincount(piece, minlength=count)
        group = np.where(size[piece] < SMALL, -1, piece)
        order = np.argsort(group, kind="stable")
        ends = np.flatnonzero(np.diff(group[order], prepend=-2))
        return np.split(faces[order], ends[1:])

    def part(self, faces: Labels) -> Part:
        """A part of the mesh, with as many triangles as cost least."""
        return min(self.choices(faces), key=lambda part: part.terms.cost(self.weights))

    def choices(self, faces: Labels) -> list[Part]:
        """A part of the mesh, with each number of triangles that it may have."""
        found = self.reduced(faces)
        area, count = found.area / self.total, len(self.part_of)
        return [
            Part(faces, surface, became, Terms(float(e) / self.total, float(t) / count, float(a)))
            for surface, became, e, t, a in zip(
                found.surfaces, found.became, found.wrong, found.triangles, area, strict=True
            )
        ]

    def reduced(self, faces: Labels) -> Reductions:
        """The reductions of a part, each made once. Borders stay while they can, or else a trunk
        would be without its foot; where nothing else shares them, straight ones are reduced then.
        Those of what is SMALL may go at once, since many a leaf is all border."""
        key = faces.tobytes()
        if key not in self.known:
            surface = self.surface(faces)
            places, uses = np.unique(surface.faces, return_counts=True)
            complete = bool((self.uses[places] == uses).all())
            small = bool(np.bincount(pieces(surface.faces)[1]).max() < SMALL)
            borders: tuple[Borders, ...] = ("stay",)
            if complete:
                borders = ("free",) if small else ("stay", "skirted")
            self.known[key] = reductions(surface, self.cloud.reach, borders)
        return self.known[key]

    def surface(self, faces: Labels) -> Surface:
        """Some faces as they are."""
        own = self.welded
        return Surface(own.positions, own.faces[faces], own.corners[faces])

    def accept(self, made: Proposal) -> None:
        """Take a step."""
        for plane, left in list(self.left(made.faces)):
            self.pairs[plane], self.board[plane] = left, self.billboard(left)
        for number in made.joined:
            del self.parts[number]
        for part in made.parts:
            self.parts[self._next] = part
            self.part_of[part.faces] = self._next
            self.place_part[self.welded.faces[part.faces]] = self._next
            self._next += 1
        self.terms = self.terms + made.change


def descent(start: Descent, cheap: bool = False, progress: Progress = silent) -> Iterator[Step]:
    """Steps down to where no proposal saves anything; `start` is changed. cheap: as the poster."""
    began = perf_counter()
    yield _step(start, began)
    if cheap:
        yield from _costliest(start, began)
        return
    waiting: list[tuple[float, int, int]] = []
    latest: dict[int, Proposal] = {}

    def look(source: int, version: int) -> None:
        offers = list(start.proposals(source))
        if offers:
            best = min(offers, key=lambda one: one.change.cost(start.weights))
            latest[source] = best
            heapq.heappush(waiting, (best.change.cost(start.weights), source, version))

    for source in range(start.sources):
        progress("proposals", source / start.sources)
        look(source, 0)
    version, idle = 0, list[tuple[float, int, int]]()
    while waiting:
        change, source, seen = offer = heapq.heappop(waiting)
        if seen < version:  # something has changed since
            look(source, version)
        elif change >= -LEAST * start.terms.cost(start.weights):
            idle.append(offer)  # until something changes: what saved nothing before may do so now
        else:
            start.accept(latest[source])
            version += 1
            yield _step(start, began)
            look(source, version)
            while idle:
                heapq.heappush(waiting, idle.pop())


def _costliest(start: Descent, began: float) -> Iterator[Step]:
    """One step after the other, each of the costliest billboard that any is for. A billboard for
    which there was none is not looked at again."""
    asked = [bool(len(start.shown_by(plane))) for plane in range(len(start.pairs))]
    while any(asked):
        costs = [
            board.cost(start.weights)
            + start.weights.error * float(start.wrong[start.cloud.face[pairs]].sum())
            for board, pairs in zip(start.board, start.pairs, strict=True)
        ]
        plane = max(np.flatnonzero(asked).tolist(), key=costs.__getitem__)
        offers = list(start.proposals(plane))
        saves = LEAST * start.terms.cost(start.weights)
        best = min(offers, key=lambda one: one.change.cost(start.weights), default=None)
        if best is None or best.change.cost(start.weights) >= -saves:
            asked[plane] = False
            continue
        start.accept(best)
        yield _step(start, began)


def _step(now: Descent, began: float) -> Step:
    boards = sum(1 for pairs in now.pairs if len(pairs))
    seconds = perf_counter() - began
    return Step(boards, now.triangles, now.terms, now.terms.cost(now.weights), seconds)
