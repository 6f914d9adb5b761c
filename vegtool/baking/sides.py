"""Do the two sides of billboards look different? Asked with small pictures before the bake.

DESIGN section 4 item 4: one double-sided quad with one picture scored the same as two opposite
quads on leaf cards, at half the triangles and texels. It does not where single-sided surfaces are
missing from one side, or where leaves have an underside of another colour.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray
from vegtool.gl.pictures import BakedLight, Pictures, draw_pictures
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Billboards

CELL = 4
"""Texels: side of a probe picture. With SAMPLES it has 256 samples, the same on both sides, so
that a surface seen from both sides differs by nothing at all."""
SAMPLES = 4
CELLS_PER_ROW = 128
COVERAGE_LIMIT = 0.35
"""Share covered on one side alone. Trees of double-sided leaves and closed wood, whose tubes
clustering cuts open, measured 0.00 to 0.25; the same trees made single-sided 0.46 to 0.91."""
COLOR_LIMIT = 0.05
"""Distance in sRGB, 13 levels of 255; trees with one leaf texture measured 0.00 to 0.03."""
TURN = 1.1
"""A billboard is turned round where its back covers this many times what its front covers."""


@dataclass(frozen=True, eq=False)
class Sides:
    """What the two sides of p billboards show.

    front, back: (p,) covered share of the rectangle. coverage: (p,) samples covered on one side
    alone, as a share of those covered on either. color: (p,) root mean square distance of the
    sides' mean colours, sRGB from 0 to 1; 0 where a side is empty. mirrored: (p,) bool, whether
    normals behind lean along the plane as those in front do (closed wood), not the other way
    (leaves, whose normals turn round whole).
    """

    front: FloatArray
    back: FloatArray
    coverage: FloatArray
    color: FloatArray
    mirrored: np.ndarray

    @property
    def differ(self) -> np.ndarray:
        """(p,) bool: one picture does not serve both of two opposite quads.

        They mirror a picture that they share: its u and v stay, its normal side turns.
        """
        return np.asarray(
            (self.coverage > COVERAGE_LIMIT) | (self.color > COLOR_LIMIT) | ~self.mirrored
        )


def compare_sides(
    buffers: PlantBuffers,
    billboards: Billboards,
    face: IntArray,
    shown_by: IntArray,
    lit: BakedLight | None = None,
) -> Sides:
    """Draw front and back of every billboard small and compare them.

    face, shown_by: (m,) int32, the faces and which billboard shows each, as in draw_pictures. lit:
    light that goes into colours; it differs from side to side, and is left out of the comparison,
    as one picture shows the mean of both.
    """
    count = len(billboards)
    if not count:
        nothing = np.zeros(0)
        return Sides(nothing, nothing, nothing, nothing, np.zeros(0, dtype=bool))
    cell = np.arange(2 * count)
    corner = np.stack([cell % CELLS_PER_ROW, cell // CELLS_PER_ROW], axis=1) * CELL
    rect = np.concatenate([corner, np.full_like(corner, CELL)], axis=1)
    rows = int(cell[-1]) // CELLS_PER_ROW + 1
    drawn = draw_pictures(
        buffers,
        pictures_of(billboards, np.tile(np.arange(count), 2), np.repeat([1, -1], count), rect),
        np.concatenate([face, face]),
        np.concatenate([shown_by, shown_by + count]),
        (CELLS_PER_ROW * CELL, rows * CELL),
        SAMPLES,
        None if lit is None else replace(lit, both_sides=True),
    )

    def texels_of(image: ByteArray) -> FloatArray:
        cells = image.reshape(rows, CELL, CELLS_PER_ROW, CELL, -1).swapaxes(1, 2)
        return np.asarray(cells.reshape(len(cells) * CELLS_PER_ROW, CELL * CELL, -1)[: 2 * count])

    texels = texels_of(drawn.color) / 255.0
    alpha = texels[..., 3]
    front, back = alpha[:count], alpha[count:]
    either = np.maximum(front, back).sum(axis=1)
    total = alpha.sum(axis=1)
    mean = (texels[..., :3] * alpha[..., None]).sum(axis=1) / np.maximum(total, 1e-9)[:, None]
    color = np.sqrt(np.square(mean[:count] - mean[count:]).mean(axis=1))
    return Sides(
        front.mean(axis=1),
        back.mean(axis=1),
        np.abs(front - back).sum(axis=1) / np.maximum(either, 1e-9),
        np.where((total[:count] > 0) & (total[count:] > 0), color, 0.0),
        _mirrored(None if drawn.normal is None else texels_of(drawn.normal), front * back),
    )


def _mirrored(normal: FloatArray | None, both: FloatArray) -> np.ndarray:
    """(p,) bool: `Sides.mirrored`, from the texels of both sides' normals, (2p, t, 3), and how much
    both cover of each, (p, t); always, where there are no normals to lean."""
    count = len(both)
    if normal is None:
        return np.ones(count, dtype=bool)
    leaning = normal[..., :2] / 127.5 - 1.0
    return np.asarray(np.einsum("ptc,ptc,pt->p", leaning[:count], leaning[count:], both) >= 0)


def turned(billboards: Billboards, sides: Sides) -> tuple[Billboards, Sides]:
    """The same rectangles, each with the side in front that shows more (u and the normal turn)."""
    turn = sides.back > TURN * sides.front
    u = np.where(turn[:, None], -billboards.u, billboards.u)
    front = np.where(turn, sides.back, sides.front)
    back = np.where(turn, sides.front, sides.back)
    return replace(billboards, u=u), replace(sides, front=front, back=back)


def opposite_needed(billboards: Billboards, sides: Sides) -> bool:
    """Whether the level as a whole needs two pictures: by the mean over what is covered."""
    area = sides.front * billboards.half_size.prod(axis=1)
    if not area.sum() > 0:
        return False
    coverage = float(np.average(sides.coverage, weights=area))
    color = float(np.average(sides.color, weights=area))
    return coverage > COVERAGE_LIMIT or color > COLOR_LIMIT


def pictures_of(
    billboards: Billboards, which: IntArray, side: IntArray, rect: IntArray
) -> Pictures:
    """Pictures of the billboards `which`, each seen from `side` (1 front, -1 back)."""
    return Pictures(
        billboards.center[which],
        billboards.u[which],
        billboards.v[which],
        billboards.half_size[which],
        billboards.half_depth[which],
        side,
        rect,
    )


def joined(some: Pictures, others: Pictures) -> Pictures:
    """Some pictures, then others."""
    return Pictures(
        *(
            np.concatenate([getattr(some, item.name), getattr(others, item.name)])
            for item in fields(Pictures)
        )
    )
