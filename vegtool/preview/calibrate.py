"""How much larger the elements of a plant are drawn, so that it covers what the plant covers.

What is left out, what fades, and an alpha test of mip-mapped texels all change how much of the
picture a plant covers, each by some per cent. What is drawn is compared with the plant itself,
supersampled, at distances that span each kind's range, and enlarged about the middles of its
elements by the square root of the ratio: quadrilaterals and triangles grow by some per cent.
"""

from __future__ import annotations

from collections.abc import Iterator
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
    Correction,
    Kinds,
    Seen,
    Switches,
    chosen,
    frame,
    switches,
)
from vegtool.preview.eye import Eye
from vegtool.preview.library import Species
from vegtool.preview.options import FadeMode
from vegtool.preview.stock import STOCK

AZIMUTHS = 3
"""Views around the plant."""
ALONG_FADE = (0.0, 0.3, 0.6, 1.0)
"""Of a fade range: where plants are compared."""
ROUNDS = 2
SUPERSAMPLE = 4
"""Samples per axis and pixel of the truth."""
LARGEST = 1.5
"""Lengths change by no more than this factor."""
FAR = 1e6
"""Times its distance: a plant that does not vanish."""
LARGEST_PX = 400
"""Pixels across of a picture: nearer plants are whole."""


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
    focal_px: float,
    fade: FadeMode,
) -> Iterator[tuple[float, Correction]]:
    """Yields the share that is done, and what was found so far: `Kinds.corrections` of one kind.

    elements: of the original. landscape: of which the kinds are. focal_px: as of the kinds.
    """
    levels = switches(kinds, 1.0)
    at = distances(levels, kind)
    stage = levels.stage(np.full(len(at), kind), at.astype(np.float32))
    factor = np.ones(len(at))
    with Landscape([np.zeros((8, 8), np.uint8)], ctx=landscape.ctx) as truth:
        truth.add(species.levels[0], elements, mipmaps=False)
        for i, distance in enumerate(at):
            views = [_view(kinds, kind, float(distance), a, focal_px) for a in range(AZIMUTHS)]
            wanted = sum(_covered(truth, _whole(view[2]), view, SUPERSAMPLE, 0) for view in views)
            factor[i] = factor[i - 1] if i else 1.0
            for _ in range(ROUNDS):
                only = np.zeros(1), np.full(1, factor[i])
                tried = replace(kinds, corrections=(only,) * len(kinds.count))
                drawn = 0.0
                for view in views:
                    what = chosen(view[2], tried, 1.0, fade)
                    drawn += _covered(landscape, frame(view[2], what), view, 1, MSAA)
                ratio = wanted / drawn if drawn > 0 and wanted > 0 else 1.0
                factor[i] = np.clip(factor[i] * ratio**0.5, 1 / LARGEST, LARGEST)
            yield (i + 1) / len(at), (stage, factor)


def _view(kinds: Kinds, kind: int, distance: float, azimuth: int, focal_px: float) -> View:
    middle, radius = float(kinds.center[kind]), float(kinds.radius[kind])
    away = max(distance, 1.2 * radius)
    pixels = min(ceil(2.3 * radius * focal_px / away) + 4, LARGEST_PX)
    fov = degrees(2 * atan(pixels / 2 / focal_px))
    eye = Eye(np.array([0.0, middle, away]), fov_y_deg=fov, near_m=away / 100, far_m=away * 10)
    rows = np.zeros(1, STOCK)
    turn = 2 * np.pi * azimuth / AZIMUTHS
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
    """Pixels that a plant covers."""
    eye, size, _ = view
    shot = eye.shot(*size)
    drawn = picture(landscape, what, shot, Light(), supersample, samples, ground=False)
    return float(drawn[..., 3].sum())
