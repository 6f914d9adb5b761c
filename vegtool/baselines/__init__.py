"""What others do, to be measured beside ours: mesh reduction, crossed billboards, impostors.

A baseline is one line in `BASELINES`: where it is made, whether it is made for a number of
triangles, and whether it is emulated.
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
    """run: module:function within this room. budgeted: made for a number of triangles, and so once
    for every budget; else once for a plant. emulated: no stock client draws it."""

    run: str
    budgeted: bool
    emulated: bool = False


BASELINES: dict[str, Maker] = {
    "quadric": Maker("quadric:quadric", budgeted=True),
    "gltfpack": Maker("gltfpack:gltfpack", budgeted=True),
    "crossed": Maker("crossed:crossed", budgeted=False),
    "octahedral": Maker("octahedral:octahedral", budgeted=False, emulated=True),
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
