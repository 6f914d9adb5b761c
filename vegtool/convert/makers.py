"""What makes the levels of a plant, by method: at most so many billboards, for a distance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import log
from typing import TYPE_CHECKING, cast

from vegtool.arrays import IntArray
from vegtool.baking.options import BakeOptions
from vegtool.boxes.options import BoxOptions, Shape
from vegtool.clustering import ClusterOptions
from vegtool.convert.options import (
    FEWEST_POINTS,
    HYBRID,
    LEVEL_RATIO,
    MOST_BILLBOARDS,
    MOST_OF_PREVIOUS,
    MOST_POINTS,
    NEAR_GROWTH,
    NEAR_LIMITS,
    NEAR_PIXELS,
    SURFEL_BILLBOARDS,
    SURFELS,
    TRIANGLES_PER_BILLBOARD,
    ConvertOptions,
)
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.measure.distances import rounded_up
from vegtool.measure.views import distance_of
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.timing import timed

if TYPE_CHECKING:
    from vegtool.baking.bake import PlantBuffers
    from vegtool.gl.pictures import BakedLight
    from vegtool.measure.scores import TruthsAt
    from vegtool.refine.level import Source
    from vegtool.surfels.blue.level import Sampled
    from vegtool.surfels.level import SurfelSource

LevelMaker = Callable[[int, float, Progress], Level]
"""Makes a level of at most so many billboards, or so many triangles twice over, for distances from
so many metres on; or of at most so many surfels."""


@dataclass(frozen=True, eq=False)
class Maker:
    """Makes the levels of a plant, by any method; those that want more of a chain say so."""

    make: LevelMaker
    options: ConvertOptions

    def __call__(self, count: int, near_m: float, progress: Progress = silent) -> Level:
        return self.make(count, near_m, progress)

    def wanted(self, plant: Plant, farthest_m: float) -> list[tuple[int, float]]:
        """Of each level, how many billboards it may have and from how many metres it is for; none
        from farther than pictures are made for, but with fewer billboards."""
        counts = billboard_counts(plant, self.options)
        size = self.options.pixels or near_pixels(counts[0])
        first = rounded_up(distance_of(plant, self.options.display, size))
        return list(zip(counts, near_distances(counts, first, farthest_m), strict=True))

    def fewer(self, count: int, near_m: float, at_m: float) -> int:
        """Of how many billboards a level is, for distances from at_m on, that would have `count` if
        it were for those from near_m on: as along the chain, as many times fewer as it is farther.
        """
        return max(1, round(count * near_m / at_m))

    def beside(self) -> dict[str, bytes]:
        """Further files of the chain, by the ending of their names."""
        return {}

    @property
    def misses(self) -> tuple[str, ...]:
        """Sentences on limits that were asked for, and could not be kept."""
        return ()


@dataclass(frozen=True, eq=False)
class SurfelBillboards(Maker):
    """Levels of surfel billboards: of as many as their error asks for."""

    made_from: SurfelSource

    def wanted(self, plant: Plant, farthest_m: float) -> list[tuple[int, float]]:
        if self.options.pixels is not None:  # as many as the error asks for, which the distance has
            near = [near for _, near in super().wanted(plant, farthest_m)]
            return [(MOST_BILLBOARDS, each) for each in near]
        from vegtool.measure.scores import LADDER

        nearest = distance_of(plant, self.options.display, LADDER[0])
        return [
            (
                count,
                rounded_up(max(self.made_from.nearest_m(TRIANGLES_PER_BILLBOARD * count), nearest)),
            )
            for count in billboard_counts(plant, self.options)
        ]

    def fewer(self, count: int, near_m: float, at_m: float) -> int:
        return count  # at most: the distance says how many

    def beside(self) -> dict[str, bytes]:
        from vegtool.surfels.options import SUFFIX
        from vegtool.surfels.store import surfels_bytes

        return {SUFFIX: surfels_bytes(self.made_from.model.without_exposure())}

    @property
    def misses(self) -> tuple[str, ...]:
        return self.made_from.model.notes


@dataclass(frozen=True, eq=False)
class Surfels(Maker):
    """Levels of surfels: each a quarter of the one before, for half its size on the screen."""

    made_from: Sampled

    def wanted(self, plant: Plant, farthest_m: float) -> list[tuple[int, float]]:
        from vegtool.surfels.blue.level import nearest_m

        most = len(self.made_from.surfels)
        counts = [max(most // LEVEL_RATIO ** (2 * i), 1) for i in range(self.options.levels)]
        display = self.options.display
        return [
            (count, rounded_up(nearest_m(self.made_from.surfels, count, plant.radius, display)))
            for count in dict.fromkeys(counts)
        ]

    def fewer(self, count: int, near_m: float, at_m: float) -> int:
        return max(1, round(count * (near_m / at_m) ** 2))

    def beside(self) -> dict[str, bytes]:
        from vegtool.surfels.blue.level import as_ply
        from vegtool.surfels.options import POINTS_SUFFIX

        return {POINTS_SUFFIX: as_ply(self.made_from)}


def level_maker(
    buffers: PlantBuffers, truth_at: TruthsAt, options: ConvertOptions, casts: bool = False,
    progress: Progress = silent,
) -> Maker:  # fmt: skip
    """What makes the levels of a plant, by `options.refine`; all that they share is made here.

    buffers: the plant's, without mipmaps. truth_at: what it looks like, under the light that is
    baked where one is. casts: levels are to throw shadows and need no light.
    """
    from vegtool.gl.pictures import BakedLight

    under, lit = truth_at.under, None
    if all(material.unlit for material in buffers.plant.materials):
        lit = BakedLight(Light())
    elif under is not None and under.shadows is not None and not casts:
        lit = BakedLight(under.light, under.shadows)
    if options.refine == "none":
        return Maker(partial(billboard_level, buffers, options, lit), options)
    if options.method == SURFELS and not casts:
        from vegtool.surfels.blue.level import sampled, surfel_level

        made = sampled(buffers, point_count(buffers.plant, options), lit, options.seed, progress)
        return Surfels(partial(surfel_level, made), options, made)
    from vegtool.hybrid.or_refined import refined_or_hybrid
    from vegtool.refine.level import Wanted, refined_level, source_of

    source = source_of(buffers, truth_at, lit)
    if options.method == HYBRID and not casts:  # a shadow has no colours to keep
        return Maker(partial(_hybrid, source, options), options)
    if options.method == SURFEL_BILLBOARDS and not casts:
        from vegtool.surfels.level import SurfelSource
        from vegtool.surfels.make import surfel_model

        model = surfel_model(
            buffers.plant, options.surfel_billboards, options.display, options.max_texture, progress
        )
        made_from = SurfelSource(source, model)
        return SurfelBillboards(partial(_cut, made_from, options), options, made_from)

    def make(count: int, near_m: float, progress: Progress) -> Level:
        most = TRIANGLES_PER_BILLBOARD * count
        balance = not casts and not options.crown_normals  # which it would bend back
        textured = options.refine != "opaque"
        wanted = Wanted(most, near_m, options.max_texture, options.seed, balance, textured)
        return (refined_level if casts else refined_or_hybrid)(source, wanted, progress)

    return Maker(make, options)


def _cut(
    made_from: SurfelSource, options: ConvertOptions, count: int, near_m: float,
    progress: Progress = silent,
) -> Level:  # fmt: skip
    """A level of surfel billboards, of at most twice as many triangles as `count`."""
    from vegtool.refine.level import Wanted
    from vegtool.surfels.level import surfel_level

    most = TRIANGLES_PER_BILLBOARD * count
    wanted = Wanted(most, near_m, options.max_texture, options.seed)
    return surfel_level(made_from, wanted, progress)


def _hybrid(
    source: Source, options: ConvertOptions, count: int, near_m: float, progress: Progress = silent
) -> Level:
    """A hybrid level, of at most twice as many triangles as `count`, or as its weights have it."""
    from vegtool.hybrid.level import hybrid_level
    from vegtool.hybrid.options import Budget, Weights
    from vegtool.refine.level import Wanted

    most = TRIANGLES_PER_BILLBOARD * count
    wanted = Wanted(most, near_m, options.max_texture, options.seed)
    told = options.weights
    aim = Budget(most, options.fill) if told is None else Weights.read(told)
    return hybrid_level(source, wanted, aim, options.proposals == "costliest", progress)


def billboard_level(
    buffers: PlantBuffers,
    options: ConvertOptions,
    lit: BakedLight | None,
    count: int,
    near_m: float,
    progress: Progress = silent,
) -> Level:
    """One level of at most `count` billboards, its atlas made for a distance of `near_m` metres.

    lit: light that goes into its colours.
    """
    from vegtool.baking.bake import bake
    from vegtool.boxes import fit_budget, geometric_error
    from vegtool.clustering import cluster

    plant, weight = buffers.plant, options.orientation_weight
    seconds = {"clustering": 0.0, "boxes": 0.0}

    def clusters(wanted: int) -> IntArray:
        with timed(seconds, "clustering"):
            how = ClusterOptions(orientation_weight=weight)
            return cluster(plant, options.method, wanted, how, options.seed)

    progress("clustering", 0.0)
    with timed(seconds, "boxes"):
        box_options = BoxOptions(
            shape=cast(Shape, options.shape), plane="orientation" if weight else "volume"
        )
        labels, billboards = fit_budget(plant, clusters, count, box_options)
        error = geometric_error(plant, labels, billboards)
    seconds["boxes"] -= seconds["clustering"]
    baked = bake(
        buffers,
        labels,
        billboards,
        options.display.pixels_per_metre(near_m),
        BakeOptions(max_texture=options.max_texture),
        lambda stage, fraction: progress(stage, 0.4 + 0.6 * fraction),
        lit=lit,
    )
    return replace(
        baked,
        near_distance_m=near_m,
        geometric_error_m=error,
        seconds={**seconds, **baked.seconds},
    )


def billboard_counts(plant: Plant, options: ConvertOptions) -> list[int]:
    """Planes per level, finest first: half each time, never more than the plant can use."""
    asked = options.billboards
    if options.triangles is not None:
        asked = max(1, options.triangles // TRIANGLES_PER_BILLBOARD)
    first = min(asked, most_billboards(plant))
    return [max(1, round(first / LEVEL_RATIO**i)) for i in range(options.levels)]


def point_count(plant: Plant, options: ConvertOptions) -> int:
    """Surfels of the first level: as many as the user says, or half of the plant's triangles
    (Brandt et al. 2019, section 5.2)."""
    if options.points is not None:
        return options.points
    return min(max(len(plant.faces) // 2, FEWEST_POINTS), MOST_POINTS)


def near_distances(counts: Sequence[int], first_m: float, farthest_m: float) -> list[float]:
    """Metres from which levels of so many planes are to be used: twice as far each time; beyond the
    farthest that pictures are made for, only with fewer planes."""
    near = [first_m]
    for before, count in pairwise(counts):
        twice = rounded_up(LEVEL_RATIO * near[-1])
        near.append(twice if count < before else max(near[-1], min(twice, farthest_m)))
    return near


def most_billboards(plant: Plant) -> int:
    """More planes than these save none of the plant's triangles that is worth it."""
    return max(1, int(MOST_OF_PREVIOUS * len(plant.faces) / TRIANGLES_PER_BILLBOARD))


def near_pixels(count: int) -> float:
    """Size on the screen (pixels, the plant's longest side) that `count` billboards are made for.

    A third of the billboards would be for half the size; an atlas is made for it.
    """
    pixels, billboards = NEAR_PIXELS
    size = float(pixels * (count / billboards) ** (log(2) / log(NEAR_GROWTH)))
    return min(max(size, NEAR_LIMITS[0]), NEAR_LIMITS[1])
