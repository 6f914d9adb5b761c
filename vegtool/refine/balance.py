"""A level as bright as its plant from every side, under every sun.

Colours that are right on the whole (color.py) may be too bright against the light and too dark with
it. What is free to mend that is found from what a level shows of each of its pictures and triangles
from many views.

Bend: how far normals lean along billboards, and up and down (bend.py), is two numbers for a level:
those at which its brightness errs least.

Gains and turns: brightness is linear in the colours of pictures and triangles, and nearly so in
small turns of their normals. The least changes that bring it near the plant's from all sides are
those of ridge regression (Hoerl, Kennard: Ridge regression: biased estimation for nonorthogonal
problems, 1970), solved by its dual, which is as large as there are views and suns.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.gl.surface import surface
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.lod import Level
from vegtool.measure.metrics import LUMINANCE
from vegtool.measure.pictures import client_plant, shot_of
from vegtool.plant import Plant
from vegtool.refine.bend import Bend, bent, bent_level
from vegtool.refine.brightness import PIXELS, Brightness
from vegtool.refine.color import LEAST_GAIN, MOST_GAIN
from vegtool.refine.retouch import elements_of, retouched

LEANS = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)
HEIGHTS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
"""Of bends, tried one after the other, and each until it gets worse."""
FEWER = 4
"""One in so many views and suns is enough for bends."""
BRIGHTER = 1.005
"""Than the plant: half of what color.py asks for clients that average samples as encoded, so that
those that average light are no farther off."""
RIDGE = 1.0
"""Of the mean square of what views show: what it costs to change a colour or a normal."""
MOST_TURN = 0.5
"""Radians."""
FINE = 1024
"""Elements; of more, every second, third, ... sun is enough, and the matrix stays small."""
LEAST_SUNS = 4


@dataclass(frozen=True, eq=False)
class Samples:
    """What a level of `elements` pictures and triangles shows, n samples from all views.

    count: (v,) how many from each view. view, element: (n,) which. albedo, tinted: (n,) luminance,
    and that of light passing through.
    normal, plane: (n, 3) unit, both on the viewer's side. exposure: (n, 2). transmission: (n,).
    pictured: (n,) bool, those of billboards.
    """

    elements: int
    count: IntArray
    view: IntArray
    element: IntArray
    albedo: FloatArray
    tinted: FloatArray
    normal: FloatArray
    plane: FloatArray
    exposure: FloatArray
    transmission: FloatArray
    pictured: np.ndarray


def balanced(level: Level, plant: Plant, wanted: Brightness) -> Level:
    """The level with normals bent, where that helps, and with the colours and normals of pictures
    and triangles changed, each by itself.

    Seen from where it may be used on. plant: what it is made of. Not for a level whose light is in
    its colours: it looks the same from both sides of the light, and gains that follow what does not
    would only make it patchy. Raises CapabilityError where OpenGL cannot draw.
    """
    samples = _samples(level, plant, wanted)
    known = (samples.count > 0) & (wanted.values > 0).all(axis=1)
    if not known.any():
        return level
    bend = best_bend(level, samples, wanted, known)
    samples = replace(samples, normal=bent(samples.normal, samples.plane, bend, samples.pictured))
    gain, turn = ridge(*_matrices(samples, wanted, known))
    return retouched(bent_level(level, bend), gain, turn)


def best_bend(level: Level, samples: Samples, wanted: Brightness, known: np.ndarray) -> Bend:
    """The bend of LEANS and HEIGHTS at which brightness is nearest to the plant's, but for one
    factor."""

    few = replace(wanted, lights=wanted.lights[::FEWER], values=wanted.values[:, ::FEWER])
    some = _of(samples, samples.view % FEWER == 0)
    known = known & (some.count > 0)

    def error(bend: Bend) -> float:
        normal = bent(some.normal, some.plane, bend, some.pictured)
        found = _brightness(replace(some, normal=normal), few)[known] / few.values[known]
        return float(found.std() / max(found.mean(), np.finfo(float).tiny))

    if not known.any():
        return Bend()
    best, least = Bend(), error(Bend())
    mapped = level.atlas is not None and level.atlas.normal is not None
    for name, values in (("lean", LEANS[1:] if mapped else ()), ("height", HEIGHTS[1:])):
        for value in values:
            tried = replace(best, **{name: value})
            if (found := error(tried)) >= least:
                break
            best, least = tried, found
    return best


def ridge(shown: FloatArray, turning: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(e,) gains and (e, 3) turns with which the rows of (m, e), and of (m, 3 e), their change by
    turns about x, y, z, come nearer to sums of BRIGHTER."""
    count = shown.shape[1]
    matrix = np.concatenate([shown, turning], axis=1)
    square = matrix @ matrix.T
    cost = RIDGE * max(float(np.trace(square)) / len(square), np.finfo(float).tiny)
    missing = BRIGHTER - shown.sum(axis=1)
    change = matrix.T @ np.linalg.solve(square + cost * np.eye(len(square)), missing)
    gain = np.clip(1 + change[:count], LEAST_GAIN, MOST_GAIN)
    turn = change[count:].reshape(3, count).T
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    return gain, turn * np.minimum(1.0, MOST_TURN / np.maximum(angle, MOST_TURN))


def _samples(level: Level, plant: Plant, wanted: Brightness) -> Samples:
    """What the level shows from each view, its pictures filtered as at its nearest distance."""
    drawn, element = client_plant(level), elements_of(level)
    pictures = 0 if level.atlas is None else len(level.atlas.front)
    pixels = plant.extent * wanted.display.pixels_per_metre(level.near_distance_m)
    parts: list[tuple[np.ndarray, ...]] = []
    with PlantBuffers(drawn, mipmaps=True) as buffers:
        for number, camera in enumerate(wanted.cameras):
            shot, footprint = shot_of(camera), PIXELS / pixels
            seen = surface(buffers, shot, anisotropy=1, footprint=footprint, places=False)
            face, color = seen.face, seen.color.astype(np.float64)
            parts.append(
                (
                    np.full(len(face), number),
                    element[face],
                    color @ LUMINANCE,
                    (color * seen.tint) @ LUMINANCE,
                    seen.normal.astype(np.float64),
                    seen.side.astype(np.float64),
                    seen.exposure.astype(np.float64),
                    seen.transmission.astype(np.float64),
                )
            )
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    view_of, of_element, albedo, tinted, normal, planes, exposure, transmission = columns
    return Samples(
        int(element.max()) + 1,
        np.bincount(view_of, minlength=len(wanted.cameras)).astype(np.int32),
        view_of,
        of_element,
        albedo,
        tinted,
        normal,
        planes,
        exposure,
        transmission,
        of_element < pictures,
    )


def _of(samples: Samples, some: np.ndarray) -> Samples:
    """Those of the samples, (n,) bool, of views of which all are."""
    arrays = {
        item.name: getattr(samples, item.name)[some]
        for item in fields(Samples)
        if item.name not in ("elements", "count")
    }
    count = np.bincount(samples.view[some], minlength=len(samples.count))
    return replace(samples, count=count.astype(np.int32), **arrays)


def _light(samples: Samples, light: Light) -> FloatArray:
    """(n,) luminance of samples under a light."""
    albedo = samples.albedo[:, None]
    tint = samples.tinted[:, None] / np.maximum(albedo, np.finfo(float).tiny)
    passing, through = samples.transmission, samples.exposure[:, 1]
    lit = shaded(albedo, samples.normal, light, samples.exposure, passing, tint, 1.0, through)
    return np.asarray(lit[:, 0])


def _brightness(samples: Samples, wanted: Brightness) -> FloatArray:
    """(v, s) mean luminance of what the level covers."""
    sums = [
        np.bincount(samples.view, _light(samples, light), len(samples.count))
        for light in wanted.lights
    ]
    return np.asarray(np.stack(sums, axis=1) / np.maximum(samples.count, 1)[:, None])


def _matrices(
    samples: Samples, wanted: Brightness, known: np.ndarray
) -> tuple[FloatArray, FloatArray]:
    """What each element adds to the mean luminance, (m, e), and how that changes with turns of its
    normals about x, y and z, (m, 3 e), as shares of what the plant's is; a row for each view that
    is known under each light."""
    shown, turning = [], []
    x, _, z = samples.normal.T
    upward = np.stack([-z, np.zeros_like(x), x], axis=1)  # normal x up
    here = samples.albedo * (1 - samples.transmission) * samples.exposure[:, 0]
    behind = samples.tinted * samples.transmission * samples.exposure[:, 1]
    cell = samples.view * samples.elements + samples.element
    step = min(1 + samples.elements // FINE, max(len(wanted.lights) // LEAST_SUNS, 1))
    for number, light in list(enumerate(wanted.lights))[::step]:
        lit = _light(samples, light)
        toward = samples.normal @ light.unit
        front = light.sun * (1 - samples.transmission) * (toward > 0)
        back = -light.sun * samples.transmission * samples.exposure[:, 1] * (toward < 0)
        pull = samples.albedo * front + samples.tinted * back
        slope = (light.sky_above - light.sky_below) / 2 * (here - behind)
        moment = pull[:, None] * np.cross(samples.normal, light.unit)
        moment += slope[:, None] * upward
        total = samples.count * wanted.values[:, number]
        rows = [_rows(samples, cell, each, total)[known] for each in (lit, *moment.T)]
        shown.append(rows[0])
        turning.append(np.concatenate(rows[1:], axis=1))
    return np.concatenate(shown), np.concatenate(turning)


def _rows(samples: Samples, cell: IntArray, values: FloatArray, total: FloatArray) -> FloatArray:
    """(v, e) sums of values (n,) by view and element, which `cell` (n,) numbers, over a total of
    each view, (v,)."""
    views, elements = len(samples.count), samples.elements
    sums = np.bincount(cell, values, views * elements).reshape(views, elements)
    return np.asarray(sums / np.maximum(total, np.finfo(float).tiny)[:, None])
