"""The multi-triangulation of a plant: triangles at many levels of detail, of which cuts are drawn.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007),
section 4.1; after De Floriani, Magillo, Puppo: Building and traversing a surface at variable
resolution (1997). A directed acyclic graph, whose nodes are local simplifications and whose arcs
are patches of about 10 triangles: from the node that simplifies the patch away to the node that
made it. All patches that a node takes give way to all that it makes, and these have the same border
to the vertex; so every cut covers the plant once, and without cracks (cuts.py).

It goes up to z_min (eq. 16) of twice the mean side of the plant's bounds (section 5). From there
on, the patches of the source's arcs are to be shown by surfel billboards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.lod import Display
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.surfels.rounds import Rounds
from vegtool.surfels.sheets import sheets

REACH = 2.0
"""Mean sides of the plant's bounds: z_min of a node at most (section 5)."""

CONTAINED = 1e-9
"""Of a sphere's radius: what spheres below it may lie outside, by rounding; beside that of their
places."""


@dataclass(frozen=True, eq=False)
class MultiTriangulation:
    """n nodes, and a arcs, whose patches consist of t triangles in all.

    Nodes are sorted from fine to coarse: an arc's start comes after its end. Node 0 is the drain,
    whose arcs are the original; node n - 1 the source, whose arcs are the coarsest level. Arcs are
    sorted by their start: those that a node simplifies away are consecutive, the source's the last.

    plant: whose vertices all levels use, and only these.
    faces: (t, 3) int32 vertices of the plant, counter-clockwise from outside; patch by patch.
    first: (a + 1,) int32: arc i has faces[first[i] : first[i + 1]], at least one.
    material: (a,) int32 index into the plant's materials, one for all faces of a patch.
    start, end: (a,) int32 nodes: which simplifies the patch away, and which made it.
    error: (n,) float64 metres: no point of the original is further from what the node, or one
    below, has made of it. Measured from the original's vertices and along its edges, with a margin
    for what lies between (displacement.py); and never less than what a single collapse moved the
    surface, so that it does not lead away from the original either. 0 at the drain, infinite at the
    source, and nowhere less than at a node below.
    center, radius: (n, 3), (n,) float64 metres: a sphere round all that the node simplifies, and
    round the spheres of the nodes below; round everything at the source. No meaning at the drain.
    """

    plant: Plant
    faces: IntArray
    first: IntArray
    material: IntArray
    start: IntArray
    end: IntArray
    error: FloatArray
    center: FloatArray
    radius: FloatArray

    def __post_init__(self) -> None:
        name, vertices = "MultiTriangulation", len(self.plant.positions)
        faces = checked(f"{name}.faces", self.faces, (None, 3), np.int32, vertices)
        start = checked(f"{name}.start", self.start, (None,), np.int32)
        arcs, nodes = len(start), len(self.error)
        first = checked(f"{name}.first", self.first, (arcs + 1,), np.int32)
        if first[0] != 0 or first[-1] != len(faces) or (np.diff(first) < 1).any():
            raise ValueError(f"{name}.first: must rise from 0 to the number of faces")
        kinds = len(self.plant.materials)
        material = checked(f"{name}.material", self.material, (arcs,), np.int32, kinds)
        start = checked(f"{name}.start", start, (arcs,), np.int32, nodes)
        end = checked(f"{name}.end", self.end, (arcs,), np.int32, nodes)
        if (start <= end).any() or (np.diff(start) < 0).any():
            raise ValueError(f"{name}.start: must rise, and come after the arc's end")
        checked(f"{name}.error", self.error[:-1], (nodes - 1,), np.float64)
        center = checked(f"{name}.center", self.center, (nodes, 3), np.float64)
        radius = checked(f"{name}.radius", self.radius, (nodes,), np.float64)
        error = np.asarray(self.error, np.float64).view()
        error.flags.writeable = False
        if error[0] != 0 or error[-1] != np.inf or (error[start] < error[end]).any():
            raise ValueError(f"{name}.error: must rise from 0 along all arcs to infinity")
        inner = end > 0
        above, below = start[inner], end[inner]
        apart = np.linalg.norm(center[above] - center[below], axis=1)
        slack = CONTAINED * radius[above] + 8 * np.spacing(np.abs(center).max())
        if (apart + radius[below] > radius[above] + slack).any():
            raise ValueError(f"{name}.radius: spheres must contain those of the nodes below")
        for key, value in (
            ("faces", faces), ("first", first), ("material", material), ("start", start),
            ("end", end), ("error", error), ("center", center), ("radius", radius),
        ):  # fmt: skip
            object.__setattr__(self, key, value)

    @property
    def sizes(self) -> IntArray:
        """(a,) int32 triangles of each patch."""
        return np.diff(self.first)


def multi_triangulation(
    plant: Plant, display: Display | None = None, epsilon: float = 1.0, progress: Progress = silent
) -> MultiTriangulation:
    """The multi-triangulation of a plant.

    display: for whom, the default one if None; epsilon: pixels, > 0. They say how far it goes, and
    nothing else: errors are in metres. Nothing is random. Raises ValueError for another epsilon.
    """
    if not epsilon > 0:
        raise ValueError(f"multi_triangulation: epsilon must be above 0 pixels, got {epsilon}")
    pc = (display or Display()).pixels_per_metre(1.0)
    scale = plant.radius or 1.0
    side = float((plant.bounds[1] - plant.bounds[0]).mean()) / scale
    made = Rounds(plant, sheets(plant), REACH * side, epsilon / pc)
    made.run(progress)

    nodes = made.nodes
    source = len(nodes)
    reach = float((np.linalg.norm(nodes.center, axis=1) + nodes.radius).max())
    start = np.where(made.above < 0, source, made.above)
    order = np.lexsort((made.below, start))
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    sizes = np.bincount(made.patch)[order]
    faces = made.corners[np.argsort(rank[made.patch], kind="stable")]
    return MultiTriangulation(
        plant=plant, faces=faces.astype(np.int32),
        first=np.append(0, np.cumsum(sizes)).astype(np.int32),
        material=made.material[order].astype(np.int32), start=start[order].astype(np.int32),
        end=made.below[order].astype(np.int32),
        error=np.append(nodes.error * scale, np.inf),
        center=np.concatenate([nodes.center * scale, np.zeros((1, 3))]) + plant.center,
        radius=np.append(nodes.radius, max(1.0, reach)) * scale,
    )  # fmt: skip
