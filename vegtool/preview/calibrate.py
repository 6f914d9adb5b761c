"""How much larger the elements of a plant are drawn, so that it covers what the plant covers.

What is left out, what fades, and an alpha test of mip-mapped texels all change how much of the
picture a plant covers, each by some per cent. What is drawn is compared with the plant itself,
supersampled, at distances that span each kind's range, and enlarged about the middles of its
elements by the square root of the ratio: quadrilaterals and triangles grow by some per cent. A
plant of few triangles is too wide from one side and too narrow from another: where it is small, it
is compared from each side by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import atan, ceil, degrees

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.elements import Elements
from vegtool.gl.draw import MSAA
from vegtool.gl.instances import INSTANCE, WHOLE
from vegtool.gl.landscape import Batch, Frame, Landscape, picture
from vegtool.lighting.light import Light
from vegtool.preview.choice import (
    BEYOND,
    Kinds,
    Seen,
    Switches,
    chosen,
    frame,
    switches,
)
from vegtool.preview.correction import SIDES, Correction, smoothed
from vegtool.preview.eye import Eye
from vegtool.preview.options import FadeMode
from vegtool.preview.points import point_batches
from vegtool.preview.stock import STOCK
from vegtool.tiles.library import Species

FEW = 3
"""Sides that a large plant is seen from."""
SMALL_PX = 75.0
"""Pixels across, up to which a plant is seen from all SIDES."""
ALONG_FADE = (0.0, 0.3, 0.6, 1.0)
"""Of a fade range: where plants are compared."""
ROUNDS = 2
SUPERSAMPLE = 4
"""Samples per axis and pixel of the truth."""
LARGEST = 1.5
"""Lengths change by no more than this factor."""
FAR = 1e6
"""Times its distance: a plant that does not vanish."""
LARGEST_PX, TRUTH_PX = 400, 160
"""Pixels across, at most, of pictures of what is drawn and of the plant itself."""
FLAT = 8.0
"""Radii of a plant from which on perspective hardly matters."""
CLOSEST = 1.2
"""Radii: no nearer is it seen."""


def distances(at: Switches, kind: int) -> FloatArray:
    """(k,) metres, ascending, at which a kind is compared."""
    count, ends = int(at.count[kind]), float(at.whole_m[kind])
    found = [ends]
    for level in range(1, count):
        start, end = float(at.start[kind, level]), float(at.end[kind, level])
        found.append((ends * start) ** 0.5)
        found += [start + (end - start) * along for along in ALONG_FADE]
        ends = end
    found += [BEYOND**0.5 * ends, BEYOND * ends]
    return np.unique(np.array(found))


View = tuple[Eye, tuple[int, int], Seen]
"""An eye, the pixels of its picture, and the plant in it."""


def corrected(
    kinds: Kinds,
    species: Species,
    kind: int,
    elements: Elements,
    landscape: Landscape,
    pieces: Mapping[int, Sequence[int]],
    focal_px: float,
    fade: FadeMode,
) -> Iterator[tuple[float, Correction]]:
    """Yields the share that is done, and what was found so far: `Kinds.corrections` of one kind.

    elements: of the original. landscape: of which the kinds are. pieces: as of `point_batches`.
    focal_px: as of the kinds.
    """
    levels = switches(kinds, 1.0)
    at = distances(levels, kind)
    stage = levels.stage(np.full(len(at), kind), at.astype(np.float32))
    factor = np.ones((len(at), SIDES))
    with Landscape([np.zeros((8, 8), np.uint8)], ctx=landscape.ctx) as truth:
        truth.add(species.levels[0], elements, mipmaps=False)
        wanted = _wanted(truth, kinds, kind, at, focal_px)
        yield 1 / len(at), Correction(stage, factor)  # nearer than the first, nothing is left out
        for i, distance in enumerate(at[1:], start=1):
            count = _sides(kinds, kind, float(distance), focal_px)
            views = _views(kinds, kind, float(distance), focal_px, LARGEST_PX, count)
            found = factor[i - 1] if count == SIDES else np.full(count, factor[i - 1].mean())
            for _ in range(ROUNDS):
                drawn = np.array(
                    [
                        _drawn(landscape, pieces, kinds, view, each, fade)
                        for view, each in zip(views, found, strict=True)
                    ]
                )
                true = wanted[i] if count == SIDES else np.full(count, wanted[i].mean())
                if count < SIDES:
                    drawn = np.full(count, drawn.mean())
                ratio = np.ones(count)
                np.divide(true, drawn, out=ratio, where=(drawn > 0) & (true > 0))
                change = np.log(ratio) / 2
                if count == SIDES:
                    change = smoothed(change)
                found = np.clip(found * np.exp(change), 1 / LARGEST, LARGEST)
            factor[i] = found if count == SIDES else found.mean()
            yield (i + 1) / len(at), Correction(stage, factor)


def _drawn(
    landscape: Landscape, pieces: Mapping[int, Sequence[int]], kinds: Kinds, view: View,
    factor: float, fade: FadeMode,
) -> float:  # fmt: skip
    """What a plant covers whose lengths are changed by a factor."""
    only = Correction(np.zeros(1), np.full((1, SIDES), factor))
    tried = replace(kinds, corrections=(only,) * len(kinds.count))
    eye, size, seen = view
    what = chosen(seen, tried, 1.0, fade)
    points = point_batches(landscape, pieces, seen, what, eye.focal_px(size[1]))
    return _covered(landscape, replace(frame(seen, what), points=points), view, 1, MSAA)


def _wanted(
    truth: Landscape, kinds: Kinds, kind: int, at: FloatArray, focal_px: float
) -> FloatArray:
    """(k, SIDES) steradians, nearly, that the plant itself covers from distances (k,): from each
    side, or, nearby, the mean of few of them."""

    def covered(distance: float, count: int) -> FloatArray:
        views = _views(kinds, kind, distance, focal_px, TRUTH_PX, count)
        areas = [_covered(truth, _whole(view[2]), view, SUPERSAMPLE, 0) for view in views]
        return np.array(areas) if count == SIDES else np.full(SIDES, np.mean(areas))

    radius = float(kinds.radius[kind])
    near, far = FLAT * radius, FLAT**2 * radius
    found = np.array([covered(float(d), FEW) if d < near else np.zeros(SIDES) for d in at])
    if (at >= near).any():
        # from afar a plant covers a / d^2 + b / d^4: what perspective does to it fades
        areas = [covered(d, SIDES) * d**2 for d in (near, far)]
        bent = (areas[0] - areas[1]) / (near**-2.0 - far**-2.0)
        flat = areas[1] - bent * far**-2.0
        away = at[:, None]
        found = np.where(away >= near, (flat + bent / away**2) / away**2, found)
    return found


def _sides(kinds: Kinds, kind: int, distance: float, focal_px: float) -> int:
    """From how many sides a plant so far away is compared."""
    radius = float(kinds.radius[kind])
    small = 2 * radius * focal_px / max(distance, 1e-9) <= SMALL_PX
    return SIDES if small and distance >= FLAT * radius else FEW


def _views(
    kinds: Kinds, kind: int, distance: float, focal_px: float, most: int, count: int
) -> list[View]:
    """A plant that far away, from `count` sides; most: pixels of a picture."""
    turns = 2 * np.pi * np.arange(count) / count
    return [_view(kinds, kind, distance, float(turn), focal_px, most) for turn in turns]


def _view(
    kinds: Kinds, kind: int, distance: float, turn: float, focal_px: float, most: int
) -> View:
    """What is seen of a plant that far away and turned so; most: pixels of the picture."""
    middle, radius = float(kinds.center[kind]), float(kinds.radius[kind])
    away = max(distance, CLOSEST * radius)
    pixels = ceil(2 * radius * focal_px / (away**2 - radius**2) ** 0.5) + 4
    focal = focal_px * min(most / pixels, 1.0)
    pixels = min(pixels, most)
    fov = degrees(2 * atan(pixels / 2 / focal))
    eye = Eye(np.array([0.0, middle, away]), fov_y_deg=fov, near_m=away / 100, far_m=away * 10)
    rows = np.zeros(1, STOCK)
    rows["scale"], rows["vanish"], rows["species"] = 1.0, FAR, kind
    rows["turn"], rows["tint"] = (np.cos(turn), np.sin(turn)), 255
    place = np.array([[0.0, -middle, -away]], np.float32)
    far, first = np.full(1, FAR, np.float32), np.zeros(1, np.int64)
    seen = Seen(rows, place, np.array([distance], np.float32), far, first, first)
    return eye, (pixels, pixels), seen


def _whole(seen: Seen) -> Frame:
    rows = np.zeros(1, INSTANCE)
    rows["place"][:, :3], rows["place"][:, 3] = seen.place, 1.0
    rows["turn"][:, :2] = seen.rows["turn"]
    rows["turn"][:, 2:] = WHOLE, 1.0
    rows["shown"] = 2.0, 1.0, 1.0
    rows["tint"] = 127
    return Frame(rows, (Batch(0, 0, 1, WHOLE),))


def _covered(
    landscape: Landscape, what: Frame, view: View, supersample: int, samples: int
) -> float:
    """Of the picture plane at a distance of 1: area that a plant covers."""
    eye, size, _ = view
    drawn = picture(landscape, what, eye.shot(*size), Light(), supersample, samples, ground=False)
    return float(drawn[..., 3].sum()) / eye.focal_px(size[1]) ** 2
