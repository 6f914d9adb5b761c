"""Which part of a model of surfel billboards each of many instances may need, for one eye.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4.5; sequential as in Dachsbacher, Vogelgsang, Stamminger: Sequential point trees (2003). What may
be drawn is a first part of an array, as long as the nearest distance of the whole says; what of
that is drawn is for the vertex shader to say (surfel_steps.glsl), or for `taken` in arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.gl.surfel_data import SurfelData, SurfelItems

SURFEL_INSTANCE = np.dtype([("place", "f4", 4), ("eye", "f4", 3), ("turn", "f4", 2)])
"""place: metres from the eye to the plant's center, and metres of a unit. eye: relative to the
plant's center, in its own frame and unit. turn: cosine and sine of the turn about y."""
ROUNDING = 1e-5
"""Of distances, by which the array is cut later than it might be: the shader rounds."""


@dataclass(frozen=True)
class Run:
    """Instances that are drawn by one call: `count` rows from `first` on, and items of each."""

    first: int
    count: int
    items: int


@dataclass(frozen=True, eq=False)
class SurfelFrame:
    """What is drawn of a model. rows: (n,) SURFEL_INSTANCE, nearest first. pixels: pc / epsilon, as
    many pixels as a metre covers at one metre, over those that may be wrong. billboards: runs of
    these. patches: of each material."""

    rows: np.ndarray
    pixels: float
    billboards: tuple[Run, ...]
    patches: tuple[tuple[Run, ...], ...]


def instances(
    data: SurfelData, eye: FloatArray, foot: FloatArray, turn: FloatArray, scale: FloatArray
) -> np.ndarray:
    """(n,) SURFEL_INSTANCE: a model at so many places, as an eye (3,) sees it.

    foot: (n, 3) metres, of the model's origin. turn: (n,) radians about y. scale: (n,).
    """
    plant = data.plant
    unit = scale * (plant.radius or 1.0)
    cosine, sine = np.cos(turn), np.sin(turn)
    x, y, z = plant.center
    center = np.stack([cosine * x + sine * z, np.full(len(foot), y), cosine * z - sine * x], axis=1)
    place = foot - eye + scale[:, None] * center
    away = place / -unit[:, None]
    rows = np.empty(len(foot), SURFEL_INSTANCE)
    rows["place"][:, :3], rows["place"][:, 3] = place, unit
    rows["eye"][:, 0] = cosine * away[:, 0] - sine * away[:, 2]
    rows["eye"][:, 1] = away[:, 1]
    rows["eye"][:, 2] = cosine * away[:, 2] + sine * away[:, 0]
    rows["turn"][:, 0], rows["turn"][:, 1] = cosine, sine
    return rows


def frame_of(data: SurfelData, rows: np.ndarray, pixels: float) -> SurfelFrame:
    """What is to be drawn of instances (n,), by pc / epsilon."""
    away = np.linalg.norm(rows["eye"] - data.center, axis=1)
    order = np.argsort(away, kind="stable")
    away = away[order]
    near = np.maximum(away - data.radius, 0.0) * ((1 - ROUNDING) / pixels)
    error, beside = data.reach
    first = int(np.searchsorted(away, (error * pixels + beside) * (1 - ROUNDING)))
    billboards = _runs(counts(data.billboards, near[first:]), first)
    patches = tuple(_runs(counts(one.arcs, near)) for one in data.patches)
    return SurfelFrame(rows[order], pixels, billboards, patches)


def counts(items: SurfelItems, near: FloatArray) -> IntArray:
    """(n,) how many of the items may be drawn, at nearest distances of the whole, (n,), times
    epsilon / pc."""
    return np.searchsorted(-items.until, -near, side="left").astype(np.int32)


def _runs(count: IntArray, first: int = 0) -> tuple[Run, ...]:
    """Neighbours that need about as many items are one call: counts (n,) fall."""
    count = count[count > 0]
    starts = np.flatnonzero(np.diff(np.ceil(np.log2(count)), prepend=np.inf))
    ends = np.append(starts[1:], len(count))[: len(starts)]
    return tuple(
        Run(first + int(start), int(end - start), int(count[start]))
        for start, end in zip(starts, ends, strict=True)
    )


def taken(data: SurfelData, eye: FloatArray, pixels: float) -> np.ndarray:
    """(s,) bool: the steps that are taken from an eye (3,), in the plant's unit, relative to its
    center."""
    steps = data.steps.astype(np.float64)
    to = steps[:, :3] - eye
    away = np.linalg.norm(to, axis=1)
    z = away - steps[:, 3]
    moved = np.linalg.norm(np.cross(steps[:, 4:7], to), axis=1) * pixels
    return np.asarray((z > 0) & (z >= steps[:, 7] * pixels) & (moved <= z * away))


def let_through(items: SurfelItems, taken: np.ndarray) -> np.ndarray:
    """(n,) bool: the items that are drawn where steps are taken, (s,) bool."""
    return np.asarray(taken[items.below] & ~((items.above >= 0) & taken[items.above]))
