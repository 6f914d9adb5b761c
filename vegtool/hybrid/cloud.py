"""The billboard cloud that a hybrid starts from: planes that pass every face within a distance.

"Hybrid billboard clouds" (sketch), section 2: "We start by generating a billboard cloud
representation of the original model [Décoret et al. 2003]."
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.clustering.features import own_corners, samples
from vegtool.clustering.plane_space import by_first_face, pieces_of, planes_for
from vegtool.hybrid.cost import misplaced
from vegtool.hybrid.shown import pictured, shown_fraction
from vegtool.lod import Billboards
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.refine.planes import billboards_about


@dataclass(frozen=True, eq=False)
class Cloud:
    """k planes near the faces of a plant, some of which several planes show.

    face, plane: (q,) int32 pairs: the plane shows the face; sorted by plane. normal: (k, 3) unit.
    reach: radii that no face is moved by more than.
    """

    plant: Plant
    face: IntArray
    plane: IntArray
    normal: FloatArray
    reach: float

    @cached_property
    def shown(self) -> Plant:
        """The plant with a face for each pair, as baking wants it: a label for each is `plane`."""
        return self.shown_and(self.face[:0])

    def shown_and(self, others: IntArray) -> Plant:
        """The same, and then some other faces of the plant."""
        face = np.concatenate([self.face, others])
        return replace(
            self.plant,
            faces=self.plant.faces[face],
            face_material=self.plant.face_material[face],
            branches=None,
        )

    @cached_property
    def wrong(self) -> FloatArray:
        """(f,) 0 to 1 how wrong each face is drawn: displaced, or not shown from all around."""
        plant, count = self.plant, len(self.plant.faces)
        radius = plant.radius or 1.0
        _, axes = own_corners(plant)  # a plant that is turned is seen by viewers that turn along
        normals = unit(plant.face_area_vectors / radius**2) @ axes.T
        planes = self.normal @ axes.T
        height = self.heights()
        away = np.full(count, np.inf)
        np.minimum.at(away, self.face, np.abs(height).mean(axis=1))
        pictures = np.zeros((count, pictured(normals[:1], planes[:1]).shape[1]))
        np.add.at(pictures, self.face, pictured(normals[self.face], planes[self.plane]))
        unshown = 1 - shown_fraction(normals, pictures)
        return np.asarray(np.clip(misplaced(away, self.reach) + unshown, 0.0, 1.0))

    def of(self, pairs: IntArray) -> Cloud:
        """Some pairs, (r,) sorted, and the planes that these have."""
        used, plane = np.unique(self.plane[pairs], return_inverse=True)
        return replace(
            self, face=self.face[pairs], plane=plane.astype(np.int32), normal=self.normal[used]
        )

    @cached_property
    def offset(self) -> FloatArray:
        """(k,) radii from the plant's centre along the normal: a plane lies halfway between the
        outermost corners of its faces."""
        height = self._along()
        first = np.flatnonzero(np.diff(self.plane, prepend=-1))
        low = np.minimum.reduceat(height.min(axis=1), first)
        high = np.maximum.reduceat(height.max(axis=1), first)
        return np.asarray((low + high) / 2)

    def heights(self) -> FloatArray:
        """(q, 3) radii of the corners of each pair's face over its plane."""
        return np.asarray(self._along() - self.offset[self.plane][:, None])

    def billboards(self) -> Billboards:
        """One for each plane, and on it."""
        plant, normal = self.plant, self.normal
        about = billboards_about(self.shown, self.plane, normal)
        middle = self.offset * (plant.radius or 1.0)
        off = middle - np.einsum("ki,ki->k", about.center - plant.center, normal)
        return replace(
            about,
            center=about.center + off[:, None] * normal,
            half_depth=about.half_depth + np.abs(off),
        )

    def _along(self) -> FloatArray:
        """(q, 3) radii of the corners of each pair's face from the centre, along the normal."""
        plant = self.plant
        corners = (plant.corners[self.face] - plant.center) / (plant.radius or 1.0)
        return np.asarray(np.einsum("qci,qi->qc", corners, self.normal[self.plane]))


def cloud_of(plant: Plant, count: int, progress: Progress = silent) -> Cloud:
    """At most `count` planes that together pass all faces, by about the least distance that allows
    it."""
    of_face = by_first_face(samples(plant, 0.0, 1).of_face)
    pieces, axes = pieces_of(plant, of_face)
    found = planes_for(pieces, count, progress)
    used, label = np.unique(found.labels[of_face], return_inverse=True)
    order = np.argsort(label, kind="stable").astype(np.int32)
    cloud = Cloud(plant, order, label[order].astype(np.int32), found.normal[used] @ axes, 1.0)
    return replace(cloud, reach=float(np.abs(cloud.heights()).max()))
