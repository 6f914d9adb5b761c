"""The statue is a closed solid, the height field is one height per place."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.growth import sample


@pytest.mark.parametrize("triangles", [100, 1_000, None])
def test_statue_is_closed(triangles: int | None) -> None:
    """Each directed edge once and its opposite once: closed, and turned the same way all over."""
    plant = sample("statue", triangles)
    edges = np.concatenate([plant.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    there = edges[:, 0].astype(np.int64) * len(plant.positions) + edges[:, 1]
    back = edges[:, 1].astype(np.int64) * len(plant.positions) + edges[:, 0]
    assert len(np.unique(there)) == len(there)
    np.testing.assert_array_equal(np.sort(there), np.sort(back))
    # As many holes as a sphere: vertices - edges + faces = 2.
    assert len(plant.positions) - len(there) // 2 + len(plant.faces) == 2


def test_statue_is_turned_outward() -> None:
    """The volume that its faces enclose is positive, about that of its outline."""
    plant = sample("statue")
    volume = np.einsum("fi,fi->", plant.face_area_vectors, plant.face_centroids) / 3
    assert 0.2 < volume < 0.6


def test_height_field_faces_upward_over_the_whole_patch() -> None:
    plant = sample("height-field")
    up = plant.face_area_vectors[:, 1]
    assert (up > 0).all()
    assert up.sum() == pytest.approx(200.0 * 200.0)
