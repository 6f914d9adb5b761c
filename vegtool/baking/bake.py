"""Billboards baked into an atlas: colour with coverage, normals and depth in one pass.

Colditz et al. 2005, section 3 (textures of billboard clouds), with DESIGN section 4: sources are
supersampled without mips, averages are taken in linear light, alpha is coverage, fitted last to
the alpha test (coverage.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray
from vegtool.baking.coverage import coverage_kept
from vegtool.baking.dilate import nearest_covered
from vegtool.baking.options import BakeOptions
from vegtool.baking.pack import Packing, pack
from vegtool.baking.sides import compare_sides, joined, opposite_needed, pictures_of, turned
from vegtool.errors import UsageError
from vegtool.gl.context import describe
from vegtool.gl.pictures import BakedLight, Drawn, draw_pictures
from vegtool.gl.upload import PlantBuffers as PlantBuffers  # for those who bake several levels
from vegtool.lod import Atlas, Billboards, Level
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.timing import timed

MOST_SAMPLES = 8
"""Samples per axis that small atlases are raised to; alpha then has 64 steps."""
CHEAP_SAMPLES = 2_000_000
"""Samples of an atlas up to which more of them per texel cost little."""
WHITE = 4
"""Texels: side of a white block. In the middle of four, mips 0 and 1 are white wherever it lies."""
FLAT = (128, 128, 255)
"""A normal that points straight out."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear red, green and blue."""
ALL_OF_THE_SKY = np.ones(2)
"""The exposure of what nothing hides."""


def bake(
    plant: Plant | PlantBuffers,
    labels: IntArray,
    billboards: Billboards,
    texels_per_metre: float,
    options: BakeOptions | None = None,
    progress: Progress = silent,
    white: bool = False,
    lit: BakedLight | None = None,
    charts: Charted | None = None,
) -> Level:
    """Bake the faces of each cluster into the pictures of the billboards that show it.

    plant: give PlantBuffers to bake several levels from one upload. labels: (f,) int32 cluster of
    each face, matching `billboards.cluster`; faces of clusters that no billboard shows, and those
    of cluster -1, are left out. white: give the atlas a white block, for a mesh beside the
    billboards (Atlas.white). charts: more pictures, for that mesh. lit: light that goes into the
    colours, in place of normals; without,
    the atlas has the plant's exposure and the light that its leaves let through, where it knows of
    them (Atlas.light). The level's billboards are those given, some turned round (u and the
    normal), so that the side which shows more is in front; its density is lower than asked for
    where max_texture forbids that. From where it may be used, and its errors, are for others to
    say. Raises UsageError where the pictures cannot fit into max_texture at any density, and
    CapabilityError where there is no OpenGL.
    """
    options = options or BakeOptions()
    if isinstance(plant, Plant):
        with PlantBuffers(plant) as buffers:
            return bake(
                buffers, labels, billboards, texels_per_metre, options, progress, white, lit, charts
            )
    seconds: dict[str, float] = {}
    progress("bake", 0.0)
    with timed(seconds, "pairs"):
        face, shown_by = pairs(labels, billboards.cluster)
    with timed(seconds, "sides"):
        sides = compare_sides(plant, billboards, face, shown_by, lit)
        billboards, sides = turned(billboards, sides)
        double_sided = options.sides == "double" or (
            options.sides == "auto" and not opposite_needed(billboards, sides)
        )
        apart = sides.differ | (lit is not None)  # light differs from side to side
        behind = np.flatnonzero(apart & (not double_sided)).astype(np.int32)
    progress("bake", 0.2)
    with timed(seconds, "pack"):
        half_size = np.concatenate([billboards.half_size, billboards.half_size[behind]])
        half_size[len(billboards) :][sides.back[behind] == 0] = 0  # nothing there: one texel
        quads = len(half_size)
        if charts is not None:
            half_size = np.concatenate([half_size, charts.planes.half_size])
        limit = min(options.max_texture, describe(plant.ctx).max_texture)
        blocks = int(white)
        packing, density = fit(half_size, texels_per_metre, options.gutter, limit, blocks)
        samples = supersample(packing, options)

    which = np.concatenate([np.arange(len(billboards)), behind])
    side = np.where(np.arange(len(which)) < len(billboards), 1, -1)
    back_face, back_picture = _pairs_behind(face, shown_by, behind, len(billboards))
    pictures = pictures_of(billboards, which, side, packing.rect[:quads])
    faces, shows = [face, back_face], [shown_by, back_picture]
    if charts is not None:
        count = len(charts.planes)
        nth, ones = np.arange(count, dtype=np.int32), np.ones(count, dtype=np.int32)
        own = pictures_of(charts.planes, nth, ones, packing.rect[quads : quads + count])
        pictures = joined(pictures, own)
        faces.append(charts.face)
        shows.append(charts.chart + quads)
    drawn = draw_pictures(
        plant,
        pictures,
        np.concatenate(faces).astype(np.int32),
        np.concatenate(shows).astype(np.int32),
        (packing.width, packing.height),
        samples,
        None if lit is None else replace(lit, both_sides=double_sided),
        light=lit is None and has_light(plant.plant),
    )
    seconds |= drawn.seconds
    progress("bake", 0.8)
    with timed(seconds, "dilate"):
        front = packing.rect[: len(billboards)]
        back = front.copy()
        back[behind] = packing.rect[len(billboards) : len(which)]
        color, normal, light = dilated(drawn, packing, options.fit_alpha)
        block = packing.rect[-1] if white else None
        if block is not None:
            whiten(color, normal, light, block, options.gutter, _exposure(plant.plant, labels < 0))
        tint = transmission_tint(plant.plant)
        shown = None
        if charts is not None:
            shown = packing.rect[quads : quads + len(charts.planes)]
            gutter = options.gutter
            for x, y, w, h in shown.tolist():
                color[y - gutter : y + h + gutter, x - gutter : x + w + gutter, 3] = 255
        atlas = Atlas(color, normal, drawn.depth, front, back, block, shown, light, tint)
    progress("bake", 1.0)
    return Level(
        "billboards",
        billboards=billboards,
        atlas=atlas,
        double_sided=double_sided,
        texels_per_metre=density,
        unlit=lit is not None,
        seconds=seconds,
    )


@dataclass(frozen=True, eq=False)
class Charted:
    """Pictures for a mesh: planes (c,); and (m,), (m,) int32 faces, and the picture that shows
    each."""

    planes: Billboards
    face: IntArray
    chart: IntArray


def pairs(labels: IntArray, cluster: IntArray) -> tuple[IntArray, IntArray]:
    """(m,), (m,) int32: every face with every billboard that shows its cluster."""
    count = max(int(labels.max(initial=0)), int(cluster.max(initial=0))) + 1
    order = np.argsort(cluster, kind="stable").astype(np.int32)
    shown = np.bincount(cluster, minlength=count)
    first = np.cumsum(shown) - shown
    times = np.where(labels >= 0, shown[labels], 0)
    face = np.repeat(np.arange(len(labels), dtype=np.int32), times)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(times) - times, times)
    return face, order[np.repeat(first[labels], times) + nth]


def _pairs_behind(
    face: IntArray, shown_by: IntArray, behind: IntArray, first: int
) -> tuple[IntArray, IntArray]:
    """The pairs of the billboards `behind` once more, for pictures numbered from `first` on."""
    number = np.full(int(shown_by.max(initial=-1)) + 1, -1, dtype=np.int32)
    behind = behind[behind < len(number)]
    number[behind] = first + np.arange(len(behind))
    keep = number[shown_by] >= 0
    return face[keep], number[shown_by[keep]]


def fit(
    half_size: FloatArray, texels_per_metre: float, gutter: int, max_texture: int, blocks: int = 0
) -> tuple[Packing, float]:
    """Pictures in whole texels, packed; the density is lowered until max_texture holds them.

    blocks: how many white ones (`WHITE`) to pack after the pictures.
    """
    density, longest = texels_per_metre, max_texture - 2 * gutter
    extra = np.full((blocks, 2), WHITE)
    while True:
        sizes = np.maximum(1, np.rint(2 * density * half_size))  # integers too large for int32
        if sizes.max() > max(longest, 1):
            density *= longest / sizes.max()
            continue
        packed = np.concatenate([sizes, extra])
        excess = float(np.prod(packed + 2 * gutter, axis=1).sum()) / max_texture**2
        if excess <= 1:
            packing = pack(packed.astype(np.int32), gutter, max_texture)
            excess = max(packing.width, packing.height) / max_texture
            if excess <= 1:
                return packing, density
        if sizes.max() == 1:
            raise UsageError(
                f"{len(half_size)} billboards do not fit into a texture of {max_texture} x "
                f"{max_texture} texels, even with one texel each. Ask for fewer "
                f"billboards (--billboards) or allow a larger texture (--max-texture)."
            )
        density *= min(0.95, 1 / sqrt(excess))


def supersample(packing: Packing, options: BakeOptions) -> int:
    """Samples per axis: what was asked for, and more where the whole atlas stays cheap."""
    cheap = int(sqrt(CHEAP_SAMPLES / (packing.width * packing.height)))
    return max(options.supersample, min(MOST_SAMPLES, cheap))


def dilated(
    drawn: Drawn, packing: Packing, fit_alpha: bool = True
) -> tuple[ByteArray, ByteArray | None, ByteArray | None]:
    """Colour, normals and light carried under alpha 0; alpha such that what is covered passes the
    test, or as drawn."""
    covered = drawn.color[..., 3] > 0
    nearest = nearest_covered(covered, packing.rect, packing.gutter)
    color = drawn.color.reshape(-1, 4)[nearest]
    alpha = drawn.color[..., 3]
    color[..., 3] = coverage_kept(alpha, packing.rect, packing.gutter) if fit_alpha else alpha
    normal = None if drawn.normal is None else drawn.normal.reshape(-1, 3)[nearest]
    light = None if drawn.light is None else drawn.light.reshape(-1, 4)[nearest]
    return color, normal, light


def whiten(
    color: ByteArray,
    normal: ByteArray | None,
    light: ByteArray | None,
    block: IntArray,
    gutter: int,
    exposure: FloatArray = ALL_OF_THE_SKY,
) -> None:
    """Paint a block (4,) of an atlas, and its gutter, opaque white and facing straight out, with
    an exposure, (2,), and no light that passes through."""
    x, y, w, h = block.tolist()
    painted = np.s_[y - gutter : y + h + gutter, x - gutter : x + w + gutter]
    color[painted] = 255
    if normal is not None:
        normal[painted] = FLAT
    if light is not None:
        light[painted] = [*np.rint(255 * exposure), 0, 0]


def _exposure(plant: Plant, faces: np.ndarray) -> FloatArray:
    """(2,) mean exposure of some faces, (f,) bool: of the wood that is drawn as a mesh, which shows
    one place of the atlas all over."""
    area = plant.face_areas * faces
    if plant.exposure is None or not area.sum() > 0:
        return ALL_OF_THE_SKY
    return np.asarray(area @ plant.exposure[plant.faces].mean(axis=1) / area.sum())


def has_light(plant: Plant) -> bool:
    """Whether there is more to light than colours and normals say."""
    return plant.exposure is not None or any(m.transmission > 0 for m in plant.materials)


def transmission_tint(plant: Plant) -> FloatArray:
    """(3,) of all light that passes through a plant's leaves, by how much passes, how large and how
    bright they are; white where none does. 0 to 1, as a file holds it."""
    area = np.bincount(plant.face_material, plant.face_areas, len(plant.materials))
    bright = np.array([m.base_color[:3] @ LUMINANCE for m in plant.materials])
    weight = area * bright * np.array([m.transmission for m in plant.materials])
    if not weight.sum() > 0:
        return np.ones(3)
    tints = np.array([m.transmission_tint for m in plant.materials])
    return np.asarray(np.clip(weight @ tints / weight.sum(), 0.0, 1.0))
