from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from surfaces import plant_from, together

from vegtool.baselines.crossed import TEXELS, crossed
from vegtool.plant import Material, Plant


def box(low: list[float], high: list[float]) -> Plant:
    """A closed box of twelve triangles."""
    corner = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, -1).T
    quads = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    points = np.array(low) + corner * (np.array(high) - low)
    return plant_from(points, faces, materials=[Material("bark")])


@pytest.mark.gl
def test_a_box_of_known_shape() -> None:
    level = crossed(box([-1, 0, -0.5], [1, 4, 0.5]))
    b, atlas = level.billboards, level.atlas
    assert b is not None and atlas is not None
    np.testing.assert_allclose(np.abs(b.normal), [[0, 0, 1], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(b.half_size, [[1, 2], [0.5, 2]])
    np.testing.assert_allclose(b.center, [[0, 2, 0], [0, 2, 0]], atol=1e-12)
    assert level.triangles in (4, 8)
    assert level.texels_per_metre == TEXELS / 4
    for (x, y, width, height), expected in zip(atlas.front, [128, 64], strict=True):
        assert (width, height) == (expected, TEXELS)
        assert (atlas.color[y : y + height, x : x + width, 3] == 255).all()


@pytest.mark.gl
def test_planes_cross_in_the_surfaces_mean() -> None:
    """A trunk of four times the side area of a branch: the planes go through near the trunk."""
    plant = together(box([0, 0, 0], [0.2, 4, 0.2]), box([0.2, 3, 0.1], [2.2, 3.1, 0.2]))
    b = crossed(plant).billboards
    assert b is not None
    mean = np.average(plant.face_centroids, axis=0, weights=plant.face_areas)
    assert b.center[1, 0] == pytest.approx(mean[0]) and mean[0] < 0.6
    assert b.center[0, 2] == pytest.approx(mean[2])
    np.testing.assert_allclose(b.center[0, :2], plant.center[:2])


@pytest.mark.gl
def test_flat_and_moved_plants() -> None:
    """A plant without depth still has two planes; all is relative to the plant."""
    corners = np.array([[-1, 0, 0], [1, 0, 0], [0, 2, 0]], float)
    leaf = [Material("leaf", role="leaf", double_sided=True)]
    flat = plant_from(corners, [[0, 1, 2]], materials=leaf)
    level = crossed(flat)
    assert level.billboards is not None
    assert (level.billboards.half_size > 0).all()
    moved = crossed(replace(flat, positions=corners + np.array([1e6, 0, -1e6])))
    assert moved.atlas is not None and level.atlas is not None
    np.testing.assert_array_equal(moved.atlas.color, level.atlas.color)
