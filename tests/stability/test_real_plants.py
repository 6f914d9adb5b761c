"""Real plants, moved, scaled and turned, are clustered alike: no face changes its cluster."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vegtool.clustering import METHODS, cluster
from vegtool.formats import read_plant
from vegtool.stability.plants import MOTIONS


@pytest.mark.models
@pytest.mark.parametrize("name", ["eztree_ash_small", "eztree_pine_medium", "proctree_default"])
def test_clusters_stay(name: str, models: Path) -> None:
    file = next(f for f in sorted((models / name).iterdir()) if f.suffix in (".glb", ".obj"))
    plant = read_plant(file)
    for method in METHODS:
        here = cluster(plant, method, 100)
        for motion in MOTIONS:
            there = cluster(motion.plant(plant), method, 100)
            assert np.array_equal(here, there), f"{method}, {motion.name}"
