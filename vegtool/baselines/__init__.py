"""What others do, to be measured beside ours: mesh reduction, crossed billboards, impostors.

A baseline is one line in `BASELINES`: where it is made, the sentence that the report shows, and
whether it is made for a number of triangles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from vegtool.errors import VegtoolError

if TYPE_CHECKING:
    from vegtool.baselines.octahedral import Octahedral
    from vegtool.lod import Level
    from vegtool.plant import Plant


@dataclass(frozen=True)
class Maker:
    """run: module:function within this room. about: what it is. budgeted: made for a number of
    triangles, and so once for every budget; else once for a plant."""

    run: str
    about: str
    budgeted: bool


BASELINES: dict[str, Maker] = {
    "quadric": Maker("quadric:quadric", "quadric edge collapse, leaves thinned and enlarged", True),
    "gltfpack": Maker("gltfpack:gltfpack", "gltfpack -si -sa, where it is installed", True),
    "crossed": Maker("crossed:crossed", "two crossed billboards of the whole plant", False),
    "octahedral": Maker("octahedral:octahedral", "octahedral impostor, 16 x 16 frames", False),
}


@dataclass(frozen=True, eq=False)
class Baseline:
    """A baseline of one plant.

    level: what is drawn, or what gives it for a view, or None where it could not be made; missing
    then says why, in a sentence. triangles, texels: what a client holds of it, of an impostor all
    frames.
    """

    name: str
    level: Level | Octahedral | None = None
    missing: str = ""
    triangles: int = 0
    texels: int = 0

    @property
    def seconds(self) -> Mapping[str, float]:
        """By stage of making it; asked of an impostor once frames of it were shown."""
        return self.level.seconds if self.level is not None else {}


def baseline(plant: Plant, name: str, triangles: int = 0) -> Baseline:
    """Make the baseline `name` of a plant, with about as many triangles where it is budgeted.

    Errors that vegtool raises on purpose are caught and become `missing`; KeyError for a name that
    is not in BASELINES.
    """
    maker = BASELINES[name]
    module, function = maker.run.split(":")
    run = getattr(import_module(f"{__name__}.{module}"), function)
    try:
        made = run(plant, triangles) if maker.budgeted else run(plant)
    except VegtoolError as error:
        return Baseline(name, missing=str(error))
    return Baseline(name, made, "", made.triangles, made.texels)
