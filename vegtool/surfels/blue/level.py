"""Levels of detail out of surfels in progressive order: each is a prefix.

Brandt et al.: Rendering of complex heterogenous scenes using progressive blue surfels (2019),
section 4.1: from where discs of a prefix are no larger than a pixel, it is all that is to be seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.baking.bake import transmission_tint
from vegtool.formats.ply_surfels import ply_bytes
from vegtool.gl.pictures import BakedLight
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display, Level
from vegtool.progress import Progress, silent
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.candidates import RESOLUTION, enough
from vegtool.surfels.blue.make import ORDERED, SEEN, ordered, sized
from vegtool.timing import timed

PLACES = 20_000
"""Of the surface, at which the error of a level is looked at."""
PIXELS_OF_ROOT = 4.0
"""Along the diagonal, for the root of the number of surfels: a closed surface then has some 25
candidates for each."""
COARSEST = 256
"""Pixels along the diagonal, at least."""
FAR = 0.95
"""Share of those places that are no farther from a surfel than is said."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """A plant's surfels, and (m, 3) metres, some places of its surface. seconds: by stage."""

    surfels: SurfelSet
    surface: FloatArray
    seconds: dict[str, float]


def sampled(
    buffers: PlantBuffers,
    count: int,
    lit: BakedLight | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> Sampled:
    """At most `count` surfels of a plant. buffers: without mipmaps. lit: light that goes into their
    colours. Raises CapabilityError where nothing can draw."""
    seconds: dict[str, float] = {}
    materials = buffers.plant.materials
    with timed(seconds, "candidates"):
        found = enough(
            buffers, count, resolution_for(count), lambda stage, f: progress(stage, SEEN * f), lit
        )
    with timed(seconds, "order"):
        surfels = ordered(
            found, count, seed=seed, unlit=lit is not None,
            double_sided=any(material.double_sided for material in materials),
            tint=transmission_tint(buffers.plant),
        )  # fmt: skip
    progress("sizes", ORDERED)
    with timed(seconds, "sizes"):
        surfels = sized(surfels, buffers)
    step = max(len(found) // PLACES, 1)
    return Sampled(surfels, found.position[::step], seconds)


def resolution_for(count: int) -> int:
    """Pixels along the diagonal at which a plant is looked at for so many surfels."""
    return int(np.clip(PIXELS_OF_ROOT * count**0.5, COARSEST, RESOLUTION))


def as_ply(made: Sampled) -> bytes:
    """All surfels as the bytes of a file."""
    return ply_bytes(made.surfels)


def nearest_m(surfels: SurfelSet, count: int, radius_m: float, display: Display) -> float:
    """Metres from a plant's center, from which discs of its first `count` surfels are no larger
    than a pixel, whatever is nearest. radius_m: of the plant."""
    return 2 * surfels.spacing.radius(count) * display.pixels_per_metre(1.0) + radius_m


def surfel_level(made: Sampled, count: int, near_m: float, progress: Progress = silent) -> Level:
    """A level of at most `count` surfels. Its error is how far places of the surface are from the
    surfel that is nearest."""
    from scipy.spatial import cKDTree

    progress("surfels", 0.0)
    shown = made.surfels.first(count)
    away = cKDTree(shown.position).query(made.surface)[0]
    error = float(away.max()), float(np.quantile(away, FAR))
    return Level(
        "surfels", surfels=shown, near_distance_m=near_m, geometric_error_m=error,
        unlit=shown.unlit, seconds=made.seconds,
    )  # fmt: skip
