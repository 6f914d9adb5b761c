"""An octahedral impostor, emulated: one picture of the whole plant for each of many directions.

Directions lie on the octahedral map of Engelhardt, Dachsbacher: Octahedron environment maps (2008).
A client draws the nearest frame on one quad. No stock client does so, it takes a shader of its
own, so the report draws the frame that such a shader would choose. Frames are baked when they are
first asked for; a real one needs them all, and that is what is counted.
"""

from __future__ import annotations

from statistics import median

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.baking.bake import PlantBuffers, dilated, fit, supersample
from vegtool.baking.options import BakeOptions
from vegtool.baking.sides import pictures_of
from vegtool.gl.pictures import draw_pictures
from vegtool.lod import Atlas, Billboards, Level
from vegtool.measure.views import View, upright
from vegtool.plant import Plant
from vegtool.timing import timed

FRAMES = 16
"""Along each side of the map."""
PIXELS = 128
"""Along each side of a frame."""


def directions(side: int = FRAMES) -> FloatArray:
    """(side * side, 3) unit vectors: the middles of the map's cells, row by row.

    The map's middle is up (+y), the diamond between the middles of its edges is the horizon, and
    all of its corners are down.
    """
    across = (2 * np.arange(side) + 1) / side - 1
    x, z = (a.ravel() for a in np.meshgrid(across, across))
    y = 1 - np.abs(x) - np.abs(z)
    below = np.maximum(-y, 0.0)
    return unit(np.stack([x - np.copysign(below, x), y, z - np.copysign(below, z)], axis=1))


class Octahedral:
    """An impostor of one plant: called with a view, it gives the level that is drawn there.

    triangles, texels: of the whole impostor, colour and normal counted each.
    """

    triangles = 2
    texels = 2 * (FRAMES * PIXELS) ** 2

    def __init__(self, plant: Plant) -> None:
        self.directions = directions()
        self._plant = plant
        self._radius = reach(plant)
        self._frames: dict[int, Level] = {}
        self._buffers: PlantBuffers | None = None

    @property
    def baked(self) -> int:
        """How many frames have been asked for."""
        return len(self._frames)

    @property
    def seconds(self) -> dict[str, float]:
        """By stage, of baking all frames, as it follows from the median of those baked so far."""
        frames = list(self._frames.values())
        stages = frames[0].seconds if frames else {}
        return {s: FRAMES**2 * median(f.seconds[s] for f in frames) for s in stages}

    def __call__(self, view: View) -> Level:
        """The frame whose direction is nearest to the view's: one billboard that faces there."""
        number = nearest(self.directions, view.direction)
        if number not in self._frames:
            self._frames[number] = self._bake(self.directions[number])
        return self._frames[number]

    def _bake(self, direction: FloatArray) -> Level:
        """Drawn from the front alone, which is the side that is ever seen: `bake` would turn the
        picture round where single-sided leaves show more from behind."""
        if self._buffers is None:
            self._buffers = PlantBuffers(self._plant)
        right, up = upright(direction)
        quad = Billboards(
            center=self._plant.center[None],
            u=right[None],
            v=up[None],
            half_size=np.full((1, 2), self._radius),
            half_depth=np.full(1, self._radius),
            cluster=np.zeros(1, np.int32),
        )
        options = BakeOptions()
        density = PIXELS / (2 * self._radius)
        packing, _ = fit(quad.half_size, density, options.gutter, options.max_texture)
        faces = np.arange(len(self._plant.faces), dtype=np.int32)
        only, front = np.zeros(1, np.int32), np.ones(1, np.int32)
        drawn = draw_pictures(
            self._buffers,
            pictures_of(quad, only, front, packing.rect),
            faces,
            np.zeros_like(faces),
            (packing.width, packing.height),
            supersample(packing, options),
        )
        seconds = dict(drawn.seconds)
        with timed(seconds, "dilate"):
            color, normal, _ = dilated(drawn, packing)
        atlas = Atlas(color, normal, drawn.depth, packing.rect, packing.rect)
        return Level(
            "billboards", billboards=quad, atlas=atlas, texels_per_metre=density, seconds=seconds
        )


def octahedral(plant: Plant) -> Octahedral:
    """The impostor of a plant; nothing is baked yet.

    What it returns raises CapabilityError when called where there is no OpenGL.
    """
    return Octahedral(plant)


def reach(plant: Plant) -> float:
    """Metres: how far the plant reaches from its center, the radius of every frame."""
    used = plant.positions[np.unique(plant.faces)]
    return float(np.linalg.norm(used - plant.center, axis=1).max()) or 1.0


def nearest(frames: FloatArray, direction: FloatArray) -> int:
    """The frame (n, 3) with the least angle to a direction (3,); the first of equal ones.

    At most 10 degrees off, 5 on average. A shader takes the cell of the map that holds the
    direction instead, which is up to 15 degrees off, 5.3 on average.
    """
    return int((frames @ direction).argmax())
