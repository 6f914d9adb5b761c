"""Levels as they are converted, on real plants."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.baking.bake import bake
from vegtool.boxes import make_billboards
from vegtool.clustering import ClusterOptions, cluster
from vegtool.formats import read_plant
from vegtool.gl.upload import PlantBuffers

LEVELS = ((240, 300.0), (80, 150.0), (27, 75.0), (9, 37.5))
"""Clusters, most of them shown by two or three billboards, and the plant's height in texels."""


@pytest.mark.models
@pytest.mark.gl
@pytest.mark.parametrize("name", ["eztree_ash_small", "eztree_pine_medium"])
def test_levels_fill_their_atlas_and_keep_the_rules(models, name):
    plant = read_plant(models / name / f"{name}.glb")
    with PlantBuffers(plant) as buffers:
        for count, height in LEVELS:
            labels = cluster(plant, "kmeans", count, ClusterOptions())
            boards = make_billboards(plant, labels)
            baked = bake(buffers, labels, boards, height / plant.height)
            atlas = baked.atlas
            assert baked.double_sided  # leaves are double-sided, wood is closed
            assert baked.texels_per_metre == height / plant.height
            assert (atlas.normal[..., 2] >= 128).mean() > 0.98  # some of the bark's look away
            shown = atlas.color[..., 3] > 0
            picture, around = np.zeros((2, *shown.shape), dtype=bool)
            for x, y, w, h in atlas.front:
                picture[y : y + h, x : x + w] = True
                around[y - 2 : y + h + 2, x - 2 : x + w + 2] = True
                shown_here = shown[y : y + h, x : x + w]
                if shown_here.any():  # dilated: nothing black is left where something is shown
                    assert atlas.color[y : y + h, x : x + w, :3].any(axis=-1).all()
            assert around.mean() >= 0.75
            assert (atlas.depth[shown & picture] > 0).all()
            assert (atlas.depth[~(shown & picture)] == 0).all()
            assert not (shown & ~around).any()  # gutters repeat the edge, the rest is empty
        assert buffers.ctx.error == "GL_NO_ERROR"
