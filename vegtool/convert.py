"""The pipeline for one plant: Plant and options in, a chain of levels out.

Every level is made for half the size on the screen of the one before, with half of its triangles,
and its atlas, where it has one, holds one texel per pixel at that size. What makes it is
refine/level.py or, with --refine none, the method of Colditz et al. 2005, section 2: clusters of
the plant's faces, a box around each, one to three billboards per box, textures baked from the
faces. From where it may be used is measured then (measure/chain.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from itertools import pairwise
from math import log
from typing import TYPE_CHECKING, cast, get_args

from vegtool.arrays import IntArray
from vegtool.baking.options import BakeOptions
from vegtool.boxes.options import BoxOptions, Shape
from vegtool.clustering import METHODS, ClusterOptions
from vegtool.errors import UsageError
from vegtool.lighting.crown import crown_normals
from vegtool.lighting.leaves import translucent
from vegtool.lighting.light import Light, Sun
from vegtool.lod import Display, Level, LodChain
from vegtool.measure.distances import rounded_up
from vegtool.measure.options import MeasureOptions
from vegtool.measure.views import distance_of
from vegtool.options import check_limits, flag_of, option, same_option
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.surfels.options import SurfelOptions
from vegtool.timing import timed

if TYPE_CHECKING:
    from vegtool.baking.bake import PlantBuffers
    from vegtool.gl.pictures import BakedLight
    from vegtool.measure.scores import TruthsAt
    from vegtool.refine.level import Source
    from vegtool.surfels.level import SurfelSource

LEVEL_RATIO = 2
"""Each level has half the billboards of the one before, for half its size on the screen."""

NEAR_PIXELS = (200.0, 512)
"""Size of a plant on the screen (pixels, its longest side) that so many billboards are made for."""
NEAR_GROWTH = 3
"""So many times the billboards are for twice the size, where nothing else is said."""

NEAR_LIMITS = (8.0, 1024.0)
"""Pixels. Below, even one billboard's picture has too few texels to be one; above, a plant is as
large as the screen."""

MOST_OF_PREVIOUS = 0.75
"""A level has at most this share of the triangles of the one before it, or it is left out."""

MAKING = 0.4
"""Share of the time that goes into levels that are measured, about."""
PREPARING = 0.7
"""Share of that which goes into a hierarchy, before there is any level."""

MOST_BILLBOARDS = 100_000

PLAIN = ("method", "orientation_weight", "shape")
"""Options of the plain method alone."""

HYBRID = "hybrid"
SURFELS = "surfel-billboards"
OF_METHODS = {
    HYBRID: ("weights", "triangles", "fill", "proposals"),
    SURFELS: tuple(item.name for item in fields(SurfelOptions)),
}
"""Methods beside refinement, and options of theirs alone."""

TRIANGLES_PER_BILLBOARD = 2
"""At least: four where both sides have pictures of their own."""


@dataclass(frozen=True)
class ConvertOptions:
    """What shapes a chain of levels. The command line makes its flags from these fields.

    Raises UsageError for an option of the plain method beside another one.
    """

    method: str = option(
        "branches",
        "What clusters of --refine none are like. "
        + "; ".join(f"{k}: {v}" for k, (_, v) in METHODS.items())
        + f". Or, with --refine full, {HYBRID}: planes of which those that are dearer than the "
        f"triangles they show give way to a mesh; {SURFELS}: a hierarchy of billboards over "
        "triangles, of which a level has what its distance asks for.",
        choices=(*METHODS, *OF_METHODS),
        short="m",
    )
    weights: str | None = option(
        None,
        "Of what a hybrid costs: error=1,polygons=1,fill=0.1, all three as shares of the "
        "original's; what is not named is so [as its triangles allow].",
        metavar="NAME=NUMBER,...",
    )
    triangles: int | None = option(
        None,
        "Triangles of the first hybrid level, at most, and half as many of each next one [two for "
        "each of --billboards].",
        least=2,
        most=TRIANGLES_PER_BILLBOARD * MOST_BILLBOARDS,
    )
    fill: float | None = option(
        None,
        "Fragments of a hybrid level, hidden ones included, as a share of the original's, at most.",
        least=0.0,
        most=1e6,
    )
    proposals: str = option(
        "all",
        "What is looked at for each step of a hybrid: all billboards, or the costliest alone: that "
        "is faster, and ends a little dearer.",
        choices=("all", "costliest"),
    )
    billboards: int = option(
        512,
        "Planes of the first billboard level; crossed shapes count two or three.",
        least=1,
        most=MOST_BILLBOARDS,
        short="b",
    )
    levels: int = option(
        4,
        "Billboard levels to make, each of half the planes; those of no use are left out.",
        least=1,
        most=12,
    )
    pixels: float | None = option(
        None,
        "Size on the screen that the first level is made for, in pixels of the plant's longest "
        f"side, and each level for half of it [by --billboards: {NEAR_PIXELS[0]:g} for "
        f"{NEAR_PIXELS[1]}].",
        least=NEAR_LIMITS[0],
        most=NEAR_LIMITS[1],
    )
    refine: str = option(
        "full",
        "full: planes by image error, wood as a small mesh, coverage and colour as measured; "
        "opaque: the same, with triangles in place of pictures, for viewers that can fill little; "
        "none: the paper's billboards.",
        choices=("full", "opaque", "none"),
    )
    orientation_weight: float = option(
        ClusterOptions().orientation_weight,
        "How much clusters of --refine none follow face orientation, beside position; 0 is the "
        "paper's method.",
        least=0.0,
        most=100.0,
    )
    shape: str = option(
        BoxOptions().shape,
        "Billboards per cluster of --refine none: by the box's form, one, or crossed.",
        choices=get_args(Shape),
    )
    prelit: bool = option(
        False,
        "Levels with the light of one sun in their colours, its shadows too, and without normal "
        "textures; needs --sun.",
    )
    sun: str | None = option(
        None,
        "Where the sun of --prelit stands: azimuth from +z towards +x, and elevation, in degrees.",
        metavar="AZ,EL",
    )
    occlusion: float | None = option(
        None,
        "How much less of the sky's light reaches what the plant itself hides from it: 1 is all of "
        "it, 0 none; written as occlusion textures [0; with --prelit, 1].",
        least=0.0,
        most=1.0,
    )
    translucency: float | None = option(
        None,
        "Share of light that leaves let through, in their own colour [as the file says, or none].",
        least=0.0,
        most=1.0,
    )
    crown_normals: float = option(
        0.0,
        "How far the normals of leaves are bent towards those of the crown as a whole, in the "
        "levels alone: 1 is all the way.",
        least=0.0,
        most=1.0,
    )
    shadow_proxy: int | None = option(
        None,
        "Make something of at most so many triangles to throw the plant's shadow too.",
        least=TRIANGLES_PER_BILLBOARD,
        most=TRIANGLES_PER_BILLBOARD * MOST_BILLBOARDS,
        metavar="TRIANGLES",
    )
    epsilon: float = same_option(SurfelOptions, "epsilon")
    theta: float = same_option(SurfelOptions, "theta")
    ds_max: float = same_option(SurfelOptions, "ds_max")
    max_texture_memory: float = same_option(SurfelOptions, "max_texture_memory")
    max_texture: int = option(
        BakeOptions().max_texture, "Largest side of an atlas, in texels.", least=16, most=16384
    )
    fov: float = option(
        Display().fov_y_deg,
        "Vertical field of view that distances are for, in degrees.",
        least=1.0,
        most=170.0,
    )
    image_height: int = option(
        Display().image_height_px,
        "Image height that distances are for, in pixels.",
        least=16,
        most=32768,
    )
    seed: int = option(0, "Seed of every random choice.", least=0)

    def __post_init__(self) -> None:
        beside = self.method in OF_METHODS
        changed = [item for item in fields(self) if getattr(self, item.name) != item.default]
        for item in changed:
            plain = item.name in PLAIN and not (beside and item.name == "method")
            if plain and self.refine != "none":
                raise UsageError(f"{flag_of(item)}: is the plain method's; add --refine none")
            for method, own in OF_METHODS.items():
                if item.name in own and self.method != method:
                    raise UsageError(
                        f"{flag_of(item)}: is of another method alone; add --method {method}"
                    )
        if beside and self.refine != "full":
            raise UsageError(f"--method {self.method}: goes with --refine full; leave --refine out")
        if self.weights is not None:
            from vegtool.hybrid.options import Weights

            Weights.read(self.weights)
            if self.triangles is not None or self.fill is not None:
                raise UsageError(
                    "--weights: say what a hybrid costs, or what it may have: --triangles, --fill"
                )
        if self.sun is not None:
            if not self.prelit:
                raise UsageError("--sun: is where the light of --prelit comes from; add --prelit")
            Sun.read(self.sun)

    @property
    def baked_sun(self) -> Sun | None:
        """The sun whose light goes into colours. Raises UsageError where it is not said."""
        if not self.prelit:
            return None
        if self.sun is None:
            raise UsageError(
                "--prelit: expected where the sun stands; add --sun AZ,EL, in degrees, such as "
                "--sun 135,40"
            )
        return Sun.read(self.sun)

    @property
    def display(self) -> Display:
        """For whom distances are stated."""
        return Display(self.fov, self.image_height)

    @property
    def surfels(self) -> SurfelOptions:
        """What shapes a hierarchy of surfel billboards."""
        return SurfelOptions(**{name: getattr(self, name) for name in OF_METHODS[SURFELS]})


def convert(
    plant: Plant,
    options: ConvertOptions | None = None,
    measure: MeasureOptions | None = None,
    progress: Progress = silent,
) -> LodChain:
    """Make the chain of levels of one plant.

    levels[0] is the plant itself. Of the others there is one at least, and no more than save
    triangles and may be used somewhere; `notes` name those that are of no use, and those that are
    used farther than their coverage keeps. Raises UsageError for options out of range, QualityError
    where no level keeps to `measure.max_error`, CapabilityError where nothing can draw.
    """
    from vegtool.baking.bake import PlantBuffers
    from vegtool.gl.sun import SunMaps
    from vegtool.measure.chain import views_of, with_distances
    from vegtool.measure.scores import Shadowed, TruthsAt

    options, measure = options or ConvertOptions(), measure or MeasureOptions()
    check_limits(options)
    check_limits(measure)
    sun = options.baked_sun
    plant = as_lit(plant, options)
    making = 1.0 if measure.measure == "off" else MAKING
    levels = [Level("mesh", mesh=plant, geometric_error_m=(0.0, 0.0))]
    with ExitStack() as stack:
        buffers = stack.enter_context(PlantBuffers(plant))
        under = None
        if sun is not None:
            maps = stack.enter_context(SunMaps([buffers], sun.direction))
            under = Shadowed(sun.light, maps)
        truth_at = TruthsAt(plant, views_of(measure), options.display, buffers, under)
        baked_from = buffers
        if options.crown_normals:
            crowned = crown_normals(plant, options.crown_normals)
            baked_from = stack.enter_context(PlantBuffers(crowned))
        before = PREPARING * making if options.method == SURFELS else 0.0
        make = level_maker(
            baked_from, truth_at, options, progress=lambda s, f: progress(s, before * f)
        )
        farthest = rounded_up(distance_of(plant, options.display, NEAR_LIMITS[0]))
        wanted = wanted_levels(plant, options, make, farthest)
        for index, (count, near) in enumerate(wanted):

            def report(stage: str, fraction: float, index: int = index) -> None:
                done = before + (making - before) * (index + fraction) / len(wanted)
                progress(f"LOD{index + 1}: {stage}", done)

            level = replace(make(count, min(near, farthest), report), near_distance_m=near)
            saves = level.triangles <= MOST_OF_PREVIOUS * levels[-1].triangles
            if saves or (index == len(wanted) - 1 and len(levels) == 1):
                levels.append(level)
        shadow = None
        if options.shadow_proxy is not None:
            from vegtool.refine.shadow_proxy import shadow_proxy

            most = min(options.shadow_proxy // TRIANGLES_PER_BILLBOARD, most_billboards(plant))
            shadow = shadow_proxy(
                plant,
                options.display,
                lambda casting, seen, near_m: level_maker(casting, seen, options, casts=True)(
                    most, near_m, lambda stage, _: progress(stage, making)
                ),
                wanted[0][1],
            )
        kept, notes = with_distances(
            plant,
            levels[1:],
            measure,
            options.display,
            lambda stage, fraction: progress(stage, making + (1 - making) * fraction),
            truth_at,
        )
        if options.refine != "none":
            from vegtool.refine.reach import coverage_notes

            notes = (*notes, *coverage_notes(kept, truth_at))
    notes = (*notes, *light_notes(plant, sun))
    misses, beside = budget_notes(kept, options), {}
    if isinstance(make, SurfelLevels):
        from vegtool.surfels.options import SUFFIX
        from vegtool.surfels.store import surfels_bytes

        model = make.made_from.model
        misses, beside = model.notes, {SUFFIX: surfels_bytes(model.without_exposure())}
        if sun is not None or plant.exposure is not None:
            notes = (*notes, f"light that is baked is in the levels, not in {plant.name}{SUFFIX}")
    progress("levels", 1.0)
    told = {**asdict(options), **asdict(measure)}
    baked = {} if sun is None else sun.as_dict()
    return LodChain(
        plant.name,
        (levels[0], *kept),
        options.display,
        options.seed,
        told,
        notes,
        baked,
        shadow,
        misses,
        beside,
    )


def wanted_levels(
    plant: Plant, options: ConvertOptions, make: LevelMaker, farthest_m: float
) -> list[tuple[int, float]]:
    """Of each level, how many billboards it may have and from how many metres it is for; none from
    farther than pictures are made for, but with fewer billboards."""
    from vegtool.measure.scores import LADDER

    counts = billboard_counts(plant, options)
    if isinstance(make, SurfelLevels) and options.pixels is None:
        nearest = distance_of(plant, options.display, LADDER[0])
        return [(count, rounded_up(max(make.nearest_m(count), nearest))) for count in counts]
    size = options.pixels or near_pixels(counts[0])
    first = rounded_up(distance_of(plant, options.display, size))
    near_m = near_distances(counts, first, farthest_m)
    if isinstance(make, SurfelLevels):  # as many as the error asks for, which the distance has
        counts = [MOST_BILLBOARDS] * len(counts)
    return list(zip(counts, near_m, strict=True))


def endings(options: ConvertOptions) -> tuple[str, ...]:
    """Of the names of files that are made beside the levels (LodChain.beside)."""
    from vegtool.surfels.options import SUFFIX

    return (SUFFIX,) if options.method == SURFELS else ()


def budget_notes(levels: Sequence[Level], options: ConvertOptions) -> tuple[str, ...]:
    """Sentences on hybrids of more triangles than were allowed."""
    if options.triangles is None:
        return ()
    over = [
        f"LOD{number}: no hybrid was found of {options.triangles:,} triangles or fewer; it has "
        f"{level.triangles:,}"
        for number, level in enumerate(levels, start=1)
        if level.triangles > options.triangles
    ]
    return tuple(over)


def light_notes(plant: Plant, sun: Sun | None) -> tuple[str, ...]:
    """Sentences on light that is not what it may seem."""
    notes = []
    if sun is not None and sun.elevation_deg < 0:
        notes.append("the sun is below the horizon: the levels' colours have the sky's light alone")
    unlit = [material.name for material in plant.materials if material.unlit]
    if 0 < len(unlit) < len(plant.materials):
        notes.append(f"unlit beside others that are lit: levels light it too: {', '.join(unlit)}")
    return tuple(notes)


def as_lit(plant: Plant, options: ConvertOptions) -> Plant:
    """The plant with what the options say of light: its exposure, and what leaves let through."""
    if options.translucency is not None:
        plant = translucent(plant, options.translucency)
    strength = float(options.prelit) if options.occlusion is None else options.occlusion
    if strength:
        from vegtool.refine.occlusion import exposed

        plant = exposed(plant, strength)
    return plant


LevelMaker = Callable[[int, float, Progress], Level]
"""Makes a level of at most so many billboards, or so many triangles twice over, for distances from
so many metres on."""


@dataclass(frozen=True, eq=False)
class SurfelLevels:
    """Makes levels of surfel billboards."""

    made_from: SurfelSource
    options: ConvertOptions

    def nearest_m(self, count: int) -> float:
        """Metres from which so many billboards, or triangles in their place, are enough."""
        return self.made_from.nearest_m(TRIANGLES_PER_BILLBOARD * count)

    def __call__(self, count: int, near_m: float, progress: Progress = silent) -> Level:
        from vegtool.refine.level import Wanted
        from vegtool.surfels.level import surfel_level

        most = TRIANGLES_PER_BILLBOARD * count
        wanted = Wanted(most, near_m, self.options.max_texture, self.options.seed)
        return surfel_level(self.made_from, wanted, progress)


def level_maker(
    buffers: PlantBuffers, truth_at: TruthsAt, options: ConvertOptions, casts: bool = False,
    progress: Progress = silent,
) -> LevelMaker:  # fmt: skip
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
        return partial(billboard_level, buffers, options, lit)
    from vegtool.hybrid.or_refined import refined_or_hybrid
    from vegtool.refine.level import Wanted, refined_level, source_of

    source = source_of(buffers, truth_at, lit)
    if options.method == HYBRID and not casts:  # a shadow has no colours to keep
        return partial(_hybrid, source, options)
    if options.method == SURFELS and not casts:
        from vegtool.surfels.level import SurfelSource
        from vegtool.surfels.make import surfel_model

        model = surfel_model(
            buffers.plant, options.surfels, options.display, options.max_texture, progress
        )
        return SurfelLevels(SurfelSource(source, model), options)

    def make(count: int, near_m: float, progress: Progress) -> Level:
        most = TRIANGLES_PER_BILLBOARD * count
        balance = not casts and not options.crown_normals  # which it would bend back
        textured = options.refine != "opaque"
        wanted = Wanted(most, near_m, options.max_texture, options.seed, balance, textured)
        return (refined_level if casts else refined_or_hybrid)(source, wanted, progress)

    return make


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
