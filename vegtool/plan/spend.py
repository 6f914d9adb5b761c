"""A scene's budget of bytes: which levels of each species it is spent on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vegtool.errors import UsageError
from vegtool.needs.inside import inside
from vegtool.needs.levels import levels_needed
from vegtool.needs.need import Need
from vegtool.needs.viewers import display_of, viewers_of
from vegtool.plan.budget import Choices, choices, evenly, spread
from vegtool.plan.errors import level_errors
from vegtool.plan.seen import seen_pixels
from vegtool.progress import Progress, part_of, silent
from vegtool.scene import Scene
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Placement
from vegtool.tiles.terrain import Terrain

EYES = 8
"""Of the scene's viewers, by which pixels are counted."""
DISTANCES = 12
"""At which errors are looked at, from the nearest to the farthest of all species."""
FARTHEST_M = 2_000.0
"""Metres: beyond, nothing of a plant is seen that a budget would be spent on."""
NEAREST_M = 0.5


@dataclass(frozen=True)
class Kept:
    """Of a species: levels that are kept, 0 being the original; their bytes; mean error of its
    pixels that are seen, and which share of all pixels they are."""

    species: str
    levels: tuple[int, ...]
    bytes: int
    error: float
    pixels: float


@dataclass(frozen=True)
class Spent:
    """bytes: the budget. kept: of each species. error: mean of all pixels of plants that are seen.
    even: the same where each species has an equal part of the budget. curve: shares of the bytes of
    all that is needed, with the error of both at each."""

    bytes: int
    kept: tuple[Kept, ...]
    error: float
    even: float
    curve: tuple[tuple[float, float, float], ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


NOTHING = Choices(np.zeros((1, 0), bool), np.zeros(1, np.int64), np.zeros(1), np.zeros(1, np.int32))
"""Of what nobody sees."""
SHARES = (0.05, 0.1, 0.15, 0.25, 0.35, 0.5, 0.75, 1.0)
"""Of the bytes of all that is needed, at which the curve is told."""


def spent(
    scene: Scene,
    species: Sequence[Species],
    needs: Sequence[Need],
    placement: Placement,
    ground: Terrain,
    budget: int,
    progress: Progress = silent,
) -> Spent:
    """Spend a budget on the levels that are needed.

    Raises UsageError, with file and line, where the coarsest levels do not fit.
    """
    viewers = viewers_of(scene, ground, placement)
    display = display_of(scene, viewers)
    focal = display.pixels_per_metre(1.0)
    near = max(min(one.nearest for one in needs if one.plants), NEAREST_M)
    far = min(max(one.farthest for one in needs if one.plants), FARTHEST_M)
    at = np.geomspace(near, max(far, 2 * near), DISTANCES)
    eyes = inside(viewers, EYES, scene.placement.seed or 0).position
    progress("pixels that are seen", 0.0)
    pixels = seen_pixels(eyes, species, placement, at, focal)
    some: list[Choices] = []
    known: list[np.ndarray] = []
    for index, (one, need) in enumerate(zip(species, needs, strict=True)):
        said = part_of(progress, index / len(species), 1 / len(species))
        rows = np.flatnonzero(levels_needed(one, need).kept)
        if not len(rows):
            some.append(NOTHING)
            known.append(rows)
            continue
        kind = "ground" if need.elevation[1] < np.radians(30) else "all"
        error = level_errors(one, at, display, kind, said)[rows]
        files = [*one.files, *([] if one.surfels is None else [one.surfels.file])]
        size = np.array([files[row].stat().st_size for row in rows])
        start = np.append(one.switch_m, [] if one.surfels is None else one.surfels.switch_m)
        start = start[rows] * focal / one.focal_px
        some.append(choices(size, start, error, at, pixels[index]))
        known.append(rows)
    try:
        made = spread(some, budget)
    except UsageError as error_:
        raise UsageError(f"{scene.at('budget', 'bytes')}: {error_}") from error_
    whole, seen = sum(int(one.bytes[-1]) for one in some), float(pixels.sum()) or 1.0

    def mean(rows: np.ndarray) -> float:
        return float(sum(one.error[i] for one, i in zip(some, rows, strict=True))) / seen

    least = sum(int(one.bytes[0]) for one in some)
    curve = [
        (share, mean(spread(some, int(share * whole))), mean(evenly(some, int(share * whole))))
        for share in SHARES
        if share * whole >= least
    ]
    kept = tuple(
        Kept(
            one.name,
            tuple(int(row) for row in rows[found.kept[i]]),
            int(found.bytes[i]),
            float(found.error[i] / (count.sum() or 1.0)),
            float(count.sum() / seen),
        )
        for one, rows, found, i, count in zip(species, known, some, made, pixels, strict=True)
    )
    return Spent(budget, kept, mean(made), mean(evenly(some, budget)), tuple(curve))
