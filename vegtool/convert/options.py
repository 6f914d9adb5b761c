"""What shapes a chain of levels, declared once."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import get_args

from vegtool.baking.options import BakeOptions
from vegtool.boxes.options import BoxOptions, Shape
from vegtool.clustering import METHODS, ClusterOptions
from vegtool.display import Display
from vegtool.errors import UsageError
from vegtool.lighting.light import Sun
from vegtool.options import flag_of, option, same_option
from vegtool.surfels.options import SurfelOptions

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
SURFEL_BILLBOARDS = "surfel-billboards"
SURFELS = "surfels"
OF_METHODS = {
    HYBRID: ("weights", "triangles", "fill", "proposals"),
    SURFEL_BILLBOARDS: tuple(item.name for item in fields(SurfelOptions)),
    SURFELS: ("points", "quantized"),
}
"""Methods beside refinement, and options of theirs alone."""

OF_PICTURES = ("billboards", "pixels", "max_texture")
"""Options that say nothing of surfels."""
FEWEST_POINTS, MOST_POINTS = 1_000, 200_000
"""Surfels of a level for which the user says no number."""

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
        f"triangles they show give way to a mesh; {SURFEL_BILLBOARDS}: a hierarchy of billboards "
        f"over triangles, of which a level has what its distance asks for; {SURFELS}: points in an "
        "order of which any first part is a picture of the whole.",
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
        "it, 0 none; written as occlusion textures, or with each surfel [0; with --prelit, 1].",
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
    points: int | None = option(
        None,
        "Surfels of the first level, and a quarter as many of each next one [half of the plant's "
        f"triangles, from {FEWEST_POINTS:,} to {MOST_POINTS:,}].",
        least=1,
        most=100_000_000,
    )
    quantized: bool = option(
        False,
        "Surfels as 24 bytes each, not 36 (4 more with light of their own), for clients that know "
        "KHR_mesh_quantization.",
    )
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
            if item.name in OF_PICTURES and self.method == SURFELS:
                raise UsageError(f"{flag_of(item)}: says nothing of surfels; leave it out")
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
    def surfel_billboards(self) -> SurfelOptions:
        """What shapes a hierarchy of surfel billboards."""
        own = OF_METHODS[SURFEL_BILLBOARDS]
        return SurfelOptions(**{name: getattr(self, name) for name in own})
