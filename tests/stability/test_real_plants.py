"""Real plants, moved, scaled and turned, are clustered alike: no face changes its cluster."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vegtool.clustering import METHODS, cluster
from vegtool.formats import read_plant
from vegtool.plant import Plant
from vegtool.stability.plants import MOTIONS

FAR = 1e4
"""Radii."""


def thickness(plant: Plant, labels: np.ndarray) -> float:
    """Radii: of clusters about the plane that fits each best, the root mean square."""
    points, of = plant.face_centroids - plant.center, np.bincount(labels)
    total = 0.0
    for label in range(len(of)):
        own = points[labels == label]
        offset = own - own.mean(axis=0)
        total += float(np.linalg.eigvalsh(offset.T @ offset)[0])
    return float(np.sqrt(total / len(labels))) / plant.radius


@pytest.mark.models
@pytest.mark.parametrize("name", ["eztree_ash_small", "eztree_pine_medium", "proctree_default"])
def test_clusters_stay(name: str, models: Path) -> None:
    file = next(f for f in sorted((models / name).iterdir()) if f.suffix in (".glb", ".obj"))
    plant = read_plant(file)
    for method in METHODS:
        here = cluster(plant, method, 100)
        for motion in MOTIONS:
            there = cluster(motion.plant(plant), method, 100)
            if method == "planes" and motion.offset_over(plant.radius) > FAR:
                # which of many planes as dense is taken first is up to rounding there
                off, own = (thickness(plant, labels) for labels in (there, here))
                assert off == pytest.approx(own, rel=0.1), motion.name
                continue
            assert np.array_equal(here, there), f"{method}, {motion.name}"
