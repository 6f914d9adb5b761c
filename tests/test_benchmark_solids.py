"""The models of benchmarks/solids: closed pieces that look outward, about as many as asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vegtool.meshes.pieces import all_welded, pieces
from vegtool.plant import Plant

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"


@pytest.fixture(params=["figure", "airplane"])
def solid(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Plant:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import solids

    return getattr(solids, request.param)()


def test_pieces_are_closed_and_look_outward(solid: Plant) -> None:
    """Each directed edge once and its opposite once; and every piece has a positive volume."""
    surface = all_welded(solid)
    edges = np.concatenate([surface.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    edges = edges.astype(np.int64)
    there, back = (edges @ turned for turned in ([1 << 32, 1], [1, 1 << 32]))
    assert len(np.unique(there)) == len(there)
    np.testing.assert_array_equal(np.sort(there), np.sort(back))
    count, piece = pieces(surface.faces)
    a, b, c = (surface.positions[surface.faces[:, corner]] for corner in range(3))
    assert np.bincount(piece, np.einsum("fi,fi->f", a, np.cross(b, c)), count).min() > 0


def test_sizes(solid: Plant) -> None:
    assert abs(len(solid.faces) / {"figure": 1000, "airplane": 3000}[solid.name] - 1) < 0.05
    assert all(material.alpha_mode == "opaque" for material in solid.materials)
    assert solid.bounds[0, 1] == 0.0


def test_normals_are_smooth_between_creases(solid: Plant) -> None:
    """Most corners have another normal than their face; none looks the other way."""
    facing = np.einsum(
        "fci,fi->fc", solid.normals[solid.faces], solid.face_area_vectors
    ) / np.linalg.norm(solid.face_area_vectors, axis=1, keepdims=True)
    assert facing.min() > 0.3
    assert (facing < 0.9999).mean() > 0.5
