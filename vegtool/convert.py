"""The pipeline for one plant: Plant and options in, a chain of levels out.

After Colditz et al. 2005, section 2: clusters of the plant's faces, a box around each, one to three
billboards per box, textures baked from the faces. Every billboard level is for twice the distance
of the one before, with about a third of its billboards, and its atlas holds one texel per pixel at
the level's near end (DESIGN section 4, item 3).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import get_args

from vegtool.arrays import IntArray
from vegtool.baking import BakeOptions
from vegtool.boxes.options import BoxOptions, Shape
from vegtool.clustering import METHODS, ClusterOptions
from vegtool.errors import UsageError
from vegtool.lod import Billboards, Display, Level, LodChain
from vegtool.options import check_limits, option
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

LEVEL_RATIO = 3
"""Each level has about a third of the billboards of the one before."""

NEAR_PIXELS = 256
"""Size of the plant on the screen (pixels, its longest side) where the first billboard level takes
over from the geometry, until measuring states the distance: the atlas is made for it."""

LEAST_FACES_PER_BILLBOARD = 4
"""A billboard costs two triangles: a level must halve the original at least, or it is no level."""


@dataclass(frozen=True)
class ConvertOptions:
    """What shapes a chain of levels. The command line makes its flags from these fields."""

    method: str = option(
        "kmeans", "How faces are grouped into clusters.", choices=tuple(METHODS), short="-m"
    )
    billboards: int = option(
        512, "Planes of the first billboard level; crossed shapes count two or three.",
        least=1, most=100_000, short="-b",
    )
    levels: int = option(4, "Billboard levels, each for twice the distance.", least=1, most=12)
    orientation_weight: float = option(
        ClusterOptions().orientation_weight,
        "How much clusters follow face orientation, beside position; 0 is the paper's method.",
        least=0.0, most=100.0,
    )
    shape: str = option(
        BoxOptions().shape, "Billboards per cluster: by the box's form, one, or crossed.",
        choices=get_args(Shape),
    )
    max_texture: int = option(
        BakeOptions().max_texture, "Largest side of an atlas, in texels.", least=16, most=16384
    )
    fov: float = option(
        Display().fov_y_deg, "Vertical field of view that distances are for, in degrees.",
        least=1.0, most=170.0,
    )
    image_height: int = option(
        Display().image_height_px, "Image height that distances are for, in pixels.",
        least=16, most=32768,
    )
    seed: int = option(0, "Seed of every random choice.", least=0)

    @property
    def display(self) -> Display:
        """For whom distances are stated."""
        return Display(self.fov, self.image_height)


@dataclass(frozen=True, eq=False)
class LevelPlan:
    """A level before it is baked: which face is on which billboard, how dense, from how far."""

    labels: IntArray
    billboards: Billboards
    texels_per_metre: float
    near_distance_m: float
    geometric_error_m: tuple[float, float]
    seconds: dict[str, float]


def convert(
    plant: Plant, options: ConvertOptions | None = None, progress: Progress = silent
) -> LodChain:
    """Make the chain of levels of one plant.

    levels[0] is the plant itself, the others are billboards. Raises UsageError for options out of
    range and CapabilityError where nothing can draw.
    """
    from vegtool.baking import bake
    from vegtool.gl.upload import PlantBuffers

    options = options or ConvertOptions()
    check_limits(options)
    levels = [Level("mesh", mesh=plant)]
    counts = billboard_counts(plant, options)
    with PlantBuffers(plant) as buffers:
        for index, (plan, step) in enumerate(
            zip(plan_levels(plant, options, progress), counts, strict=False), start=1
        ):
            def stage(name: str, fraction: float, index: int = index) -> None:
                progress(f"LOD{index}: {name}", (index - 1 + 0.5 + 0.5 * fraction) / len(counts))

            baked = bake(
                buffers, plan.labels, plan.billboards, plan.texels_per_metre,
                BakeOptions(max_texture=options.max_texture), stage,
            )
            levels.append(
                Level(
                    "billboards",
                    billboards=plan.billboards,
                    atlas=baked.atlas,
                    double_sided=baked.double_sided,
                    texels_per_metre=baked.texels_per_metre,
                    near_distance_m=plan.near_distance_m,
                    geometric_error_m=plan.geometric_error_m,
                    seconds={**plan.seconds, **baked.seconds},
                )
            )
    progress("levels", 1.0)
    return LodChain(plant.name, tuple(levels), options.display, options.seed, asdict(options))


def plan_levels(
    plant: Plant, options: ConvertOptions, progress: Progress = silent
) -> Iterator[LevelPlan]:
    """The levels, finest first, without their textures: what `--dry-run` shows."""
    from vegtool.boxes import fit_budget, geometric_error
    from vegtool.clustering import cluster

    cluster_options = ClusterOptions(orientation_weight=options.orientation_weight)
    box_options = BoxOptions(
        shape=options.shape, plane="orientation" if options.orientation_weight else "volume"
    )
    counts = billboard_counts(plant, options)
    for index, budget in enumerate(counts):
        near = near_distance(plant, options.display, index)
        seconds: dict[str, float] = {}

        def clusters(count: int, seconds: dict[str, float] = seconds) -> IntArray:
            with timed(seconds, "clustering"):
                return cluster(plant, options.method, count, cluster_options, options.seed)

        progress(f"LOD{index + 1}: clustering", index / len(counts))
        with timed(seconds, "boxes"):
            labels, billboards = fit_budget(plant, clusters, budget, box_options)
            error = geometric_error(plant, labels, billboards)
        seconds["boxes"] -= seconds["clustering"]
        yield LevelPlan(
            labels, billboards, options.display.pixels_per_metre(near), near, error, seconds
        )


def billboard_counts(plant: Plant, options: ConvertOptions) -> list[int]:
    """Planes per level, finest first: a third each time, never more than the plant can use."""
    most = max(1, len(plant.faces) // LEAST_FACES_PER_BILLBOARD)
    first = min(options.billboards, most)
    counts = [max(1, round(first / LEVEL_RATIO**i)) for i in range(options.levels)]
    return counts


def near_distance(plant: Plant, display: Display, level: int) -> float:
    """Metres from which billboard level `level` (0 the finest) may be used."""
    size = float((plant.bounds[1] - plant.bounds[0]).max())
    if size <= 0:
        raise UsageError(f"{plant.source or plant.name}: expected a plant with an extent, found none")
    return display.distance_m(NEAR_PIXELS / size) * 2**level


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Add the time of the block to `seconds[stage]`."""
    start = perf_counter()
    try:
        yield
    finally:
        seconds[stage] = seconds.get(stage, 0.0) + perf_counter() - start
