"""ISODATA with lines: long and thin clusters."""

from __future__ import annotations

import numpy as np
from cluster_cases import cards
from plants import plant_of

from vegtool.clustering import ClusterOptions, cluster
from vegtool.plant import Plant


def rods(count: int, gap: float) -> np.ndarray:
    """Rows of equal small triangles along x, 20 to a row of length one, rows `gap` apart in y."""
    triangle = 0.01 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    places = [(x / 19, row * gap, 0.0) for row in range(count) for x in range(20)]
    return np.stack([triangle + np.array(place) for place in places])


def test_rods_close_together_are_kept_whole() -> None:
    """Rods of length 1, 0.25 apart: compact clusters cut across both, long ones take one each."""
    plant = plant_of(rods(2, 0.25))
    assert cluster(plant, "kmeans", 2).tolist() != [0] * 20 + [1] * 20
    found = cluster(plant, "isodata", 2, ClusterOptions(elongation=4.0))
    assert found.tolist() == [0] * 20 + [1] * 20


def length_to_width(plant: Plant, labels: np.ndarray) -> float:
    """Median ratio of the first to the second principal deviation of the clusters' centroids."""
    ratios = []
    for label in range(int(labels.max()) + 1):
        mine = plant.face_centroids[labels == label]
        spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(mine.T)), 1e-30))
        ratios.append(spread[2] / spread[1])
    return float(np.median(ratios))


def test_clusters_get_longer_with_elongation() -> None:
    plant = plant_of(cards(3_000))
    lengths = [
        length_to_width(plant, cluster(plant, "isodata", 60, ClusterOptions(0.0, elongation=e)))
        for e in (1.0, 2.0, 4.0)
    ]
    assert lengths[0] < lengths[1] < lengths[2]
    assert lengths[2] > 2
