"""Surfel billboards as a place to walk through: a row of plants, each of a file of its own."""

from __future__ import annotations

from dataclasses import dataclass
from math import isclose
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.gl.landscape import GroundMesh
from vegtool.gl.surfel_data import SurfelData
from vegtool.lighting.light import Sun
from vegtool.lod import Display
from vegtool.preview.eye import FOV_Y_DEG, Eye
from vegtool.preview.options import FadeMode
from vegtool.preview.surfel_forest import SurfelForest
from vegtool.preview.world import in_a_row
from vegtool.surfels.drawn import drawn_data
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.store import read_surfels

SAME = 1e-3
"""Of pixels to a metre: what differs by less is the same."""


@dataclass(frozen=True, eq=False)
class SurfelWorld:
    """See scenery.Place. models, data: of each plant, the model and what is drawn of it. foot:
    (n, 3) metres, of their origins."""

    models: tuple[SurfelModel, ...]
    data: tuple[SurfelData, ...]
    foot: FloatArray
    start: Eye
    target: FloatArray
    ground: GroundMesh | None
    ground_m: float
    notes: tuple[str, ...] = ()
    sun: Sun | None = None
    way: Path | None = None
    orbited: bool = True
    progressive: bool = False

    def height_at(self, x: float, z: float) -> float:
        """Metres: of the ground, which is flat."""
        return self.ground_m

    def scenery(self, fade: FadeMode) -> SurfelForest:
        """What draws it; nothing is uploaded yet. Billboards follow each other at once."""
        epsilon = [model.options.epsilon for model in self.models]
        return SurfelForest(self.data, epsilon, self.foot, self.ground)

    def details(self, focal_px: float) -> list[str]:
        """What each model has, and from where on it is drawn as what."""
        return [
            _detail(model, data, focal_px)
            for model, data in zip(self.models, self.data, strict=True)
        ]


def read_surfel_world(file: Path, image_height_px: int) -> SurfelWorld:
    """The place of a file of surfel billboards, for pictures of a height. Raises InputError for one
    that is missing or broken."""
    return surfel_world([read_surfels(file)], image_height_px)


def surfel_world(models: list[SurfelModel], image_height_px: int) -> SurfelWorld:
    """Models side by side."""
    low, high = (np.array([model.plant.bounds[i] for model in models]) for i in (0, 1))
    sunk = low[:, 1].copy()
    low[:, 1] -= sunk
    high[:, 1] -= sunk
    row = in_a_row(low, high)
    row.foot[:, 1] = -sunk
    seen = Display(FOV_Y_DEG, image_height_px)
    notes = [note for model in models for note in (*model.notes, *_made_for(model, seen))]
    return SurfelWorld(
        tuple(models), tuple(drawn_data(model) for model in models), row.foot, row.start,
        row.target, row.ground, row.terrain.base, tuple(notes),
    )  # fmt: skip


def _made_for(model: SurfelModel, seen: Display) -> list[str]:
    """A note where it was made for pictures in which a metre has other pixels."""
    ratio = seen.pixels_per_metre(1.0) / model.display.pixels_per_metre(1.0)
    if isclose(ratio, 1.0, rel_tol=SAME):
        return []
    shown = f"{seen.image_height_px:,} pixels and {seen.fov_y_deg:g} degrees"
    return [
        f"{model.plant.source}: was made for pictures of {_pixels(model)}; in these, of {shown}, "
        f"billboards begin {ratio:.3g} times as far away, and err by as much of a pixel as stated"
    ]


def _pixels(model: SurfelModel) -> str:
    made = model.display
    return f"{made.image_height_px:,} pixels and {made.fov_y_deg:g} degrees"


def _detail(model: SurfelModel, data: SurfelData, focal_px: float) -> str:
    one, mt = model.hierarchy, model.triangles
    away = one.error * (focal_px / model.options.epsilon)
    begins = f" from {away.min():.3g} m, one alone from {away.max():.3g} m" if len(one) else ""
    return (
        f"{model.plant.name}: {len(one):,} billboards{begins}; {len(mt.plant.faces):,} triangles; "
        f"{data.atlas_bytes / 1e6:.1f} MB of textures, made for pictures of {_pixels(model)} "
        f"({model.plant.source})"
    )
