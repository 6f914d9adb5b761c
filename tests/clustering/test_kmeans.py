"""k-means on faces: the smallest cases, then the objective against scikit-learn's."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.clustering import ClusterOptions, cluster
from vegtool.errors import UsageError
from vegtool.plant import Material, Plant


def plant_of(corners: np.ndarray) -> Plant:
    """A plant from (f, 3, 3) corners, as a triangle soup."""
    n = 3 * len(corners)
    return Plant(
        name="test",
        positions=corners.reshape(-1, 3),
        normals=np.tile([0.0, 1.0, 0.0], (n, 1)),
        uvs=np.zeros((n, 2)),
        faces=np.arange(n, dtype=np.int32).reshape(-1, 3),
        face_material=np.zeros(len(corners), dtype=np.int32),
        materials=(Material("leaf", role="leaf"),),
    )


def test_two_far_triangles_are_two_clusters() -> None:
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    plant = plant_of(np.stack([triangle, triangle + 5, triangle + [0.1, 0, 0]]))
    assert cluster(plant, "kmeans", 2).tolist() == [0, 1, 0]


def test_unknown_method_names_the_choices() -> None:
    plant = plant_of(np.eye(3)[None])
    with pytest.raises(UsageError, match="kmeans"):
        cluster(plant, "k-means", 2)
    with pytest.raises(UsageError, match="at least 1"):
        cluster(plant, "kmeans", 0)
    with pytest.raises(UsageError, match="orientation weight"):
        ClusterOptions(orientation_weight=float("nan"))
