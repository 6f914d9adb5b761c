"""Crown normals blended in: how much of them is best, without shadows and with.

12 views, each with a sun of its own; with shadows the truth has those of its own crown, under one
sun, and levels have none, as foliage far away mostly has none: crown normals are dark on the side
that shadows would be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

from light.prelit import SUN, VIEWS
from vegtool.convert import ConvertOptions, convert
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Sun
from vegtool.lod import LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import Shadowed, scores, truths
from vegtool.measure.views import views
from vegtool.plant import Plant
from vegtool.refine.occlusion import exposed

SHARES = (0.0, 0.25, 0.5, 1.0)
LEVELS = 2


@dataclass(frozen=True)
class Bent:
    """One level. flip, shading: against the plant as it is lit. flip_shadows, shading_shadows:
    against it with its shadows."""

    share: float
    level: int
    flip: float
    shading: float
    flip_shadows: float
    shading_shadows: float


def bent(plant: Plant, chain: LodChain) -> Iterator[Bent]:
    """The first LEVELS levels with each of SHARES. chain: as it comes, with none."""
    off = MeasureOptions(measure="off")
    options = ConvertOptions(levels=LEVELS)
    sun, whole = Sun.read(SUN), exposed(plant, 1.0)
    with ExitStack() as stack:
        buffers = stack.enter_context(PlantBuffers(plant))
        shaded = stack.enter_context(PlantBuffers(whole))
        maps = stack.enter_context(SunMaps([shaded], sun.direction))
        under = Shadowed(sun.light, maps)
        seen_from, display = views("all", VIEWS), options.display
        for share in SHARES:
            told = replace(options, crown_normals=share)
            made = convert(plant, told, off) if share else chain
            for number, level in enumerate(made.levels[1 : 1 + LEVELS], start=1):
                size = [plant.extent * display.pixels_per_metre(level.near_distance_m)]
                lit = truths(plant, seen_from, size, display, buffers=buffers)
                dark = truths(whole, seen_from, size, display, buffers=shaded, under=under)
                plain = scores(lit, level).values
                unshadowed = replace(dark, under=replace(under, shadows=None))
                beside = scores(unshadowed, level).values
                yield Bent(
                    share,
                    number,
                    float(plain["flip"].mean()),
                    float(plain["shading_rmse"].mean()),
                    float(beside["flip"].mean()),
                    float(beside["shading_rmse"].mean()),
                )


def rows(plant: str, found: Sequence[Bent]) -> list[dict[str, object]]:
    """For results/lighting_crown.csv."""
    return [
        {
            "plant": plant,
            "method": "full",
            "level": b.level,
            "share": b.share,
            "flip": f"{b.flip:.4f}",
            "shading_rmse": f"{b.shading:.4f}",
            "flip_shadows": f"{b.flip_shadows:.4f}",
            "shading_rmse_shadows": f"{b.shading_shadows:.4f}",
        }
        for b in found
    ]
