"""Planes that patch the cracks of a billboard cloud: fractional coverage.

"Hybrid billboard clouds" (sketch), section 2: "A polygon that is not displayed to all viewers
continues to attract billboards to cover it from other angles, thus patching the crack." How much of
a face is not displayed, and to whom, is looked up (sights.py).

First come the planes that are there: as Décoret et al. 2003 do, a plane may show every face that is
valid for it, whichever plane it was found for. That costs no polygons. Then further ones, each
where most is missing: the search of plane_cover.py, a face being worth what the plane would show of
what is not displayed of it. Either way a plane gets those faces whose pictures fill more of the
holes than they cover of what is empty. What alpha cuts out is left as it is: it is full of holes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.clustering.features import Labels, own_corners, samples
from vegtool.clustering.plane_cover import (
    MOST_PIECES,
    ROUNDING,
    STEP,
    Grid,
    Pieces,
    densest_plane,
)
from vegtool.hybrid.cloud import Cloud
from vegtool.hybrid.sights import sights
from vegtool.progress import Progress, silent


def patched(cloud: Cloud, further: int, progress: Progress = silent) -> Cloud:
    """A cloud whose planes show what they can of what no other does, and at most so many planes
    more, none of which moves a face by more than the others may. Nothing is random."""
    cut_out = np.array([m.alpha_mode == "mask" for m in cloud.plant.materials])
    if not cloud.plant.radius or cut_out[cloud.plant.face_material].all():
        return cloud
    work = Patching(cloud)
    count = len(cloud.normal)
    for plane in range(count + further):
        progress("patches", plane / (count + further))
        if plane >= count and not work.one_more():
            break
        work.show(plane)
        if not len(work.faces[plane]):
            break
    planes = [plane for plane, faces in enumerate(work.faces) if len(faces)]
    faces = [work.faces[plane] for plane in planes]
    return replace(
        cloud,
        face=np.concatenate(faces).astype(np.int32),
        plane=np.repeat(np.arange(len(planes)), [len(own) for own in faces]).astype(np.int32),
        normal=np.array(work.normal)[planes] @ work.axes,
    )


class Patching:
    """A cloud as it gets its patches: all in radii, in the plant's own axes.

    faces, normal, offset: of each plane. whole: (f,) faces that alpha cuts nothing out of. surface,
    displayed: (r,) rays that meet them, and their pictures.
    """

    def __init__(self, cloud: Cloud) -> None:
        plant = cloud.plant
        self.axes = own_corners(plant)[1]
        self.corners = (plant.corners - plant.center) / (plant.radius or 1.0) @ self.axes.T
        materials = [(m.double_sided, m.alpha_mode == "opaque") for m in plant.materials]
        self.both_sides, self.whole = np.array(materials)[plant.face_material].T
        self.piece = samples(plant, 0.0, 1).of_face
        self.reach = cloud.reach + ROUNDING
        self.normal, self.offset = list(cloud.normal @ self.axes.T), list(cloud.offset)
        ends = np.searchsorted(cloud.plane, np.arange(1, len(cloud.normal)))
        self.faces = np.split(cloud.face.astype(np.int64), ends)
        self.sights = sights(self.corners, self.both_sides, self.whole, cloud.reach)
        self.surface = self.sights.first >= 0
        self.displayed = np.zeros(len(self.surface), dtype=bool)
        for plane, faces in enumerate(self.faces):
            ray, _ = self._met(plane, faces[self.whole[faces]])
            self.displayed[ray] = True

    def show(self, plane: int) -> None:
        """Give a plane the pieces, of those that are valid for it, that it is the better for."""
        height = np.abs(self.corners @ self.normal[plane] - self.offset[plane]).max(axis=1)
        count = int(self.piece.max()) + 1
        out = np.bincount(self.piece, (height > self.reach) | ~self.whole, count) > 0
        out[self.piece[self.faces[plane]]] = True  # are there already
        faces = np.flatnonzero(~out[self.piece])
        ray, which = self._met(plane, faces)
        piece = self.piece[faces[which]]
        fills, covers = (~self.displayed & part for part in (self.surface, ~self.surface))
        gains = np.bincount(piece, fills[ray], count) > np.bincount(piece, covers[ray], count)
        self.displayed[ray[gains[piece]]] = True
        self.faces[plane] = np.concatenate([self.faces[plane], faces[gains[self.piece[faces]]]])

    def one_more(self) -> bool:
        """Begin a plane where most is missing, if something is."""
        missing = self.sights.seen(~self.displayed, len(self.corners))
        total = missing.sum(axis=1)
        rows = np.flatnonzero(total > 0)
        if not len(rows):
            return False
        if len(rows) > MOST_PIECES:
            rows = np.sort(rows[np.argsort(-total[rows], kind="stable")[:MOST_PIECES]])
        corners = self.corners[rows]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
        pieces = Missing(
            np.ascontiguousarray(corners.swapaxes(0, 1)),
            np.arange(len(rows)), area, np.zeros(len(rows)),
            self.sights.rays.views, missing[rows],
        )  # fmt: skip
        valid, normal, _ = densest_plane(Grid(pieces, self.reach))
        height = corners[valid] @ normal
        self.normal.append(normal)
        self.offset.append((height.min() + height.max()) / 2)
        self.faces.append(np.empty(0, dtype=np.int64))
        return True

    def _met(self, plane: int, faces: Labels) -> tuple[Labels, Labels]:
        """(h,), (h,) which rays meet which of the faces, moved onto a plane."""
        corners, normal = self.corners[faces], self.normal[plane]
        height = corners @ normal - self.offset[plane]
        return self.sights.met(corners - height[..., None] * normal, self.both_sides[faces])


@dataclass(frozen=True, eq=False)
class Missing(Pieces):
    """Faces, each a piece, that are worth what is not displayed of them.

    views: (d, 3) unit. missing: (f, d) how large what is not displayed of each looks from there,
    squared radii.
    """

    views: FloatArray
    missing: FloatArray

    def of(self, rows: Labels) -> Missing:
        own = super().of(rows)
        return Missing(own.corners, own.first, own.area, own.bare, self.views, self.missing[rows])

    def projected(self, directions: FloatArray) -> FloatArray:
        """(d, f) how much of what is missing pictures on planes across (d, 3) unit vectors show, of
        the side that is seen, in multiples of STEP."""
        worth = np.empty((len(directions), len(self)))
        side = np.sign(self.area @ self.views.T)
        for nth, normal in enumerate(directions):
            picture = (self.area @ normal)[:, None] * (self.views @ normal) * side
            worth[nth] = np.clip(picture, 0.0, self.missing).sum(axis=1)
        return np.asarray(np.rint(worth / STEP) * STEP)
