"""Models for the tests of tiles: with all of their billboards, or with some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.lod import Display
from vegtool.plant import Plant
from vegtool.surfels.bake import SurfelAtlas
from vegtool.surfels.base import base_of
from vegtool.surfels.make import surfel_model
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.reduce import kept


def with_some(model: SurfelModel, keep: np.ndarray) -> SurfelModel:
    """The same with some of its billboards, (b,) bool."""
    one = kept(base_of(model.triangles), model.hierarchy, keep)
    atlas = model.textures.atlas
    some = replace(atlas, front=atlas.front[keep], back=atlas.back[keep])
    textures = SurfelAtlas(some, model.textures.behind[keep])
    return replace(model, hierarchy=one, textures=textures)


def without(plant: Plant, display: Display) -> SurfelModel:
    """A model of triangles alone."""
    model = surfel_model(plant, display=display)
    return with_some(model, np.zeros(len(model.hierarchy), bool))
