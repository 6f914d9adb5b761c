"""A plant simplified round by round, and what comes of it: nodes, and patches between them.

Cignoni, Ganovelli, Gobbetti, Marton, Ponchio, Scopigno: Batched multi triangulation (2005). In each
round patches that lie beside each other form groups, each group is halved while its border stays,
and what is left of it is cut into patches again. Where borders were, most triangles are left; so
patches on either side come together in the next round, and another border stays then. A group that
can't be made of clearly fewer triangles, or not as near as it is wanted, remains as it was. Its
patches are tried once more in another group.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.plant import Plant
from vegtool.progress import Progress
from vegtool.surfels.displacement import displaced, marks_on
from vegtool.surfels.halving import halved
from vegtool.surfels.patches import groups_of, patches_of
from vegtool.surfels.sheets import Flags, Labels, Sheets, Triangles, together

FEWER = 0.8
"""Of a group's triangles: more must not be left for it to become a node."""

TRIES = 2
"""Groups in which a patch may fail to be simplified."""

LEAST = 2.0**-24
"""Plant radii: error of a node at least, which float32 does not tell from none. So only the drain
has none, and a cut without error is the original."""

ROUNDING = 1e-12
"""By which spheres are larger than need be, so that they contain what they touch."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Simplifications of groups, from fine to coarse; the first is the drain: the original itself.

    error: (n,) plant radii. center: (n, 3), radius: (n,) plant radii.
    """

    error: FloatArray
    center: FloatArray
    radius: FloatArray

    def __len__(self) -> int:
        return len(self.error)

    def of(self, rows: Flags) -> Nodes:
        """Some of them."""
        return Nodes(self.error[rows], self.center[rows], self.radius[rows])

    def and_(self, more: Nodes) -> Nodes:
        """These, then more."""
        return Nodes(
            np.concatenate([self.error, more.error]),
            np.concatenate([self.center, more.center]),
            np.concatenate([self.radius, more.radius]),
        )


class Rounds:
    """A plant as it is simplified.

    nodes: those that there are. corners: (t, 3) int64 all triangles so far, of the plant's
    vertices; patch: (t,) int64 of each. material, below, above: (p,) int64 of each patch: its
    material, the node that made it, and the one that simplifies it away, -1 for none yet.
    live: the triangles of the present level that may be simplified; live_patch: (l,) int64.
    """

    def __init__(self, plant: Plant, sheets: Sheets, reach: float, slope: float) -> None:
        """reach: plant radii, the most that z_min of a node may be. slope: how much displacement is
        allowed per distance."""
        self.sheets, self.reach, self.slope = sheets, reach, slope
        self.materials = len(plant.materials)
        self.nodes = Nodes(np.zeros(1), np.zeros((1, 3)), np.zeros(1))
        self.corners, self.patch = np.empty((0, 3), np.int64), np.empty(0, np.int64)
        self.material = self.below = self.above = self.tries = np.empty(0, np.int64)
        seam = sheets.seam[plant.faces] * self.materials + plant.face_material[:, None]
        original = Triangles(
            sheets.faces, plant.faces.astype(np.int64), seam, np.zeros(len(seam), np.int64)
        )
        patch = self._add(original, np.zeros(1, np.int64))
        free = sheets.whole & ~sheets.held[sheets.faces].all(axis=1)
        rows = np.isin(patch, patch[free])
        self.live, self.live_patch = original.of(rows), patch[rows]
        self.marks = marks_on(self.live, sheets.positions, sheets.held)

    def run(self, progress: Progress) -> None:
        """Rounds, until nothing is left to be simplified."""
        total = len(self.live)
        while len(self.live):
            progress("triangles", 1 - len(self.live) / total)
            self._round()

    def _round(self) -> None:
        present, patch = np.unique(self.live_patch, return_inverse=True)
        group = groups_of(self.live, self.sheets.positions, patch)
        bound = self._bounds(group)
        limit = (self.reach - bound.radius) * self.slope
        before = np.bincount(group)
        todo = self.live.regrouped(group).of((limit > bound.error)[group])
        made, moves = halved(todo, self.sheets, limit)
        after = np.bincount(made.group, minlength=len(before))
        done = (after > 0) & (after <= FEWER * before)

        made, over = made.of(done[made.group]), group[self.marks.face]
        corners = self.sheets.positions[made.faces]
        far, near = displaced(
            self.marks, np.where(done[over], over, -1), corners, made.group, len(done)
        )
        error = np.max([bound.error, far, moves, np.full(len(done), LEAST)], axis=0)
        done &= error <= limit
        node = np.full(len(done), -1)
        node[done] = len(self.nodes) + np.arange(done.sum())
        self.nodes = self.nodes.and_(Nodes(error, bound.center, bound.radius).of(done))
        group_of = np.zeros(len(present), np.int64)
        group_of[patch] = group  # whole patches
        self.above[present] = node[group_of]
        self.tries[present] += 1
        self._replace(~done[group] & (self.tries[self.live_patch] < TRIES), made, near, node)

    def _replace(self, stays: Flags, made: Triangles, near: Labels, node: Labels) -> None:
        """Of the live triangles, let (l,) stay, and then come those made by nodes (g,), -1 for
        none. near: (m,) which of `made` each mark is over, -1 for none."""
        kept = node[made.group] >= 0
        old, new = np.cumsum(stays) - 1, np.cumsum(kept) - 1 + stays.sum()
        face = np.where(stays[self.marks.face], old[self.marks.face], -1)
        moved = np.flatnonzero(near >= 0)
        moved = moved[kept[near[moved]]]
        face[moved] = new[near[moved]]
        self.marks = self.marks.over(face)
        made = made.of(kept)
        self.live_patch = np.concatenate([self.live_patch[stays], self._add(made, node)])
        self.live = together([self.live.of(stays), made])

    def _add(self, triangles: Triangles, node: Labels) -> Labels:
        """Make patches of triangles that nodes (g,) have made of their groups; (n,) the patches."""
        if not len(triangles):
            return np.empty(0, np.int64)
        material = triangles.seam[:, 0] % self.materials
        apart = triangles.group * self.materials + material
        label = patches_of(triangles, self.sheets.positions, apart)
        first = np.unique(label, return_index=True)[1]
        patch = label + len(self.below)
        self.corners = np.concatenate([self.corners, triangles.corners])
        self.patch = np.concatenate([self.patch, patch])
        self.material = np.concatenate([self.material, material[first]])
        self.below = np.concatenate([self.below, node[triangles.group[first]]])
        self.above = np.concatenate([self.above, np.full(len(first), -1)])
        self.tries = np.concatenate([self.tries, np.zeros(len(first), np.int64)])
        return patch

    def _bounds(self, group: Labels) -> Nodes:
        """For each group, (g,): the largest error below, and a sphere round all that is below."""
        groups, nodes = int(group.max()) + 1, self.nodes
        below = self.below[self.live_patch]
        original = below == 0
        points = self.sheets.positions[self.live.faces[original]].reshape(-1, 3)
        of_point = np.repeat(group[original], 3)
        pair = np.unique(group[~original] * len(nodes) + below[~original])
        of_node, node = pair // len(nodes), pair % len(nodes)
        center, radius = nodes.center[node], nodes.radius[node]

        low, high = np.full((groups, 3), np.inf), np.full((groups, 3), -np.inf)
        for index, least, most in (
            (of_point, points, points),
            (of_node, center - radius[:, None], center + radius[:, None]),
        ):
            np.minimum.at(low, index, least)
            np.maximum.at(high, index, most)
        middle, size, error = (low + high) / 2, np.zeros(groups), np.zeros(groups)
        np.maximum.at(size, of_point, np.linalg.norm(points - middle[of_point], axis=1))
        np.maximum.at(size, of_node, np.linalg.norm(center - middle[of_node], axis=1) + radius)
        np.maximum.at(error, of_node, nodes.error[node])
        return Nodes(error, middle, size * (1 + ROUNDING))
