"""Which levels of a species may be drawn from somewhere in a scene, and why others are not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.needs.need import Need
from vegtool.needs.planar import BoolArray
from vegtool.tiles.library import Species

ROUNDING = 1e-5
"""Of a distance: levels are chosen in floats of 32 bits."""


@dataclass(frozen=True, eq=False)
class LevelsNeeded:
    """kept: (n,) whether each level is needed, surfels after those that are triangles. reasons: a
    sentence on each."""

    kept: BoolArray
    reasons: tuple[str, ...]


def levels_needed(species: Species, need: Need) -> LevelsNeeded:
    """The levels that plants between the need's nearest and farthest are drawn as.

    A level is drawn from its switch distance until the next one has replaced it, at the end of that
    one's fade; distances are for the need's display. The last one is drawn from there on.
    """
    focal = need.display.pixels_per_metre(1.0)
    start_m = species.switch_m * focal / species.focal_px
    fade = species.fade
    names = ["the original", *(f"level {index}" for index in range(1, len(start_m)))]
    if species.surfels is not None:
        start_m = np.append(start_m, species.surfels.switch_m * focal / species.focal_px)
        fade = np.append(fade, species.surfels.fade)
        names.append("surfels")
    end_m = np.append((start_m * (1 + fade))[1:], np.inf)
    if not need.plants:
        none = tuple(f"{name}: left out, as no plant of it stands anywhere" for name in names)
        return LevelsNeeded(np.zeros(len(names), np.bool_), none)
    nearest, farthest = need.nearest * (1 - ROUNDING), need.farthest * (1 + ROUNDING)
    kept = (start_m <= farthest) & (end_m >= nearest)
    reasons = []
    for name, start, end, is_kept in zip(names, start_m, end_m, kept, strict=True):
        drawn = f"drawn {_between(start, end)}"
        if is_kept:
            seen = _between(need.nearest, need.farthest)
            reasons.append(f"{name}: kept, as it is {drawn} and plants are seen {seen}")
        elif start > farthest:
            reasons.append(f"{name}: left out: {drawn}, and no eye is beyond {need.farthest:.4g} m")
        else:
            reasons.append(f"{name}: left out: {drawn}, and no eye is within {need.nearest:.4g} m")
    return LevelsNeeded(np.asarray(kept), tuple(reasons))


def _between(start: float, end: float) -> str:
    return f"from {start:.4g} m on" if np.isinf(end) else f"from {start:.4g} to {end:.4g} m"
