"""Candidates for surfels: what is to be seen of a plant from outside, pixel by pixel.

Brandt et al.: Rendering of complex heterogenous scenes using progressive blue surfels (2019),
section 3.1: pictures of positions, normals and colours, orthographic, from the eight corners of the
bounds towards their middle. What those miss is looked for from further directions, and joins in
where it is more than a few samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.baking.bake import has_light
from vegtool.gl.draw import Shot
from vegtool.gl.pictures import BakedLight
from vegtool.gl.surface import surface
from vegtool.gl.upload import PlantBuffers
from vegtool.measure.views import upright, views
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

RESOLUTION = 1024
"""Pixels along the longer side of a picture."""
FINEST = 2048
"""Pixels along it, where what is seen is little of the picture."""
PER_SURFEL = 12
"""Candidates that are enough: of fewer, surfels lie where pixels do, and leave holes."""
FLATTEST = 0.2
"""Of the longest side of the bounds: none counts as less, so that nothing is seen edge-on alone."""
CELL = 2.0
"""Pixels: side of the cells by which a sample is told to be covered."""
FURTHER = 26
"""Directions in which more is looked for, in turn."""
WORTH = 0.002
"""Of the samples of a picture: of fewer that nothing covers, none is taken."""
AGAIN = 4
"""Pictures in a row without any, after which no more are drawn."""
HELD_OUT = 16
"""Directions from which what is missed is measured."""

HALF_AXIS = 2**18
"""Cells to either side of the middle: as many as a picture of 2^19 pixels has."""
AXES = np.array([1, 2**20, 2**40])
NEIGHBOURS = sorted(
    (int(np.array(step) @ AXES) for step in product((0, -1, 1), repeat=3)), key=abs
)  # nearest first: most are found there

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Candidates:
    """n places of a surface. position: (n, 3) metres. normal: (n, 3) unit, to the side that is
    seen. color: (n, 3) linear. material: (n,) int32 of the plant. pixel_m: metres between them,
    about, as seen from where they were. light: (n, 3) as of SurfelSet, of the side that is seen and
    the other, and what passes through; or None where there is no more than colours say."""

    position: FloatArray
    normal: FloatArray
    color: FloatArray
    material: IntArray
    pixel_m: float
    light: FloatArray | None = None

    def __post_init__(self) -> None:
        position = checked("Candidates.position", self.position, (None, 3), np.float64)
        count = len(position)
        for name in ("normal", "color"):
            value = checked(f"Candidates.{name}", getattr(self, name), (count, 3), np.float64)
            object.__setattr__(self, name, value)
        material = checked("Candidates.material", self.material, (count,), np.int32)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "material", material)
        if self.light is not None:
            light = checked("Candidates.light", self.light, (count, 3), np.float64)
            object.__setattr__(self, "light", light)

    def __len__(self) -> int:
        return len(self.position)

    def of(self, rows: npt.NDArray[np.integer] | Bools) -> Candidates:
        """Some of them."""
        return Candidates(
            self.position[rows], self.normal[rows], self.color[rows], self.material[rows],
            self.pixel_m, None if self.light is None else self.light[rows],
        )  # fmt: skip


def candidates(
    buffers: PlantBuffers,
    resolution: int = RESOLUTION,
    progress: Progress = silent,
    lit: BakedLight | None = None,
) -> Candidates:
    """All that is seen of a plant from outside.

    buffers: without mipmaps. lit: light that goes into their colours. Of what hides everything
    else, that alone is found; of a surface that is seen from no side, nothing. Raises
    CapabilityError where nothing can draw.
    """
    plant = buffers.plant
    corners = corner_directions(plant)
    found = [seen_from(buffers, direction, resolution, lit) for direction in corners]
    covered = Covered(plant.center, found[0].pixel_m)
    for one in found:
        covered.add(one)
    idle = 0
    for number, view in enumerate(views("all", FURTHER)):
        progress("candidates", number / FURTHER)
        one = seen_from(buffers, view.direction, resolution, lit)
        new = ~covered.covers(one)
        idle = 0 if new.sum() > WORTH * len(one) else idle + 1
        if not idle:
            found.append(one.of(new))
            covered.add(found[-1])
        if idle == AGAIN:
            break
    return joined(found)


def enough(
    buffers: PlantBuffers,
    count: int,
    resolution: int = RESOLUTION,
    progress: Progress = silent,
    lit: BakedLight | None = None,
) -> Candidates:
    """The same for `count` surfels: of finer pictures than of `resolution`, up to FINEST, where
    these have too few, as of what is thin or long."""
    found = candidates(buffers, resolution, progress, lit)
    wanted = PER_SURFEL * count
    if not 0 < len(found) < wanted:
        return found
    finer = min(int(resolution * (wanted / len(found)) ** 0.5), FINEST)
    return found if finer <= resolution else candidates(buffers, finer, progress, lit)


def missed(buffers: PlantBuffers, those: Candidates, resolution: int = RESOLUTION) -> float:
    """The share of what is seen from other directions that candidates do not cover."""
    covered = Covered(buffers.plant.center, those.pixel_m)
    covered.add(those)
    total = lacking = 0
    for view in views("all", HELD_OUT, 0.5):
        one = seen_from(buffers, view.direction, resolution)
        total += len(one)
        lacking += int((~covered.covers(one)).sum())
    return lacking / max(total, 1)


def corner_directions(plant: Plant) -> FloatArray:
    """(8, 3) unit, from the middle of the bounds to their corners."""
    half = np.diff(plant.bounds, axis=0)[0] / 2
    half = np.maximum(half, FLATTEST * (float(half.max()) or 1.0))
    signs = np.array(list(product((-1.0, 1.0), repeat=3)))
    return np.asarray(signs * half / np.linalg.norm(half))


def seen_from(
    buffers: PlantBuffers, direction: FloatArray, resolution: int, lit: BakedLight | None = None
) -> Candidates:
    """What an orthographic picture shows, from a direction (3,), unit. Its pixels are as large in
    all directions: as many as `resolution` along the diagonal of the bounds."""
    plant = buffers.plant
    radius = plant.radius or 1.0
    axes = np.stack([*upright(direction), direction])
    matrix = np.eye(4)
    matrix[:3, :3] = axes / radius
    matrix[2] *= -0.5  # nearer is less; all lies within the radius
    seen = surface(buffers, Shot(matrix, plant.center, resolution, resolution), lit=lit)
    light = None
    if lit is None and has_light(plant):
        light = np.column_stack([seen.exposure, seen.transmission]).astype(np.float64).clip(0, 1)
        if any(material.double_sided for material in plant.materials):
            away = seen.normal @ direction < 0  # as of a crown's leaves; it is drawn turned round
            light[away, :2] = light[away, 1::-1]
    return Candidates(
        seen.position, seen.normal.astype(np.float64), seen.color.astype(np.float64),
        plant.face_material[seen.face], 2 * radius / resolution, light,
    )  # fmt: skip


def joined(some: list[Candidates]) -> Candidates:
    """All of them, in order, of one plant."""
    light = [one.light for one in some if one.light is not None]
    return Candidates(
        np.concatenate([one.position for one in some]),
        np.concatenate([one.normal for one in some]),
        np.concatenate([one.color for one in some]),
        np.concatenate([one.material for one in some]),
        some[0].pixel_m,
        np.concatenate(light) if light else None,
    )


class Covered:
    """Which cells of space hold candidates, and to which of six sides these look.

    A sample is covered where its cell, or one beside it, holds something that does not look the
    opposite way. center: (3,) metres, of everything.
    """

    def __init__(self, center: FloatArray, pixel_m: float) -> None:
        self._center, self._cell_m = center, CELL * pixel_m
        self._cell = np.empty(0, dtype=np.int64)
        self._sides = np.empty(0, dtype=np.uint8)  # a bit for each

    def add(self, those: Candidates) -> None:
        cells = np.concatenate([self._cell, self._cells(those)])
        bits = np.concatenate([self._sides, _bit(_side(those.normal))])
        order = np.argsort(cells, kind="stable")
        cells = cells[order]
        first = np.flatnonzero(np.diff(cells, prepend=-1))
        self._cell = cells[first]
        self._sides = np.bitwise_or.reduceat(bits[order], first) if len(first) else bits

    def covers(self, those: Candidates) -> Bools:
        cells, side = self._cells(those), _side(those.normal)
        kinds, kind = np.unique(cells * 6 + side, return_inverse=True)
        cell, wanted = kinds // 6, ~_bit(kinds % 6 ^ 1)
        found = np.zeros(len(kinds), dtype=bool)
        for step in NEIGHBOURS:
            rest = np.flatnonzero(~found)
            at = np.minimum(np.searchsorted(self._cell, cell[rest] + step), len(self._cell) - 1)
            there = self._cell[at] == cell[rest] + step
            found[rest] = there & ((self._sides[at] & wanted[rest]) > 0)
        return np.asarray(found[kind])

    def _cells(self, those: Candidates) -> npt.NDArray[np.int64]:
        """(n,) a number of each sample's cell."""
        place = np.floor((those.position - self._center) / self._cell_m).astype(np.int64)
        return np.asarray((place + HALF_AXIS) @ AXES)


def _side(normal: FloatArray) -> npt.NDArray[np.int64]:
    """(n,) 0 to 5: to which of the axes a normal is nearest; opposite ones differ by their lowest
    bit."""
    axis = np.abs(normal).argmax(axis=1)
    return np.asarray(2 * axis + (normal[np.arange(len(normal)), axis] < 0))


def _bit(side: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
    return np.asarray(np.left_shift(1, side), dtype=np.uint8)
